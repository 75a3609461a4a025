//! The walk through the tree in portable Rust.
//!
//! It is written lane by lane, so that a compiler may turn it into what vectors the machine has. `vector` does the
//! same sums in the same order; where the order of operands decides what becomes of a NaN, it is that of the AVX
//! instructions.

use super::Hit;
use super::query::Query;
use super::wide::{BLOCK, LANES, STACK_SIZE, TriangleBlock, WIDTH, WideNode, WideTree};

/// The best hit so far: the end of the ray to begin with.
#[derive(Clone, Copy, Debug)]
pub(super) struct Best {
    /// Where it is on the ray.
    pub t: f32,
    triangle: u32,
    u: f32,
    v: f32,
}

impl Best {
    /// No hit yet. No triangle has an index below 0: a hit at the end of the ray itself is none.
    #[inline(always)]
    pub fn end_of(query: &Query) -> Best {
        Best { t: query.t_max, triangle: 0, u: 0.0, v: 0.0 }
    }

    /// Takes a hit that is nearer, or as near and of a lower triangle; whether it was taken. The weights of the second
    /// and third corner are `b / sum` and `c / sum`.
    #[inline(always)]
    pub fn update(&mut self, t: f32, triangle: u32, b: f32, c: f32, sum: f32) -> bool {
        let is_better = t < self.t || (t == self.t && triangle < self.triangle);
        if is_better {
            *self = Best { t, triangle, u: b / sum, v: c / sum };
        }
        is_better
    }
}

impl From<Best> for Hit {
    fn from(best: Best) -> Hit {
        Hit { t: best.t, triangle: best.triangle, u: best.u, v: best.v }
    }
}

/// The nearest hit; among hits at the same `t` that of the lowest triangle.
pub(super) fn closest_hit(tree: &WideTree, query: &Query) -> Option<Hit> {
    let mut best = Best::end_of(query);
    let mut found = false;
    // Entry distance in the upper half, reference in the lower: the order of keys is that of distances.
    let mut stack = [0u64; STACK_SIZE];
    let mut height = 1;
    while height > 0 {
        height -= 1;
        let (entry, reference) = (f32::from_bits((stack[height] >> 32) as u32), stack[height] as u32);
        if entry > best.t {
            continue;
        }
        if reference & BLOCK != 0 {
            found |= test_block(&tree.blocks[(reference & !BLOCK) as usize], query, &mut best);
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
    found.then_some(best.into())
}

/// Whether there is any hit.
pub(super) fn is_occluded(tree: &WideTree, query: &Query) -> bool {
    let mut stack = [0u32; STACK_SIZE];
    let mut height = 1;
    while height > 0 {
        height -= 1;
        let reference = stack[height];
        if reference & BLOCK != 0 {
            if test_block(&tree.blocks[(reference & !BLOCK) as usize], query, &mut Best::end_of(query)) {
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

/// The smaller number; the second where one is a NaN.
#[inline(always)]
fn smaller(one: f32, other: f32) -> f32 {
    if one < other { one } else { other }
}

/// The larger number; the second where one is a NaN.
#[inline(always)]
fn larger(one: f32, other: f32) -> f32 {
    if one > other { one } else { other }
}

/// Where the ray enters each child's box, NaN where it does not meet it within `(0, t_max)`.
///
/// A ray that lies in a plane of a box has `0 * infinity`, a NaN, for it; the plane is then passed over.
#[inline(always)]
fn test_node(node: &WideNode, query: &Query, t_max: f32) -> [f32; WIDTH] {
    let mut entry = [0.0f32; WIDTH];
    let mut exit = [t_max; WIDTH];
    for axis in 0..3 {
        let entry_planes = &node.planes[query.entry_row[axis]];
        let exit_planes = &node.planes[query.exit_row[axis]];
        for slot in 0..WIDTH {
            entry[slot] = larger((entry_planes[slot] - query.origin_entry[axis]) * query.inverse[axis], entry[slot]);
            exit[slot] = smaller((exit_planes[slot] - query.origin_exit[axis]) * query.inverse[axis], exit[slot]);
        }
    }
    std::array::from_fn(|slot| if entry[slot] <= exit[slot] { entry[slot] } else { f32::NAN })
}

/// Tests a block of triangles and keeps the best hit; whether there was a better one.
///
/// Woop, Benthin and Wald 2013 ("Watertight ray/triangle intersection"). An edge function here has the right sign or is
/// zero, because rounding is monotone: `a > b` never becomes `round(a) < round(b)`. Zero counts as inside for both
/// triangles of an edge, so that no ray passes between them. This asks for products rounded one by one: a fused
/// multiply and add would round one only and break it.
#[inline(always)]
fn test_block(block: &TriangleBlock, query: &Query, best: &mut Best) -> bool {
    let [x, y, z] = query.axes;
    let mut found = false;
    for lane in 0..LANES {
        let corner = |corner: usize| {
            let corner = &block.corners[corner];
            let height = corner[z][lane] - query.origin[z];
            let along = corner[x][lane] - query.origin[x] - query.shear[0] * height;
            let across = corner[y][lane] - query.origin[y] - query.shear[1] * height;
            [along, across, height]
        };
        let [ax, ay, az] = corner(0);
        let [bx, by, bz] = corner(1);
        let [cx, cy, cz] = corner(2);
        let a = cx * by - cy * bx;
        let b = ax * cy - ay * cx;
        let c = bx * ay - by * ax;
        let sum = a + b + c;
        let t = (a * az + b * bz + c * cz) * query.shear[2] / sum;
        let is_inside = (a >= 0.0 && b >= 0.0 && c >= 0.0) || (a <= 0.0 && b <= 0.0 && c <= 0.0);
        // Where the sum is zero, all three are, and `t` is a NaN.
        if is_inside && t > 0.0 {
            found |= best.update(t, block.triangles[lane], b, c, sum);
        }
    }
    found
}
