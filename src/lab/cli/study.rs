//! `patina-lab study`: runs a study and prints its tables.

use super::arguments::MvclOptions;
use crate::cli::fit::stop_on_interrupt;
use crate::error::Result;
use crate::lab::consistency::{self, StudyOptions};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Studies consistency between views.
pub fn mvcl(options: &MvclOptions, json: bool) -> Result<()> {
    let stop = Arc::new(AtomicBool::new(false));
    stop_on_interrupt(Arc::clone(&stop));
    let study = StudyOptions {
        scenes: options.scenes.clone(),
        cases: options.cases.clone(),
        seeds: options.seeds,
        quick: options.quick,
        steps_diffuse: options.steps_diffuse,
        steps_all: options.steps_all,
        output: options.output.clone(),
    };
    let tell = |text: &str| match json {
        true => println!("{}", serde_json::json!({"event": "study", "message": text})),
        false => eprintln!("{text}"),
    };
    let tables = consistency::mvcl(&study, &stop, &tell)?;
    if !json {
        for table in &tables {
            println!("{}", table.to_markdown());
        }
    }
    tell(&format!("tables and plots: {}", options.output.display()));
    Ok(())
}
