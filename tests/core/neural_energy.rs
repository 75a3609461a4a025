//! The flow that ships makes no light of nothing, and the path tracer draws its materials by the density it states.

#![allow(clippy::unwrap_used)]

use glam::{DVec3, Vec3};
use patina::math::frame::Frame;
use patina::math::random::SequentialRandom;
use patina::neural::sampler::HalfVectorSampler;
use patina::neural::{FlowModel, shipped, source};
use patina::render::regions::MeasuredMaterial;
use std::f64::consts::{FRAC_PI_2, TAU};
use std::sync::Arc;

/// Directional albedo of a material of the shipped flow, from the normal to the horizon.
fn albedos_of(model: &FlowModel, material: &str) -> Vec<(f64, [f64; 3])> {
    let parameters = model.of_material(material).unwrap();
    // Decoded once, before all threads of the sampler ask for it at the same time.
    model.decode(&parameters);
    HalfVectorSampler::new(model, &parameters).albedos()
}

#[test]
fn no_material_of_the_shipped_flow_reflects_far_more_light_than_it_gets() {
    let trained = Arc::new(shipped().unwrap());
    let model = FlowModel::new(Arc::clone(&trained), 1);
    let (mut over, mut count, mut largest) = (0usize, 0usize, (0.0f64, String::new()));
    for material in trained.account.materials.iter().step_by(8) {
        let albedos = albedos_of(&model, material);
        assert!(albedos.len() > 8 && albedos.windows(2).all(|pair| pair[0].0 < pair[1].0));
        assert!(albedos.last().unwrap().0 > 1.5, "{material}: the horizon is not reached");
        let mut most = 0.0f64;
        for (angle, albedo) in &albedos {
            assert!(albedo.iter().all(|value| value.is_finite() && *value >= 0.0), "{material} at {angle}: {albedo:?}");
            most = albedo.iter().fold(most, |most, value| most.max(*value));
        }
        println!("{material:<26} largest albedo {most:.3}");
        // The blackest of them, a polished phenolic, gives back up to four percent in the fits.
        assert!(most > 0.005, "{material} is black: {most}");
        over += usize::from(most > 1.0);
        count += 1;
        if most > largest.0 {
            largest = (most, material.clone());
        }
    }
    println!("{over} of {count} materials over 1, the largest {:.3} ({})", largest.0, largest.1);
    assert_eq!(count, 11);
    // The fits of which the flow was learned stay below 0.85; near the horizon the flow is least certain.
    assert!(largest.0 < 1.5, "{largest:?}");
}

#[test]
fn a_cloth_of_the_shipped_flow_is_neither_black_nor_brighter_than_white() {
    let model = FlowModel::new(Arc::new(shipped().unwrap()), 1);
    for (angle, albedo) in albedos_of(&model, "white-fabric") {
        assert!(albedo.iter().all(|value| (0.1..1.0).contains(value)), "at {angle}: {albedo:?}");
    }
}

#[test]
fn the_energy_of_the_shipped_flow_is_that_of_the_fits_it_was_learned_of() {
    let model = FlowModel::new(Arc::new(shipped().unwrap()), 1);
    // Green albedo of the neural fits nearly along the normal and at 60 degrees, by a program of its own from their
    // weights and formula, with the same cells.
    let fits: [(&str, [f64; 2]); 5] = [
        ("white-fabric", [0.234, 0.247]),
        ("white-diffuse-bball", [0.296, 0.284]),
        ("green-latex", [0.144, 0.147]),
        ("alum-bronze", [0.093, 0.099]),
        ("chrome-steel", [0.063, 0.083]),
    ];
    for (material, expected) in fits {
        let albedos = albedos_of(&model, material);
        let near = |degrees: f64| {
            let distance = |angle: f64| (angle - degrees.to_radians()).abs();
            albedos.iter().min_by(|a, b| distance(a.0).total_cmp(&distance(b.0))).unwrap().1[1]
        };
        let found = [near(0.0), near(60.0)];
        println!("{material}: {found:.3?}, the fits {expected:.3?}");
        // A flow that is not normalised, or a colour that is lost, misses by a factor of two and more.
        for (found, expected) in found.iter().zip(expected) {
            assert!((found / expected).ln().abs() < 0.35, "{material}: {found} and not {expected}");
        }
    }
}

/// Cells of the half vector: along the square root of its angle from the normal, and around the normal. Their borders
/// are borders of the sampler's own cells, so that its density has no step within a part of a cell.
const ROWS: usize = 32;
const COLUMNS: usize = 12;
/// Parts of a cell, over which the density is integrated.
const FINE: [usize; 2] = [12, 24];
/// Where the direction to the eye lies, in the frame of the surface.
const EYE_ANGLE: f64 = 0.7;
const EYE_AZIMUTH: f64 = 0.9;

fn at_height(height: f64, azimuth: f64) -> DVec3 {
    let radius = (1.0 - height * height).max(0.0).sqrt();
    DVec3::new(radius * azimuth.cos(), radius * azimuth.sin(), height)
}

/// Pearson's statistic and the number of cells in it; cells of which little is expected are taken together.
fn chi_square(counts: &[f64], expected: &[f64]) -> (f64, f64) {
    // Quadrature is good to a percent of a cell.
    let term = |count: f64, expected: f64| (count - expected).powi(2) / (expected + (0.01 * expected).powi(2));
    let (mut statistic, mut cells, mut rest) = (0.0f64, 0.0f64, [0.0f64; 2]);
    for (&count, &expected) in counts.iter().zip(expected) {
        if expected > 20.0 {
            statistic += term(count, expected);
            cells += 1.0;
        } else {
            rest[0] += count;
            rest[1] += expected;
        }
    }
    if rest[1] > 20.0 {
        statistic += term(rest[0], rest[1]);
        cells += 1.0;
    }
    (statistic, cells)
}

#[test]
fn what_the_path_tracer_draws_of_chrome_follows_its_density_by_chi_square() {
    let found = source::read("chrome-steel", None, None).unwrap();
    let material = MeasuredMaterial::new(&found.name, found.table);
    // A surface that is not level, as the tracer meets it.
    let frame = Frame::around(Vec3::new(0.36, 0.48, 0.8));
    let to_eye = at_height(EYE_ANGLE.cos(), EYE_AZIMUTH);
    let viewer = frame.outer_from_local(to_eye.as_vec3());

    // Cells, then one for draws that fall below the surface.
    let total = 30_000;
    let mut counts = vec![0.0f64; ROWS * COLUMNS + 1];
    let mut random = SequentialRandom::new(21);
    for _ in 0..total {
        let numbers = [0; 3].map(|_| random.next_number());
        let cell = material.sample(&frame, viewer, numbers).map_or(ROWS * COLUMNS, |drawn| {
            assert!(material.density(&frame, drawn, viewer) > 0.0, "{drawn} is drawn and has no chance");
            let half = (frame.local_from_outer(drawn).as_dvec3() + to_eye).normalize();
            let row = (half.z.clamp(-1.0, 1.0).acos() / FRAC_PI_2).sqrt() * ROWS as f64;
            let turn = (half.y.atan2(half.x) - EYE_AZIMUTH).rem_euclid(TAU) / TAU * COLUMNS as f64;
            (row as usize).min(ROWS - 1) * COLUMNS + (turn as usize).min(COLUMNS - 1)
        });
        counts[cell] += 1.0;
    }

    // The chance of each cell. The light's solid angle is four cosines times the half vector's; beside it what comes of
    // leaving the cosine out, which is the usual mistake.
    let mut expected = vec![0.0f64; ROWS * COLUMNS + 1];
    let mut mistaken = expected.clone();
    let height_of = |row: f64| ((row / ROWS as f64).powi(2) * FRAC_PI_2).cos();
    for cell in 0..ROWS * COLUMNS {
        let (row, column) = ((cell / COLUMNS) as f64, (cell % COLUMNS) as f64);
        for part in 0..FINE[0] * FINE[1] {
            let upper = height_of(row + (part / FINE[1]) as f64 / FINE[0] as f64);
            let lower = height_of(row + (part / FINE[1] + 1) as f64 / FINE[0] as f64);
            let turn = (column + ((part % FINE[1]) as f64 + 0.5) / FINE[1] as f64) / COLUMNS as f64 * TAU;
            let half = at_height(0.5 * (upper + lower), turn + EYE_AZIMUTH);
            let cosine = half.dot(to_eye);
            let to_light = 2.0 * cosine * half - to_eye;
            if cosine <= 0.0 || to_light.z <= 0.0 {
                continue;
            }
            let light = frame.outer_from_local(to_light.as_vec3());
            let density = f64::from(material.density(&frame, light, viewer));
            let solid_angle = (upper - lower) * TAU / (COLUMNS * FINE[1]) as f64;
            expected[cell] += f64::from(total) * density * 4.0 * cosine * solid_angle;
            mistaken[cell] += f64::from(total) * density * 4.0 * solid_angle;
        }
    }
    let above: f64 = expected.iter().sum();
    assert!(above < 1.001 * f64::from(total), "the density integrates to {}", above / f64::from(total));
    expected[ROWS * COLUMNS] = (f64::from(total) - above).max(0.0);
    mistaken[ROWS * COLUMNS] = expected[ROWS * COLUMNS];

    let (statistic, cells) = chi_square(&counts, &expected);
    let limit = |cells: f64| cells + 5.0 * (2.0 * cells).sqrt();
    println!("chi square {statistic:.1} of {cells} cells, {} draws below the surface", counts[ROWS * COLUMNS]);
    assert!(cells > 40.0, "{cells} cells");
    assert!(statistic < limit(cells), "{statistic} of {cells} cells");
    // The test can tell.
    let (statistic, cells) = chi_square(&counts, &mistaken);
    assert!(statistic > 3.0 * limit(cells), "{statistic} of {cells} cells");
}
