//! Rays and the bounding volume hierarchy.
//!
//! This folder knows positions and triangles, nothing of materials or scenes.

use glam::Vec3;

/// A ray: points `origin + t direction` for `t` in `(0, t_max)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Start, in world units.
    pub origin: Vec3,
    /// Direction, any length above zero; `t` is counted in its length.
    pub direction: Vec3,
    /// Where the ray ends; infinite for a ray into the open.
    pub t_max: f32,
}

/// Where a ray meets the nearest triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance in lengths of the ray's direction.
    pub t: f32,
    /// Index of the triangle in the mesh the hierarchy was built from.
    pub triangle: u32,
    /// Barycentric weight of the triangle's second corner.
    pub u: f32,
    /// Barycentric weight of the triangle's third corner; the first has `1 - u - v`.
    pub v: f32,
}
