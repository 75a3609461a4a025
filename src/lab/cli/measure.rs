//! `patina-lab audit` and `patina-lab bench`.

use super::arguments::{AuditOptions, BenchOptions, BenchStudioOptions, FuzzOptions, NightlyOptions};
use crate::cli::interrupt::stop_on_interrupt;
use crate::error::{Error, ErrorKind, Result};
use crate::lab::audit::{AuditSettings, built_in, gradients};
use crate::lab::{fuzz, scale};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Audits gradients on the built-in audit scene; an audit beyond its limits is an error.
pub fn audit_gradients(options: &AuditOptions, json: bool) -> Result<()> {
    let settings = AuditSettings {
        parameters: options.parameters,
        consistency_parameters: options.consistency_parameters,
        seed: options.seed,
        ..Default::default()
    };
    let built = built_in(&settings)?;
    let stop = AtomicBool::new(false);
    let report = gradients(&built.scene, &built.surface, &built.parameters, &built.weights, &settings, &stop)?;
    if json {
        println!("{}", serde_json::json!({"event": "audit", "report": report}));
    } else {
        println!("{}", report.to_markdown());
    }
    if report.passes() {
        return Ok(());
    }
    Err(Error::new(ErrorKind::Numerical, "a derivative is not that of its function; the worst rows are above")
        .remedy("a defect of this program: report it with the table"))
}

/// Opens damaged files; one that ends in a panic, in too much memory or in too long a wait is an error.
pub fn fuzz(options: &FuzzOptions, json: bool) -> Result<()> {
    let FuzzOptions { inputs, from, seed, kind, output } = options;
    let settings =
        fuzz::Settings { inputs: *inputs, from: *from, seed: *seed, kinds: kind.clone(), output: output.clone() };
    // Panics are what is looked for: each is told once, with its input.
    std::panic::set_hook(Box::new(fuzz::note_panic));
    let outcomes = fuzz::run(&settings, &super::contest::teller("fuzz", json));
    drop(std::panic::take_hook());
    let outcomes = outcomes?;
    if json {
        println!("{}", serde_json::json!({"event": "fuzz", "kinds": outcomes}));
    }
    let failed: u64 = outcomes.iter().map(|outcome| outcome.failed).sum();
    if failed == 0 {
        return Ok(());
    }
    let message = format!("{failed} inputs ended otherwise than read or refused: they are listed above");
    Err(Error::new(ErrorKind::Internal, message)
        .remedy("a defect of this program: mend the reader, and make the input a test"))
}

/// Runs the checks of a night; one that falls short is an error.
pub fn nightly(options: &NightlyOptions, json: bool) -> Result<()> {
    let stop = Arc::new(AtomicBool::new(false));
    stop_on_interrupt(Arc::clone(&stop));
    crate::lab::nightly::run(&options.checks, &options.output, &stop, &super::contest::teller("nightly", json))
}

/// Measures growth and writes the table as Markdown, CSV and SVG.
pub fn bench_scale(options: &BenchOptions, json: bool) -> Result<()> {
    std::fs::create_dir_all(&options.output).map_err(|source| Error::writing(&options.output, source))?;
    let own = [&options.triangles, &options.views, &options.maps];
    let cases = match own.iter().all(|list| list.is_empty()) {
        true => scale::cases(options.quick),
        false => scale::cases_along(&options.triangles, &options.views, &options.maps),
    };
    let extent = if options.whole { scale::Extent::WholeFit } else { scale::Extent::OneStep };
    let table = scale::run(&cases, &options.methods, extent, &options.output, &super::contest::teller("scale", json))?;
    table.write(&options.output, "scale")?;
    if !json {
        println!("{}", table.to_markdown());
    }
    super::contest::teller("scale", json)(&format!("table: {}", options.output.join("scale.md").display()));
    Ok(())
}

/// Measures the window and writes the figures as Markdown, CSV and JSON.
#[cfg(feature = "studio")]
pub fn bench_studio(options: &BenchStudioOptions, json: bool) -> Result<()> {
    use super::arguments::BenchPart;
    use crate::export::RunFolder;
    use crate::lab::window as bench;
    use std::path::{Path, PathBuf};
    let asked = |part: BenchPart| options.parts.is_empty() || options.parts.contains(&part);
    let tell = std::sync::Arc::new(move |text: &str| {
        if !json {
            eprintln!("{text}");
        }
    });
    std::fs::create_dir_all(&options.output).map_err(|source| Error::writing(&options.output, source))?;
    let mut report = bench::BenchReport { machine: bench::machine::Machine::here(), ..Default::default() };
    // The demo, and the scene that is named; a run has no opening that takes long, and no Start.
    let named = options.scene.as_deref();
    let is_run = |path: &Path| RunFolder::open(path).is_ok_and(|folder| folder.is_run());
    let to_open: Vec<Option<&Path>> = [None].into_iter().chain(named.filter(|path| !is_run(path)).map(Some)).collect();
    let mut to_relight: Vec<Option<PathBuf>> = vec![None];
    for path in &to_open {
        if asked(BenchPart::Opening) {
            report.opening.extend(bench::opening::measure(*path, &options.output, &*tell)?);
        }
        if asked(BenchPart::Starting) {
            let times = if options.quick { 1 } else { 2 };
            let (rows, run) = bench::starting::measure(*path, times, &options.output, &*tell)?;
            report.starting.extend(rows);
            // What was fitted is relit: a scene of photos has no other maps.
            to_relight.extend(path.map(|_| Some(run)));
        }
        // What was measured stays, whatever becomes of the rest.
        report.write(&options.output)?;
    }
    let is_relit = to_relight.len() > 1;
    to_relight.extend(named.filter(|_| !is_relit).map(|path| Some(path.to_path_buf())));
    if asked(BenchPart::Relight) {
        for path in &to_relight {
            report.relight.extend(bench::relight::measure(path.as_deref(), options.quick, &*tell)?);
            report.write(&options.output)?;
        }
    }
    let _ = std::fs::remove_dir_all(bench::scratch(&options.output, "starting"));
    let needs_window =
        |part: &BenchPart| !matches!(part, BenchPart::Opening | BenchPart::Starting | BenchPart::Relight);
    if !options.parts.is_empty() && !options.parts.iter().any(needs_window) {
        report.write(&options.output)?;
        return tell_report(&report, json);
    }
    let report = bench::run(bench::BenchOptions {
        seconds: if options.quick { options.seconds.min(3.0) } else { options.seconds },
        pairs: if options.quick { options.pairs.min(1) } else { options.pairs },
        cycles: if options.quick { options.cycles.min(3) } else { options.cycles },
        scene: options.scene.clone(),
        is_small: options.quick,
        output: options.output.clone(),
        stalls: asked(BenchPart::Stalls),
        frames: asked(BenchPart::Frames),
        answers: asked(BenchPart::Answers),
        slowdown: asked(BenchPart::Slowdown),
        memory: asked(BenchPart::Memory),
        equality: asked(BenchPart::Equality),
        before: report,
        tell,
    })?;
    tell_report(&report, json)
}

/// Prints the tables; a view that is relit too slowly or wrongly is an error.
#[cfg(feature = "studio")]
fn tell_report(report: &crate::lab::window::BenchReport, json: bool) -> Result<()> {
    if json {
        println!("{}", serde_json::json!({"event": "bench", "report": report}));
    } else {
        println!("{}", report.to_markdown());
    }
    match report.relight.iter().find(|row| !row.passes()) {
        None => Ok(()),
        Some(row) => Err(Error::new(
            ErrorKind::Numerical,
            format!("{} under {} is relit too slowly or too far from the path tracer", row.scene, row.light),
        )
        .remedy("the table above has both figures; on a machine that is busy measure again")),
    }
}

/// Says why the window cannot be measured.
#[cfg(not(feature = "studio"))]
pub fn bench_studio(_: &BenchStudioOptions, _: bool) -> Result<()> {
    Err(Error::new(ErrorKind::Unsupported, "this program was built without its window")
        .remedy("build it with the feature `studio`; `patina-lab bench scale` needs none"))
}
