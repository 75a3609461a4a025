//! An environment blurred by the fitted lobe, and the lobe's own reflectance: the two factors of the split sum.

use crate::image::Image;
use crate::light::Environment;
use crate::material::lobe::{LobeGeometry, LobeModel, MIN_WIDTH, Material};
use crate::math::parallel;
use crate::math::sphere::{direction_of_texel, solid_angle_of_texel};
use glam::Vec3;
use std::f32::consts::{PI, TAU};

/// Widths that are blurred for: level `i` of `n` holds `(i / (n - 1))^2`.
pub const LEVELS: usize = 8;
/// Side of the table of reflectance.
pub const TABLE_SIDE: usize = 32;
const WIDTH: usize = 64;
const HEIGHT: usize = 32;

/// The microfacet width of a level.
fn width_of(level: usize) -> f32 {
    (level as f32 / (LEVELS - 1) as f32).powi(2).max(MIN_WIDTH)
}

/// The environment for each width, in mirror directions: the first level is the light itself at twice the size.
pub fn levels(light: &Environment, model: LobeModel) -> Vec<Image<Vec3>> {
    let sharp = light.resampled(2 * WIDTH, 2 * HEIGHT);
    let source = sources(&light.resampled(WIDTH, HEIGHT));
    let mut levels = vec![sharp.radiance];
    levels.extend((1..LEVELS).map(|level| {
        let width = width_of(level);
        // Seen along the normal: the lobe about the mirror direction, weighed by the cosine.
        let material = Material { diffuse: [0.0; 3], specular: [1.0; 3], log_width: width.ln() };
        let table = ByCosine::new(|cosine| {
            let light = Vec3::new((1.0 - cosine * cosine).max(0.0).sqrt(), 0.0, cosine);
            LobeGeometry::new(Vec3::Z, light, Vec3::Z)
                .map_or(0.0, |geometry| material.reflect_by(model, &geometry, 1.0)[0])
        });
        blurred(&source, |cosine| table.at(cosine))
    }));
    levels
}

/// Irradiance over pi for each normal.
pub fn irradiance(light: &Environment) -> Image<Vec3> {
    let source = sources(&light.resampled(WIDTH, HEIGHT));
    let (width, height) = (WIDTH / 2, HEIGHT / 2);
    image(width, height, |normal| source.iter().map(|(d, power)| *power * (d.dot(normal).max(0.0) / PI)).sum())
}

/// Directions of texels, and their radiance times solid angle.
fn sources(light: &Environment) -> Vec<(Vec3, Vec3)> {
    let (width, height) = (light.width(), light.height());
    (0..width * height)
        .map(|index| {
            let direction = direction_of_texel(index / width, index % width, width, height);
            let angle = solid_angle_of_texel(index / width, width, height) as f32;
            (direction, light.radiance.pixels()[index] * angle)
        })
        .collect()
}

/// A function of a cosine in [0, 1], kept at equal steps of the root of what it lacks to 1: about those of the angle, so
/// that narrow lobes are kept as well as wide ones.
struct ByCosine(Vec<f32>);

impl ByCosine {
    const STEPS: usize = 4096;

    fn new(value: impl Fn(f32) -> f32) -> Self {
        let cosine = |step: usize| 1.0 - (step as f32 / Self::STEPS as f32).powi(2);
        ByCosine((0..=Self::STEPS).map(|step| value(cosine(step))).collect())
    }

    #[inline]
    fn at(&self, cosine: f32) -> f32 {
        let place = (1.0 - cosine).max(0.0).sqrt() * Self::STEPS as f32;
        let step = (place as usize).min(Self::STEPS - 1);
        let (one, next) = (self.0[step], self.0[step + 1]);
        one + (place - step as f32) * (next - one)
    }
}

/// Each direction's mean of the light under a weight of the cosine to it.
fn blurred(source: &[(Vec3, Vec3)], weight: impl Fn(f32) -> f32 + Sync) -> Image<Vec3> {
    let total_angle = 2.0 * TAU / source.len() as f32;
    image(WIDTH, HEIGHT, |mirror| {
        let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
        for (row, line) in source.chunks_exact(WIDTH).enumerate() {
            let angle = solid_angle_of_texel(row, WIDTH, HEIGHT) as f32;
            for (direction, power) in line {
                let cosine = direction.dot(mirror);
                if cosine > 0.0 {
                    let weight = weight(cosine.min(1.0));
                    sum += *power * weight;
                    weights += weight * angle;
                }
            }
        }
        if weights > 1e-6 * total_angle { sum / weights } else { Vec3::ZERO }
    })
}

fn image(width: usize, height: usize, value: impl Fn(Vec3) -> Vec3 + Sync) -> Image<Vec3> {
    let pixel = |index| value(direction_of_texel(index / width, index % width, width, height));
    Image::from_pixels(width, height, parallel::map(width * height, pixel))
}

/// Reflectance of the lobe under even light as `F0 A + B`: pairs (A, B), rows by the width `(row + 1/2) / side`, columns by
/// the cosine to the viewer.
pub fn reflectance_table(model: LobeModel) -> Vec<[f32; 2]> {
    const HALVES: usize = 48;
    const AZIMUTHS: usize = 24;
    parallel::map(TABLE_SIDE * TABLE_SIDE, |index| {
        let place = |place: usize| (place as f32 + 0.5) / TABLE_SIDE as f32;
        let (width, cos_out) = (place(index / TABLE_SIDE).max(MIN_WIDTH), place(index % TABLE_SIDE));
        let viewer = Vec3::new((1.0 - cos_out * cos_out).sqrt(), 0.0, cos_out);
        let at = |f0: f32| Material { diffuse: [0.0; 3], specular: [f0; 3], log_width: width.ln() };
        let inverse_width_squared = 1.0 / (width * width);
        let (full, grazing) = (at(1.0), at(0.0));
        let mut sums = [0.0f32; 2];
        for half_index in 0..HALVES {
            // Half vectors as the lobe has them.
            let u = (half_index as f32 + 0.5) / HALVES as f32;
            let sin_squared = model.sine_squared_of_sample(u, inverse_width_squared);
            let (sin_half, cos_half) = (sin_squared.sqrt(), (1.0 - sin_squared).max(0.0).sqrt());
            for azimuth in 0..AZIMUTHS {
                let (sin, cos) = (TAU * (azimuth as f32 + 0.5) / AZIMUTHS as f32).sin_cos();
                let half = Vec3::new(sin_half * cos, sin_half * sin, cos_half);
                let light = half * (2.0 * viewer.dot(half)) - viewer;
                let Some(geometry) = LobeGeometry::new(Vec3::Z, light, viewer) else { continue };
                // p(i) = D (n.h) / (4 h.o).
                let half_density = model.density_of_half(geometry.ln_cos_half, inverse_width_squared);
                let density = half_density / (4.0 * geometry.half_dot_out);
                if density > 0.0 {
                    let rise = grazing.reflect_by(model, &geometry, 1.0)[0] / density;
                    sums[0] += full.reflect_by(model, &geometry, 1.0)[0] / density - rise;
                    sums[1] += rise;
                }
            }
        }
        sums.map(|sum| sum / (HALVES * AZIMUTHS) as f32)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn even_light_stays_even_and_a_lamp_stays_where_it_is() {
        let even = Environment::constant(64, 32, Vec3::new(0.5, 1.0, 2.0));
        for level in LobeModel::ALL.into_iter().flat_map(|model| levels(&even, model)) {
            assert!(level.pixels().iter().all(|rgb| (*rgb - Vec3::new(0.5, 1.0, 2.0)).length() < 2e-3));
        }
        let spread = irradiance(&even);
        assert!(spread.pixels().iter().all(|rgb| (*rgb - Vec3::new(0.5, 1.0, 2.0)).length() < 0.02));
        let mut lamp = Environment::constant(64, 32, Vec3::ZERO);
        lamp.radiance[(10, 20)] = Vec3::splat(100.0);
        let towards = direction_of_texel(10, 20, 64, 32);
        for level in levels(&lamp, LobeModel::BlinnPhong) {
            let brightest =
                (0..level.pixels().len()).max_by(|&a, &b| level.pixels()[a].x.total_cmp(&level.pixels()[b].x));
            let index = brightest.unwrap();
            let found = direction_of_texel(index / level.width(), index % level.width(), level.width(), level.height());
            assert!(found.dot(towards) > 0.99, "{found} {towards}");
        }
    }

    #[test]
    fn a_function_of_a_cosine_is_kept_as_it_is() {
        for width in [0.02f32, 0.3, 1.0] {
            let lobe = |cosine: f32| (-(1.0 - cosine) / (width * width)).exp();
            let table = ByCosine::new(lobe);
            for step in 0..=1000 {
                let cosine = 1.0 - (step as f32 * 1e-3).powi(2);
                assert!((table.at(cosine) - lobe(cosine)).abs() < 1e-4, "{width} {cosine}");
            }
        }
    }

    #[test]
    fn the_table_never_reflects_more_than_arrives() {
        for model in LobeModel::ALL {
            let table = reflectance_table(model);
            assert!(table.iter().all(|[a, b]| *a >= -1e-4 && *b >= 0.0 && a + b < 1.1), "{table:?}");
            // A narrow lobe seen from above reflects F0 and little else.
            let [a, b] = table[TABLE_SIDE * 2 + TABLE_SIDE - 1];
            assert!(a > 0.9 && b < 0.01, "{a} {b}");
        }
    }
}
