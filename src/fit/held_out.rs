//! The views that judge a fit: none of their pixels ever moves a number.

use super::fitter::Fitter;
use super::schedule::Stage;
use crate::light::EnvironmentSampler;
use crate::math::parallel;
use crate::render::PathArena;
use crate::render::accumulate::{PassKey, estimate_pixel};
use crate::render::first_hits::CameraRays;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

impl Fitter {
    /// Writes the error over the held-out views into the last line of the history, when it is due there. `false` when
    /// stopped: the line stays without, and the next call fills it in.
    pub(super) fn look_at_held_out(&mut self, stop: &AtomicBool) -> bool {
        let every = self.settings.held_out_interval;
        let due = self.state.losses.last().is_some_and(|row| {
            every > 0 && row.step == self.state.step && row.step.is_multiple_of(every) && row.held_out_rmse.is_none()
        });
        if !due || self.held_out.is_empty() {
            return true;
        }
        let began = Instant::now();
        // The stage of the step that was done, which `step` has not left yet.
        let Some(&stage) = self.stage() else { return true };
        // The solver's own steps look by themselves, through their cache.
        if stage.kind.is_of_solver() {
            return true;
        }
        self.enter(&stage);
        let (rmse, of_views) = self.held_out_rmse(&stage, stop);
        if stop.load(Ordering::Relaxed) {
            return false;
        }
        self.state.seconds += began.elapsed().as_secs_f64();
        if let Some(row) = self.state.losses.last_mut() {
            row.held_out_rmse = rmse;
        }
        self.figures.keep_errors(&of_views);
        true
    }

    /// Root mean squared error over the held-out views, on shrunken photographs, and of each of them. `None` without
    /// such views.
    fn held_out_rmse(&self, stage: &Stage, stop: &AtomicBool) -> (Option<f64>, Vec<(usize, f32)>) {
        let Some(work) = self.work.as_ref() else { return (None, Vec::new()) };
        let mut of_views = Vec::with_capacity(self.held_out.len());
        let sampler = EnvironmentSampler::new(&work.parameters.environment());
        let (mut sum, mut count) = (0.0f64, 0.0f64);
        for target in &self.held_out {
            let tracer = self.tracer(stage, &work.parameters, &sampler, target);
            let rays = CameraRays::fresh(&self.surface, &target.camera, self.settings.pixel_filter, 4);
            let key = PassKey::halves(self.settings.seed ^ 0xe7a1, 0, target.view as u32);
            let errors = parallel::map_with(target.pixel_count(), PathArena::default, |arena, pixel| {
                let (photo, state) = target.at(&self.scene, pixel);
                if stop.load(Ordering::Relaxed) || !state.is_surface() || state.is_clipped() {
                    return None;
                }
                let estimate = estimate_pixel(&tracer, &rays, pixel, key, &work.parameters, arena);
                let error = (0..3)
                    .map(|c| f64::from((estimate.first[c] - photo[c]) * (estimate.second[c] - photo[c])))
                    .sum::<f64>();
                (estimate.escaped == 0.0 && error.is_finite()).then_some(error / 3.0)
            });
            let (sum_before, count_before) = (sum, count);
            for error in errors.into_iter().flatten() {
                sum += error;
                count += 1.0;
            }
            if count > count_before {
                let mean = (sum - sum_before) / (count - count_before);
                of_views.push((target.view, mean.max(0.0).sqrt() as f32));
            }
        }
        ((count > 0.0).then(|| (sum / count).max(0.0).sqrt()), of_views)
    }
}
