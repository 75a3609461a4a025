//! Layers over the texels: error, disagreement and coverage of all views together.

#![allow(clippy::unwrap_used)]

use super::common::*;
use patina::ErrorKind;
use patina::insight::surface_layers::{LayerSettings, SurfaceLayers, surface_layers};
use patina::render::picture::PictureSettings;
use patina::scene::{Background, PixelState, Scene};
use std::cell::RefCell;
use std::sync::atomic::AtomicBool;

static GO: AtomicBool = AtomicBool::new(false);
/// The view whose photo is spoiled.
const SPOILED: usize = 2;

fn trial() -> Trial {
    Trial { cameras: around(6, 35.0), background: Background::Black, ..Default::default() }
}

fn settings() -> LayerSettings {
    let picture = PictureSettings { samples: 16, max_bounces: 2, background_visible: false, ..Default::default() };
    LayerSettings { map_size: 32, picture, ..Default::default() }
}

fn layers(trial: &Trial, scene: &Scene, settings: &LayerSettings) -> SurfaceLayers {
    surface_layers(scene, &trial.surface(), &trial.truth(), settings, &GO, &|_| {}).unwrap()
}

/// Which texels a view alone sees.
fn seen_by(trial: &Trial, scene: &Scene, view: usize) -> Vec<bool> {
    let excluded = (0..scene.views.len()).map(|other| other != view).collect();
    let own = layers(trial, scene, &LayerSettings { excluded, ..settings() });
    own.times_seen.pixels().iter().map(|&times| times > 0.0).collect()
}

#[test]
fn a_spoiled_photo_raises_disagreement_where_its_view_looks_and_nowhere_else() {
    let trial = trial();
    let mut scene = trial.photographed();
    let fair = layers(&trial, &scene, &settings());
    let photo = scene.views[SPOILED].photo.to_linear();
    scene.set_photo(SPOILED, photo.map(|&radiance| radiance * 2.0)).unwrap();
    let spoiled = layers(&trial, &scene, &settings());
    let looks = seen_by(&trial, &scene, SPOILED);

    // The range is that of the spoiled gradients in one case and of noise in the other: compare variances.
    let variance = |layers: &SurfaceLayers, texel: usize| {
        f64::from(layers.disagreement.pixels()[texel]) * layers.gradient_range * layers.gradient_range
    };
    let (mut inside, mut outside) = (Vec::new(), Vec::new());
    for (texel, &looks) in looks.iter().enumerate() {
        let value = spoiled.disagreement.pixels()[texel];
        // A pixel of a silhouette sees a texel but does not judge it.
        assert!(value.is_nan() || spoiled.times_seen.pixels()[texel] >= 2.0, "texel {texel}");
        if value.is_nan() {
            continue;
        }
        assert!((0.0..=1.0).contains(&value));
        if looks {
            inside.push((f64::from(value), variance(&spoiled, texel) / variance(&fair, texel)));
        } else {
            assert!((variance(&spoiled, texel) - variance(&fair, texel)).abs() <= 1e-6 * variance(&fair, texel));
            outside.push(f64::from(value));
        }
    }
    assert!(inside.len() > 100 && outside.len() > 30, "{} {}", inside.len(), outside.len());
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let (raised, rest) = (mean(&inside.iter().map(|pair| pair.0).collect::<Vec<_>>()), mean(&outside));
    println!("disagreement where the spoiled view looks {raised:.4}, elsewhere {rest:.4}");
    assert!(raised > 8.0 * rest, "{raised} {rest}");
    let grown = inside.iter().filter(|pair| pair.1 > 2.0).count();
    // In the shadow of the ball and at silhouettes there is little light to disagree about.
    assert!(grown * 10 > inside.len() * 7, "{grown} of {}", inside.len());

    let error = |layers: &SurfaceLayers, view: usize| layers.views[view].rmse;
    assert!(error(&spoiled, SPOILED) > 5.0 * error(&fair, SPOILED));
    assert!((spoiled.views[SPOILED].exposure_stops - 1.0).abs() < 0.1, "{:?}", spoiled.views[SPOILED]);
    assert!(spoiled.views[SPOILED].aligned_rmse < 0.5 * error(&spoiled, SPOILED));
    for view in (0..6).filter(|&view| view != SPOILED) {
        assert_eq!(spoiled.views[view], fair.views[view]);
        assert!(spoiled.views[view].exposure_stops.abs() < 0.05);
    }
}

#[test]
fn the_error_of_a_photo_that_is_off_by_a_known_factor_is_that_factor() {
    let trial = trial();
    let mut scene = trial.photographed();
    for view in 0..scene.views.len() {
        let photo = scene.views[view].photo.to_linear();
        scene.set_photo(view, photo.map(|&radiance| radiance * 1.5)).unwrap();
    }
    let keep = LayerSettings { keep_pictures: true, ..settings() };
    let off = layers(&trial, &scene, &keep);
    let levelled = layers(&trial, &scene, &LayerSettings { gains: vec![1.5; 6], ..keep.clone() });
    let (mut errors, mut squares, mut left) = (0.0, 0.0, 0.0);
    for (texel, &error) in off.photo_error.pixels().iter().enumerate() {
        if error.is_finite() {
            errors += error * error;
            left += levelled.photo_error.pixels()[texel].powi(2);
            squares += 1.0;
        }
    }
    // The model is two thirds of the photo: the error is a third of the photo's radiance, here by RMS over views.
    let (mut photo_squared, mut count) = (0.0, 0.0);
    for pictures in &off.pictures {
        for (photo, model) in pictures.photo.pixels().iter().zip(pictures.model.pixels()) {
            if model.max_element() > 0.0 {
                photo_squared += f64::from((*photo / 3.0).length_squared()) / 3.0;
                count += 1.0;
            }
        }
    }
    let (by_texel, by_pixel) = ((errors / squares).sqrt(), (photo_squared / count).sqrt() as f32);
    assert!((by_texel / by_pixel - 1.0).abs() < 0.3, "{by_texel} {by_pixel}");
    // What is left is the noise of the photos, of 32 paths a pixel.
    let left = (left / squares).sqrt();
    println!("photo error {by_texel:.4} by texel, {by_pixel:.4} by pixel; {left:.4} with the right gains");
    assert!(left < 0.4 * by_texel, "{left} {by_texel}");
    assert_eq!(off.pictures.len(), 6);
}

#[test]
fn unseen_texels_are_nan_and_who_has_no_part_changes_nothing() {
    let trial = trial();
    let mut scene = trial.photographed();
    scene.views[1].held_out = true;
    let few = LayerSettings { excluded: vec![false, false, false, true], ..settings() };
    let base = layers(&trial, &scene, &few);
    for (texel, &times) in base.times_seen.pixels().iter().enumerate() {
        let (coverage, error) = (base.coverage.pixels()[texel], base.photo_error.pixels()[texel]);
        if times == 0.0 {
            assert!(coverage.is_nan() && error.is_nan() && base.disagreement.pixels()[texel].is_nan());
        } else {
            assert_eq!(coverage, times / 4.0);
        }
    }
    assert!(base.times_seen.pixels().contains(&0.0), "texels between charts");
    for view in [1, 3] {
        let photo = scene.views[view].photo.to_linear();
        scene.set_photo(view, photo.map(|&radiance| radiance * 3.0)).unwrap();
    }
    let changed = layers(&trial, &scene, &few);
    let bits = |layers: &SurfaceLayers| layers.photo_error.map(|value| value.to_bits());
    assert_eq!(bits(&base), bits(&changed));
    assert!(changed.views[1].held_out && changed.views[1].rmse > 2.0 * base.views[1].rmse);

    // Clipped pixels see, but do not judge.
    for view in [0, 2, 4, 5] {
        scene.views[view].states = scene.views[view].states.map(|_| PixelState::SurfaceClipped);
    }
    let clipped = layers(&trial, &scene, &few);
    assert_eq!(clipped.times_seen, base.times_seen);
    assert!(clipped.photo_error.pixels().iter().all(|error| error.is_nan()));
    assert_eq!((clipped.views[0].pixels, clipped.views[0].clipped_share), (0, 1.0));
}

#[test]
fn layers_do_not_depend_on_threads_and_can_be_stopped() {
    let trial = trial();
    let scene = trial.photographed();
    let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    // Photos of 24 x 24 pixels are halved.
    let small = LayerSettings { most_pixels: 200, ..settings() };
    let run = |threads: usize| pool(threads).install(|| layers(&trial, &scene, &small));
    let (one, three) = (run(1), run(3));
    assert_eq!(one.disagreement.map(|value| value.to_bits()), three.disagreement.map(|value| value.to_bits()));
    assert_eq!(one.views, three.views);
    assert!(one.views[0].pixels < 144);

    let stop = AtomicBool::new(false);
    let told = RefCell::new(Vec::new());
    let error = surface_layers(&scene, &trial.surface(), &trial.truth(), &small, &stop, &|share| {
        told.borrow_mut().push(share);
        stop.store(true, std::sync::atomic::Ordering::Relaxed);
    });
    assert_eq!(error.unwrap_err().kind(), ErrorKind::Stopped);
    assert_eq!(told.borrow().len(), 1);
}
