//! Settings that change while a fit runs.
//!
//! A change takes effect between two steps. What a step draws stays a function of settings and state alone, so a fit
//! that is changed, saved and taken up with the new settings goes on bit for bit like one that was not interrupted.

use super::evidence;
use super::fitter::Fitter;
use super::settings::{FitSettings, Method};
use super::targets::held_out_targets;
use super::views::{ViewUse, training_views, uses_of};
use crate::error::{Error, ErrorKind, Place, Result};

/// How far a change of a setting reaches while a fit runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Reach {
    /// The whole fit, so that it cannot change: shapes, random numbers and the order of stages hang on it.
    Fit,
    /// What a stage keeps between its steps, which is made anew.
    StageWork,
    /// The steps to come.
    NextSteps,
}

/// Defines [`reach_of`]: a setting that is not listed does not compile.
macro_rules! reaches {
    ($($setting:ident: $reach:ident,)*) => {
        /// How far a change of a setting reaches, by its name on the command line; `None` for unknown names.
        fn reach_of(name: &str) -> Option<Reach> {
            let FitSettings { $($setting: _),* } = FitSettings::default();
            let reaches = [$((stringify!($setting), Reach::$reach)),*];
            reaches.into_iter().find(|(setting, _)| setting.replace('_', "-") == name).map(|(_, reach)| reach)
        }
    };
}

reaches! {
    seed: Fit,
    method: Fit,
    map_size: Fit,
    environment_height: Fit,
    steps: Fit,
    steps_diffuse: NextSteps,
    steps_all: NextSteps,
    views_per_step: StageWork,
    pixels_per_step: StageWork,
    samples: StageWork,
    bounces: NextSteps,
    levels: Fit,
    pixel_filter: StageWork,
    lobe: Fit,
    consistency: StageWork,
    background: NextSteps,
    exposure: NextSteps,
    start: Fit,
    fixed_light: NextSteps,
    fixed_maps: Fit,
    rate_diffuse: NextSteps,
    rate_specular: NextSteps,
    rate_roughness: NextSteps,
    rate_light: NextSteps,
    light_smoothness: NextSteps,
    final_rate: NextSteps,
    lobe_ramp: NextSteps,
    first_hits_mib: StageWork,
    solver_rounds: Fit,
    solver_grid: Fit,
    solver_levels: Fit,
    solver_choices: Fit,
    solver_refine: NextSteps,
    held_out_interval: NextSteps,
    exclude: StageWork,
}

impl FitSettings {
    /// Whether a setting, by its name on the command line, may change while a fit runs. `false` for unknown names.
    pub fn changes_mid_run(name: &str) -> bool {
        reach_of(name).is_some_and(|reach| reach != Reach::Fit)
    }
}

impl Fitter {
    /// Goes on with other settings from the next step on.
    ///
    /// # Errors
    /// `InvalidSetting` naming the setting when it is out of its range, cannot change while a fit runs, asks for fewer
    /// steps than are done, or leaves no view to fit to. The fit then goes on as it was.
    pub fn change(&mut self, mut settings: FitSettings) -> Result<()> {
        if settings.method == Method::Automatic {
            settings.method = self.settings.method;
        }
        self.scene.spell_names(&mut settings.exclude);
        settings.validate()?;
        let changed: Vec<String> = self.settings.differences(&settings).into_iter().map(|(name, _, _)| name).collect();
        if let Some(name) = changed.iter().find(|name| reach_of(name) == Some(Reach::Fit)) {
            return Err(Error::new(ErrorKind::InvalidSetting, "this cannot change while a fit runs")
                .at(Place::Setting(name.clone()))
                .remedy("start a new run with it"));
        }
        let uses = uses_of(&self.scene, &settings.exclude);
        let training = training_views(&uses, &settings)?;
        evidence::check(&self.scene, &training, &settings)?;
        let stage_before = self.stage().map(|stage| (stage.kind, stage.photo_level));
        self.state.replan(&settings)?;

        // Nothing fails from here on.
        if uses != self.uses {
            self.held_out = held_out_targets(&self.scene, &uses);
            for (rmse, _) in self.figures.view_rmse.iter_mut().zip(&uses).filter(|(_, own)| **own == ViewUse::LeftOut) {
                *rmse = None;
            }
        }
        let stage_moved = self.stage().map(|stage| (stage.kind, stage.photo_level)) != stage_before;
        if stage_moved || changed.iter().any(|name| reach_of(name) == Some(Reach::StageWork)) {
            self.work = None;
        }
        // The solver's cache hangs on many of them; it is traced anew in a few seconds.
        if !changed.is_empty() {
            self.solver = None;
        }
        self.uses = uses;
        self.training = training;
        self.settings = settings;
        Ok(())
    }
}
