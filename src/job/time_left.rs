//! How long a fit will still take, guessed from how long it took so far.

use crate::fit::LossRow;
use crate::fit::schedule::{Stage, StageKind};

/// Steps of the same stage whose pace counts.
const STEPS_OF_PACE: usize = 12;

/// Steps a second over the last steps, and seconds left, after the last of `losses`.
///
/// Steps of the optimiser all take about as long. Those of the solver do not: what is left is weighed by what each kind
/// costs beside the others, and measured by what was done.
pub fn pace(plan: &[Stage], losses: &[LossRow]) -> (f64, f64) {
    let Some(last) = losses.last() else { return (0.0, f64::NAN) };
    let same_stage = losses.iter().rev().take_while(|row| row.stage == last.stage).take(STEPS_OF_PACE).count();
    let first = losses.len() - same_stage;
    let before = if first > 0 { losses[first - 1].seconds } else { 0.0 };
    let per_second = same_stage as f64 / (last.seconds - before).max(1e-9);
    let (mut done, mut left, mut steps_left) = (0.0, 0.0, 0usize);
    let mut is_of_solver = false;
    let steps = plan.iter().flat_map(|stage| (0..stage.steps).map(move |step| (stage, step)));
    for (number, (stage, step)) in steps.enumerate() {
        if number < losses.len() {
            done += relative_cost(plan, stage, step);
            is_of_solver = stage.kind.is_of_solver();
        } else {
            left += relative_cost(plan, stage, step);
            steps_left += 1;
        }
    }
    let seconds = if is_of_solver { last.seconds / done.max(1e-9) * left } else { steps_left as f64 / per_second };
    (per_second, seconds)
}

/// What a step costs, in rounds on the light at full size: about what was measured.
fn relative_cost(plan: &[Stage], stage: &Stage, step: usize) -> f64 {
    let shrunk = 0.5f64.powi(stage.photo_level as i32);
    let is_first_of_level =
        step == 0 && plan.iter().find(|own| own.is_of_level_of(stage)).is_some_and(|own| own.kind == stage.kind);
    // The cache is traced before the first step of a level.
    let cache = if is_first_of_level && stage.kind.is_of_solver() { 6.0 * shrunk } else { 0.0 };
    cache
        + match stage.kind {
            StageKind::WideLight | StageKind::NarrowLight => shrunk.sqrt(),
            StageKind::Maps => 10.0 * shrunk * shrunk.sqrt(),
            StageKind::Refine => 10.0,
            StageKind::Diffuse | StageKind::All => 0.3,
        }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::schedule::stages;
    use crate::fit::{FitSettings, Method};

    /// A history in which each step takes its seconds.
    fn history(plan: &[Stage], seconds: impl Fn(&Stage, usize) -> f64) -> Vec<LossRow> {
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
        let (per_second, left) = pace(&plan, &whole[..14]);
        assert!((per_second - 2.0).abs() < 1e-9 && (left - 5.0).abs() < 1e-9, "{per_second} {left}");
        assert!(pace(&plan, &[]).1.is_nan());
    }
}
