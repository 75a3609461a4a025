//! Estimation with the neural model, from two photos, and from photos in which pixels are black.

#![allow(clippy::unwrap_used)]

use glam::Vec3;
use patina::image::{Image, RgbImage, file};
use patina::insight::truth::{EnvironmentErrors, environment_errors};
use patina::light::Environment;
use patina::measured::MeasuredBrdf;
use patina::measured::analytic::{LambertLobes, LobeKind};
use patina::measured::coordinates::HalfDifference;
use patina::measured::model::ReflectanceModel;
use patina::neural::architecture::CODE;
use patina::object::joint::{Estimate, Known, estimate};
use patina::object::nodes::NodeGrid;
use patina::object::observations::{ObjectView, Observations};
use patina::object::picture::{log_errors, render, render_exact};
use patina::object::prior::LightPriorKind;
use patina::object::progress::StepKind;
use patina::object::reflectance_step::ParameterPrior;
use patina::object::result_folder;
use patina::object::result_read::ObjectInputs;
use patina::object::settings::ObjectSettings;
use patina::object::starts::{Start, StartedModel};
use patina::object::transport::TexelDirections;
use patina::object::{ObjectGeometry, ObjectPhoto};
use patina::scene::{Camera, Mesh};
use std::f32::consts::{FRAC_PI_2, PI, TAU};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

fn small() -> ObjectSettings {
    ObjectSettings {
        light_height: 16,
        pixels: 400,
        nodes: [20, 10, 6],
        outer_loops: 4,
        grey_loops: 1,
        net_channels: 8,
        net_steps: 10,
        followed: 1,
        ..ObjectSettings::default()
    }
}

/// A sky with a sun over a floor, four times as fine as the light that is fitted.
fn sky() -> Environment {
    let radiance = Image::from_fn(64, 32, |row, column| {
        let sun = (-((row as f32 - 9.0).powi(2) + (column as f32 - 40.0).powi(2)) / 6.0).exp();
        let base = if row < 16 { Vec3::new(0.5, 0.7, 1.0) } else { Vec3::new(0.25, 0.2, 0.15) };
        base + sun * Vec3::new(30.0, 27.0, 22.0)
    });
    Environment { radiance }
}

/// A red plastic under clear lacquer, by no model that is fitted here.
fn plastic(at: HalfDifference) -> [f64; 3] {
    let fresnel = 0.04 + 0.96 * (1.0 - at.theta_difference.cos()).powi(5);
    let lacquer = 20.0 * fresnel * (-(at.theta_half / 0.15).powi(2)).exp();
    [0.12 + lacquer, 0.03 + lacquer, 0.008 + lacquer]
}

/// Reflectance in 1/sr.
type Reflectance<'a> = dyn Fn(HalfDifference) -> [f64; 3] + Sync + 'a;

fn photograph(geometry: &ObjectGeometry, light: &Environment, reflectance: &Reflectance) -> RgbImage {
    let directions = TexelDirections::of_any_size(light.width(), light.height());
    let visibility = geometry.visibility(&geometry.pixels, light.width(), light.height());
    let evaluate = |at: &[HalfDifference], values: &mut [[f64; 3]]| {
        values.iter_mut().zip(at).for_each(|(value, at)| *value = reflectance(*at));
    };
    render_exact(geometry, visibility.as_ref(), &directions, &evaluate, &[light]).swap_remove(0)
}

fn photo_of(picture: RgbImage) -> ObjectPhoto {
    ObjectPhoto::new("photo", picture, f32::INFINITY, 0.0).unwrap().0
}

fn found(views: &[ObjectView], model: &StartedModel, known: &Known, settings: &ObjectSettings) -> Estimate {
    estimate(views, model, known, settings, &AtomicBool::new(false), &|_| {}).unwrap()
}

fn light_errors(found: &Estimate) -> EnvironmentErrors {
    let light = found.light.environment();
    environment_errors(&light, &sky().resampled(light.width(), light.height())).unwrap()
}

#[test]
fn the_neural_model_explains_a_measured_sphere() {
    let geometry = ObjectGeometry::sphere(40, 40, 20.0);
    let table = MeasuredBrdf::from_fn(plastic);
    let measured = |at: HalfDifference| table.lookup(at).unwrap_or_default();
    let view = ObjectView::new(photo_of(photograph(&geometry, &sky(), &measured)), geometry.clone()).unwrap();
    let weight = 1e-5;
    let mut model = StartedModel::neural(Arc::new(patina::neural::shipped().unwrap()), 2, weight, &[]);
    // None is of the right colours, one is glossy as the sphere is, one shines in another way, one not at all.
    let kept = ["gray-plastic", "green-metallic-paint", "white-fabric"];
    model.starts.retain(|start| kept.contains(&start.name.as_str()));
    assert_eq!(model.starts.len(), kept.len());
    let settings = ObjectSettings { prior: LightPriorKind::Deep, code_weight: weight, ..small() };
    let found = found(&[view], &model, &Known::default(), &settings);
    assert!(found.picture_log_rmse < 0.1, "{}", found.picture_log_rmse);

    // Two lobes of three codes each, then the colours: all codes in the ball.
    let (codes, colours) = found.parameters.split_at(2 * 3 * CODE);
    assert_eq!(colours.len(), 2 * 3);
    assert!(found.parameters.iter().all(|value| value.is_finite()));
    for code in codes.chunks(CODE) {
        let length = code.iter().map(|value| value * value).sum::<f64>().sqrt();
        assert!(length <= 1.01 + 1e-6, "{length}");
    }

    // What the codes cost is what was said of it, and a part of the objective.
    let expected = weight * codes.iter().map(|value| value * value).sum::<f64>();
    let last = found.rows.iter().rfind(|row| row.kind == StepKind::Reflectance).unwrap();
    assert!(expected > 0.0 && (last.code_prior - expected).abs() < 1e-6 * expected, "{last:?} for {expected}");
    assert!(last.total() > last.data + last.light_prior);
    assert!(last.light_prior != 0.0 && last.total().is_finite());

    // Under a light that it was not fitted to, up to the factor per channel that no photo tells.
    let turned = sky().rotated_about_up(FRAC_PI_2);
    let truth = photograph(&geometry, &turned, &measured);
    let (directions, grid) = (TexelDirections::new(64, 32).unwrap(), NodeGrid::fine());
    let relit_error = |parameters: &[f64]| {
        let table = grid.tabulate(model.model.as_ref(), parameters);
        let relit = render(&geometry, None, &directions, &grid, &table, &[&turned]).swap_remove(0);
        log_errors(&geometry, &relit, &truth, 1e-3).1
    };
    let start = model.starts.iter().find(|start| start.name == found.start).unwrap();
    let (before, after) = (relit_error(&start.parameters), relit_error(&found.parameters));
    println!("picture {:.3}; relit {after:.3}, its start {} {before:.3}", found.picture_log_rmse, start.name);
    assert!(after < before, "{after} is no nearer than {before} of {}", start.name);
}

/// A sphere of triangles with normals of the sphere.
fn round_mesh() -> Mesh {
    let (rows, columns) = (24usize, 48usize);
    let mut positions = Vec::new();
    for row in 0..=rows {
        for column in 0..columns {
            let (polar, turn) = (PI * row as f32 / rows as f32, TAU * column as f32 / columns as f32);
            positions.push(Vec3::new(polar.sin() * turn.cos(), polar.cos(), polar.sin() * turn.sin()));
        }
    }
    let vertex = |row: usize, column: usize| (row * columns + column % columns) as u32;
    let mut triangles = Vec::new();
    for row in 0..rows {
        for column in 0..columns {
            let (here, beside) = (vertex(row, column), vertex(row, column + 1));
            let (below, across) = (vertex(row + 1, column), vertex(row + 1, column + 1));
            // At the poles one half of each quad has no area.
            if row > 0 {
                triangles.push([here, beside, below]);
            }
            if row + 1 < rows {
                triangles.push([beside, across, below]);
            }
        }
    }
    Mesh { normals: positions.clone(), positions, triangles, ..Mesh::default() }
}

#[test]
fn two_photos_are_both_explained_and_know_the_light_no_worse_than_one() {
    let mesh = round_mesh();
    let views: Vec<ObjectView> = [Vec3::new(0.0, 0.0, 6.0), Vec3::new(5.0, 2.0, -3.0)]
        .into_iter()
        .map(|eye| {
            let camera = Camera::looking_at(eye, Vec3::ZERO, 28, 28, 0.36);
            let geometry = ObjectGeometry::of_mesh(&mesh, &camera).unwrap();
            ObjectView::new(photo_of(photograph(&geometry, &sky(), &plastic)), geometry).unwrap()
        })
        .collect();
    let settings = ObjectSettings { prior: LightPriorKind::Gradient, pixels: 1200, ..small() };
    // All pixels of both are taken, each with its own shadows.
    let size = settings.light_size();
    let gathered = Observations::gather(&views, settings.pixels, size, true, settings.seed).unwrap().0;
    let [first, second] = [&views[0], &views[1]].map(|view| view.geometry.pixels.len());
    assert!(first > 300 && second > 300 && gathered.pixels.len() == first + second, "{first} {second}");
    let (joined, alone) = (
        gathered.visibility.unwrap(),
        views[1].geometry.visibility(&views[1].geometry.pixels, size.0, size.1).unwrap(),
    );
    assert_eq!(joined.of(&[first, first + second - 1]), alone.of(&[0, second - 1]));

    let mut model = StartedModel::lobes(LobeKind::Ggx);
    model.starts.retain(|start| ["glossy plastic", "satin plastic", "polished plastic"].contains(&start.name.as_str()));
    assert_eq!(model.starts.len(), 3);
    let one = found(&views[..1], &model, &Known::default(), &settings);
    let two = found(&views, &model, &Known::default(), &settings);
    let errors = [&one, &two].map(|found| light_errors(found).log_rmse.aligned);
    println!("log error of the light by one photo and by two: {errors:?}");
    assert!(errors[1] < 1.1 * errors[0], "{errors:?}");

    // Both come out again.
    let folder = tempfile::tempdir().unwrap();
    result_folder::prepare(folder.path()).unwrap();
    result_folder::write(folder.path(), &views, &model, &two, &settings, &ObjectInputs::default(), &[]).unwrap();
    let error_of = |index: usize, picture: &RgbImage| {
        log_errors(&views[index].geometry, picture, &views[index].photo.radiance, 1e-3).0
    };
    let [front, side] = [0, 1]
        .map(|index| error_of(index, &file::read_rgb(&folder.path().join(format!("rerender_{index}.exr"))).unwrap()));
    assert!(front < 0.2 && side < 0.2, "{front} {side}");
    assert!(!folder.path().join("rerender_2.exr").exists());
    // The estimate by the first photo alone knows less of the second.
    let directions = TexelDirections::new(size.0, size.1).unwrap();
    let (grid, light) = (NodeGrid::new(settings.nodes), one.light.environment());
    let guessed = render(&views[1].geometry, Some(&alone), &directions, &grid, &one.table, &[&light]).swap_remove(0);
    let guess = error_of(1, &guessed);
    println!("pictures again {front:.3} {side:.3}, the second by the first alone {guess:.3}");
    assert!(side < guess, "{side} {guess}");
}

#[test]
fn black_pixels_are_told_and_move_the_light_by_little() {
    let geometry = ObjectGeometry::sphere(40, 40, 20.0);
    let lobes = LambertLobes::new(LobeKind::Ggx, 1);
    let parameters: Vec<f64> =
        [0.3f64, 0.12, 0.06].iter().map(|v| v.ln()).chain([0.5f64.ln(); 3]).chain([0.11f64.ln(), -2.6]).collect();
    let reflectance = |at: HalfDifference| {
        let mut value = [[0.0; 3]];
        lobes.evaluate(&parameters, &[at], &mut value);
        value[0]
    };
    let whole = photograph(&geometry, &sky(), &reflectance);
    let mut spoilt = whole.clone();
    let mut zeros = 0;
    for pixel in geometry.pixels.iter().step_by(10) {
        spoilt[(pixel.row as usize, pixel.column as usize)] = Vec3::ZERO;
        zeros += 1;
    }
    let model = StartedModel {
        model: Box::new(LambertLobes::new(LobeKind::Ggx, 1)),
        starts: vec![Start { name: "truth".into(), parameters: parameters.clone() }],
        prior: ParameterPrior::none(parameters.len()),
    };
    let known = Known { reflectance: Some(parameters.clone()), light: None };
    // All pixels are used, so that all black ones are met.
    let pixels = geometry.pixels.len();
    let settings = ObjectSettings { prior: LightPriorKind::Gradient, pixels, ..small() };
    let estimated =
        |photo: ObjectPhoto| found(&[ObjectView::new(photo, geometry.clone()).unwrap()], &model, &known, &settings);
    let brightest = whole.pixels().iter().map(|pixel| pixel.max_element()).fold(0.0, f32::max);
    let (whole, spoilt) = (photo_of(whole), photo_of(spoilt));
    let pairs = [
        ("float", whole.clone(), spoilt.clone()),
        ("8-bit", whole.as_bytes(1.0 / brightest), spoilt.as_bytes(1.0 / brightest)),
    ];
    for (kind, whole, spoilt) in pairs {
        let (sound, hurt) = (estimated(whole), estimated(spoilt));
        assert!(sound.findings.iter().all(|finding| finding.code != "photo-black"), "{kind}");
        let told = hurt.findings.iter().find(|finding| finding.code == "photo-black").unwrap();
        assert!(told.message.starts_with(&format!("{zeros} of {pixels} pixels are black")), "{kind}: {}", told.message);
        assert!(hurt.findings.iter().all(|finding| finding.code != "object-not-finite"), "{kind}");
        assert!(hurt.light.channels.iter().flatten().all(|value| value.is_finite()), "{kind}");
        assert!(hurt.picture_log_rmse.is_finite() && hurt.rows.iter().all(|row| row.total().is_finite()), "{kind}");
        let moved = environment_errors(&hurt.light.environment(), &sound.light.environment()).unwrap().log_rmse.raw;
        let errors = [&sound, &hurt].map(|found| light_errors(found).log_rmse.raw);
        println!("{kind}: log error of the light without and with black pixels {errors:?}, it moved by {moved:.3}");
        assert!(moved < 0.25 && errors[1] < errors[0] + 0.1, "{kind}: {moved} {errors:?}");
    }
}
