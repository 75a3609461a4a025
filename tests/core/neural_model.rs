//! The weights that ship: a density, a reflectance, a sampler; and files that are none of that.

#![allow(clippy::unwrap_used)]

use glam::DVec3;
use patina::ErrorKind;
use patina::lab::neural::run::{Sitting, checkpoint_path, curve_path, train};
use patina::math::random::SequentialRandom;
use patina::measured::{HalfDifference, ReflectanceModel};
use patina::neural::architecture::{Architecture, CODE};
use patina::neural::fit::{FlowFitSettings, fit_table};
use patina::neural::library::Library;
use patina::neural::target::TargetGrid;
use patina::neural::train::TrainSettings;
use patina::neural::weights::{Account, Trained, write};
use patina::neural::{FlowModel, shipped, shipped_leave_out};
use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

fn code_of(trained: &Trained, name: &str) -> Vec<f32> {
    trained.material(name).unwrap().0[1].to_vec()
}

#[test]
fn the_shipped_weights_say_what_they_are() {
    let trained = shipped().unwrap();
    assert!(trained.account.data.contains("MERL via neural fits"), "{}", trained.account.data);
    assert!(trained.account.command.contains("measured train"));
    assert_eq!(trained.account.materials.len(), 88);
    assert!(trained.account.divergence < 2e-3 && trained.account.log_error < 0.6, "{:?}", trained.account);
    assert!(trained.codes.chunks(CODE).all(|code| code.iter().map(|x| x * x).sum::<f32>() <= 1.0 + 1e-5));
    assert_eq!(trained.flow.architecture(), &Architecture::compact(CODE));
    let account = shipped_leave_out().unwrap().account;
    assert_eq!((account.materials.len(), account.left_out.len()), (62, 10));
    assert!(account.left_out.iter().all(|name| !account.materials.contains(name)));
    assert!(account.divergence < 2e-3, "{account:?}");
}

#[test]
fn the_density_integrates_to_one_and_has_no_seam() {
    let trained = shipped().unwrap();
    for name in ["chrome-steel", "pink-fabric", "blue-acrylic"] {
        let code = code_of(&trained, name);
        let (halves, others) = (200, 40);
        let mut points = Vec::new();
        for index in 0..halves * others * others {
            let (half, rest) = (index % halves, index / halves);
            let middle = |index: usize, count: usize| (index as f64 + 0.5) / count as f64;
            points.push([middle(half, halves), middle(rest % others, others), middle(rest / others, others)]);
        }
        let sum: f64 = trained.flow.log_density(&points, &code).iter().map(|log| log.exp()).sum();
        let integral = sum / points.len() as f64;
        assert!((integral - 1.0).abs() < 1e-3, "{name}: {integral}");
        let ends: Vec<[f64; 3]> = [0.0, 1.0 - 1e-12].iter().map(|&azimuth| [0.3, 0.6, azimuth]).collect();
        let log = trained.flow.log_density(&ends, &code);
        assert!((log[0] - log[1]).abs() < 1e-6, "{name}: {log:?}");
    }
}

#[test]
fn samples_of_the_flow_follow_its_density_by_chi_square() {
    let trained = shipped().unwrap();
    let code = code_of(&trained, "chrome-steel");
    let mut random = SequentialRandom::new(5);
    let count = 60_000;
    let uniform: Vec<[f64; 3]> = (0..count).map(|_| [0; 3].map(|_| f64::from(random.next_number()))).collect();
    let drawn = trained.flow.carry_from_uniform(&uniform, &code);
    let (side, fine) = (6usize, 5usize);
    let mut counts = vec![0.0f64; side.pow(3)];
    for (point, _) in &drawn {
        let cell = point.iter().fold(0, |cell, u| cell * side + ((u * side as f64) as usize).min(side - 1));
        counts[cell] += 1.0;
    }
    let sub = side * fine;
    let middle = |index: usize| (index as f64 + 0.5) / sub as f64;
    let points: Vec<[f64; 3]> = (0..sub.pow(3))
        .map(|index| [middle(index / sub / sub), middle(index / sub % sub), middle(index % sub)])
        .collect();
    let mut expected = vec![0.0f64; counts.len()];
    for (point, log) in points.iter().zip(trained.flow.log_density(&points, &code)) {
        let cell = point.iter().fold(0, |cell, u| cell * side + ((u * side as f64) as usize).min(side - 1));
        expected[cell] += log.exp() / points.len() as f64 * f64::from(count);
    }
    // Quadrature is good to a percent of a cell.
    let statistic: f64 = counts.iter().zip(&expected).map(|(n, e)| (n - e).powi(2) / (e + (0.01 * e).powi(2))).sum();
    let cells = counts.len() as f64;
    assert!(statistic < cells + 5.0 * (2.0 * cells).sqrt(), "{statistic} of {cells}");
    let spread = expected.iter().fold(0.0f64, |most, e| most.max(*e)) / (f64::from(count) / cells);
    assert!(spread > 1.2, "the density is not flat: {spread}");
}

#[test]
fn reflectance_is_reciprocal_and_finite_everywhere() {
    let model = FlowModel::new(Arc::new(shipped().unwrap()), 2);
    let mut parameters = model.of_material("brass").unwrap();
    // A code far outside the ball, and numbers that are none, count as the nearest that may be.
    parameters[3] = 1e9;
    parameters[60] = f64::NAN;
    let mut random = SequentialRandom::new(2);
    let direction = |u: f32, v: f32| {
        let (height, turn) = (f64::from(u), f64::from(v) * 2.0 * PI);
        DVec3::new((1.0 - height * height).sqrt() * turn.cos(), (1.0 - height * height).sqrt() * turn.sin(), height)
    };
    let mut at = Vec::new();
    for _ in 0..500 {
        let pair = [0; 2].map(|_| direction(random.next_number(), random.next_number()));
        at.push(HalfDifference::from_directions(pair[0], pair[1]));
        at.push(HalfDifference::from_directions(pair[1], pair[0]));
    }
    for theta_half in [0.0, 1e-9, FRAC_PI_2] {
        for theta_difference in [0.0, FRAC_PI_2] {
            for phi_difference in [0.0, PI] {
                at.push(HalfDifference { theta_half, theta_difference, phi_difference });
            }
        }
    }
    let mut values = vec![[0.0; 3]; at.len()];
    model.evaluate(&parameters, &at, &mut values);
    assert!(values.iter().flatten().all(|value| value.is_finite() && *value >= 0.0));
    for pair in values[..1000].chunks_exact(2) {
        assert!((0..3).all(|channel| (pair[0][channel] - pair[1][channel]).abs() <= 1e-4 * pair[0][channel] + 1e-12));
    }
    let exact = model.exact(&parameters, &at);
    assert!(exact.iter().flatten().all(|value| value.is_finite() && *value >= 0.0));
}

#[test]
fn gradients_of_the_model_equal_finite_differences() {
    let model = FlowModel::new(Arc::new(shipped().unwrap()), 2);
    let mut parameters = model.of_material("blue-acrylic").unwrap();
    let count = parameters.len();
    let mut random = SequentialRandom::new(4);
    for value in &mut parameters[48..96] {
        *value = 0.3 * (f64::from(random.next_number()) - 0.5);
    }
    parameters[count - 3..].fill(0.5);
    let at: Vec<HalfDifference> = (0..40)
        .map(|_| HalfDifference {
            theta_half: 0.6 * f64::from(random.next_number()),
            theta_difference: 0.9 * f64::from(random.next_number()),
            phi_difference: PI * f64::from(random.next_number()),
        })
        .collect();
    let adjoint: Vec<[f64; 3]> = (0..40).map(|_| [0; 3].map(|_| f64::from(random.next_number()) - 0.3)).collect();
    let value = |parameters: &[f64]| -> f64 {
        let mut values = vec![[0.0; 3]; at.len()];
        model.evaluate(parameters, &at, &mut values);
        values.iter().zip(&adjoint).map(|(v, a)| v[0] * a[0] + v[1] * a[1] + v[2] * a[2]).sum()
    };
    let mut gradient = vec![0.0; count];
    model.pull_back(&parameters, &at, &adjoint, &mut gradient);
    let (mut off, mut size) = (0.0, 0.0);
    // Every third: codes and colours of both lobes are among them.
    for index in (0..count).step_by(3) {
        let (mut up, mut down) = (parameters.clone(), parameters.clone());
        up[index] += 2e-3;
        down[index] -= 2e-3;
        let difference = (value(&up) - value(&down)) / 4e-3;
        off += (difference - gradient[index]).powi(2);
        size += gradient[index].powi(2);
    }
    assert!(size > 0.0 && off.sqrt() < 0.02 * size.sqrt(), "{} of {}", off.sqrt(), size.sqrt());
}

#[test]
fn a_table_of_the_model_is_fitted_by_the_model() {
    let model = FlowModel::new(Arc::new(shipped().unwrap()), 1);
    let table = model.table(&model.of_material("gold-paint").unwrap());
    let settings = FlowFitSettings { columns: 60, steps: 40, ..FlowFitSettings::default() };
    let fit = fit_table(&model, &table, &settings).unwrap();
    assert!(fit.error.log_rmse < 0.02, "{:?}", fit.error);
    let parameters = &fit.parameters;
    assert!(model.interpolation_error(parameters, 301) < 0.2);
}

fn dull_library() -> Library {
    let target = |level: f64| {
        TargetGrid::of_reflectance(move |at, values| {
            at.iter().zip(values).for_each(|(at, value)| *value = [level * (1.0 + at.theta_half.cos()); 3]);
        })
    };
    Library {
        statement: "made up".into(),
        names: vec!["a".into(), "b".into()],
        targets: vec![target(0.1), target(0.3)],
    }
}

#[test]
fn weights_of_another_architecture_and_damaged_files_are_clear_errors() {
    let folder = tempfile::tempdir().unwrap();
    let library = dull_library();
    let architecture = Architecture::triangular(CODE, "small", 16, 1);
    let mut settings = TrainSettings { steps: 4, strata: [2, 2, 4], ..TrainSettings::of(&architecture) };
    settings.densities_per_step = 6;
    let mut sitting = Sitting {
        output: folder.path().join("w.safetensors"),
        architecture,
        settings: settings.clone(),
        left_out: Vec::new(),
        command: "test".into(),
        time: None,
        resume: false,
    };
    let account = train(&sitting, &library, &Default::default(), &|_| {}).unwrap();
    assert_eq!(account.step, 4);
    assert!(checkpoint_path(&sitting.output).is_file() && curve_path(&sitting.output).is_file());
    let read = Trained::read(&sitting.output).unwrap();
    assert_eq!((read.account.materials.len(), read.log_colours.len()), (2, 6));
    // The account says one thing, the numbers are another.
    let lying = Account { architecture: Architecture::paper(CODE), ..account };
    let training = patina::neural::train::Training::new(sitting.architecture.clone(), &library, settings).unwrap();
    let path = folder.path().join("lying.safetensors");
    write(&path, &lying, &training, &[0.0; 6], false).unwrap();
    let error = Trained::read(&path).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Malformed);
    assert!(error.to_string().contains("another architecture"), "{error}");
    // Taking up a run with another configuration.
    sitting.resume = true;
    sitting.architecture = Architecture::compact(CODE);
    let error = train(&sitting, &library, &Default::default(), &|_| {}).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::InvalidSetting, "{error}");
    // Not weights at all, and weights cut short.
    let bytes = std::fs::read(&sitting.output).unwrap();
    for content in [&b"hello"[..], &bytes[..bytes.len() - 10], &[]] {
        assert_eq!(Trained::parse(content).unwrap_err().kind(), ErrorKind::Malformed);
    }
}
