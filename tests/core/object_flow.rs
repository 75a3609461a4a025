//! Estimation with the neural model that ships, from several photos, and from photos with black pixels.

#![allow(clippy::unwrap_used)]

use super::object_scene;

use glam::Vec3;
use object_scene::*;
use patina::measured::analytic::LobeKind;
use patina::object::joint::{Estimate, Known, estimate};
use patina::object::observations::ObjectView;
use patina::object::picture::log_errors;
use patina::object::prior::LightPriorKind;
use patina::object::settings::ObjectSettings;
use patina::object::starts::StartedModel;
use patina::object::{ObjectGeometry, ObjectPhoto};
use patina::scene::Camera;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

fn found(views: &[ObjectView], model: &StartedModel, known: &Known, settings: &ObjectSettings) -> Estimate {
    estimate(views, model, known, settings, &AtomicBool::new(false), &|_| {}).unwrap()
}

#[test]
fn the_neural_model_explains_a_plastic_that_it_never_saw() {
    let geometry = ObjectGeometry::sphere(40, 40, 20.0);
    let view = view_of(&geometry, photograph(&geometry, &sky()));
    let trained = Arc::new(patina::neural::shipped().unwrap());
    let settings = small();
    let mut model = StartedModel::neural(trained, 2, settings.code_weight, &[]);
    model.starts.retain(|start| ["red-plastic", "cherry-235", "light-brown-fabric"].contains(&start.name.as_str()));
    assert_eq!(model.starts.len(), 3);
    let known = Known { light: Some(sky()), ..Known::default() };
    let estimate = found(&[view], &model, &known, &settings);

    // Codes stay in the ball, and what they cost is counted.
    let codes = 2 * 3 * 16;
    for code in estimate.parameters[..codes].chunks(16) {
        let length = code.iter().map(|value| value * value).sum::<f64>().sqrt();
        assert!(length <= 1.01 + 1e-6, "{length}");
    }
    let last = estimate.rows.last().unwrap();
    assert!(last.code_prior > 0.0 && last.code_prior.is_finite(), "{last:?}");
    assert!(last.total() < estimate.rows[0].total());

    // Under a light that it was not fitted to, it is nearer to the truth than what it began from.
    let turned = sky().rotated_about_up(std::f32::consts::FRAC_PI_2);
    let wanted = photograph(&geometry, &turned);
    let error =
        |own: &[f64]| log_errors(&geometry, &photograph_of(&geometry, &turned, &*model.model, own), &wanted, 1e-3).0;
    let begun = model.starts.iter().find(|start| start.name == estimate.start).unwrap();
    let (before, after) = (error(&begun.parameters), error(&estimate.parameters));
    println!("picture {}, relit {after}, at its start {before}", estimate.picture_log_rmse);
    assert!(estimate.picture_log_rmse < 0.1, "{}", estimate.picture_log_rmse);
    assert!(after < 0.5 * before && after < 0.3, "{after} of {before}");
}

#[test]
fn the_schedule_that_was_released_descends() {
    let geometry = ObjectGeometry::sphere(32, 32, 16.0);
    let view = view_of(&geometry, photograph(&geometry, &sky()));
    let settings = ObjectSettings {
        outer_loops: 2,
        grey_loops: 2,
        light_steps: 20,
        reflectance_steps: 4,
        net_rate: 0.01,
        followed: 1,
        light_height: 16,
        pixels: 200,
        nodes: [20, 10, 6],
        net_channels: 8,
        ..ObjectSettings::released()
    };
    let estimate = found(&[view], &StartedModel::lobes(LobeKind::CookTorrance), &Known::default(), &settings);
    assert!(estimate.light.channels.iter().flatten().chain([&0.0]).all(|value| value.is_finite()));
    assert!(estimate.rows.iter().all(|row| row.total().is_finite() && row.not_finite == 0));
    let data: Vec<f64> = estimate.rows.iter().map(|row| row.data).collect();
    // The first row is that of the start under the light it was tried with, which the net does not take over.
    assert!(data.len() > 2 && *data.last().unwrap() < 0.6 * data[1], "{data:?}");
}

#[test]
fn two_photos_know_the_light_no_worse_than_one() {
    // The second camera sees it from the other end.
    let mesh = floor_and_wall();
    let views: Vec<ObjectView> = [3.0, -5.0]
        .into_iter()
        .map(|z| {
            let camera = Camera::looking_at(Vec3::new(-6.0, 7.0, z), Vec3::new(-0.7, 0.3, 0.0), 40, 40, 0.6);
            let geometry = ObjectGeometry::of_mesh(&mesh, &camera).unwrap();
            view_of(&geometry, photograph(&geometry, &sky()))
        })
        .collect();
    let (model, known) = known_truth();
    let settings = ObjectSettings { prior: LightPriorKind::Gradient, pixels: 800, ..small() };
    let one = found(&views[..1], &model, &known, &settings);
    let two = found(&views, &model, &known, &settings);
    let errors = [light_error(&one), light_error(&two)];
    println!("log error of the light by one photo and by two: {errors:?}");
    assert!(errors[1] < 1.05 * errors[0], "{errors:?}");
    assert!(two.picture_log_rmse < 0.1, "{}", two.picture_log_rmse);
    assert_ne!(one.light, two.light, "the second photo says nothing");
}

#[test]
fn black_pixels_are_told_and_hardly_move_the_light() {
    let geometry = ObjectGeometry::sphere(40, 40, 20.0);
    let whole = photograph(&geometry, &sky());
    let mut spoilt = whole.clone();
    for pixel in geometry.pixels.iter().step_by(20) {
        spoilt[(pixel.row as usize, pixel.column as usize)] = Vec3::ZERO;
    }
    let (model, known) = known_truth();
    let settings = ObjectSettings { prior: LightPriorKind::Gradient, pixels: 1000, ..small() };
    let sound = found(&[view_of(&geometry, whole.clone())], &model, &known, &settings);
    assert!(sound.findings.iter().all(|finding| finding.code != "photo-black"));
    let brightest = whole.pixels().iter().map(|pixel| pixel.max_element()).fold(0.0, f32::max);
    let photo = ObjectPhoto::new("photo", spoilt.clone(), f32::INFINITY, 0.0).unwrap().0;
    let bytes = ObjectView::new(photo.as_bytes(1.0 / brightest), geometry.clone()).unwrap();
    for view in [view_of(&geometry, spoilt), bytes] {
        let hurt = found(&[view], &model, &known, &settings);
        assert!(hurt.findings.iter().any(|finding| finding.code == "photo-black"), "{:?}", hurt.findings);
        assert!(hurt.light.channels.iter().flatten().all(|value| value.is_finite()));
        let errors = [light_error(&sound), light_error(&hurt)];
        println!("log error of the light without and with black pixels: {errors:?}");
        assert!(errors[1] < errors[0] + 0.3, "{errors:?}");
    }
}
