//! The neural model on surfaces and weights that break models, and trainings that are interrupted.

#![allow(clippy::unwrap_used)]

use patina::lab::neural::run::{Sitting, train};
use patina::math::random::SequentialRandom;
use patina::measured::metrics::table_error;
use patina::measured::{HalfDifference, MeasuredBrdf};
use patina::neural::architecture::{Architecture, CODE};
use patina::neural::fit::{FlowFitSettings, fit_table};
use patina::neural::flow::Flow;
use patina::neural::library::Library;
use patina::neural::target::TargetGrid;
use patina::neural::train::TrainSettings;
use patina::neural::{FlowModel, Trained, shipped};
use std::sync::Arc;
use std::time::Duration;

/// Reflectance by formula, in 1/sr.
type Surface = fn(HalfDifference) -> [f64; 3];

/// Nearly a mirror: all of it within two degrees of the normal.
fn chrome(at: HalfDifference) -> [f64; 3] {
    let fresnel = 0.6 + 0.4 * (1.0 - at.theta_difference.cos()).powi(5);
    let lobe = 400.0 * (-(at.theta_half / 0.03).powi(2)).exp();
    [fresnel * lobe + 1e-4, 0.98 * fresnel * lobe + 1e-4, 0.95 * fresnel * lobe + 1e-4]
}

/// Less than a hundredth of the light, with a rim at grazing angles.
fn velvet(at: HalfDifference) -> [f64; 3] {
    let rim = 0.02 * at.theta_half.sin().powi(8);
    [0.002 + rim, 0.002 + rim, 0.003 + rim]
}

/// Sends light back where it came from: bright where the difference of both directions is small.
fn retroreflective_cloth(at: HalfDifference) -> [f64; 3] {
    let back = 2.0 * (-(at.theta_difference / 0.15).powi(2)).exp();
    [0.05 + back, 0.05 + back, 0.06 + back]
}

#[test]
#[ignore = "slow: cargo test -- --ignored"]
fn chrome_velvet_and_retroreflective_cloth_are_fitted_finitely_and_better_than_they_began() {
    let model = FlowModel::new(Arc::new(shipped().unwrap()), 2);
    let fitted = |table: &MeasuredBrdf, steps: usize| {
        let settings = FlowFitSettings { columns: 80, per_column: 16, steps, ..FlowFitSettings::default() };
        fit_table(&model, table, &settings).unwrap()
    };
    let surfaces: [(&str, Surface); 3] =
        [("chrome", chrome), ("velvet", velvet), ("retroreflective cloth", retroreflective_cloth)];
    for (name, surface) in surfaces {
        let table = MeasuredBrdf::from_fn(surface);
        let (begun, done) = (fitted(&table, 0), fitted(&table, 60));
        assert!(done.parameters.iter().all(|value| value.is_finite()), "{name}");
        for code in done.parameters[..model.code_parameters()].chunks(CODE) {
            assert!(code.iter().map(|value| value * value).sum::<f64>().sqrt() <= 1.01 + 1e-6, "{name}");
        }
        let made = model.table(&done.parameters);
        let error = table_error(&made, &table).unwrap().log_rmse;
        println!("{name}: {} at its start, {error} after 60 steps", begun.error.log_rmse);
        assert!(error.is_finite() && error < begun.error.log_rmse, "{name}: {error} from {}", begun.error.log_rmse);
    }
}

#[test]
#[ignore = "slow: cargo test -- --ignored"]
fn no_number_of_the_papers_own_architecture_is_lost_whatever_its_weights() {
    let mut random = SequentialRandom::new(21);
    let points: Vec<[f64; 3]> = (0..2000).map(|_| [0; 3].map(|_| f64::from(random.next_number()))).collect();
    for scale in [1e-3f32, 1.0, 1e3, 1e20, f32::INFINITY] {
        let mut flow = Flow::new(Architecture::paper(CODE), 1).unwrap();
        flow.weights.iter_mut().for_each(|weight| *weight *= scale * (random.next_number() - 0.3));
        let code: Vec<f32> = (0..CODE).map(|_| 1e6 * (random.next_number() - 0.5)).collect();
        let log_density = flow.log_density(&points, &code);
        assert!(log_density.iter().all(|value| value.is_finite()), "weights times {scale}");
    }
}

/// Two dull materials.
fn library() -> Library {
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

fn sitting(output: std::path::PathBuf, architecture: Architecture, steps: u64) -> Sitting {
    let mut settings = TrainSettings { steps, strata: [2, 2, 4], ..TrainSettings::of(&architecture) };
    settings.densities_per_step = 3;
    let (left_out, command) = (Vec::new(), "test".into());
    Sitting { output, architecture, settings, left_out, command, time: None, resume: false }
}

#[test]
fn a_training_that_is_interrupted_and_taken_up_from_its_file_ends_with_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    let library = library();
    let architecture = || Architecture::triangular(CODE, "small", 16, 1);
    let whole = sitting(folder.path().join("whole.safetensors"), architecture(), 8);
    train(&whole, &library, &Default::default(), &|_| {}).unwrap();

    // The first sitting has no time at all, later ones have time for a step or a few.
    let mut parts =
        Sitting { time: Some(Duration::ZERO), ..sitting(folder.path().join("parts.safetensors"), architecture(), 8) };
    let mut sittings = 1;
    let mut account = train(&parts, &library, &Default::default(), &|_| {}).unwrap();
    assert_eq!(account.step, 0);
    (parts.resume, parts.time) = (true, Some(Duration::from_micros(1500)));
    while account.step < 8 {
        sittings += 1;
        assert!(sittings < 10_000, "no sitting does a step");
        account = train(&parts, &library, &Default::default(), &|_| {}).unwrap();
    }
    assert!(sittings > 1);
    let [one, other] = [&whole.output, &parts.output].map(|path| Trained::read(path).unwrap());
    assert_eq!(one.flow.weights, other.flow.weights);
    assert_eq!(one.codes, other.codes);
    assert_eq!(one.log_colours, other.log_colours);
}

#[test]
fn a_flow_without_codes_learns_one_channel_and_survives_its_file() {
    let folder = tempfile::tempdir().unwrap();
    let library = library().single("b:green").unwrap();
    assert!(library.names == ["b"] && library.targets.len() == 1);
    let own = sitting(folder.path().join("single.safetensors"), Architecture::triangular(0, "single", 12, 1), 30);
    train(&own, &library, &Default::default(), &|_| {}).unwrap();
    let read = Trained::read(&own.output).unwrap();
    assert!(read.codes.is_empty());
    let side = 24;
    let middle = |index: usize| (index as f64 + 0.5) / side as f64;
    let points: Vec<[f64; 3]> = (0..side * side * side)
        .map(|index| [middle(index % side), middle(index / side % side), middle(index / side / side)])
        .collect();
    let sum: f64 = read.flow.log_density(&points, &[]).iter().map(|log| log.exp()).sum();
    assert!((sum / points.len() as f64 - 1.0).abs() < 1e-2, "{}", sum / points.len() as f64);
    let drawn = read.flow.carry_from_uniform(&points[..500], &[]);
    assert!(drawn.iter().all(|(point, log)| log.is_finite() && point.iter().all(|u| (0.0..1.0).contains(u))));
}
