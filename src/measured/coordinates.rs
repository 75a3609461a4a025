//! The angles of isotropic reflectance (Rusinkiewicz 1998): half vector and difference vector.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;

/// Where in the three-dimensional domain of isotropic reflectance a pair of directions lies, in radians.
///
/// `theta_half` and `theta_difference` lie in [0, pi/2], `phi_difference` in [0, pi): swapping the two directions adds
/// pi to the third, so folding it makes every function of these angles reciprocal.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HalfDifference {
    /// Angle between the half vector and the normal, in [0, pi/2].
    pub theta_half: f64,
    /// Angle between either direction and the half vector, in [0, pi/2].
    pub theta_difference: f64,
    /// Azimuth of the incident direction about the half vector, folded into [0, pi); 0 in the plane of the normal.
    pub phi_difference: f64,
}

impl HalfDifference {
    /// The angles of two unit directions that leave the surface, in a frame whose z axis is the normal.
    ///
    /// Opposite directions have no half vector: the normal stands in for it then.
    pub fn from_directions(to_light: DVec3, to_eye: DVec3) -> Self {
        let half = (to_light + to_eye).try_normalize().unwrap_or(DVec3::Z);
        let theta_half = half.z.clamp(-1.0, 1.0).acos().min(FRAC_PI_2);
        // The half vector's own frame: its azimuthal axis points away from the normal, in the plane of both.
        let azimuth = DVec3::new(half.x, half.y, 0.0).try_normalize().unwrap_or(DVec3::X);
        let bitangent = DVec3::Z.cross(azimuth);
        let tangent = bitangent.cross(half);
        let local = DVec3::new(to_light.dot(tangent), to_light.dot(bitangent), to_light.dot(half));
        let theta_difference = local.z.clamp(-1.0, 1.0).acos().min(FRAC_PI_2);
        let mut phi_difference = local.y.atan2(local.x);
        if phi_difference < 0.0 {
            phi_difference += PI;
        }
        if phi_difference >= PI {
            phi_difference -= PI;
        }
        Self { theta_half, theta_difference, phi_difference }
    }

    /// A pair of unit directions (to light, to eye) with these angles, the half vector at azimuth 0.
    ///
    /// Not every triple belongs to directions above the surface: check `z` of both.
    pub fn directions(self) -> (DVec3, DVec3) {
        let (sin_half, cos_half) = self.theta_half.sin_cos();
        let half = DVec3::new(sin_half, 0.0, cos_half);
        let tangent = DVec3::new(cos_half, 0.0, -sin_half);
        let (sin_difference, cos_difference) = self.theta_difference.sin_cos();
        let (sin_phi, cos_phi) = self.phi_difference.sin_cos();
        let local = DVec3::new(sin_difference * cos_phi, sin_difference * sin_phi, cos_difference);
        let to_light = tangent * local.x + DVec3::Y * local.y + half * local.z;
        let to_eye = 2.0 * half.dot(to_light) * half - to_light;
        (to_light, to_eye)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::SequentialRandom;

    fn difference(a: HalfDifference, b: HalfDifference) -> f64 {
        let turn = (a.phi_difference - b.phi_difference).abs();
        // An azimuth of nearly pi is one of nearly 0, and it counts for less the smaller the circle is.
        let turn = turn.min(PI - turn) * a.theta_difference.sin();
        (a.theta_half - b.theta_half).abs().max((a.theta_difference - b.theta_difference).abs()).max(turn)
    }

    #[test]
    fn angles_make_directions_with_these_angles_whichever_is_the_light_and_however_turned() {
        let mut random = SequentialRandom::new(3);
        let mut number = || f64::from(random.next_number());
        for _ in 0..2000 {
            let angles = HalfDifference {
                theta_half: 0.01 + 1.5 * number(),
                theta_difference: 0.01 + 1.5 * number(),
                phi_difference: PI * number(),
            };
            let (to_light, to_eye) = angles.directions();
            assert!((to_light.length() - 1.0).abs() < 1e-12 && (to_eye.length() - 1.0).abs() < 1e-12);
            let (sin, cos) = (2.0 * PI * number()).sin_cos();
            let turned = |v: DVec3| DVec3::new(cos * v.x - sin * v.y, sin * v.x + cos * v.y, v.z);
            for (light, eye) in [(to_light, to_eye), (to_eye, to_light), (turned(to_light), turned(to_eye))] {
                let again = HalfDifference::from_directions(light, eye);
                assert!(difference(angles, again) < 1e-6, "{angles:?} came back as {again:?}");
                assert!((0.0..PI).contains(&again.phi_difference));
            }
        }
    }

    #[test]
    fn opposite_and_equal_directions_have_finite_angles() {
        for (to_light, to_eye) in [(DVec3::X, -DVec3::X), (DVec3::Z, DVec3::Z), (DVec3::Y, DVec3::Y)] {
            let at = HalfDifference::from_directions(to_light, to_eye);
            assert!(at.theta_half.is_finite() && at.theta_difference.is_finite() && at.phi_difference.is_finite());
        }
    }
}
