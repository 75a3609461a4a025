//! How long a fit will still take, guessed from how long it took so far.

use crate::fit::LossRow;
use crate::fit::schedule::{Stage, StageKind};

/// Steps of the same stage whose pace counts.
const STEPS_OF_PACE: usize = 12;
/// Seconds that the usual machine has in its favour against the one at hand: the first ones tell little.
const SECONDS_OF_THE_USUAL_MACHINE: f64 = 0.5;

/// How fast a fit goes, after its last step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pace {
    /// Steps a second over the last steps.
    pub steps_per_second: f64,
    /// Seconds until the last step is done; not a number before the first.
    pub seconds_left: f64,
    /// The same without the next step.
    pub seconds_after_next: f64,
    /// Seconds for what comes after the last step.
    pub finishing_seconds: f64,
}

/// The pace after the last of `losses`, of which `first_of_session` is the first that was done since the fit was started or
/// taken up.
///
/// Steps of the optimiser all take about as long. Those of the solver do not: each is expected to take what it took on a usual machine
/// for so many million pixels of surface, times how long those so far took beside that.
pub fn pace(plan: &[Stage], losses: &[LossRow], first_of_session: usize, surface_megapixels: f64) -> Pace {
    let finishing = FINISHING_SECONDS.0 + FINISHING_SECONDS.1 * surface_megapixels;
    let Some(last) = losses.last() else {
        let (seconds_left, seconds_after_next) = (f64::NAN, f64::NAN);
        return Pace { steps_per_second: 0.0, seconds_left, seconds_after_next, finishing_seconds: finishing };
    };
    let same_stage = losses.iter().rev().take_while(|row| row.stage == last.stage).take(STEPS_OF_PACE).count();
    let first = losses.len() - same_stage;
    let before = if first > 0 { losses[first - 1].seconds } else { 0.0 };
    let steps_per_second = same_stage as f64 / (last.seconds - before).max(1e-9);

    let steps: Vec<(&Stage, usize)> =
        plan.iter().flat_map(|stage| (0..stage.steps).map(move |step| (stage, step))).collect();
    let (done, left) = steps.split_at(losses.len().min(steps.len()));
    if !done.last().is_some_and(|(stage, _)| stage.kind.is_of_solver()) {
        let seconds_left = left.len() as f64 / steps_per_second;
        let seconds_after_next = left.len().saturating_sub(1) as f64 / steps_per_second;
        return Pace { steps_per_second, seconds_left, seconds_after_next, finishing_seconds: finishing };
    }
    // The first step of a session has the cache in it, which may be there already: it tells nothing.
    let (mut taken, mut expected) = (SECONDS_OF_THE_USUAL_MACHINE, SECONDS_OF_THE_USUAL_MACHINE);
    for (number, (pair, (stage, step))) in (1..).zip(losses.windows(2).zip(&done[1..])) {
        if number == first_of_session {
            continue;
        }
        taken += pair[1].seconds - pair[0].seconds;
        expected += usual_seconds(plan, stage, *step, surface_megapixels);
    }
    let slowness = taken / expected;
    let usual = |steps: &[(&Stage, usize)]| -> f64 {
        steps.iter().map(|(stage, step)| usual_seconds(plan, stage, *step, surface_megapixels)).sum()
    };
    Pace {
        steps_per_second,
        seconds_left: slowness * usual(left),
        seconds_after_next: slowness * left.get(1..).map_or(0.0, usual),
        finishing_seconds: slowness * finishing,
    }
}

/// Seconds of all that comes after the last step, most of them for scores: so many, and for each million pixels of surface.
const FINISHING_SECONDS: (f64, f64) = (13.0, 7.5);
/// The same of making a level ready, at its pixels.
const LEVEL_SECONDS: (f64, f64) = (2.0, 4.0);
/// The same of a round on the light.
const ROUND_SECONDS: (f64, f64) = (1.0, 0.3);
/// The same of maps.
const MAPS_SECONDS: (f64, f64) = (0.2, 8.5);
/// Seconds of the descent from whole pixels.
const REFINE_SECONDS: (f64, f64) = (12.0, 14.5);
/// Millions of pixels that the solver keeps, about: more of them are thinned out.
const MOST_MEGAPIXELS: f64 = 4.0;
/// Seconds of a step of the optimiser, about.
const OPTIMISER_SECONDS: f64 = 0.3;

/// What a step takes on a machine of two processors, as was measured on captures of .6 to 4 million pixels of surface.
fn usual_seconds(plan: &[Stage], stage: &Stage, step: usize, surface_megapixels: f64) -> f64 {
    let megapixels = (surface_megapixels * 0.25f64.powi(stage.photo_level as i32)).min(MOST_MEGAPIXELS);
    let linear = |(fixed, each): (f64, f64)| fixed + each * megapixels;
    let is_first_of_level =
        step == 0 && plan.iter().find(|own| own.is_of_level_of(stage)).is_some_and(|own| own.kind == stage.kind);
    let ready = if is_first_of_level && stage.kind.is_of_solver() { linear(LEVEL_SECONDS) } else { 0.0 };
    ready
        + match stage.kind {
            StageKind::WideLight | StageKind::NarrowLight => linear(ROUND_SECONDS),
            StageKind::Maps => linear(MAPS_SECONDS),
            StageKind::Refine => linear(REFINE_SECONDS),
            StageKind::Diffuse | StageKind::All => OPTIMISER_SECONDS,
        }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::schedule::stages;
    use crate::fit::{FitSettings, Method};

    const MEGAPIXELS: f64 = 5.0;

    /// A history in which each step takes its seconds.
    fn history(plan: &[Stage], mut seconds: impl FnMut(&Stage, usize) -> f64) -> Vec<LossRow> {
        let steps = plan.iter().flat_map(|stage| (0..stage.steps).map(move |step| (stage, step)));
        let mut now = 0.0;
        let row = |(index, (stage, step)): (usize, (&Stage, usize))| {
            now += seconds(stage, step);
            LossRow {
                step: index + 1,
                stage: stage.name(),
                seconds: now,
                loss: 1.0,
                image_loss: 1.0,
                consistency: 0.0,
                surface_rmse: None,
                held_out_rmse: None,
            }
        };
        steps.enumerate().map(row).collect()
    }

    #[test]
    fn steps_of_the_optimiser_go_on_at_the_pace_of_the_last() {
        let settings =
            FitSettings { method: Method::Adam, steps_diffuse: 4, steps_all: 20, levels: 1, ..FitSettings::default() };
        let plan = stages(&settings);
        let whole = history(&plan, |stage, _| if stage.kind == StageKind::Diffuse { 9.0 } else { 0.5 });
        let Pace { steps_per_second, seconds_left, .. } = pace(&plan, &whole[..14], 0, MEGAPIXELS);
        assert!((steps_per_second - 2.0).abs() < 1e-9 && (seconds_left - 5.0).abs() < 1e-9);
        assert!(pace(&plan, &[], 0, MEGAPIXELS).seconds_left.is_nan());
    }

    #[test]
    fn steps_of_the_solver_are_weighed_by_pixels_and_by_what_was_done() {
        let plan = stages(&FitSettings { method: Method::Solver, ..FitSettings::default() });
        let steps: usize = plan.iter().map(|stage| stage.steps).sum();
        for (slowness, first) in [(1.0, 5.0), (3.0, 0.0), (0.2, 60.0)] {
            let mut is_first = true;
            let seconds = |stage: &Stage, step: usize| {
                let own = slowness * usual_seconds(&plan, stage, step, MEGAPIXELS);
                own + if std::mem::take(&mut is_first) { first } else { 0.0 }
            };
            let whole = history(&plan, seconds);
            let end = whole.last().unwrap().seconds;
            for done in steps / 2..steps {
                let told = pace(&plan, &whole[..done], 0, MEGAPIXELS).seconds_left;
                let left = end - whole[done - 1].seconds;
                // The usual machine has some seconds in its favour.
                assert!((told / left - 1.0).abs() < 0.5, "{slowness} {done}: {told} of {left}");
            }
            let told = pace(&plan, &whole[..steps - 1], 0, MEGAPIXELS).seconds_left;
            let left = end - whole[steps - 2].seconds;
            assert!((told / left - 1.0).abs() < 0.2, "{slowness}: {told} of {left}");
        }
        // What a fit that was taken up caches anew is no sign of slowness.
        let mut number = 0;
        let again = history(&plan, |stage, step| {
            number += 1;
            usual_seconds(&plan, stage, step, MEGAPIXELS) + if number == 5 { 100.0 } else { 0.0 }
        });
        let told = |first_of_session| pace(&plan, &again[..6], first_of_session, MEGAPIXELS);
        let left: f64 = again[steps - 1].seconds - again[5].seconds;
        assert!((told(4).seconds_left / left - 1.0).abs() < 0.1 && told(0).seconds_left > 2.0 * left);
        let next = again[6].seconds - again[5].seconds;
        assert!((told(4).seconds_left - told(4).seconds_after_next - next).abs() < 0.1 * next);
        let first = &history(&plan, |_, _| 1.0)[..1];
        assert!(pace(&plan, first, 0, 0.1).seconds_left < 0.5 * pace(&plan, first, 0, MEGAPIXELS).seconds_left);
    }
}
