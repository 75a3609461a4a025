//! The light as a sum of hat functions, one a texel, and their integrals.
//!
//! Radiance is bilinear between texel centres, so texel `j` stands for a hat over its neighbours. Two integrals of each
//! hat are enough for both lobes to see one and the same light: its solid angle `∫ hat dω`, and its moment
//! `∫ hat ω dω`, whose product with a normal is the hat's irradiance wherever it lies above the horizon.

use crate::math::sphere::{direction_of_texel, solid_angle_of_texel, tap_of_direction};
use crate::math::vector::WIDEST;
use glam::{DVec3, Vec3, Vec4};

/// Points along each side of a texel for the integrals.
const SPLIT: usize = 8;

/// Integrals of the hats of a light, as arrays of one number a texel; padded with zeros to whole vectors.
#[derive(Clone, Debug)]
pub struct LightBasis {
    /// Width of the light in texels.
    pub width: usize,
    /// Height of the light in texels.
    pub height: usize,
    /// `∫ hat ω dω`, axis by axis, in sr.
    pub moment: [Vec<f32>; 3],
    /// Unit direction of the moment: where the hat's weight lies, axis by axis.
    pub direction: [Vec<f32>; 3],
    /// `∫ hat dω` in sr.
    pub solid_angle: Vec<f32>,
}

/// A light, both as the sums over all hats and as those over a few texels read it; padded with darkness to whole
/// vectors.
#[derive(Clone, Debug)]
pub struct LightPlanes {
    /// Radiance, one plane a channel.
    pub channels: [Vec<f32>; 3],
    /// Radiance and 1, texel by texel.
    pub texels: Vec<Vec4>,
}

impl LightBasis {
    /// The basis of lights of this size.
    pub fn new(width: usize, height: usize) -> Self {
        let count = width * height;
        let mut moments = vec![DVec3::ZERO; count];
        let mut solid = vec![0.0f64; count];
        let (fine_width, fine_height) = (width * SPLIT, height * SPLIT);
        for row in 0..fine_height {
            let weight = solid_angle_of_texel(row, fine_width, fine_height);
            for column in 0..fine_width {
                let direction = direction_of_texel(row, column, fine_width, fine_height);
                let tap = tap_of_direction(direction, width, height);
                for k in 0..4 {
                    let share = weight * f64::from(tap.weight[k]);
                    moments[tap.index[k] as usize] += direction.as_dvec3() * share;
                    solid[tap.index[k] as usize] += share;
                }
            }
        }
        let padded = count.next_multiple_of(WIDEST);
        let axis = |values: &[Vec3], axis: usize| {
            let mut plane: Vec<f32> = values.iter().map(|value| value[axis]).collect();
            plane.resize(padded, 0.0);
            plane
        };
        let moments: Vec<Vec3> = moments.iter().map(|moment| moment.as_vec3()).collect();
        let directions: Vec<Vec3> = moments.iter().map(|moment| moment.normalize_or(Vec3::Y)).collect();
        let mut solid_angle: Vec<f32> = solid.iter().map(|&value| value as f32).collect();
        solid_angle.resize(padded, 0.0);
        LightBasis {
            width,
            height,
            moment: [0, 1, 2].map(|k| axis(&moments, k)),
            direction: [0, 1, 2].map(|k| axis(&directions, k)),
            solid_angle,
        }
    }

    /// The basis whose hats are pairs of these, each of a row and the one below it; as it is where rows are odd.
    pub fn with_rows_joined(&self) -> Self {
        if !self.height.is_multiple_of(2) {
            return self.clone();
        }
        let joined = |plane: &Vec<f32>| -> Vec<f32> {
            let rows = plane[..self.count()].chunks_exact(2 * self.width).map(|rows| rows.split_at(self.width));
            let sums = rows.flat_map(|(upper, lower)| upper.iter().zip(lower).map(|(a, b)| a + b));
            let mut made: Vec<f32> = sums.collect();
            made.resize(made.len().next_multiple_of(WIDEST), 0.0);
            made
        };
        let moment = self.moment.each_ref().map(joined);
        let mut direction = moment.clone();
        for texel in 0..self.count() / 2 {
            let own = Vec3::from_array([0, 1, 2].map(|axis| moment[axis][texel])).normalize_or(Vec3::Y);
            (0..3).for_each(|axis| direction[axis][texel] = own[axis]);
        }
        let solid_angle = joined(&self.solid_angle);
        LightBasis { width: self.width, height: self.height / 2, moment, direction, solid_angle }
    }

    /// Number of texels.
    pub fn count(&self) -> usize {
        self.width * self.height
    }

    /// Number of texels with padding: a whole number of vectors.
    pub fn padded(&self) -> usize {
        self.solid_angle.len()
    }

    /// Direction of a hat.
    pub fn direction_of(&self, texel: usize) -> Vec3 {
        Vec3::new(self.direction[0][texel], self.direction[1][texel], self.direction[2][texel])
    }

    /// A light in the order of the basis.
    ///
    /// # Panics
    /// Never on a light of the size of the basis; a shorter one is padded with darkness, a longer one cut.
    pub fn planes(&self, light: &[[f32; 3]]) -> LightPlanes {
        let channels = [0, 1, 2].map(|channel| {
            let mut plane: Vec<f32> = light.iter().take(self.count()).map(|radiance| radiance[channel]).collect();
            plane.resize(self.padded(), 0.0);
            plane
        });
        let [red, green, blue] = &channels;
        let texels = (0..self.padded()).map(|texel| Vec4::new(red[texel], green[texel], blue[texel], 1.0)).collect();
        LightPlanes { channels, texels }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joined_rows_have_the_solid_angles_and_moments_of_both() {
        let basis = LightBasis::new(64, 32);
        let joined = basis.with_rows_joined();
        assert_eq!((joined.width, joined.height, joined.padded()), (64, 16, 1024));
        for (fine, coarse) in
            basis.moment.iter().chain([&basis.solid_angle]).zip(joined.moment.iter().chain([&joined.solid_angle]))
        {
            let [fine, coarse] = [fine, coarse].map(|plane| plane.iter().map(|&value| f64::from(value)).sum::<f64>());
            assert!((fine - coarse).abs() < 1e-4, "{fine} {coarse}");
        }
        let between = (basis.direction_of(5 * 64 + 7) + basis.direction_of(4 * 64 + 7)).normalize_or(Vec3::Y);
        assert!(joined.direction_of(2 * 64 + 7).dot(between) > 0.9999);
        assert_eq!(LightBasis::new(8, 5).with_rows_joined().height, 5);
    }

    #[test]
    fn hats_cover_the_sphere_once_and_give_the_irradiance_of_a_constant_light() {
        let basis = LightBasis::new(64, 32);
        let total: f64 = basis.solid_angle.iter().map(|&value| f64::from(value)).sum();
        assert!((total / (4.0 * std::f64::consts::PI) - 1.0).abs() < 1e-5);
        for normal in [Vec3::Y, Vec3::X, Vec3::new(0.6, 0.0, -0.8)] {
            let sum: f32 = (0..basis.count())
                .map(|j| (0..3).map(|axis| basis.moment[axis][j] * normal[axis]).sum::<f32>().max(0.0))
                .sum();
            // Hats that the horizon cuts are rounded off: a part in a thousand.
            assert!((sum / std::f32::consts::PI - 1.0).abs() < 2e-3, "{normal}: {sum}");
        }
    }
}
