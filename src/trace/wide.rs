//! Nodes of eight children and blocks of triangles, and how the binary tree becomes them.

use super::binary::{self, BinaryTree, Content};
use super::prepare::{Prepared, PreparedTriangle};

/// Children of a node.
pub(super) const WIDTH: usize = 8;
/// Triangles of a block.
pub(super) const LANES: usize = 8;
/// Marks a child that is a block; the other 31 bits are its number.
pub(super) const BLOCK: u32 = 1 << 31;
/// Depth above which a tree is not walked; the walk's stack holds seven entries a level.
const DEPTH_MAX: usize = 36;
/// Entries the stack of a walk needs: each level leaves at most seven behind, the last eight.
pub(super) const STACK_SIZE: usize = (WIDTH - 1) * DEPTH_MAX + 1;

/// Cost of testing the eight boxes of a node, relative to [`BLOCK_COST`].
const NODE_COST: f64 = 1.0;
/// Cost of testing a block of triangles.
const BLOCK_COST: f64 = 1.0;

/// The boxes of eight children, coordinate by coordinate.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(super) struct WideNode {
    /// `planes[axis]` holds the lower, `planes[3 + axis]` the upper coordinates. The box of a missing child is
    /// inverted, from plus to minus infinity: no ray meets it.
    pub planes: [[f32; WIDTH]; 6],
    /// Number of each child's node, or [`BLOCK`] and the number of its block.
    pub children: [u32; WIDTH],
}

/// The corners of some triangles, coordinate by coordinate.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(super) struct TriangleBlock {
    /// `corners[corner][axis]`; the corners of a missing triangle are one point, which no ray meets.
    pub corners: [[[f32; LANES]; 3]; 3],
    /// Index of each triangle in the list the hierarchy is built from.
    pub triangles: [u32; LANES],
}

/// The tree that rays walk through; node 0 is the root.
#[derive(Clone, Debug)]
pub(super) struct WideTree {
    /// The nodes.
    pub nodes: Vec<WideNode>,
    /// The leaves.
    pub blocks: Vec<TriangleBlock>,
    /// Nodes on the longest way down.
    pub depth: usize,
}

impl WideTree {
    /// Size in memory, in bytes.
    pub fn memory_bytes(&self) -> usize {
        self.nodes.capacity() * size_of::<WideNode>() + self.blocks.capacity() * size_of::<TriangleBlock>()
    }
}

/// Builds the tree.
pub(super) fn build(prepared: &Prepared) -> WideTree {
    let tree = collapse(prepared, &binary::by_surface_area(prepared));
    if tree.depth <= DEPTH_MAX { tree } else { collapse(prepared, &binary::balanced(prepared)) }
}

/// What becomes of a binary subtree at least cost, after Ylitie, Karras and Laine 2017, section 3.1.
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

fn plan(tree: &BinaryTree) -> Vec<Plan> {
    let empty = Plan { cost: [0.0; WIDTH - 1], left: [0; WIDTH], triangles: 0, is_block: true };
    let mut plans = vec![empty; tree.nodes.len()];
    for place in (0..tree.nodes.len()).rev() {
        let area = tree.nodes[place].half_area();
        plans[place] = match tree.nodes[place].content() {
            Content::Triangle(_) => {
                Plan { cost: [area * BLOCK_COST; WIDTH - 1], left: [0; WIDTH], triangles: 1, is_block: true }
            }
            Content::Children([left, right]) => join(area, &plans[left as usize], &plans[right as usize]),
        };
    }
    plans
}

fn join(area: f64, left: &Plan, right: &Plan) -> Plan {
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
    if triangles as usize <= LANES && block_cost <= plan.cost[0] {
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

fn collapse(prepared: &Prepared, tree: &BinaryTree) -> WideTree {
    let plans = plan(tree);
    let mut wide = WideTree { nodes: vec![EMPTY_NODE], blocks: Vec::new(), depth: 1 };
    // (binary node, wide node, depth); a stack, so that what lies close together is stored close together.
    let mut waiting = vec![(0u32, 0u32, 1)];
    while let Some((source, target, depth)) = waiting.pop() {
        wide.depth = wide.depth.max(depth);
        let children = children_of(tree, &plans, source);
        let first_new = waiting.len();
        for (slot, &child) in children.iter().enumerate() {
            let reference = if plans[child as usize].is_block {
                wide.blocks.push(block_of(prepared, tree, child));
                BLOCK | (wide.blocks.len() - 1) as u32
            } else {
                wide.nodes.push(EMPTY_NODE);
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

/// All triangles below a binary node, as a block in the order of their indices.
fn block_of(prepared: &Prepared, tree: &BinaryTree, source: u32) -> TriangleBlock {
    let mut members: Vec<&PreparedTriangle> = Vec::with_capacity(LANES);
    let mut parts = vec![source];
    while let Some(node) = parts.pop() {
        match tree.nodes[node as usize].content() {
            Content::Triangle(triangle) => members.push(&prepared.triangles[triangle as usize]),
            Content::Children(children) => parts.extend(children),
        }
    }
    members.sort_unstable_by_key(|member| member.index);
    let mut block = TriangleBlock { corners: [[[0.0; LANES]; 3]; 3], triangles: [u32::MAX; LANES] };
    for (lane, member) in members.iter().enumerate() {
        block.triangles[lane] = member.index;
        for (corner, position) in member.corners.iter().enumerate() {
            for axis in 0..3 {
                block.corners[corner][axis][lane] = position[axis];
            }
        }
    }
    block
}

const EMPTY_NODE: WideNode = WideNode {
    planes: [
        [f32::INFINITY; WIDTH],
        [f32::INFINITY; WIDTH],
        [f32::INFINITY; WIDTH],
        [f32::NEG_INFINITY; WIDTH],
        [f32::NEG_INFINITY; WIDTH],
        [f32::NEG_INFINITY; WIDTH],
    ],
    children: [0; WIDTH],
};
