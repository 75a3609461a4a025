//! Directions and places on a latitude-longitude map: the one place where they meet.
//!
//! `theta = acos(d.y)` in [0, pi] grows downwards with the rows, `phi = atan2(d.x, -d.z) mod 2 pi` with the columns.

use super::elementary;
use glam::Vec3;
use std::f32::consts::{PI, TAU};

/// (phi, theta) of a direction whose length is from 1e-15 to 1e15; phi in [0, 2 pi), theta in [0, pi].
#[inline]
pub fn angles_of_direction(direction: Vec3) -> (f32, f32) {
    let horizontal = (direction.x * direction.x + direction.z * direction.z).sqrt();
    let theta = elementary::atan2(horizontal, direction.y);
    let phi = elementary::atan2(direction.x, -direction.z);
    let phi = if phi < 0.0 { phi + TAU } else { phi };
    (if phi >= TAU { 0.0 } else { phi }, theta)
}

/// The unit direction at (phi, theta).
pub fn direction_of_angles(phi: f32, theta: f32) -> Vec3 {
    let (sin_phi, cos_phi) = phi.sin_cos();
    let (sin_theta, cos_theta) = theta.sin_cos();
    Vec3::new(sin_theta * sin_phi, cos_theta, -sin_theta * cos_phi)
}

/// Exact solid angle in steradians of one texel of a `width x height` map in this row.
pub fn solid_angle_of_texel(row: usize, width: usize, height: usize) -> f64 {
    solid_angle_of_band(row as f64 / height as f64, (row + 1) as f64 / height as f64) / width as f64
}

/// Exact solid angle in steradians of the full band between two heights on the map, in [0, 1] from the top.
pub fn solid_angle_of_band(top: f64, bottom: f64) -> f64 {
    let pi = std::f64::consts::PI;
    // cos a - cos b as a product, which keeps its digits at the poles.
    2.0 * pi * 2.0 * (0.5 * pi * (top + bottom)).sin() * (0.5 * pi * (bottom - top)).sin()
}

/// The centre direction of a texel.
pub fn direction_of_texel(row: usize, column: usize, width: usize, height: usize) -> Vec3 {
    direction_of_angles(TAU * (column as f32 + 0.5) / width as f32, PI * (row as f32 + 0.5) / height as f32)
}

/// Four texels and their bilinear weights, which sum to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BilinearTap {
    /// Indices into a row-major map.
    pub index: [u32; 4],
    /// Weights in [0, 1].
    pub weight: [f32; 4],
}

/// The tap of a direction in a `width x height` map: wraps in phi, clamps at the poles.
pub fn tap_of_direction(direction: Vec3, width: usize, height: usize) -> BilinearTap {
    let (phi, theta) = angles_of_direction(direction);
    tap_of_angles(phi, theta, width, height)
}

/// The tap of a direction by its angles, see [`angles_of_direction`], in a `width x height` map: wraps in phi, clamps at
/// the poles.
#[inline]
pub fn tap_of_angles(phi: f32, theta: f32, width: usize, height: usize) -> BilinearTap {
    let x = phi * (width as f32 / TAU) - 0.5;
    let y = theta * (height as f32 / PI) - 0.5;
    let (x_floor, y_floor) = (elementary::floor(x), elementary::floor(y));
    let (x_fraction, y_fraction) = (x - x_floor as f32, y - y_floor as f32);
    let (width, height) = (width as i32, height as i32);
    // From -1 to one less than the width; a division would take longer than all the rest.
    let left = if x_floor < 0 { width - 1 } else { x_floor.min(width - 1) };
    let right = if left + 1 == width { 0 } else { left + 1 };
    let row = |y: i32| (y.clamp(0, height - 1) * width) as u32;
    let (left, right) = (left as u32, right as u32);
    let (upper, lower) = (row(y_floor), row(y_floor + 1));
    BilinearTap {
        index: [upper + left, upper + right, lower + left, lower + right],
        weight: [
            (1.0 - x_fraction) * (1.0 - y_fraction),
            x_fraction * (1.0 - y_fraction),
            (1.0 - x_fraction) * y_fraction,
            x_fraction * y_fraction,
        ],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_invert_and_the_convention_holds() {
        assert_eq!(angles_of_direction(Vec3::Y).1, 0.0);
        assert!((angles_of_direction(Vec3::NEG_Z).0).abs() < 1e-6);
        assert!((angles_of_direction(Vec3::X).0 - PI / 2.0).abs() < 1e-6);
        for row in 0..32 {
            for column in 0..64 {
                let tap = tap_of_direction(direction_of_texel(row, column, 64, 32), 64, 32);
                let own: f32 =
                    (0..4).filter(|&k| tap.index[k] == (row * 64 + column) as u32).map(|k| tap.weight[k]).sum();
                assert!(own > 0.9999, "row {row} column {column}: {own}");
            }
        }
    }

    #[test]
    fn solid_angles_sum_to_the_sphere() {
        let sum: f64 = (0..32).map(|row| 64.0 * solid_angle_of_texel(row, 64, 32)).sum();
        assert!((sum - 4.0 * std::f64::consts::PI).abs() < 1e-12);
    }
}
