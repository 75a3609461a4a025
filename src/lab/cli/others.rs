//! `patina-lab readers` and `patina-lab pipelines`: this program beside others.

use crate::cli::interrupt::stop_on_interrupt;
use crate::error::Result;
use crate::lab::bar_table::BarTable;
use crate::lab::pipelines::{self, PipelineOptions};
use crate::lab::readers::{self, ReaderOptions};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Reads what other tools wrote and compares; a bar that is missed is an error.
pub fn readers(options: &ReaderOptions, json: bool) -> Result<()> {
    let tables = readers::run(options, &super::contest::teller("readers", json))?;
    tables.iter().for_each(|table| print("readers", table, json));
    let remedy = "files and answers lie in the output folder: mend the reader, or say why the tool is wrong";
    tables.iter().try_for_each(|table| table.judged(remedy))
}

/// Runs the workflow for many captures; what it does otherwise than it should is an error.
pub fn pipelines(options: &PipelineOptions, json: bool) -> Result<()> {
    let stop = Arc::new(AtomicBool::new(false));
    stop_on_interrupt(Arc::clone(&stop));
    let table = pipelines::run(options, &stop, &super::contest::teller("pipelines", json))?;
    print("pipelines", &table, json);
    table.judged("logs of each sitting and all results lie in the output folder")
}

fn print(event: &str, table: &BarTable, json: bool) {
    match json {
        true => println!("{}", serde_json::json!({"event": event, "table": table})),
        false => println!("{}", table.to_markdown()),
    }
}
