//! Does the workflow for many captures do what its guide says? `patina-lab pipelines --python PYTHON`.
//!
//! Three small captures are made, one of them broken, and worked off by Snakemake on this machine in several sittings
//! ([`sitting`]): the first is killed in a fit, the second is told to end in a fit and then killed, the third goes through, the
//! fourth finds nothing to do. A relight fails once on the way. [`judge`] says what of it went as it should.

pub mod judge;
pub mod sitting;

use super::bar_table::BarTable;
use crate::error::{Error, ErrorKind, Place, Result};
use crate::files::write_bytes;
use crate::job::demo::write_folder;
use crate::scene::demo::DemoSettings;
use serde_json::json;
use sitting::{Sitting, Workflow};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// The capture whose fit is killed.
pub const KILLED: &str = "killed";
/// The capture whose relight fails once.
pub const FAILS_ONCE: &str = "fails-once";
/// The capture with a photo that is cut short.
pub const BROKEN: &str = "broken";
/// That photo.
pub const BROKEN_PHOTO: &str = "0000.exr";
/// The file that says that the relight has failed.
const MARKER: &str = "failed_once";
/// Steps that a fit has taken before it is told to end.
const STEPS_BEFORE_END: usize = 5;

/// What is run, and with what.
#[derive(Clone, Debug, clap::Args)]
pub struct PipelineOptions {
    /// The Python that has `snakemake`.
    #[arg(long, default_value = "python3")]
    pub python: PathBuf,
    /// The program; the `patina` beside this one when not given.
    #[arg(long)]
    pub patina: Option<PathBuf>,
    /// The folder of the workflow.
    #[arg(long, default_value = "assets/pipelines")]
    pub workflow: PathBuf,
    /// The folder of the scripts.
    #[arg(long, default_value = "tests/pipelines")]
    pub scripts: PathBuf,
    /// Folder of captures, results and tables; what an earlier run left there is removed.
    #[arg(short, long, default_value = "patina-pipelines")]
    pub output: PathBuf,
}

/// Runs the workflow and judges it; `tell` hears of each sitting.
///
/// # Errors
/// A program, a script or a workflow that is missing; a fit that ends before it can be killed; `Stopped`. What the workflow
/// does otherwise than it should is a row that falls short.
pub fn run(options: &PipelineOptions, stop: &AtomicBool, tell: &dyn Fn(&str)) -> Result<BarTable> {
    let workflow = prepare(options, tell)?;
    let results = workflow.results.clone();
    let fit_log = results.join(KILLED).join("fit.log");
    let marker = workflow.folder.join(MARKER);

    tell("first sitting: killed as soon as a fit is on its way");
    let mut sitting = Sitting::start(&workflow, &[], "first")?;
    sitting.wait_until(|| judge::steps_in(&fit_log) > 0, stop)?;
    sitting.kill()?;
    let after_kill = judge::Files::under(&results);
    // The steps of the next fit are counted in a log of its own.
    remove(&fit_log)?;

    tell("second sitting: told to end in the fit, then killed");
    workflow.unlock()?;
    let mut sitting = Sitting::start(&workflow, &["--rerun-incomplete"], "second")?;
    sitting.wait_until(|| judge::steps_in(&fit_log) >= STEPS_BEFORE_END, stop)?;
    sitting.tell_to_end()?;
    sitting.wait_until_left(|| judge::has_stopped(&fit_log), stop)?;
    sitting.kill()?;
    let steps_at_end = judge::steps_in(&fit_log);

    tell("third sitting: to the end");
    if !results.join(FAILS_ONCE).join("relight.json").is_file() {
        // The failure may have been cut off together with its sitting.
        remove(&marker)?;
    }
    workflow.unlock()?;
    let third = Sitting::start(&workflow, &["--rerun-incomplete"], "third")?.wait(stop)?;
    let after_third = judge::Files::under(&results);

    tell("fourth sitting: nothing to do");
    let fourth = Sitting::start(&workflow, &[], "fourth")?.wait(stop)?;

    let mut table = BarTable::new(&["what", "seen"]);
    table.rows.push(judge::ended("third sitting", &third));
    table.rows.push(judge::untouched("after a kill", &after_kill, &results));
    table.rows.push(judge::resumed(&fit_log, steps_at_end));
    table.rows.push(judge::retried(&results));
    table.rows.push(judge::broken(&results));
    table.rows.push(judge::table(&results));
    table.rows.push(judge::page(&results));
    table.rows.push(judge::ended("fourth sitting", &fourth));
    table.rows.push(judge::untouched("when all is done", &after_third, &results));
    write_bytes(&options.output.join("pipelines.md"), table.to_markdown().as_bytes())?;
    Ok(table)
}

/// Makes the captures and the configuration.
fn prepare(options: &PipelineOptions, tell: &dyn Fn(&str)) -> Result<Workflow> {
    let patina = program(options)?;
    let whole = |path: &Path| path.canonicalize().map_err(|source| Error::reading(path, source));
    let snakefile = whole(&options.workflow.join("Snakefile"))?;
    let fails_once = whole(&options.scripts.join("fails_once.py"))?;
    for name in ["captures", "results", ".snakemake"] {
        let old = options.output.join(name);
        if old.exists() {
            std::fs::remove_dir_all(&old).map_err(|source| Error::writing(&old, source))?;
        }
    }
    std::fs::create_dir_all(&options.output).map_err(|source| Error::writing(&options.output, source))?;
    let folder = whole(&options.output)?;
    let marker = folder.join(MARKER);
    remove(&marker)?;
    tell("making three captures");
    for (seed, name) in (1u64..).zip([KILLED, FAILS_ONCE, BROKEN]) {
        let settings =
            DemoSettings { views: 8, held_out: 2, width: 80, height: 60, map_size: 128, seed, ..Default::default() };
        write_folder(&settings, &folder.join("captures").join(name))?;
    }
    cut(&folder.join("captures").join(BROKEN).join("views").join(BROKEN_PHOTO))?;
    let (captures, results) = (folder.join("captures"), folder.join("results"));
    let words = [
        "python3".to_string(),
        quoted(&fails_once),
        quoted(&marker),
        "relight".into(),
        FAILS_ONCE.into(),
        quoted(&patina),
    ];
    // Fits of a few seconds that say each step: Adam on small maps.
    let fit: Vec<&str> = "--method adam --map-size 128 --steps-diffuse 50 --steps-all 70 --samples 2 --bounces 1 \
         --environment-height 16 --held-out-interval 0"
        .split_whitespace()
        .collect();
    let small = ["--samples", "4"];
    let config = json!({
        "captures": captures, "results": results, "patina": words.join(" "), "threads": 1, "read_options": [],
        "fit_options": fit, "skies": ["noon", "overcast"], "relight_options": small, "compare_options": small,
    });
    let path = folder.join("config.json");
    write_bytes(&path, config.to_string().as_bytes())?;
    Ok(Workflow { python: options.python.clone(), snakefile, config: path, folder, results })
}

/// Removes a file where there is one.
fn remove(path: &Path) -> Result<()> {
    match std::fs::remove_file(path) {
        Err(source) if source.kind() != std::io::ErrorKind::NotFound => Err(Error::writing(path, source)),
        _ => Ok(()),
    }
}

/// The program that the workflow starts.
fn program(options: &PipelineOptions) -> Result<PathBuf> {
    let beside = || {
        let own = std::env::current_exe().map_err(|source| Error::reading("patina-lab".as_ref(), source))?;
        Ok(own.with_file_name(format!("patina{}", std::env::consts::EXE_SUFFIX)))
    };
    let path = options.patina.clone().map_or_else(beside, Ok)?;
    path.canonicalize().map_err(|source| {
        Error::new(ErrorKind::Missing, "the program is not here")
            .caused_by(source)
            .at(Place::File(path))
            .remedy("build it with `cargo build --release`, or name it with --patina")
    })
}

/// Cuts a photo in half.
fn cut(photo: &Path) -> Result<()> {
    let bytes = std::fs::read(photo).map_err(|source| Error::reading(photo, source))?;
    write_bytes(photo, &bytes[..bytes.len() / 2])
}

/// A path as a word for a shell.
fn quoted(path: &Path) -> String {
    format!("'{}'", path.display().to_string().replace('\'', r"'\''"))
}
