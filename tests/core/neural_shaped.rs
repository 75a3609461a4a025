//! The shaped weights that ship: a density, its inverse, and reciprocal reflectance.

#![allow(clippy::unwrap_used)]

use glam::DVec3;
use patina::math::random::SequentialRandom;
use patina::measured::{HalfDifference, ReflectanceModel};
use patina::neural::architecture::{Architecture, CODE};
use patina::neural::weights::Trained;
use patina::neural::{FlowModel, shaped, shaped_leave_out, shipped_leave_out};
use std::f64::consts::TAU;
use std::sync::Arc;

/// Numbers of a shape.
const SHAPE: usize = 102;

fn model() -> FlowModel {
    FlowModel::new(Arc::new(shaped().unwrap()), 1)
}

fn upper(random: &mut SequentialRandom) -> DVec3 {
    let (height, turn) = (f64::from(random.next_number()), f64::from(random.next_number()) * TAU);
    let radius = (1.0 - height * height).sqrt();
    DVec3::new(radius * turn.cos(), radius * turn.sin(), height)
}

#[test]
fn the_shaped_weights_say_what_they_are_and_come_back_from_their_file() {
    let (all, some) = (shaped().unwrap(), shaped_leave_out().unwrap());
    assert_eq!(all.flow.architecture(), &Architecture::shaped(CODE, SHAPE));
    assert_eq!(all.account.materials.len(), 88);
    assert_eq!(some.account.left_out, shipped_leave_out().unwrap().account.left_out);
    assert!(some.account.left_out.iter().all(|name| !some.account.materials.contains(name)));
    let length = |numbers: &[f32]| numbers.iter().map(|x| x * x).sum::<f32>().sqrt();
    for trained in [&all, &some] {
        assert!(trained.account.data.contains("MERL via neural fits"), "{}", trained.account.data);
        assert!(
            trained.codes.chunks(CODE + SHAPE).all(|row| length(&row[..CODE]) < 1.001 && length(&row[CODE..]) < 1.001)
        );
        assert_eq!(FlowModel::new(Arc::new(trained.clone()), 1).parameter_count(), 153);
    }
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("again.safetensors");
    all.write(&file).unwrap();
    let again = Trained::read(&file).unwrap();
    assert_eq!((&again.flow.weights, &again.codes, &again.account), (&all.flow.weights, &all.codes, &all.account));
    assert!(std::fs::metadata(&file).unwrap().len() < 1_000_000, "small enough to ship");
}

#[test]
fn a_shaped_flow_is_an_invertible_map_by_the_fast_path_and_the_general_one() {
    let trained = shaped().unwrap();
    let mut random = SequentialRandom::new(5);
    for name in ["chrome-steel", "pink-fabric"] {
        let code = trained.material(name).unwrap().0[1];
        let uniform: Vec<[f64; 3]> = (0..2000).map(|_| [0; 3].map(|_| f64::from(random.next_number()))).collect();
        let drawn = trained.flow.carry_from_uniform(&uniform, code);
        let points: Vec<[f64; 3]> = drawn.iter().map(|(point, _)| *point).collect();
        let back = trained.flow.to_uniform(&points, code);
        let off = |(a, b): (&[f64; 3], &[f64; 3])| (0..3).map(|axis| (a[axis] - b[axis]).abs()).fold(0.0, f64::max);
        let most = back.iter().zip(&uniform).map(off).fold(0.0, f64::max);
        assert!(most < 1e-4, "{name}: {most}");
        // A density: it integrates to one, by a sum that is good to a percent where knots are close to each other.
        let (halves, others) = (256, 48);
        let even = |index: usize, count: usize| (index as f64 + 0.5) / count as f64;
        let cube: Vec<[f64; 3]> = (0..halves * others * others)
            .map(|i| [even(i % halves, halves), even(i / halves % others, others), even(i / halves / others, others)])
            .collect();
        let mass = trained.flow.log_density(&cube, code).iter().map(|log| log.exp()).sum::<f64>() / cube.len() as f64;
        assert!((mass - 1.0).abs() < 2e-2, "{name}: {mass}");
    }
}

#[test]
fn reflectance_is_reciprocal_and_finite_whatever_the_code() {
    let model = model();
    let mut parameters = model.of_material("brass").unwrap();
    // Numbers far outside the ball, and such that are none, count as the nearest that may be.
    parameters[3] = 1e9;
    parameters[SHAPE + 20] = f64::NAN;
    let mut random = SequentialRandom::new(2);
    let mut at = Vec::new();
    for _ in 0..500 {
        let pair = [0; 2].map(|_| upper(&mut random));
        at.push(HalfDifference::from_directions(pair[0], pair[1]));
        at.push(HalfDifference::from_directions(pair[1], pair[0]));
    }
    let mut values = vec![[0.0; 3]; at.len()];
    model.evaluate(&parameters, &at, &mut values);
    assert!(values.iter().flatten().all(|value| value.is_finite() && *value >= 0.0));
    assert!(values.iter().any(|value| value[1] > 1e-4));
    for pair in values.chunks_exact(2) {
        assert!((0..3).all(|c| (pair[0][c] - pair[1][c]).abs() <= 1e-5 * (pair[0][c] + 1e-6)), "{pair:?}");
    }
}
