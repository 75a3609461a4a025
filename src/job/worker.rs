//! The thread of a job.

use super::outcome;
use super::prepare::{Prepared, RunSettings};
use super::save::Saver;
use super::teller::Teller;
use super::time_left::{self, MachinePace, Pace};
use super::{Budget, Command, Event, Progress, Slot, Snapshot, SolverTold, StepTime};
use crate::error::{ErrorKind, Finding, Result, Severity};
use crate::fit::underway::{Reached, Underway};
use crate::fit::{FitSettings, Fitter, LossRow, StepOutcome};
use crate::insight::report::data::StageTime;
use crossbeam_channel::Receiver;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Time between two snapshots, at least; maps of 2048^2 texels take a while to copy.
const SNAPSHOT_INTERVAL: Duration = Duration::from_millis(500);
/// How long a job that holds waits for a command before it looks at its stop flag.
const PATIENCE: Duration = Duration::from_millis(50);

/// A job at work.
pub(super) struct Worker {
    pub(super) fitter: Fitter,
    pub(super) settings: RunSettings,
    pub(super) saver: Saver,
    pub(super) commands: Receiver<Command>,
    pub(super) teller: Teller,
    pub(super) before_step: Option<Box<dyn FnMut(usize) + Send>>,
    pub(super) budget: Option<Budget>,
    pub(super) snapshot: Arc<Slot<Snapshot>>,
    pub(super) stop: Arc<AtomicBool>,
    pub(super) began: Instant,
    pub(super) paused: bool,
    /// Single steps that were asked for and not done yet.
    pub(super) steps_asked: usize,
    /// Where the last step was when its time was up.
    pub(super) reached: Option<Reached>,
    /// Steps that were done before this job.
    pub(super) first_of_session: usize,
    /// How long steps take on this machine, as fits before have shown.
    pub(super) machine_pace: MachinePace,
}

fn pace_of(fitter: &Fitter, first_of_session: usize, known: MachinePace) -> Pace {
    let state = fitter.state();
    time_left::pace(&state.plan, &state.losses, first_of_session, fitter.surface_megapixels(), known)
}

impl Worker {
    pub(super) fn run(mut self, mut prepared: Prepared) -> Result<()> {
        // Nothing is lost yet: a folder that cannot be written is an error here, and a warning from now on.
        let steps_done = self.fitter.state().step;
        if steps_done == 0 {
            self.saver.folder().set_result_aside()?;
            // A program that is killed before its first checkpoint must not leave an earlier one beside another mesh.
            self.saver.folder().remove_checkpoint()?;
            self.saver.write_known_maps(&self.fitter)?;
        }
        crate::export::obj::write(&self.saver.folder().file("mesh.obj"), self.fitter.surface().mesh())?;
        if steps_done == 0 {
            // The checkpoint of an earlier run in the folder must not be taken for one of this run.
            self.saver.save(&self.fitter, &self.settings)?;
        } else {
            self.saver.folder().write_settings(&self.settings)?;
        }
        self.teller.send(Event::Started { steps_done, steps_total: self.fitter.steps_total() });
        for finding in prepared.findings.iter().cloned().chain(self.fitter.setting_findings()) {
            self.teller.send(Event::Finding(finding));
        }
        self.put_snapshot();
        let mut last_snapshot = Instant::now();
        let mut told_events = 0;
        let is_cut_short = loop {
            if self.obey() {
                return self.end_early();
            }
            if self.saver.is_due() {
                self.save();
            }
            if self.paused && self.steps_asked == 0 {
                continue;
            }
            if let Some(hook) = &mut self.before_step {
                hook(self.fitter.state().step);
            }
            if self.is_out_of_time() {
                break true;
            }
            let (outcome, was_shown_within) = self.step()?;
            match outcome {
                StepOutcome::Interrupted if self.is_out_of_time() => break true,
                StepOutcome::Interrupted => return self.end_early(),
                StepOutcome::Finished => break false,
                StepOutcome::Stepped(row) => {
                    let state = self.fitter.state();
                    for event in &state.events[told_events..] {
                        self.teller.send(Event::Finding(Finding::new(Severity::Note, "fit-event", event.to_string())));
                    }
                    told_events = state.events.len();
                    self.teller.send(Event::Progress(self.progress(row)));
                }
            }
            let was_single = self.steps_asked > 0;
            self.steps_asked = self.steps_asked.saturating_sub(1);
            if was_single && !self.paused && self.steps_asked == 0 {
                self.set_paused(true);
            }
            // While it holds, what is seen is what a single step did. Else nothing is made for nobody: without a window
            // pictures of a fit of photographs took 4 of its 96 s. The solver's steps are few, and each is shown.
            let is_large_step = self.fitter.stage().is_some_and(|stage| stage.kind.is_of_solver());
            let is_due = is_large_step || last_snapshot.elapsed() > SNAPSHOT_INTERVAL;
            if self.paused || was_shown_within || (is_due && self.snapshot.is_seen()) {
                self.put_snapshot();
                last_snapshot = Instant::now();
            }
        };
        self.put_snapshot();
        self.save();
        if let Some(budget) = self.budget.take().filter(|_| is_cut_short) {
            let finding = budget.finding(&self.fitter, self.reached.is_some());
            // What goes on later is the checkpoint; the result is made of what there is.
            self.fitter.cut_short(self.reached.take());
            self.teller.send(Event::Finding(finding.clone()));
            prepared.findings.push(finding);
            self.put_snapshot();
        }
        if let Some(finding) = self.fitter.tail_finding() {
            self.teller.send(Event::Finding(finding));
        }
        prepared.timings.push(StageTime { stage: "fit".into(), seconds: self.fitter.state().seconds });
        let folder = self.saver.folder();
        let tell = |event: Event| self.teller.send(event);
        match outcome::write(&self.fitter, prepared, &self.settings, folder, self.began, &self.stop, &tell) {
            Ok(data) => {
                if let Err(error) = folder.remove_earlier() {
                    let message = format!("the result before this one was not removed: {}", error.message());
                    let finding = Finding::new(Severity::Note, "earlier-result-stays", message);
                    self.teller.send(Event::Finding(finding.at(error.place().clone())));
                }
                self.teller.send(Event::Finished(Box::new(data)));
            }
            // All steps are done and saved: who stops now gives up the report, and nothing failed.
            Err(error) if error.kind() == ErrorKind::Stopped => {
                let finding = Finding::new(Severity::Note, "report-not-made", error.message());
                self.teller.send(Event::Finding(finding.remedy(error.remedy_text())));
                self.teller.send(Event::Stopped { steps_done: self.fitter.state().step });
            }
            Err(error) => return Err(error),
        }
        Ok(())
    }

    /// One step; where the time is limited, it is dropped when that is up, but for what it had reached.
    /// Also whether something within it was shown.
    fn step(&mut self) -> Result<(StepOutcome, bool)> {
        let Worker { fitter, budget, stop, snapshot, teller, reached, first_of_session, machine_pace, .. } = self;
        *reached = None;
        let is_limited = budget.is_some();
        let mut last_snapshot = Instant::now();
        let mut was_shown = false;
        let (began, before) = (Instant::now(), fitter.state().seconds);
        let Pace { seconds_after_next, finishing_seconds, .. } = pace_of(fitter, *first_of_session, *machine_pace);
        let mut watch = |underway: &Underway| {
            let seconds = before + began.elapsed().as_secs_f64();
            if let Some(step_seconds_left) = underway.seconds_left {
                // Nothing is known of what comes after where no step was done before.
                let after_it = if seconds_after_next.is_finite() { seconds_after_next } else { 0.0 };
                let seconds_left = step_seconds_left + after_it;
                teller.send(Event::WithinStep(StepTime {
                    seconds,
                    step_seconds_left,
                    seconds_left,
                    finishing_seconds,
                }));
            }
            if is_limited && underway.is_reached {
                *reached = Some(underway.reached());
            }
            let Some(before) = snapshot.last().filter(|_| snapshot.is_seen()) else { return };
            if last_snapshot.elapsed() > SNAPSHOT_INTERVAL {
                let (maps, environment) = underway.shown();
                let (maps, environment) = (Arc::new(maps), Arc::new(environment));
                snapshot.put(Snapshot { maps, environment, ..(*before).clone() });
                teller.wake();
                (last_snapshot, was_shown) = (Instant::now(), true);
            }
        };
        let outcome = match budget {
            Some(budget) => budget.limit(stop, |flag| fitter.step_watched(flag, &mut watch)),
            None => fitter.step_watched(stop, &mut watch),
        }?;
        if outcome != StepOutcome::Interrupted {
            *reached = None;
        }
        Ok((outcome, was_shown))
    }

    /// Whether the time is up with steps left, and nobody asked for a stop.
    fn is_out_of_time(&self) -> bool {
        self.budget.as_ref().is_some_and(Budget::is_over)
            && !self.stop.load(Ordering::Relaxed)
            && !self.fitter.steps_left().is_empty()
    }

    /// Does what was asked since the last step; waits a moment for it while the job holds. `true` to end.
    fn obey(&mut self) -> bool {
        let mut changed = Vec::new();
        let mut save = false;
        let first = if self.paused && self.steps_asked == 0 {
            self.commands.recv_timeout(PATIENCE).ok()
        } else {
            self.commands.try_recv().ok()
        };
        let mut next = first;
        // The flag may be raised without a command.
        let mut stop = self.stop.load(Ordering::Relaxed);
        while let (Some(command), false) = (next.take(), stop) {
            match command {
                Command::Stop => stop = true,
                Command::Pause => self.set_paused(true),
                Command::Resume => self.set_paused(false),
                Command::StepOnce => self.steps_asked += 1,
                Command::Checkpoint => save = true,
                Command::Change(settings) => changed.extend(self.change(*settings)),
            }
            next = self.commands.try_recv().ok();
        }
        // Several changes at once, as of a slider, are written once; the end writes for itself.
        if (save || !changed.is_empty()) && !stop {
            self.save();
        }
        for settings in changed {
            self.teller.send(Event::SettingsChanged(Box::new(settings)));
        }
        stop
    }

    /// Takes other settings; returns them when they were taken.
    fn change(&mut self, settings: FitSettings) -> Option<FitSettings> {
        let findings_before = self.fitter.setting_findings();
        if let Err(error) = self.fitter.change(settings) {
            self.teller.send(Event::Refused(error));
            return None;
        }
        let settings = self.fitter.settings().clone();
        self.settings.fit = settings.clone();
        for finding in self.fitter.setting_findings() {
            if !findings_before.contains(&finding) {
                self.teller.send(Event::Finding(finding));
            }
        }
        Some(settings)
    }

    fn set_paused(&mut self, paused: bool) {
        if !paused {
            self.steps_asked = 0;
        }
        if self.paused != paused {
            self.paused = paused;
            if paused {
                // Whoever hears of the pause sees where it holds.
                self.put_snapshot();
            }
            self.teller.send(if paused { Event::Paused } else { Event::Resumed });
            if paused {
                self.save();
            }
        }
    }

    /// Ends before the fit does. Here a checkpoint that cannot be written is an error: the steps since the last one are
    /// lost.
    fn end_early(mut self) -> Result<()> {
        let path = self.saver.save(&self.fitter, &self.settings)?;
        self.teller.send(Event::Checkpoint(path));
        // What was seen within a step that was dropped is not what is kept.
        self.put_snapshot();
        self.teller.send(Event::Stopped { steps_done: self.fitter.state().step });
        Ok(())
    }

    /// Writes a checkpoint and tells how it went.
    fn save(&mut self) {
        let outcome = self.saver.save(&self.fitter, &self.settings);
        if let Some(finding) = self.saver.news(&outcome) {
            self.teller.send(Event::Finding(finding));
        }
        if let Ok(path) = outcome {
            self.teller.send(Event::Checkpoint(path));
        }
    }

    fn put_snapshot(&self) {
        let state = self.fitter.state();
        let stage = self.fitter.stage().or(state.plan.last());
        self.snapshot.put(Snapshot {
            step: state.step,
            maps: Arc::new(self.fitter.maps()),
            environment: Arc::new(self.fitter.environment()),
            losses: state.losses.clone(),
            steps_total: self.fitter.steps_total(),
            stage: stage.map(crate::fit::schedule::Stage::name).unwrap_or_default(),
            view_rmse: self.fitter.figures().view_rmse.clone(),
            log_gains: state.log_gains.clone(),
            agreement: self.fitter.figures().agreement.clone(),
            told: SolverTold::of(&self.fitter),
        });
        self.teller.wake();
    }

    fn progress(&self, row: LossRow) -> Progress {
        let steps_total = self.fitter.steps_total();
        let Pace { steps_per_second, seconds_left, finishing_seconds, factors, .. } =
            pace_of(&self.fitter, self.first_of_session, self.machine_pace);
        Progress { row, steps_total, steps_per_second, seconds_left, finishing_seconds, machine_pace: factors }
    }
}
