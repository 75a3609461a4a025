//! What can be typed. The text of each field is its help.

use crate::atlas::KeepUv;
use crate::fit::{FitSettings, Method, Preset};
use crate::scene::settings::{BackgroundChoice, PixelCentre, Up};
use clap::{Args, FromArgMatches, Parser, Subcommand};
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
    /// Render a run from a scene's cameras, as pictures or layers in linear EXR.
    Render(RenderOptions),
    /// Score a run against the photographs of a scene.
    Compare(CompareOptions),
    /// Look at measured reflectance, convert it, and fit models to it.
    #[command(subcommand)]
    Measured(super::measured::MeasuredTask),
    /// Check the program against itself.
    #[command(subcommand)]
    Audit(AuditTask),
    /// Measure time and memory.
    #[command(subcommand)]
    Bench(BenchTask),
    /// Fit scenes with a known truth many times over and write tables and plots.
    #[command(subcommand)]
    Study(StudyTask),
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

/// What to audit.
#[derive(Debug, Subcommand)]
pub enum AuditTask {
    /// Compare reverse-mode derivatives with central differences in f64 under frozen randomness.
    Gradients(AuditOptions),
}

/// Options of `patina audit gradients`.
#[derive(Debug, Args)]
pub struct AuditOptions {
    /// Parameters to compare over all maps and the light.
    #[arg(long, default_value_t = crate::insight::audit::AuditSettings::default().parameters)]
    pub parameters: usize,
    /// Parameters to compare for the exact gradient of multi-view consistency.
    #[arg(long, default_value_t = crate::insight::audit::AuditSettings::default().consistency_parameters)]
    pub consistency_parameters: usize,
    /// Seed of the scene's photographs, the paths and the choice of parameters.
    #[arg(long, default_value_t = crate::insight::audit::AuditSettings::default().seed)]
    pub seed: u64,
}

/// What to measure.
#[derive(Debug, Subcommand)]
pub enum BenchTask {
    /// Growth with triangles, views and map size: read, atlas, tracer, one step, peak memory.
    Scale(BenchOptions),
    /// Error against seconds: this program's methods and Mitsuba fit the same exchange scenes, judged alike.
    Fit(super::contest::ContestArguments),
    /// Hard cases: error, steps, non-finite numbers and what was told, for this program's methods.
    Hard(super::contest::HardArguments),
    /// Rays, paths and gradients a second, beside Mitsuba's.
    Tracer(super::contest::TracerArguments),
    /// What `bench fit` starts for each of this program's fits.
    #[command(hide = true)]
    Entry(super::contest::EntryArguments),
    /// The window: frames a second, time from an act to its answer, what it takes from a fit, memory. Needs a display.
    Studio(BenchStudioOptions),
}

/// Options of `patina bench studio`.
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
    /// Measure on this scene in place of a sphere of 454 854 triangles with maps of 2048 x 2048 texels.
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

/// A part of `patina bench studio`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum BenchPart {
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
}

/// Options of `patina bench scale`.
#[derive(Debug, Args)]
pub struct BenchOptions {
    /// Two small cases only.
    #[arg(long)]
    pub quick: bool,
    /// The methods whose step is timed.
    #[arg(long, value_enum, value_delimiter = ',', default_values_t = [crate::job::contest::Contestant::Adam])]
    pub methods: Vec<crate::job::contest::Contestant>,
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
    Mvcl(MvclOptions),
    /// What one photo tells of light and reflectance: figures 3 to 5 of the paper, and shadows.
    Ibrdf(super::object::StudyIbrdfOptions),
}

/// Options of `patina study mvcl`.
#[derive(Debug, Args)]
pub struct MvclOptions {
    /// Exchange folders with their truth; without one, a vase made and photographed in code.
    pub scenes: Vec<PathBuf>,
    /// Number of seeds: 1, 2, 3 and so on.
    #[arg(long, default_value_t = 5)]
    pub seeds: usize,
    /// Halved photographs, few steps and few paths.
    #[arg(long)]
    pub quick: bool,
    /// Settings to run; `none` always runs, since changes are against it.
    #[arg(long, value_enum, value_delimiter = ',')]
    pub cases: Vec<crate::job::study::Case>,
    /// Optimiser steps of the first step; 60 when quick, else the default of a fit.
    #[arg(long)]
    pub steps_diffuse: Option<usize>,
    /// Optimiser steps of the second step; 90 when quick, else the default of a fit.
    #[arg(long)]
    pub steps_all: Option<usize>,
    /// Folder of the tables and plots.
    #[arg(short, long)]
    pub output: PathBuf,
}

/// Options of `patina demo`.
#[derive(Debug, Args)]
pub struct DemoOptions {
    /// The run folder.
    #[arg(short, long, default_value = "patina-demo")]
    pub output: PathBuf,
    /// Seed of the cameras, the photographs and the fit.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// A TOML file of fit settings that differ from the demo's, such as `consistency = "exact"`.
    #[arg(long)]
    pub settings: Option<PathBuf>,
    /// How maps and light are found.
    #[arg(long, value_enum)]
    pub method: Option<Method>,
}

/// How a scene is read.
#[derive(Clone, Debug, Default, Args)]
pub struct ReadOptions {
    /// Which axis of the data set points up: auto, or one of +x -x +y -y +z -z.
    #[arg(long)]
    pub up: Option<Up>,
    /// Where the data set puts pixel centres: auto, integer or half.
    #[arg(long)]
    pub pixel_centre: Option<PixelCentre>,
    /// Keep every n-th view out of the fit, to judge it; 0 keeps none.
    #[arg(long)]
    pub hold_out_every: Option<usize>,
    /// Read at most so many views.
    #[arg(long)]
    pub max_views: Option<usize>,
    /// Shrink photographs by this whole factor on reading.
    #[arg(long)]
    pub shrink: Option<usize>,
    /// What pixels without surface show: auto, environment or black.
    #[arg(long)]
    pub scene_background: Option<BackgroundChoice>,
}

impl ReadOptions {
    /// The settings of the reader.
    pub fn settings(&self) -> crate::scene::ReadSettings {
        self.over(crate::scene::ReadSettings::default())
    }

    /// `settings` with everything that was typed.
    pub fn over(&self, mut settings: crate::scene::ReadSettings) -> crate::scene::ReadSettings {
        if let Some(up) = self.up {
            settings.up = up;
        }
        if let Some(centre) = self.pixel_centre {
            settings.pixel_centre = centre;
        }
        if let Some(every) = self.hold_out_every {
            settings.hold_out_every = every;
        }
        if let Some(most) = self.max_views {
            settings.max_views = most;
        }
        if let Some(shrink) = self.shrink {
            settings.shrink = shrink;
        }
        if let Some(background) = self.scene_background {
            settings.background = background;
        }
        settings
    }
}

/// Options of `patina check`.
#[derive(Debug, Args)]
pub struct CheckOptions {
    /// The scene: a BlendedMVS folder, an exchange folder, or a `scene.toml`.
    pub scene: PathBuf,
    /// Folder for the pictures with outlines; none are made without it.
    #[arg(short, long)]
    pub output: Option<PathBuf>,
    /// How the scene is read.
    #[command(flatten)]
    pub read: ReadOptions,
}

/// Options of `patina fit`.
#[derive(Debug, Args)]
pub struct FitOptions {
    /// The scene: a BlendedMVS folder, an exchange folder, or a `scene.toml`.
    pub scene: PathBuf,
    /// The run folder.
    #[arg(short, long)]
    pub output: PathBuf,
    /// A settings file as in a run folder; options on the command line win.
    #[arg(long)]
    pub settings: Option<PathBuf>,
    /// A light that is known: start from this map (HDR, EXR, PFM).
    #[arg(long)]
    pub env: Option<PathBuf>,
    /// Keep texture coordinates the mesh came with: auto, keep or rebuild.
    #[arg(long)]
    pub uv: Option<KeepUv>,
    /// How the scene is read.
    #[command(flatten)]
    pub read: ReadOptions,
    /// A whole set of settings to begin with; options on the command line win.
    #[arg(long, value_enum, conflicts_with = "settings")]
    pub preset: Option<Preset>,
    /// How the maps are fitted.
    #[command(flatten)]
    pub fit: TypedSettings,
}

/// Settings of a fit, and which of them were typed.
#[derive(Clone, Debug, Default)]
pub struct TypedSettings {
    /// The settings; what was not typed has its default.
    pub values: FitSettings,
    /// Names of those that were typed.
    pub typed: Vec<String>,
}

impl TypedSettings {
    /// `base` with everything that was typed.
    pub fn over(&self, base: &FitSettings) -> crate::Result<FitSettings> {
        base.with(&self.typed, &self.values)
    }
}

impl FromArgMatches for TypedSettings {
    fn from_arg_matches(matches: &clap::ArgMatches) -> Result<Self, clap::Error> {
        // Arguments are known by the names of the fields.
        let is_typed = |name: &String| {
            matches.value_source(&name.replace('-', "_")) == Some(clap::parser::ValueSource::CommandLine)
        };
        let names = FitSettings::described().into_iter().map(|setting| setting.name);
        Ok(TypedSettings { values: FitSettings::from_arg_matches(matches)?, typed: names.filter(is_typed).collect() })
    }

    fn update_from_arg_matches(&mut self, matches: &clap::ArgMatches) -> Result<(), clap::Error> {
        *self = TypedSettings::from_arg_matches(matches)?;
        Ok(())
    }
}

impl Args for TypedSettings {
    fn augment_args(command: clap::Command) -> clap::Command {
        FitSettings::augment_args(command)
    }

    fn augment_args_for_update(command: clap::Command) -> clap::Command {
        FitSettings::augment_args_for_update(command)
    }
}

/// Options of `patina resume`.
#[derive(Debug, Args)]
pub struct ResumeOptions {
    /// The run folder.
    pub run: PathBuf,
    /// The scene, when it has moved since.
    #[arg(long)]
    pub scene: Option<PathBuf>,
}

/// Options of `patina relight`.
#[derive(Debug, Args)]
pub struct RelightOptions {
    /// The run folder.
    pub run: PathBuf,
    /// Lights: HDR or EXR files, or `noon`, `evening`, `overcast`.
    #[arg(long, required = true, num_args = 1..)]
    pub env: Vec<String>,
    /// The scene whose cameras are used; the scene of the run when not given.
    #[arg(long)]
    pub cameras: Option<PathBuf>,
    /// Names of the views; the first held-out ones when not given.
    #[arg(long, num_args = 1..)]
    pub views: Vec<String>,
    /// Turn the light about the vertical, in degrees.
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    pub rotate: f32,
    /// Keep the light as strong as its file says; otherwise its mean is matched to that of the fitted light.
    #[arg(long)]
    pub absolute: bool,
    /// Paths a pixel.
    #[arg(long, default_value_t = 64)]
    pub samples: usize,
    /// Surface hits on the longest path.
    #[arg(long, default_value_t = 3)]
    pub bounces: usize,
    /// Shrink pictures by this whole factor.
    #[arg(long, default_value_t = 1)]
    pub shrink: usize,
    /// Exposure of the PNG files, in stops.
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    pub exposure: f32,
    /// Hide the light behind the surface.
    #[arg(long)]
    pub hide_background: bool,
    /// Give parts of the surface a measured reflectance: a `.binary` file, the result folder of `patina object`, or the
    /// name of a material of the neural model. One for each --region, or one for the whole surface.
    #[arg(long)]
    pub material: Vec<String>,
    /// Take materials from this folder of neural fits of measurements, not from the neural model.
    #[arg(long, requires = "material")]
    pub library: Option<PathBuf>,
    /// Masks over the texture maps, white where the material of the same place in the list holds.
    #[arg(long, requires = "material")]
    pub region: Vec<PathBuf>,
    /// A turntable instead of single pictures.
    #[command(flatten)]
    pub turntable: super::turntable::TurntableOptions,
    /// Folder of the pictures; `relight` in the run folder when not given.
    #[arg(short, long)]
    pub output: Option<PathBuf>,
}

/// A layer of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Layer {
    /// The picture under the run's light.
    Shaded,
    /// Diffuse reflectance.
    Diffuse,
    /// Specular reflectance F0.
    Specular,
    /// Roughness r = a^2.
    Roughness,
    /// Shading normal in the world.
    Normal,
    /// Share of the pixel that the surface covers.
    Coverage,
    /// Variance of each shaded pixel's mean, from independent groups of samples.
    Variance,
}

/// Options of `patina render`.
#[derive(Debug, Args)]
pub struct RenderOptions {
    /// The run folder; or an exchange folder with its truth, to render that.
    pub run: PathBuf,
    /// The scene whose cameras are used; the scene of the run when not given.
    #[arg(long)]
    pub cameras: Option<PathBuf>,
    /// Layers to write, one linear EXR per view and layer.
    #[arg(long, value_enum, value_delimiter = ',', default_value = "shaded")]
    pub aov: Vec<Layer>,
    /// Names of the views; all when not given.
    #[arg(long, num_args = 1..)]
    pub views: Vec<String>,
    /// Another light than the run's own, as a file or a built-in sky.
    #[arg(long)]
    pub env: Option<String>,
    /// Paths a pixel.
    #[arg(long, default_value_t = 64)]
    pub samples: usize,
    /// Surface hits on the longest path.
    #[arg(long, default_value_t = 3)]
    pub bounces: usize,
    /// Seed of the random numbers.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Hide the light behind the surface.
    #[arg(long)]
    pub hide_background: bool,
    /// How the scene is read.
    #[command(flatten)]
    pub read: ReadOptions,
    /// Folder of the pictures; `render` in the run folder when not given.
    #[arg(short, long)]
    pub output: Option<PathBuf>,
}

/// Options of `patina compare`.
#[derive(Debug, Args)]
pub struct CompareOptions {
    /// The run folder.
    pub run: PathBuf,
    /// The scene with the photographs.
    pub scene: PathBuf,
    /// Paths a pixel.
    #[arg(long, default_value_t = 32)]
    pub samples: usize,
    /// Surface hits on the longest path; that of the run when not given.
    #[arg(long)]
    pub bounces: Option<usize>,
    /// How the scene is read.
    #[command(flatten)]
    pub read: ReadOptions,
}
