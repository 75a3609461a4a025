//! How a fit begins: anew from a scene, or from a saved state.

use super::adam::Moments;
use super::evidence;
use super::figures::LiveFigures;
use super::fitter::Fitter;
use super::schedule::stages;
use super::settings::{FitSettings, Method, Start};
use super::solver::light_evidence::LightKnown;
use super::solver::scene::foretold_gains;
use super::start;
use super::state::FitState;
use super::suited::Suited;
use super::targets::{held_out_targets, targets};
use super::views::{training_views, uses_of};
use crate::error::{Error, ErrorKind, Result};
use crate::light::Environment;
use crate::render::Surface;
use crate::scene::Scene;
use std::sync::Arc;

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
}
