//! The solver as a method of a fit: same door, same folder, same promises.

#![allow(clippy::unwrap_used)]

use super::common::*;
use patina::export::RunFolder;
use patina::fit::settings::{BackgroundEvidence, Start};
use patina::fit::solver::SolverSettings;
use patina::fit::underway::Underway;
use patina::fit::{FitSettings, Fitter, Method, StepOutcome, checkpoint};
use patina::job::{Event, JobOptions, RunSettings, relit};
use patina::render::Surface;
use patina::render::cached::{CachedSettings, CachedTransport};
use patina::scene::{Background, Scene};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, OnceLock};

static GO: AtomicBool = AtomicBool::new(false);

/// The steps of [`base`]: light and maps on the only level, twice, and the descent.
const STAGES: [&str; 8] =
    ["wide light", "wide light", "narrow light", "narrow light", "maps", "narrow light", "maps", "refine"];

/// Seven views, the last held out; photographed once for all tests.
fn scene() -> (Arc<Scene>, Arc<Surface>) {
    static SCENE: OnceLock<(Arc<Scene>, Arc<Surface>)> = OnceLock::new();
    SCENE.get_or_init(|| last_held_out(7)).clone()
}

fn base() -> FitSettings {
    FitSettings { method: Method::Solver, solver_rounds: 4, solver_grid: 32, map_size: 32, ..quick() }
}

fn new_fitter(settings: &FitSettings) -> Fitter {
    let (scene, surface) = scene();
    Fitter::new(scene, surface, settings.clone(), None).unwrap()
}

/// A fit that is saved after these numbers of steps and taken up ends as `whole` did.
fn assert_taken_up_alike(settings: &FitSettings, steps: &[usize], whole: &Fitter) {
    let (scene, surface) = scene();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("checkpoint");
    for &step in steps {
        let mut fitter = new_fitter(settings);
        (0..step).for_each(|_| drop(fitter.step(&GO).unwrap()));
        checkpoint::write(&path, fitter.state()).unwrap();
        let state = checkpoint::read(&path).unwrap();
        let mut resumed = Fitter::resume(scene.clone(), surface.clone(), settings.clone(), state).unwrap();
        run(&mut resumed).unwrap();
        assert!(without_seconds(resumed.state()) == without_seconds(whole.state()), "after step {step}");
    }
}

#[test]
fn it_explains_the_photos_and_views_it_never_saw() {
    let mut fitter = new_fitter(&base());
    run(&mut fitter).unwrap();
    let state = fitter.state();
    let stages: Vec<&str> = state.losses.iter().map(|row| row.stage.as_str()).collect();
    assert_eq!(stages, STAGES);
    let held_out: Vec<f64> = state.losses.iter().map(|row| row.held_out_rmse.unwrap()).collect();
    println!("held out {held_out:?}");
    let last = held_out[STAGES.len() - 1];
    assert!(last < 0.5 * held_out[0] || last < 0.02, "{held_out:?}");
    // A sixth of the photos' mean.
    assert!(last < 0.06, "{held_out:?}");
    let figures = &fitter.figures().view_rmse;
    assert!(figures.iter().all(|rmse| rmse.is_some_and(|rmse| rmse < 0.1)), "{figures:?}");
    assert!(state.non_finite.is_empty());
}

#[test]
fn transport_that_was_cached_before_serves_where_it_is_the_fits_own() {
    let (_, surface) = scene();
    let settings = FitSettings { solver_rounds: 2, ..base() };
    let mut whole = new_fitter(&settings);
    run(&mut whole).unwrap();
    let (own, light_size) = SolverSettings::first_cache(&settings);
    for (cached, serves) in [(own, true), (CachedSettings { seed: 7, ..own }, false)] {
        let transport = Arc::new(CachedTransport::build(&surface, cached, light_size, &GO).unwrap());
        let mut fitter = new_fitter(&settings);
        fitter.take_transport(Arc::clone(&transport));
        fitter.step(&GO).unwrap();
        assert_eq!(Arc::strong_count(&transport) > 1, serves);
        run(&mut fitter).unwrap();
        assert!(without_seconds(fitter.state()) == without_seconds(whole.state()));
    }
    // A window's cache is that of a fit by the solver with photos of usual size, and coarser ones have their own.
    let fit = FitSettings { method: Method::Solver, ..FitSettings::default() };
    assert_eq!(relit::settings_beside(&fit, fit.bounces), SolverSettings::first_cache(&fit).0);
    for other in [
        FitSettings { solver_grid: 128, ..fit.clone() },
        FitSettings { solver_grid: 1024, map_size: 1024, ..fit.clone() },
        FitSettings { method: Method::Adam, ..fit.clone() },
    ] {
        let expected = relit::settings_of(other.bounces, Some(other.lobe));
        assert_eq!(relit::settings_beside(&other, other.bounces), expected);
    }
}

#[test]
fn a_fit_that_is_taken_up_goes_on_bit_for_bit_whatever_the_threads() {
    let (scene, surface) = scene();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("checkpoint");
    for settings in [base(), FitSettings { exposure: true, background: BackgroundEvidence::Ignore, ..base() }] {
        let mut whole = new_fitter(&settings);
        run(&mut whole).unwrap();
        let whole = without_seconds(whole.state());
        for step in [0, 1, 4, 5, 6, 7, 8] {
            let mut fitter = new_fitter(&settings);
            (0..step).for_each(|_| drop(fitter.step(&GO).unwrap()));
            // A step that is stopped leaves no trace.
            assert_eq!(
                fitter.step(&AtomicBool::new(true)).unwrap(),
                match step {
                    8 => StepOutcome::Finished,
                    _ => StepOutcome::Interrupted,
                }
            );
            checkpoint::write(&path, fitter.state()).unwrap();
            let state = checkpoint::read(&path).unwrap();
            let mut resumed = Fitter::resume(scene.clone(), surface.clone(), settings.clone(), state).unwrap();
            let pool = rayon::ThreadPoolBuilder::new().num_threads(1 + step % 3).build().unwrap();
            pool.install(|| run(&mut resumed)).unwrap();
            assert!(without_seconds(resumed.state()) == whole, "after step {step}");
        }
    }
}

#[test]
fn levels_bring_maps_at_half_size_first_and_go_on_bit_for_bit() {
    let settings = FitSettings { map_size: 256, solver_levels: 3, solver_rounds: 2, ..base() };
    let mut whole = new_fitter(&settings);
    let (mut sizes, mut looks) = (Vec::new(), Vec::new());
    loop {
        let mut seen = 0;
        let outcome = whole.step_watched(&GO, &mut |underway: &Underway| {
            if underway.seconds_left.is_none() {
                assert!(!underway.is_reached && underway.shown().0.diffuse.width() == 256);
                seen += 1;
            }
        });
        let StepOutcome::Stepped(row) = outcome.unwrap() else { break };
        looks.push(seen);
        sizes.push((row.stage, whole.state().map_size, whole.deviations().is_some()));
    }
    let expected = [
        ("wide light 1/2", 128, false),
        ("narrow light 1/2", 128, false),
        ("maps 1/2", 128, true),
        ("refine", 256, true),
    ];
    assert_eq!(sizes, expected.map(|(name, size, known)| (name.to_string(), size, known)));
    // Each of the six photos is seen on the maps as the finer level is made ready, which is no part of the fit.
    assert_eq!(looks, [0, 0, 0, 6]);
    assert_taken_up_alike(&settings, &[2, 3], &whole);
}

#[test]
fn the_job_shows_each_step_and_leaves_a_whole_run() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let job = job(new_fitter(&base()), &path, JobOptions::default());
    let mut progress = 0;
    let data = loop {
        match job.events.recv().unwrap() {
            Event::Progress(row) => {
                progress += 1;
                assert_eq!(row.steps_total, STAGES.len());
            }
            Event::Finished(data) => break data,
            Event::Failed(error) => panic!("{error}"),
            _ => {}
        }
    };
    assert_eq!(progress, STAGES.len());
    let (_, snapshot) = job.snapshot.newest().unwrap();
    assert_eq!((snapshot.step, snapshot.stage.as_str()), (STAGES.len(), "refine"));
    assert!(data.aggregates.iter().any(|aggregate| aggregate.name == "held-out views"));
    assert_eq!(data.loss_history.len(), STAGES.len());
    let folder = RunFolder::open(&path).unwrap();
    assert!(folder.has_result() && folder.report_html_path().is_file());
    assert!(folder.read_result().is_ok());
    for name in ["diffuse_deviation.exr", "specular_deviation.exr", "roughness_deviation.exr"] {
        assert!(folder.file(name).is_file(), "{name}");
    }
    // One view is held out, which has no standard error: training views judge, withheld from that alone.
    let choices = data.choices.as_ref().unwrap();
    assert!(choices.are_withheld && choices.views == 2 && choices.lines.len() == 5, "{choices:?}");
    assert_eq!(choices.lines.iter().filter_map(|line| line.share).sum::<f64>().round(), 1.0);
    let codes = folder.read_choices().unwrap().unwrap();
    assert!(codes.pixels().iter().all(|code| [0.0, 1.0, 2.0, 3.0].contains(code)));
    let told: patina::insight::report::ReportData = folder.read_report_json().unwrap();
    assert_eq!(told.choices.as_ref(), Some(choices));
    assert_eq!(folder.read_loss().unwrap().len(), STAGES.len());
    assert_eq!(folder.read_settings::<RunSettings>().unwrap().fit, base());
}

#[test]
fn hard_starts_and_scenes_leave_nothing_that_is_not_finite() {
    let black_cloth = Trial { cameras: around(5, 35.0), background: Background::Black, ..Default::default() };
    for settings in [
        FitSettings { start: Start::Paper, ..base() },
        FitSettings { bounces: 1, exposure: true, ..base() },
        FitSettings { fixed_light: true, ..base() },
        FitSettings { map_size: 16, solver_grid: 64, environment_height: 2, ..base() },
    ] {
        fit(black_cloth.photographed(), black_cloth.surface(), settings.clone()).unwrap();
        // Black photos: nothing to find, and nothing to fall over.
        fit(black_cloth.black(), black_cloth.surface(), settings).unwrap();
    }
}
