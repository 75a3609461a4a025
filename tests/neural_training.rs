//! The flow on surfaces that break models, trainings that stop and go on, flows without codes, weights beyond reason.

#![allow(clippy::unwrap_used)]

use patina::math::random::SequentialRandom;
use patina::measured::{HalfDifference, MeasuredBrdf};
use patina::neural::architecture::{Architecture, CODE};
use patina::neural::fit::{FlowFitSettings, fit_table};
use patina::neural::flow::Flow;
use patina::neural::library::Library;
use patina::neural::run::{Sitting, checkpoint_path, curve_path, train};
use patina::neural::target::TargetGrid;
use patina::neural::train::{TrainSettings, Training};
use patina::neural::weights::read_checkpoint;
use patina::neural::{FlowModel, Trained, shipped};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// All light within two degrees of the mirror direction.
fn chrome(at: HalfDifference) -> [f64; 3] {
    let fresnel = 0.6 + 0.4 * (1.0 - at.theta_difference.cos()).powi(5);
    let lobe = 300.0 * fresnel * (-(at.theta_half / 0.03).powi(2)).exp();
    [1e-4 + lobe, 1e-4 + 0.97 * lobe, 1e-4 + 0.93 * lobe]
}

/// Below a hundredth everywhere, brightest where light and eye graze.
fn black_velvet(at: HalfDifference) -> [f64; 3] {
    let rim = 0.006 * at.theta_half.sin().powi(6) + 0.002 * (1.0 - at.theta_difference.cos()).powi(3);
    [0.001 + rim, 0.001 + rim, 0.0015 + rim]
}

/// Light goes back where it came from, whatever the normal.
fn retro_reflective_cloth(at: HalfDifference) -> [f64; 3] {
    let back = 1.5 * (-(at.theta_difference / 0.12).powi(2)).exp();
    [0.06 + back, 0.05 + 0.9 * back, 0.03 + 0.7 * back]
}

#[test]
fn chrome_velvet_and_retro_reflective_cloth_are_fitted_and_no_number_is_lost() {
    let model = FlowModel::new(Arc::new(shipped().unwrap()), 1);
    let surfaces: [(&str, fn(HalfDifference) -> [f64; 3]); 3] =
        [("chrome", chrome), ("velvet", black_velvet), ("cloth", retro_reflective_cloth)];
    for (name, surface) in surfaces {
        let table = MeasuredBrdf::from_fn(surface);
        let after = |steps: usize| {
            let settings = FlowFitSettings { columns: 100, per_column: 16, steps, ..FlowFitSettings::default() };
            fit_table(&model, &table, &settings).unwrap()
        };
        let (begun, done) = (after(0), after(60));
        for fit in [&begun, &done] {
            let error = fit.error;
            let figures = [error.log_rmse, error.log10_rmse, error.cosine_rmse, error.cosine_mean];
            assert!(figures.iter().all(|figure| figure.is_finite()), "{name}: {error:?}");
            assert!(fit.sampled_log_rmse.is_finite() && fit.parameters.iter().all(|value| value.is_finite()), "{name}");
            for code in fit.parameters[..model.code_parameters()].chunks(CODE) {
                let length = code.iter().map(|value| value * value).sum::<f64>().sqrt();
                assert!(length <= 1.01 + 1e-6, "{name}: {length}");
            }
            let decoded = model.decode(&fit.parameters);
            assert!(decoded.1.iter().flatten().all(|value| value.is_finite() && *value >= 0.0), "{name}");
        }
        println!("{name}: log error {:.3} at its start, then {:.3}", begun.error.log_rmse, done.error.log_rmse);
        assert!(done.error.log_rmse < begun.error.log_rmse, "{name}: {:?} from {:?}", done.error, begun.error);
        assert!(done.sampled_log_rmse < 0.98 * begun.sampled_log_rmse, "{name}");
    }
}

/// Two made-up materials.
fn library() -> Library {
    let material = |sharpness: f64| {
        TargetGrid::of_reflectance(move |at, values| {
            for (at, value) in at.iter().zip(values) {
                let lobe = (-sharpness * at.theta_half.powi(2)).exp() * (1.0 + at.theta_difference.powi(4));
                *value = [0.1 + lobe, 0.02 + lobe, 0.01 * (1.0 + at.phi_difference.cos().powi(2)) + lobe];
            }
        })
    };
    Library {
        statement: "made up".into(),
        names: vec!["dull".into(), "shiny".into()],
        targets: vec![material(3.0), material(60.0)],
    }
}

fn sitting(output: PathBuf, architecture: Architecture, steps: u64) -> Sitting {
    let settings =
        TrainSettings { steps, strata: [2, 2, 4], densities_per_step: 4, ..TrainSettings::of(&architecture) };
    let (left_out, command) = (Vec::new(), "test".into());
    Sitting { output, architecture, settings, left_out, command, time: None, resume: false }
}

/// The cells of a curve, its header first.
fn curve(output: &Path) -> Vec<Vec<String>> {
    let text = std::fs::read_to_string(curve_path(output)).unwrap();
    text.lines().map(|line| line.split(',').map(str::to_string).collect()).collect()
}

#[test]
fn a_run_taken_up_from_its_checkpoint_file_ends_with_the_bits_of_an_unbroken_one() {
    let folder = tempfile::tempdir().unwrap();
    let library = library();
    let architecture = Architecture::triangular(CODE, "small", 16, 1);
    let go_on = AtomicBool::new(false);
    let unbroken = sitting(folder.path().join("unbroken.safetensors"), architecture.clone(), 200);
    let expected = train(&unbroken, &library, &go_on, &|_| {}).unwrap();
    assert_eq!(expected.step, 200);

    // Stopped before its first step, then by its time within the first hundred, then let run.
    let mut broken = sitting(folder.path().join("broken.safetensors"), architecture, 200);
    let mut account = train(&broken, &library, &AtomicBool::new(true), &|_| {}).unwrap();
    assert_eq!(account.step, 0);
    (broken.resume, broken.time) = (true, Some(Duration::from_micros(20)));
    for _ in 0..200 {
        if account.step > 0 {
            break;
        }
        account = train(&broken, &library, &go_on, &|_| {}).unwrap();
    }
    assert!((1..100).contains(&account.step), "stopped at step {}", account.step);
    let halfway = Trained::read(&broken.output).unwrap();
    broken.time = None;
    account = train(&broken, &library, &go_on, &|_| {}).unwrap();
    assert_eq!(account.step, 200);
    assert_eq!(
        (account.log_likelihood, account.divergence, account.log_error),
        (expected.log_likelihood, expected.divergence, expected.log_error)
    );

    let [one, other] = [&unbroken.output, &broken.output].map(|output| Trained::read(output).unwrap());
    assert_ne!(halfway.flow.weights, other.flow.weights);
    assert_eq!((&one.flow.weights, &one.codes), (&other.flow.weights, &other.codes));
    assert_eq!(one.log_colours, other.log_colours);
    // So do the moments: a third sitting would go on alike, too.
    let [one, other] =
        [&unbroken.output, &broken.output].map(|output| read_checkpoint(&checkpoint_path(output)).unwrap().0);
    assert_eq!((&one.of_weights, &one.of_codes), (&other.of_weights, &other.of_codes));

    let [one, other] = [&unbroken.output, &broken.output].map(|output| curve(output));
    assert_eq!((one.len(), other.len(), &one[0]), (3, 3, &other[0]));
    assert_eq!(one[0][..2], ["step", "seconds"]);
    // Seconds are those of the clock; a row's figures are means over the steps that its sitting did of its hundred, so
    // that only the row after the one that was interrupted has to have the same.
    for row in 1..3 {
        assert_eq!((&one[row][0], &one[row][5]), (&other[row][0], &other[row][5]));
    }
    assert_eq!(one[2][2..], other[2][2..]);
}

#[test]
fn flows_without_codes_learn_one_channel_and_survive_their_file() {
    let folder = tempfile::tempdir().unwrap();
    let library = library().single("shiny:green").unwrap();
    assert_eq!((library.names.len(), library.targets.len()), (1, 1));
    // Quadrature of the paper's costs six nets a point: it gets fewer points, and has had but a few steps.
    for (architecture, steps, side) in
        [(Architecture::triangular(0, "single", 16, 1), 60, 24), (Architecture::paper(0), 4, 16)]
    {
        let name = architecture.name.clone();
        let own = sitting(folder.path().join(format!("{name}.safetensors")), architecture.clone(), steps);
        let before = Training::new(architecture, &library, own.settings.clone()).unwrap();
        let account = train(&own, &library, &AtomicBool::new(false), &|_| {}).unwrap();
        assert!(account.step == steps && account.divergence.is_finite(), "{name}");
        let read = Trained::read(&own.output).unwrap();
        assert!(read.codes.is_empty() && read.log_colours.len() == 3, "{name}");
        assert_ne!(read.flow.weights, before.flow.weights, "{name}");
        if steps > 10 {
            let divergence = before.figures(&library).divergence;
            assert!(account.divergence < divergence, "{name}: {} from {divergence}", account.divergence);
        }

        let middle = |index: usize| (index as f64 + 0.5) / side as f64;
        let points: Vec<[f64; 3]> = (0..side * side * side)
            .map(|index| [middle(index % side), middle(index / side % side), middle(index / side / side)])
            .collect();
        let sum: f64 = read.flow.log_density(&points, &[]).iter().map(|log| log.exp()).sum();
        let integral = sum / points.len() as f64;
        assert!((integral - 1.0).abs() < 1e-2, "{name}: {integral}");

        let mut random = SequentialRandom::new(3);
        let uniform: Vec<[f64; 3]> = (0..1000).map(|_| [0; 3].map(|_| f64::from(random.next_number()))).collect();
        let drawn = read.flow.from_uniform(&uniform, &[]);
        assert!(drawn.iter().all(|(point, _)| point.iter().all(|u| (0.0..1.0).contains(u))), "{name}");
        let samples: Vec<[f64; 3]> = drawn.iter().map(|(point, _)| *point).collect();
        assert!(samples.iter().zip(&uniform).any(|(sample, u)| (sample[0] - u[0]).abs() > 1e-4), "{name}");
        for ((_, own), at_sample) in drawn.iter().zip(read.flow.log_density(&samples, &[])) {
            assert!((own - at_sample).abs() < 1e-3, "{name}: {own} {at_sample}");
        }
    }
}

#[test]
fn no_density_of_the_papers_configuration_is_lost_whatever_its_weights() {
    let mut random = SequentialRandom::new(17);
    let points: Vec<[f64; 3]> = (0..2000).map(|_| [0; 3].map(|_| f64::from(random.next_number()))).collect();
    let mut spreads = Vec::new();
    for scale in [1e-3f32, 1.0, 1e3, 1e20] {
        let mut flow = Flow::new(Architecture::paper(CODE), 1).unwrap();
        flow.weights.iter_mut().for_each(|weight| *weight = scale * random.next_normal());
        let code: Vec<f32> = (0..CODE).map(|_| random.next_number() - 0.5).collect();
        let log_density = flow.log_density(&points, &code);
        assert_eq!(log_density.len(), points.len());
        assert!(log_density.iter().all(|value| value.is_finite()), "weights of {scale}");
        spreads.push(log_density.iter().fold(0.0f64, |most, value| most.max(value.abs())));
        let drawn = flow.from_uniform(&points[..400], &code);
        let inside = |(point, log): &([f64; 3], f64)| log.is_finite() && point.iter().all(|u| (0.0..1.0).contains(u));
        assert!(drawn.iter().all(inside), "weights of {scale}");
    }
    // From next to no bend to the steepest there is.
    assert!(spreads[0] < 0.5 && spreads[1] > 1.0, "{spreads:?}");
}
