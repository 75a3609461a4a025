//! The way a fit goes: left saddles, consistency, exposure, and fits that are stopped, saved and taken up again.

#![allow(clippy::unwrap_used)]

use super::common::*;
use glam::Vec3;
use patina::ErrorKind;
use patina::fit::settings::{Consistency, Start, Steps};
use patina::fit::state::FitState;
use patina::fit::{FitSettings, Fitter, StepOutcome, checkpoint};
use patina::render::Surface;
use patina::scene::{Background, Photo, Scene};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A stop flag that nobody raises.
static GO: AtomicBool = AtomicBool::new(false);

#[test]
fn the_start_of_the_paper_is_left_and_named() {
    for (background, steps) in [
        (Background::Black, Steps::TwoStep),
        (Background::Environment, Steps::TwoStep),
        (Background::Environment, Steps::OneStep),
    ] {
        let trial = Trial { background, ..Default::default() };
        let fitter = trial.fitted(FitSettings { start: Start::Paper, steps, ..quick() });
        let events = &fitter.state().events;
        assert_eq!(events.len(), 1, "{events:?}");
        assert!(events[0].is_of_saddle() && events[0].to_string().contains("norm"), "{events:?}");
        assert_learned(&fitter);
        assert!(mean_of(fitter.state(), 0) > 0.0 && mean_light(fitter.state()) > 0.0);
    }
}

#[test]
fn the_four_settings_of_consistency() {
    let trial = Trial::default();
    let of = |consistency| trial.fitted(FitSettings { consistency, ..quick() });
    let distance = |a: &Fitter, b: &Fitter| -> f32 {
        let texels = a.state().texels.iter().zip(&b.state().texels);
        texels
            .map(|(a, b)| (a.to_array(), b.to_array()))
            .map(|(a, b)| (0..7).map(|n| (a[n] - b[n]).abs()).sum::<f32>())
            .sum::<f32>()
            / a.state().texels.len() as f32
    };
    let none = of(Consistency::None);
    let released = of(Consistency::Released);
    let constant = of(Consistency::Constant);
    let exact = of(Consistency::Exact);
    for fitter in [&none, &released, &constant, &exact] {
        assert_learned(fitter);
    }
    // A factor of 1 + 1e-6 on the whole gradient is nothing to Adam; what is left is rounding.
    assert!(distance(&none, &released) < 2e-3, "{}", distance(&none, &released));
    assert!(distance(&none, &exact) > 10.0 * distance(&none, &released), "the exact gradient is another one");
    assert!(released.state().losses.iter().all(|row| row.consistency < 1e-2));
    // The first step is least squares alone.
    let (first, second) = exact.state().losses.split_at(quick().steps_diffuse);
    assert!(!first.is_empty() && first.iter().all(|row| row.consistency == 0.0));
    assert!(!second.is_empty() && second.iter().all(|row| row.consistency > 0.0 && row.consistency <= 1.0));
    // The unbiased image loss may fall below zero; the factor makes it larger either way.
    assert!(constant.state().losses.iter().all(|row| row.loss.abs() >= row.image_loss.abs()));
}

#[test]
fn exposure_finds_the_gain_of_one_view() {
    // Under a known light: a background of its own could explain a brighter view as well.
    let trial = Trial::default();
    let mut scene = trial.photographed();
    let Photo::Linear32(photo) = &mut scene.views[1].photo else { unreachable!() };
    photo.pixels_mut().iter_mut().for_each(|pixel| *pixel *= 1.3);
    let settings = FitSettings { exposure: true, fixed_light: true, steps_diffuse: 50, ..quick() };
    let mut fitter = Fitter::new(Arc::new(scene.clone()), trial.surface(), settings, Some(&trial.light)).unwrap();
    run(&mut fitter).unwrap();
    let gains = &fitter.state().log_gains;
    assert!(gains[1] > gains[0] + 0.15 && gains[1] > gains[2] + 0.15, "{gains:?}");
    assert!(gains[1] < gains[0] + 0.35, "ln 1.3 is 0.262: {gains:?}");
    assert!(gains.iter().sum::<f32>().abs() < 1e-5, "the mean stays zero: {gains:?}");
    let fitter = fit(scene, trial.surface(), quick()).unwrap();
    assert_eq!(fitter.state().log_gains, [0.0; 3]);
}

/// A scene with every kind of thing a checkpoint must hold: gains, held-out views, pixels that are not finite.
fn eventful() -> (Arc<Scene>, Arc<Surface>, FitSettings) {
    let trial = Trial { cameras: around(4, 35.0), ..Default::default() };
    let mut scene = trial.photographed();
    scene.views[3].held_out = true;
    let Photo::Linear32(photo) = &mut scene.views[0].photo else { unreachable!() };
    photo[(10, 10)].x = f32::NAN;
    photo[(14, 12)] = Vec3::splat(3e38);
    let settings =
        FitSettings { exposure: true, start: Start::Paper, views_per_step: 2, held_out_interval: 3, ..quick() };
    (Arc::new(scene), trial.surface(), settings)
}

#[test]
fn a_fit_taken_up_from_a_file_is_the_uninterrupted_one_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("checkpoint");
    let (scene, surface, settings) = eventful();
    let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let (one, two) = (pool(1), pool(2));
    for consistency in [Consistency::None, Consistency::Exact] {
        let settings = FitSettings { consistency, ..settings.clone() };
        let new = || Fitter::new(scene.clone(), surface.clone(), settings.clone(), None).unwrap();
        let whole = one.install(|| {
            let mut whole = new();
            run(&mut whole).unwrap();
            whole
        });
        assert_eq!(whole.state().step, 12);
        // Before, at and after the borders of the four stages, and at the very end.
        for cut in [0, 1, 3, 4, 6, 9, 12] {
            let mut first = new();
            two.install(|| (0..cut).for_each(|_| drop(first.step(&GO).unwrap())));
            checkpoint::write(&path, first.state()).unwrap();
            let state = checkpoint::read(&path).unwrap();
            assert_eq!(&state, first.state());
            let mut second = Fitter::resume(scene.clone(), surface.clone(), settings.clone(), state).unwrap();
            two.install(|| run(&mut second).unwrap());
            assert_eq!(without_seconds(second.state()), without_seconds(whole.state()), "cut after step {cut}");
        }
    }
}

#[test]
fn a_stop_at_any_time_leaves_no_trace() {
    let (scene, surface, settings) = eventful();
    for consistency in [Consistency::None, Consistency::Exact] {
        let settings = FitSettings { consistency, ..settings.clone() };
        let new = || Fitter::new(scene.clone(), surface.clone(), settings.clone(), None).unwrap();
        let mut whole = new();
        run(&mut whole).unwrap();
        let mut stopped = new();
        let mut attempt = 0;
        loop {
            // Raised at some time that the machine chooses; every third step is left alone, so that the end is reached.
            attempt += 1;
            let stop = AtomicBool::new(attempt % 5 == 0);
            let before = without_seconds(stopped.state());
            let outcome = std::thread::scope(|scope| {
                let wait =
                    std::time::Duration::from_micros(if attempt % 3 == 0 { u64::MAX } else { attempt * 137 % 4000 });
                let (done, gone) = std::sync::mpsc::channel::<()>();
                let stop = &stop;
                scope.spawn(move || {
                    if gone.recv_timeout(wait).is_err() {
                        stop.store(true, Ordering::Relaxed);
                    }
                });
                let outcome = stopped.step(stop).unwrap();
                done.send(()).ok();
                outcome
            });
            match outcome {
                StepOutcome::Finished => break,
                StepOutcome::Stepped(_) => {}
                StepOutcome::Interrupted => {
                    // A look at held-out views that was stopped before may have been made up for.
                    let look_aside = |mut state: FitState| {
                        state.losses.iter_mut().for_each(|row| row.held_out_rmse = None);
                        state
                    };
                    let (before, after) = (look_aside(before), look_aside(without_seconds(stopped.state())));
                    assert_eq!(
                        (after.step, &after.losses, &after.non_finite),
                        (before.step, &before.losses, &before.non_finite)
                    );
                    if after.stage == before.stage && after.events == before.events {
                        assert_eq!(after, before, "a dropped step changed something");
                    }
                }
            }
        }
        assert_eq!(without_seconds(stopped.state()), without_seconds(whole.state()));
    }
}

#[test]
fn a_checkpoint_of_other_settings_is_refused() {
    let trial = Trial::default();
    let (scene, surface) = (Arc::new(trial.photographed()), trial.surface());
    let state = fit(trial.photographed(), surface.clone(), FitSettings { map_size: 32, ..quick() }).unwrap();
    let mut at_start = state.state().clone();
    at_start.stage = 0;
    at_start.step_in_stage = 0;
    for settings in [FitSettings { environment_height: 8, ..quick() }, quick()] {
        let outcome = Fitter::resume(scene.clone(), surface.clone(), settings, at_start.clone());
        assert_eq!(outcome.err().unwrap().kind(), ErrorKind::InvalidScene);
    }
    let mut odd = state.state().clone();
    odd.moments.first.pop();
    let settings = FitSettings { map_size: 32, ..quick() };
    assert!(Fitter::resume(scene.clone(), surface.clone(), settings.clone(), odd).is_err());
    assert!(Fitter::resume(scene, surface, settings, state.state().clone()).is_ok());
}
