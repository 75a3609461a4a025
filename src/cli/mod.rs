//! The command line; it holds no algorithm.
//!
//! [`arguments`] is what can be typed, [`check`] prints what was understood of a scene, [`fit`] drives a job and shows its events, [`measured`] is for measured
//! reflectance, [`object`] is object mode, [`gauge`] moves the scale of a run, [`export`] writes it for other
//! programs, [`turntable`] belongs to `relight`, `benchmark` to `compare`, [`guide`] prints the guide,
//! [`completions`] the script for a shell, `hint` answers what was mistyped, [`commands`] holds the rest; `summary` is what is said of a fit that has ended, `say` writes lines where somebody listens, [`interrupt`] hears Ctrl-C, `threads` starts what everything works on.
//! Whatever is asked here can be asked of the library in the same words.

/// A line on standard output; lost where nobody listens, see [`say`].
macro_rules! println {
    ($($text:tt)*) => { $crate::cli::say::out(format_args!($($text)*)) };
}

/// A line on standard error; lost where nobody listens, see [`say`].
macro_rules! eprintln {
    ($($text:tt)*) => { $crate::cli::say::error(format_args!($($text)*)) };
}

pub mod arguments;
mod benchmark;
pub mod check;
pub mod commands;
pub mod completions;
pub mod export;
pub mod fit;
pub mod gauge;
pub mod guide;
mod hint;
pub mod interrupt;
pub mod measured;
pub mod object;
mod say;
mod summary;
mod threads;
pub mod turntable;

use crate::error::{Error, ErrorKind, Result};
use arguments::{Arguments, StudioOptions, Task};
use clap::{CommandFactory, Parser};
use std::ffi::OsString;
use std::process::ExitCode;

/// Runs the program on its arguments, the program's name first. Exit codes: 0 done, 1 an error, 2 arguments that are
/// not understood, 3 stopped by the user.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    crate::image::file::keep_decoders_quiet();
    let arguments = match Arguments::try_parse_from(arguments) {
        Ok(arguments) => arguments,
        Err(usage) => {
            let code = ExitCode::from(if usage.use_stderr() { 2 } else { 0 });
            match hint::of(&usage) {
                Some(hint) => eprintln!("{hint}"),
                // Fails only where nobody reads any more.
                None => drop(hint::suggested(usage).print()),
            }
            return code;
        }
    };
    let json = arguments.json;
    if let Err(code) = use_threads(arguments.threads, json) {
        return code;
    }
    let outcome = match arguments.task {
        Some(Task::Demo(options)) => fit::demo(&options, json),
        Some(Task::Fit(options)) => fit::fit(&options, json),
        Some(Task::Resume(options)) => fit::resume(&options, json),
        Some(Task::Check(options)) => check::check(&options, json),
        Some(Task::Relight(options)) => commands::relight(&options, json),
        Some(Task::Export(options)) => export::export(&options, json),
        Some(Task::Gauge(options)) => gauge::gauge(&options, json),
        Some(Task::Render(options)) => commands::render(&options, json),
        Some(Task::Compare(options)) => commands::compare(&options, json),
        Some(Task::Object(options)) => object::object(&options, json),
        Some(Task::Measured(task)) => measured::run(&task, json),
        Some(Task::Guide(options)) => guide::guide(&options, json),
        Some(Task::Completions(options)) => completions::completions(&options, Arguments::command()),
        Some(Task::Studio(options)) => window(&options),
        None => window(&StudioOptions::default()),
    };
    exit_code(outcome, json)
}

/// Starts the threads of the program, and tells where they are fewer than asked for.
///
/// # Errors
/// The code to exit with, after the error is shown.
pub(crate) fn use_threads(asked: Option<usize>, json: bool) -> std::result::Result<(), ExitCode> {
    match threads::start(asked) {
        Ok(told) => commands::tell_findings(told.as_slice(), json),
        Err(error) => return Err(exit_code(Err(error), json)),
    }
    Ok(())
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
