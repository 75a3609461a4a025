//! Where a fit begins.
//!
//! The paper starts from diffuse 0 and light 0. A picture is a product of the two, so there both gradients are exactly
//! zero: a saddle no gradient method leaves. The measured start reads the light off the background where photographs
//! show it, and gives the surface the one grey that explains its mean radiance.

use super::settings::{BackgroundEvidence, FitSettings};
use super::targets::Target;
use crate::light::Environment;
use crate::material::Material;
use crate::math::sphere::{solid_angle_of_texel, tap_of_direction};
use crate::render::Surface;
use crate::scene::{Background, PixelState, Scene};
use glam::{Vec2, Vec3};

/// Start values.
#[derive(Clone, Debug, PartialEq)]
pub struct StartValues {
    /// Value of every texel.
    pub texel: Material<f32>,
    /// The light.
    pub environment: Environment,
}

/// Specular reflectance to begin with: a dielectric's.
const START_SPECULAR: f32 = 0.04;
/// Brightest grey of a surface to begin with.
const BRIGHTEST_GREY: f32 = 0.8;
/// Roughness `r` to begin with, the paper's.
const START_ROUGHNESS: f32 = 0.5;

/// The paper's start: diffuse 0, specular 0, roughness 0.5, light 0.
pub fn paper(settings: &FitSettings) -> StartValues {
    let height = settings.environment_height;
    StartValues {
        texel: texel(0.0, 0.0),
        environment: Environment { radiance: crate::image::Image::filled(2 * height, height, Vec3::ZERO) },
    }
}

fn texel(diffuse: f32, specular: f32) -> Material<f32> {
    Material::from_maps(Vec3::splat(diffuse), Vec3::splat(specular), START_ROUGHNESS)
}

/// Start values read off the photographs.
///
/// Light texels that background pixels show get their mean radiance; the others are filled smoothly from those. Without
/// background the light is constant, and such that a surface of reflectance 0.5 has the photographs' mean radiance.
pub fn measured(scene: &Scene, surface: &Surface, targets: &[Target], settings: &FitSettings) -> StartValues {
    let height = settings.environment_height;
    let width = 2 * height;
    let mut sums = vec![(Vec3::ZERO, 0.0f32); width * height];
    let mut surface_mean = (glam::DVec3::ZERO, 0u64);
    let use_background = scene.background == Background::Environment && settings.background == BackgroundEvidence::Use;
    for target in targets {
        // A grid of at most about 128 x 128 pixels a view is plenty for means.
        let stride = (target.camera.width.max(target.camera.height) / 128).max(1);
        for row in (0..target.camera.height).step_by(stride) {
            for column in (0..target.camera.width).step_by(stride) {
                let (radiance, state) = target.at(scene, row * target.camera.width + column);
                if state == PixelState::Ignored {
                    continue;
                }
                let ray = target.camera.ray_through(Vec2::new(column as f32 + 0.5, row as f32 + 0.5));
                if surface.closest(&ray).is_some() {
                    if state.is_surface() {
                        surface_mean.0 += radiance.as_dvec3();
                        surface_mean.1 += 1;
                    }
                } else if use_background && !(target.has_mask && state.is_surface()) {
                    let tap = tap_of_direction(ray.direction, width, height);
                    for k in 0..4 {
                        let sum = &mut sums[tap.index[k] as usize];
                        sum.0 += radiance * tap.weight[k];
                        sum.1 += tap.weight[k];
                    }
                }
            }
        }
    }
    let surface_mean = (surface_mean.0 / surface_mean.1.max(1) as f64).as_vec3();
    let seen: Vec<bool> = sums.iter().map(|sum| sum.1 > 0.25).collect();
    let weight = |index: usize| solid_angle_of_texel(index / width, width, height);
    let light_seen =
        (0..width * height).filter(|&index| seen[index]).map(weight).sum::<f64>() / (4.0 * std::f64::consts::PI);
    if light_seen < 0.01 {
        let radiance = (surface_mean / 0.5).max(Vec3::splat(1e-4));
        let environment = Environment { radiance: crate::image::Image::filled(width, height, radiance) };
        return StartValues { texel: texel(0.5, START_SPECULAR), environment };
    }
    let known = sums.iter().map(|sum| sum.0 / sum.1.max(1e-6)).collect();
    let radiance = fill_smoothly(known, &seen, width, height);
    let environment = Environment { radiance: crate::image::Image::from_pixels(width, height, radiance) };
    // The mean light over all directions is what a point of unknown normal receives on average.
    let mean_light: Vec3 =
        (0..width * height).map(|index| environment.radiance.pixels()[index] * weight(index) as f32).sum::<Vec3>()
            / (4.0 * std::f32::consts::PI);
    let (environment, mean_light) = brightened(environment, mean_light, surface_mean, &seen, light_seen as f32);
    let grey = surface_mean.element_sum() / mean_light.element_sum().max(1e-6);
    StartValues { texel: texel(grey.clamp(0.05, BRIGHTEST_GREY), START_SPECULAR), environment }
}

/// A light under which the surface can be as bright as it is: what the seen texels leave unexplained comes from those
/// that no photo shows. So a black cloth behind an object is not taken for a night. Returns the light and its mean.
fn brightened(
    mut environment: Environment,
    mean_light: Vec3,
    surface_mean: Vec3,
    seen: &[bool],
    light_seen: f32,
) -> (Environment, Vec3) {
    let missing = (surface_mean / BRIGHTEST_GREY - mean_light).max(Vec3::ZERO);
    let unseen = 1.0 - light_seen;
    if unseen < 0.01 || missing == Vec3::ZERO {
        return (environment, mean_light);
    }
    for (radiance, &seen) in environment.radiance.pixels_mut().iter_mut().zip(seen) {
        if !seen {
            *radiance += missing / unseen;
        }
    }
    (environment, mean_light + missing)
}

/// Fills unknown texels of a latitude-longitude map by relaxation towards the mean of their neighbours (Laplace).
fn fill_smoothly(mut radiance: Vec<Vec3>, known: &[bool], width: usize, height: usize) -> Vec<Vec3> {
    let count = known.iter().filter(|&&known| known).count().max(1);
    let mean = radiance.iter().zip(known).filter(|(_, known)| **known).map(|(radiance, _)| *radiance).sum::<Vec3>()
        / count as f32;
    for (value, &known) in radiance.iter_mut().zip(known) {
        if !known {
            *value = mean;
        }
    }
    for _ in 0..400 {
        let before = radiance.clone();
        for index in 0..width * height {
            if !known[index] {
                let (row, column) = (index / width, index % width);
                let at = |row: usize, column: usize| before[row * width + column];
                radiance[index] = 0.25
                    * (at(row.saturating_sub(1), column)
                        + at((row + 1).min(height - 1), column)
                        + at(row, (column + 1) % width)
                        + at(row, (column + width - 1) % width));
            }
        }
    }
    radiance
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_texels_lie_between_their_known_neighbours() {
        let (width, height) = (8, 4);
        let known: Vec<bool> = (0..32).map(|index| index / 8 == 0 || index / 8 == 3).collect();
        let values = (0..32).map(|index| if index / 8 == 0 { Vec3::ONE } else { Vec3::ZERO }).collect();
        let filled = fill_smoothly(values, &known, width, height);
        assert!((filled[8].x - 2.0 / 3.0).abs() < 1e-3 && (filled[16].x - 1.0 / 3.0).abs() < 1e-3);
        assert_eq!(filled[0], Vec3::ONE);
    }
}
