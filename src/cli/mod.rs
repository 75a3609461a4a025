//! The command line; it holds no algorithm.
//!
//! [`arguments`] is what can be typed, [`fit`] drives a job and shows its events, [`measure`] audits and benches,
//! [`contest`] holds methods against each other, [`study`] runs studies, [`measured`] is for measured reflectance and
//! [`neural`] for its neural model, [`object`] is object mode, [`gauge`] moves the scale of a run,
//! [`turntable`] belongs to `relight`, [`guide`]
//! prints the guide, [`completions`] the script for a shell, `hint` answers what was mistyped, [`commands`] holds the
//! rest. Whatever is asked here can be asked of the library in the same words.

pub mod arguments;
pub mod commands;
pub mod completions;
pub mod contest;
pub mod fit;
pub mod gauge;
pub mod guide;
mod hint;
pub mod measure;
pub mod measured;
pub mod neural;
pub mod object;
mod standard_output;
pub mod study;
pub mod turntable;

use crate::error::{Error, ErrorKind, Result};
use arguments::{Arguments, AuditTask, BenchTask, StudioOptions, StudyTask, Task};
use clap::Parser;
use std::ffi::OsString;
use std::process::ExitCode;

/// Runs the program on its arguments, the program's name first. Exit codes: 0 done, 1 an error, 2 arguments that are
/// not understood, 3 stopped by the user.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
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
    if let Some(threads) = arguments.threads {
        // Fails only when a pool exists already, as in tests: then that one serves.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
    }
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
        Some(Task::Audit(AuditTask::Gradients(options))) => measure::audit_gradients(&options, json),
        Some(Task::Bench(BenchTask::Scale(options))) => measure::bench_scale(&options, json),
        Some(Task::Bench(BenchTask::Fit(options))) => contest::fit(&options, json, arguments.threads),
        Some(Task::Bench(BenchTask::Hard(options))) => contest::hard(&options, json),
        Some(Task::Bench(BenchTask::Tracer(options))) => contest::tracer(&options, json, arguments.threads),
        Some(Task::Bench(BenchTask::Entry(options))) => contest::entry(&options, json),
        Some(Task::Bench(BenchTask::Studio(options))) => measure::bench_studio(&options, json),
        Some(Task::Object(options)) => object::object(&options, json),
        Some(Task::Study(StudyTask::Ibrdf(options))) => object::study(&options, json),
        Some(Task::Study(StudyTask::Mvcl(options))) => study::mvcl(&options, json),
        Some(Task::Measured(task)) => measured::run(&task, json),
        Some(Task::Guide(options)) => guide::guide(&options, json),
        Some(Task::Completions(options)) => completions::completions(&options),
        Some(Task::Studio(options)) => window(&options),
        None => window(&StudioOptions::default()),
    };
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
