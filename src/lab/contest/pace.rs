//! As many steps of Adam as there is time for.
//!
//! Step sizes fall along a cosine over the steps of a kind, so a fit must know how many there will be. Nobody knows
//! beforehand what a step costs; so it is measured on the way, and the plan is changed between steps.

use crate::error::Result;
use crate::fit::schedule::{Stage, StageKind};
use crate::fit::{FitSettings, Fitter};

/// Share of the time after the first step that belongs to diffuse and light alone.
const DIFFUSE_SHARE: f64 = 0.35;
/// Share of the time that is planned with: what is left over serves as margin.
const PLANNED: f64 = 0.97;
/// Steps between two looks.
const INTERVAL: usize = 6;
/// Steps of a kind, at most.
const MOST_STEPS: usize = 1_000_000;

/// Watches what steps cost.
pub struct Pace {
    began: Option<f64>,
    last: f64,
    seconds_a_pixel: f64,
    since: usize,
}

impl Default for Pace {
    fn default() -> Self {
        Pace { began: None, last: 0.0, seconds_a_pixel: 0.0, since: 0 }
    }
}

impl Pace {
    /// Looks at the clock after a step of `stage`, and now and then changes the numbers of steps so that the fit ends at
    /// `end` seconds.
    ///
    /// # Errors
    /// Those of [`Fitter::change`] but for a plan that cannot change any more, which is left as it is.
    pub fn after_step(&mut self, fitter: &mut Fitter, stage: &Stage, seconds: f64, end: f64) -> Result<()> {
        let began = *self.began.get_or_insert(seconds);
        // The first step makes what later ones share.
        if self.last > 0.0 {
            let now = (seconds - self.last) / pixels(fitter, stage);
            let share = if self.seconds_a_pixel > 0.0 { 0.2 } else { 1.0 };
            self.seconds_a_pixel += share * (now - self.seconds_a_pixel);
            self.since += 1;
        }
        self.last = seconds;
        if self.since < INTERVAL {
            return Ok(());
        }
        self.since = 0;
        let Some(&current) = fitter.stage() else { return Ok(()) };
        let deadline = began
            + (end * PLANNED - began)
                * if current.kind == StageKind::Diffuse && fitter.settings().steps_all > 0 {
                    DIFFUSE_SHARE
                } else {
                    1.0
                };
        let done = current.steps_before + fitter.state().step_in_stage;
        let left = current.steps_of_kind.saturating_sub(done);
        let cost = self.cost_left(fitter, &current);
        let wanted = done as f64 + left as f64 * (deadline - seconds).max(0.0) / cost.max(1e-9);
        let wanted = (wanted.round() as usize).clamp(done + fitter.settings().levels, MOST_STEPS);
        if wanted.abs_diff(current.steps_of_kind) * 20 < current.steps_of_kind {
            return Ok(());
        }
        let own = fitter.settings().clone();
        let settings = match current.kind {
            StageKind::Diffuse => FitSettings { steps_diffuse: wanted, ..own },
            _ => FitSettings { steps_all: wanted, ..own },
        };
        let _ = fitter.change(settings);
        Ok(())
    }

    /// Seconds that the rest of the current kind takes.
    fn cost_left(&self, fitter: &Fitter, current: &Stage) -> f64 {
        let state = fitter.state();
        let rest = state.plan.iter().enumerate().skip(state.stage).filter(|(_, stage)| stage.kind == current.kind);
        let seconds = rest.map(|(number, stage)| {
            let done = if number == state.stage { state.step_in_stage } else { 0 };
            stage.steps.saturating_sub(done) as f64 * pixels(fitter, stage)
        });
        seconds.sum::<f64>() * self.seconds_a_pixel
    }
}

/// Pixels of a step of a stage, about.
fn pixels(fitter: &Fitter, stage: &Stage) -> f64 {
    let settings = fitter.settings();
    let all =
        fitter.scene().views.iter().map(|view| (view.camera.width * view.camera.height) >> (2 * stage.photo_level));
    let mean = all.sum::<usize>() as f64 / fitter.scene().views.len().max(1) as f64;
    let whole = mean * settings.views_per_step as f64;
    let most = if settings.pixels_per_step == 0 { f64::INFINITY } else { settings.pixels_per_step as f64 };
    whole.min(most).max(1.0)
}
