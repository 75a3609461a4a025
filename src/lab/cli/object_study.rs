//! `patina-lab study ibrdf`: what one photo tells of light and reflectance.

use crate::cli::fit::stop_on_interrupt;
use crate::error::Result;
use crate::lab::object_study as study;
use crate::object::starts::ModelKind;
use clap::Args;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

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
    /// Models of the reflectance; the neural one and Cook-Torrance when not given.
    #[arg(long, value_enum, value_delimiter = ',')]
    pub models: Vec<ModelKind>,
    /// A few small cases, some minutes.
    #[arg(long)]
    pub quick: bool,
    /// Materials of each figure at most, in place of two with --quick and the paper's number without.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..))]
    pub materials: Option<u16>,
    /// Lights of each figure at most, in place of one or two with --quick and the paper's number without.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..))]
    pub lights: Option<u16>,
    /// Only these parts; without it, all but `schedules`.
    #[arg(long, value_enum, value_delimiter = ',')]
    pub parts: Vec<study::Part>,
    /// Minutes after which figure 2 begins no further fit of DSBRDF; none are begun with --quick, and all without.
    #[arg(long, value_parser = crate::lab::cli::neural::minutes)]
    pub dsbrdf_minutes: Option<f64>,
    /// Seed of pixels, noise and nets.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Folder of results, tables and page; results that stand there are not made again.
    #[arg(short, long)]
    pub output: PathBuf,
}

/// Studies what one photo tells.
pub fn study(options: &StudyIbrdfOptions, json: bool) -> Result<()> {
    let stop = Arc::new(AtomicBool::new(false));
    stop_on_interrupt(Arc::clone(&stop));
    let models = match options.models.is_empty() {
        false => options.models.clone(),
        true => vec![ModelKind::Ibrdf, ModelKind::CookTorrance],
    };
    let asked = study::StudyOptions {
        library: options.library.clone(),
        envmaps: options.envmaps.clone(),
        mesh: options.mesh.clone(),
        weights: options.weights.clone(),
        leave_out_weights: options.leave_out_weights.clone(),
        models,
        quick: options.quick,
        materials: options.materials.map(usize::from),
        lights: options.lights.map(usize::from),
        parts: options.parts.clone(),
        dsbrdf_minutes: options.dsbrdf_minutes.unwrap_or(if options.quick { 0.0 } else { f64::INFINITY }),
        seed: options.seed,
        output: options.output.clone(),
    };
    let tell = |text: &str| match json {
        true => println!("{}", serde_json::json!({"event": "study", "message": text})),
        false => eprintln!("{text}"),
    };
    let tables = study::run(&asked, &stop, &tell)?;
    if !json {
        println!("{tables}");
    }
    tell(&format!("tables and page: {}", options.output.display()));
    Ok(())
}
