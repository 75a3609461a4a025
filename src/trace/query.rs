//! What one ray needs over and over on its walk.

use super::Ray;

/// A ray made ready for the walk.
#[derive(Clone, Copy, Debug)]
pub(super) struct Query {
    /// Start of the ray.
    pub origin: [f32; 3],
    /// One over each component of the direction.
    pub inverse: [f32; 3],
    /// A plane at `p` across an axis is met at `p * inverse + offset`. Where the ray enters a box, the plane is first
    /// moved towards the ray's start by the padding.
    pub entry_offset: [f32; 3],
    /// The same where the ray leaves a box; the plane is first moved away by the padding.
    pub exit_offset: [f32; 3],
    /// Which row of a node's planes the ray enters through, axis by axis.
    pub entry_row: [usize; 3],
    /// Which row of a node's planes the ray leaves through, axis by axis.
    pub exit_row: [usize; 3],
    /// Axes in the order of the sheared frame: the third is the one of the direction's largest component.
    pub axes: [usize; 3],
    /// Shear that turns the direction onto the third axis, and the scale that makes it one long.
    pub shear: [f32; 3],
    /// Where the ray ends.
    pub t_max: f32,
}

/// Components of the direction below this fraction of the largest one are raised to it, so that no inverse is infinite.
/// Over the whole scene that moves a ray by less than the padding of the boxes.
const LEAST_COMPONENT: f32 = 1.0 / (1u64 << 40) as f32;
/// Up to this multiple of the scene's largest coordinate, all origins share one padding.
pub(super) const NEAR: f32 = 4.0;

/// By how much boxes are padded, for a ray that starts at coordinates of at most `farthest`.
///
/// Ize 2013 ("Robust BVH ray traversal") pads by a factor on `t`. Here the padding is a length, because the triangle
/// test subtracts the origin from the corners and shears them, which moves them sideways by some units in the last
/// place of their distance: a ray that meets the triangle so moved may pass its box by that length, whatever its angle
/// to the side of the box. The sums of the box test itself err by about as much.
#[inline]
pub(super) fn padding(farthest: f32, largest_coordinate: f32) -> f32 {
    (largest_coordinate + farthest.max(NEAR * largest_coordinate)) * (4.0 * f32::EPSILON)
}

impl Query {
    /// Prepares a ray for a scene of this largest coordinate; `None` when it is no ray.
    pub fn new(ray: &Ray, largest_coordinate: f32) -> Option<Query> {
        let (origin, direction) = (ray.origin.to_array(), ray.direction.to_array());
        let length = ray.direction.abs().max_element();
        let is_ray = ray.origin.is_finite() && ray.direction.is_finite() && length > 0.0 && ray.t_max > 0.0;
        if !is_ray {
            return None;
        }
        let least = length * LEAST_COMPONENT;
        let inverse = direction.map(|component| component.abs().max(least).copysign(component).recip());
        let is_negative = direction.map(|component| usize::from(component.is_sign_negative()));
        let padding = padding(ray.origin.abs().max_element(), largest_coordinate);
        let towards_entry = direction.map(|component| padding.copysign(component));
        // Shear constants of Woop, Benthin and Wald 2013 ("Watertight ray/triangle intersection"), section 3.
        let last = ray.direction.abs().max_position();
        let axes = [(last + 1) % 3, (last + 2) % 3, last];
        Some(Query {
            origin,
            inverse,
            entry_offset: [0, 1, 2].map(|axis| -(origin[axis] + towards_entry[axis]) * inverse[axis]),
            exit_offset: [0, 1, 2].map(|axis| -(origin[axis] - towards_entry[axis]) * inverse[axis]),
            entry_row: [0, 1, 2].map(|axis| axis + 3 * is_negative[axis]),
            exit_row: [0, 1, 2].map(|axis| axis + 3 - 3 * is_negative[axis]),
            axes,
            shear: [direction[axes[0]] * inverse[last], direction[axes[1]] * inverse[last], inverse[last]],
            t_max: ray.t_max,
        })
    }
}
