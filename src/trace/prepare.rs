//! Which triangles take part: their checks, and what is left out.

use crate::error::{Error, ErrorKind, Place, Result};
use crate::math::random::mix;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// A triangle that takes part.
#[derive(Clone, Copy, Debug)]
pub(super) struct PreparedTriangle {
    /// Its corners.
    pub corners: [Vec3; 3],
    /// Its index in the list the hierarchy is built from.
    pub index: u32,
    /// How many triangles before this one have the same box, none of them a copy of it; the order is that of their corners'
    /// bits.
    pub box_copies: u32,
}

impl PreparedTriangle {
    /// Lower and upper corner of the triangle's box.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let [a, b, c] = self.corners;
        (a.min(b).min(c), a.max(b).max(c))
    }
}

/// All triangles that take part, in the order of their indices; at least one.
#[derive(Clone, Debug)]
pub(super) struct Prepared {
    /// The triangles.
    pub triangles: Vec<PreparedTriangle>,
}

impl Prepared {
    /// Lower and upper corner of the box around everything.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        self.triangles.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), triangle| {
            let (triangle_low, triangle_high) = triangle.bounds();
            (low.min(triangle_low), high.max(triangle_high))
        })
    }
}

/// Checks all triangles and leaves out those without area and exact copies.
///
/// A builder that joins neighbours (obvhs) takes time and depth in proportion to the square of the number of boxes
/// that coincide; copies are found here by sorting.
pub(super) fn prepare(positions: &[Vec3], triangles: &[[u32; 3]]) -> Result<Prepared> {
    check(positions, triangles)?;
    let mut kept: Vec<PreparedTriangle> = triangles
        .iter()
        .enumerate()
        .map(|(index, triangle)| PreparedTriangle {
            // Adding zero turns -0 into +0, so that equal positions have equal bits.
            corners: triangle.map(|vertex| positions[vertex as usize] + Vec3::ZERO),
            index: index as u32,
            box_copies: 0,
        })
        .filter(has_area)
        .collect();
    leave_out_copies(&mut kept);
    if kept.is_empty() {
        return Err(Error::new(ErrorKind::InvalidScene, "the mesh has no triangle with an area")
            .remedy("check that the mesh file holds faces and that their corners differ"));
    }
    Ok(Prepared { triangles: kept })
}

fn check(positions: &[Vec3], triangles: &[[u32; 3]]) -> Result<()> {
    // Node and block numbers have 31 bits; there are no more of either than triangles and one.
    if triangles.len() >= 1 << 30 {
        return Err(Error::new(ErrorKind::TooLarge, format!("the mesh has {} triangles", triangles.len()))
            .remedy("use a mesh of fewer triangles"));
    }
    for (index, triangle) in triangles.iter().enumerate() {
        for &vertex in triangle {
            let Some(position) = positions.get(vertex as usize) else {
                let message = format!("a triangle names vertex {vertex} of {}", positions.len());
                return Err(Error::new(ErrorKind::InvalidScene, message)
                    .at(Place::Triangle(index))
                    .remedy("the mesh file is damaged: export it again"));
            };
            if !position.is_finite() {
                return Err(Error::new(ErrorKind::NonFinite, format!("vertex {vertex} is at {position}"))
                    .at(Place::Triangle(index))
                    .remedy("remove the vertex or export the mesh again"));
            }
        }
    }
    Ok(())
}

/// Whether the triangle's area is above zero; in f64, where the differences of f32 numbers neither under- nor overflow.
fn has_area(triangle: &PreparedTriangle) -> bool {
    let [a, b, c]: [DVec3; 3] = triangle.corners.map(Vec3::as_dvec3);
    (b - a).cross(c - a) != DVec3::ZERO
}

/// Leaves out triangles whose three corners are those of an earlier one, and counts boxes that coincide.
fn leave_out_copies(triangles: &mut Vec<PreparedTriangle>) {
    // Bring equal boxes next to each other; copies have equal boxes.
    let mut order: Vec<(u64, u32)> =
        triangles.par_iter().enumerate().map(|(slot, triangle)| (box_hash(triangle), slot as u32)).collect();
    order.par_sort_unstable();

    let mut is_copy = vec![false; triangles.len()];
    for run in order.chunk_by(|one, other| one.0 == other.0).filter(|run| run.len() > 1) {
        let mut corners: Vec<([[u32; 3]; 3], u32)> =
            run.iter().map(|&(_, slot)| (corner_bits(&triangles[slot as usize]), slot)).collect();
        corners.sort_unstable();
        let mut copies = 0;
        for (place, &(bits, slot)) in corners.iter().enumerate() {
            if place > 0 && corners[place - 1].0 == bits {
                is_copy[slot as usize] = true;
            } else {
                triangles[slot as usize].box_copies = copies;
                copies += 1;
            }
        }
    }
    let mut copies = is_copy.iter();
    triangles.retain(|_| copies.next() != Some(&true));
}

fn box_hash(triangle: &PreparedTriangle) -> u64 {
    let (low, high) = triangle.bounds();
    let pair = |a: f32, b: f32| u64::from(a.to_bits()) << 32 | u64::from(b.to_bits());
    mix(mix(mix(pair(low.x, low.y)) ^ pair(low.z, high.x)) ^ pair(high.y, high.z))
}

/// The bits of the three corners, in an order that depends on the positions alone.
fn corner_bits(triangle: &PreparedTriangle) -> [[u32; 3]; 3] {
    let mut bits = triangle.corners.map(|corner| corner.to_array().map(f32::to_bits));
    bits.sort_unstable();
    bits
}
