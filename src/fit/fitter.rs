//! The loop body: one call, one optimiser step.
//!
//! Everything a step draws (views, pixels, directions) is a function of the seed and the step's number, and everything
//! it changes is in [`FitState`]; so a fit that is saved and taken up again goes on bit for bit as if it had not been
//! interrupted.

use super::adam::Moments;
use super::evidence;
use super::figures::LiveFigures;
use super::gauge::GaugeRule;
use super::known_maps::KnownMaps;
use super::schedule::{Stage, stages};
use super::settings::{FitSettings, Method, Start};
use super::solver::light_evidence::LightKnown;
use super::solver::scene::foretold_gains;
use super::solver::{Choices, LobeTails, Objective, SolverScene};
use super::stage_work::StageWork;
use super::start;
use super::state::{FitState, LossRow};
use super::suited::Suited;
use super::targets::{Target, held_out_targets, targets};
use super::underway::WatchUnderway;
use super::views::{ViewUse, training_views, unknown_names, uses_of};
use crate::error::{Error, ErrorKind, Finding, Result, Severity};
use crate::light::Environment;
use crate::material::texels::{PyramidWeights, TexelPyramid, maps_from_texels};
use crate::material::{LobeModel, MaterialMaps};
use crate::render::cached::CachedTransport;
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
    pub(super) uses: Vec<ViewUse>,
    pub(super) training: Vec<usize>,
    pub(super) held_out: Vec<Target>,
    pub(super) state: FitState,
    pub(super) figures: LiveFigures,
    pub(super) work: Option<StageWork>,
    /// What the solver traced; `None` under Adam and before its first step.
    pub(super) solver: Option<SolverScene>,
    /// How often the photos that it has were halved.
    pub(super) solver_photo_level: usize,
    /// What the solver's light is known by; of nothing under Adam and before its first round on the light.
    pub(super) light_known: LightKnown,
    /// Transport of the surface that was cached before.
    pub(super) transport: Option<Arc<CachedTransport>>,
    /// What judging views say of the model's freedoms; `None` under Adam and before the maps of full size.
    pub(super) choices: Option<Arc<Choices>>,
    /// What the last maps that the solver made say of tails of lobes; no checkpoint holds it.
    pub(super) tails: Option<LobeTails>,
    /// Maps that are kept.
    pub(super) known_maps: Option<Arc<KnownMaps>>,
    /// Whether it was ended before its last step.
    pub(super) is_cut_short: bool,
    /// The objective before and after each step of the last descent; no checkpoint holds it.
    pub(super) descent: Vec<[Objective; 2]>,
}

impl Fitter {
    /// A new fit of a scene. `surface` holds the mesh with the atlas; `known_light` starts from a given environment. Where
    /// the method is [`Method::Automatic`], what suits the scene is taken, but for the size of the maps: [`Fitter::settings`]
    /// says what.
    ///
    /// # Errors
    /// A setting out of range; a scene of which nothing can be evidence, or whose photos and cameras do not go together.
    pub fn new(
        scene: Arc<Scene>,
        surface: Arc<Surface>,
        settings: FitSettings,
        known_light: Option<&Environment>,
    ) -> Result<Self> {
        let mut settings = settings;
        if settings.method == Method::Automatic {
            // The atlas of the surface was made for maps of this size.
            let map_size = settings.map_size;
            settings = Suited::to_unchecked(&scene).resolve(&settings, &settings.chosen());
            settings.map_size = map_size;
        }
        let mut fitter = Fitter::prepare(scene, surface, settings)?;
        fitter.state.plan = stages(&fitter.settings);
        let first_size = fitter.state.plan.first().map_or(fitter.settings.map_size, |stage| stage.map_size);
        let state = &mut fitter.state;
        state.log_gains = vec![0.0; fitter.scene.views.len()];
        if fitter.settings.exposure {
            let stops = fitter.training.iter().map(|&view| fitter.scene.views[view].exposure_prior_stops);
            let foretold = foretold_gains(stops);
            fitter.training.iter().zip(foretold).for_each(|(&view, gain)| state.log_gains[view] = gain);
        }
        state.gain_moments = Moments::zeros(fitter.scene.views.len());
        state.map_size = first_size;
        let values = match fitter.settings.start {
            Start::Measured => fitter.measured_start(),
            Start::Paper => start::paper(&fitter.settings),
        };
        fitter.begin_from(values, known_light);
        fitter.state.non_finite = evidence::defects_of_photos(&fitter.scene);
        Ok(fitter)
    }

    /// Takes up a fit from a saved state.
    ///
    /// Settings that may change while a fit runs may differ from those of the run so far: it then goes on with the new
    /// ones, as after [`Fitter::change`].
    ///
    /// # Errors
    /// As of [`Fitter::new`]; a state of another scene, other sizes or another plan.
    pub fn resume(
        scene: Arc<Scene>,
        surface: Arc<Surface>,
        mut settings: FitSettings,
        mut state: FitState,
    ) -> Result<Self> {
        // A run that recorded no method is what its plan says.
        if settings.method == Method::Automatic {
            let is_of_solver = state.plan.iter().any(|stage| stage.kind.is_of_solver());
            settings.method = if is_of_solver { Method::Solver } else { Method::Adam };
        }
        let mut fitter = Fitter::prepare(scene, surface, settings)?;
        let views = fitter.scene.views.len();
        let light = 2 * fitter.settings.environment_height * fitter.settings.environment_height;
        let texels = state.map_size.saturating_mul(state.map_size);
        let foreign = |why: &str| {
            Error::new(
                ErrorKind::InvalidScene,
                format!("the checkpoint belongs to another scene or other settings{why}"),
            )
            .remedy("resume with the scene and settings the run was started with")
        };
        if state.plan.is_empty() {
            state.plan = stages(&fitter.settings);
        }
        if state.stage <= state.plan.len() {
            state.replan(&fitter.settings).map_err(|error| foreign(&format!(": {}", error.message())))?;
        }
        // At the border of two stages the maps still have the size of the stage before.
        let stage = state.plan.get(state.stage).or(state.plan.last());
        let fits = stage.is_some_and(|stage| {
            state.map_size.is_power_of_two()
                && state.map_size <= stage.map_size
                && (state.map_size == stage.map_size || state.step_in_stage == 0)
                && state.step_in_stage <= stage.steps
        }) && state.stage <= state.plan.len()
            && state.texels.len() == texels
            && state.moments.is_of(texels)
            && (state.variances.is_empty() || state.variances.len() == texels)
            && state.light.len() == light
            && state.light_moments.is_of(light)
            && state.log_gains.len() == views
            && state.gain_moments.is_of(views);
        if !fits {
            return Err(foreign(""));
        }
        fitter.state = state;
        Ok(fitter)
    }

    fn prepare(scene: Arc<Scene>, surface: Arc<Surface>, mut settings: FitSettings) -> Result<Self> {
        settings.validate()?;
        scene.spell_names(&mut settings.exclude);
        let uses = uses_of(&scene, &settings.exclude);
        let training = training_views(&uses, &settings)?;
        evidence::check(&scene, &training, &settings)?;
        let held_out = held_out_targets(&scene, &uses);
        let figures = LiveFigures::new(scene.views.len());
        let state = FitState::default();
        Ok(Fitter {
            scene,
            surface,
            settings,
            uses,
            training,
            held_out,
            state,
            figures,
            work: None,
            solver: None,
            solver_photo_level: 0,
            light_known: LightKnown::default(),
            transport: None,
            choices: None,
            tails: None,
            known_maps: None,
            is_cut_short: false,
            descent: Vec::new(),
        })
    }

    pub(super) fn measured_start(&self) -> start::StartValues {
        let level = self.state.plan.first().map_or(0, |stage| stage.photo_level);
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

    /// The settings, resolved for the scene.
    pub fn settings(&self) -> &FitSettings {
        &self.settings
    }

    /// All that a checkpoint must hold.
    pub fn state(&self) -> &FitState {
        &self.state
    }

    /// What each view of the scene serves.
    pub fn view_uses(&self) -> &[ViewUse] {
        &self.uses
    }

    /// What the last steps found out on the way: errors of views, agreement of views.
    pub fn figures(&self) -> &LiveFigures {
        &self.figures
    }

    /// Number of steps of all stages.
    pub fn steps_total(&self) -> usize {
        self.state.plan.iter().map(|stage| stage.steps).sum()
    }

    /// The stage of the next step; `None` at the end.
    pub fn stage(&self) -> Option<&Stage> {
        self.state.plan.get(self.state.stage)
    }

    /// What fixes the scale between reflectance and light.
    pub fn gauge(&self) -> GaugeRule {
        if self.settings.fixed_maps {
            return GaugeRule::FixedMaps;
        }
        GaugeRule::of(self.scene.background, self.settings.background, self.settings.fixed_light, self.settings.method)
    }

    /// The maps as they are, of the size of the stage; those that are kept bit for bit.
    pub fn maps(&self) -> MaterialMaps {
        if let Some(known) = &self.known_maps {
            return known.maps.clone();
        }
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
        let texels = TexelPyramid::from_base(self.state.texels.clone(), &weights).with_model(self.settings.lobe);
        Parameters::new(texels, &self.environment())
    }

    /// What happened that the user should know, as findings.
    pub fn findings(&self) -> Vec<Finding> {
        let events = self.state.events.iter().map(|event| Finding::new(Severity::Note, "fit-event", event.to_string()));
        let counts = self.state.non_finite.iter().map(|(name, count)| {
            Finding::new(
                Severity::Warning,
                "non-finite",
                format!("{count} numbers were not finite or too large: {name}"),
            )
            .remedy("they were left out; look at that place of the photo or the mesh")
        });
        events.chain(counts).chain(self.setting_findings()).chain(self.tail_finding()).collect()
    }

    /// The objective before and after each step of the last descent, by what was learned of noise and gains then. Empty unless
    /// there was one since the fit was started or taken up.
    pub fn descent(&self) -> &[[Objective; 2]] {
        &self.descent
    }

    /// That lobes have tails which the model's do not have, where maps that the solver made since the fit was started or
    /// taken up show them.
    pub fn tail_finding(&self) -> Option<Finding> {
        if self.settings.lobe == LobeModel::Ggx {
            return None;
        }
        let tails = self.tails.filter(LobeTails::are_there)?;
        let message = format!(
            "highlights reach further than the model's lobes: as if {:.0} ± {:.0} % of each were three times as wide",
            100.0 * tails.share,
            100.0 * tails.error
        );
        Some(Finding::new(Severity::Warning, "lobes-with-tails", message).remedy(
            "specular and roughness maps are the nearest that Blinn-Phong lobes come to, and their intervals do not know of it; measured surfaces and GGX have such tails: --lobe ggx fits them",
        ))
    }

    /// Takes transport of this very surface that somebody cached already: where it is what the solver would trace, it begins
    /// the sooner.
    pub(crate) fn take_transport(&mut self, transport: Arc<CachedTransport>) {
        self.transport = Some(transport);
    }

    /// What the settings ask for that this scene does not have.
    pub fn setting_findings(&self) -> Vec<Finding> {
        unknown_names(&self.scene, &self.settings.exclude)
    }

    /// Steps until the fit is done. Whether it is, and `stop` was not raised before; it may be gone on with then.
    ///
    /// # Errors
    /// As of [`Fitter::step`].
    pub fn finish(&mut self, stop: &AtomicBool) -> Result<bool> {
        loop {
            match self.step(stop)? {
                StepOutcome::Stepped(_) => {}
                StepOutcome::Finished => return Ok(true),
                StepOutcome::Interrupted => return Ok(false),
            }
        }
    }

    /// Does one step. `stop` may be raised by another thread at any time: the step in progress is then dropped.
    ///
    /// # Errors
    /// `NonFinite` when too much of a step is not finite; photos of which none shows the surface.
    pub fn step(&mut self, stop: &AtomicBool) -> Result<StepOutcome> {
        self.step_watched(stop, &mut |_| {})
    }

    /// [`Fitter::step`]; `watch` hears of maps and light within a step that takes long.
    pub(crate) fn step_watched(&mut self, stop: &AtomicBool, watch: &mut WatchUnderway) -> Result<StepOutcome> {
        let began = Instant::now();
        if !self.look_at_held_out(stop) {
            return Ok(StepOutcome::Interrupted);
        }
        while self.stage().is_some_and(|stage| self.state.step_in_stage >= stage.steps) {
            self.state.stage += 1;
            self.state.step_in_stage = 0;
            self.work = None;
        }
        let Some(&stage) = self.stage() else { return Ok(StepOutcome::Finished) };
        if stage.kind.is_of_solver() {
            return self.solver_step(&stage, stop, watch);
        }
        self.enter(&stage);

        let Some(mut sums) = self.sum_gradient(&stage, stop)? else { return Ok(StepOutcome::Interrupted) };
        if self.state.step == 0 && self.leave_saddle() {
            self.enter(&stage);
            return self.step(stop);
        }
        self.move_parameters(&stage, &sums);
        self.figures.keep(&mut sums, stage.map_size);

        self.state.step += 1;
        self.state.step_in_stage += 1;
        self.state.seconds += began.elapsed().as_secs_f64();
        let row = LossRow {
            step: self.state.step,
            stage: stage.name(),
            seconds: self.state.seconds,
            loss: sums.loss,
            image_loss: sums.image_loss,
            consistency: sums.consistency,
            surface_rmse: sums.surface_rmse(),
            held_out_rmse: None,
        };
        self.state.losses.push(row);
        // A look that is stopped is made up for at the begin of the next step.
        self.look_at_held_out(stop);
        match self.state.losses.last() {
            Some(row) => Ok(StepOutcome::Stepped(row.clone())),
            None => Err(Error::new(ErrorKind::Internal, "a step left no line in the history")),
        }
    }
}
