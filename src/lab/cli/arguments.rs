//! What can be typed to measure: audits, benchmarks and studies. The text of each field is its help.

use clap::{Args, Parser, Subcommand};
use std::path::PathBuf;

/// Measures the program: benches, studies, audits. What a user does is `patina`.
#[derive(Debug, Parser)]
#[command(name = "patina-lab", version, about, max_term_width = 110)]
pub struct Arguments {
    /// One JSON object a line instead of text.
    #[arg(long, global = true)]
    pub json: bool,
    /// Threads to work on; all processors when not given. Results do not depend on it.
    #[arg(long, global = true)]
    pub threads: Option<usize>,
    /// What to do.
    #[command(subcommand)]
    pub task: Task,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Task {
    /// Check the program against itself.
    #[command(subcommand)]
    Audit(AuditTask),
    /// Measure error, time and memory.
    #[command(subcommand)]
    Bench(BenchTask),
    /// Fit scenes with a known truth many times over and write tables and plots.
    #[command(subcommand)]
    Study(StudyTask),
    /// Open damaged files of every kind that is read; fails where one ends in a panic, in too much memory or in too long a
    /// wait.
    Fuzz(FuzzOptions),
    /// Have other programs open and render the exports of a run, and compare; fails where a bar is missed.
    Proof(crate::lab::proof::ProofOptions),
    /// Have other tools write cameras and meshes, read them, and compare; fails where a bar is missed or a tool is missing.
    Readers(crate::lab::readers::ReaderOptions),
    /// Run the workflow for many captures, with kills and failures; fails where it does otherwise than it should.
    Pipelines(crate::lab::pipelines::PipelineOptions),
    /// Ask what takes too long to be asked on every change; fails where something falls short.
    Nightly(NightlyOptions),
    /// Write the demo and the study scenes as exchange folders for the Mitsuba scripts.
    References(ReferencesOptions),
    /// Train the neural model of reflectance, hold models against measured tables.
    #[command(subcommand)]
    Measured(super::measured::MeasuredTask),
}

/// Options of `patina-lab fuzz`.
#[derive(Debug, Args)]
pub struct FuzzOptions {
    /// Damaged files of each kind.
    #[arg(long, default_value_t = 10_000)]
    pub inputs: u64,
    /// Number of the first: with --inputs 1 the one input that was told of.
    #[arg(long, default_value_t = 0)]
    pub from: u64,
    /// Seed of the damage.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Only these kinds, such as obj or colmap-binary.
    #[arg(long, value_delimiter = ',')]
    pub kind: Vec<String>,
    /// Folder of the inputs that went wrong; none are kept without it.
    #[arg(short, long)]
    pub output: Option<PathBuf>,
}

/// Options of `patina-lab nightly`.
#[derive(Debug, Args)]
pub struct NightlyOptions {
    /// Only these checks.
    #[arg(long, value_delimiter = ',')]
    pub checks: Vec<String>,
    /// Folder of what the checks write.
    #[arg(short, long, default_value = "patina-nightly")]
    pub output: PathBuf,
}

/// Options of `patina-lab references`.
#[derive(Debug, Args)]
pub struct ReferencesOptions {
    /// Folder of the scenes; the cow and the teddy are written when `cow.obj` and `teddy.obj` lie there, with texture
    /// coordinates (`tests/mitsuba/unwrap.py`).
    #[arg(short, long)]
    pub output: PathBuf,
}

/// What to audit.
#[derive(Debug, Subcommand)]
pub enum AuditTask {
    /// Compare reverse-mode derivatives with central differences in f64 under frozen randomness.
    Gradients(AuditOptions),
}

/// Options of `patina-lab audit gradients`.
#[derive(Debug, Args)]
pub struct AuditOptions {
    /// Parameters to compare over all maps and the light.
    #[arg(long, default_value_t = crate::lab::audit::AuditSettings::default().parameters)]
    pub parameters: usize,
    /// Parameters to compare for the exact gradient of multi-view consistency.
    #[arg(long, default_value_t = crate::lab::audit::AuditSettings::default().consistency_parameters)]
    pub consistency_parameters: usize,
    /// Seed of the scene's photographs, the paths and the choice of parameters.
    #[arg(long, default_value_t = crate::lab::audit::AuditSettings::default().seed)]
    pub seed: u64,
}

/// What to measure.
#[derive(Debug, Subcommand)]
pub enum BenchTask {
    /// Growth with triangles, views and map size: read, atlas, tracer, one step, peak memory so far.
    Scale(BenchOptions),
    /// Error against seconds: this program's methods and Mitsuba fit the same exchange scenes, judged alike.
    Fit(crate::lab::cli::contest::ContestArguments),
    /// Hard cases: error, steps, non-finite numbers and what was told, for this program's methods.
    Hard(crate::lab::cli::contest::HardArguments),
    /// Rays, paths and gradients a second, beside Mitsuba's.
    Tracer(crate::lab::cli::contest::TracerArguments),
    /// What `bench fit` starts for each of this program's fits.
    #[command(hide = true)]
    Entry(crate::lab::cli::contest::EntryArguments),
    /// The atlas of meshes: distortion, packing, seconds, and pictures of the layouts.
    Atlas(crate::lab::atlas_quality::AtlasArguments),
    /// Cached transport against the path tracer, over its settings.
    Cache(crate::lab::cached_error::CacheArguments),
    /// The window against what it should keep to: seconds to open and to the first maps, stalls, frames a second, time from
    /// an act to its answer, relighting, what it takes from a fit, memory. Most of it needs a display.
    Studio(BenchStudioOptions),
}

/// Options of `patina-lab bench studio`.
#[derive(Clone, Debug, Args)]
pub struct BenchStudioOptions {
    /// Seconds of each measurement.
    #[arg(long, default_value_t = 20.0)]
    pub seconds: f64,
    /// Pairs of a fit with and without the window.
    #[arg(long, default_value_t = 4)]
    pub pairs: usize,
    /// Cycles of open, fit some steps, close.
    #[arg(long, default_value_t = 40)]
    pub cycles: usize,
    /// Measure on this scene, beside the demo, in place of a sphere of 454 854 triangles with maps of 2048 x 2048 texels.
    #[arg(long)]
    pub scene: Option<PathBuf>,
    /// A small sphere, few seconds, few cycles.
    #[arg(long)]
    pub quick: bool,
    /// Only these parts.
    #[arg(long, value_enum, value_delimiter = ',')]
    pub parts: Vec<BenchPart>,
    /// Folder of the tables.
    #[arg(short, long, default_value = "patina-bench")]
    pub output: PathBuf,
}

/// A part of `patina-lab bench studio`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum BenchPart {
    /// Seconds from the drop of a scene until a fit could start, the first time and again. Needs no display.
    Opening,
    /// Seconds from Start to the first maps, the longest wait for newer ones, and how right the time left is, over two whole
    /// fits. Needs no display.
    Starting,
    /// For how long the window hears nobody while a scene is opened and from Start on.
    Stalls,
    /// Frames a second while the eye moves, frames at rest, share of the processors.
    Frames,
    /// Time from an act to the frame that shows its answer.
    Answers,
    /// Steps a second with and without the window.
    Slowdown,
    /// Memory over cycles of open, fit, close.
    Memory,
    /// Whether maps fitted under the window are those fitted without, bit for bit.
    Equality,
    /// Milliseconds of a new environment from cached transport, and its error against the path tracer; fails beyond its
    /// limits. Needs no display.
    Relight,
}

/// Options of `patina-lab bench scale`.
#[derive(Debug, Args)]
pub struct BenchOptions {
    /// Two small cases only.
    #[arg(long)]
    pub quick: bool,
    /// Time whole fits on their defaults in place of one step.
    #[arg(long)]
    pub whole: bool,
    /// The methods that are timed.
    #[arg(long, value_enum, value_delimiter = ',', default_values_t = [crate::lab::contest::Contestant::Adam])]
    pub methods: Vec<crate::lab::contest::Contestant>,
    /// Triangles: vary these in place of the built-in cases, the first with the first of the other lists.
    #[arg(long, value_delimiter = ',')]
    pub triangles: Vec<usize>,
    /// Views, in the same way.
    #[arg(long, value_delimiter = ',')]
    pub views: Vec<usize>,
    /// Widths of the maps in texels, in the same way.
    #[arg(long, value_delimiter = ',')]
    pub maps: Vec<usize>,
    /// Folder of the tables.
    #[arg(short, long, default_value = "patina-bench")]
    pub output: PathBuf,
}

/// What to study.
#[derive(Debug, Subcommand)]
pub enum StudyTask {
    /// What consistency between views changes: errors of pictures, maps and light for its settings, over seeds.
    Mvcl(crate::lab::cli::study::MvclOptions),
    /// What one photo tells of light and reflectance: figures 2 to 5 of the paper, and shadows.
    Ibrdf(crate::lab::cli::object_study::StudyIbrdfOptions),
    /// Make the tables and plots of all studies from the results that are kept.
    Tables(crate::lab::cli::study::TablesOptions),
}
