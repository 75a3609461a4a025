//! An environment as it looks when details below an angle are blurred away.

use super::Environment;
use crate::image::Image;
use crate::math::parallel;
use crate::math::sphere;
use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// Angles in degrees by which lights are told apart from coarse to fine: below a texel of a small map, a highlight, a
/// window, a quarter of the sky.
pub const BANDS: [f64; 4] = [5.0, 15.0, 30.0, 60.0];

impl Environment {
    /// The environment blurred on the sphere by `exp((cos a - 1) / s^2)`, near to a normal distribution of the deviation
    /// `s` along each of two axes. Mean radiance stays.
    pub fn blurred(&self, degrees: f64) -> Self {
        let (width, height) = (self.width(), self.height());
        let kernel = BlurKernel::new(width, height, degrees);
        let radiance = self.radiance.pixels();
        let rows: Vec<Vec<DVec3>> = parallel::map(height, |row| {
            let mut sums = vec![(DVec3::ZERO, 0.0); width];
            for other in 0..height {
                let weights = kernel.between(row, other);
                for (column, (sum, total)) in sums.iter_mut().enumerate() {
                    for (from, radiance) in radiance[other * width..(other + 1) * width].iter().enumerate() {
                        let weight = weights[column.abs_diff(from)];
                        *sum += weight * radiance.as_dvec3();
                        *total += weight;
                    }
                }
            }
            sums.into_iter().map(|(sum, total)| sum / total.max(f64::MIN_POSITIVE)).collect()
        });
        let pixels = rows.into_iter().flatten().map(|value| value.as_vec3()).collect();
        Environment { radiance: Image::from_pixels(width, height, pixels) }
    }

    /// The map as it looks out of focus behind a thing: blurred by so many degrees, as it is for 0. Of the size that such a
    /// blur leaves something to see of, since the time goes with the square of the texels.
    pub fn out_of_focus(&self, degrees: f32) -> Self {
        if degrees <= 0.0 {
            return self.clone();
        }
        let height = ((TEXELS_A_BLUR * 180.0 / degrees) as usize).clamp(8, LARGEST_BLURRED).min(self.height());
        let width = (2 * height).min(self.width());
        let is_small = (width, height) == (self.width(), self.height());
        let small = (!is_small).then(|| self.resampled(width, height));
        small.as_ref().unwrap_or(self).blurred(f64::from(degrees))
    }
}

/// Rows of texels to the angle of a blur, in [`Environment::out_of_focus`].
const TEXELS_A_BLUR: f32 = 2.5;
/// Most rows of what is blurred there.
const LARGEST_BLURRED: usize = 64;

/// Weights of a blur between the rows of a map; by symmetry they are functions of two rows and a number of columns.
pub struct BlurKernel {
    width: usize,
    height: usize,
    cosines: Vec<(f64, f64)>,
    sharpness: f64,
}

impl BlurKernel {
    /// The blur by so many degrees of maps of this size.
    pub fn new(width: usize, height: usize, degrees: f64) -> Self {
        let cosines = (0..height).map(|row| (PI * (row as f64 + 0.5) / height as f64).sin_cos()).collect();
        BlurKernel { width, height, cosines, sharpness: degrees.to_radians().powi(2).max(1e-12).recip() }
    }

    /// Weights of the texels of row `other` in the blur at row `row`, by the number of columns between them: kernel times
    /// solid angle.
    pub fn between(&self, row: usize, other: usize) -> Vec<f64> {
        let ((sine, cosine), (other_sine, other_cosine)) = (self.cosines[row], self.cosines[other]);
        let solid_angle = sphere::solid_angle_of_texel(other, self.width, self.height);
        let weight = |columns: usize| {
            let along = (TAU * columns as f64 / self.width as f64).cos();
            let cosine = sine * other_sine * along + cosine * other_cosine;
            solid_angle * (self.sharpness * (cosine - 1.0)).exp()
        };
        (0..self.width).map(weight).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn a_blur_spreads_a_sun_by_its_angle_and_keeps_the_energy() {
        let (width, height) = (64, 32);
        let even = Environment::constant(width, height, Vec3::new(2.0, 1.0, 0.5));
        for value in even.blurred(15.0).radiance.pixels() {
            assert!((*value - Vec3::new(2.0, 1.0, 0.5)).abs().max_element() < 1e-5);
        }
        let mut sun = Environment::constant(width, height, Vec3::ZERO);
        sun.radiance[(12, 20)] = Vec3::splat(1000.0);
        let blurred = sun.blurred(15.0);
        assert!((blurred.mean_radiance().x / sun.mean_radiance().x - 1.0).abs() < 0.02);
        let centre = sphere::direction_of_texel(12 * width / width, 20, width, height);
        let (mut squares, mut total) = (0.0, 0.0);
        for (index, value) in blurred.radiance.pixels().iter().enumerate() {
            let (row, column) = (index / width, index % width);
            let weight = f64::from(value.x) * sphere::solid_angle_of_texel(row, width, height);
            let angle = sphere::direction_of_texel(row, column, width, height).angle_between(centre).to_degrees();
            squares += weight * f64::from(angle).powi(2);
            total += weight;
        }
        // Two axes of 15 degrees each: 21.2 degrees in the root mean square.
        let spread = (squares / total).sqrt();
        assert!((spread - 15.0 * 2f64.sqrt()).abs() < 1.5, "{spread}");
    }

    #[test]
    fn what_is_out_of_focus_is_blurred_at_a_size_that_goes_with_the_angle() {
        let mut sun = Environment::constant(256, 128, Vec3::ONE);
        sun.radiance[(40, 90)] = Vec3::splat(1000.0);
        assert_eq!(sun.out_of_focus(0.0), sun);
        let [wide, narrow] = [20.0, 2.0].map(|degrees| sun.out_of_focus(degrees));
        assert_eq!((wide.width(), wide.height()), (44, 22));
        assert_eq!((narrow.width(), narrow.height()), (128, 64));
        let brightest = |light: &Environment| light.radiance.pixels().iter().map(|own| own.x).fold(0.0, f32::max);
        assert!(brightest(&wide) < brightest(&narrow) && brightest(&narrow) < 200.0);
        for light in [wide, narrow] {
            assert!((light.mean_radiance().x / sun.mean_radiance().x - 1.0).abs() < 0.03);
        }
    }
}
