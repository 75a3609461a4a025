use super::*;
use crate::math::random::SequentialRandom;
use statrs::distribution::{ChiSquared, ContinuousCDF};

fn direction(random: &mut SequentialRandom) -> Vec3 {
    let z = random.next_number().max(1e-3);
    let radius = (1.0 - z * z).sqrt();
    let (sin, cos) = (std::f32::consts::TAU * random.next_number()).sin_cos();
    Vec3::new(radius * cos, radius * sin, z)
}

fn random_model(random: &mut SequentialRandom) -> LobeModel {
    LobeModel::ALL[random.below(2)]
}

fn random_material(random: &mut SequentialRandom) -> Material<f32> {
    let mut colour = || Vec3::new(random.next_number(), random.next_number(), random.next_number());
    let (diffuse, specular) = (colour(), colour());
    let roughness = (MIN_ROUGHNESS.ln() * random.next_number()).exp();
    Material::from_maps(diffuse, specular, roughness)
}

#[test]
fn reciprocal_and_positive() {
    let mut random = SequentialRandom::new(1);
    for _ in 0..10_000 {
        let (material, model) = (random_material(&mut random), random_model(&mut random));
        let (light, viewer) = (direction(&mut random), direction(&mut random));
        let there = LobeGeometry::new(Vec3::Z, light, viewer).unwrap();
        let back = LobeGeometry::new(Vec3::Z, viewer, light).unwrap();
        let forward = material.reflect_by(model, &there, 1.0).map(|value| value / there.cos_in);
        let reverse = material.reflect_by(model, &back, 1.0).map(|value| value / back.cos_in);
        for channel in 0..3 {
            assert!(forward[channel] >= 0.0 && forward[channel].is_finite());
            assert!((forward[channel] - reverse[channel]).abs() <= 2e-4 * forward[channel].max(1e-3));
        }
    }
}

/// Directional albedo by importance sampling in f64 sums.
fn albedo(model: LobeModel, material: &Material<f32>, viewer: Vec3, count: usize) -> f64 {
    let frame = Frame::around(Vec3::Z);
    let sampler = material.sampler(model, viewer.z, 1.0);
    let mut random = SequentialRandom::new(9);
    let mut sum = 0.0;
    for _ in 0..count {
        let u = [random.next_number(), random.next_number()];
        if let Some(light) = sampler.sample(&frame, viewer, u)
            && let Some(geometry) = LobeGeometry::new(Vec3::Z, light, viewer)
        {
            sum += f64::from(material.reflect_by(model, &geometry, 1.0)[1] / sampler.density(&geometry));
        }
    }
    sum / count as f64
}

#[test]
fn a_white_specular_lobe_returns_at_most_what_it_receives() {
    for model in LobeModel::ALL {
        for roughness in [MIN_ROUGHNESS, 0.001, 0.01, 0.1, 0.5, 1.0] {
            for degrees in [0.0f32, 30.0, 60.0, 80.0, 88.0] {
                let (sin, cos) = degrees.to_radians().sin_cos();
                let viewer = Vec3::new(sin, 0.0, cos);
                let white = Material::from_maps(Vec3::ZERO, Vec3::ONE, roughness);
                let albedo = albedo(model, &white, viewer, 40_000);
                assert!(albedo < 1.02, "{model:?}, r {roughness}, {degrees} degrees: {albedo}");
                // A near-mirror loses little; a rough lobe loses what single scattering loses.
                if roughness <= 0.001 && degrees <= 60.0 {
                    assert!(albedo > 0.93, "{model:?}, r {roughness}, {degrees} degrees: {albedo}");
                }
            }
        }
    }
    let lambert = Material::from_maps(Vec3::splat(0.7), Vec3::ZERO, 0.5);
    let geometry = LobeGeometry::new(Vec3::Z, Vec3::Z, Vec3::Z).unwrap();
    assert!((lambert.reflect(&geometry, 0.0)[0] - 0.7 / PI).abs() < 1e-7);
}

#[test]
fn the_distribution_of_half_vectors_is_normalised() {
    // Integral of D (n.h) over the hemisphere, by the midpoint rule in ln(sin^2): d omega cos = pi d(sin^2).
    for model in LobeModel::ALL {
        for width in [0.02f32, 0.1, 0.5, 1.0] {
            let (steps, least) = (20_000, 1e-12f64.ln());
            let mut sum = 0.0f64;
            for step in 0..steps {
                let sin_squared = (least * (f64::from(step) + 0.5) / f64::from(steps)).exp();
                let ln_cos = (0.5 * (-sin_squared).ln_1p()) as f32;
                let density = f64::from(model.density_of_half(ln_cos, 1.0 / (width * width)));
                let cosine = f64::from(ln_cos).exp();
                sum += density / cosine * std::f64::consts::PI * sin_squared * -least / f64::from(steps);
            }
            assert!((sum - 1.0).abs() < 1e-2, "{model:?} a {width}: {sum}");
        }
    }
}

#[test]
fn both_lobes_are_their_formulas() {
    // Written out from the papers, in f64 and without the rearrangements that keep digits.
    let mut random = SequentialRandom::new(11);
    for _ in 0..2000 {
        let (light, viewer) = (direction(&mut random), direction(&mut random));
        let geometry = LobeGeometry::new(Vec3::Z, light, viewer).unwrap();
        let half = (light + viewer).as_dvec3().normalize();
        let a = f64::from(0.05 + 0.95 * random.next_number());
        let (i, o, h) = (f64::from(light.z), f64::from(viewer.z), half.z);
        let exponent = 2.0 / (a * a) - 2.0;
        let g1 = |c: f64| c / (c * (1.0 - a / 2.0) + a / 2.0);
        let of_blinn_phong = (exponent + 2.0) / std::f64::consts::TAU * h.powf(exponent) * g1(i) * g1(o) / (4.0 * o);
        let lambda = |c: f64| 0.5 * ((1.0 + a * a * (1.0 - c * c) / (c * c)).sqrt() - 1.0);
        let of_ggx = a * a
            / (std::f64::consts::PI * (h * h * (a * a - 1.0) + 1.0).powi(2))
            / (1.0 + lambda(i) + lambda(o))
            / (4.0 * o);
        for (model, expected) in [(LobeModel::BlinnPhong, of_blinn_phong), (LobeModel::Ggx, of_ggx)] {
            let found = model.value(&geometry, a.ln());
            assert!((found - expected).abs() < 1e-3 * expected + 1e-9, "{model:?} a {a}: {found} {expected}");
        }
    }
}

#[test]
fn every_derivative_matches_central_differences_in_f64() {
    let mut random = SequentialRandom::new(4);
    let mut worst = 0.0f64;
    for case in 0..4000 {
        let (base, model) = (random_material(&mut random), random_model(&mut random));
        let material = Material::<f64> {
            diffuse: base.diffuse.map(f64::from),
            specular: base.specular.map(f64::from),
            log_width: f64::from(base.log_width),
        };
        let viewer = direction(&mut random);
        // Half of the cases near the peak, where narrow lobes live.
        let light = if case % 2 == 0 {
            direction(&mut random)
        } else {
            let frame = Frame::around(Vec3::Z);
            // The first number is below the least share of the specular lobe.
            let u = [0.1 * random.next_number(), random.next_number()];
            match base.sampler(model, viewer.z, 1.0).sample(&frame, viewer, u) {
                Some(light) => light,
                None => continue,
            }
        };
        let Some(geometry) = LobeGeometry::new(Vec3::Z, light, viewer) else { continue };
        let weights: [f64; 3] = std::array::from_fn(|_| f64::from(random.next_number()) - 0.3);
        let strength = 0.75;
        let loss = |material: &Material<f64>| -> f64 {
            material
                .reflect_by(model, &geometry, strength)
                .iter()
                .zip(&weights)
                .map(|(value, weight)| value * weight)
                .sum()
        };
        let gradient = material.reflect_backward_by(model, &geometry, strength, weights);
        let step = 1e-6;
        let scale = material.reflect_by(model, &geometry, strength).iter().map(|value| value.abs()).sum::<f64>() + 1e-3;
        for (entry, analytic) in gradient.to_array().into_iter().enumerate() {
            let evaluate = |delta: f64| {
                let mut values = material.to_array();
                values[entry] += delta;
                loss(&Material::from_array(values))
            };
            let difference = (evaluate(step) - evaluate(-step)) / (2.0 * step);
            let error = (analytic - difference).abs() / (scale + difference.abs());
            worst = worst.max(error);
            assert!(error < 1e-5, "entry {entry}: analytic {analytic}, difference {difference}");
        }
    }
    assert!(worst > 0.0, "differences were taken");
}

#[test]
fn samples_follow_their_density() {
    // Chi-square over a grid in (cos theta, phi); cells below 5 expected are pooled; 0.01 with a Sidak correction.
    let (rows, columns, count) = (24, 48, 200_000);
    let cases = [(0.5f32, 20.0f32), (0.5, 75.0), (0.05, 40.0), (0.05, 70.0), (0.9, 5.0), (0.01, 55.0)];
    for (case, model) in (0..cases.len()).flat_map(|case| LobeModel::ALL.map(|model| (case, model))) {
        let (roughness, degrees) = cases[case];
        let material = Material::from_maps(Vec3::splat(0.3), Vec3::splat(0.4), roughness);
        let (sin, cos) = degrees.to_radians().sin_cos();
        let viewer = Vec3::new(sin, 0.0, cos);
        let frame = Frame::around(Vec3::Z);
        let sampler = material.sampler(model, viewer.z, 1.0);
        let mut random = SequentialRandom::new(77);
        let mut observed = vec![0.0f64; rows * columns];
        for _ in 0..count {
            let u = [random.next_number(), random.next_number()];
            if let Some(light) = sampler.sample(&frame, viewer, u) {
                let phi = light.y.atan2(light.x).rem_euclid(std::f32::consts::TAU);
                let row = ((light.z * rows as f32) as usize).min(rows - 1);
                let column = ((phi / std::f32::consts::TAU * columns as f32) as usize).min(columns - 1);
                observed[row * columns + column] += 1.0;
            }
        }
        let mut expected = vec![0.0f64; rows * columns];
        let sub = 24;
        for (cell, value) in expected.iter_mut().enumerate() {
            let (row, column) = (cell / columns, cell % columns);
            for i in 0..sub * sub {
                let z = (row as f32 + ((i / sub) as f32 + 0.5) / sub as f32) / rows as f32;
                let phi =
                    (column as f32 + ((i % sub) as f32 + 0.5) / sub as f32) / columns as f32 * std::f32::consts::TAU;
                let radius = (1.0 - z * z).sqrt();
                let light = Vec3::new(radius * phi.cos(), radius * phi.sin(), z);
                if let Some(geometry) = LobeGeometry::new(Vec3::Z, light, viewer) {
                    *value += f64::from(sampler.density(&geometry));
                }
            }
            let area = std::f64::consts::TAU / (rows * columns) as f64;
            *value *= area / (sub * sub) as f64 * f64::from(count);
        }
        let (mut statistic, mut freedom, mut pooled) = (0.0, 0.0f64, (0.0, 0.0));
        for (&seen, &due) in observed.iter().zip(&expected) {
            if due < 5.0 {
                pooled = (pooled.0 + seen, pooled.1 + due);
            } else {
                statistic += (seen - due) * (seen - due) / due;
                freedom += 1.0;
            }
        }
        if pooled.1 > 5.0 {
            statistic += (pooled.0 - pooled.1) * (pooled.0 - pooled.1) / pooled.1;
            freedom += 1.0;
        }
        let p = 1.0 - ChiSquared::new(freedom - 1.0).unwrap().cdf(statistic);
        let threshold = 1.0 - 0.99f64.powf(0.5 / cases.len() as f64);
        assert!(
            p > threshold,
            "{model:?}, r {roughness} at {degrees} degrees: chi-square {statistic} over {freedom}, p {p}"
        );
    }
}

#[test]
fn nothing_is_ever_not_finite() {
    let poison = [0.0, 1.0, 1e-7, 1.0 - 1e-7, -1.0, f32::MIN_POSITIVE, 0.5];
    let mut random = SequentialRandom::new(3);
    for _ in 0..100_000 {
        let mut pick = || poison[random.below(poison.len())];
        let light = Vec3::new(pick(), pick(), pick()).normalize_or(Vec3::Z);
        let viewer = Vec3::new(pick(), pick(), pick()).normalize_or(Vec3::Z);
        let material = Material::from_maps(Vec3::splat(pick()), Vec3::splat(pick()), pick());
        let model = random_model(&mut random);
        if let Some(geometry) = LobeGeometry::new(Vec3::Z, light, viewer) {
            let value = material.reflect_by(model, &geometry, 1.0);
            let d = material.reflect_backward_by(model, &geometry, 1.0, [1.0; 3]);
            let density = material.sampler(model, geometry.cos_out, 1.0).density(&geometry);
            assert!(value.iter().all(|v| v.is_finite() && *v >= 0.0), "{geometry:?} {material:?} {value:?}");
            assert!(d.log_width.is_finite() && d.specular.iter().all(|v| v.is_finite()), "{geometry:?}");
            assert!(density.is_finite() && density >= 0.0);
        }
    }
    assert!(LobeGeometry::new(Vec3::ZERO, Vec3::Z, Vec3::Z).is_none(), "a zero normal reflects nothing");
    assert!(LobeGeometry::new(Vec3::NAN, Vec3::Z, Vec3::Z).is_none());
}
