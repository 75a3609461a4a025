//! Sums over the pixels of a view, and over views, texel by texel.

use super::pixels::PixelSays;
use super::{LayerPictures, SurfaceLayers, ViewError};
use crate::image::Image;
use crate::material::TextureTap;
use glam::Vec3;

/// Least share of a texel in a pixel that counts as being seen, as in [`crate::insight::coverage`].
const LEAST_WEIGHT: f32 = 0.05;

/// Sums of one view over the texels.
pub(super) struct ViewTexels {
    seen: Vec<bool>,
    weight: Vec<f32>,
    squared: Vec<f32>,
    gradient: Vec<Vec3>,
}

/// Welford's running mean and sum of squared deviations over views.
pub(super) struct OverViews {
    seen_by: Vec<u16>,
    judged_by: Vec<u16>,
    squared: Vec<f32>,
    mean: Vec<Vec3>,
    deviations: Vec<Vec3>,
}

impl ViewTexels {
    /// Empty sums over so many texels.
    pub(super) fn new(texels: usize) -> Self {
        ViewTexels {
            seen: vec![false; texels],
            weight: vec![0.0; texels],
            squared: vec![0.0; texels],
            gradient: vec![Vec3::ZERO; texels],
        }
    }

    /// Adds the pixels of a view to the texels they read; the sums must be empty.
    pub(super) fn gather(&mut self, says: &[PixelSays], map_size: usize) {
        for says in says {
            let Some((uv, level)) = says.place else { continue };
            if !says.state.is_surface() {
                continue;
            }
            let coarse = map_size >> level;
            let tap = TextureTap::at(uv, level, coarse, coarse);
            for (&index, &weight) in tap.index.iter().zip(&tap.weight) {
                if weight <= LEAST_WEIGHT {
                    continue;
                }
                let (top, left) = ((index as usize / coarse) << level, (index as usize % coarse) << level);
                for row in top..top + (1 << level) {
                    for texel in row * map_size + left..row * map_size + left + (1 << level) {
                        self.seen[texel] = true;
                        if says.is_judged() {
                            self.weight[texel] += weight;
                            self.squared[texel] += weight * says.squared;
                            self.gradient[texel] += weight * says.gradient;
                        }
                    }
                }
            }
        }
    }
}

impl OverViews {
    /// No view yet, over so many texels.
    pub(super) fn new(texels: usize) -> Self {
        OverViews {
            seen_by: vec![0; texels],
            judged_by: vec![0; texels],
            squared: vec![0.0; texels],
            mean: vec![Vec3::ZERO; texels],
            deviations: vec![Vec3::ZERO; texels],
        }
    }

    /// Adds the means of a view and empties its sums; `keep` hears of each gradient.
    pub(super) fn add(&mut self, own: &mut ViewTexels, mut keep: impl FnMut(usize, Vec3)) {
        for texel in 0..own.seen.len() {
            if !std::mem::take(&mut own.seen[texel]) {
                continue;
            }
            self.seen_by[texel] += 1;
            let weight = std::mem::take(&mut own.weight[texel]);
            let squared = std::mem::take(&mut own.squared[texel]);
            let gradient = std::mem::take(&mut own.gradient[texel]);
            if weight > 0.0 {
                let gradient = gradient / weight;
                self.judged_by[texel] += 1;
                self.squared[texel] += squared / weight;
                let delta = gradient - self.mean[texel];
                self.mean[texel] += delta / f32::from(self.judged_by[texel]);
                self.deviations[texel] += delta * (gradient - self.mean[texel]);
                keep(texel, gradient);
            }
        }
    }

    /// The layers after the last view; `range` is that of the gradients.
    pub(super) fn layers(
        &self,
        size: usize,
        taking_part: usize,
        range: f64,
        views: Vec<ViewError>,
        pictures: Vec<LayerPictures>,
    ) -> SurfaceLayers {
        let image =
            |value: &dyn Fn(usize) -> f32| Image::from_pixels(size, size, (0..size * size).map(value).collect());
        let photo_error = |texel: usize| match self.judged_by[texel] {
            0 => f32::NAN,
            // Products of independent halves may come out below zero where there is no error.
            count => (self.squared[texel] / f32::from(count)).max(0.0).sqrt(),
        };
        let disagreement = |texel: usize| {
            let count = self.judged_by[texel];
            if count < 2 {
                return f32::NAN;
            }
            let variance = f64::from(self.deviations[texel].element_sum()) / 3.0 / f64::from(count - 1);
            if range > 0.0 { (2.0 * variance / (range * range)).min(1.0) as f32 } else { 0.0 }
        };
        let coverage = |texel: usize| match self.seen_by[texel] {
            0 => f32::NAN,
            count => f32::from(count) / taking_part as f32,
        };
        SurfaceLayers {
            photo_error: image(&photo_error),
            disagreement: image(&disagreement),
            gradient_range: range,
            coverage: image(&coverage),
            times_seen: image(&|texel| f32::from(self.seen_by[texel])),
            views,
            pictures,
        }
    }
}
