//! Light that bounces between microfacets, which most renderers add to a lobe and the fitted model does not.
//!
//! A rough metal comes out brighter there. With `E` the mean directional reflectance of a white lobe of GGX, they add
//! `F_ms (1 - E) / E` of what the lobe reflects, `F_ms = F E / (1 - F (1 - E))` (Kulla and Conty 2017; Turquin 2019), with `F`
//! the mean of Fresnel's factor. [`f0_without`] lowers F0 so that the sum is what was fitted.

use crate::material::lobe::{LobeGeometry, LobeModel, MIN_WIDTH};
use glam::Vec3;
use std::f32::consts::TAU;
use std::sync::LazyLock;

/// Mean of `(1 - c)^5` over directions by their cosines.
const GRAZING: f32 = 1.0 / 21.0;
/// Widths the table is made at: `((i + 1) / n)^2`.
const TABLE_LENGTH: usize = 24;

static TABLE: LazyLock<Vec<f32>> =
    LazyLock::new(|| (0..TABLE_LENGTH).map(|i| reflectance(((i + 1) as f32 / TABLE_LENGTH as f32).powi(2))).collect());

/// Mean directional reflectance of a white lobe of GGX, by the cosine, from a table linear in the root of the width.
pub fn mean_reflectance(width: f32) -> f32 {
    let place = (width.clamp(0.0, 1.0).sqrt() * TABLE_LENGTH as f32 - 1.0).clamp(0.0, (TABLE_LENGTH - 1) as f32);
    let low = (place as usize).min(TABLE_LENGTH - 2);
    let share = place - low as f32;
    (TABLE[low] * (1.0 - share) + TABLE[low + 1] * share).min(1.0)
}

/// The F0 of a lobe of GGX of this width that reflects as much with light between its facets as one of `f0` without.
pub fn f0_without(f0: Vec3, width: f32) -> Vec3 {
    let reflected = mean_reflectance(width).clamp(0.05, 1.0);
    let missing = (1.0 - reflected) / reflected;
    let lowered = |f0: f32| {
        let mut own = f0;
        // What F0 is too high by makes the next one too low by half as much at most: their mean comes near soon.
        for _ in 0..12 {
            let fresnel = own + (1.0 - own) * GRAZING;
            let between = fresnel * reflected / (1.0 - fresnel * (1.0 - reflected));
            own = 0.5 * (own + f0 / (1.0 + between * missing));
        }
        own
    };
    Vec3::new(lowered(f0.x), lowered(f0.y), lowered(f0.z))
}

fn reflectance(width: f32) -> f32 {
    const VIEWS: usize = 24;
    const SIDE: usize = 24;
    let model = LobeModel::Ggx;
    let log_width = width.max(MIN_WIDTH).ln();
    let inverse_width_squared = (-2.0 * log_width).exp();
    let (mut sum, mut weights) = (0.0f32, 0.0f32);
    for view in 0..VIEWS {
        let cos_out = (view as f32 + 0.5) / VIEWS as f32;
        let viewer = Vec3::new((1.0 - cos_out * cos_out).sqrt(), 0.0, cos_out);
        let mut reflected = 0.0;
        for index in 0..SIDE * SIDE {
            let u = [(index / SIDE) as f32 + 0.5, (index % SIDE) as f32 + 0.5].map(|place| place / SIDE as f32);
            let sin_squared = model.sine_squared_of_sample(u[0], inverse_width_squared);
            let (sin, (sin_phi, cos_phi)) = (sin_squared.sqrt(), (TAU * u[1]).sin_cos());
            let half = Vec3::new(sin * cos_phi, sin * sin_phi, (1.0 - sin_squared).max(0.0).sqrt());
            let light = half * (2.0 * viewer.dot(half)) - viewer;
            let Some(geometry) = LobeGeometry::new(Vec3::Z, light, viewer) else { continue };
            let density = model.density_of_half(geometry.ln_cos_half, inverse_width_squared);
            reflected += model.value(&geometry, log_width) * 4.0 * geometry.half_dot_out / density.max(1e-20);
        }
        sum += cos_out * reflected / (SIDE * SIDE) as f32;
        weights += cos_out;
    }
    sum / weights
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rough_lobe_loses_light_and_a_narrow_one_hardly_any() {
        assert!(mean_reflectance(0.01) > 0.98 && mean_reflectance(1.0) < 0.75, "{:?}", *TABLE);
        assert!(TABLE.windows(2).all(|pair| pair[1] < pair[0] + 0.005), "{:?}", *TABLE);
    }

    #[test]
    fn what_is_lowered_comes_back_with_the_light_between_facets() {
        for width in [0.05, 0.3, 0.8] {
            let reflected = mean_reflectance(width);
            for f0 in [0.02f32, 0.3, 0.9, 1.0] {
                let own = f0_without(Vec3::splat(f0), width).x;
                let fresnel = own + (1.0 - own) * GRAZING;
                let between = fresnel * reflected / (1.0 - fresnel * (1.0 - reflected));
                let seen = own * (1.0 + between * (1.0 - reflected) / reflected);
                assert!(own <= f0 && (seen - f0).abs() < 1e-4, "{width} {f0}: {own} {seen}");
            }
        }
    }
}
