//! The tree that rays walk through: nodes of eight children and blocks of triangles.

/// Children of a node.
pub(super) const WIDTH: usize = 8;
/// Triangles of a block.
pub(super) const LANES: usize = 8;
/// Marks a child that is a block; the other 31 bits are its number.
pub(super) const BLOCK: u32 = 1 << 31;
/// Depth above which a tree is not walked; the walk's stack holds seven entries a level.
pub(super) const DEPTH_MAX: usize = 36;
/// Entries the stack of a walk needs: each level leaves at most seven behind, the last eight.
pub(super) const STACK_SIZE: usize = (WIDTH - 1) * DEPTH_MAX + 1;

/// The boxes of eight children, coordinate by coordinate.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(super) struct WideNode {
    /// `planes[axis]` holds the lower, `planes[3 + axis]` the upper coordinates. The box of a missing child is
    /// inverted, from plus to minus infinity: no ray of ordinary numbers meets it.
    pub planes: [[f32; WIDTH]; 6],
    /// Number of each child's node, or [`BLOCK`] and the number of its block; for a missing child the first block.
    pub children: [u32; WIDTH],
}

/// Up to eight triangles between up to eight points, coordinate by coordinate.
///
/// Neighbours in a mesh share most of their corners: a block is half as large as with three corners a triangle, and a
/// ray moves each point into its frame once.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(super) struct TriangleBlock {
    /// `points[axis]`.
    pub points: [[f32; LANES]; 3],
    /// The three corners of each triangle, by their places among the points: first corner in bits 0 to 2, second in 3
    /// to 5, third in 6 to 8. The corners of a missing triangle are one point, which no ray meets.
    pub corners: [u16; LANES],
}

impl WideNode {
    /// A node without children.
    pub const EMPTY: WideNode = WideNode {
        planes: [
            [f32::INFINITY; WIDTH],
            [f32::INFINITY; WIDTH],
            [f32::INFINITY; WIDTH],
            [f32::NEG_INFINITY; WIDTH],
            [f32::NEG_INFINITY; WIDTH],
            [f32::NEG_INFINITY; WIDTH],
        ],
        children: [BLOCK; WIDTH],
    };
}

impl TriangleBlock {
    /// A block without triangles.
    pub const EMPTY: TriangleBlock = TriangleBlock { points: [[0.0; LANES]; 3], corners: [0; LANES] };
}

/// The tree that rays walk through; node 0 is the root.
#[derive(Clone, Debug)]
pub(super) struct WideTree {
    /// The nodes.
    pub nodes: Vec<WideNode>,
    /// The leaves. The first holds no triangle.
    pub blocks: Vec<TriangleBlock>,
    /// Indices of each block's triangles in the list the hierarchy is built from; they are read for hits only.
    pub triangles: Vec<[u32; LANES]>,
    /// Nodes on the longest way down.
    pub depth: usize,
}

impl WideTree {
    /// Size in memory, in bytes.
    pub fn memory_bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice())
            + size_of_val(self.blocks.as_slice())
            + size_of_val(self.triangles.as_slice())
    }
}
