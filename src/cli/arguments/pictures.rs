//! What can be typed to make pictures of runs and compare pictures. The text of each field is its help.

use super::{ReadOptions, groups};
use crate::render::path::MAX_BOUNCES;
use clap::Args;
use std::path::PathBuf;

/// A number that is one.
fn finite(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err("give a finite number".into()),
    }
}

/// A number of samples per pixel.
fn paths(text: &str) -> Result<usize, String> {
    match text.parse::<usize>() {
        Ok(number @ 1..=65_536) => Ok(number),
        _ => Err("give a whole number from 1 to 65536".into()),
    }
}

/// A whole number of surface hits.
fn hits(text: &str) -> Result<usize, String> {
    match text.parse::<usize>() {
        Ok(number) if (1..=MAX_BOUNCES).contains(&number) => Ok(number),
        _ => Err(format!("give a whole number from 1 to {MAX_BOUNCES}")),
    }
}

/// An angle by which a background is blurred, in degrees.
fn blur(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(degrees) if degrees == 0.0 || (5.0..=90.0).contains(&degrees) => Ok(degrees),
        _ => Err("give degrees from 5 to 90, or 0 for a sharp one".into()),
    }
}

/// Options of `patina relight`.
#[derive(Debug, Args)]
#[command(mut_args(groups::beside_a_run), mut_args(groups::of_cameras))]
pub struct RelightOptions {
    /// The run folder.
    pub run: PathBuf,
    /// Environments: HDR, EXR or PFM files, the built-in skies `noon`, `evening`, `overcast`, or the sky of an hour and a
    /// latitude such as `16:30@48`, with a day of the year after a comma.
    #[arg(long, required = true, num_args = 1..)]
    pub env: Vec<String>,
    /// The scene whose cameras are used; the scene of the run when not given.
    #[arg(long)]
    pub cameras: Option<PathBuf>,
    /// Names of the views; the first held-out ones when not given.
    #[arg(long, num_args = 1..)]
    pub views: Vec<String>,
    /// Rotate the environment about the up axis, in degrees.
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true, value_parser = finite)]
    pub rotate: f32,
    /// Keep the intensity of the file; otherwise the mean is normalised to that of the estimated environment.
    #[arg(long)]
    pub absolute: bool,
    /// Samples per pixel (spp).
    #[arg(long, default_value_t = 64, value_parser = paths)]
    pub samples: usize,
    /// Max bounces: surface hits on the longest path, 1 to 16.
    #[arg(long, default_value_t = 3, value_parser = hits)]
    pub bounces: usize,
    /// Exposure of the PNG files, in EV (stops).
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true, value_parser = finite)]
    pub exposure: f32,
    /// Do not show the environment as background.
    #[arg(long)]
    pub hide_background: bool,
    /// Show the environment out of focus behind the surface, blurred by so many degrees; what it lights stays sharp.
    #[arg(long, value_name = "DEGREES", default_value_t = 0.0, conflicts_with = "hide_background", value_parser = blur)]
    pub background_blur: f32,
    /// Lay a level ground under the surface that shows its shadow on the environment behind it.
    #[arg(long, conflicts_with = "material")]
    pub ground: bool,
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
    /// A turntable in place of single images.
    #[command(flatten)]
    pub turntable: crate::cli::turntable::TurntableOptions,
    /// How the scene is read.
    #[command(flatten)]
    pub read: ReadOptions,
    /// Folder of the images; `relight` in the run folder when not given.
    #[arg(short, long)]
    pub output: Option<PathBuf>,
}

/// A layer of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Layer {
    /// The image under the run's environment.
    Shaded,
    /// Diffuse reflectance.
    Diffuse,
    /// Specular reflectance F0.
    Specular,
    /// Roughness r = a^2.
    Roughness,
    /// Shading normal in world space.
    Normal,
    /// Share of the pixel that the surface covers.
    Coverage,
    /// Variance of each shaded pixel's mean, from independent groups of samples.
    Variance,
}

/// Options of `patina render`.
#[derive(Debug, Args)]
#[command(mut_args(groups::beside_a_run))]
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
    /// Another environment than the run's own: a file or a built-in sky.
    #[arg(long)]
    pub env: Option<String>,
    /// Samples per pixel (spp).
    #[arg(long, default_value_t = 64, value_parser = paths)]
    pub samples: usize,
    /// Max bounces: surface hits on the longest path, 1 to 16.
    #[arg(long, default_value_t = 3, value_parser = hits)]
    pub bounces: usize,
    /// Seed of the random numbers.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Do not show the environment as background.
    #[arg(long)]
    pub hide_background: bool,
    /// Show the environment out of focus behind the surface, blurred by so many degrees.
    #[arg(long, value_name = "DEGREES", default_value_t = 0.0, conflicts_with = "hide_background", value_parser = blur)]
    pub background_blur: f32,
    /// How the scene is read.
    #[command(flatten)]
    pub read: ReadOptions,
    /// Folder of the images; `render` in the run folder when not given.
    #[arg(short, long)]
    pub output: Option<PathBuf>,
}

/// Options of `patina compare`.
#[derive(Debug, Args)]
#[command(mut_args(groups::beside_a_run))]
pub struct CompareOptions {
    /// The run folder.
    pub run: PathBuf,
    /// The scene with the photos.
    pub scene: PathBuf,
    /// Samples per pixel (spp).
    #[arg(long, default_value_t = 32, value_parser = paths)]
    pub samples: usize,
    /// Max bounces: surface hits on the longest path, 1 to 16; those of the run when not given.
    #[arg(long, value_parser = hits)]
    pub bounces: Option<usize>,
    /// Score by the rules of a published benchmark: its cameras, environments, masks, scales and tone curves.
    #[arg(long, value_enum)]
    pub protocol: Option<crate::job::benchmark::Protocol>,
    /// How the scene is read.
    #[command(flatten)]
    pub read: ReadOptions,
}
