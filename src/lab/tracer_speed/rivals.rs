//! Other programs on the same rays and scenes: Mitsuba by its Python, Embree by a small program in C.

use super::TracerOptions;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

/// One repetition of Mitsuba: for each of its samplers a value a column, where it has one.
pub type MitsubaRows = BTreeMap<String, Vec<Option<f64>>>;

/// One repetition of Embree, built in one way.
#[derive(Clone, Debug, Deserialize)]
pub struct EmbreeRow {
    /// The way of building.
    pub name: String,
    /// Millions of camera, bounce and shadow rays a second.
    pub rates: [f64; 3],
    /// How many of each met something.
    pub met: [usize; 3],
}

/// What Mitsuba said, one repetition after the other; or why it said nothing.
pub fn mitsuba(python: &Path, scene: &Path, options: &TracerOptions) -> Result<Vec<MitsubaRows>, String> {
    let script = options.scripts.join("time_exchange.py");
    if !script.is_file() {
        return Err(format!("there is no {}", script.display()));
    }
    let mut command = Command::new(python);
    command.arg(&script).arg(scene).args(["--spp", &options.samples.to_string()]);
    command.args(["--most-views", &options.most_views.to_string(), "--repetitions", &options.repetitions.to_string()]);
    if let Some(threads) = options.threads {
        command.args(["--threads", &threads.to_string()]);
    }
    lines_of(command)
}

/// What Embree said of a file of rays, one repetition and way of building after the other; or why it said nothing.
pub fn embree(program: &Path, rays: &Path, options: &TracerOptions) -> Result<Vec<EmbreeRow>, String> {
    let mut command = Command::new(program);
    let threads = options.threads.unwrap_or_else(rayon::current_num_threads);
    command.arg(rays).args([threads.to_string(), options.repetitions.max(1).to_string()]);
    lines_of(command)
}

/// The lines a program prints, as JSON.
fn lines_of<T: for<'a> Deserialize<'a>>(mut command: Command) -> Result<Vec<T>, String> {
    let program = command.get_program().to_string_lossy().into_owned();
    let output = command.output().map_err(|error| format!("{program} cannot be started ({error})"))?;
    if !output.status.success() {
        let text = String::from_utf8_lossy(&output.stderr);
        let last = text.lines().rev().find(|line| !line.trim().is_empty()).unwrap_or("no message");
        return Err(format!("{program} ended with {} ({})", output.status, last.trim()));
    }
    let text = String::from_utf8_lossy(&output.stdout);
    let rows: Vec<T> = text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect();
    if rows.is_empty() { Err(format!("{program} said nothing")) } else { Ok(rows) }
}
