//! The loop body: one call, one optimiser step.
//!
//! Everything a step draws (views, pixels, directions) is a function of the seed and the step's number, and everything
//! it changes is in [`FitState`]; so a fit that is saved and taken up again goes on bit for bit as if it had not been
//! interrupted.

use super::adam::Moments;
use super::gauge::GaugeRule;
use super::held_out::held_out_targets;
use super::schedule::{Stage, stages};
use super::settings::{FitSettings, Start};
use super::start;
use super::state::{FitState, LossRow};
use super::targets::{Target, targets};
use super::work::StageWork;
use crate::error::{Error, ErrorKind, Finding, Result, Severity};
use crate::light::Environment;
use crate::material::MaterialMaps;
use crate::material::texels::{PyramidWeights, TexelPyramid, maps_from_texels};
use crate::render::{Parameters, Surface};
use crate::scene::Scene;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// What a step did.
#[derive(Clone, Debug, PartialEq)]
pub enum StepOutcome {
    /// A step was done; its line of the history.
    Stepped(LossRow),
    /// All stages are done; nothing was changed.
    Finished,
    /// The stop flag was raised; nothing was changed.
    Interrupted,
}

/// A fit in progress.
pub struct Fitter {
    pub(super) scene: Arc<Scene>,
    pub(super) surface: Arc<Surface>,
    pub(super) settings: FitSettings,
    pub(super) stages: Vec<Stage>,
    pub(super) training: Vec<usize>,
    pub(super) held_out: Vec<Target>,
    pub(super) state: FitState,
    pub(super) work: Option<StageWork>,
}

impl Fitter {
    /// A new fit of a scene. `surface` holds the mesh with the atlas; `known_light` starts from a given environment.
    pub fn new(
        scene: Arc<Scene>,
        surface: Arc<Surface>,
        settings: FitSettings,
        known_light: Option<&Environment>,
    ) -> Result<Self> {
        let mut fitter = Fitter::prepare(scene, surface, settings)?;
        let first = fitter.stages[0];
        let state = &mut fitter.state;
        state.log_gains = vec![0.0; fitter.scene.views.len()];
        state.gain_moments = Moments::zeros(fitter.scene.views.len());
        state.map_size = first.map_size;
        let values = match fitter.settings.start {
            Start::Measured => fitter.measured_start(),
            Start::Paper => start::paper(&fitter.settings),
        };
        fitter.begin_from(values, known_light);
        Ok(fitter)
    }

    /// Takes up a fit from a saved state.
    pub fn resume(scene: Arc<Scene>, surface: Arc<Surface>, settings: FitSettings, state: FitState) -> Result<Self> {
        let mut fitter = Fitter::prepare(scene, surface, settings)?;
        let fits = state.log_gains.len() == fitter.scene.views.len()
            && state.stage <= fitter.stages.len()
            && state.texels.len() == state.map_size * state.map_size
            && state.light.len() == 2 * fitter.settings.environment_height * fitter.settings.environment_height;
        if !fits {
            return Err(Error::new(
                ErrorKind::InvalidScene,
                "the checkpoint belongs to another scene or other settings",
            )
            .remedy("resume with the scene and settings the run was started with"));
        }
        fitter.state = state;
        Ok(fitter)
    }

    fn prepare(scene: Arc<Scene>, surface: Arc<Surface>, settings: FitSettings) -> Result<Self> {
        settings.validate()?;
        let training: Vec<usize> = (0..scene.views.len()).filter(|&view| !scene.views[view].held_out).collect();
        if training.is_empty() {
            return Err(Error::new(ErrorKind::InvalidScene, "no view is left to fit to")
                .remedy("hold out fewer views: --hold-out-every 0 keeps them all"));
        }
        let held_out = held_out_targets(&scene);
        let stages = stages(&settings);
        Ok(Fitter { scene, surface, stages, settings, training, held_out, state: FitState::default(), work: None })
    }

    pub(super) fn measured_start(&self) -> start::StartValues {
        let level = self.stages[0].photo_level;
        let targets = targets(&self.scene, &self.training, level);
        start::measured(&self.scene, &self.surface, &targets, &self.settings)
    }

    pub(super) fn begin_from(&mut self, values: start::StartValues, known_light: Option<&Environment>) {
        let count = self.state.map_size * self.state.map_size;
        let environment = match known_light {
            Some(light) => light.resampled(2 * self.settings.environment_height, self.settings.environment_height),
            None => values.environment,
        };
        self.state.texels = vec![values.texel; count];
        self.state.moments = Moments::zeros(count);
        self.state.light = environment.radiance.pixels().iter().map(|pixel| pixel.to_array()).collect();
        self.state.light_moments = Moments::zeros(self.state.light.len());
        self.work = None;
    }

    /// The scene.
    pub fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }

    /// The surface with the atlas.
    pub fn surface(&self) -> &Arc<Surface> {
        &self.surface
    }

    /// The settings.
    pub fn settings(&self) -> &FitSettings {
        &self.settings
    }

    /// All that a checkpoint must hold.
    pub fn state(&self) -> &FitState {
        &self.state
    }

    /// Number of steps of all stages.
    pub fn steps_total(&self) -> usize {
        self.stages.iter().map(|stage| stage.steps).sum()
    }

    /// The stage of the next step; `None` at the end.
    pub fn stage(&self) -> Option<&Stage> {
        self.stages.get(self.state.stage)
    }

    /// What fixes the scale between reflectance and light.
    pub fn gauge(&self) -> GaugeRule {
        GaugeRule::of(self.scene.background, self.settings.background, self.settings.fixed_light)
    }

    /// The maps as they are, of the size of the stage.
    pub fn maps(&self) -> MaterialMaps {
        maps_from_texels(&self.state.texels, self.state.map_size, self.state.map_size)
    }

    /// The light as it is.
    pub fn environment(&self) -> Environment {
        let height = self.settings.environment_height;
        let pixels = self.state.light.iter().map(|&radiance| glam::Vec3::from_array(radiance)).collect();
        Environment { radiance: crate::image::Image::from_pixels(2 * height, height, pixels) }
    }

    /// Maps and light, for rendering.
    pub fn parameters(&self) -> Parameters<f32> {
        let weights = PyramidWeights::flat(self.state.map_size, self.state.map_size);
        Parameters::new(TexelPyramid::from_base(self.state.texels.clone(), &weights), &self.environment())
    }

    /// What happened that the user should know, as findings.
    pub fn findings(&self) -> Vec<Finding> {
        let events = self.state.events.iter().map(|event| Finding::new(Severity::Note, "fit-event", event.clone()));
        let counts = self.state.non_finite.iter().map(|(name, count)| {
            Finding::new(Severity::Warning, "non-finite", format!("{count} numbers were not finite: {name}"))
                .remedy("they were left out; look at that place of the photo or the mesh")
        });
        events.chain(counts).collect()
    }

    /// Does one step. `stop` may be raised by another thread at any time: the step in progress is then dropped.
    pub fn step(&mut self, stop: &AtomicBool) -> Result<StepOutcome> {
        let began = Instant::now();
        while self.stages.get(self.state.stage).is_some_and(|stage| self.state.step_in_stage >= stage.steps) {
            self.state.stage += 1;
            self.state.step_in_stage = 0;
            self.work = None;
        }
        let Some(&stage) = self.stages.get(self.state.stage) else { return Ok(StepOutcome::Finished) };
        self.enter(&stage);

        let Some(sums) = self.sum_gradient(&stage, stop)? else { return Ok(StepOutcome::Interrupted) };
        if self.state.step == 0 && self.leave_saddle() {
            self.enter(&stage);
            return self.step(stop);
        }
        self.move_parameters(&stage, &sums);

        self.state.step += 1;
        self.state.step_in_stage += 1;
        let look = self.settings.held_out_interval;
        let held_out_rmse =
            (look > 0 && self.state.step.is_multiple_of(look)).then(|| self.held_out_rmse(&stage, stop));
        self.state.seconds += began.elapsed().as_secs_f64();
        let row = LossRow {
            step: self.state.step,
            stage: stage.name(),
            seconds: self.state.seconds,
            loss: sums.loss,
            image_loss: sums.image_loss,
            consistency: sums.consistency,
            held_out_rmse: held_out_rmse.flatten(),
        };
        self.state.losses.push(row.clone());
        Ok(StepOutcome::Stepped(row))
    }
<<<<<<< HEAD

    /// Prepares what a stage needs, once.
    fn enter(&mut self, stage: &Stage) {
        if self.work.is_some() {
            return;
        }
        while self.state.map_size < stage.map_size {
            self.state.texels = doubled(&self.state.texels, self.state.map_size);
            self.state.map_size *= 2;
            self.state.moments = Moments::zeros(self.state.texels.len());
        }
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
        self.work = Some(StageWork { weights, parameters, gradient, targets, first_hits });
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

    /// The targets of a step: consecutive places of an endless list in which each epoch is a shuffle of all views.
    fn views_of_step(&self, step: usize) -> Vec<(usize, usize)> {
        let count = self.training.len();
        let per_step = self.settings.views_per_step.min(count);
        let shuffled = |epoch: usize| {
            let mut order: Vec<usize> = (0..count).collect();
            SequentialRandom::new(mix(self.settings.seed ^ ((epoch as u64) << 20))).shuffle(&mut order);
            order
        };
        let first = step * per_step;
        let mut epoch = first / count;
        let mut order = shuffled(epoch);
        (first..first + per_step)
            .map(|place| {
                if place / count != epoch {
                    epoch = place / count;
                    order = shuffled(epoch);
                }
                (order[place % count], epoch)
            })
            .collect()
    }

    /// The pixels of a view in its visit number `visit`: whole tiles, each tile once before any is repeated.
    fn pixels_of_visit(&self, target: &Target, visit: usize, quota: usize) -> Vec<u32> {
        let (width, height) = (target.camera.width, target.camera.height);
        if quota == 0 || quota >= width * height {
            return (0..(width * height) as u32).collect();
        }
        let (tiles_x, tiles_y) = (width.div_ceil(TILE_PIXELS), height.div_ceil(TILE_PIXELS));
        let mut tiles: Vec<usize> = (0..tiles_x * tiles_y).collect();
        SequentialRandom::new(mix(self.settings.seed ^ ((target.view as u64) << 32) ^ 0x7411)).shuffle(&mut tiles);
        let per_visit = quota.div_ceil(TILE_PIXELS * TILE_PIXELS).min(tiles.len());
        let mut pixels = Vec::with_capacity(quota + TILE_PIXELS * TILE_PIXELS);
        for place in 0..per_visit {
            let tile = tiles[(visit * per_visit + place) % tiles.len()];
            let (row, column) = (tile / tiles_x * TILE_PIXELS, tile % tiles_x * TILE_PIXELS);
            for row in row..(row + TILE_PIXELS).min(height) {
                for column in column..(column + TILE_PIXELS).min(width) {
                    pixels.push((row * width + column) as u32);
                }
            }
        }
        pixels
    }

    /// Adds up the gradient of a step into the stage's gradient, on the base level. `None` when stopped.
    fn sum_gradient(&mut self, stage: &Stage, stop: &AtomicBool) -> Result<Option<StepSums>> {
        let views = self.views_of_step(self.state.step);
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
        &mut self,
        work: &mut StageWork,
        views: &[(usize, usize)],
        stage: &Stage,
        stop: &AtomicBool,
    ) -> Result<Option<StepSums>> {
        let separate = self.settings.consistency != Consistency::None;
        let share = 1.0 / views.len() as f32;
        let sampler = EnvironmentSampler::new(&work.parameters.environment());
        let quota = if separate { 0 } else { self.settings.pixels_per_step.div_ceil(views.len()) };
        let quota = if self.settings.pixels_per_step == 0 { 0 } else { quota };
        let mut sums = StepSums::default();
        let mut view_gradients: Vec<ViewGradient<f32>> = Vec::new();
        let mut total: Option<Parameters<f32>> = None;
        for &(slot, visit) in views {
            let StageWork { weights, parameters, gradient, targets, first_hits } = &mut *work;
            let target = &targets[slot];
            let pixels = self.pixels_of_visit(target, visit, quota);
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
            self.note_non_finite(target, &totals, pixels.len())?;
            sums.image_loss += f64::from(totals.loss) * if separate { f64::from(share) } else { 1.0 };
            if separate {
                gradient.texels.pull_down(weights);
                view_gradients.push(ViewGradient::collect(&gradient.texels.levels[0].texels));
                let total = total.get_or_insert_with(|| Parameters {
                    texels: TexelPyramid {
                        levels: vec![crate::material::texels::Level {
                            width: stage.map_size,
                            height: stage.map_size,
                            texels: vec![[0.0; 8]; stage.map_size * stage.map_size],
                        }],
                    },
                    light: vec![[0.0; 3]; gradient.light.len()],
                    environment_size: gradient.environment_size,
                });
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

    /// Applies the consistency setting to the summed gradient. `false` when stopped.
    fn weigh_by_consistency(
        &self,
        work: &mut StageWork,
        views: &[(usize, usize)],
        view_gradients: &[ViewGradient<f32>],
        stage: &Stage,
        sampler: &EnvironmentSampler,
        sums: &mut StepSums,
        stop: &AtomicBool,
    ) -> bool {
        let count = stage.map_size * stage.map_size;
        let agreement = Agreement::of(view_gradients, count, None, f64::from);
        sums.consistency = agreement.value;
        let scale_all = |gradient: &mut Parameters<f32>, factor: f32| {
            for texel in &mut gradient.texels.levels[0].texels {
                texel[..7].iter_mut().for_each(|value| *value *= factor);
            }
            gradient.light.iter_mut().flatten().for_each(|value| *value *= factor);
        };
        match self.settings.consistency {
            Consistency::None => {}
            Consistency::Released => {
                let factor = released_factor(view_gradients, count);
                sums.consistency = factor.ln();
                sums.loss *= factor;
                scale_all(&mut work.gradient, factor as f32);
            }
            Consistency::Constant => {
                sums.loss *= agreement.value.exp();
                let mean_factor = agreement.value.exp() as f32;
                let gradient = &mut work.gradient;
                for (texel, &value) in gradient.texels.levels[0].texels.iter_mut().zip(&agreement.per_texel) {
                    let factor = value.exp();
                    texel[..7].iter_mut().for_each(|value| *value *= factor);
                }
                gradient.light.iter_mut().flatten().for_each(|value| *value *= mean_factor);
            }
            Consistency::Exact => {
                // L = mean(L_i) exp(V): grad L = exp(V) (grad mean + mean grad V).
                let factor = agreement.value.exp();
                sums.loss *= factor;
                scale_all(&mut work.gradient, factor as f32);
                let scale = (factor * sums.image_loss) as f32;
                for (&(slot, visit), view_gradient) in views.iter().zip(view_gradients) {
                    let direction = agreement.direction(view_gradient, f64::from);
                    if direction.is_empty() {
                        continue;
                    }
                    if !self.add_hessian_product(work, slot, visit, &direction, stage, sampler, scale, stop) {
                        return false;
                    }
                }
            }
        }
        true
    }

    /// Adds `scale` times the Hessian of a view's loss times a direction on the diffuse map. `false` when stopped.
    fn add_hessian_product(
        &self,
        work: &mut StageWork,
        slot: usize,
        visit: usize,
        direction: &[(u32, [f64; 3])],
        stage: &Stage,
        sampler: &EnvironmentSampler,
        scale: f32,
        stop: &AtomicBool,
    ) -> bool {
        let StageWork { weights, parameters, gradient, targets, first_hits } = work;
        let target = &targets[slot];
        let lift = |value: f32| Dual::new(value, 0.0f32);
        let mut base: Vec<Texel<Dual<f32>>> =
            parameters.texels.levels[0].texels.iter().map(|texel| texel.map(lift)).collect();
        // A direction of unit size keeps the tangents of f32 in range; the size is put back at the end.
        let size = direction.iter().flat_map(|(_, v)| v).fold(0.0f64, |size, value| size.max(value.abs()));
        if size == 0.0 {
            return true;
        }
        for (index, v) in direction {
            for channel in 0..3 {
                base[*index as usize][channel].tangent = (v[channel] / size) as f32;
            }
        }
        let dual = Parameters {
            texels: TexelPyramid::from_base(base, weights),
            light: parameters.light.iter().map(|radiance| radiance.map(lift)).collect(),
            environment_size: parameters.environment_size,
        };
        let mut d_dual = Parameters {
            texels: TexelPyramid::<Dual<f32>>::zeros(weights),
            light: vec![[Dual::default(); 3]; dual.light.len()],
            environment_size: dual.environment_size,
        };
        let pixels = self.pixels_of_visit(target, visit, 0);
        let tracer = self.tracer(stage, parameters, sampler, target);
        let rays = self.rays(target, &first_hits[slot]);
        let loss = self.view_loss(target, 1.0 / (3.0 * pixels.len() as f32));
        accumulate(&tracer, &rays, &pixels, self.pass_key(target), &dual, &loss, &mut d_dual, stop);
        if stop.load(Ordering::Relaxed) {
            return false;
        }
        d_dual.texels.pull_down(weights);
        let factor = scale * size as f32;
        for (texel, d) in gradient.texels.levels[0].texels.iter_mut().zip(&d_dual.texels.levels[0].texels) {
            for number in 0..7 {
                texel[number] += factor * d[number].tangent;
            }
        }
        for (light, d) in gradient.light.iter_mut().zip(&d_dual.light) {
            for channel in 0..3 {
                light[channel] += factor * d[channel].tangent;
            }
        }
        true
    }

    fn tracer<'a>(
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
                background_visible: self.scene.background == crate::scene::Background::Environment,
                // Samples share a pixel between them.
                camera_cone_radians: target.camera.pixel_angle_radians() / (self.settings.samples as f32).sqrt(),
                bounce_cone_radians: 0.1,
            },
        }
    }

    fn rays<'a>(&'a self, target: &'a Target, first_hits: &'a Option<FirstHits>) -> CameraRays<'a> {
        let filter = self.settings.pixel_filter;
        match first_hits {
            Some(first_hits) => CameraRays::cached(&self.surface, &target.camera, filter, first_hits),
            None => CameraRays::fresh(&self.surface, &target.camera, filter, self.settings.samples),
        }
    }

    fn view_loss<'a>(&'a self, target: &'a Target, weight: f32) -> ViewLoss<'a> {
        let gain = self.state.log_gains[target.view].exp();
        let use_background = self.settings.background == BackgroundEvidence::Use;
        ViewLoss::new(&self.scene, target, weight, gain, use_background)
    }

    fn pass_key(&self, target: &Target) -> PassKey {
        PassKey { seed: self.settings.seed, step: self.state.step as u32, view: target.view as u32 }
    }

    /// Counts pixels that were not finite; too many of them end the fit.
    fn note_non_finite(&mut self, target: &Target, totals: &PassTotals<f32>, pixels: usize) -> Result<()> {
        let Some(pixel) = totals.first_non_finite else { return Ok(()) };
        let (row, column) = (pixel / target.camera.width, pixel % target.camera.width);
        let name = self.scene.views[target.view].name.clone();
        self.count_non_finite(
            format!("radiance in view {name}, first at row {row} column {column}"),
            totals.non_finite_pixels,
        );
        if totals.non_finite_pixels as f64 > MAX_NON_FINITE_SHARE * pixels as f64 {
            return Err(Error::new(
                ErrorKind::NonFinite,
                format!("{} of {pixels} pixels of a step are not finite", totals.non_finite_pixels),
            )
            .at(Place::Pixel { view: name, row, column })
            .remedy("the last checkpoint is good: resume from it with smaller rates"));
        }
        Ok(())
    }

    fn count_non_finite(&mut self, name: String, count: u64) {
        match self.state.non_finite.iter_mut().find(|(known, _)| *known == name) {
            Some((_, total)) => *total += count,
            None => self.state.non_finite.push((name, count)),
        }
    }

    /// Detects the paper's start, where every gradient is exactly zero, and leaves it. `true` when it did.
    fn leave_saddle(&mut self) -> bool {
        if self.settings.start != Start::Paper {
            return false;
        }
        let Some(work) = &self.work else { return false };
        let still = work.gradient.texels.levels[0].texels.iter().all(|texel| texel[..6].iter().all(|&d| d == 0.0))
            && work.gradient.light.iter().flatten().all(|&d| d == 0.0);
        if !still || self.state.events.iter().any(|event| event.contains("saddle")) {
            return false;
        }
        self.state.events.push(
            "The start of diffuse 0 and light 0 is a saddle: the gradient is exactly zero (norm 0). It was left by the \
             measured start: light from the photographs, one grey for the surface."
                .into(),
        );
        let values = self.measured_start();
        self.begin_from(values, None);
        true
    }

    /// Moves texels, light and gains along the summed gradient.
    fn move_parameters(&mut self, stage: &Stage, sums: &StepSums) {
        let Some(work) = &mut self.work else { return };
        let rate = stage.rate(self.state.step_in_stage, self.settings.final_rate);
        let free = if stage.kind == StageKind::All { rate } else { 0.0 };
        let rates = TexelRates {
            diffuse: rate * self.settings.rate_diffuse,
            specular: free * self.settings.rate_specular,
            log_width: free * self.settings.rate_roughness,
        };
        let base = &mut work.gradient.texels.levels[0].texels;
        let texels = self.state.moments.step_texels(&mut self.state.texels, base, rates);
        let mut light = 0;
        if self.settings.fixed_light {
            work.gradient.light.fill([0.0; 3]);
        } else {
            let mean = mean_radiance(&self.state.light, work.parameters.environment_size);
            let rate = rate * self.settings.rate_light;
            light = self.state.light_moments.step_light(&mut self.state.light, &mut work.gradient.light, mean, rate);
        }
        work.parameters.texels.levels[0].texels.clone_from(&self.state.texels);
        work.parameters.texels.rebuild(&work.weights);
        work.parameters.light.clone_from(&self.state.light);
        if self.settings.exposure {
            for &(view, d_gain) in &sums.gain_derivatives {
                let gain = self.state.log_gains[view].exp();
                let direction = self.state.gain_moments.direction_of(view, d_gain * gain);
                self.state.log_gains[view] -= rate * RATE_GAIN * direction;
            }
            // The mean logarithm stays zero: a common gain belongs to the light.
            let mean =
                self.training.iter().map(|&view| self.state.log_gains[view]).sum::<f32>() / self.training.len() as f32;
            for &view in &self.training {
                self.state.log_gains[view] -= mean;
            }
        }
        for (name, count) in [("gradient of a texel", texels), ("gradient of the light", light)] {
            if count > 0 {
                self.count_non_finite(name.into(), count as u64);
            }
        }
    }

    /// Root mean squared error over the held-out views, on shrunken photographs. `None` without such views.
    fn held_out_rmse(&self, stage: &Stage, stop: &AtomicBool) -> Option<f64> {
        let work = self.work.as_ref()?;
        let sampler = EnvironmentSampler::new(&work.parameters.environment());
        let (mut sum, mut count) = (0.0f64, 0.0f64);
        for target in &self.held_out {
            let tracer = self.tracer(stage, &work.parameters, &sampler, target);
            let rays = CameraRays::fresh(&self.surface, &target.camera, self.settings.pixel_filter, 4);
            let key = PassKey { seed: self.settings.seed ^ 0xe7a1, step: 0, view: target.view as u32 };
            let errors: Vec<Option<f64>> = (0..target.pixel_count())
                .into_par_iter()
                .map_init(PathArena::default, |arena, pixel| {
                    let (photo, state) = target.at(&self.scene, pixel);
                    if stop.load(Ordering::Relaxed) || !state.is_surface() || state.is_clipped() {
                        return None;
                    }
                    let estimate = estimate_pixel(&tracer, &rays, pixel, key, &work.parameters, arena);
                    let error = (0..3)
                        .map(|c| f64::from((estimate.first[c] - photo[c]) * (estimate.second[c] - photo[c])))
                        .sum::<f64>();
                    (estimate.escaped == 0.0 && error.is_finite()).then_some(error / 3.0)
                })
                .collect();
            for error in errors.into_iter().flatten() {
                sum += error;
                count += 1.0;
            }
        }
        (count > 0.0).then(|| (sum / count).max(0.0).sqrt())
    }
}

/// What a step added up beside its gradient.
#[derive(Clone, Debug, Default)]
struct StepSums {
    loss: f64,
    image_loss: f64,
    consistency: f64,
    gain_derivatives: Vec<(usize, f32)>,
}

fn clear(gradient: &mut Parameters<f32>) {
    for level in &mut gradient.texels.levels {
        level.texels.par_iter_mut().with_min_len(1 << 14).for_each(|texel| *texel = [0.0; 8]);
    }
    gradient.light.fill([0.0; 3]);
}

fn add_scaled(total: &mut Parameters<f32>, part: &Parameters<f32>, factor: f32) {
    let (total_texels, part_texels) = (&mut total.texels.levels[0].texels, &part.texels.levels[0].texels);
    total_texels.par_iter_mut().zip(part_texels).with_min_len(1 << 14).for_each(|(total, part)| {
        if part[7] != 0.0 {
            for number in 0..7 {
                total[number] += factor * part[number];
            }
            total[7] += part[7];
        }
    });
    for (total, part) in total.light.iter_mut().zip(&part.light) {
        for channel in 0..3 {
            total[channel] += factor * part[channel];
        }
    }
}

/// Mean over the sphere of directions and the channels.
fn mean_radiance(light: &[[f32; 3]], (width, height): (usize, usize)) -> f32 {
    let sum: f64 = light
        .iter()
        .enumerate()
        .map(|(index, radiance)| {
            solid_angle_of_texel(index / width, width, height) * f64::from(radiance.iter().sum::<f32>())
        })
        .sum();
    (sum / 3.0 / (4.0 * std::f64::consts::PI)) as f32
}

/// Maps of twice the size: each texel becomes four.
fn doubled(texels: &[Texel<f32>], size: usize) -> Vec<Texel<f32>> {
    (0..4 * size * size)
        .map(|index| {
            let (row, column) = (index / (2 * size), index % (2 * size));
            texels[row / 2 * size + column / 2]
        })
        .collect()
=======
>>>>>>> hard
}
