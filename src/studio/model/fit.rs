//! The fit as the window knows it: commands out, events in, and in which state it is.

use super::log::{Log, Message};
use crate::error::{Error, Finding, Severity};
use crate::export::RunFolder;
use crate::fit::{FitSettings, LossRow};
use crate::insight::report::data::ReportData;
use crate::job::advance::Advance;
use crate::job::{Command, Event, FinishingStage, JobHandle, Progress, Snapshot};
use crate::scene::Scene;
use std::sync::Arc;
use std::time::Instant;

/// In which state the fit is.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum FitStatus {
    /// None was started.
    #[default]
    Idle,
    /// Steps are being done.
    Running,
    /// It was asked to hold and does its last step before.
    Pausing,
    /// It holds after a step.
    Paused,
    /// It was asked to stop and has not yet.
    Stopping,
    /// Steps are done; files and pictures are being made.
    Finishing(FinishingStage),
    /// Everything is written.
    Finished,
    /// It ended early as asked.
    Stopped,
    /// It ended with an error.
    Failed(String),
}

impl FitStatus {
    /// Whether a thread works on it or waits to.
    pub fn is_live(&self) -> bool {
        use FitStatus::{Finishing, Paused, Pausing, Running, Stopping};
        matches!(self, Running | Pausing | Paused | Stopping | Finishing(_))
    }
}

/// The fit.
#[derive(Default)]
pub struct FitControl {
    job: Option<JobHandle>,
    /// The state.
    pub status: FitStatus,
    /// The newest progress.
    pub progress: Option<Progress>,
    /// Steps of the whole fit.
    pub steps_total: usize,
    /// Every line of the loss history that is known.
    pub losses: Vec<LossRow>,
    /// The newest maps and light.
    pub snapshot: Option<Arc<Snapshot>>,
    snapshot_number: u64,
    /// The report of a finished run.
    pub report: Option<Arc<ReportData>>,
    /// Where the run is written.
    pub folder: Option<RunFolder>,
    /// Settings the worker goes by, or will once it has taken what was sent.
    pub settings_in_force: Option<FitSettings>,
    /// Settings the worker has last said to go by.
    pub settings_confirmed: Option<FitSettings>,
    /// Changes that were sent and neither taken nor refused yet.
    pub changes_sent: usize,
    /// Whether the worker refused the last change.
    pub was_refused: bool,
    /// When the last checkpoint was written.
    pub last_checkpoint: Option<Instant>,
    /// How far the whole job is, finishing included.
    pub advance: Advance,
}

impl FitControl {
    /// Takes over a job that was just started.
    pub fn begin(&mut self, job: JobHandle, folder: RunFolder, settings: FitSettings) {
        *self = FitControl {
            job: Some(job),
            status: FitStatus::Running,
            folder: Some(folder),
            losses: std::mem::take(&mut self.losses),
            snapshot: self.snapshot.take(),
            settings_in_force: Some(settings.clone()),
            settings_confirmed: Some(settings),
            advance: Advance::default(),
            ..FitControl::default()
        };
    }

    /// Factor of each photo of the scene that a fit with exposure gains found: by the newest snapshot, or by the report
    /// of a run that was opened; empty for ones.
    pub fn gains(&self, scene: Option<&Scene>) -> Vec<f32> {
        if let Some(snapshot) = &self.snapshot {
            return snapshot.log_gains.iter().map(|gain| gain.exp()).collect();
        }
        let (Some(scene), Some(report)) = (scene, &self.report) else { return Vec::new() };
        let reported = |name: &str| {
            let line = report.views.iter().find(|line| line.name == name);
            let gain = line.map_or(1.0, |line| line.exposure_gain as f32);
            if gain.is_finite() && gain > 0.0 { gain } else { 1.0 }
        };
        scene.views.iter().map(|view| reported(&view.name)).collect()
    }

    /// Sends a command; a job that is gone is no error here, its last event says why.
    pub fn send(&mut self, command: Command) {
        if let Some(job) = &self.job {
            let _ = job.commands.try_send(command);
        }
    }

    /// Holds or goes on.
    pub fn pause_or_go_on(&mut self) {
        match self.status {
            FitStatus::Running => {
                self.status = FitStatus::Pausing;
                self.send(Command::Pause);
            }
            FitStatus::Paused | FitStatus::Pausing => self.send(Command::Resume),
            _ => {}
        }
    }

    /// Asks for the end, within a tile of pixels.
    pub fn stop(&mut self) {
        if let Some(job) = &self.job {
            job.stop();
            if self.status.is_live() {
                self.status = FitStatus::Stopping;
            }
        }
    }

    /// Stops and waits until the checkpoint is written.
    pub fn stop_and_wait(&mut self) {
        if let Some(job) = self.job.take() {
            job.stop();
            // Events are bounded: somebody has to read them for the job to come to its end.
            while !matches!(
                job.events.recv(),
                Err(_) | Ok(Event::Stopped { .. } | Event::Finished(_) | Event::Failed(_))
            ) {}
            job.join();
        }
    }

    /// Takes in what the job told since the last call. True when something changed.
    pub fn poll(&mut self, log: &mut Log) -> bool {
        let Some(job) = &self.job else { return false };
        let mut events: Vec<Event> = job.events.try_iter().collect();
        if let Some((number, snapshot)) = job.snapshot.newest()
            && number > self.snapshot_number
        {
            self.snapshot_number = number;
            // The history of the snapshot is whole even where single lines were dropped.
            if snapshot.losses.len() >= self.losses.len() {
                self.losses.clone_from(&snapshot.losses);
            }
            self.snapshot = Some(snapshot);
        }
        let changed = !events.is_empty();
        for event in events.drain(..) {
            self.take_in(event, log);
        }
        if matches!(self.status, FitStatus::Running | FitStatus::Finishing(_)) {
            self.advance.tick();
        }
        if !self.status.is_live() {
            self.job = None;
        }
        changed
    }

    fn take_in(&mut self, event: Event, log: &mut Log) {
        match event {
            Event::Started { steps_done, steps_total } => {
                self.steps_total = steps_total;
                self.losses.truncate(steps_done);
                log.note(match steps_done {
                    0 => format!("Fit started ({steps_total} steps)"),
                    _ => format!("Fit resumed after step {steps_done} of {steps_total}"),
                });
            }
            Event::Progress(progress) => {
                if self.losses.last().is_none_or(|row| row.step < progress.row.step) {
                    self.losses.push(progress.row.clone());
                }
                self.steps_total = progress.steps_total;
                self.advance.stepped(&progress);
                self.progress = Some(progress);
            }
            Event::WithinStep(time) => self.advance.within_step(&time),
            Event::Finding(finding) => log.add(Message::from(&finding)),
            Event::Checkpoint(_) => self.last_checkpoint = Some(Instant::now()),
            // What was sent before the job heard of the stop changes nothing.
            Event::Paused | Event::Resumed | Event::Finishing(_) if self.status == FitStatus::Stopping => {}
            Event::Paused => self.status = FitStatus::Paused,
            Event::Resumed => self.status = FitStatus::Running,
            Event::SettingsChanged(settings) => {
                self.changes_sent = self.changes_sent.saturating_sub(1);
                self.settings_confirmed = Some(*settings);
                log.note("Fit continues with the changed settings");
            }
            Event::Refused(error) => {
                self.changes_sent = self.changes_sent.saturating_sub(1);
                self.was_refused = true;
                log.add(Message::from(
                    &Finding::new(Severity::Warning, "refused", error.message()).at(error.place().clone()),
                ));
            }
            Event::Finishing(stage) => {
                self.status = FitStatus::Finishing(stage);
                self.advance.finishing(stage);
            }
            Event::Finished(data) => {
                self.report = Some(Arc::from(data));
                self.status = FitStatus::Finished;
                self.advance.finished();
                if let Some(folder) = &self.folder {
                    log.note_of_file(format!("Fit finished. Results: {}", folder.path().display()), folder.path());
                }
            }
            Event::Stopped { steps_done } => {
                self.status = FitStatus::Stopped;
                log.note(format!("Stopped after {steps_done} steps; the checkpoint keeps them"));
            }
            Event::Failed(error) => self.fail(&error, log),
        }
    }

    fn fail(&mut self, error: &Error, log: &mut Log) {
        self.status = FitStatus::Failed(error.message().into());
        log.error(error);
    }

    /// Forgets everything; a job in progress is asked to stop and ends by itself.
    pub fn forget(&mut self) {
        self.stop();
        *self = FitControl::default();
    }
}
