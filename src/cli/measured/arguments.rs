//! What `patina measured` is asked.

use clap::{Args, Subcommand};
use std::path::PathBuf;

/// What to do with measured reflectance.
#[derive(Debug, Subcommand)]
pub enum MeasuredTask {
    /// List the materials of a library folder of neural fits.
    List(ListOptions),
    /// Draw a material: its sphere, its lobes as curves and as numbers.
    Show(ShowOptions),
    /// Write a material as a table in MERL's `.binary` layout.
    Convert(ConvertOptions),
    /// Fit a model of few parameters to a material.
    Fit(MeasuredFitOptions),
    /// Project a measured, fitted or neural reflectance onto diffuse, specular and roughness, and state the error.
    Project(ProjectOptions),
}

/// Options of `patina measured list`.
#[derive(Debug, Args)]
pub struct ListOptions {
    /// Folder of the neural fits.
    pub library: PathBuf,
}

/// Where a material comes from.
#[derive(Debug, Args)]
pub struct Source {
    /// A `.binary` file, or the name of a material in the library or in the published fits.
    pub material: String,
    /// Folder of the neural fits.
    #[arg(long)]
    pub library: Option<PathBuf>,
    /// A file of published parameters, `.fit`, to take the material from.
    #[arg(long, conflicts_with = "library")]
    pub published: Option<PathBuf>,
}

/// Options of `patina measured show`.
#[derive(Debug, Args)]
pub struct ShowOptions {
    /// The material.
    #[command(flatten)]
    pub source: Source,
    /// Light the sphere by this environment in place of three lamps.
    #[arg(long)]
    pub env: Option<PathBuf>,
    /// Side of the picture in pixels.
    #[arg(long, default_value_t = 256, value_parser = clap::value_parser!(u32).range(8..=4096))]
    pub size: u32,
    /// Folder of the pictures.
    #[arg(short, long)]
    pub output: PathBuf,
}

/// Options of `patina measured convert`.
#[derive(Debug, Args)]
pub struct ConvertOptions {
    /// The material.
    #[command(flatten)]
    pub source: Source,
    /// The `.binary` file to write.
    #[arg(short, long)]
    pub output: PathBuf,
}

/// Options of `patina measured fit`.
#[derive(Debug, Args)]
pub struct MeasuredFitOptions {
    /// The material.
    #[command(flatten)]
    pub source: Source,
    /// cook-torrance, cook-torrance-two, ggx, ward, dsbrdf, bivariate, or maps (diffuse, specular and
    /// roughness).
    #[arg(long)]
    pub model: String,
    /// Folder of the fit: `fit.json`, `fit.binary`, spheres and lobes side by side.
    #[arg(short, long)]
    pub output: PathBuf,
}

/// Options of `patina measured project`.
#[derive(Debug, Args)]
pub struct ProjectOptions {
    /// A `.binary` file, the result folder of `patina object`, or the name of a material: of --library, or else of the
    /// neural model.
    pub material: String,
    /// Folder of the neural fits.
    #[arg(long)]
    pub library: Option<PathBuf>,
    /// Weights of the neural model; those that come with the program when not given.
    #[arg(long, conflicts_with = "library")]
    pub weights: Option<PathBuf>,
    /// Folder for `project.json`, the spheres and the lobes side by side, and the table of the projection.
    #[arg(short, long)]
    pub output: Option<PathBuf>,
}
