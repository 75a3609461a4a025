//! The only door between a fit and whoever watches it.
//!
//! A job owns a thread. [`Command`]s go in, [`Event`]s come out, and a [`Slot`] holds the newest [`Snapshot`] of maps and
//! light: a watcher that is slow misses steps, never the last state, and never slows the fit; without one none are made
//! between the first and the last. The command line and the window drive the same job, so neither can do what the other
//! cannot.
//!
//! [`open`] opens scenes and runs, begins fits and takes them up; [`prepare`] turns a scene into a surface with an atlas,
//! [`kept`] keeps on disk what opening takes long to make,
//! [`run_with_maps`] reads the run whose maps and atlas are kept, [`known_maps`] settles what they decide,
//! [`begin`] starts a job, `worker` is what its thread does and [`handle`] what a watcher holds of it, `save` keeps the run
//! folder whole while it runs, [`budget`] limits how long that is,
//! [`outcome`] renders, scores and writes the run folder, [`demo`] makes the built-in scene,
//! [`capture_folder`] finds the parts of a scene in a folder and names them. [`preview`] draws for a window
//! beside a fit, [`relit`] does so from cached transport, at once. After a fit, [`gallery`] makes what a user shows,
//! [`fit_film`] a film of the fit, [`gauge`] moves its scale, [`entanglement`] tells how much light is baked into the maps, [`regions`] reads measured materials for parts of a surface,
//! [`relight`](mod@relight) makes one picture, [`export`] writes a run for other programs.
//!
//! [`ask`] tells beforehand what a fit will need, [`benchmark`] scores a run by the rules of published benchmarks.
//!
//! [`object`] is the job of object mode, light and reflectance from photos of one object; [`materials`] its library of
//! materials to look at.

pub mod advance;
pub mod against_truth;
pub mod ask;
pub mod background;
pub mod begin;
pub mod benchmark;
pub mod budget;
pub mod capture_folder;
pub mod demo;
pub mod entanglement;
mod explained;
pub mod export;
mod facts;
pub mod film;
pub mod fit_film;
pub mod gallery;
pub mod gauge;
pub mod handle;
pub mod kept;
pub mod known_maps;
pub mod materials;
mod newest;
pub mod object;
pub mod open;
mod opened_scene;
pub mod outcome;
pub mod pictures;
pub mod prepare;
pub mod preview;
pub mod regions;
pub mod relight;
pub mod relit;
pub mod run_with_maps;
mod save;
pub mod shown;
pub mod slot;
pub mod solver_told;
mod stages;
mod teller;
pub mod time_left;
mod view;
mod worker;

pub use begin::{start, start_with};
pub use budget::Budget;
pub use facts::rows_of;
pub use handle::{JobHandle, JobOptions, Wake};
pub use prepare::RunSettings;
pub use slot::Slot;
pub use solver_told::SolverTold;

use crate::error::{Error, Finding};
use crate::fit::{FitSettings, LossRow};
use crate::image::GreyImage;
use crate::light::Environment;
use crate::material::MaterialMaps;
use std::path::PathBuf;
use std::sync::Arc;

/// What a watcher may ask of a job.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Command {
    /// Hold after the step in progress.
    Pause,
    /// Go on.
    Resume,
    /// Do one step, then hold.
    StepOnce,
    /// Write a checkpoint after the step in progress.
    Checkpoint,
    /// Go on with other settings after the step in progress: [`Fitter::change`](crate::fit::Fitter::change). Answered by
    /// [`Event::SettingsChanged`] or [`Event::Refused`].
    Change(Box<FitSettings>),
    /// Drop the step in progress, write a checkpoint and end.
    Stop,
}

/// What a job tells. Progress is dropped when nobody reads it; everything else is kept for the reader. The fit never
/// waits for one.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Event {
    /// The fit begins or goes on.
    Started {
        /// Steps done before.
        steps_done: usize,
        /// Steps of the whole fit.
        steps_total: usize,
    },
    /// A step was done.
    Progress(Progress),
    /// A step that takes long has come to a place.
    WithinStep(StepTime),
    /// Something the user should know.
    Finding(Finding),
    /// A checkpoint was written.
    Checkpoint(PathBuf),
    /// The fit goes on with these settings.
    SettingsChanged(Box<FitSettings>),
    /// Settings that were asked for cannot be taken; the fit goes on with those it has.
    Refused(Error),
    /// The job holds.
    Paused,
    /// The job goes on.
    Resumed,
    /// All steps are done; images and files are being made.
    Finishing(FinishingStage),
    /// Everything is written.
    Finished(Box<crate::insight::report::ReportData>),
    /// The job ended early as asked, in its steps or while its report was made; the checkpoint holds its state.
    Stopped {
        /// Steps done.
        steps_done: usize,
    },
    /// The job ended with an error; the last checkpoint stays.
    Failed(Error),
}

/// What is made after the last step of a fit, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FinishingStage {
    /// The maps are written.
    Maps,
    /// Every view is rendered and scored.
    Views,
    /// The capture is checked.
    Capture,
    /// The result is relit.
    Relighting,
    /// The report is written.
    Report,
}

impl FinishingStage {
    /// In a few words, for a progress bar.
    pub fn label(self) -> &'static str {
        match self {
            FinishingStage::Maps => "writing maps",
            FinishingStage::Views => "rendering views",
            FinishingStage::Capture => "checking the capture",
            FinishingStage::Relighting => "relighting",
            FinishingStage::Report => "writing the report",
        }
    }

    /// Share of the finishing that is done when this stage begins, about as measured on photographs and on the demo, in
    /// [0, 1].
    pub fn share_before(self) -> f32 {
        match self {
            FinishingStage::Maps => 0.0,
            FinishingStage::Views => 0.1,
            FinishingStage::Capture => 0.6,
            FinishingStage::Relighting => 0.7,
            FinishingStage::Report => 0.9,
        }
    }
}

/// How far a fit is.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Progress {
    /// The newest line of the loss history.
    pub row: LossRow,
    /// Steps of the whole fit.
    pub steps_total: usize,
    /// Steps a second over the last steps.
    pub steps_per_second: f64,
    /// Seconds until the last step is done, from the pace so far and the pixels of the coming stages.
    pub seconds_left: f64,
    /// Seconds that what comes after the last step is expected to take.
    pub finishing_seconds: f64,
    /// What the steps so far tell of the pace of this machine.
    pub machine_pace: time_left::MachinePace,
}

/// How far a step is.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct StepTime {
    /// Seconds of all steps so far, this one's included.
    pub seconds: f64,
    /// Seconds until this one is done.
    pub step_seconds_left: f64,
    /// Seconds until the last step is done.
    pub seconds_left: f64,
    /// Seconds that what comes after it is expected to take.
    pub finishing_seconds: f64,
}

/// Maps and light at a step.
#[derive(Clone, Debug, PartialEq)]
pub struct Snapshot {
    /// Steps done.
    pub step: usize,
    /// The maps, of the size of the stage.
    pub maps: Arc<MaterialMaps>,
    /// The light.
    pub environment: Arc<Environment>,
    /// The curve so far.
    pub losses: Vec<LossRow>,
    /// Steps of the whole fit.
    pub steps_total: usize,
    /// Name of the stage, such as `diffuse 1/4`; that of the last stage at the end.
    pub stage: String,
    /// Root mean squared error of each view in linear radiance, as last known in this session:
    /// [`LiveFigures::view_rmse`](crate::fit::figures::LiveFigures::view_rmse).
    pub view_rmse: Vec<Option<f32>>,
    /// Logarithm of each view's gain; 0 when gains are not fitted.
    pub log_gains: Vec<f32>,
    /// Disagreement of the views at each texel in the last step; `None` without consistency.
    pub agreement: Option<Arc<GreyImage>>,
    /// What the solver tells beside them.
    pub told: SolverTold,
}
