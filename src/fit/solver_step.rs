//! The solver's steps as steps of a fit: same state, same history, same checkpoint.
//!
//! A step is a round on the light, or all maps. What it needs and no checkpoint holds, the traced cache, is made before
//! the first step, and again after a resume. Nothing is random but by the seed, so a fit that is taken up goes on bit for
//! bit.

use super::fitter::{Fitter, StepOutcome};
use super::schedule::{Stage, StageKind};
use super::settings::Method;
use super::solver::first_look::FirstLook;
use super::solver::observations::Observation;
use super::solver::photo_gains::log_gains;
use super::solver::way::{Look, OnTheWay};
use super::solver::{
    Choices, Estimate, SolverScene, SolverSettings, SolverStep, StepReport, TexelVariance, TransportError,
};
use super::stage_work::{doubled, halved};
use super::state::LossRow;
use super::targets::targets;
use super::underway::{Underway, WatchUnderway};
use crate::error::Result;
use crate::image::{GreyImage, Image, RgbImage};
use crate::material::MaterialMaps;
use glam::Vec3;
use std::borrow::Cow;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

impl Fitter {
    /// Does one step of the solver. A step that is stopped changes nothing but the size of the maps.
    pub(super) fn solver_step(
        &mut self,
        stage: &Stage,
        stop: &AtomicBool,
        watch: &mut WatchUnderway,
    ) -> Result<StepOutcome> {
        let began = Instant::now();
        let whole = SolverSettings::of(&self.settings);
        // What the model needs is asked on the finest maps that the solver makes, once.
        let last_maps = self.state.plan.iter().rfind(|stage| stage.kind == StageKind::Maps);
        let check_choices = whole.check_choices && last_maps.is_some_and(|last| last.is_of_level_of(stage));
        let is_last = last_maps == Some(stage);
        // The grid is not halved with the maps: light that reaches points too far apart bounds what small maps can show.
        let map_size = whole.map_size_of(stage);
        let settings = SolverSettings { map_size, check_choices, ..whole };
        let level = (stage.photo_level, map_size);
        let is_of_level = |solver: &SolverScene| (self.solver_photo_level, solver.settings.map_size) == level;
        if !self.solver.as_ref().is_some_and(is_of_level) {
            // Photos and maps are other ones; what points of the surface see of each other and of the light is the same.
            let traced = self.solver.take().map(|solver| solver.transport).or_else(|| self.transport.take());
            let (scene, surface) = (&self.scene, &self.surface);
            let photos = (targets(scene, &self.training, stage.photo_level), &self.held_out[..]);
            let mut seen = self.first_look(map_size, settings.light_size, watch);
            let made = SolverScene::build(scene, surface, photos, settings, traced, stop, &mut seen)?;
            drop(seen);
            self.solver = made;
            self.solver_photo_level = stage.photo_level;
        }
        let Some(mut solver) = self.solver.take() else { return Ok(StepOutcome::Interrupted) };
        solver.settings.check_choices = check_choices && is_last;
        let step = match stage.kind {
            StageKind::Maps => SolverStep::Maps,
            StageKind::Refine => SolverStep::Refine,
            _ => SolverStep::Light(self.light_rounds_done()),
        };
        self.grow_maps(stage.map_size);
        let mut estimate = self.lend_estimate(&solver)?;
        let light_size = settings.light_size;
        let views = if settings.exposure { solver.views.clone() } else { Vec::new() };
        // What made the level ready before is no part of the way.
        let way_began = Instant::now();
        let report = solver.step_watched(step, &mut estimate, stop, &mut |way: OnTheWay| {
            let OnTheWay { look, gains, share, is_reached } = way;
            let seconds_left = Some(way_began.elapsed().as_secs_f64() * (1.0 / share - 1.0));
            let log_gains = views.iter().copied().zip(log_gains(gains)).collect();
            watch(&Underway { look, map_size, light_size, seconds_left, log_gains, is_reached });
        });
        if report.is_some() && whole.fixed_maps && self.steps_total() == self.state.step + 1 {
            // Else before maps are made under the light.
            solver.fill_holes(&mut estimate.light);
        }
        let held_out = report.as_ref().map(|_| solver.held_out_rmse(&self.scene, &estimate));
        self.take_estimate(&solver, estimate);
        self.solver = Some(solver);
        let (Some(mut report), Some((held_out_rmse, of_views))) = (report, held_out) else {
            return Ok(StepOutcome::Interrupted);
        };
        if let Some(choices) = report.choices.take() {
            self.choices = Some(Arc::new(choices));
        }
        if stage.kind == StageKind::Maps {
            self.tails = report.tails;
        }
        if stage.kind == StageKind::Refine {
            self.descent = std::mem::take(&mut report.descent);
        }
        self.figures.keep_errors(&report.view_errors);
        self.figures.keep_errors(&of_views);
        self.state.seconds += began.elapsed().as_secs_f64();
        Ok(StepOutcome::Stepped(self.note(stage, &report, held_out_rmse)))
    }

    /// What shows the photos of a level as they are being traced, on the maps that an earlier one has made.
    fn first_look(
        &self,
        map_size: usize,
        light_size: (usize, usize),
        watch: &mut WatchUnderway,
    ) -> impl FnMut(&[Observation]) {
        let state = &self.state;
        let has_maps = state.step > 0 && !self.settings.fixed_maps;
        let mut shown = has_maps.then(|| {
            let (mut texels, mut size) = (state.texels.clone(), state.map_size);
            while size < map_size {
                (texels, size) = (doubled(&texels, size), 2 * size);
            }
            FirstLook::at(texels, size)
        });
        move |pixels| {
            let (Some(shown), Some(first)) = (&mut shown, pixels.first()) else { return };
            shown.add(pixels, state.log_gains[self.training[first.view as usize]].exp());
            let look = || Look { texels: Cow::Owned(shown.texels()), light: Cow::Borrowed(&state.light) };
            let (look, log_gains) = (&look, Vec::new());
            watch(&Underway { look, map_size, light_size, seconds_left: None, log_gains, is_reached: false });
        }
    }

    /// Millions of pixels of the photos fitted to that show surface, at full size; before the solver has looked, half of all.
    pub(crate) fn surface_megapixels(&self) -> f64 {
        let pixels = |view: &usize| {
            let camera = &self.scene.views[*view].camera;
            (camera.width * camera.height) as f64 / 1e6
        };
        let all: f64 = self.training.iter().map(pixels).sum();
        let of_level =
            |solver: &SolverScene| solver.surface_pixels() as f64 / 1e6 * 4f64.powi(self.solver_photo_level as i32);
        self.solver.as_ref().map_or(0.5 * all, of_level).min(all)
    }

    /// Rounds on the light so far, on all levels.
    fn light_rounds_done(&self) -> usize {
        let is_round = |stage: &&Stage| matches!(stage.kind, StageKind::WideLight | StageKind::NarrowLight);
        let before: usize = self.state.plan[..self.state.stage].iter().filter(is_round).map(|stage| stage.steps).sum();
        before + self.stage().filter(is_round).map_or(0, |_| self.state.step_in_stage)
    }

    /// Standard deviations of the maps' values, as maps: only the solver knows them, and only at its end.
    pub fn deviations(&self) -> Option<MaterialMaps> {
        let state = &self.state;
        let of_light = state.light_scale_deviation;
        self.deviations_are_known()
            .then(|| Estimate::deviations(&state.texels, &state.variances, state.map_size, of_light))
    }

    pub(super) fn deviations_are_known(&self) -> bool {
        self.settings.method == Method::Solver
            && self.state.variances.len() == self.state.texels.len()
            && self.state.plan.iter().enumerate().any(|(number, stage)| {
                let is_done = number == self.state.stage && self.state.step_in_stage >= stage.steps;
                stage.kind == StageKind::Maps && (number < self.state.stage || is_done)
            })
    }

    /// How far the solver's model is from the path tracer's with what was found. `None` under Adam, before the first step of a
    /// session, or when `stop` was raised.
    pub fn transport_error(&self, stop: &AtomicBool) -> Option<TransportError> {
        let solver = self.solver.as_ref()?;
        let (mut texels, mut size) = (self.state.texels.clone(), self.state.map_size);
        // Those of a fit that was cut short may be finer than those the solver has footprints for.
        while size > solver.settings.map_size {
            (texels, size) = (halved(&texels, size), size / 2);
        }
        let estimate = Estimate { texels, light: self.state.light.clone(), ..Estimate::default() };
        solver.transport_error(&self.surface, &estimate, stop)
    }

    /// What each texel of the light is known by, as an image: highlights in red, background pixels in green, diffuse light
    /// and shadows in blue, each a share of the texel's precision; what is missing to 1 is belief. `None` unless a round on
    /// the light was done since the fit was started or taken up.
    pub fn light_evidence(&self) -> Option<RgbImage> {
        let height = self.settings.environment_height;
        let width = 2 * height;
        let shares = &self.light_known.shares;
        (shares.len() == width * height && !shares.is_empty())
            .then(|| Image::from_pixels(width, height, shares.iter().map(|share| Vec3::from_array(*share)).collect()))
    }

    /// Standard deviation, relative, of the factor that light and reflectance have in common, see
    /// [`FitState::light_scale_deviation`](super::state::FitState), infinite where the photos leave the factor open.
    pub fn light_scale_deviation(&self) -> Option<f64> {
        self.state.told_light_scale_deviation()
    }

    /// What views that took no part say of the model's freedoms: which are needed where, what they bought and what they
    /// cost. `None` unless the maps of full size were made since the fit was started or taken up, and where less than two
    /// views can judge.
    pub fn choices(&self) -> Option<&Arc<Choices>> {
        self.choices.as_ref()
    }

    /// Number of texels that share a texel's lobe, as an image: the mean over all ways to cut the surface into regions,
    /// weighed by their evidence; 0 where a texel took over what its neighbours have. `None` as for [`Self::deviations`].
    pub fn lobe_sharing(&self) -> Option<GreyImage> {
        let size = self.state.map_size;
        self.deviations_are_known().then(|| {
            Image::from_fn(size, size, |row, column| self.state.variances[row * size + column].lobe_cluster_size)
        })
    }

    /// Moves the unknowns out of the state, so that none is held twice.
    fn lend_estimate(&mut self, solver: &SolverScene) -> Result<Estimate> {
        let mut estimate = if solver.settings.fixed_maps {
            self.estimate_of_known(solver)?
        } else {
            let state = &mut self.state;
            Estimate {
                texels: std::mem::take(&mut state.texels),
                variances: std::mem::take(&mut state.variances),
                light: std::mem::take(&mut state.light),
                light_known: std::mem::take(&mut self.light_known),
                log_gains: solver.views.iter().map(|&view| state.log_gains[view]).collect(),
            }
        };
        estimate.variances.resize(estimate.texels.len(), TexelVariance::default());
        // The paper's start is black: nothing could be told apart under it.
        if estimate.light.iter().all(|radiance| *radiance == [0.0; 3]) {
            let light = solver.constant_light();
            estimate.light = light.radiance.pixels().iter().map(|pixel| pixel.to_array()).collect();
        }
        Ok(estimate)
    }

    fn take_estimate(&mut self, solver: &SolverScene, estimate: Estimate) {
        let state = &mut self.state;
        if !solver.settings.fixed_maps {
            state.texels = estimate.texels;
            state.variances = estimate.variances;
        }
        state.light = estimate.light;
        self.light_known = estimate.light_known;
        if self.light_known.scale_deviation > 0.0 {
            state.keep_light_scale_deviation(self.light_known.scale_deviation);
        }
        for (&view, gain) in solver.views.iter().zip(estimate.log_gains) {
            state.log_gains[view] = gain;
        }
    }

    /// Writes a step into the history.
    fn note(&mut self, stage: &Stage, report: &StepReport, held_out_rmse: Option<f64>) -> LossRow {
        let state = &mut self.state;
        state.step += 1;
        state.step_in_stage += 1;
        let row = LossRow {
            step: state.step,
            stage: stage.name(),
            seconds: state.seconds,
            loss: report.residual * report.residual,
            image_loss: report.squared_error,
            consistency: 0.0,
            surface_rmse: None,
            held_out_rmse,
        };
        state.losses.push(row.clone());
        row
    }
}
