//! Makes what a stage keeps between its steps, once when the stage is entered.

use super::adam::Moments;
use super::fitter::Fitter;
use super::schedule::Stage;
use super::settings::Consistency;
use super::stage_work::{StageWork, doubled, mean_of_photos};
use super::targets::{Target, targets};
use crate::atlas::covered_texels;
use crate::material::texels::{PyramidWeights, TexelPyramid};
use crate::render::first_hits::FirstHits;
use crate::render::{ParameterGradient, Parameters};

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
        let texels = TexelPyramid::from_base(self.state.texels.clone(), &weights).with_model(self.settings.lobe);
        let parameters = Parameters::new(texels, &self.environment());
        let gradient = ParameterGradient::zeros(&weights, self.state.light.len());
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
