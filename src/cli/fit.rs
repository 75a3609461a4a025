//! `patina demo`, `fit` and `resume`: drive a job and show its events.

use super::arguments::{DemoOptions, FitOptions, ResumeOptions};
use super::interrupt::{stop_on_interrupt, while_opening};
use super::summary::summarise;
use crate::error::{Error, ErrorKind, Result};
use crate::export::RunFolder;
use crate::export::run_folder::new_run_folder;
use crate::files::{folder_of, name_of_folder};
use crate::fit::{FitSettings, Method};
use crate::job::advance::Advance;
use crate::job::open::{self, OpenStage, Tell};
use crate::job::prepare::RunSettings;
use crate::job::{self, Budget, Event, JobHandle, JobOptions, demo, known_maps};
use crate::scene::demo::DemoSettings;
use indicatif::{ProgressBar, ProgressStyle};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Runs the demo.
pub fn demo(options: &DemoOptions, json: bool) -> Result<()> {
    let job_options = within(options.seconds);
    let folder = RunFolder::create(&options.output)?.held()?;
    let stop = Arc::new(AtomicBool::new(false));
    stop_on_interrupt(Arc::clone(&stop));
    let mut settings = demo::settings();
    settings.fit.seed = options.seed;
    let mut chosen = Vec::new();
    if let Some(path) = &options.settings {
        // Settings of Adam's choose him here, too.
        settings.fit.method = Method::Automatic;
        (settings.fit, chosen) = settings.fit.changed_by_file(path)?;
    }
    settings.fit.method = options.method.unwrap_or(settings.fit.method);
    // By the seed and the lobe of the fit the scene is made anew when the run is taken up or relit.
    let demo_settings = DemoSettings { seed: settings.fit.seed, lobe: settings.fit.lobe, ..DemoSettings::default() };
    let (prepared, fitter, settings) = with_bar(json, |tell| {
        let opened = open::open_demo(&demo_settings, &stop, tell)?;
        opened.resolve(&mut settings.fit, &chosen);
        open::start_new(opened, settings, &stop, tell)
    })?;
    let job = job::start_with(prepared, fitter, settings, folder.clone(), job_options)?;
    watch(job, &folder, &stop, json)
}

/// Fits a scene.
pub fn fit(options: &FitOptions, json: bool) -> Result<()> {
    let job_options = within(options.seconds);
    let AskedSettings { mut settings, mut chosen } = run_settings(options)?;
    settings.fit.validate()?;
    known_maps::settle(&mut settings, &mut chosen)?;
    let stop = Arc::new(AtomicBool::new(false));
    stop_on_interrupt(Arc::clone(&stop));
    let output = options.output.clone().unwrap_or_else(|| usual_run_folder(&settings.scene));
    let folder = RunFolder::create(&output)?.held()?;
    if !json {
        eprintln!("reading and checking {}", settings.scene.display());
        if options.output.is_none() {
            eprintln!("the run goes to {}", output.display());
        }
    }
    let mut told = Vec::new();
    let (prepared, fitter, settings) = with_bar(json, |tell| {
        let opened = open::open_scene(&settings.scene, &settings.read, &stop, tell)?;
        told = opened.resolve(&mut settings.fit, &chosen);
        open::start_new(opened, settings, &stop, tell)
    })?;
    if !json {
        told.iter().for_each(|line| eprintln!("{line}"));
    }
    let job = job::start_with(prepared, fitter, settings, folder.clone(), job_options)?;
    watch(job, &folder, &stop, json)
}

/// A job that takes so many seconds from now on at the most, reading included.
fn within(seconds: Option<f64>) -> JobOptions {
    JobOptions { budget: seconds.map(Budget::of_seconds), ..JobOptions::default() }
}

/// Where a run goes that no folder was named for: `runs/SCENE-1`, `runs/SCENE-2`, ... where the program was started.
fn usual_run_folder(scene: &Path) -> PathBuf {
    // A manifest is known by the folder it lies in.
    let named = if scene.is_file() { folder_of(scene) } else { scene };
    new_run_folder(Path::new("runs"), &name_of_folder(named))
}

/// Settings that are asked for, before they are resolved for a scene.
#[derive(Clone, Debug)]
pub struct AskedSettings {
    /// The settings.
    pub settings: RunSettings,
    /// Names of the settings of the fit that were typed or stand in a settings file.
    pub chosen: Vec<String>,
}

/// The settings that options ask for: a preset or a settings file, and what was typed over it.
///
/// # Errors
/// A settings file that cannot be read.
pub fn run_settings(options: &FitOptions) -> Result<AskedSettings> {
    let mut chosen = options.fit.typed.clone();
    let mut settings = match &options.settings {
        Some(path) => {
            let text = std::fs::read_to_string(path).map_err(|source| Error::reading(path, source))?;
            let settings = crate::files::settings_of_toml::<RunSettings>(&text, path).map_err(|error| {
                error.with_remedy(
                    "take the settings.toml of a run folder as a pattern: settings of the fit stand under [fit]",
                )
            })?;
            let table: toml::Table = crate::files::settings_of_toml(&text, path)?;
            if let Some(fit) = table.get("fit").and_then(toml::Value::as_table) {
                chosen.extend(fit.keys().cloned());
            }
            settings
        }
        None => RunSettings { fit: FitSettings::preset(options.preset.unwrap_or_default()), ..Default::default() },
    };
    // What was typed wins, even where it equals the default.
    settings.scene = absolute(&options.scene);
    settings.known_light = options.env.as_deref().map(absolute).unwrap_or(settings.known_light);
    settings.known_maps = options.maps.as_deref().map(absolute).unwrap_or(settings.known_maps);
    settings.read = options.read.over(settings.read);
    settings.fit = options.fit.over(&settings.fit)?;
    settings.fit.fixed_maps |= !settings.known_maps.as_os_str().is_empty();
    if let Some(uv) = options.uv {
        settings.atlas.keep_uv = uv;
    }
    Ok(AskedSettings { settings, chosen })
}

fn absolute(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.into())
}

/// Takes up a run.
pub fn resume(options: &ResumeOptions, json: bool) -> Result<()> {
    let job_options = within(options.seconds);
    let folder = RunFolder::open(&options.run)?.held()?;
    let stop = Arc::new(AtomicBool::new(false));
    stop_on_interrupt(Arc::clone(&stop));
    let (prepared, fitter, settings) =
        with_bar(json, |tell| open::resume(&folder, options.scene.as_deref(), &stop, tell))?;
    let job = job::start_with(prepared, fitter, settings, folder.clone(), job_options)?;
    watch(job, &folder, &stop, json)
}

/// Shows how far something is that is opened.
fn with_bar<T>(json: bool, work: impl FnOnce(Tell) -> Result<T>) -> Result<T> {
    let bar = if json { ProgressBar::hidden() } else { ProgressBar::new(1000) };
    bar.set_style(ProgressStyle::with_template("{msg} [{bar:30}] {percent} %").unwrap_or(ProgressStyle::default_bar()));
    let outcome = while_opening(|| {
        work(&|stage: OpenStage, share: f32| {
            bar.set_message(stage.label());
            bar.set_position((share * 1000.0) as u64);
        })
    });
    bar.finish_and_clear();
    outcome
}

/// Shows the events of a job until it ends.
fn watch(job: JobHandle, folder: &RunFolder, stop: &AtomicBool, json: bool) -> Result<()> {
    let bar = if json { ProgressBar::hidden() } else { ProgressBar::new(PARTS) };
    // The message is cut where the terminal ends: a line that wraps would be drawn anew below itself.
    let style = ProgressStyle::with_template("{prefix:>13} [{bar:30}] {percent:>3} % {wide_msg}");
    bar.set_style(style.unwrap_or(ProgressStyle::default_bar()));
    let say = |text: String| if bar.is_hidden() { eprintln!("{text}") } else { bar.println(text) };
    let mut last_line = std::time::Instant::now();
    // One share of the whole job, as the window shows it: steps by their seconds, then what comes after them.
    let mut advance = Advance::default();
    let left_in_words = |advance: &Advance, otherwise: f64| {
        crate::insight::report::number::duration(advance.seconds_left().unwrap_or(otherwise))
    };
    let mut residuals = String::new();
    let outcome = loop {
        if stop.load(Ordering::Relaxed) {
            job.stop();
        }
        let event = match job.events.recv_timeout(std::time::Duration::from_millis(100)) {
            Ok(event) => event,
            Err(crossbeam_channel::RecvTimeoutError::Timeout) => {
                advance.tick();
                bar.set_position(parts_of(&advance));
                continue;
            }
            Err(crossbeam_channel::RecvTimeoutError::Disconnected) => {
                break Err(Error::new(ErrorKind::Internal, "the fit ended without a word"));
            }
        };
        match &event {
            Event::Progress(progress) => advance.stepped(progress),
            Event::WithinStep(time) => advance.within_step(time),
            Event::Finishing(stage) => advance.finishing(*stage),
            Event::Finished(_) => advance.finished(),
            _ => {}
        }
        bar.set_position(parts_of(&advance));
        if json {
            println!("{}", line_of(&event, &advance));
        }
        match event {
            Event::Progress(progress) => {
                let row = &progress.row;
                bar.set_prefix(row.stage.clone());
                let held_out = row.held_out_rmse.map_or(String::new(), |rms| format!(", held-out residual {rms:.4}"));
                // Of the pixels and the level of this step: another measure than the RMSE of whole photos at the end.
                residuals = format!(", residual (RMS) {:.4}{held_out}", row.image_loss.max(0.0).sqrt());
                let left = left_in_words(&advance, progress.seconds_left);
                bar.set_message(format!("{left} left{residuals}"));
                // Without a terminal a bar shows nothing: a line now and then does.
                if !json && bar.is_hidden() && (last_line.elapsed().as_secs() >= 5 || row.held_out_rmse.is_some()) {
                    eprintln!("{} step {} of {}: {left} left{residuals}", row.stage, row.step, progress.steps_total);
                    last_line = std::time::Instant::now();
                }
            }
            Event::WithinStep(time) => {
                bar.set_message(format!("{} left{residuals}", left_in_words(&advance, time.seconds_left)));
            }
            Event::Finding(finding) if !json => say(finding.to_string()),
            Event::Refused(error) if !json => say(format!("refused: {error}")),
            Event::Finishing(stage) if !json => {
                bar.set_prefix("finishing");
                bar.set_message(stage.label());
            }
            Event::Finished(data) => break Ok(data),
            Event::Stopped { steps_done } => {
                break Err(Error::new(ErrorKind::Stopped, format!("stopped after {steps_done} steps"))
                    .remedy(format!("resume with `patina resume {}`", folder.path().display())));
            }
            Event::Failed(error) => break Err(error),
            _ => {}
        }
    };
    bar.finish_and_clear();
    job.join();
    let data = outcome?;
    if !json {
        summarise(&data, folder);
    }
    Ok(())
}

/// Parts of the bar; finer than the percent that is written beside it.
const PARTS: u64 = 1000;

fn parts_of(advance: &Advance) -> u64 {
    (PARTS as f32 * advance.share()) as u64
}

fn line_of(event: &Event, advance: &Advance) -> serde_json::Value {
    use serde_json::json;
    match event {
        Event::Started { steps_done, steps_total } => {
            json!({"event": "started", "steps_done": steps_done, "steps_total": steps_total})
        }
        Event::Progress(progress) => json!({
            "event": "progress", "progress": progress, "share": advance.share(),
            "seconds_left_of_job": advance.seconds_left(),
        }),
        Event::WithinStep(time) => json!({
            "event": "within-step", "time": time, "share": advance.share(),
            "seconds_left_of_job": advance.seconds_left(),
        }),
        Event::Finding(finding) => json!({"event": "finding", "finding": finding}),
        Event::Checkpoint(path) => json!({"event": "checkpoint", "path": path}),
        Event::SettingsChanged(settings) => json!({"event": "settings-changed", "settings": settings}),
        Event::Refused(error) => json!({"event": "refused", "message": error.to_string()}),
        Event::Paused => json!({"event": "paused"}),
        Event::Resumed => json!({"event": "resumed"}),
        Event::Finishing(stage) => {
            json!({
                "event": "finishing", "what": stage.label(), "share": advance.share(),
                "seconds_left_of_job": advance.seconds_left(),
            })
        }
        Event::Finished(data) => {
            json!({"event": "finished", "aggregates": data.aggregates, "truth": data.truth, "timings": data.timings})
        }
        Event::Stopped { steps_done } => json!({"event": "stopped", "steps_done": steps_done}),
        Event::Failed(error) => json!({"event": "failed", "message": error.to_string()}),
    }
}
