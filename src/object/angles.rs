//! Half and difference angles of pairs of directions, written for loops over many of them.

use crate::math::arc::{arc_of_quarter, arc_of_upper_half};
use glam::Vec3;
use std::f32::consts::PI;

/// Half and difference angles of a pair of unit directions at a unit normal, without a frame, in `f32`.
#[inline(always)]
pub fn angles(normal: Vec3, to_light: Vec3, to_eye: Vec3) -> (f32, f32, f32) {
    let sum = to_light + to_eye;
    let half = sum * (sum.length_squared().max(1e-20)).sqrt().recip();
    let (half_cosine, light_cosine) = (half.dot(normal), to_light.dot(half));
    let across = normal.cross(half);
    let half_sine = across.length();
    let theta_half = arc_of_quarter(half_sine, half_cosine.max(0.0));
    // Half of the angle between the two directions, from their difference: exact near 0.
    let theta_difference = arc_of_quarter(0.5 * (to_light - to_eye).length(), light_cosine.max(0.0));
    // Tangent and bitangent of the half vector, both times the sine of theta_half.
    let (x, y) = (light_cosine * half_cosine - to_light.dot(normal), to_light.dot(across));
    // Reciprocity makes phi and phi + pi one: the lower half of the plane is turned onto the upper.
    let (x, y) = if y < 0.0 { (-x, -y) } else { (x, y) };
    let azimuth = arc_of_upper_half(y, x);
    (theta_half, theta_difference, if azimuth >= PI { 0.0 } else { azimuth })
}
