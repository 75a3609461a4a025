//! The command line of the lab, `patina-lab`; it holds no algorithm.
//!
//! [`arguments`] is what can be typed, [`measure`] audits and times, [`contest`] holds methods against each other,
//! [`study`] and [`object_study`] run studies, [`proof`] holds exports against other programs, [`others`] what they write and
//! start, [`measured`] and [`neural`] are for measured reflectance.

pub mod arguments;
pub mod contest;
pub mod measure;
pub mod measured;
pub mod neural;
pub mod object_study;
pub mod others;
pub mod proof;
pub mod study;

use crate::cli::{exit_code, use_threads};
use arguments::{Arguments, AuditTask, BenchTask, StudyTask, Task};
use clap::Parser;
use std::ffi::OsString;
use std::process::ExitCode;

/// Runs the lab on its arguments, the program's name first. Exit codes as those of [`crate::cli::run`].
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    crate::image::file::keep_decoders_quiet();
    let arguments = match Arguments::try_parse_from(arguments) {
        Ok(arguments) => arguments,
        Err(usage) => {
            let _ = usage.print();
            return ExitCode::from(if usage.use_stderr() { 2 } else { 0 });
        }
    };
    let (json, threads) = (arguments.json, arguments.threads);
    if let Err(code) = use_threads(threads, json) {
        return code;
    }
    let outcome = match arguments.task {
        Task::Audit(AuditTask::Gradients(options)) => measure::audit_gradients(&options, json),
        Task::Bench(BenchTask::Scale(options)) => measure::bench_scale(&options, json),
        Task::Bench(BenchTask::Fit(options)) => contest::fit(&options, json, threads),
        Task::Bench(BenchTask::Hard(options)) => contest::hard(&options, json),
        Task::Bench(BenchTask::Tracer(options)) => contest::tracer(&options, json, threads),
        Task::Bench(BenchTask::Entry(options)) => contest::entry(&options, json),
        Task::Bench(BenchTask::Atlas(options)) => crate::lab::atlas_quality::run(&options),
        Task::Bench(BenchTask::Cache(options)) => crate::lab::cached_error::run(&options),
        Task::Bench(BenchTask::Studio(options)) => measure::bench_studio(&options, json),
        Task::Study(StudyTask::Ibrdf(options)) => object_study::study(&options, json),
        Task::Study(StudyTask::Mvcl(options)) => study::mvcl(&options, json),
        Task::Study(StudyTask::Tables(options)) => study::tables(&options, json),
        Task::Fuzz(options) => measure::fuzz(&options, json),
        Task::Proof(options) => proof::prove(&options, json),
        Task::Readers(options) => others::readers(&options, json),
        Task::Pipelines(options) => others::pipelines(&options, json),
        Task::Nightly(options) => measure::nightly(&options, json),
        Task::References(options) => {
            crate::lab::scenes::write_references(&options.output, &contest::teller("references", json))
        }
        Task::Measured(task) => measured::run(&task, json),
    };
    exit_code(outcome, json)
}
