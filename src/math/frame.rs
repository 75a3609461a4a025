//! An orthonormal frame around a direction.

use glam::Vec3;

/// A right-handed orthonormal frame; `normal` is the local z axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Local x axis in the outer space.
    pub tangent: Vec3,
    /// Local y axis in the outer space.
    pub bitangent: Vec3,
    /// Local z axis in the outer space, unit length.
    pub normal: Vec3,
}

impl Frame {
    /// A frame around a unit normal, without a branch on its direction.
    ///
    /// Duff, Burgess, Christensen, Hery, Kensler, Liani and Villemin 2017, "Building an Orthonormal Basis, Revisited".
    #[inline]
    pub fn around(normal: Vec3) -> Self {
        let sign = 1.0f32.copysign(normal.z);
        let a = -1.0 / (sign + normal.z);
        let b = normal.x * normal.y * a;
        Frame {
            tangent: Vec3::new(1.0 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x),
            bitangent: Vec3::new(b, sign + normal.y * normal.y * a, -normal.y),
            normal,
        }
    }

    /// A vector given in this frame, in the outer space.
    #[inline]
    pub fn outer_from_local(&self, local: Vec3) -> Vec3 {
        self.tangent * local.x + self.bitangent * local.y + self.normal * local.z
    }

    /// A vector of the outer space, in this frame.
    #[inline]
    pub fn local_from_outer(&self, outer: Vec3) -> Vec3 {
        Vec3::new(outer.dot(self.tangent), outer.dot(self.bitangent), outer.dot(self.normal))
    }
}

/// A cosine-weighted direction about +z from two uniform numbers; its density is `z / pi`.
#[inline]
pub fn sample_cosine_hemisphere(u: [f32; 2]) -> Vec3 {
    let radius = u[0].sqrt();
    let (sin, cos) = (std::f32::consts::TAU * u[1]).sin_cos();
    Vec3::new(radius * cos, radius * sin, (1.0 - u[0]).max(0.0).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_orthonormal_right_handed_and_invert() {
        for normal in [Vec3::X, Vec3::NEG_Z, Vec3::Z, Vec3::new(0.6, -0.8, 0.0), Vec3::new(1e-4, 0.0, -1.0)] {
            let normal = normal.try_normalize().unwrap();
            let frame = Frame::around(normal);
            assert!((frame.tangent.cross(frame.bitangent) - normal).length() < 1e-6);
            assert!((frame.tangent.length() - 1.0).abs() < 1e-6);
            let vector = Vec3::new(0.3, -2.0, 0.7);
            assert!((frame.outer_from_local(frame.local_from_outer(vector)) - vector).length() < 1e-6);
        }
    }
}
