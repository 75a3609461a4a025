//! Comparisons with tools of other hands, by the Python that `PATINA_TOOLS_PYTHON` names.

use super::Outcome;
use crate::error::Result;
use crate::lab::bar_table::BarTable;
use crate::lab::pipelines::{self, PipelineOptions};
use crate::lab::readers::{self, ReaderOptions};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// What pycolmap, trimesh and PyMeshLab write is read as they read it.
pub fn readers_agree(folder: &Path, _: &AtomicBool) -> Result<Outcome> {
    let Some(python) = python() else { return Ok(left_out("pycolmap, trimesh and PyMeshLab")) };
    let options = ReaderOptions {
        python,
        scripts: "tests/readers".into(),
        meshes: Vec::new(),
        points: 1000,
        only: Vec::new(),
        output: folder.into(),
    };
    Ok(outcome(&readers::run(&options, &|_| {})?))
}

/// The workflow for many captures goes on after kills and ends with its table.
pub fn workflow_goes_on(folder: &Path, stop: &AtomicBool) -> Result<Outcome> {
    let Some(python) = python() else { return Ok(left_out("Snakemake")) };
    let options = PipelineOptions {
        python,
        patina: None,
        workflow: "assets/pipelines".into(),
        scripts: "tests/pipelines".into(),
        output: folder.into(),
    };
    Ok(outcome(&[pipelines::run(&options, stop, &|_| {})?]))
}

fn python() -> Option<PathBuf> {
    std::env::var_os("PATINA_TOOLS_PYTHON").map(PathBuf::from)
}

fn left_out(tools: &str) -> Outcome {
    Outcome::LeftOut(format!("PATINA_TOOLS_PYTHON names no Python with {tools}"))
}

fn outcome(tables: &[BarTable]) -> Outcome {
    let missed: Vec<String> = tables.iter().flat_map(BarTable::missed).collect();
    let count: usize = tables.iter().map(|table| table.rows.len()).sum();
    match missed.is_empty() && count > 0 {
        true => Outcome::Holds(format!("{count} bars hold")),
        false => Outcome::FallsShort(format!("of {count} bars are missed: {}", missed.join("; "))),
    }
}
