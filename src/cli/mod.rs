//! The command line; it holds no algorithm.
//!
//! [`arguments`] is what can be typed, [`fit`] drives a job and shows its events, [`measured`] is for measured
//! reflectance, [`object`] is object mode, [`gauge`] moves the scale of a run, [`turntable`] belongs to `relight`,
//! [`commands`] holds the rest. Whatever is asked here can be asked of the library in the same words.

pub mod arguments;
pub mod commands;
pub mod fit;
pub mod gauge;
pub mod measured;
pub mod object;
pub mod turntable;

use crate::error::{Error, ErrorKind, Result};
use arguments::{Arguments, StudioOptions, Task};
use clap::Parser;
use std::ffi::OsString;
use std::process::ExitCode;

/// Runs the program on its arguments, the program's name first. Exit codes: 0 done, 1 an error, 2 arguments that are
/// not understood, 3 stopped by the user.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    crate::image::file::keep_decoders_quiet();
    let arguments = match Arguments::try_parse_from(arguments) {
        Ok(arguments) => arguments,
        Err(usage) => {
            let _ = usage.print();
            return ExitCode::from(if usage.use_stderr() { 2 } else { 0 });
        }
    };
    use_threads(arguments.threads);
    let json = arguments.json;
    let outcome = match arguments.task {
        Some(Task::Demo(options)) => fit::demo(&options, json),
        Some(Task::Fit(options)) => fit::fit(&options, json),
        Some(Task::Resume(options)) => fit::resume(&options, json),
        Some(Task::Check(options)) => commands::check(&options, json),
        Some(Task::Relight(options)) => commands::relight(&options, json),
        Some(Task::Gauge(options)) => gauge::gauge(&options, json),
        Some(Task::Render(options)) => commands::render(&options, json),
        Some(Task::Compare(options)) => commands::compare(&options, json),
        Some(Task::Object(options)) => object::object(&options, json),
        Some(Task::Measured(task)) => measured::run(&task, json),
        Some(Task::Studio(options)) => window(&options),
        None => window(&StudioOptions::default()),
    };
    exit_code(outcome, json)
}

/// Limits the threads of the program.
pub(crate) fn use_threads(threads: Option<usize>) {
    if let Some(threads) = threads {
        // Fails only when a pool exists already, as in tests: then that one serves.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
    }
}

/// Shows an error and gives the code to exit with.
pub(crate) fn exit_code(outcome: Result<()>, json: bool) -> ExitCode {
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            show(&error, json);
            ExitCode::from(if error.kind() == ErrorKind::Stopped { 3 } else { 1 })
        }
    }
}

/// Opens the window.
#[cfg(feature = "studio")]
fn window(options: &StudioOptions) -> Result<()> {
    let StudioOptions { path, demo, settings_file } = options.clone();
    crate::studio::run(crate::studio::StudioOptions { path, demo, settings_file })
}

/// Says why there is no window.
#[cfg(not(feature = "studio"))]
fn window(_: &StudioOptions) -> Result<()> {
    Err(Error::new(ErrorKind::Unsupported, "this program was built without its window")
        .remedy("build it with the feature `studio`, or try `patina demo` and `patina --help`"))
}

fn show(error: &Error, json: bool) {
    if json {
        let line = serde_json::json!({
            "event": "error",
            "kind": format!("{:?}", error.kind()),
            "place": error.place().to_string(),
            "message": error.message(),
            "remedy": error.remedy_text(),
        });
        println!("{line}");
    } else {
        eprintln!("error: {error}");
    }
}
