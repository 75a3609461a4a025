//! `patina-lab measured`: trains the neural model of reflectance, draws the map of its codes, times it, tries it.

use crate::cli::interrupt::stop_on_interrupt;
use crate::error::{Error, ErrorKind, Place, Result};
use crate::files::write_bytes;
use crate::lab::neural::run::{Sitting, train};
use crate::lab::neural::speed;
use crate::measured::{MeasuredBrdf, NeuralFits};
use crate::neural::architecture::{Architecture, CODE};
use crate::neural::embedding::Embedding;
use crate::neural::fit::{FlowFitSettings, fit_table};
use crate::neural::flow::Flow;
use crate::neural::library::{Library, subset};
use crate::neural::nodes::GridShape;
use crate::neural::sampler::HalfVectorSampler;
use crate::neural::train::TrainSettings;
use crate::neural::{FlowModel, Trained};
use clap::{Args, Subcommand};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// What to do with measured materials and their neural model.
#[derive(Debug, Subcommand)]
pub enum NeuralTask {
    /// Train the neural model on a library of measured materials; can be stopped and taken up again.
    Train(TrainOptions),
    /// Draw the map of the materials' codes, and print how many neighbours are of a kind.
    Embedding(EmbeddingOptions),
    /// Fit codes to measured materials and print the errors.
    Codes(CodesOptions),
    /// Time the neural model: evaluations and samples a second.
    Speed(SpeedOptions),
}

/// A number of minutes.
pub(super) fn minutes(text: &str) -> std::result::Result<f64, String> {
    match text.parse::<f64>() {
        Ok(minutes) if minutes >= 0.0 => Ok(minutes),
        _ => Err("give a number of minutes, 0 or more".into()),
    }
}

/// Options of `patina-lab measured train`.
#[derive(Debug, Args)]
pub struct TrainOptions {
    /// Folder with the neural fits of MERL (names and weights), or with .binary tables.
    pub library: PathBuf,
    /// File of weights to write; checkpoint and curve are written beside it.
    #[arg(short, long, default_value = "ibrdf.safetensors")]
    pub output: PathBuf,
    /// `compact`, or the paper's own size, `paper`.
    #[arg(long, default_value = "compact")]
    pub configuration: String,
    /// Materials that are not trained on.
    #[arg(long, num_args = 1.., value_name = "NAME")]
    pub leave_out: Vec<String>,
    /// Share of the rest to train on; all of a left-out material's kind stay.
    #[arg(long, default_value_t = 1.0)]
    pub fraction: f64,
    /// Stop after this many minutes, to be taken up with --resume.
    #[arg(long, value_parser = minutes)]
    pub minutes: Option<f64>,
    /// Steps in all; the rates fall along them.
    #[arg(long)]
    pub steps: Option<u64>,
    /// Weight of the squared error of logarithms beside the likelihood; 0 is the paper's training.
    #[arg(long)]
    pub log_error_weight: Option<f64>,
    /// Seed of weights, codes and points.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Train a flow without codes on this one material's channel: NAME:red, NAME:green or NAME:blue.
    #[arg(long, value_name = "NAME:CHANNEL", conflicts_with_all = ["leave_out", "fraction"])]
    pub only: Option<String>,
    /// Take up the checkpoint beside the output.
    #[arg(long)]
    pub resume: bool,
}

/// Options of `patina-lab measured embedding`.
#[derive(Debug, Args)]
pub struct EmbeddingOptions {
    /// File of weights; those that come with the program when not given.
    #[arg(long)]
    pub weights: Option<PathBuf>,
    /// Table to write; a picture (.svg) is written beside it.
    #[arg(short, long, default_value = "embedding.csv")]
    pub output: PathBuf,
    /// Neighbours that are looked at.
    #[arg(long, default_value_t = 5)]
    pub neighbours: usize,
}

/// Options of `patina-lab measured codes`.
#[derive(Debug, Args)]
pub struct CodesOptions {
    /// Folder with the neural fits of MERL, or a .binary table.
    pub library: PathBuf,
    /// Materials of the folder; all when not given.
    #[arg(long, num_args = 1.., value_name = "NAME")]
    pub material: Vec<String>,
    /// File of weights; those that come with the program when not given.
    #[arg(long)]
    pub weights: Option<PathBuf>,
    /// Take the weights with a shape a material that come with the program.
    #[arg(long, conflicts_with = "weights")]
    pub shaped: bool,
    /// Take the weights that come with the program for studies of materials left out.
    #[arg(long, conflicts_with = "weights")]
    pub left_out: bool,
    /// Lobes, 1 to 3; when not given, one of shaped weights and three of others.
    #[arg(long)]
    pub lobes: Option<usize>,
    /// Table of errors to write.
    #[arg(short, long)]
    pub output: Option<PathBuf>,
}

/// Options of `patina-lab measured speed`.
#[derive(Debug, Args)]
pub struct SpeedOptions {
    /// Points of a batch.
    #[arg(long, default_value_t = 65_536)]
    pub batch: usize,
    /// How often each is timed; the best counts.
    #[arg(long, default_value_t = 5)]
    pub repeats: usize,
}

/// Runs a task.
pub fn run(task: &NeuralTask, json: bool) -> Result<()> {
    match task {
        NeuralTask::Train(options) => train_flow(options, json),
        NeuralTask::Embedding(options) => embedding(options, json),
        NeuralTask::Codes(options) => codes(options, json),
        NeuralTask::Speed(options) => time(options, json),
    }
}

fn unknown(setting: &str, message: String, remedy: &str) -> Error {
    Error::new(ErrorKind::InvalidSetting, message).at(Place::Setting(setting.into())).remedy(remedy)
}

fn weights(path: Option<&Path>) -> Result<Trained> {
    path.map_or_else(crate::neural::shipped, Trained::read)
}

fn train_flow(options: &TrainOptions, json: bool) -> Result<()> {
    let stop = Arc::new(AtomicBool::new(false));
    stop_on_interrupt(Arc::clone(&stop));
    let tell = |text: &str| match json {
        true => println!("{}", serde_json::json!({"event": "train", "message": text})),
        false => eprintln!("{text}"),
    };
    if !(options.fraction > 0.0 && options.fraction <= 1.0) {
        return Err(unknown("fraction", format!("{} is no share", options.fraction), "give a number in (0, 1]"));
    }
    let code = if options.only.is_some() { 0 } else { CODE };
    let architecture = Architecture::named(&options.configuration, code).ok_or_else(|| {
        let message = format!("there is no configuration `{}`", options.configuration);
        unknown("configuration", message, "take compact or paper")
    })?;
    let mut library = Library::read(&options.library, &[], &tell)?;
    if let Some(name) = options.leave_out.iter().find(|name| !library.names.contains(name)) {
        return Err(unknown("leave-out", format!("there is no material `{name}`"), "check the name in the library"));
    }
    let kept = subset(&library.names, &options.leave_out, options.fraction, options.seed);
    library.keep(&kept);
    if let Some(only) = &options.only {
        library = library.single(only).ok_or_else(|| {
            unknown("only", format!("there is no `{only}`"), "give a material and a channel, such as brass:red")
        })?;
    }
    let mut settings = TrainSettings { seed: options.seed, ..TrainSettings::of(&architecture) };
    settings.steps = options.steps.unwrap_or(settings.steps);
    settings.log_error_weight = options.log_error_weight.unwrap_or(settings.log_error_weight);
    let sitting = Sitting {
        output: options.output.clone(),
        architecture,
        settings,
        left_out: options.leave_out.clone(),
        command: std::env::args().collect::<Vec<_>>().join(" "),
        time: options.minutes.map(|minutes| Duration::from_secs_f64(60.0 * minutes.min(1e6))),
        resume: options.resume,
    };
    let account = train(&sitting, &library, &stop, &tell)?;
    if json {
        println!(
            "{}",
            serde_json::json!({"event": "trained", "step": account.step, "seconds": account.seconds,
            "log_likelihood": account.log_likelihood, "divergence": account.divergence, "log_error": account.log_error})
        );
    } else {
        println!("{} steps, {:.0} s: {}", account.step, account.seconds, options.output.display());
    }
    Ok(())
}

fn embedding(options: &EmbeddingOptions, json: bool) -> Result<()> {
    let map = Embedding::of(&weights(options.weights.as_deref())?, options.neighbours);
    write_bytes(&options.output, map.csv().as_bytes())?;
    let picture = options.output.with_extension("svg");
    write_bytes(&picture, map.svg().as_bytes())?;
    if json {
        println!(
            "{}",
            serde_json::json!({"event": "embedding", "purity": map.purity, "chance": map.chance,
            "explained": map.explained})
        );
    } else {
        println!(
            "{:.1} % of the {} nearest neighbours are of a kind ({:.1} % by chance); the map shows {:.0} % of the variance",
            100.0 * map.purity,
            options.neighbours,
            100.0 * map.chance,
            100.0 * (map.explained[0] + map.explained[1])
        );
        println!("{}, {}", options.output.display(), picture.display());
    }
    Ok(())
}

/// Every so many cells of a table are asked what reading between nodes costs.
const BETWEEN_NODES_STRIDE: usize = 301;

fn codes(options: &CodesOptions, json: bool) -> Result<()> {
    let shipped = match (options.shaped, options.left_out) {
        (false, false) => crate::neural::shipped,
        (false, true) => crate::neural::shipped_leave_out,
        (true, false) => crate::neural::shaped,
        (true, true) => crate::neural::shaped_leave_out,
    };
    let trained = Arc::new(options.weights.as_deref().map_or_else(shipped, Trained::read)?);
    let lobes = options.lobes.unwrap_or_else(|| trained.account.architecture.usual_lobes());
    if !(1..=3).contains(&lobes) {
        return Err(unknown("lobes", format!("{lobes} lobes are not fitted"), "take 1, 2 or 3"));
    }
    let model = FlowModel::with(Arc::clone(&trained), lobes, GridShape::default());
    let mut rows = String::from(
        "material,trained_on,log_rmse,log10_rmse,cosine_rmse,library_log_rmse,largest_albedo,between_nodes_log_rmse\n",
    );
    let (mut errors, mut between, mut bright) = (Vec::new(), Vec::new(), 0usize);
    let mut one = |name: &str, table: &MeasuredBrdf| -> Result<()> {
        let found = fit_table(&model, table, &FlowFitSettings::of(&trained.account.architecture))?;
        let own = match model.of_material(name) {
            Some(parameters) => crate::measured::metrics::table_error(&model.table(&parameters), table)?.log_rmse,
            None => f64::NAN,
        };
        let albedos = HalfVectorSampler::new(&model, &found.parameters).albedos();
        let largest = albedos.iter().flat_map(|(_, albedo)| *albedo).fold(0.0, f64::max);
        // What reading between nodes adds, which renderings do, beside exact evaluation.
        let between_nodes = model.interpolation_error(&found.parameters, BETWEEN_NODES_STRIDE);
        let known = trained.account.materials.iter().any(|own| own == name);
        let error = found.error;
        let row = format!(
            "{name},{known},{:.4},{:.4},{:.4},{own:.4},{largest:.3},{between_nodes:.4}",
            error.log_rmse, error.log10_rmse, error.cosine_rmse
        );
        if json {
            println!(
                "{}",
                serde_json::json!({"event": "codes", "material": name, "trained_on": known, "error": error,
                "library_log_rmse": own, "largest_albedo": largest, "between_nodes_log_rmse": between_nodes})
            );
        } else {
            println!("{row}");
        }
        rows.push_str(&row);
        rows.push('\n');
        errors.push(error.log_rmse);
        between.push(between_nodes);
        bright += usize::from(largest > 1.0);
        Ok(())
    };
    if options.library.is_file() {
        let name = options.library.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        one(&name, &MeasuredBrdf::read(&options.library)?)?;
    } else {
        let fits = NeuralFits::read(&options.library)?;
        let names: Vec<String> = match options.material.is_empty() {
            true => fits.materials.iter().map(|fit| fit.name.clone()).collect(),
            false => options.material.clone(),
        };
        for name in names {
            one(&name, &fits.find(&name)?.table())?;
        }
    }
    if !json {
        let mean = errors.iter().sum::<f64>() / errors.len().max(1) as f64;
        let median = crate::math::statistics::quantile(&errors, 0.5);
        println!("log-RMSE over {} materials: mean {mean:.4}, median {median:.4}", errors.len());
        let middle = crate::math::statistics::quantile(&between, 0.5);
        let most = between.iter().copied().fold(0.0, f64::max);
        println!("read between nodes, log-RMSE: median {middle:.4}, at most {most:.4}");
        println!("largest albedo above 1: {bright} of {}", errors.len());
    }
    options.output.as_ref().map_or(Ok(()), |path| write_bytes(path, rows.as_bytes()))
}

fn time(options: &SpeedOptions, json: bool) -> Result<()> {
    for name in ["compact", "paper"] {
        let Some(architecture) = Architecture::named(name, CODE) else { continue };
        let flow = Flow::new(architecture, 1)?;
        let found = speed::measure(&flow, options.batch, options.repeats);
        if json {
            println!(
                "{}",
                serde_json::json!({"event": "speed", "configuration": name, "weights": flow.weights.len(), "speed": found})
            );
        } else {
            println!(
                "{name}, {} weights, batches of {}: {:.3e} evaluations/s, {:.3e} samples/s, {:.3e} with gradients/s",
                flow.weights.len(),
                found.batch,
                found.evaluations_per_second,
                found.samples_per_second,
                found.gradients_per_second
            );
            // Only flows whose conditioners are small read tables in columns.
            if found.in_columns_per_second > 0.0 {
                println!("  in columns that share a conditioner, one thread: {:.3e}/s", found.in_columns_per_second);
            }
        }
    }
    Ok(())
}
