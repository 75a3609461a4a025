//! `patina-lab study`: sittings of studies, and the tables of what they left.

use crate::cli::interrupt::stop_on_interrupt;
use crate::error::{Error, ErrorKind, Place, Result};
use crate::lab::consistency::{self, StudyOptions};
use crate::lab::object_study;
use crate::lab::study::{CasePattern, Results, Sitting, Tally};
use clap::Args;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// Options that every study has.
#[derive(Clone, Debug, Args)]
pub struct SittingOptions {
    /// Only cases whose names hold these words, such as `fig5 nickel`; a comma stands for `or`, and !WORD leaves out.
    #[arg(long, value_name = "PATTERN")]
    pub cases: Option<CasePattern>,
    /// Begin no case after so many seconds: the same command goes on where it was.
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub budget: Option<f64>,
    /// Folder of the results, one file a study; cases that stand there are not done again.
    #[arg(long, default_value = RESULTS)]
    pub results: PathBuf,
}

/// Where results are kept.
const RESULTS: &str = "tests/results";

fn seconds(text: &str) -> std::result::Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if (0.0..1e9).contains(&seconds) => Ok(seconds),
        _ => Err("give a number of seconds, 0 or more".into()),
    }
}

/// Options of `patina-lab study mvcl`.
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
    /// Optimiser steps of the first step; 60 when quick, else the default of a fit.
    #[arg(long)]
    pub steps_diffuse: Option<usize>,
    /// Optimiser steps of the second step; 90 when quick, else the default of a fit.
    #[arg(long)]
    pub steps_all: Option<usize>,
    /// Which cases, for how long, and where they are kept.
    #[command(flatten)]
    pub sitting: SittingOptions,
}

/// Options of `patina-lab study tables`.
#[derive(Clone, Debug, Args)]
pub struct TablesOptions {
    /// Folder of the results.
    #[arg(long, default_value = RESULTS)]
    pub results: PathBuf,
    /// Folder of the tables and plots; `studies.md` holds all tables.
    #[arg(short, long, default_value = "patina-studies")]
    pub output: PathBuf,
}

impl SittingOptions {
    /// Sits for a study of this name. `study` is given its results file and the sitting.
    ///
    /// # Errors
    /// Those of the study.
    pub fn sit(&self, name: &str, json: bool, study: &mut dyn FnMut(&Path, &Sitting) -> Result<Tally>) -> Result<()> {
        let stop = Arc::new(AtomicBool::new(false));
        stop_on_interrupt(Arc::clone(&stop));
        let tell = |text: &str| match json {
            true => println!("{}", serde_json::json!({"event": "study", "message": text})),
            false => eprintln!("{text}"),
        };
        let (pattern, budget) = (self.cases.clone().unwrap_or_default(), self.budget.map(Duration::from_secs_f64));
        let sitting = Sitting { budget, pattern, stop: &stop, tell: &tell };
        let path = file_of(&self.results, name);
        study(&path, &sitting)?;
        tell(&format!("results: {}; `patina-lab study tables` makes the tables", path.display()));
        Ok(())
    }
}

fn file_of(folder: &Path, study: &str) -> PathBuf {
    folder.join(format!("{study}.jsonl"))
}

/// Studies consistency between views.
pub fn mvcl(options: &MvclOptions, json: bool) -> Result<()> {
    let study = StudyOptions {
        scenes: options.scenes.clone(),
        seeds: options.seeds,
        quick: options.quick,
        steps_diffuse: options.steps_diffuse,
        steps_all: options.steps_all,
    };
    options.sitting.sit("mvcl", json, &mut |results, sitting| consistency::mvcl(&study, results, sitting))
}

/// Makes the tables of all studies.
pub fn tables(options: &TablesOptions, json: bool) -> Result<()> {
    type Write = fn(&Results, &Path) -> Result<String>;
    let studies: [(&str, Write); 2] = [("ibrdf", object_study::tables::write), ("mvcl", consistency::tables::write)];
    let mut texts = Vec::new();
    for (name, write) in studies {
        let path = file_of(&options.results, name);
        if path.is_file() {
            texts.push(write(&Results::read(&path)?, &options.output)?);
        }
    }
    if texts.is_empty() {
        return Err(Error::new(ErrorKind::Missing, "the folder holds no results of a study")
            .at(Place::File(options.results.clone()))
            .remedy("name their folder with --results, or make some with `patina-lab study ibrdf` or `study mvcl`"));
    }
    let (text, path) = (texts.join("\n"), options.output.join("studies.md"));
    crate::files::write_bytes(&path, text.as_bytes())?;
    match json {
        true => println!("{}", serde_json::json!({"event": "tables", "path": path})),
        false => println!("{text}"),
    }
    Ok(())
}
