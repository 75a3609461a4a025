//! `patina-lab measured`: what is done with many tables at once, and the training of the neural model.

use super::neural::NeuralTask;
use crate::cli::interrupt::stop_on_interrupt;
use crate::cli::measured::{Fitted, Source, light_of, report_fit, table_of, tell_written};
use crate::error::Result;
use crate::image::file;
use crate::insight::material_pictures as pictures;
use crate::lab::neural::own_net::{self, OwnNetSettings};
use crate::lab::rivals::RivalOptions;
use crate::measured::fits::NeuralFits;
use clap::{Args, Subcommand};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// What to do with measured reflectance.
#[derive(Debug, Subcommand)]
pub enum MeasuredTask {
    /// Draw the spheres of all materials of a library on one sheet.
    Thumbnails(ThumbnailOptions),
    /// Fit the baselines and a net per material to all materials of a library and compare their errors.
    Rivals(RivalsOptions),
    /// Fit all weights of the neural model to one material.
    OwnNet(OwnNetOptions),
    /// What concerns the neural model.
    #[command(flatten)]
    Neural(NeuralTask),
}

/// Options of `patina-lab measured own-net`.
#[derive(Debug, Args)]
pub struct OwnNetOptions {
    /// The material.
    #[command(flatten)]
    pub source: Source,
    /// Folder of the fit: weights, `fit.json`, `fit.binary`, spheres and lobes side by side.
    #[arg(short, long)]
    pub output: PathBuf,
}

/// Options of `patina-lab measured thumbnails`.
#[derive(Debug, Args)]
pub struct ThumbnailOptions {
    /// Folder of the neural fits.
    pub library: PathBuf,
    /// Light the spheres by this environment in place of three lamps.
    #[arg(long)]
    pub env: Option<PathBuf>,
    /// Side of a sphere in pixels.
    #[arg(long, default_value_t = 104, value_parser = clap::value_parser!(u32).range(8..=512))]
    pub size: u32,
    /// The sheet, a PNG file.
    #[arg(short, long)]
    pub output: PathBuf,
}

/// Options of `patina-lab measured rivals`.
#[derive(Debug, Args)]
pub struct RivalsOptions {
    /// Folder of the neural fits.
    pub library: PathBuf,
    /// Only these materials.
    #[arg(long, value_delimiter = ',')]
    pub materials: Vec<String>,
    /// Only these models: ibrdf (one net per material), bivariate, dsbrdf, cook-torrance, cook-torrance-two, ggx, ward, maps.
    #[arg(long, value_delimiter = ',')]
    pub models: Vec<String>,
    /// Every eighth material only.
    #[arg(long)]
    pub quick: bool,
    /// Folder of the tables; a study that was stopped goes on there.
    #[arg(short, long, default_value = "patina-rivals")]
    pub output: PathBuf,
}

/// Runs a task.
pub fn run(task: &MeasuredTask, json: bool) -> Result<()> {
    match task {
        MeasuredTask::Thumbnails(options) => thumbnails(options, json),
        MeasuredTask::Rivals(options) => rivals(options, json),
        MeasuredTask::OwnNet(options) => own_net(options, json),
        MeasuredTask::Neural(task) => super::neural::run(task, json),
    }
}

fn own_net(options: &OwnNetOptions, json: bool) -> Result<()> {
    let (table, name) = table_of(&options.source)?;
    let found = own_net::fit_own_net(&crate::neural::shipped()?, &table, &OwnNetSettings::default())?;
    let command = format!("patina-lab measured own-net {name}");
    found.named(&name, &command).write(&options.output.join(own_net::FILE))?;
    let fitted = Fitted {
        model: own_net::NAME,
        table: found.model.table(&found.parameters),
        error: found.error,
        maps: None,
        parameters: found.parameters,
    };
    report_fit(&fitted, &name, &table, Some(&options.output), "fit", json)
}

fn thumbnails(options: &ThumbnailOptions, json: bool) -> Result<()> {
    let fits = NeuralFits::read(&options.library)?;
    let light = light_of(options.env.as_ref())?;
    let tiles: Vec<_> = fits
        .materials
        .iter()
        .map(|fit| {
            let table = fit.table();
            let value = |at| table.lookup(at).unwrap_or_default();
            (fit.name.clone(), pictures::sphere_of(&value, options.size as usize, &light))
        })
        .collect();
    file::write_png_srgb8(&options.output, &pictures::sheet(&tiles, None))?;
    tell_written(&format!("{} materials", tiles.len()), &options.output, json);
    Ok(())
}

fn rivals(options: &RivalsOptions, json: bool) -> Result<()> {
    let stop = Arc::new(AtomicBool::new(false));
    stop_on_interrupt(Arc::clone(&stop));
    let study = RivalOptions {
        library: options.library.clone(),
        materials: options.materials.clone(),
        models: options.models.clone(),
        quick: options.quick,
        output: options.output.clone(),
    };
    let table = crate::lab::rivals::run(&study, &stop, &|row| match json {
        true => println!("{}", serde_json::json!({"event": "rival", "row": row})),
        false => eprintln!("{:<26} {:<22} log-RMSE {:.4}", row.material, row.model, row.error.log_rmse),
    })?;
    if !json {
        println!("{}", table.to_markdown());
    }
    Ok(())
}
