//! What is wrong with a capture is told by name, and a sound one is left in peace.

#![allow(clippy::unwrap_used)]

use glam::Vec3;
use patina::fit::{FitSettings, Fitter, Method};
use patina::insight::capture::{Capture, check};
use patina::job::demo::photograph;
use patina::lab::scenes::hard::{HardCase, HardScene, HardSettings, build};
use patina::material::texels::texels_from_maps;
use patina::render::Surface;
use patina::scene::{Photo, Scene};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// A stop flag that nobody raises.
static GO: AtomicBool = AtomicBool::new(false);

fn photographed(case: HardCase, settings: &HardSettings, samples: usize) -> HardScene {
    let mut hard = build(case, settings).unwrap();
    photograph(&mut hard.scene, samples, 1, 1.0, &GO, &|_| {}).unwrap();
    hard
}

/// Sizes at which a test takes about a second.
fn small() -> HardSettings {
    HardSettings { views: 9, held_out: 1, light_height: 8, ..Default::default() }
}

/// A fit that has found the truth's maps and light.
fn of_truth(hard: &HardScene, given: &Scene) -> Fitter {
    let truth = hard.scene.truth.as_ref().unwrap();
    let settings = FitSettings {
        method: Method::Adam,
        map_size: truth.maps.diffuse.width(),
        environment_height: truth.environment.height(),
        bounces: truth.max_bounces,
        levels: 1,
        ..Default::default()
    };
    let (scene, surface) = (Arc::new(given.clone()), Arc::new(Surface::new(given.mesh.clone()).unwrap()));
    let fresh = Fitter::new(scene.clone(), surface.clone(), settings.clone(), Some(&truth.environment)).unwrap();
    let mut state = fresh.state().clone();
    state.texels = texels_from_maps(&truth.maps);
    Fitter::resume(scene, surface, settings, state).unwrap()
}

fn codes(capture: &Capture) -> Vec<&'static str> {
    capture.findings.iter().map(|finding| finding.code).collect()
}

#[test]
fn each_defect_is_told_and_a_sound_capture_is_not() {
    let mut hard = photographed(HardCase::Plain, &small(), 24);
    let capture = check(&of_truth(&hard, &hard.scene), &GO);
    assert_eq!(codes(&capture), [""; 0], "{:?}", capture.findings);
    assert_eq!(capture.views.len(), 9, "held-out views are not asked");
    for view in &capture.views {
        assert!(view.shift_x_pixels.hypot(view.shift_y_pixels) < 0.1, "{view:?}");
        assert!((view.gain - 1.0).abs() < 0.02 && view.unlike_share < 0.002, "{view:?}");
        assert!(view.doubtful_mask_share.is_nan(), "there is no mask");
    }

    // The photos are those of the true cameras; the model's pictures are of the turned ones.
    hard.case = HardCase::TwoPixels;
    let given = hard.spoil(&hard.scene).unwrap();
    let capture = check(&of_truth(&hard, &given), &GO);
    assert_eq!(codes(&capture), ["camera-turned"], "{:?}", capture.findings);
    for (figures, (real, turned)) in capture.views.iter().zip(hard.scene.views.iter().zip(&given.views)) {
        let place = Vec3::new(0.0, 0.5, 0.0);
        let expected = real.camera.project(place).unwrap().0 - turned.camera.project(place).unwrap().0;
        let found = glam::Vec2::new(figures.shift_x_pixels as f32, figures.shift_y_pixels as f32);
        assert!(found.distance(expected) < 0.3, "{figures:?}: {expected} expected");
        assert!(figures.shift_error_pixels < 0.3 && figures.shift_explains > 0.5, "{figures:?}");
    }
    let text = capture.findings[0].to_string();
    assert!(text.contains("9 of 9") && text.contains("--exclude"), "{text}");

    hard.case = HardCase::Masks;
    let capture = check(&of_truth(&hard, &hard.spoil(&hard.scene).unwrap()), &GO);
    assert_eq!(codes(&capture), ["mask-doubtful"], "{:?}", capture.findings);
    let mean = capture.views.iter().map(|view| view.doubtful_mask_share).sum::<f64>() / 9.0;
    assert!((0.015..0.045).contains(&mean), "3 % are wrong, {mean} was found");

    let mut given = hard.scene.clone();
    for (index, view) in given.views.iter_mut().enumerate() {
        let gain = [1.3, 1.0, 1.0 / 1.3][index % 3];
        view.photo = Photo::Linear32(view.photo.to_linear().map(|&radiance| radiance * gain));
    }
    let capture = check(&of_truth(&hard, &given), &GO);
    assert_eq!(codes(&capture), ["exposure-varies"], "{:?}", capture.findings);
    for (index, view) in capture.views.iter().enumerate() {
        assert!((view.gain.ln() - f64::from([1.3f32, 1.0, 1.0 / 1.3][index % 3]).ln()).abs() < 0.03, "{view:?}");
    }
    assert!(capture.findings[0].remedy.contains("--exposure"));
}

#[test]
fn a_part_that_the_mesh_lacks_is_found_where_it_is() {
    let hard = photographed(HardCase::Missing, &small(), 24);
    let given = hard.spoil(&hard.scene).unwrap();
    let capture = check(&of_truth(&hard, &given), &GO);
    assert!(codes(&capture).contains(&"mesh-missing-part"), "{:?}", capture.findings);
    let found = capture.missing.unwrap().centre;
    assert!(found.distance(Vec3::new(1.15, 0.36, 0.35)) < 0.35, "{found}");
    let capture = check(&of_truth(&hard, &hard.scene), &GO);
    assert_eq!(codes(&capture), [""; 0], "the whole mesh is sound: {:?}", capture.findings);
}

#[test]
fn the_same_bits_whatever_the_number_of_threads() {
    let hard = photographed(HardCase::OnePixel, &HardSettings { size: 32, views: 5, ..small() }, 8);
    let fitter = of_truth(&hard, &hard.spoil(&hard.scene).unwrap());
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        format!("{:?}", pool.install(|| check(&fitter, &GO)))
    };
    assert_eq!(with(1), with(3));
    let stopped = check(&fitter, &AtomicBool::new(true));
    assert_eq!(stopped, Capture::default());
}
