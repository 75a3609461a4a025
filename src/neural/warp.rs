//! The unit cube in which densities live, and the angles it stands for.
//!
//! The three coordinates are those of the paper's code: the index of a MERL table along each angle, over its length,
//! with the part of `theta_half` that is above the surface stretched to the whole axis. Where the stretching ends is
//! computed, not read from a table: of two directions with `theta_difference` and `phi_difference`, the lower one
//! reaches the horizon at `tan(theta_half) = 1 / (tan(theta_difference) |cos(phi_difference)|)`.

use crate::measured::coordinates::HalfDifference;
use std::f64::consts::{FRAC_PI_2, PI};

/// Index of the stretched square root of `theta_half` in a point of the cube.
pub const HALF: usize = 0;
/// Index of `theta_difference` over a right angle.
pub const DIFFERENCE: usize = 1;
/// Index of `phi_difference` over half a turn; periodic.
pub const AZIMUTH: usize = 2;

/// The largest `theta_half` at which both directions are above the surface, in [0, pi/2].
pub fn horizon(theta_difference: f64, phi_difference: f64) -> f64 {
    let (sine, cosine) = theta_difference.clamp(0.0, FRAC_PI_2).sin_cos();
    cosine.max(0.0).atan2(sine * phi_difference.cos().abs()).min(FRAC_PI_2)
}

/// The point of the cube; `None` when a direction is below the surface or an angle is not finite.
pub fn to_cube(at: HalfDifference) -> Option<[f64; 3]> {
    let HalfDifference { theta_half, theta_difference, phi_difference } = at;
    let edge = horizon(theta_difference, phi_difference);
    // The slack is that of directions turned to angles and back.
    if !(theta_half <= edge + 1e-9) || !phi_difference.is_finite() || !theta_difference.is_finite() {
        return None;
    }
    let share = if edge > 1e-12 { (theta_half.max(0.0) / edge).min(1.0) } else { 0.0 };
    Some([share.sqrt(), (theta_difference / FRAC_PI_2).clamp(0.0, 1.0), (phi_difference / PI).rem_euclid(1.0)])
}

/// The angles of a point of the cube.
pub fn from_cube(point: [f64; 3]) -> HalfDifference {
    let theta_difference = point[DIFFERENCE].clamp(0.0, 1.0) * FRAC_PI_2;
    let phi_difference = point[AZIMUTH].rem_euclid(1.0) * PI;
    let theta_half = point[HALF] * point[HALF] * horizon(theta_difference, phi_difference);
    HalfDifference { theta_half, theta_difference, phi_difference }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cube_holds_what_is_above_the_surface_and_no_more() {
        let mut random = crate::math::random::SequentialRandom::new(3);
        for _ in 0..2000 {
            let point = [0; 3].map(|_| f64::from(random.next_number()));
            let angles = from_cube(point);
            let (light, eye) = angles.directions();
            assert!(light.z > -1e-9 && eye.z > -1e-9);
            let back = to_cube(angles).unwrap();
            assert!((0..3).all(|axis| (back[axis] - point[axis]).abs() < 1e-9), "{point:?} {back:?}");
            let beyond = HalfDifference {
                theta_half: angles.theta_half.max(1e-3) / point[0].max(0.05).powi(2) * 1.01,
                ..angles
            };
            let (light, eye) = beyond.directions();
            assert!(point[0] < 0.05 || light.z.min(eye.z) < 1e-9 || beyond.theta_half > FRAC_PI_2);
        }
        for theta_difference in [0.0, 0.3, FRAC_PI_2] {
            for phi_difference in [0.0, FRAC_PI_2, PI] {
                let point = to_cube(HalfDifference { theta_half: 0.0, theta_difference, phi_difference }).unwrap();
                assert!(point.iter().all(|u| (0.0..=1.0).contains(u)));
            }
        }
    }
}
