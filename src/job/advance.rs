//! How far a job is, from its first step to its report: one share that never goes back, and the seconds that are left; the
//! same in window and terminal.
//!
//! Steps are weighed by the seconds they are expected to take, as the job tells them; what comes after the last step as well. What a job
//! has shown of the machine is kept between runs ([`Advance::learned_pace`]).

use super::time_left::MachinePace;
use super::{FinishingStage, Progress, StepTime};
use std::time::Instant;

/// Share of a step, or of the finishing, that passing time alone may claim.
const MOST_BY_TIME: f64 = 0.9;

/// How far a job is.
#[derive(Clone, Debug, Default)]
pub struct Advance {
    share: f64,
    /// Seconds that finishing is expected to take.
    finishing_seconds: f64,
    /// Seconds of the steps so far, those still expected, and those of one step; when that was told.
    steps: Option<(f64, f64, f64, Instant)>,
    finishing: Option<(FinishingStage, Instant)>,
    learned: Option<MachinePace>,
    /// What the steps so far tell of the pace of this machine.
    machine_pace: MachinePace,
}

impl Advance {
    /// The share of the whole job that is done, in [0, 1]; it never goes back.
    pub fn share(&self) -> f32 {
        self.share as f32
    }

    /// The same in whole percent, for window title and status bar alike.
    pub fn percent(&self) -> u32 {
        (100.0 * self.share) as u32
    }

    /// Seconds until the report is written; `None` while nothing is known.
    pub fn seconds_left(&self) -> Option<f64> {
        let (_, left, _, then) = self.steps?;
        let seconds = match &self.finishing {
            Some((_, began)) => self.finishing_seconds - began.elapsed().as_secs_f64(),
            None => left - then.elapsed().as_secs_f64() + self.finishing_seconds,
        };
        seconds.is_finite().then_some(seconds.max(0.0))
    }

    /// What a job which ended has shown of the machine; handed out once.
    pub fn learned_pace(&mut self) -> Option<MachinePace> {
        self.learned.take()
    }

    /// A step was done.
    pub fn stepped(&mut self, progress: &Progress) {
        let Progress { row, seconds_left, finishing_seconds, steps_per_second, machine_pace, .. } = progress;
        self.machine_pace = *machine_pace;
        self.take((row.seconds, *seconds_left, *finishing_seconds), 1.0 / steps_per_second.max(1e-9));
    }

    /// A step has come to a place.
    pub fn within_step(&mut self, time: &StepTime) {
        self.take((time.seconds, time.seconds_left, time.finishing_seconds), time.step_seconds_left);
    }

    fn take(&mut self, (done, left, finishing): (f64, f64, f64), step: f64) {
        if finishing.is_finite() {
            self.finishing_seconds = finishing.max(0.0);
        }
        if done.is_finite() && left.is_finite() {
            self.steps = Some((done, left.max(0.0), step, Instant::now()));
            self.claim(done / self.whole(done, left));
        }
    }

    /// A part of the finishing began.
    pub fn finishing(&mut self, stage: FinishingStage) {
        let began = self.finishing.map_or_else(Instant::now, |(_, began)| began);
        self.finishing = Some((stage, began));
        self.claim(self.before_finishing() + (1.0 - self.before_finishing()) * f64::from(stage.share_before()));
    }

    /// The report is written.
    pub fn finished(&mut self) {
        self.share = 1.0;
        if let (Some((_, began)), true) = (self.finishing, self.finishing_seconds > 0.0) {
            let finishing = self.machine_pace.finishing * began.elapsed().as_secs_f64() / self.finishing_seconds;
            self.learned = Some(MachinePace { finishing, ..self.machine_pace });
        }
    }

    /// Time passes within a step, or within the finishing, of a job that is at work.
    pub fn tick(&mut self) {
        let Some((done, left, step, then)) = self.steps else { return };
        match self.finishing {
            None => {
                let within = then.elapsed().as_secs_f64().min(MOST_BY_TIME * step).min(left);
                self.claim((done + within) / self.whole(done, left));
            }
            Some((_, began)) => {
                let share = began.elapsed().as_secs_f64() / self.finishing_seconds.max(1e-3);
                let before = self.before_finishing();
                self.claim(before + (1.0 - before) * share.min(MOST_BY_TIME));
            }
        }
    }

    fn whole(&self, done: f64, left: f64) -> f64 {
        (done + left.max(0.0) + self.finishing_seconds).max(1e-9)
    }

    fn before_finishing(&self) -> f64 {
        let Some((done, left, ..)) = self.steps else { return 0.5 };
        (done + left) / self.whole(done, left)
    }

    fn claim(&mut self, share: f64) {
        if share.is_finite() {
            self.share = self.share.max(share.clamp(0.0, 0.99));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::LossRow;

    fn progress(seconds: f64, seconds_left: f64) -> Progress {
        let row = LossRow {
            step: 1,
            stage: "maps".into(),
            seconds,
            loss: 1.0,
            image_loss: 1.0,
            consistency: 0.0,
            surface_rmse: None,
            held_out_rmse: None,
        };
        Progress {
            row,
            steps_total: 10,
            steps_per_second: 1.0,
            seconds_left,
            finishing_seconds: 10.0,
            machine_pace: MachinePace::default(),
        }
    }

    #[test]
    fn the_share_covers_finishing_and_never_goes_back() {
        let mut advance = Advance::default();
        let mut before = 0;
        // The expectation grows on the way: what was shown stays.
        for (seconds, left) in [(10.0, 30.0), (20.0, 20.0), (30.0, 90.0), (40.0, 0.0)] {
            advance.stepped(&progress(seconds, left));
            assert!(advance.percent() >= before, "{} after {before}", advance.percent());
            before = advance.percent();
        }
        assert_eq!(advance.percent(), 80, "a fifth is left for what comes after the last step");
        let stages = [
            FinishingStage::Maps,
            FinishingStage::Views,
            FinishingStage::Capture,
            FinishingStage::Relighting,
            FinishingStage::Report,
        ];
        for stage in stages {
            advance.finishing(stage);
            advance.tick();
            assert!(advance.percent() >= before && advance.percent() < 100);
            before = advance.percent();
        }
        advance.finished();
        assert_eq!(advance.percent(), 100);
        assert!(advance.learned_pace().is_some_and(|pace| pace.finishing > 0.0) && advance.learned_pace().is_none());
    }

    #[test]
    fn the_time_left_counts_finishing_and_nothing_is_said_before_the_first_step() {
        let mut advance = Advance::default();
        assert!(advance.seconds_left().is_none() && advance.percent() == 0);
        advance.stepped(&progress(10.0, 30.0));
        let left = advance.seconds_left().unwrap();
        assert!((39.0..=40.0).contains(&left), "{left}");
        advance.within_step(&StepTime {
            seconds: 12.0,
            step_seconds_left: 12.0,
            seconds_left: 12.0,
            finishing_seconds: 10.0,
        });
        let left = advance.seconds_left().unwrap();
        assert!((21.0..=22.0).contains(&left) && advance.percent() == 35, "{left}");
        // A fit that is taken up within its last step tells nothing else before.
        let mut taken_up = Advance::default();
        taken_up.within_step(&StepTime {
            seconds: 30.0,
            step_seconds_left: 10.0,
            seconds_left: 10.0,
            finishing_seconds: 40.0,
        });
        assert!((49.0..=50.0).contains(&taken_up.seconds_left().unwrap()) && taken_up.percent() == 37);
        advance.stepped(&progress(f64::NAN, f64::NAN));
        assert!(advance.seconds_left().is_some(), "what is not a number changes nothing");
    }
}
