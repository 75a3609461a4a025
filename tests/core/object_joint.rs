//! Estimation of light and reflectance from one photo: what it reaches, what it refuses, what it survives.

#![allow(clippy::unwrap_used)]

use super::object_scene;

use glam::Vec3;
use object_scene::*;
use patina::ErrorKind;
use patina::image::Image;
use patina::measured::analytic::{LambertLobes, LobeKind};
use patina::measured::coordinates::HalfDifference;
use patina::measured::model::ReflectanceModel;
use patina::object::joint::{Estimate, Known, estimate};
use patina::object::nodes::NodeGrid;
use patina::object::observations::ObjectView;
use patina::object::picture::{log_errors, render};
use patina::object::prior::LightPriorKind;
use patina::object::progress::ObjectEvent;
use patina::object::settings::{LightMethod, ObjectSettings};
use patina::object::starts::StartedModel;
use patina::object::transport::TexelDirections;
use patina::object::{ObjectGeometry, ObjectPhoto};
use patina::scene::Camera;
use std::sync::atomic::{AtomicBool, Ordering};

fn run(
    views: &[ObjectView],
    model: &StartedModel,
    known: &Known,
    settings: &ObjectSettings,
) -> patina::Result<Estimate> {
    estimate(views, model, known, settings, &AtomicBool::new(false), &|_| {})
}

#[test]
fn both_are_found_so_that_the_object_can_be_relit() {
    let geometry = ObjectGeometry::sphere(48, 48, 24.0);
    let view = view_of(&geometry, photograph(&geometry, &sky()));
    let model = StartedModel::lobes(LobeKind::CookTorrance);
    let settings = ObjectSettings { prior: LightPriorKind::Gradient, ..small() };
    let found = run(std::slice::from_ref(&view), &model, &Known::default(), &settings).unwrap();
    assert!(found.picture_log_rmse < 0.05, "{}", found.picture_log_rmse);
    // Under a light turned by a quarter, after the factor per channel that no photo tells.
    let turned = sky().rotated_about_up(std::f32::consts::FRAC_PI_2);
    let truth = photograph(&geometry, &turned);
    let directions = TexelDirections::new(64, 32).unwrap();
    let grid = NodeGrid::new(settings.nodes);
    let relit = render(&geometry, None, &directions, &grid, &found.table, &[&turned]).swap_remove(0);
    let (_, aligned) = log_errors(&geometry, &relit, &truth, 1e-3);
    assert!(aligned < 0.2, "{aligned}");
    // While the same priors hold, which is from the first step with colours on, the objective never rises.
    let steps: Vec<_> = found.rows.iter().filter(|row| row.round >= 2).collect();
    assert!(steps.len() >= 4, "{}", steps.len());
    for pair in steps.windows(2) {
        let [before, after] = [pair[0], pair[1]].map(|row| row.total());
        assert!(after <= before + 1e-9 * before.abs(), "{:?} {before} to {:?} {after}", pair[0], pair[1]);
    }
    assert!(steps.last().unwrap().total() < steps[0].total());
    assert!(found.rows.iter().all(|row| row.total().is_finite() && row.not_finite == 0));
    assert!(!found.candidates.is_empty() && found.candidates.windows(2).all(|c| c[0].evidence <= c[1].evidence));
}

#[test]
fn with_a_net_that_is_cold_and_a_noisy_photo_the_objective_never_rises_either() {
    let geometry = ObjectGeometry::sphere(48, 48, 24.0);
    let mut number = 0u32;
    // Noise of a tenth: what the net cannot follow.
    let noisy = photograph(&geometry, &sky()).map(|pixel| {
        number = number.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        *pixel * (0.9 + 0.2 * (number >> 8) as f32 / (1u32 << 24) as f32)
    });
    let view = view_of(&geometry, noisy);
    let model = StartedModel::lobes(LobeKind::Ward);
    for seed in 1..=3 {
        let settings = ObjectSettings { prior: LightPriorKind::Deep, net_steps: 4, net_rate: 0.05, seed, ..small() };
        let found = run(std::slice::from_ref(&view), &model, &Known::default(), &settings).unwrap();
        let steps: Vec<_> = found.rows.iter().filter(|row| row.round > settings.grey_loops).collect();
        assert!(steps.len() >= 3, "{}", steps.len());
        for pair in steps.windows(2) {
            let [before, after] = [pair[0], pair[1]].map(|row| row.total());
            // A round that was taken back is told by the other matrix: the same but for rounding.
            assert!(after <= before + 1e-5 * before.abs(), "{:?} {before} to {:?} {after}", pair[0], pair[1]);
        }
    }
}

#[test]
fn a_known_light_gives_the_reflectance_back() {
    let geometry = ObjectGeometry::sphere(48, 48, 24.0);
    let view = view_of(&geometry, photograph(&geometry, &sky()));
    let model = StartedModel::lobes(LobeKind::Ggx);
    let known = Known { light: Some(sky()), ..Known::default() };
    let settings = ObjectSettings { light_height: 32, nodes: [28, 15, 8], ..small() };
    let found = run(&[view], &model, &known, &settings).unwrap();
    // Diffuse colours and width of the lobe; strength and Fresnel trade.
    let (_, truth) = truth_model();
    for index in [0, 1, 2, 6] {
        assert!((found.parameters[index] - truth[index]).abs() < 0.15, "{index}: {:?}", found.parameters);
    }
}

#[test]
fn priors_beat_no_prior_and_both_ways_descend() {
    let geometry = ObjectGeometry::sphere(48, 48, 24.0);
    let view = view_of(&geometry, photograph(&geometry, &sky()));
    let (model, known) = known_truth();
    let of = |prior, method, light_steps| {
        let settings = ObjectSettings { prior, method, light_steps, net_steps: 25, ..small() };
        run(std::slice::from_ref(&view), &model, &known, &settings).unwrap()
    };
    let none = of(LightPriorKind::None, LightMethod::ClosedForm, 3);
    let gradient = of(LightPriorKind::Gradient, LightMethod::ClosedForm, 3);
    let deep = of(LightPriorKind::Deep, LightMethod::ClosedForm, 6);
    let first_order = of(LightPriorKind::Deep, LightMethod::FirstOrder, 40);
    let errors = [&none, &gradient, &deep, &first_order].map(light_error);
    println!("log error of the light: none, gradient, deep, first order: {errors:?}");
    assert!(errors[1] < 0.8 * errors[0] && errors[2] < errors[0], "{errors:?}");
    assert!(none.picture_log_rmse < 0.02 && gradient.picture_log_rmse < 0.05);
    let data = |found: &Estimate| (found.rows[0].data, found.rows.last().unwrap().data);
    for found in [&none, &first_order] {
        let (first, last) = data(found);
        assert!(last < first, "{first} {last}");
    }
}

#[test]
fn shadows_matter_where_there_are_some() {
    let mesh = floor_and_wall();
    let camera = Camera::looking_at(Vec3::new(-6.0, 7.0, 3.0), Vec3::new(-0.7, 0.3, 0.0), 48, 48, 0.6);
    let geometry = ObjectGeometry::of_mesh(&mesh, &camera).unwrap();
    let view = view_of(&geometry, photograph(&geometry, &sky()));
    let (model, known) = known_truth();
    let of = |shadows| {
        let settings = ObjectSettings { shadows, prior: LightPriorKind::Gradient, ..small() };
        let found = run(std::slice::from_ref(&view), &model, &known, &settings).unwrap();
        (found.picture_log_rmse, light_error(&found))
    };
    let (with, without) = (of(true), of(false));
    assert!(with.0 < 0.6 * without.0 && with.1 < without.1, "{with:?} {without:?}");
}

#[test]
fn the_same_bits_whatever_the_number_of_threads() {
    let geometry = ObjectGeometry::sphere(32, 32, 16.0);
    let view = view_of(&geometry, photograph(&geometry, &sky()));
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let settings = ObjectSettings { outer_loops: 2, followed: 1, pixels: 200, ..small() };
            let model = StartedModel::lobes(LobeKind::Ward);
            let found = run(std::slice::from_ref(&view), &model, &Known::default(), &settings).unwrap();
            (found.parameters, found.light)
        })
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn saturated_and_black_pixels_bound_and_do_not_break() {
    let geometry = ObjectGeometry::sphere(48, 48, 24.0);
    let picture = photograph(&geometry, &sky());
    let mut levels: Vec<f32> = picture.pixels().iter().map(|pixel| pixel.max_element()).collect();
    levels.sort_by(f32::total_cmp);
    let photo = ObjectPhoto::new("photo", picture.clone(), f32::INFINITY, 0.0).unwrap().0;
    // A fifth of the object is saturated.
    let photo = photo.as_bytes(1.0 / levels[levels.len() * 84 / 100]);
    let view = ObjectView::new(photo, geometry.clone()).unwrap();
    let (model, known) = known_truth();
    let settings = ObjectSettings { prior: LightPriorKind::Gradient, ..small() };
    let found = run(&[view], &model, &known, &settings).unwrap();
    assert!(found.findings.iter().any(|finding| finding.code == "photo-saturated"));
    let directions = TexelDirections::new(32, 16).unwrap();
    let light = found.light.environment();
    let grid = NodeGrid::new(settings.nodes);
    let own = render(&geometry, None, &directions, &grid, &found.table, &[&light]).swap_remove(0);
    // Where the photo was cut the light still makes it at least as bright.
    let cut = levels[levels.len() * 84 / 100];
    let bright: Vec<(f32, f32)> = picture
        .pixels()
        .iter()
        .zip(own.pixels())
        .filter(|(truth, _)| truth.max_element() > 1.3 * cut)
        .map(|(truth, own)| (truth.max_element(), own.max_element()))
        .collect();
    assert!(!bright.is_empty() && bright.iter().all(|(_, own)| *own > 0.85 * cut), "{bright:?}");
}

#[test]
fn what_cannot_be_estimated_is_refused_in_words() {
    let geometry = ObjectGeometry::sphere(32, 32, 16.0);
    let picture = photograph(&geometry, &sky());
    let model = StartedModel::lobes(LobeKind::Ggx);
    let mut photo = ObjectPhoto::new("photo", picture.clone(), f32::INFINITY, 0.0).unwrap().0;
    let three = Image::from_fn(32, 32, |row, column| if row == 16 && (15..18).contains(&column) { 1.0 } else { 0.0 });
    photo.apply_mask(&three, patina::Place::View("mask".into())).unwrap();
    let view = ObjectView::new(photo, geometry.clone()).unwrap();
    let error = run(&[view], &model, &Known::default(), &small()).unwrap_err();
    assert!(error.kind() == ErrorKind::InvalidScene && error.message().contains("3 pixels"), "{error}");

    let view = view_of(&geometry, picture.clone());
    let both = Known { light: Some(sky()), reflectance: Some(model.model.start()), ..Known::default() };
    let error = run(std::slice::from_ref(&view), &model, &both, &small()).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::InvalidSetting);
    let error =
        run(std::slice::from_ref(&view), &model, &Known::default(), &ObjectSettings { light_height: 3, ..small() });
    assert_eq!(error.unwrap_err().kind(), ErrorKind::InvalidSetting);
    let other = ObjectPhoto::new("photo", Image::filled(8, 8, Vec3::ONE), f32::INFINITY, 0.0).unwrap().0;
    assert!(ObjectView::new(other, geometry).unwrap_err().message().contains("8 x 8"));
}

#[test]
fn a_stop_ends_the_work_and_is_said() {
    let geometry = ObjectGeometry::sphere(32, 32, 16.0);
    let view = view_of(&geometry, photograph(&geometry, &sky()));
    let stop = AtomicBool::new(false);
    let model = StartedModel::lobes(LobeKind::Ggx);
    let watch = |event: ObjectEvent| {
        if matches!(event, ObjectEvent::State { .. }) {
            stop.store(true, Ordering::Relaxed);
        }
    };
    let settings = ObjectSettings { followed: 1, pixels: 200, ..small() };
    let error = estimate(&[view], &model, &Known::default(), &settings, &stop, &watch).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Stopped);
}

/// A model that gives NaN at some angles.
struct Broken(LambertLobes);

impl ReflectanceModel for Broken {
    fn name(&self) -> &str {
        "broken"
    }
    fn parameter_count(&self) -> usize {
        self.0.parameter_count()
    }
    fn start(&self) -> Vec<f64> {
        self.0.start()
    }
    fn evaluate(&self, parameters: &[f64], at: &[HalfDifference], values: &mut [[f64; 3]]) {
        self.0.evaluate(parameters, at, values);
        for (value, point) in values.iter_mut().zip(at) {
            if point.theta_half > 1.2 && point.theta_difference > 0.2 {
                value[1] = f64::NAN;
            }
        }
    }
    fn pull_back(&self, parameters: &[f64], at: &[HalfDifference], adjoint: &[[f64; 3]], gradient: &mut [f64]) {
        self.0.pull_back(parameters, at, adjoint, gradient);
        gradient[0] = f64::NAN;
    }
}

#[test]
fn numbers_that_are_not_finite_are_counted_and_left_out() {
    let geometry = ObjectGeometry::sphere(32, 32, 16.0);
    let view = view_of(&geometry, photograph(&geometry, &sky()));
    let lobes = StartedModel::lobes(LobeKind::Ggx);
    let model = StartedModel {
        model: Box::new(Broken(LambertLobes::new(LobeKind::Ggx, 1))),
        starts: lobes.starts[..2].to_vec(),
        prior: lobes.prior.clone(),
    };
    let settings = ObjectSettings { outer_loops: 2, prior: LightPriorKind::Gradient, ..small() };
    let found = run(&[view], &model, &Known::default(), &settings).unwrap();
    assert!(found.findings.iter().any(|finding| finding.code == "object-not-finite"));
    assert!(found.parameters.iter().all(|value| value.is_finite()));
    assert!(found.light.channels.iter().flatten().all(|value| value.is_finite()));
}
