//! The walk through the tree in portable Rust.
//!
//! It is written lane by lane, so that a compiler may turn it into what vectors the machine has. `vector` does the same;
//! the triangle test is the same sums in the same order in both, so that they give the same bits.

use super::Hit;
use super::query::Query;
use super::wide::{BLOCK, LANES, STACK_SIZE, WIDTH, WideNode, WideTree};

/// The best hit so far: the end of the ray to begin with.
#[derive(Clone, Copy, Debug)]
pub(super) struct Best {
    /// Where it is on the ray.
    pub t: f32,
    /// Number of the block and lane in it.
    place: Option<(u32, u32)>,
    u: f32,
    v: f32,
}

impl Best {
    /// No hit yet, on a ray that ends here.
    #[inline]
    pub fn end_of_ray(t_max: f32) -> Best {
        Best { t: t_max, place: None, u: 0.0, v: 0.0 }
    }

    /// Takes a hit that is nearer, or as near and of a lower triangle. The weights of the second and third corner are
    /// `b / sum` and `c / sum`.
    #[inline]
    pub fn update(&mut self, tree: &WideTree, block: u32, lane: u32, [t, b, c, sum]: [f32; 4]) {
        let index = |(block, lane): (u32, u32)| tree.triangles[block as usize][lane as usize];
        let is_as_near_and_lower = t == self.t && self.place.is_some_and(|place| index((block, lane)) < index(place));
        if t < self.t || is_as_near_and_lower {
            *self = Best { t, place: Some((block, lane)), u: b / sum, v: c / sum };
        }
    }

    /// The hit, if there is one.
    #[inline]
    pub fn hit(&self, tree: &WideTree) -> Option<Hit> {
        let (block, lane) = self.place?;
        let triangle = tree.triangles[block as usize][lane as usize];
        Some(Hit { t: self.t, triangle, u: self.u, v: self.v })
    }
}

/// The nearest hit; among hits at the same `t` that of the lowest triangle.
pub(super) fn closest_hit(tree: &WideTree, query: &Query) -> Option<Hit> {
    let mut best = Best::end_of_ray(query.t_max);
    // Entry distance in the upper half, reference in the lower: as distances are not negative, keys sort like them.
    let mut stack = [0u64; STACK_SIZE];
    let mut height = 1;
    while height > 0 {
        height -= 1;
        let (entry, reference) = (f32::from_bits((stack[height] >> 32) as u32), stack[height] as u32);
        if entry > best.t {
            continue;
        }
        if reference & BLOCK != 0 {
            test_block(tree, reference & !BLOCK, query, &mut best);
            continue;
        }
        let node = &tree.nodes[reference as usize];
        let entries = test_node(node, query, best.t);
        // Farthest first onto the stack.
        let base = height;
        for (&entry, &child) in entries.iter().zip(&node.children).filter(|(entry, _)| !entry.is_nan()) {
            let key = u64::from(entry.to_bits()) << 32 | u64::from(child);
            let mut place = height;
            while place > base && stack[place - 1] < key {
                stack[place] = stack[place - 1];
                place -= 1;
            }
            stack[place] = key;
            height += 1;
        }
    }
    best.hit(tree)
}

/// Whether there is any hit.
pub(super) fn is_occluded(tree: &WideTree, query: &Query) -> bool {
    let mut stack = [0u32; STACK_SIZE];
    let mut height = 1;
    while height > 0 {
        height -= 1;
        let reference = stack[height];
        if reference & BLOCK != 0 {
            let mut best = Best::end_of_ray(query.t_max);
            test_block(tree, reference & !BLOCK, query, &mut best);
            if best.place.is_some() {
                return true;
            }
            continue;
        }
        let node = &tree.nodes[reference as usize];
        for (&entry, &child) in test_node(node, query, query.t_max).iter().zip(&node.children) {
            if !entry.is_nan() {
                stack[height] = child;
                height += 1;
            }
        }
    }
    false
}

/// Where the ray enters each child's box, NaN where it does not meet it within `(0, t_max)`.
///
/// Numbers so large that a plane is at infinity minus infinity give a NaN here; `f32::max` and `f32::min` pass it over,
/// and the box counts as met.
#[inline]
fn test_node(node: &WideNode, query: &Query, t_max: f32) -> [f32; WIDTH] {
    let mut entry = [0.0f32; WIDTH];
    let mut exit = [t_max; WIDTH];
    for axis in 0..3 {
        let entry_planes = &node.planes[query.entry_row[axis]];
        let exit_planes = &node.planes[query.exit_row[axis]];
        for slot in 0..WIDTH {
            entry[slot] = entry[slot].max(entry_planes[slot] * query.inverse[axis] + query.entry_offset[axis]);
            exit[slot] = exit[slot].min(exit_planes[slot] * query.inverse[axis] + query.exit_offset[axis]);
        }
    }
    std::array::from_fn(|slot| if entry[slot] <= exit[slot] { entry[slot] } else { f32::NAN })
}

/// Tests a block of triangles and keeps the best hit.
///
/// Woop, Benthin and Wald 2013 ("Watertight ray/triangle intersection"). An edge function here has the right sign or is
/// zero, because rounding is monotone: `a > b` never becomes `round(a) < round(b)`. Zero counts as inside for both
/// triangles of an edge, so that no ray passes between them. This asks for products rounded one by one: a fused
/// multiply and add would round one only and break it. `t` is an average of the corners' with weights of one sign, so
/// that it lies between them however thin the triangle is.
#[inline]
fn test_block(tree: &WideTree, number: u32, query: &Query, best: &mut Best) {
    let block = &tree.blocks[number as usize];
    let [x, y, z] = query.axes;
    let height: [f32; LANES] = std::array::from_fn(|place| block.points[z][place] - query.origin[z]);
    let moved = |axis: usize, shear: f32| -> [f32; LANES] {
        std::array::from_fn(|place| block.points[axis][place] - query.origin[axis] - shear * height[place])
    };
    let (along, across) = (moved(x, query.shear[0]), moved(y, query.shear[1]));
    for lane in 0..LANES {
        let corner = |corner: usize| {
            let place = usize::from(block.corners[lane] >> (3 * corner)) % LANES;
            [along[place], across[place], height[place]]
        };
        let ([ax, ay, az], [bx, by, bz], [cx, cy, cz]) = (corner(0), corner(1), corner(2));
        // U = C_x B_y - C_y B_x, V = A_x C_y - A_y C_x, W = B_x A_y - B_y A_x
        let a = cx * by - cy * bx;
        let b = ax * cy - ay * cx;
        let c = bx * ay - by * ax;
        let is_inside = (a >= 0.0 && b >= 0.0 && c >= 0.0) || (a <= 0.0 && b <= 0.0 && c <= 0.0);
        if !is_inside {
            continue;
        }
        // T = S_z (U A_z + V B_z + W C_z) / (U + V + W); a NaN for a triangle seen from its edge.
        let sum = a + b + c;
        let t = (a * az + b * bz + c * cz) * query.shear[2] / sum;
        if t > 0.0 {
            best.update(tree, number, lane as u32, [t, b, c, sum]);
        }
    }
}
