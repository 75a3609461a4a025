//! What a watcher may do to a fit while it runs, and what the world may do to its folder.

#![allow(clippy::unwrap_used)]

mod common;

use clap::Parser;
use common::*;
use patina::cli::arguments::{Arguments, Task};
use patina::cli::fit::run_settings;
use patina::export::RunFolder;
use patina::fit::settings::{BackgroundEvidence, Consistency, Start, Steps};
use patina::fit::{FitSettings, FitState, Fitter, Preset, ViewUse, checkpoint};
use patina::insight::ReportData;
use patina::job::open::{self, OpenStage, PathKind};
use patina::job::{Command, Event, JobHandle, JobOptions, RunSettings, start_with};
use patina::render::Surface;
use patina::render::first_hits::PixelFilter;
use patina::scene::demo::DemoSettings;
use patina::scene::{Photo, ReadSettings, Scene};
use patina::{ErrorKind, Place};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, OnceLock};

/// A stop flag that nobody raises.
static GO: AtomicBool = AtomicBool::new(false);

/// Five views, the last held out; photographed once for all tests.
fn scene() -> (Arc<Scene>, Arc<Surface>) {
    static SCENE: OnceLock<(Arc<Scene>, Arc<Surface>)> = OnceLock::new();
    SCENE.get_or_init(|| last_held_out(5)).clone()
}

fn base() -> FitSettings {
    FitSettings { views_per_step: 2, held_out_interval: 3, ..quick() }
}

fn new_fitter(settings: &FitSettings) -> Fitter {
    let (scene, surface) = scene();
    Fitter::new(scene, surface, settings.clone(), None).unwrap()
}

fn stepped(settings: &FitSettings, steps: usize) -> Fitter {
    let mut fitter = new_fitter(settings);
    (0..steps).for_each(|_| drop(fitter.step(&GO).unwrap()));
    fitter
}

fn to_end(mut fitter: Fitter) -> FitState {
    run(&mut fitter).unwrap();
    without_seconds(fitter.state())
}

// ---- settings that change ----

/// Changes of every kind that is allowed.
fn changes() -> Vec<FitSettings> {
    vec![
        FitSettings { rate_diffuse: 0.1, rate_light: 0.01, final_rate: 0.5, light_smoothness: 0.0, ..base() },
        FitSettings { samples: 4, pixel_filter: PixelFilter::Tent, first_hits_mib: 64, bounces: 1, ..base() },
        FitSettings { views_per_step: 3, pixels_per_step: 600, held_out_interval: 2, ..base() },
        FitSettings { consistency: Consistency::Exact, lobe_ramp: 5, ..base() },
        FitSettings { background: BackgroundEvidence::Ignore, exposure: true, ..base() },
        FitSettings { fixed_light: true, exclude: vec!["view1".into(), "no such".into()], ..base() },
        FitSettings { exclude: vec!["view4".into()], ..base() },
        FitSettings { steps_all: 10, ..base() },
    ]
}

#[test]
fn a_changed_fit_is_taken_up_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("checkpoint");
    let (scene, surface) = scene();
    let unchanged = to_end(new_fitter(&base()));
    for settings in changes() {
        // At the start, inside stages, at their borders, before and after looks at held-out views.
        for step in [0, 2, 3, 6, 9, 11] {
            let mut whole = stepped(&base(), step);
            whole.change(settings.clone()).unwrap();
            assert_eq!(whole.settings(), &settings);

            checkpoint::write(&path, whole.state()).unwrap();
            let state = checkpoint::read(&path).unwrap();
            let resumed = Fitter::resume(scene.clone(), surface.clone(), settings.clone(), state).unwrap();
            let whole = to_end(whole);
            assert_eq!(to_end(resumed), whole, "after step {step}: {:?}", base().differences(&settings));
            assert_eq!(whole.step, settings.steps_diffuse + settings.steps_all);
            if step < 6 && settings.exclude != ["view4"] {
                assert_ne!(whole.texels, unchanged.texels, "{:?} did nothing", base().differences(&settings));
            }
        }
    }
}

#[test]
fn a_change_before_the_first_step_is_a_start_with_it() {
    for settings in changes() {
        if settings.background == base().background && settings.exclude.is_empty() {
            let mut changed = new_fitter(&base());
            changed.change(settings.clone()).unwrap();
            assert_eq!(to_end(changed), to_end(new_fitter(&settings)), "{:?}", base().differences(&settings));
        }
    }
}

#[test]
fn what_cannot_change_is_refused_by_name_and_leaves_no_trace() {
    let unchanged = to_end(new_fitter(&base()));
    let refused = [
        ("seed", FitSettings { seed: 2, ..base() }),
        ("map-size", FitSettings { map_size: 32, ..base() }),
        ("environment-height", FitSettings { environment_height: 8, ..base() }),
        ("levels", FitSettings { levels: 1, ..base() }),
        ("steps", FitSettings { steps: Steps::OneStep, ..base() }),
        ("start", FitSettings { start: Start::Paper, ..base() }),
        ("steps-diffuse", FitSettings { steps_diffuse: 3, ..base() }),
        ("rate-light", FitSettings { rate_light: f32::NAN, ..base() }),
        ("exclude", FitSettings { exclude: (0..4).map(|view| format!("view{view}")).collect(), ..base() }),
        // One of two is wrong: neither is taken.
        ("levels", FitSettings { levels: 1, rate_diffuse: 0.5, ..base() }),
    ];
    let mut fitter = stepped(&base(), 7);
    for (name, settings) in refused {
        let error = fitter.change(settings).unwrap_err();
        assert_eq!((error.kind(), error.place()), (ErrorKind::InvalidSetting, &Place::Setting(name.into())), "{error}");
        assert!(["rate-light"].contains(&name) || !error.remedy_text().is_empty(), "{error}");
        assert_eq!(fitter.settings(), &base());
    }
    assert_eq!(to_end(fitter), unchanged);
}

#[test]
fn a_fit_that_ended_goes_on_when_more_steps_are_asked_for() {
    let mut fitter = new_fitter(&base());
    run(&mut fitter).unwrap();
    let longer = FitSettings { steps_all: base().steps_all + 3, ..base() };
    fitter.change(longer).unwrap();
    assert_eq!(to_end(fitter).step, 15);
}

// ---- photos that are left out ----

#[test]
fn a_photo_that_is_left_out_says_nothing() {
    let (scene, surface) = scene();
    let exclude = vec!["view1".to_string(), "view4".to_string()];
    let settings = FitSettings { exclude, exposure: true, ..base() };
    let states: Vec<FitState> = [1.0, 30.0]
        .into_iter()
        .map(|factor| {
            let mut scene = Scene::clone(&scene);
            for view in [1, 4] {
                let Photo::Linear32(photo) = &mut scene.views[view].photo else { unreachable!() };
                photo.pixels_mut().iter_mut().for_each(|pixel| *pixel *= factor);
            }
            let mut fitter = Fitter::new(Arc::new(scene), surface.clone(), settings.clone(), None).unwrap();
            run(&mut fitter).unwrap();
            use ViewUse::*;
            assert_eq!(fitter.view_uses(), [Training, LeftOut, Training, Training, LeftOut]);
            let known: Vec<bool> = fitter.figures().view_rmse.iter().map(Option::is_some).collect();
            assert_eq!(known, [true, false, true, true, false]);
            without_seconds(fitter.state())
        })
        .collect();
    assert_eq!(states[0], states[1]);
    assert!(states[0].losses.iter().all(|row| row.held_out_rmse.is_none()), "no view was left to judge by");

    let unknown = FitSettings { exclude: vec!["view7".into()], ..base() };
    let fitter = new_fitter(&unknown);
    let findings = fitter.findings();
    assert!(findings.iter().any(|finding| finding.code == "exclude-unknown" && finding.message.contains("view7")));
    let all = FitSettings { exclude: (0..5).map(|view| format!("view{view}")).collect(), ..base() };
    let error = Fitter::new(scene, surface, all, None).err().unwrap();
    assert_eq!(error.place(), &Place::Setting("exclude".into()));
    assert!(!error.remedy_text().is_empty());
}

// ---- a job ----

/// Holds a job before chosen steps.
struct Gate {
    at: Receiver<usize>,
    go: Sender<()>,
}

impl Gate {
    fn new() -> (Gate, JobOptions) {
        let (at_sender, at) = channel();
        let (go, go_receiver) = channel();
        let before_step = move |step| {
            at_sender.send(step).ok();
            // A test that is over holds nothing up.
            go_receiver.recv().ok();
        };
        (Gate { at, go }, JobOptions { before_step: Some(Box::new(before_step)), ..Default::default() })
    }

    /// Lets the job go until so many steps are done; it then holds. A command sent now is obeyed one step later.
    fn until(&self, step: usize) {
        loop {
            if self.at.recv().unwrap() == step {
                return;
            }
            self.go.send(()).unwrap();
        }
    }

    /// Lets the job do one step.
    fn one(&self) {
        self.go.send(()).unwrap();
    }
}

/// Takes up what a folder holds.
fn taken_up(folder: &Path) -> Fitter {
    let folder = RunFolder::open(folder).unwrap();
    assert!(folder.is_run() && folder.file("mesh.obj").is_file());
    let settings: RunSettings = folder.read_settings().unwrap();
    let (scene, surface) = scene();
    Fitter::resume(scene, surface, settings.fit, checkpoint::read(&folder.checkpoint_path()).unwrap()).unwrap()
}

/// All events up to one that `is_it`; fails when the job ends before.
fn until(job: &JobHandle, is_it: impl Fn(&Event) -> bool) -> Vec<Event> {
    let mut events = Vec::new();
    loop {
        let event = job.events.recv().unwrap_or_else(|_| panic!("the job ended after {events:?}"));
        let found = is_it(&event);
        events.push(event);
        if found {
            return events;
        }
    }
}

fn report(events: &[Event]) -> &ReportData {
    let Some(Event::Finished(data)) = events.last() else { panic!("{:?}", events.last()) };
    data
}

fn is_end(event: &Event) -> bool {
    matches!(event, Event::Finished(_) | Event::Failed(_) | Event::Stopped { .. })
}

fn is_finding(event: &Event, wanted: &str) -> bool {
    matches!(event, Event::Finding(finding) if finding.code == wanted)
}

#[test]
fn a_job_takes_changes_refuses_others_and_is_taken_up_where_it_was_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let (gate, options) = Gate::new();
    let job = job(new_fitter(&base()), folder.path(), options);
    let good = FitSettings { samples: 4, steps_all: 8, exclude: vec!["view2".into(), "typo".into()], ..base() };
    gate.until(3);
    job.commands.send(Command::Change(Box::new(FitSettings { levels: 1, ..base() }))).unwrap();
    job.commands.send(Command::Change(Box::new(good.clone()))).unwrap();
    gate.one();
    let events = until(&job, |event| matches!(event, Event::SettingsChanged(_)));
    let Some(Event::SettingsChanged(told)) = events.last() else { unreachable!() };
    assert_eq!(**told, good);
    assert!(
        events.iter().any(|event| matches!(event, Event::Refused(error) if error.to_string().contains("--levels")))
    );
    assert!(events.iter().any(|event| is_finding(event, "exclude-unknown")));
    // What is on the disk now is the changed fit after four steps.
    let mut expected = stepped(&base(), 4);
    expected.change(good.clone()).unwrap();
    let at_change = taken_up(folder.path());
    assert_eq!(at_change.settings(), &good);
    assert_eq!(without_seconds(at_change.state()), without_seconds(expected.state()));

    gate.until(6);
    job.stop();
    gate.one();
    let events = until(&job, is_end);
    assert!(matches!(events.last(), Some(Event::Stopped { .. })), "{:?}", events.last());
    job.join();
    let whole = to_end(expected);
    assert_eq!(whole.step, 14);
    assert_eq!(to_end(at_change), whole);
    assert_eq!(to_end(taken_up(folder.path())), whole);
}

#[test]
fn the_report_marks_what_was_left_out_and_the_snapshot_has_live_figures() {
    let folder = tempfile::tempdir().unwrap();
    let settings =
        FitSettings { exclude: vec!["view0".into()], consistency: Consistency::Constant, exposure: true, ..base() };
    let job = job(new_fitter(&settings), folder.path(), JobOptions::default());
    let events = until(&job, is_end);
    let data = report(&events);
    let marked: Vec<&str> = data.views.iter().filter(|view| view.left_out).map(|view| view.name.as_str()).collect();
    assert_eq!(marked, ["view0"]);
    let counts: Vec<_> =
        data.aggregates.iter().map(|aggregate| (aggregate.name.as_str(), aggregate.score.views)).collect();
    assert_eq!(counts, [("held-out views", 1), ("training views", 3)]);
    let html = std::fs::read_to_string(folder.path().join("report.html")).unwrap();
    assert!(html.contains("left out"));

    let (_, snapshot) = job.snapshot.newest().unwrap();
    assert_eq!((snapshot.step, snapshot.steps_total, snapshot.stage.as_str()), (12, 12, "all 1/1"));
    let known: Vec<bool> = snapshot.view_rmse.iter().map(|rmse| rmse.is_some_and(f32::is_finite)).collect();
    assert_eq!(known, [false, true, true, true, true]);
    // The held-out one is that of the last look, which had one view.
    let held_out = snapshot.losses.iter().rev().find_map(|row| row.held_out_rmse).unwrap();
    assert!((f64::from(snapshot.view_rmse[4].unwrap()) - held_out).abs() < 1e-6);
    assert_eq!(snapshot.log_gains.len(), 5);
    assert!(snapshot.log_gains[0] == 0.0 && snapshot.log_gains[1] != 0.0);
    let agreement = snapshot.agreement.as_ref().unwrap();
    assert_eq!((agreement.width(), agreement.height()), (16, 16));
    assert!(agreement.pixels().iter().all(|value| (0.0..=1.0).contains(value)));
    assert!(agreement.pixels().iter().any(|&value| value > 0.0));
    job.join();
}

#[test]
fn the_error_of_a_view_is_that_of_its_step() {
    let mut fitter = new_fitter(&FitSettings { views_per_step: 1, ..base() });
    for _ in 0..4 {
        let before = fitter.figures().view_rmse.clone();
        fitter.step(&GO).unwrap();
        let after = &fitter.figures().view_rmse;
        let moved: Vec<usize> = (0..4).filter(|&view| before[view] != after[view]).collect();
        assert_eq!(moved.len(), 1);
        // What the view's surface says is what the line of the step says; the loss counts its background too.
        let row = fitter.state().losses.last().unwrap();
        let own = f64::from(after[moved[0]].unwrap());
        assert!(own > 0.0 && (row.surface_rmse.unwrap() - own).abs() < 1e-6, "{own} against {row:?}");
    }
}

#[test]
fn single_steps_hold_again_and_show_what_they_did() {
    let folder = tempfile::tempdir().unwrap();
    // More steps than can be done before the pause is heard.
    let job = job(new_fitter(&FitSettings { steps_all: 100_000, ..base() }), folder.path(), JobOptions::default());
    job.commands.send(Command::Pause).unwrap();
    until(&job, |event| matches!(event, Event::Paused));
    let shown = || job.snapshot.newest().unwrap().1.step;
    let before = shown();
    for count in [1, 2] {
        let already = shown();
        (0..count).for_each(|_| job.commands.send(Command::StepOnce).unwrap());
        for step in 1..=count {
            let events = until(&job, |event| matches!(event, Event::Progress(_)));
            let Some(Event::Progress(progress)) = events.last() else { unreachable!() };
            assert_eq!(progress.row.step, already + step);
        }
        // A checkpoint that was asked for is written after the steps and their snapshot.
        job.commands.send(Command::Checkpoint).unwrap();
        until(&job, |event| matches!(event, Event::Checkpoint(_)));
        assert_eq!(shown(), already + count);
    }
    let saved = checkpoint::read(&folder.path().join("checkpoint")).unwrap();
    assert_eq!(saved.step, before + 3);
    job.stop();
    let events = until(&job, is_end);
    assert!(matches!(events.last(), Some(Event::Stopped { steps_done }) if *steps_done == before + 3));
}

#[test]
fn nobody_who_watches_holds_a_fit_up() {
    let folder = tempfile::tempdir().unwrap();
    let woken = Arc::new(AtomicUsize::new(0));
    let counter = Arc::clone(&woken);
    let options = JobOptions {
        wake: Some(Arc::new(move || {
            counter.fetch_add(1, Ordering::Relaxed);
        })),
        ..Default::default()
    };
    let settings = FitSettings { steps_diffuse: 300, steps_all: 0, samples: 1, bounces: 1, levels: 1, ..base() };
    let job = job(new_fitter(&settings), folder.path(), options);
    let events = job.events.clone();
    // Nobody reads until the thread has ended.
    job.join();
    let events: Vec<Event> = events.try_iter().collect();
    assert_eq!(report(&events).loss_history.len(), 300);
    let steps = events.iter().filter(|event| matches!(event, Event::Progress(_))).count();
    assert!((100..300).contains(&steps), "{steps} steps were kept");
    assert!(events.iter().any(|event| matches!(event, Event::Started { .. })));
    assert!(woken.load(Ordering::Relaxed) >= events.len());
}

// ---- faults ----

#[test]
fn a_folder_that_is_deleted_is_made_again_with_all_that_a_resumed_fit_needs() {
    let parent = tempfile::tempdir().unwrap();
    let folder = parent.path().join("run");
    let (gate, options) = Gate::new();
    let job = job(new_fitter(&base()), &folder, options);
    gate.until(4);
    std::fs::remove_dir_all(&folder).unwrap();
    job.commands.send(Command::Checkpoint).unwrap();
    gate.one();
    gate.until(5);
    let taken = taken_up(&folder);
    assert_eq!(taken.state().step, 5);
    std::fs::remove_dir_all(&folder).unwrap();
    drop(gate);
    let events = until(&job, is_end);
    report(&events);
    job.join();
    assert!(RunFolder::open(&folder).unwrap().has_result());
    assert_eq!(to_end(taken), without_seconds(taken_up(&folder).state()));
}

#[test]
fn a_checkpoint_that_cannot_be_written_is_a_warning_and_is_tried_again() {
    let parent = tempfile::tempdir().unwrap();
    let folder = parent.path().join("run");
    let (gate, options) = Gate::new();
    let job = job(new_fitter(&base()), &folder, options);
    gate.until(2);
    // A folder in the place of the file: no permission is needed for this to fail.
    let settings = folder.join("settings.toml");
    let before = std::fs::read(&settings).unwrap();
    std::fs::remove_file(&settings).unwrap();
    std::fs::create_dir_all(settings.join("in the way")).unwrap();
    for _ in 0..2 {
        job.commands.send(Command::Checkpoint).unwrap();
        gate.one();
        gate.at.recv().unwrap();
    }
    std::fs::remove_dir_all(&settings).unwrap();
    patina::files::write_bytes(&settings, &before).unwrap();
    assert_eq!(taken_up(&folder).state().step, 0, "the last whole checkpoint stays");
    job.commands.send(Command::Checkpoint).unwrap();
    gate.one();
    let events = until(&job, |event| is_finding(event, "checkpoint-written-again"));
    let warnings: Vec<_> = events
        .iter()
        .filter_map(|event| match event {
            Event::Finding(finding) if finding.code == "checkpoint-not-written" => Some(finding),
            _ => None,
        })
        .collect();
    assert_eq!(warnings.len(), 1, "told once: {warnings:?}");
    assert!(warnings[0].place.contains("settings.toml") && warnings[0].remedy.contains("tried again"));
    gate.at.recv().unwrap();
    assert_eq!(taken_up(&folder).state().step, 5);
    drop(gate);
    report(&until(&job, is_end));
}

#[test]
fn results_that_cannot_be_written_are_an_error_at_the_end() {
    let parent = tempfile::tempdir().unwrap();
    let folder = parent.path().join("run");
    let (gate, options) = Gate::new();
    let job = job(new_fitter(&base()), &folder, options);
    gate.until(4);
    std::fs::remove_dir_all(&folder).unwrap();
    patina::files::write_bytes(&folder, b"a file in the place of the folder").unwrap();
    job.commands.send(Command::Checkpoint).unwrap();
    drop(gate);
    let events = until(&job, is_end);
    assert!(events.iter().any(|event| is_finding(event, "checkpoint-not-written")));
    let last = events.iter().filter_map(|event| if let Event::Progress(p) = event { Some(p.row.step) } else { None });
    assert_eq!(last.max(), Some(12), "the fit went on to its end");
    let Some(Event::Failed(error)) = events.last() else { panic!("{:?}", events.last()) };
    assert_eq!(error.kind(), ErrorKind::Unwritable, "{error}");
    job.join();
    assert_eq!(std::fs::read(&folder).unwrap(), b"a file in the place of the folder");
}

#[test]
fn a_stop_that_cannot_save_is_an_error_and_no_stop() {
    let parent = tempfile::tempdir().unwrap();
    let folder = parent.path().join("run");
    let (gate, options) = Gate::new();
    let job = job(new_fitter(&base()), &folder, options);
    gate.until(4);
    std::fs::remove_dir_all(&folder).unwrap();
    patina::files::write_bytes(&folder, b"in the way").unwrap();
    job.stop();
    gate.one();
    assert!(matches!(until(&job, is_end).last(), Some(Event::Failed(error)) if error.kind() == ErrorKind::Unwritable));
}

#[test]
fn a_stop_while_the_report_is_made_is_no_failure_and_the_maps_are_there() {
    let folder = tempfile::tempdir().unwrap();
    let (gate, options) = Gate::new();
    let job = job(new_fitter(&base()), folder.path(), options);
    gate.until(12);
    job.stop();
    gate.one();
    let events = until(&job, is_end);
    assert!(events.iter().any(|event| matches!(event, Event::Finishing(_))), "the steps were done: {events:?}");
    assert!(matches!(events.last(), Some(Event::Stopped { steps_done: 12 })), "{:?}", events.last());
    assert!(events.iter().any(|event| is_finding(event, "report-not-made")));
    job.join();
    assert!(folder.path().join("diffuse.exr").is_file() && !folder.path().join("report.html").exists());
    // What is left is the report: taken up, it is made.
    let taken = taken_up(folder.path());
    assert_eq!(taken.state().step, 12);
    let job = common::job(taken, folder.path(), JobOptions::default());
    report(&until(&job, is_end));
    assert!(folder.path().join("report.html").is_file());
}

#[test]
fn a_worker_that_panics_says_so_and_its_checkpoint_is_whole() {
    let folder = tempfile::tempdir().unwrap();
    let (gate, JobOptions { before_step, .. }) = Gate::new();
    let mut hold = before_step.unwrap();
    let before_step = move |step| {
        hold(step);
        assert!(step < 8, "a panic that this test asked for");
    };
    let options = JobOptions { before_step: Some(Box::new(before_step)), ..Default::default() };
    let job = job(new_fitter(&base()), folder.path(), options);
    gate.until(4);
    job.commands.send(Command::Checkpoint).unwrap();
    drop(gate);
    let events = until(&job, is_end);
    let Some(Event::Failed(error)) = events.last() else { panic!("{:?}", events.last()) };
    assert_eq!(error.kind(), ErrorKind::Internal);
    assert!(error.to_string().contains("a panic that this test asked for") && error.to_string().contains("resume"));
    job.join();
    let taken = taken_up(folder.path());
    assert_eq!(taken.state().step, 5);
    assert_eq!(to_end(taken), to_end(new_fitter(&base())));
}

// ---- opening ----

#[test]
fn a_scene_is_opened_fitted_stopped_viewed_resumed_and_viewed_again() {
    let parent = tempfile::tempdir().unwrap();
    let (scene_folder, run_folder) = (parent.path().join("scene"), parent.path().join("run"));
    let small = DemoSettings { views: 5, held_out: 1, width: 48, height: 36, map_size: 64, seed: 1 };
    let made = open::open_demo(&small, &GO, &|_, _| {}).unwrap();
    let options = patina::export::exchange::ExchangeOptions { with_photos: true, ..Default::default() };
    patina::export::exchange::write(&made.scene, made.scene.truth.as_ref().unwrap(), &options, &scene_folder).unwrap();
    assert_eq!(open::kind_of(&scene_folder).unwrap(), PathKind::Scene);

    let heard = Mutex::new(Vec::new());
    let tell = |stage: OpenStage, share: f32| {
        assert!((0.0..=1.0).contains(&share));
        let mut heard = heard.lock().unwrap();
        if heard.last() != Some(&stage) {
            heard.push(stage);
        }
    };
    let opened = open::open_scene(&scene_folder, &ReadSettings::default(), &GO, &tell).unwrap();
    assert_eq!((opened.scene.views.len(), opened.report.views.len()), (6, 6));
    let fit = FitSettings { map_size: 32, exclude: vec![opened.scene.views[0].name.clone()], ..base() };
    let settings = RunSettings { scene: scene_folder.clone(), fit, ..Default::default() };
    let (prepared, fitter, settings) = open::start_new(opened, settings, &GO, &tell).unwrap();
    use OpenStage::*;
    assert_eq!(*heard.lock().unwrap(), [Read, Check, Atlas, Tracer, Start]);

    let folder = RunFolder::create(&run_folder).unwrap();
    let (gate, options) = Gate::new();
    let job = start_with(prepared, fitter, settings, folder.clone(), options).unwrap();
    gate.until(2);
    job.stop();
    gate.one();
    until(&job, is_end);
    job.join();

    assert_eq!(open::kind_of(&run_folder).unwrap(), PathKind::Run);
    let view = open::view_run(&folder, None, &GO, &tell).unwrap();
    assert!(!view.is_finished && view.can_resume && view.report.is_none() && view.times_seen.is_none());
    assert_eq!(view.scene.unwrap().views.len(), 6);
    assert_eq!((view.maps.diffuse.width(), view.environment.height()), (16, 4), "the maps of the first stage");
    assert_eq!(view.losses.len(), checkpoint::read(&folder.checkpoint_path()).unwrap().step);
    assert!(view.findings.is_empty(), "{:?}", view.findings);

    let (prepared, fitter, settings) = open::resume(&folder, None, &GO, &tell).unwrap();
    let job = start_with(prepared, fitter, settings, folder.clone(), JobOptions::default()).unwrap();
    let events = until(&job, is_end);
    let data = report(&events).clone();
    job.join();

    // Now the scene is moved away: a finding for who looks, an error for who wants to go on.
    let moved = parent.path().join("moved");
    std::fs::rename(&scene_folder, &moved).unwrap();
    let view = open::view_run(&folder, None, &GO, &tell).unwrap();
    assert!(view.is_finished && view.scene.is_none());
    assert_eq!(view.findings.len(), 1);
    assert!(view.findings[0].code == "scene-not-opened" && !view.findings[0].remedy.is_empty());
    assert_eq!(view.maps.diffuse.width(), 32);
    assert_eq!(view.losses.len(), 12);
    assert_eq!(view.report.unwrap().views.len(), data.views.len());
    assert!(view.times_seen.unwrap().pixels().iter().any(|&times| times > 0.0));
    assert_eq!(open::resume(&folder, None, &GO, &tell).err().unwrap().kind(), ErrorKind::Missing);
    let view = open::view_run(&folder, Some(&moved), &GO, &tell).unwrap();
    assert!(view.scene.is_some() && view.findings.is_empty());
    let (_, fitter, settings) = open::resume(&folder, Some(&moved), &GO, &tell).unwrap();
    assert_eq!((fitter.state().step, settings.scene), (12, moved.clone()));

    // Results without a checkpoint can be looked at; a checkpoint with steps to go beats older results.
    let whole = std::fs::read(folder.checkpoint_path()).unwrap();
    std::fs::remove_file(folder.checkpoint_path()).unwrap();
    let view = open::view_run(&folder, Some(&moved), &GO, &tell).unwrap();
    assert!(view.is_finished && !view.can_resume && view.losses.len() == 12);
    checkpoint::write(&folder.checkpoint_path(), &{
        let mut state = fitter.state().clone();
        (state.step, state.stage, state.step_in_stage) = (11, state.plan.len() - 1, 2);
        state
    })
    .unwrap();
    let view = open::view_run(&folder, Some(&moved), &GO, &tell).unwrap();
    assert!(!view.is_finished && view.report.is_none());
    patina::files::write_bytes(&folder.checkpoint_path(), &whole[..40]).unwrap();
    let view = open::view_run(&folder, Some(&moved), &GO, &tell).unwrap();
    assert!(view.is_finished && view.findings.iter().any(|finding| finding.code == "checkpoint-unreadable"));
}

#[test]
fn a_raised_flag_stops_before_the_next_stage() {
    let stop = AtomicBool::new(true);
    let error = open::open_scene(Path::new("anywhere"), &ReadSettings::default(), &stop, &|_, _| {}).err().unwrap();
    assert_eq!(error.kind(), ErrorKind::Stopped);
    let stop = AtomicBool::new(false);
    let (scene, _) = scene();
    let opened = open::OpenedScene { scene: Scene::clone(&scene), report: Default::default(), timings: Vec::new() };
    let tell = |stage: OpenStage, _: f32| {
        assert_ne!(stage, OpenStage::Tracer, "begun after the flag was raised");
        stop.store(true, Ordering::Relaxed);
    };
    let settings = RunSettings { fit: base(), ..Default::default() };
    assert_eq!(open::start_new(opened, settings, &stop, &tell).err().unwrap().kind(), ErrorKind::Stopped);
}

#[test]
fn a_path_that_is_neither_run_nor_scene_says_what_is_needed() {
    let parent = tempfile::tempdir().unwrap();
    let error = open::kind_of(parent.path()).unwrap_err();
    assert!(error.remedy_text().contains("scene.toml") && error.remedy_text().contains("cameras.json"), "{error}");
    assert_eq!(open::kind_of(&parent.path().join("nothing")).unwrap_err().kind(), ErrorKind::Missing);
    // A file out of a run or a scene: the folder to open is named.
    let run = parent.path().join("run");
    RunFolder::create(&run).unwrap();
    let settings = run.join("settings.toml");
    patina::files::write_bytes(&settings, b"").unwrap();
    assert!(open::kind_of(&settings).unwrap_err().remedy_text().contains(&run.display().to_string()));
    let manifest = parent.path().join("scene.toml");
    patina::files::write_bytes(&manifest, b"").unwrap();
    assert_eq!(open::kind_of(&manifest).unwrap(), PathKind::Scene);
    assert_eq!(open::kind_of(&run).unwrap(), PathKind::Run);
}

// ---- the command line ----

#[test]
fn what_is_typed_wins_over_a_preset_and_over_a_file() {
    let of = |more: &[&str]| {
        let words = ["patina", "fit", "scene", "-o", "run"].iter().chain(more);
        let Some(Task::Fit(options)) = Arguments::try_parse_from(words).unwrap().task else { unreachable!() };
        run_settings(&options).unwrap()
    };
    assert_eq!(of(&[]).fit, FitSettings::default());
    assert_eq!(of(&["--preset", "careful"]).fit, FitSettings::preset(Preset::Careful));
    let typed = of(&["--preset", "quick", "--map-size", "2048", "--exclude", "a", "--exclude", "b c"]).fit;
    let exclude = vec!["a".to_string(), "b c".to_string()];
    assert_eq!(typed, FitSettings { map_size: 2048, exclude, ..FitSettings::preset(Preset::Quick) });

    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("settings.toml");
    patina::files::write_bytes(&file, b"[read]\nshrink = 4\nmax_views = 9\n[fit]\nsamples = 16\nbounces = 5\n")
        .unwrap();
    let file = file.to_str().unwrap();
    // 4 is the default: typed, it wins all the same.
    let settings = of(&["--settings", file, "--samples", "4", "--shrink", "2"]);
    assert_eq!((settings.fit.samples, settings.fit.bounces), (4, 5));
    assert_eq!((settings.read.shrink, settings.read.max_views), (2, 9));
    let both = ["patina", "fit", "s", "-o", "r", "--settings", file, "--preset", "quick"];
    assert!(Arguments::try_parse_from(both).is_err());
}
