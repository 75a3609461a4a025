//! What can be typed: the tasks, and the options of each by what they are about. The text of each field is its help.

mod pictures;
mod scene;

pub use pictures::{CompareOptions, Layer, RelightOptions, RenderOptions};
pub use scene::{CheckOptions, DemoOptions, FitOptions, ReadOptions, ResumeOptions};

use clap::{Args, Parser, Subcommand};
use std::path::PathBuf;

/// Turns a photographed scene into materials one can relight.
#[derive(Debug, Parser)]
#[command(name = "patina", version, about, max_term_width = 110)]
pub struct Arguments {
    /// One JSON object a line instead of text and progress bars.
    #[arg(long, global = true)]
    pub json: bool,
    /// Threads to work on; all processors when not given. Results do not depend on it.
    #[arg(long, global = true)]
    pub threads: Option<usize>,
    /// What to do.
    #[command(subcommand)]
    pub task: Option<Task>,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Task {
    /// Open the window; also what `patina` does without a task.
    Studio(StudioOptions),
    /// Build the demo scene in code, photograph it, fit it, relight it, and report the error against the truth.
    Demo(DemoOptions),
    /// Look a scene over before a fit: findings with place and remedy, and mesh outlines over every photo.
    Check(CheckOptions),
    /// Fit diffuse, specular and roughness maps and the light to a scene's photographs.
    Fit(Box<FitOptions>),
    /// Take up a run that was stopped; the result equals that of an uninterrupted run bit for bit.
    Resume(ResumeOptions),
    /// Render a run under other lights.
    Relight(RelightOptions),
    /// Estimate light and measured reflectance from photos of one object of known shape.
    Object(Box<super::object::ObjectOptions>),
    /// Move a run along what photos leave open, reflectance against light, into a new run folder.
    Gauge(super::gauge::GaugeOptions),
    /// Export a run to other renderers: GLB, USD, Mitsuba, Blender, MaterialX, texture sets, a page for browsers.
    Export(super::export::ExportArguments),
    /// Render a run from a scene's cameras, as pictures or layers in linear EXR.
    Render(RenderOptions),
    /// Score a run against the photographs of a scene.
    Compare(CompareOptions),
    /// Look at measured reflectance, convert it, and fit models to it.
    #[command(subcommand)]
    Measured(super::measured::MeasuredTask),
}

/// Options of `patina studio`.
#[derive(Clone, Debug, Default, Args)]
pub struct StudioOptions {
    /// A scene or run folder to open at once.
    pub path: Option<PathBuf>,
    /// Open the built-in demo at once.
    #[arg(long, conflicts_with = "path")]
    pub demo: bool,
    /// Remember settings in this file instead of the user's own.
    #[arg(long, value_name = "FILE")]
    pub settings_file: Option<PathBuf>,
}
