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
