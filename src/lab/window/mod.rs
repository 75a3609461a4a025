//! `patina bench studio`: the real window, driven from inside, and what it costs.
//!
//! Read [`person`] first: a thread that acts like somebody in front of the window, by keys, mouse and acts, and watches
//! what comes of it. [`driven`] is the window it sits at: the studio and nothing less, with a mark on every frame that
//! tells when the adapter was done with it. `script` runs the measurements one after another: [`stalls`], [`frames`],
//! [`answers`], [`slowdown`], [`memory`], [`equality`]. [`opening`], [`starting`] and [`relight`] need no window.
//! [`scenes`] makes what they work on, [`machine`] reads threads, memory and load from the system, [`report`] writes the
//! tables, [`bars`] holds the figures against what the window should keep to.
//!
//! What it refuses to do: to be a test. Figures depend on the machine and on what else runs there, so bars are told beside them,
//! with the load, and only `relight` fails where it misses its own. It also measures no display: a frame counts as shown when the adapter is done
//! with it and it was handed on.

pub mod answers;
pub mod bars;
pub mod driven;
pub mod equality;
pub mod frames;
pub mod machine;
pub mod memory;
pub mod opening;
pub mod person;
pub mod relight;
pub mod report;
mod report_alive;
pub mod scenes;
mod script;
pub mod slowdown;
pub mod stalls;
pub mod starting;

use crate::error::{Error, ErrorKind, Result};
use crate::studio::app::{Studio, StudioOptions};
use crate::studio::launch;
use driven::{Driven, Shared};
use person::Person;
pub use report::BenchReport;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

/// A folder of this process alone below the one for results, for what a measurement makes and takes away again.
pub fn scratch(output: &std::path::Path, name: &str) -> std::path::PathBuf {
    output.join(format!("{name}-{}", std::process::id()))
}

/// What is measured, and how long.
#[derive(Clone)]
pub struct BenchOptions {
    /// Seconds of each measurement.
    pub seconds: f64,
    /// Pairs of a fit with and without the window.
    pub pairs: usize,
    /// Cycles of open, fit, close.
    pub cycles: usize,
    /// A scene in place of the one made in code.
    pub scene: Option<PathBuf>,
    /// A small mesh and small maps where the scene is made in code.
    pub is_small: bool,
    /// Where the tables go, and the runs meanwhile.
    pub output: PathBuf,
    /// Measure how long the window hears nobody.
    pub stalls: bool,
    /// Measure frames.
    pub frames: bool,
    /// Measure answers.
    pub answers: bool,
    /// Measure what the window takes from a fit.
    pub slowdown: bool,
    /// Measure memory.
    pub memory: bool,
    /// Compare maps.
    pub equality: bool,
    /// What was measured without the window before.
    pub before: BenchReport,
    /// Hears what is being done.
    pub tell: Arc<dyn Fn(&str) + Send + Sync>,
}

/// Opens the window, measures, closes it, and writes `studio.md`, `studio.csv`, `studio.json` and `studio-memory.csv`.
///
/// # Errors
/// `Unsupported` without a display; `Unwritable` for the folder; `Internal` where something that was waited for never
/// came.
pub fn run(options: BenchOptions) -> Result<BenchReport> {
    std::fs::create_dir_all(&options.output).map_err(|source| Error::writing(&options.output, source))?;
    let settings_file = options.output.join("studio-settings.json");
    let runs = options.output.join("runs");
    let _ = std::fs::remove_file(&settings_file);
    let outcome: Arc<Mutex<Option<Result<BenchReport>>>> = Arc::default();
    let (kept, output) = (Arc::clone(&outcome), options.output.clone());
    let (own_settings, own_runs) = (settings_file.clone(), runs.clone());
    launch::open(Some(settings_file.clone()), move |creation| {
        let studio_options = StudioOptions { settings_file: Some(own_settings), ..StudioOptions::default() };
        let mut studio = Studio::new(creation, &studio_options);
        studio.model.preferences.runs_folder = own_runs;
        let device = creation.wgpu_render_state.as_ref().map(|state| state.device.clone());
        let shared = Arc::new(Shared::default());
        let person = Person::new(creation.egui_ctx.clone(), Arc::clone(&shared), device);
        let spawned = std::thread::Builder::new().name("patina-person".into()).spawn(move || {
            let measured =
                std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| script::measure(&person, &options)));
            let panicked = |_| Err(Error::new(ErrorKind::Internal, "the bench ended unexpectedly"));
            *kept.lock().unwrap_or_else(PoisonError::into_inner) = Some(measured.unwrap_or_else(panicked));
            person.close();
        });
        // Without the thread the window stays open and a person may close it: the missing report is the error.
        drop(spawned);
        Box::new(Driven::new(studio, shared))
    })?;
    let _ = std::fs::remove_file(&settings_file);
    let _ = std::fs::remove_dir_all(&runs);
    let report = outcome.lock().unwrap_or_else(PoisonError::into_inner).take();
    let report = report.unwrap_or_else(|| {
        Err(Error::new(ErrorKind::Stopped, "the window was closed before everything was measured"))
    })?;
    report.write(&output)?;
    Ok(report)
}
