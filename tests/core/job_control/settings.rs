//! Settings that change under a running fit, and photos that are left out.

use super::support::*;
use crate::core_tests::common::*;
use patina::fit::settings::{BackgroundEvidence, Consistency, Start, Steps};
use patina::fit::state::FitState;
use patina::fit::{FitSettings, Fitter, ViewUse, checkpoint};
use patina::render::first_hits::PixelFilter;
use patina::scene::{Photo, Scene};
use patina::{ErrorKind, Place};
use std::sync::Arc;

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
