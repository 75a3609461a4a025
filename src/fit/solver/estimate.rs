//! What the solver changes: maps, light and gains, and how sure it is of the maps.

use super::light_evidence::LightKnown;
use super::light_scale::LightScale;
use crate::atlas::{dilate, nearest_covered};
use crate::image::Image;
use crate::light::Environment;
use crate::material::texels::maps_from_texels;
use crate::material::{Material, MaterialMaps};
use glam::Vec3;

/// The unknowns. They live in the state of a fit between two steps.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Estimate {
    /// Texels of square maps.
    pub texels: Vec<Material<f32>>,
    /// How well each texel is known.
    pub variances: Vec<TexelVariance>,
    /// Radiance of the light's texels.
    pub light: Vec<[f32; 3]>,
    /// What the light is known by.
    pub light_known: LightKnown,
    /// Logarithm of each view's gain, in the order of [`super::SolverScene::views`].
    pub log_gains: Vec<f32>,
}

/// How well a texel is known.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TexelVariance {
    /// Variance of each of its numbers given the light; 0 where it is not known yet.
    pub variance: Material<f32>,
    /// Number of texels that share its lobe once maps are made, at least 1 where the texel's own pixels, or those of its
    /// block, were solved for; 0 where it was not.
    pub lobe_cluster_size: f32,
}

impl TexelVariance {
    /// Whether the texel's own pixels, or those of its block, were solved for.
    #[inline]
    pub fn is_solved(&self) -> bool {
        self.lobe_cluster_size > 0.0
    }
}

/// Standard deviations of a texel's numbers when nothing is known of it: diffuse RGB, specular RGB, log width.
const UNKNOWN_DEVIATION: [f32; 7] = [0.3, 0.3, 0.3, 0.2, 0.2, 0.2, 0.5];

/// A light's scale that is known less well counts as known to this, relative.
const MOST_LIGHT_DEVIATION: f64 = 0.25;
/// What arrives at places that face differently errs by this share of what the scale may err by: what all have in common
/// is no error of a map after its factor. Chosen so that stated intervals of nine tenths hold nine tenths of the texels.
const IRRADIANCE_SHARE: f32 = 0.5;
/// By what a light that was found puts lobes off, all alike where they see the same of it: specular reflectance relative
/// to itself, logarithm of the width. A lobe sees more detail of the light than irradiance does, which photos tell little
/// of. Chosen, like the share above, by how often stated intervals hold the truth: in the mean over development scenes, and with
/// each of them left out.
const LOBE_LIGHT_ERRORS: [f32; 2] = [0.35, 0.18];

/// What is known of a texel before anything was solved.
pub const START_TEXEL: Material<f32> = Material { diffuse: [0.4; 3], specular: [0.08; 3], log_width: -0.7 };

impl Estimate {
    /// Start values with this light.
    pub fn start(map_size: usize, light: &Environment, views: usize) -> Self {
        Estimate {
            texels: vec![START_TEXEL; map_size * map_size],
            variances: vec![TexelVariance::default(); map_size * map_size],
            light: light.radiance.pixels().iter().map(|pixel| pixel.to_array()).collect(),
            light_known: LightKnown::default(),
            log_gains: vec![0.0; views],
        }
    }

    /// Whether a texel was solved for when maps were made, better than any block of a round on the light is.
    #[inline]
    pub fn is_mapped(&self, texel: usize) -> bool {
        self.variances[texel].variance.diffuse[0] > 0.0
    }

    /// Sets a texel that was solved for, together with the texels that share its lobe: at least itself.
    pub fn set(&mut self, texel: usize, material: Material<f32>, known: TexelVariance) {
        self.texels[texel] = material;
        self.variances[texel] = TexelVariance { lobe_cluster_size: known.lobe_cluster_size.max(1.0), ..known };
    }

    /// Mean of the texels that were solved for. `None` where none was.
    pub fn mean_of_solved(&self) -> Option<Material<f32>> {
        let mut sum = Material::<f64>::default();
        let mut count = 0.0f64;
        for (texel, _) in self.texels.iter().zip(&self.variances).filter(|(_, known)| known.is_solved()) {
            sum.add(&texel.map(f64::from));
            count += 1.0;
        }
        (count > 0.0).then(|| sum.map(|value| (value / count) as f32))
    }

    /// Standard deviations of the values of maps of this size, by [`Estimate::texels`] and [`Estimate::variances`]: how far
    /// a value may be off. A texel that was not solved for has those of what is believed of any surface.
    /// `light_deviation` is the relative standard deviation of the light's scale; `None` for a light that is known, which
    /// adds nothing.
    pub fn deviations(
        texels: &[Material<f32>],
        variances: &[TexelVariance],
        map_size: usize,
        light_deviation: Option<f64>,
    ) -> MaterialMaps {
        let [of_diffuse, of_specular, of_log_width] = light_deviation.map_or([0.0; 3], |deviation| {
            let of_diffuse = IRRADIANCE_SHARE * deviation.min(MOST_LIGHT_DEVIATION) as f32;
            [of_diffuse, LOBE_LIGHT_ERRORS[0], LOBE_LIGHT_ERRORS[1]]
        });
        let deviation = |texel: usize, number: usize| {
            let own = variances[texel].variance.to_array()[number];
            if variances[texel].is_solved() && own > 0.0 {
                let by_light = match number {
                    0..3 => of_diffuse * texels[texel].diffuse[number],
                    3..6 => of_specular * texels[texel].specular[number - 3],
                    _ => of_log_width,
                };
                own.sqrt().hypot(by_light)
            } else {
                UNKNOWN_DEVIATION[number]
            }
        };
        let colour = |first: usize| {
            Image::from_fn(map_size, map_size, |row, column| {
                Vec3::from_array([0, 1, 2].map(|c| deviation(row * map_size + column, first + c)))
            })
        };
        MaterialMaps {
            diffuse: colour(0),
            specular: colour(3),
            roughness: Image::from_fn(map_size, map_size, |row, column| {
                let texel = row * map_size + column;
                roughness_deviation(texels[texel].log_width, deviation(texel, 6))
            }),
        }
    }

    /// Divides what reflectances are known to by a factor of the light, F0 where it was, and keeps how well that is known.
    pub(super) fn scale_variances(&mut self, scale: &LightScale, scaled_specular: &[bool]) {
        self.light_known.scale_deviation = scale.deviation;
        for (known, scaled_specular) in self.variances.iter_mut().zip(scaled_specular) {
            for c in 0..3 {
                let square = scale.factor[c] * scale.factor[c];
                known.variance.diffuse[c] /= square;
                if *scaled_specular {
                    known.variance.specular[c] /= square;
                }
            }
        }
    }

    /// The maps, of this size.
    pub fn maps(&self, map_size: usize) -> MaterialMaps {
        maps_from_texels(&self.texels, map_size, map_size)
    }

    /// The light, of this size; one of another size is cut or filled with darkness.
    pub fn environment(&self, (width, height): (usize, usize)) -> Environment {
        let mut pixels: Vec<Vec3> =
            self.light.iter().map(|&radiance| Vec3::from_array(radiance).max(Vec3::ZERO)).collect();
        pixels.resize(width * height, Vec3::ZERO);
        Environment { radiance: Image::from_pixels(width, height, pixels) }
    }
}

/// Texels of square maps that were not solved for take the values of the nearest that were; where none was, all stay.
pub fn fill_from_solved(texels: &mut Vec<Material<f32>>, variances: &[TexelVariance], map_size: usize) {
    fill_from_known(texels, variances.iter().map(TexelVariance::is_solved).collect(), map_size);
}

/// Texels of square maps that are not known take the values of the nearest that are; where none is, all stay.
pub(super) fn fill_from_known(texels: &mut Vec<Material<f32>>, is_known: Vec<bool>, map_size: usize) {
    if !is_known.contains(&true) || !is_known.contains(&false) {
        return;
    }
    let nearest = nearest_covered(&Image::from_pixels(map_size, map_size, is_known));
    let image = Image::from_pixels(map_size, map_size, std::mem::take(texels));
    *texels = dilate(&image, &nearest).into_pixels();
}

/// How far the roughness, the square of a width, may be off (root mean square) where the logarithm of the width is normal
/// about `log_width`: with `s` twice its deviation the squared roughness times `exp(2 s²) - 2 exp(s² / 2) + 1`, and never
/// more than half of what there is. For small deviations that is the derivative, `2 r d(ln a)`; by that alone intervals of
/// what is known loosely ended short of what is rougher.
fn roughness_deviation(log_width: f32, deviation: f32) -> f32 {
    // Beyond this deviation nothing is known of it.
    let squared = (2.0 * deviation.min(2.0)).powi(2);
    let relative = ((2.0 * squared).exp_m1() - 2.0 * (0.5 * squared).exp_m1()).sqrt();
    ((2.0 * log_width).exp() * relative).min(0.5)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_light_that_was_found_makes_intervals_wider_and_one_that_is_known_does_not() {
        let texels = [Material { diffuse: [0.4; 3], specular: [0.1; 3], log_width: -0.5 }, START_TEXEL];
        let texels = [texels[0], texels[0], texels[1], texels[1]];
        let variance = Material { diffuse: [0.01; 3], specular: [0.0001; 3], log_width: 0.04 };
        let (solved, unsolved) = (TexelVariance { variance, lobe_cluster_size: 3.0 }, TexelVariance::default());
        let variances = [solved, solved, unsolved, unsolved];
        let of = |light| Estimate::deviations(&texels, &variances, 2, light);
        let (known, close, open) = (of(None), of(Some(0.1)), of(Some(f64::MAX)));
        assert_eq!(known.diffuse[(0, 0)], Vec3::splat(0.1));
        assert_eq!(known.specular[(0, 0)], Vec3::splat(0.01));
        let near = |value: f32, expected: f32| assert!((value - expected).abs() < 1e-6, "{value} for {expected}");
        near(close.diffuse[(0, 0)].x, 0.1f32.hypot(0.05 * 0.4));
        near(open.diffuse[(0, 0)].x, 0.1f32.hypot(0.125 * 0.4));
        near(close.specular[(0, 0)].y, 0.01f32.hypot(0.35 * 0.1));
        near(close.roughness[(0, 0)], roughness_deviation(-0.5, 0.2f32.hypot(0.18)));
        // Where nothing was found, what is believed of any surface is left as it is.
        assert_eq!(close.diffuse[(1, 0)], known.diffuse[(1, 0)]);
        assert_eq!(known.diffuse[(1, 1)], Vec3::splat(UNKNOWN_DEVIATION[0]));
    }

    #[test]
    fn a_roughness_is_off_as_the_square_of_a_width_whose_logarithm_is_normal() {
        // Small deviations: the derivative.
        assert!((roughness_deviation(-0.5, 1e-3) / (2e-3 * (-1.0f32).exp()) - 1.0).abs() < 1e-3);
        // Wide ones: the mean over the normal distribution, in steps of a hundredth of its deviation.
        let (log_width, deviation) = (-1.5f64, 0.3f64);
        let squared = |z: f64| ((2.0 * (log_width + deviation * z)).exp() - (2.0 * log_width).exp()).powi(2);
        let weights = (-800..=800).map(|k| f64::from(k) * 0.01).map(|z| (z, (-0.5 * z * z).exp()));
        let (sum, total) =
            weights.fold((0.0, 0.0), |(sum, all), (z, weight)| (sum + weight * squared(z), all + weight));
        let found = f64::from(roughness_deviation(log_width as f32, deviation as f32));
        assert!((found / (sum / total).sqrt() - 1.0).abs() < 1e-3, "{found} {}", (sum / total).sqrt());
        assert_eq!(roughness_deviation(-0.5, 50.0), 0.5, "what is not known at all");
        assert_eq!(roughness_deviation(-0.5, 0.0), 0.0);
    }
}
