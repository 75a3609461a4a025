//! What can be typed: the tasks, and the options of each by what they are about. The text of each field is its help.

mod groups;
mod pictures;
mod scene;

pub use pictures::{CompareOptions, Layer, RelightOptions, RenderOptions};
pub use scene::{CheckOptions, DemoOptions, FitOptions, ReadOptions, ResumeOptions};

use clap::{Args, Parser, Subcommand};
use std::path::PathBuf;

/// Fits relightable material maps and an HDR environment to calibrated photos of a mesh.
#[derive(Debug, Parser)]
#[command(name = "patina", version, about, max_term_width = 110, after_help = "Read more with `patina guide`.")]
pub struct Arguments {
    /// Print one JSON object per line in place of text and progress bars.
    #[arg(long, global = true)]
    pub json: bool,
    /// Number of threads [default: all processors]. Results do not depend on it.
    #[arg(long, global = true)]
    pub threads: Option<usize>,
    /// The command.
    #[command(subcommand)]
    pub task: Option<Task>,
}

/// A command.
#[derive(Debug, Subcommand)]
pub enum Task {
    /// Open the window; also what `patina` does without a command.
    Studio(StudioOptions),
    /// Build the demo scene in code, photograph it, fit it, relight it, and report the error against the truth.
    Demo(DemoOptions),
    /// Validate a scene before fitting: findings with place and fix, and the mesh outline over every photo.
    Check(CheckOptions),
    /// Fit diffuse, specular and roughness maps and the environment to a scene's photos.
    #[command(after_help = "Expert settings are shown by --help; what is minimised, by `patina guide objective`.")]
    Fit(Box<FitOptions>),
    /// Resume an interrupted run; on the same kind of processor the result is bit-identical to an uninterrupted run.
    Resume(ResumeOptions),
    /// Render a run under other environments.
    Relight(RelightOptions),
    /// Estimate the environment and a measured reflectance from photos of a single object of known shape.
    Object(Box<super::object::ObjectOptions>),
    /// Trade brightness between environment and albedo, which photos of diffuse surfaces leave open; writes a new run.
    #[command(name = "rescale", visible_alias = "gauge")]
    Gauge(super::gauge::GaugeOptions),
    /// Export a run to other renderers: GLB, USD, Mitsuba, Blender, MaterialX, texture sets, a page for browsers.
    Export(super::export::ExportArguments),
    /// Render a run from a scene's cameras, as images or layers in linear EXR.
    Render(RenderOptions),
    /// Score a run against the photos of a scene.
    Compare(CompareOptions),
    /// Look at measured reflectance, convert it, and fit models to it.
    #[command(subcommand)]
    Measured(super::measured::MeasuredTask),
    /// Read the guide in the terminal; without a topic, list the topics.
    Guide(super::guide::GuideOptions),
    /// Print a script that completes commands and options in a shell.
    Completions(super::completions::CompletionsOptions),
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
