//! `patina-lab bench fit` with the process it starts for each fit, `patina-lab bench hard`
//! and `patina-lab bench tracer`.

use crate::cli::arguments::ReadOptions;
use crate::cli::interrupt::stop_on_interrupt;
use crate::error::{Error, Result};
use crate::lab::contest::entry::{self, EntryOptions};
use crate::lab::contest::{self, ContestOptions, Contestant, all};
use crate::lab::hard::{self, HardOptions};
use crate::lab::scenes::hard::HardCase;
use crate::lab::tracer_speed::{self, TracerOptions};
use clap::Args;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Options of `patina-lab bench fit`.
#[derive(Clone, Debug, Args)]
pub struct ContestArguments {
    /// Exchange folders with their truth; without one, the demo is made in code and written as one.
    pub scenes: Vec<PathBuf>,
    /// Fit every scene of this folder once and make one table of scenes by measures, with means and standard errors. What
    /// an earlier run left in the output folder is used again while program, scenes and options are the same.
    #[arg(long, conflicts_with_all = ["scenes", "reuse", "seeds"])]
    pub all: Option<PathBuf>,
    /// The methods, in the order they run; all when not given, with --all the solver.
    #[arg(long, value_enum, value_delimiter = ',')]
    pub methods: Vec<Contestant>,
    /// Wall-clock seconds that each fit may take, from the start of its process.
    #[arg(long, default_value_t = 600.0)]
    pub seconds: f64,
    /// Seconds at which each fit shows what it has; 10 and its doublings when not given.
    #[arg(long, value_delimiter = ',')]
    pub at: Vec<f64>,
    /// Number of seeds: 1, 2, 3 and so on.
    #[arg(long, default_value_t = 5)]
    pub seeds: usize,
    /// A tiny demo when no scene is named; with --all, at most 20 s a fit and 3 pictures of each kind of 16 paths.
    #[arg(long)]
    pub quick: bool,
    /// Judge what an earlier contest left in the output folder, and run only what it lacks.
    #[arg(long)]
    pub reuse: bool,
    /// Paths a pixel in pictures that are judged; their noise is taken off the squared error.
    #[arg(long, default_value_t = 32)]
    pub samples: usize,
    /// Pictures of each kind (training, held out, relit) that are judged, at most.
    #[arg(long, default_value_t = 6)]
    pub most_views: usize,
    /// A TOML file of fit settings that differ from the defaults, such as `samples = 8`.
    #[arg(long)]
    pub settings: Option<PathBuf>,
    /// The Python that has Mitsuba.
    #[arg(long, default_value = "python3")]
    pub python: PathBuf,
    /// The folder of `fit_exchange.py`.
    #[arg(long, default_value = "tests/mitsuba")]
    pub scripts: PathBuf,
    /// Folder of the tables, plots and snapshots.
    #[arg(short, long, default_value = "patina-bench")]
    pub output: PathBuf,
    /// How the scenes are read.
    #[command(flatten)]
    pub read: ReadOptions,
}

/// Options of `patina-lab bench entry`.
#[derive(Clone, Debug, Args)]
pub struct EntryArguments {
    /// An exchange folder with its truth.
    pub scene: PathBuf,
    /// The method.
    #[arg(long, value_enum)]
    pub method: Contestant,
    /// Seconds it may take.
    #[arg(long)]
    pub seconds: f64,
    /// Seconds at which it shows what it has.
    #[arg(long, value_delimiter = ',')]
    pub at: Vec<f64>,
    /// Seed of its random numbers.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// A TOML file of fit settings that differ from the defaults.
    #[arg(long)]
    pub settings: Option<PathBuf>,
    /// When the process was started, in seconds since 1970.
    #[arg(long)]
    pub began: Option<f64>,
    /// Folder of the snapshots.
    #[arg(short, long)]
    pub output: PathBuf,
    /// How the scene is read.
    #[command(flatten)]
    pub read: ReadOptions,
}

/// Options of `patina-lab bench hard`.
#[derive(Clone, Debug, Args)]
pub struct HardArguments {
    /// The methods.
    #[arg(long, value_enum, value_delimiter = ',', default_values_t = [Contestant::Adam, Contestant::Solver])]
    pub methods: Vec<Contestant>,
    /// The cases; all when not given.
    #[arg(long, value_enum, value_delimiter = ',')]
    pub cases: Vec<HardCase>,
    /// Tiny photos and few steps.
    #[arg(long)]
    pub quick: bool,
    /// Seed of the cameras, the photos and the fits.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Folder of the table.
    #[arg(short, long, default_value = "patina-bench")]
    pub output: PathBuf,
}

/// Options of `patina-lab bench tracer`.
#[derive(Clone, Debug, Args)]
pub struct TracerArguments {
    /// Exchange folders.
    pub scenes: Vec<PathBuf>,
    /// Bumpy spheres of so many triangles, timed as well.
    #[arg(long, value_delimiter = ',')]
    pub triangles: Vec<usize>,
    /// Views that are timed, at most.
    #[arg(long, default_value_t = 4)]
    pub most_views: usize,
    /// Paths a pixel.
    #[arg(long, default_value_t = 16)]
    pub samples: usize,
    /// Repetitions.
    #[arg(long, default_value_t = 5)]
    pub repetitions: usize,
    /// The Python that has Mitsuba; without it, only this program is timed.
    #[arg(long)]
    pub python: Option<PathBuf>,
    /// The folder of `time_exchange.py`.
    #[arg(long, default_value = "tests/mitsuba")]
    pub scripts: PathBuf,
    /// `tests/embree/time_rays.c`, compiled; without it, Embree is not asked for single rays.
    #[arg(long)]
    pub embree: Option<PathBuf>,
    /// Folder of the table.
    #[arg(short, long, default_value = "patina-bench")]
    pub output: PathBuf,
}

/// Times rays, paths and gradients, and writes the table.
pub fn tracer(options: &TracerArguments, json: bool, threads: Option<usize>) -> Result<()> {
    std::fs::create_dir_all(&options.output).map_err(|source| Error::writing(&options.output, source))?;
    let neither = options.scenes.is_empty() && options.triangles.is_empty();
    let tracer = TracerOptions {
        scenes: options.scenes.clone(),
        triangles: if neither { vec![31_964, 100_000, 454_854] } else { options.triangles.clone() },
        most_views: options.most_views,
        samples: options.samples,
        repetitions: options.repetitions,
        threads,
        python: options.python.clone(),
        scripts: options.scripts.clone(),
        embree: options.embree.clone(),
        output: options.output.clone(),
    };
    let table = tracer_speed::run(&tracer, &teller("tracer", json))?;
    table.write(&options.output, "tracer")?;
    if !json {
        println!("{}", table.to_markdown());
    }
    Ok(())
}

/// Runs the hard cases and prints their table.
pub fn hard(options: &HardArguments, json: bool) -> Result<()> {
    let stop = Arc::new(AtomicBool::new(false));
    stop_on_interrupt(Arc::clone(&stop));
    let hard = HardOptions {
        methods: options.methods.clone(),
        cases: if options.cases.is_empty() { HardCase::ALL.to_vec() } else { options.cases.clone() },
        quick: options.quick,
        seed: options.seed,
        output: options.output.clone(),
    };
    let tell = teller("hard", json);
    let table = hard::run(&hard, &stop, &tell)?;
    if !json {
        println!("{}", table.to_markdown());
    }
    tell(&format!("table: {}", options.output.join("hard.md").display()));
    Ok(())
}

/// Runs a contest and prints its tables.
pub fn fit(options: &ContestArguments, json: bool, threads: Option<usize>) -> Result<()> {
    let stop = Arc::new(AtomicBool::new(false));
    stop_on_interrupt(Arc::clone(&stop));
    let program = std::env::current_exe().map_err(|source| Error::reading("patina".as_ref(), source))?;
    let contest = ContestOptions {
        scenes: options.scenes.clone(),
        read: options.read.settings(),
        methods: methods_of(options),
        seconds: options.seconds,
        at: options.at.clone(),
        seeds: options.seeds,
        quick: options.quick,
        reuse: options.reuse,
        threads,
        samples: options.samples,
        most_views: options.most_views,
        settings: options.settings.clone(),
        program,
        python: options.python.clone(),
        scripts: options.scripts.clone(),
        output: options.output.clone(),
    };
    let tell = teller("contest", json);
    if let Some(folder) = &options.all {
        return every(folder, contest, &stop, &tell, json);
    }
    let result = contest::run(&contest, &stop, &tell)?;
    if !json {
        println!("{}", result.to_markdown());
    }
    tell(&format!("tables and plots: {}", options.output.display()));
    Ok(())
}

fn methods_of(options: &ContestArguments) -> Vec<Contestant> {
    match (options.methods.as_slice(), &options.all) {
        ([], None) => Contestant::ALL.to_vec(),
        ([], Some(_)) => vec![Contestant::Solver],
        (named, _) => named.to_vec(),
    }
}

/// Fits every scene of a folder and prints the table.
fn every(folder: &Path, mut contest: ContestOptions, stop: &AtomicBool, tell: &dyn Fn(&str), json: bool) -> Result<()> {
    if contest.quick {
        contest.seconds = contest.seconds.min(20.0);
        contest.samples = contest.samples.min(16);
        contest.most_views = contest.most_views.min(3);
    }
    if contest.at.is_empty() {
        // Doublings from half a second: first maps are looked for among them.
        let doublings = std::iter::successors(Some(0.5), |due| Some(2.0 * due));
        contest.at = doublings.take_while(|due| *due < contest.seconds).collect();
    }
    let table = all::run(folder, &contest, stop, tell)?;
    if !json {
        println!("{}", table.to_markdown());
    }
    tell(&format!("table: {}", contest.output.join("all.md").display()));
    Ok(())
}

/// Does one fit of a contest.
pub fn entry(options: &EntryArguments, json: bool) -> Result<()> {
    let stop = Arc::new(AtomicBool::new(false));
    stop_on_interrupt(Arc::clone(&stop));
    let entry = EntryOptions {
        scene: options.scene.clone(),
        read: options.read.settings(),
        method: options.method,
        seconds: options.seconds,
        at: options.at.clone(),
        seed: options.seed,
        settings: options.settings.clone(),
        began: options.began,
        output: options.output.clone(),
    };
    entry::enter(&entry, &stop, &teller("entry", json))
}

/// Says what goes on: a line of text, or one of JSON.
pub(super) fn teller(event: &'static str, json: bool) -> impl Fn(&str) {
    move |text| match json {
        true => println!("{}", serde_json::json!({"event": event, "message": text})),
        false => eprintln!("{text}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lab::contest::race::read_arguments;
    use crate::scene::ReadSettings;
    use crate::scene::settings::{BackgroundChoice, ColourEncoding, MaskUse, PixelCentre, Up};
    use clap::Parser;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        read: ReadOptions,
    }

    #[test]
    fn every_option_of_reading_reaches_the_process_of_a_fit() {
        let read = ReadSettings {
            up: Up::NegZ,
            pixel_centre: PixelCentre::Integer,
            hold_out_every: 5,
            max_views: 7,
            masks: MaskUse::Ignore,
            background: BackgroundChoice::Environment,
            encoding: ColourEncoding::Linear,
            layer: Some("View Layer.Combined".into()),
            shrink: 2,
            unit_in_metres: Some(0.001),
            mesh: vec!["/meshes/vase.obj".into(), "/meshes/lid.obj".into()],
            chunk: Some("Chunk 2".into()),
        };
        for read in [read, ReadSettings::default()] {
            let line = std::iter::once("entry".to_string()).chain(read_arguments(&read));
            assert_eq!(Line::parse_from(line).read.settings(), read);
        }
    }
}
