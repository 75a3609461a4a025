//! The gradient of a step: pixels of several views, traced and added up.

use super::batch::{pixels_of_visit, views_of_step};
use super::consistency::ViewGradient;
use super::fitter::Fitter;
use super::loss::ViewLoss;
use super::schedule::{Stage, StageKind};
use super::settings::{BackgroundEvidence, Consistency};
use super::stage_work::StageWork;
use super::step_sums::StepSums;
use super::targets::Target;
use crate::error::{Error, ErrorKind, Place, Result};
use crate::light::EnvironmentSampler;
use crate::material::TexelGradient;
use crate::material::texels::PyramidWeights;
use crate::math::parallel;
use crate::render::accumulate::{PassKey, PassTotals, accumulate};
use crate::render::first_hits::{CameraRays, FirstHits};
use crate::render::{ParameterGradient, Parameters, PathSettings, PathTracer};
use crate::scene::Background;
use std::sync::atomic::{AtomicBool, Ordering};

/// A fit ends with an error when more than this share of a step's pixels is not finite.
const MAX_NON_FINITE_SHARE: f64 = 0.01;

impl Fitter {
    /// Adds up the gradient of a step into the stage's gradient, on the base level. `None` when stopped.
    pub(super) fn sum_gradient(&mut self, stage: &Stage, stop: &AtomicBool) -> Result<Option<StepSums>> {
        let views =
            views_of_step(self.settings.seed, self.training.len(), self.settings.views_per_step, self.state.step);
        let Some(mut work) = self.work.take() else {
            return Err(Error::new(ErrorKind::Internal, "a step began before its stage"));
        };
        let outcome = self.sum_gradient_of(&mut work, &views, stage, stop);
        if !matches!(outcome, Ok(Some(_))) {
            // Drop the half-made gradient.
            clear(&mut work.gradient);
        }
        self.work = Some(work);
        outcome
    }

    fn sum_gradient_of(
        &self,
        work: &mut StageWork,
        views: &[(usize, usize)],
        stage: &Stage,
        stop: &AtomicBool,
    ) -> Result<Option<StepSums>> {
        // The first step of the paper is plain least squares: consistency is of the second (section 4.2).
        let separate = self.settings.consistency != Consistency::None && stage.kind != StageKind::Diffuse;
        let share = 1.0 / views.len() as f32;
        let sampler = EnvironmentSampler::new(&work.parameters.environment());
        // 0 takes every pixel.
        let quota = if separate { 0 } else { self.settings.pixels_per_step.div_ceil(views.len()) };
        let mut sums = StepSums::default();
        let mut view_gradients: Vec<ViewGradient<f32>> = Vec::new();
        let mut total: Option<ParameterGradient<f32>> = None;
        for &(slot, visit) in views {
            let StageWork { weights, parameters, gradient, targets, first_hits, .. } = &mut *work;
            let target = &targets[slot];
            let pixels = pixels_of_visit(self.settings.seed, target, visit, quota);
            let tracer = self.tracer(stage, parameters, &sampler, target);
            let rays = self.rays(target, &first_hits[slot]);
            let weight = if separate { 1.0 } else { share } / (3.0 * pixels.len() as f32);
            let loss = self.view_loss(target, weight);
            let key = self.pass_key(target);
            let totals = accumulate(&tracer, &rays, &pixels, key, parameters, &loss, gradient, stop);
            if stop.load(Ordering::Relaxed) {
                return Ok(None);
            }
            sums.gain_derivatives.push((target.view, loss.gain_derivative() * if separate { share } else { 1.0 }));
            if let Some(rmse) = loss.surface_rmse() {
                sums.view_errors.push((target.view, rmse));
            }
            sums.non_finite.extend(self.non_finite_of(target, &totals, pixels.len())?);
            sums.image_loss += f64::from(totals.loss) * if separate { f64::from(share) } else { 1.0 };
            if separate {
                gradient.texels.pull_down(weights);
                view_gradients.push(ViewGradient::collect(&gradient.texels.levels[0].texels));
                let base = || PyramidWeights::flat(stage.map_size, stage.map_size);
                let total = total.get_or_insert_with(|| ParameterGradient::zeros(&base(), gradient.light.len()));
                add_scaled(total, gradient, share);
                clear(gradient);
            }
        }
        match total {
            None => work.gradient.texels.pull_down(&work.weights),
            Some(total) => {
                work.gradient.texels.levels[0].texels.clone_from(&total.texels.levels[0].texels);
                work.gradient.light.clone_from(&total.light);
            }
        }
        sums.loss = sums.image_loss;
        if separate && !self.weigh_by_consistency(work, views, &view_gradients, stage, &sampler, &mut sums, stop) {
            return Ok(None);
        }
        Ok(Some(sums))
    }

    pub(super) fn tracer<'a>(
        &'a self,
        stage: &Stage,
        parameters: &'a Parameters<f32>,
        sampler: &'a EnvironmentSampler,
        target: &Target,
    ) -> PathTracer<'a> {
        PathTracer {
            surface: &self.surface,
            proposal: &parameters.texels,
            light: sampler,
            environment_size: parameters.environment_size,
            settings: PathSettings {
                max_bounces: self.settings.bounces,
                lobe_strength: stage.lobe_strength(self.state.step_in_stage, self.settings.lobe_ramp),
                background_visible: self.scene.background == Background::Environment,
                two_sided: false,
                // Samples share a pixel between them.
                camera_cone_radians: target.camera.pixel_angle_radians() / (self.settings.samples as f32).sqrt(),
                bounce_cone_radians: 0.1,
            },
        }
    }

    pub(super) fn rays<'a>(&'a self, target: &'a Target, first_hits: &'a Option<FirstHits>) -> CameraRays<'a> {
        let filter = self.settings.pixel_filter;
        match first_hits {
            Some(first_hits) => CameraRays::cached(&self.surface, &target.camera, filter, first_hits),
            None => CameraRays::fresh(&self.surface, &target.camera, filter, self.settings.samples),
        }
    }

    pub(super) fn view_loss<'a>(&'a self, target: &'a Target, weight: f32) -> ViewLoss<'a> {
        let gain = self.state.log_gains[target.view].exp();
        let use_background = self.settings.background == BackgroundEvidence::Use;
        ViewLoss::new(&self.scene, target, weight, gain, use_background)
    }

    pub(super) fn pass_key(&self, target: &Target) -> PassKey {
        PassKey::halves(self.settings.seed, self.state.step as u32, target.view as u32)
    }

    /// Name and number of the pixels of a view that were not finite, if any; too many of them end the fit. The name is the
    /// same in each step, so that counts add up.
    fn non_finite_of(&self, target: &Target, totals: &PassTotals<f32>, pixels: usize) -> Result<Option<(String, u64)>> {
        let Some(pixel) = totals.first_non_finite else { return Ok(None) };
        let (row, column) = target.place_in_photo(pixel);
        let view = self.scene.views[target.view].name.clone();
        let count = totals.non_finite_pixels;
        if count as f64 > MAX_NON_FINITE_SHARE * pixels as f64 {
            let message = format!("{count} of {pixels} pixels of a step are not finite");
            return Err(Error::new(ErrorKind::NonFinite, message)
                .at(Place::Pixel { view, row, column })
                .remedy("the last checkpoint is good: resume from it with smaller rates"));
        }
        Ok(Some((format!("error of a pixel in {view}"), count)))
    }
}

fn clear(gradient: &mut ParameterGradient<f32>) {
    for level in &mut gradient.texels.levels {
        parallel::each_chunk(&mut level.texels, 1 << 14, &|_, texels| texels.fill(TexelGradient::default()));
    }
    gradient.light.fill([0.0; 3]);
}

fn add_scaled(total: &mut ParameterGradient<f32>, part: &ParameterGradient<f32>, factor: f32) {
    let (total_texels, part_texels) = (&mut total.texels.levels[0].texels, &part.texels.levels[0].texels);
    parallel::each_chunk(total_texels, 1 << 14, &|chunk, total_texels| {
        for (total, part) in total_texels.iter_mut().zip(&part_texels[chunk << 14..]) {
            if part.evidence != 0.0 {
                total.d_material.add_scaled(&part.d_material, factor);
                total.evidence += part.evidence;
            }
        }
    });
    for (total, part) in total.light.iter_mut().zip(&part.light) {
        for channel in 0..3 {
            total[channel] += factor * part[channel];
        }
    }
}
