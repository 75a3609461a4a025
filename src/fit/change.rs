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

/// Settings that cannot change: shapes, random numbers and the order of stages hang on them.
const FIXED: [&str; 11] = [
    "seed",
    "method",
    "map-size",
    "environment-height",
    "levels",
    "steps",
    "start",
    "solver-choices",
    "solver-rounds",
    "solver-grid",
    "solver-levels",
];
/// Settings that what a stage keeps between its steps was made for.
const OF_STAGE_WORK: [&str; 7] =
    ["exclude", "samples", "pixel-filter", "views-per-step", "pixels-per-step", "consistency", "first-hits-mib"];

impl FitSettings {
    /// Whether a setting, by its name on the command line, may change while a fit runs. `false` for unknown names.
    pub fn changes_mid_run(name: &str) -> bool {
        !FIXED.contains(&name) && FitSettings::default().get(name).is_ok()
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
        settings.validate()?;
        let changed: Vec<String> = self.settings.differences(&settings).into_iter().map(|(name, _, _)| name).collect();
        if let Some(name) = changed.iter().find(|name| FIXED.contains(&name.as_str())) {
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
        if stage_moved || changed.iter().any(|name| OF_STAGE_WORK.contains(&name.as_str())) {
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
