//! What one ray needs over and over on its walk.

use super::Ray;
use glam::Vec3;

/// A ray made ready for the walk.
#[derive(Clone, Copy, Debug)]
pub(super) struct Query {
    /// Start of the ray.
    pub origin: [f32; 3],
    /// One over each component of the direction; infinite, with its sign, for a component of zero.
    pub inverse: [f32; 3],
    /// Origin for the plane where the ray enters a box and the one where it leaves: moved towards the plane along
    /// each axis by [`Query::new`]'s padding.
    pub origin_entry: [f32; 3],
    /// See [`Query::origin_entry`].
    pub origin_exit: [f32; 3],
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

impl Query {
    /// Prepares a ray for a scene within `bounds`; `None` when it is no ray.
    ///
    /// The boxes are padded, as Ize 2013 ("Robust BVH ray traversal") asks, but by a length in place of a relative
    /// `t`: the triangle test subtracts the origin from the corners and shears them, which moves them sideways by some
    /// units in the last place of their distance. A ray that meets the triangle so moved may pass its box by the
    /// same length, whatever its angle to that side of the box.
    pub fn new(ray: &Ray, bounds: (Vec3, Vec3)) -> Option<Query> {
        let usable = ray.origin.is_finite() && ray.direction.is_finite() && ray.direction != Vec3::ZERO;
        if !usable || ray.t_max.is_nan() || ray.t_max <= 0.0 {
            return None;
        }
        let reach = (bounds.0 - ray.origin).abs().max((bounds.1 - ray.origin).abs()).max_element();
        let padding = reach * (4.0 * f32::EPSILON);
        let origin = ray.origin.to_array();
        let direction = ray.direction.to_array();
        let mut query = Query {
            origin,
            inverse: direction.map(f32::recip),
            origin_entry: origin,
            origin_exit: origin,
            entry_row: [0, 1, 2],
            exit_row: [3, 4, 5],
            axes: [0; 3],
            shear: [0.0; 3],
            t_max: ray.t_max,
        };
        for axis in 0..3 {
            let is_negative = direction[axis].is_sign_negative();
            if is_negative {
                (query.entry_row[axis], query.exit_row[axis]) = (3 + axis, axis);
            }
            let towards_entry = if is_negative { -padding } else { padding };
            query.origin_entry[axis] = origin[axis] + towards_entry;
            query.origin_exit[axis] = origin[axis] - towards_entry;
        }
        // Shear constants of Woop, Benthin and Wald 2013 ("Watertight ray/triangle intersection"), section 3.
        let last = ray.direction.abs().max_position();
        query.axes = [(last + 1) % 3, (last + 2) % 3, last];
        query.shear = [
            direction[query.axes[0]] / direction[last],
            direction[query.axes[1]] / direction[last],
            1.0 / direction[last],
        ];
        Some(query)
    }
}
