//! The loop body: one call, one optimiser step.
//!
//! Everything a step draws (views, pixels, directions) is a function of the seed and the step's number, and everything
//! it changes is in [`FitState`]; so a fit that is saved and taken up again goes on bit for bit as if it had not been
//! interrupted.

use super::figures::LiveFigures;
use super::gauge::GaugeRule;
use super::known_maps::KnownMaps;
use super::schedule::Stage;
use super::settings::FitSettings;
use super::solver::light_evidence::LightKnown;
use super::solver::{Choices, LobeTails, Objective, SolverScene};
use super::stage_work::StageWork;
use super::state::{FitState, LossRow};
use super::targets::Target;
use super::underway::WatchUnderway;
use super::views::{ViewUse, unknown_names};
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
