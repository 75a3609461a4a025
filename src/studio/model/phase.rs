//! In which state the work on the open project is: one state, from which title, status bar, buttons and messages follow.

use super::tasks::TaskKind;
use super::{FitStatus, Model};
use crate::job::FinishingStage;

/// The state of the open project.
#[derive(Clone, Debug, PartialEq)]
pub enum Phase {
    /// Nothing is open.
    Closed,
    /// A scene or run is being read.
    Opening,
    /// The scene is being checked, or its atlas made.
    Preparing,
    /// The same, and the fit starts when it is ready.
    Queued,
    /// Preparing was cancelled or failed.
    Unprepared,
    /// A fit can start.
    Ready,
    /// The fit is being started.
    Starting,
    /// Steps are being done.
    Fitting,
    /// It holds after the current step.
    Pausing,
    /// It holds.
    Paused,
    /// It was asked to stop.
    Stopping,
    /// Steps are done; images and files are being made.
    Finishing(FinishingStage),
    /// Everything is written.
    Finished,
    /// It ended early.
    Stopped,
    /// It ended with an error.
    Failed(String),
}

impl Phase {
    /// The state in a few words.
    pub fn words(&self) -> String {
        match self {
            Phase::Closed => "No project".into(),
            Phase::Opening => "Opening".into(),
            Phase::Preparing => "Preparing scene".into(),
            Phase::Queued => "Preparing scene. Fit starts automatically when ready.".into(),
            Phase::Unprepared => "Not prepared".into(),
            Phase::Ready => "Not started".into(),
            Phase::Starting => "Starting".into(),
            Phase::Fitting => "Fitting".into(),
            Phase::Pausing => "Pausing after this step".into(),
            Phase::Paused => "Paused".into(),
            Phase::Stopping => "Stopping".into(),
            Phase::Finishing(stage) => format!("Finishing: {}", stage.label()),
            Phase::Finished => "Finished".into(),
            Phase::Stopped => "Stopped".into(),
            Phase::Failed(why) => format!("Failed: {why}"),
        }
    }

    /// Whether a job works on a fit or waits to, so that its progress is worth a bar.
    pub fn is_live(&self) -> bool {
        match self {
            Phase::Fitting | Phase::Pausing | Phase::Paused | Phase::Stopping | Phase::Finishing(_) => true,
            Phase::Closed
            | Phase::Opening
            | Phase::Preparing
            | Phase::Queued
            | Phase::Unprepared
            | Phase::Ready
            | Phase::Starting
            | Phase::Finished
            | Phase::Stopped
            | Phase::Failed(_) => false,
        }
    }
}

impl Model {
    /// The state of the open project.
    pub fn phase(&self) -> Phase {
        let Some(project) = &self.project else {
            return if self.tasks.is_running(&TaskKind::Opening) { Phase::Opening } else { Phase::Closed };
        };
        match &self.fit.status {
            FitStatus::Running => Phase::Fitting,
            FitStatus::Pausing => Phase::Pausing,
            FitStatus::Paused => Phase::Paused,
            FitStatus::Stopping => Phase::Stopping,
            FitStatus::Finishing(stage) => Phase::Finishing(*stage),
            _ if self.tasks.is_running(&TaskKind::Starting) => Phase::Starting,
            FitStatus::Finished => Phase::Finished,
            FitStatus::Stopped => Phase::Stopped,
            FitStatus::Failed(why) => Phase::Failed(why.clone()),
            FitStatus::Idle if project.surface.is_some() => Phase::Ready,
            FitStatus::Idle if self.start_is_queued => Phase::Queued,
            FitStatus::Idle if self.is_preparing() => Phase::Preparing,
            FitStatus::Idle => Phase::Unprepared,
        }
    }

    /// Whether the scene that is open is being checked, or its atlas made.
    pub fn is_preparing(&self) -> bool {
        self.tasks.is_running(&TaskKind::Checking) || self.tasks.is_running(&TaskKind::Preparing)
    }

    /// Whether a start would resume the fit from its checkpoint.
    pub fn can_resume(&self) -> bool {
        let has_ended = match &self.fit.status {
            FitStatus::Idle | FitStatus::Stopped | FitStatus::Failed(_) => true,
            FitStatus::Running
            | FitStatus::Pausing
            | FitStatus::Paused
            | FitStatus::Stopping
            | FitStatus::Finishing(_)
            | FitStatus::Finished => false,
        };
        has_ended && self.fit.folder.as_ref().is_some_and(|folder| folder.checkpoint_path().is_file())
    }
}
