//! How long a fit will still take, guessed from how long it took so far.

use crate::fit::LossRow;
use crate::fit::schedule::{Stage, StageKind};

/// Steps of the same stage whose pace counts.
const STEPS_OF_PACE: usize = 12;
/// Seconds that the usual machine has in its favour against the one at hand: the first ones tell little.
const SECONDS_OF_THE_USUAL_MACHINE: f64 = 0.5;

/// Smallest and largest factor that is believed.
const FACTORS: (f64, f64) = (0.1, 10.0);

/// How many times as long as on the usual machine each part of a fit takes on this one.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, rename_all = "kebab-case")]
pub struct MachinePace {
    /// A level made ready.
    pub level: f64,
    /// A round on the light.
    pub round: f64,
    /// Maps.
    pub maps: f64,
    /// The descent from whole pixels.
    pub refine: f64,
    /// What comes after the last step.
    pub finishing: f64,
}

impl Default for MachinePace {
    fn default() -> Self {
        MachinePace { level: 1.0, round: 1.0, maps: 1.0, refine: 1.0, finishing: 1.0 }
    }
}

impl MachinePace {
    /// What the steps of a fit tell, where they tell anything; else `self`.
    fn of_steps(
        self,
        plan: &[Stage],
        done: &[(&Stage, usize)],
        losses: &[LossRow],
        first_of_session: usize,
        surface_megapixels: f64,
    ) -> Self {
        let usual = MachinePace::default();
        // Seconds taken and usual ones, by kind; the first step has the cache in it.
        let (mut own, mut firsts) = ([(0.0, 0.0); 3], Vec::new());
        let place = |kind: StageKind| match kind {
            StageKind::WideLight | StageKind::NarrowLight => Some(0),
            StageKind::Maps => Some(1),
            StageKind::Refine => Some(2),
            StageKind::Diffuse | StageKind::All => None,
        };
        for (number, (pair, &(stage, step))) in (1..).zip(losses.windows(2).zip(&done[1..])) {
            let Some(place) = place(stage.kind).filter(|_| number != first_of_session) else { continue };
            let seconds = pair[1].seconds - pair[0].seconds;
            let level = usual.level_seconds(plan, stage, step, surface_megapixels);
            let alone = usual.seconds(plan, stage, step, surface_megapixels) - level;
            match level > 0.0 {
                true => firsts.push((seconds, level, alone, place)),
                false => own[place] = (own[place].0 + seconds, own[place].1 + alone),
            }
        }
        let ratio = |(taken, usual): (f64, f64), otherwise: f64| match usual > 0.0 {
            true => (taken / usual).clamp(FACTORS.0, FACTORS.1),
            false => otherwise,
        };
        let [round, maps, refine] =
            [(0, self.round), (1, self.maps), (2, self.refine)].map(|(k, own_factor)| ratio(own[k], own_factor));
        let of_kind = [round, maps, refine];
        let levels = firsts.iter().fold((0.0, 0.0), |sum, &(seconds, level, alone, place)| {
            (sum.0 + (seconds - of_kind[place] * alone).max(0.0), sum.1 + level)
        });
        MachinePace { level: ratio(levels, self.level), round, maps, refine, ..self }
    }

    /// Each factor brought to where it is believed.
    #[must_use]
    pub fn within_range(self) -> Self {
        self.towards(self)
    }

    /// Halfway between what was known before and what a further fit showed.
    #[must_use]
    pub fn towards(self, other: Self) -> Self {
        let between = |a: f64, b: f64| {
            let [a, b] = [a, b].map(|factor| factor.clamp(FACTORS.0, FACTORS.1));
            (a * b).sqrt()
        };
        MachinePace {
            level: between(self.level, other.level),
            round: between(self.round, other.round),
            maps: between(self.maps, other.maps),
            refine: between(self.refine, other.refine),
            finishing: between(self.finishing, other.finishing),
        }
    }
}

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
    /// What the steps so far tell of this machine, and what finishing is expected to.
    pub factors: MachinePace,
}

/// The pace after the last of `losses`, of which `first_of_session` is the first that was done since the fit was started or
/// taken up.
///
/// Steps of the optimiser all take about as long. Those of the solver do not: each is expected to take what its kind took on
/// this machine before, as `known` has it, for so many million pixels of surface, times how long those so far took beside
/// that.
pub fn pace(
    plan: &[Stage],
    losses: &[LossRow],
    first_of_session: usize,
    surface_megapixels: f64,
    known: MachinePace,
) -> Pace {
    let finishing = known.finishing * (FINISHING_SECONDS.0 + FINISHING_SECONDS.1 * surface_megapixels);
    let Some(last) = losses.last() else {
        let (seconds_left, seconds_after_next) = (f64::NAN, f64::NAN);
        return Pace {
            steps_per_second: 0.0,
            seconds_left,
            seconds_after_next,
            finishing_seconds: finishing,
            factors: known,
        };
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
        let factors = known;
        return Pace { steps_per_second, seconds_left, seconds_after_next, finishing_seconds: finishing, factors };
    }
    // The first step of a session has the cache in it, which may be there already: it tells nothing.
    let (mut taken, mut expected) = (SECONDS_OF_THE_USUAL_MACHINE, SECONDS_OF_THE_USUAL_MACHINE);
    for (number, (pair, (stage, step))) in (1..).zip(losses.windows(2).zip(&done[1..])) {
        if number == first_of_session {
            continue;
        }
        taken += pair[1].seconds - pair[0].seconds;
        expected += known.seconds(plan, stage, *step, surface_megapixels);
    }
    let slowness = taken / expected;
    let usual = |steps: &[(&Stage, usize)]| -> f64 {
        steps.iter().map(|(stage, step)| known.seconds(plan, stage, *step, surface_megapixels)).sum()
    };
    Pace {
        steps_per_second,
        seconds_left: slowness * usual(left),
        seconds_after_next: slowness * left.get(1..).map_or(0.0, usual),
        finishing_seconds: slowness * finishing,
        factors: MachinePace {
            finishing: slowness * known.finishing,
            ..known.of_steps(plan, done, losses, first_of_session, surface_megapixels)
        },
    }
}

/// Seconds of all that comes after the last step, most of them for scores: so many, and for each million pixels of surface.
const FINISHING_SECONDS: (f64, f64) = (18.0, 5.0);
/// The same of making a level ready, at its pixels.
const LEVEL_SECONDS: (f64, f64) = (4.0, 3.0);
/// The same of a round on the light.
const ROUND_SECONDS: (f64, f64) = (1.4, 0.5);
/// The same of maps.
const MAPS_SECONDS: (f64, f64) = (1.5, 8.0);
/// Seconds of the descent from whole pixels.
const REFINE_SECONDS: (f64, f64) = (18.0, 22.0);
/// Millions of pixels that the solver keeps, about: more of them are thinned out.
const MOST_MEGAPIXELS: f64 = 4.0;
/// Seconds of a step of the optimiser, about.
const OPTIMISER_SECONDS: f64 = 0.3;

impl MachinePace {
    /// Seconds of a step: what it takes on a machine of two processors, as was measured on captures of .6 to 4 million pixels
    /// of surface, times the factor of its kind.
    fn seconds(self, plan: &[Stage], stage: &Stage, step: usize, surface_megapixels: f64) -> f64 {
        let megapixels = megapixels_of(stage, surface_megapixels);
        let linear = |(fixed, each): (f64, f64)| fixed + each * megapixels;
        self.level_seconds(plan, stage, step, surface_megapixels)
            + match stage.kind {
                StageKind::WideLight | StageKind::NarrowLight => self.round * linear(ROUND_SECONDS),
                StageKind::Maps => self.maps * linear(MAPS_SECONDS),
                StageKind::Refine => self.refine * linear(REFINE_SECONDS),
                StageKind::Diffuse | StageKind::All => OPTIMISER_SECONDS,
            }
    }

    /// Those in which its level is made ready: none but in a level's first step.
    fn level_seconds(self, plan: &[Stage], stage: &Stage, step: usize, surface_megapixels: f64) -> f64 {
        let is_first_of_level =
            step == 0 && plan.iter().find(|own| own.is_of_level_of(stage)).is_some_and(|own| own.kind == stage.kind);
        match is_first_of_level && stage.kind.is_of_solver() {
            true => self.level * (LEVEL_SECONDS.0 + LEVEL_SECONDS.1 * megapixels_of(stage, surface_megapixels)),
            false => 0.0,
        }
    }
}

/// Millions of pixels of surface that the solver sees in a stage.
fn megapixels_of(stage: &Stage, surface_megapixels: f64) -> f64 {
    (surface_megapixels * 0.25f64.powi(stage.photo_level as i32)).min(MOST_MEGAPIXELS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::schedule::stages;
    use crate::fit::{FitSettings, Method};

    const MEGAPIXELS: f64 = 5.0;
    const USUAL: MachinePace = MachinePace { level: 1.0, round: 1.0, maps: 1.0, refine: 1.0, finishing: 1.0 };

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
        let Pace { steps_per_second, seconds_left, .. } = pace(&plan, &whole[..14], 0, MEGAPIXELS, USUAL);
        assert!((steps_per_second - 2.0).abs() < 1e-9 && (seconds_left - 5.0).abs() < 1e-9);
        assert!(pace(&plan, &[], 0, MEGAPIXELS, USUAL).seconds_left.is_nan());
    }

    #[test]
    fn steps_of_the_solver_are_weighed_by_pixels_and_by_what_was_done() {
        let plan = stages(&FitSettings { method: Method::Solver, ..FitSettings::default() });
        let steps: usize = plan.iter().map(|stage| stage.steps).sum();
        for (slowness, first) in [(1.0, 5.0), (3.0, 0.0), (0.2, 60.0)] {
            let mut is_first = true;
            let seconds = |stage: &Stage, step: usize| {
                let own = slowness * USUAL.seconds(&plan, stage, step, MEGAPIXELS);
                own + if std::mem::take(&mut is_first) { first } else { 0.0 }
            };
            let whole = history(&plan, seconds);
            let end = whole.last().unwrap().seconds;
            for done in steps / 2..steps {
                let told = pace(&plan, &whole[..done], 0, MEGAPIXELS, USUAL).seconds_left;
                let left = end - whole[done - 1].seconds;
                // The usual machine has some seconds in its favour.
                assert!((told / left - 1.0).abs() < 0.5, "{slowness} {done}: {told} of {left}");
            }
            let told = pace(&plan, &whole[..steps - 1], 0, MEGAPIXELS, USUAL).seconds_left;
            let left = end - whole[steps - 2].seconds;
            assert!((told / left - 1.0).abs() < 0.2, "{slowness}: {told} of {left}");
        }
        // What a fit that was taken up caches anew is no sign of slowness.
        let mut number = 0;
        let again = history(&plan, |stage, step| {
            number += 1;
            USUAL.seconds(&plan, stage, step, MEGAPIXELS) + if number == 5 { 100.0 } else { 0.0 }
        });
        let told = |first_of_session| pace(&plan, &again[..6], first_of_session, MEGAPIXELS, USUAL);
        let left: f64 = again[steps - 1].seconds - again[5].seconds;
        assert!((told(4).seconds_left / left - 1.0).abs() < 0.1 && told(0).seconds_left > 2.0 * left);
        let next = again[6].seconds - again[5].seconds;
        assert!((told(4).seconds_left - told(4).seconds_after_next - next).abs() < 0.1 * next);
        let first = &history(&plan, |_, _| 1.0)[..1];
        assert!(
            pace(&plan, first, 0, 0.1, USUAL).seconds_left
                < 0.5 * pace(&plan, first, 0, MEGAPIXELS, USUAL).seconds_left
        );
    }

    /// Another machine than the usual one has other strengths: the first fit on it is told wrongly, the second is not.
    #[test]
    fn what_one_fit_took_tells_how_long_the_next_takes() {
        let plan = stages(&FitSettings { method: Method::Solver, ..FitSettings::default() });
        let machine = MachinePace { level: 0.5, round: 4.0, maps: 1.5, refine: 0.7, finishing: 2.0 };
        let whole = history(&plan, |stage, step| machine.seconds(&plan, stage, step, MEGAPIXELS));
        let learned = pace(&plan, &whole, 0, MEGAPIXELS, USUAL).factors;
        for (own, truth) in [
            (learned.level, machine.level),
            (learned.round, machine.round),
            (learned.maps, machine.maps),
            (learned.refine, machine.refine),
        ] {
            assert!((own / truth - 1.0).abs() < 1e-6, "{learned:?}");
        }
        let end = whole.last().unwrap().seconds;
        let worst = |known: MachinePace| {
            let off = |done: usize| {
                let left = end - whole[done - 1].seconds;
                (pace(&plan, &whole[..done], 0, MEGAPIXELS, known).seconds_left / left - 1.0).abs()
            };
            (whole.len() / 4..whole.len()).map(off).fold(0.0, f64::max)
        };
        assert!(worst(USUAL) > 0.5 && worst(learned) < 0.02, "{} {}", worst(USUAL), worst(learned));
        let between = USUAL.towards(learned);
        assert!(between.round > 1.0 && between.round < learned.round);
        // What comes after the last step is as slow as the steps so far, and where nothing was done nothing is learned.
        let slow = history(&plan, |stage, step| 3.0 * USUAL.seconds(&plan, stage, step, MEGAPIXELS));
        let (slow, usual) = (pace(&plan, &slow, 0, MEGAPIXELS, USUAL), pace(&plan, &[], 0, MEGAPIXELS, USUAL));
        assert!((slow.factors.finishing / 3.0 - 1.0).abs() < 0.05, "{slow:?}");
        assert!((slow.finishing_seconds / usual.finishing_seconds / 3.0 - 1.0).abs() < 0.05, "{slow:?}");
        assert_eq!(pace(&plan, &whole[..1], 0, MEGAPIXELS, machine).factors, machine);
    }
}
