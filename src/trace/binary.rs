//! The binary tree: one triangle a leaf, built by obvhs, or balanced where that would grow too deep.

use super::prepare::Prepared;
use crate::math::random::SequentialRandom;
use glam::{DVec3, Vec3};
use obvhs::aabb::Aabb;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};

/// Marks a leaf in [`BinaryNode::right`].
const LEAF: u32 = u32::MAX;

/// A node of the binary tree.
#[derive(Clone, Copy, Debug)]
pub(super) struct BinaryNode {
    /// Lower corner of its box.
    pub low: Vec3,
    /// Upper corner of its box.
    pub high: Vec3,
    /// First child; for a leaf its triangle.
    left: u32,
    /// Second child, or [`LEAF`].
    right: u32,
}

impl BinaryNode {
    /// The two children, or the triangle of a leaf, by its place in the prepared list.
    pub fn content(&self) -> Content {
        if self.right == LEAF { Content::Triangle(self.left) } else { Content::Children([self.left, self.right]) }
    }

    /// Half the surface of the box, in f64, where it neither under- nor overflows.
    pub fn half_area(&self) -> f64 {
        let size = self.high.as_dvec3() - self.low.as_dvec3();
        size.x * size.y + size.y * size.z + size.z * size.x
    }
}

/// What a node holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Content {
    /// Two nodes further on in the list.
    Children([u32; 2]),
    /// One triangle, by its place in the prepared list.
    Triangle(u32),
}

/// A binary tree: the root first, every node before its children.
#[derive(Clone, Debug)]
pub(super) struct BinaryTree {
    /// The nodes.
    pub nodes: Vec<BinaryNode>,
}

/// Share of the nodes that obvhs tries elsewhere. With all of them rays are a tenth faster than with a seventh of them;
/// the build takes four times as long, some 5 microseconds a triangle, which a fit of a minute earns back.
const REINSERTED_SHARE: f32 = 1.0;

/// The tree that obvhs builds: neighbours on a space-filling curve joined from below, then made better by taking
/// subtrees out and inserting them elsewhere.
///
/// Meister and Bittner 2018, "Parallel locally-ordered clustering for bounding volume hierarchy construction" and
/// "Parallel reinsertion for bounding volume hierarchy optimization".
///
/// The builder sorts by a grid over the box around everything, in `f32`: a few triangles far from all others would leave
/// it one cell for the rest, and time in the square of their number. They make a tree of their own, beside it.
pub(super) fn by_surface_area(prepared: &Prepared) -> BinaryTree {
    let (middle, reach) = middle_and_reach(prepared);
    let is_far = |slot: &u32| {
        let (low, high) = prepared.triangles[*slot as usize].bounds();
        let offset = (low.as_dvec3() - middle).abs().max((high.as_dvec3() - middle).abs());
        offset.max_element() > FAR_REACHES * reach
    };
    let (mut far, mut near): (Vec<u32>, Vec<u32>) = (0..prepared.triangles.len() as u32).partition(is_far);
    if far.len() > near.len() {
        // Most of them are no exception.
        near.append(&mut far);
        near.sort_unstable();
    }
    let boxes = boxes_for_obvhs(prepared, &near, middle);
    let indices = (0..boxes.len() as u32).collect();
    let mut built = PlocBuilder::with_capacity(boxes.len()).build(
        PlocSearchDistance::Medium,
        &boxes,
        indices,
        SortPrecision::U64,
        3,
    );
    ReinsertionOptimizer::default().run(&mut built, REINSERTED_SHARE, None);
    let mut contents: Vec<Content> = built
        .nodes
        .iter()
        .map(|node| {
            if node.is_leaf() {
                // Places of the builder that hold no node look like leaves of nothing; nobody asks for them.
                let slot = built.primitive_indices.get(node.first_index as usize).copied().unwrap_or_default();
                Content::Triangle(near[slot as usize])
            } else {
                Content::Children([node.first_index, node.first_index + 1])
            }
        })
        .collect();
    if far.is_empty() {
        return from_topology(prepared, 0, |node| contents[node as usize]);
    }
    let first = contents.len() as u32;
    contents.extend(halves(prepared, far).into_iter().map(|content| match content {
        Content::Children([left, right]) => Content::Children([first + left, first + right]),
        triangle => triangle,
    }));
    contents.push(Content::Children([0, first]));
    from_topology(prepared, contents.len() as u32 - 1, |node| contents[node as usize])
}

/// Triangles that reach further out than so many times the reach of most have a tree of their own.
const FAR_REACHES: f64 = 256.0;

/// The median of the triangles' middles, and the median of how far they lie from it; the latter may be 0.
fn middle_and_reach(prepared: &Prepared) -> (DVec3, f64) {
    let middles: Vec<DVec3> = prepared
        .triangles
        .iter()
        .map(|triangle| {
            let (low, high) = triangle.bounds();
            0.5 * (low.as_dvec3() + high.as_dvec3())
        })
        .collect();
    let median = |mut values: Vec<f64>| {
        let half = values.len() / 2;
        *values.select_nth_unstable_by(half, f64::total_cmp).1
    };
    let middle = DVec3::from_array([0, 1, 2].map(|axis| median(middles.iter().map(|point| point[axis]).collect())));
    let reach = median(middles.iter().map(|point| (*point - middle).abs().max_element()).collect());
    // Where most triangles lie at one place, their own size is the measure.
    let own = median(
        prepared
            .triangles
            .iter()
            .map(|triangle| (triangle.bounds().1 - triangle.bounds().0).as_dvec3().max_element())
            .collect(),
    );
    (middle, reach.max(own))
}

/// Boxes of which obvhs reads only how they lie to each other.
///
/// They are scaled to about one around the middle of most, so that areas neither overflow nor vanish. Boxes that
/// coincide are moved apart a little: obvhs joins each box with the neighbour that suits it best, and where all suit
/// alike, only one pair a round is joined, which takes time in proportion to the square of their number and makes a
/// tree as deep as they are many.
fn boxes_for_obvhs(prepared: &Prepared, slots: &[u32], middle: DVec3) -> Vec<Aabb> {
    let largest = slots
        .iter()
        .map(|&slot| {
            let (low, high) = prepared.triangles[slot as usize].bounds();
            (low.as_dvec3() - middle).abs().max((high.as_dvec3() - middle).abs()).max_element()
        })
        .fold(0.0, f64::max);
    let scale = 1.0 / largest;
    let scaled = |point: Vec3| ((point.as_dvec3() - middle) * scale).as_vec3a();
    slots
        .iter()
        .map(|&slot| {
            let triangle = &prepared.triangles[slot as usize];
            let (low, high) = triangle.bounds();
            let (mut low, mut high) = (scaled(low), scaled(high));
            if triangle.box_copies > 0 {
                let mut random = SequentialRandom::new(u64::from(triangle.index));
                let mut number = || random.next_number() - 0.5;
                let shift = (high - low).max_element() * 0.01 * glam::Vec3A::new(number(), number(), number());
                (low, high) = (low + shift, high + shift);
            }
            Aabb { min: low, max: high }
        })
        .collect()
}

/// A balanced tree: halves along the longest side of the box around the triangles' middles. Its depth is the logarithm
/// of their number whatever they look like; it is slower to walk than [`by_surface_area`].
pub(super) fn balanced(prepared: &Prepared) -> BinaryTree {
    let contents = halves(prepared, (0..prepared.triangles.len() as u32).collect());
    from_topology(prepared, 0, |node| contents[node as usize])
}

/// The nodes of a balanced tree over some triangles, the root first.
fn halves(prepared: &Prepared, mut order: Vec<u32>) -> Vec<Content> {
    let middle = |slot: u32| {
        let (low, high) = prepared.triangles[slot as usize].bounds();
        0.5 * low + 0.5 * high
    };
    // Node k covers order[ranges[k]]; children are added behind, so the list is the topology.
    let mut ranges = vec![(0, order.len())];
    let mut contents = Vec::new();
    while contents.len() < ranges.len() {
        let (start, end) = ranges[contents.len()];
        if end - start == 1 {
            contents.push(Content::Triangle(order[start]));
            continue;
        }
        let part = &mut order[start..end];
        let (low, high) = part.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), &slot| {
            (low.min(middle(slot)), high.max(middle(slot)))
        });
        let axis = (0.5 * high - 0.5 * low).max_position();
        let half = part.len() / 2;
        part.select_nth_unstable_by(half, |&one, &other| {
            middle(one)[axis].total_cmp(&middle(other)[axis]).then(one.cmp(&other))
        });
        let first_child = ranges.len() as u32;
        ranges.push((start, start + half));
        ranges.push((start + half, end));
        contents.push(Content::Children([first_child, first_child + 1]));
    }
    contents
}

/// Lays the nodes out from the root on, with parents before children, and computes their boxes from the triangles alone.
fn from_topology(prepared: &Prepared, root: u32, content: impl Fn(u32) -> Content) -> BinaryTree {
    let mut nodes: Vec<BinaryNode> = Vec::with_capacity(2 * prepared.triangles.len());
    let mut sources = vec![root];
    while let Some(&source) = sources.get(nodes.len()) {
        let (left, right) = match content(source) {
            Content::Triangle(triangle) => (triangle, LEAF),
            Content::Children([left, right]) => {
                let place = sources.len() as u32;
                sources.extend([left, right]);
                (place, place + 1)
            }
        };
        nodes.push(BinaryNode { low: Vec3::ZERO, high: Vec3::ZERO, left, right });
    }
    for place in (0..nodes.len()).rev() {
        let (low, high) = match nodes[place].content() {
            Content::Triangle(triangle) => prepared.triangles[triangle as usize].bounds(),
            Content::Children([left, right]) => {
                let (left, right) = (&nodes[left as usize], &nodes[right as usize]);
                (left.low.min(right.low), left.high.max(right.high))
            }
        };
        (nodes[place].low, nodes[place].high) = (low, high);
    }
    BinaryTree { nodes }
}
