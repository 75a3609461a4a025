//! From the binary tree to the wide one.
//!
//! Which binary nodes become nodes, which become blocks and which vanish is chosen so that the expected cost of a
//! random ray is least, after Ylitie, Karras and Laine 2017 ("Efficient incoherent ray traversal on GPUs through
//! compressed wide BVHs"), section 3.1.

use super::binary::{self, BinaryTree, Content};
use super::prepare::{Prepared, PreparedTriangle};
use super::wide::{BLOCK, DEPTH_MAX, LANES, TriangleBlock, WIDTH, WideNode, WideTree};
use glam::Vec3;

/// Cost of testing the eight boxes of a node, relative to [`BLOCK_COST`].
const NODE_COST: f64 = 1.0;
/// Cost of testing a block of triangles.
const BLOCK_COST: f64 = 1.0;

/// Builds the tree.
pub(super) fn build(prepared: &Prepared) -> WideTree {
    let tree = collapse(prepared, &binary::by_surface_area(prepared));
    if tree.depth <= DEPTH_MAX { tree } else { collapse(prepared, &binary::balanced(prepared)) }
}

/// What becomes of a binary subtree at least cost.
#[derive(Clone, Copy)]
struct Plan {
    /// `cost[roots - 1]`: least expected cost of the subtree as a forest of at most so many children of one node.
    cost: [f64; WIDTH - 1],
    /// `left[roots - 1]`: how many of those the left part gets in a forest of so many; 0 when fewer are as good.
    left: [u8; WIDTH],
    /// Triangles in the subtree.
    triangles: u32,
    /// Whether the subtree, as one child, is a block.
    is_block: bool,
}

fn plan(prepared: &Prepared, tree: &BinaryTree) -> Vec<Plan> {
    let empty = Plan { cost: [0.0; WIDTH - 1], left: [0; WIDTH], triangles: 0, is_block: true };
    let mut plans = vec![empty; tree.nodes.len()];
    for place in (0..tree.nodes.len()).rev() {
        let area = tree.nodes[place].half_area();
        plans[place] = match tree.nodes[place].content() {
            Content::Triangle(_) => {
                Plan { cost: [area * BLOCK_COST; WIDTH - 1], left: [0; WIDTH], triangles: 1, is_block: true }
            }
            Content::Children([left, right]) => {
                let fits = |triangles: u32| triangles as usize <= LANES && fits_block(prepared, tree, place as u32);
                join(area, &plans[left as usize], &plans[right as usize], fits)
            }
        };
    }
    plans
}

fn join(area: f64, left: &Plan, right: &Plan, fits: impl Fn(u32) -> bool) -> Plan {
    // C_distribute(n, j) = min over 0 < k < j of C(left, k) + C(right, j - k)
    let distribute = |roots: usize| {
        let mut best = (f64::INFINITY, 1);
        for left_roots in 1..roots {
            let cost = left.cost[left_roots - 1] + right.cost[roots - left_roots - 1];
            if cost < best.0 {
                best = (cost, left_roots);
            }
        }
        best
    };
    let triangles = left.triangles + right.triangles;
    let mut plan = Plan { cost: [0.0; WIDTH - 1], left: [0; WIDTH], triangles, is_block: false };

    // C(n, 1) is a block, or a node with all its children.
    let (children_cost, children_left) = distribute(WIDTH);
    plan.left[WIDTH - 1] = children_left as u8;
    plan.cost[0] = children_cost + area * NODE_COST;
    let block_cost = area * BLOCK_COST;
    if block_cost <= plan.cost[0] && fits(triangles) {
        plan.cost[0] = block_cost;
        plan.is_block = true;
    }
    // C(n, i) = min(C_distribute(n, i), C(n, i - 1))
    for roots in 2..WIDTH {
        let (cost, left_roots) = distribute(roots);
        plan.cost[roots - 1] = plan.cost[roots - 2];
        if cost < plan.cost[roots - 2] {
            plan.cost[roots - 1] = cost;
            plan.left[roots - 1] = left_roots as u8;
        }
    }
    plan
}

/// The wide tree of least expected cost that the binary tree contains.
pub(super) fn collapse(prepared: &Prepared, tree: &BinaryTree) -> WideTree {
    let plans = plan(prepared, tree);
    let mut wide = WideTree {
        nodes: vec![WideNode::EMPTY],
        blocks: vec![TriangleBlock::EMPTY],
        triangles: vec![[u32::MAX; LANES]],
        depth: 1,
    };
    // (binary node, wide node, depth); a stack, so that what lies close together is stored close together.
    let mut waiting = vec![(0u32, 0u32, 1)];
    while let Some((source, target, depth)) = waiting.pop() {
        wide.depth = wide.depth.max(depth);
        let children = children_of(tree, &plans, source);
        let first_new = waiting.len();
        for (slot, &child) in children.iter().enumerate() {
            let reference = if plans[child as usize].is_block {
                let (block, triangles) = block_of(prepared, tree, child);
                wide.blocks.push(block);
                wide.triangles.push(triangles);
                BLOCK | (wide.blocks.len() - 1) as u32
            } else {
                wide.nodes.push(WideNode::EMPTY);
                let number = (wide.nodes.len() - 1) as u32;
                waiting.push((child, number, depth + 1));
                number
            };
            let (low, high) = (tree.nodes[child as usize].low, tree.nodes[child as usize].high);
            let node = &mut wide.nodes[target as usize];
            for axis in 0..3 {
                node.planes[axis][slot] = low[axis];
                node.planes[3 + axis][slot] = high[axis];
            }
            node.children[slot] = reference;
        }
        waiting[first_new..].reverse();
    }
    wide.nodes.shrink_to_fit();
    wide.blocks.shrink_to_fit();
    wide.triangles.shrink_to_fit();
    wide
}

/// The binary nodes that become the children of the wide node that `source` becomes.
fn children_of(tree: &BinaryTree, plans: &[Plan], source: u32) -> Vec<u32> {
    let mut children = Vec::with_capacity(WIDTH);
    let Content::Children([left, right]) = tree.nodes[source as usize].content() else {
        // The root of a mesh of one triangle.
        return vec![source];
    };
    if plans[source as usize].is_block {
        return vec![source];
    }
    let left_roots = usize::from(plans[source as usize].left[WIDTH - 1]);
    let mut parts = vec![(right, WIDTH - left_roots), (left, left_roots)];
    while let Some((node, mut roots)) = parts.pop() {
        let plan = &plans[node as usize];
        while roots > 1 && plan.left[roots - 1] == 0 {
            roots -= 1;
        }
        match tree.nodes[node as usize].content() {
            Content::Children([left, right]) if roots > 1 => {
                let left_roots = usize::from(plan.left[roots - 1]);
                parts.push((right, roots - left_roots));
                parts.push((left, left_roots));
            }
            _ => children.push(node),
        }
    }
    children
}

/// The triangles below a binary node, of which there are few, in the order of their indices.
fn members_of<'a>(prepared: &'a Prepared, tree: &BinaryTree, source: u32) -> Vec<&'a PreparedTriangle> {
    let mut members = Vec::with_capacity(LANES);
    let mut parts = vec![source];
    while let Some(node) = parts.pop() {
        match tree.nodes[node as usize].content() {
            Content::Triangle(triangle) => members.push(&prepared.triangles[triangle as usize]),
            Content::Children(children) => parts.extend(children),
        }
    }
    members.sort_unstable_by_key(|member| member.index);
    members
}

/// Whether the triangles below a binary node have at most as many different corners as a block has points.
fn fits_block(prepared: &Prepared, tree: &BinaryTree, source: u32) -> bool {
    let mut points: Vec<Vec3> = Vec::with_capacity(LANES);
    for corner in members_of(prepared, tree, source).iter().flat_map(|member| member.corners) {
        if !points.contains(&corner) {
            if points.len() == LANES {
                return false;
            }
            points.push(corner);
        }
    }
    true
}

/// All triangles below a binary node, as a block, and their indices.
fn block_of(prepared: &Prepared, tree: &BinaryTree, source: u32) -> (TriangleBlock, [u32; LANES]) {
    let mut block = TriangleBlock::EMPTY;
    let mut triangles = [u32::MAX; LANES];
    let mut points: Vec<Vec3> = Vec::with_capacity(LANES);
    for (lane, member) in members_of(prepared, tree, source).iter().enumerate() {
        triangles[lane] = member.index;
        for (corner, &position) in member.corners.iter().enumerate() {
            let known = points.iter().position(|&point| point == position);
            let place = known.unwrap_or_else(|| {
                points.push(position);
                points.len() - 1
            });
            block.corners[lane] |= (place as u16) << (3 * corner);
            for axis in 0..3 {
                block.points[axis][place] = position[axis];
            }
        }
    }
    (block, triangles)
}

#[cfg(test)]
mod tests {
    use super::super::{binary, plain, prepare, query::Query};
    use super::*;
    use crate::math::random::SequentialRandom;
    use crate::trace::Ray;

    fn point(random: &mut SequentialRandom) -> Vec3 {
        let mut number = || 2.0 * random.next_number() - 1.0;
        Vec3::new(number(), number(), number())
    }

    fn prepared_soup(count: usize, random: &mut SequentialRandom) -> Prepared {
        let mut positions = Vec::new();
        for _ in 0..count {
            let middle = point(random);
            positions.extend([0; 3].map(|_| middle + 0.1 * point(random)));
        }
        let triangles: Vec<[u32; 3]> =
            (0..count as u32).map(|index| [3 * index, 3 * index + 1, 3 * index + 2]).collect();
        prepare::prepare(&positions, &triangles).unwrap()
    }

    /// Checks that every triangle is in one block, within the boxes of all nodes above.
    fn check(prepared: &Prepared, wide: &WideTree) {
        let mut seen = vec![0; prepared.triangles.len()];
        let mut waiting = vec![(0, Vec3::NEG_INFINITY, Vec3::INFINITY)];
        while let Some((reference, low, high)) = waiting.pop() {
            if reference & BLOCK == 0 {
                let node = &wide.nodes[reference as usize];
                for slot in (0..WIDTH).filter(|&slot| node.planes[0][slot] <= node.planes[3][slot]) {
                    let corner = |first: usize| Vec3::from([0, 1, 2].map(|axis| node.planes[first + axis][slot]));
                    assert!(corner(0).cmpge(low).all() && corner(3).cmple(high).all());
                    waiting.push((node.children[slot], corner(0), corner(3)));
                }
                continue;
            }
            let number = (reference & !BLOCK) as usize;
            let block = &wide.blocks[number];
            for lane in (0..LANES).filter(|&lane| wide.triangles[number][lane] != u32::MAX) {
                let index = wide.triangles[number][lane];
                let slot = prepared.triangles.binary_search_by_key(&index, |triangle| triangle.index).unwrap();
                seen[slot] += 1;
                for (corner, position) in prepared.triangles[slot].corners.iter().enumerate() {
                    let place = usize::from(block.corners[lane] >> (3 * corner) & 7);
                    assert_eq!(*position, Vec3::from([0, 1, 2].map(|axis| block.points[axis][place])));
                    assert!(position.cmpge(low).all() && position.cmple(high).all());
                }
            }
        }
        assert!(seen.iter().all(|&count| count == 1));
    }

    #[test]
    fn every_triangle_is_in_one_block_within_all_boxes_above() {
        let mut random = SequentialRandom::new(1);
        for count in [1, 2, 3, 8, 9, 100, 3000] {
            let prepared = prepared_soup(count, &mut random);
            check(&prepared, &build(&prepared));
            check(&prepared, &collapse(&prepared, &binary::balanced(&prepared)));
        }
    }

    #[test]
    fn hits_do_not_depend_on_the_tree() {
        let mut random = SequentialRandom::new(2);
        let prepared = prepared_soup(2000, &mut random);
        let trees = [build(&prepared), collapse(&prepared, &binary::balanced(&prepared))];
        for _ in 0..5000 {
            let ray = Ray { origin: point(&mut random), direction: point(&mut random), t_max: f32::INFINITY };
            let query = Query::new(&ray, 1.1).unwrap();
            let [one, other] = trees.each_ref().map(|tree| plain::closest_hit(tree, &query));
            assert_eq!(one, other);
        }
    }

    #[test]
    fn boxes_that_coincide_make_no_deep_tree() {
        // Different triangles, all with the cube as their box.
        let mut random = SequentialRandom::new(3);
        let mut positions = Vec::new();
        for _ in 0..10_000 {
            let (a, b) = (random.next_number(), random.next_number());
            positions.extend([Vec3::ZERO, Vec3::ONE, Vec3::new(a, b, 0.5)]);
        }
        let triangles: Vec<[u32; 3]> = (0..10_000).map(|index| [3 * index, 3 * index + 1, 3 * index + 2]).collect();
        let prepared = prepare::prepare(&positions, &triangles).unwrap();
        let wide = collapse(&prepared, &binary::by_surface_area(&prepared));
        assert!(wide.depth <= 16, "{} levels", wide.depth);
        check(&prepared, &wide);
    }

    #[test]
    fn a_triangle_far_from_all_others_does_not_spoil_their_tree() {
        let mut random = SequentialRandom::new(4);
        let near = prepared_soup(20_000, &mut random);
        let mut positions: Vec<Vec3> = near.triangles.iter().flat_map(|triangle| triangle.corners).collect();
        positions.extend([Vec3::ZERO, Vec3::X, Vec3::splat(1e6)]);
        let triangles: Vec<[u32; 3]> = (0..20_001).map(|index| [3 * index, 3 * index + 1, 3 * index + 2]).collect();
        let spiked = prepare::prepare(&positions, &triangles).unwrap();
        let trees = [&near, &spiked].map(|prepared| collapse(prepared, &binary::by_surface_area(prepared)));
        check(&spiked, &trees[1]);
        // The tree of the others hangs below one more node.
        assert!(trees[1].depth <= trees[0].depth + 2, "{} and {} levels", trees[1].depth, trees[0].depth);
        assert!(trees[1].nodes.len() <= trees[0].nodes.len() + trees[0].nodes.len() / 50 + 2);
    }
}
