//! What a stage keeps between its steps: mip chains, photographs at its resolution, first hits.

use super::adam::Moments;
use super::fitter::Fitter;
use super::schedule::Stage;
use super::settings::Consistency;
use super::targets::{Target, targets};
use crate::atlas::covered_texels;
use crate::material::texels::{PyramidWeights, Texel, TexelPyramid};
use crate::render::Parameters;
use crate::render::first_hits::FirstHits;
use crate::scene::{PixelState, Scene};

/// What a stage needs and no checkpoint holds: all of it follows from scene, settings and state.
pub(super) struct StageWork {
    pub weights: PyramidWeights,
    pub parameters: Parameters<f32>,
    pub gradient: Parameters<f32>,
    pub targets: Vec<Target>,
    pub first_hits: Vec<Option<FirstHits>>,
    /// Mean radiance of the pixels that are evidence, over all photos and channels.
    pub mean_of_photos: f32,
}

impl Fitter {
    /// Prepares what a stage needs, once.
    pub(super) fn enter(&mut self, stage: &Stage) {
        if self.work.is_some() {
            return;
        }
        self.grow_maps(stage.map_size);
        let covered = covered_texels(self.surface.mesh(), stage.map_size, stage.map_size);
        // Levels of the chain beyond the footprints of shrunken photographs serve bounced rays.
        let weights = PyramidWeights::new(&covered, 6);
        let texels = TexelPyramid::from_base(self.state.texels.clone(), &weights);
        let parameters = Parameters::new(texels, &self.environment());
        let gradient = Parameters {
            texels: TexelPyramid::zeros(&weights),
            light: vec![[0.0; 3]; self.state.light.len()],
            environment_size: parameters.environment_size,
        };
        let targets = targets(&self.scene, &self.training, stage.photo_level);
        let first_hits = self.cache_first_hits(&targets);
        let mean_of_photos = mean_of_photos(&self.scene, &targets);
        self.work = Some(StageWork { weights, parameters, gradient, targets, first_hits, mean_of_photos });
    }

    /// Doubles the maps until they have this size; what is known of a texel goes on as known of its four.
    pub(super) fn grow_maps(&mut self, map_size: usize) {
        let state = &mut self.state;
        while state.map_size < map_size {
            state.texels = doubled(&state.texels, state.map_size);
            if !state.variances.is_empty() {
                state.variances = doubled(&state.variances, state.map_size);
            }
            state.map_size *= 2;
            state.moments = Moments::zeros(state.texels.len());
        }
    }

    /// Traces first hits for as many views as the memory budget holds, when each view is likely to be visited often
    /// enough to pay for them.
    fn cache_first_hits(&self, targets: &[Target]) -> Vec<Option<FirstHits>> {
        let mut budget = self.settings.first_hits_mib << 20;
        let every_pixel = self.settings.pixels_per_step == 0 || self.settings.consistency != Consistency::None;
        targets
            .iter()
            .map(|target| {
                let bytes = FirstHits::bytes(&target.camera, self.settings.samples);
                let pays =
                    every_pixel || target.pixel_count() * self.settings.views_per_step <= self.settings.pixels_per_step;
                if !pays || bytes > budget {
                    return None;
                }
                budget -= bytes;
                let Fitter { settings, surface, .. } = self;
                let view = target.view as u32;
                Some(FirstHits::trace(
                    surface,
                    &target.camera,
                    settings.pixel_filter,
                    settings.samples,
                    settings.seed,
                    view,
                ))
            })
            .collect()
    }
}

/// Mean radiance over all pixels that say something, on at most about 128 x 128 pixels a photo.
fn mean_of_photos(scene: &Scene, targets: &[Target]) -> f32 {
    let (mut sum, mut count) = (0.0f64, 0u64);
    for target in targets {
        let stride = (target.pixel_count() >> 14).max(1);
        for pixel in (0..target.pixel_count()).step_by(stride) {
            let (radiance, state) = target.at(scene, pixel);
            if state != PixelState::Ignored {
                sum += f64::from(radiance.element_sum().max(0.0)) / 3.0;
                count += 1;
            }
        }
    }
    (sum / count.max(1) as f64) as f32
}

/// Maps of twice the size: each texel becomes four.
fn doubled(texels: &[Texel<f32>], size: usize) -> Vec<Texel<f32>> {
    (0..4 * size * size)
        .map(|index| {
            let (row, column) = (index / (2 * size), index % (2 * size));
            texels[row / 2 * size + column / 2]
        })
        .collect()
}

/// Maps of half the size: each texel is the mean of four.
pub(super) fn halved(texels: &[Texel<f32>], size: usize) -> Vec<Texel<f32>> {
    let half = size / 2;
    (0..half * half)
        .map(|index| {
            let first = 2 * (index / half) * size + 2 * (index % half);
            let four = [first, first + 1, first + size, first + size + 1].map(|texel| texels[texel]);
            std::array::from_fn(|k| 0.25 * four.iter().map(|texel| texel[k]).sum::<f32>())
        })
        .collect()
}
