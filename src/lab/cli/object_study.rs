//! `patina-lab study ibrdf`: what one photo tells of light and reflectance.

use super::study::SittingOptions;
use crate::error::Result;
use crate::lab::object_study as study;
use clap::Args;
use std::path::PathBuf;

/// Options of `patina-lab study ibrdf`.
#[derive(Debug, Args)]
pub struct StudyIbrdfOptions {
    /// Folder of the neural fits of the MERL materials.
    pub library: PathBuf,
    /// Folder of latitude-longitude environments.
    pub envmaps: PathBuf,
    /// Mesh of an object that shadows itself.
    #[arg(long)]
    pub mesh: Option<PathBuf>,
    /// Weights of the neural model; those that come with the program for studies of materials left out when not given.
    #[arg(long)]
    pub weights: Option<PathBuf>,
    /// Further weights for figure 2, each fitted to the materials it was trained without.
    #[arg(long, value_delimiter = ',')]
    pub leave_out_weights: Vec<PathBuf>,
    /// Small photos and lights: a minute holds a dozen cases. They are parts of their own in the results.
    #[arg(long)]
    pub quick: bool,
    /// Folder for a sheet of pictures of each case that is done.
    #[arg(long)]
    pub pictures: Option<PathBuf>,
    /// Which cases, for how long, and where they are kept.
    #[command(flatten)]
    pub sitting: SittingOptions,
}

/// Studies what one photo tells.
pub fn study(options: &StudyIbrdfOptions, json: bool) -> Result<()> {
    let asked = study::StudyOptions {
        library: options.library.clone(),
        envmaps: options.envmaps.clone(),
        mesh: options.mesh.clone(),
        weights: options.weights.clone(),
        leave_out_weights: options.leave_out_weights.clone(),
        quick: options.quick,
        pictures: options.pictures.clone(),
    };
    options.sitting.sit("ibrdf", json, &mut |results, sitting| study::run(&asked, results, sitting))
}
