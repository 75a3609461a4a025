//! The sampler of the environment: its samples follow its density, and its density follows the light.

#![allow(clippy::unwrap_used)]

use glam::Vec3;
use patina::image::Image;
use patina::light::sky::{SkySettings, sun_and_sky};
use patina::light::{Environment, EnvironmentSampler, LightSample};
use patina::math::random::SequentialRandom;
use patina::math::statistics::Moments;
use patina::math::{luminance, sphere};
use statrs::distribution::{ChiSquared, ContinuousCDF};

fn one_texel_sun(width: usize, height: usize, row: usize, column: usize) -> Environment {
    let mut environment = Environment::constant(width, height, Vec3::ZERO);
    environment.radiance[(row, column)] = Vec3::splat(1e6);
    environment
}

fn noise(width: usize, height: usize) -> Environment {
    let mut random = SequentialRandom::new(21);
    Environment {
        radiance: Image::from_fn(width, height, |_, _| {
            Vec3::from_array(std::array::from_fn(|_| random.next_number().powi(8) * 10.0))
        }),
    }
}

/// Lights easy and hard, by name.
fn lights() -> Vec<(&'static str, Environment)> {
    let mut blue = Environment::constant(64, 32, Vec3::new(0.0, 0.0, 1e-3));
    blue.radiance[(10, 30)] = Vec3::new(1e5, 1e5, 0.0);
    vec![
        ("constant", Environment::constant(64, 32, Vec3::ONE)),
        ("one texel in all", Environment::constant(1, 1, Vec3::ONE)),
        ("noon", sun_and_sky(64, 32, &SkySettings::noon())),
        ("noise", noise(64, 32)),
        ("odd size", noise(7, 5)),
        ("sun", one_texel_sun(64, 32, 9, 40)),
        ("sun at the wrap", one_texel_sun(64, 32, 15, 0)),
        ("sun at the upper pole", one_texel_sun(64, 32, 0, 17)),
        ("sun at the lower pole", one_texel_sun(64, 32, 31, 63)),
        ("sun on a fine map", one_texel_sun(256, 128, 40, 99)),
        ("dim blue beside a yellow sun", blue),
    ]
}

/// The integral of the density over each bin of a `width x height` map, by `split^2` midpoints a bin.
fn integrated_density(sampler: &EnvironmentSampler, width: usize, height: usize, split: usize) -> Vec<f64> {
    let mut bins = vec![0.0; width * height];
    for row in 0..height * split {
        let solid_angle = sphere::solid_angle_of_texel(row, width * split, height * split);
        for column in 0..width * split {
            // The middle of the solid angle, not of theta: at a pole they differ.
            let edge = |row: usize| (std::f64::consts::PI * row as f64 / (height * split) as f64).cos();
            let theta = (0.5 * (edge(row) + edge(row + 1))).acos() as f32;
            let phi = std::f32::consts::TAU * (column as f32 + 0.5) / (width * split) as f32;
            let direction = sphere::direction_of_angles(phi, theta);
            bins[row / split * width + column / split] += f64::from(sampler.pdf(direction)) * solid_angle;
        }
    }
    bins
}

#[test]
fn the_density_integrates_to_one() {
    for (name, environment) in lights() {
        let sampler = EnvironmentSampler::new(&environment);
        let integral: f64 =
            integrated_density(&sampler, 2 * environment.width(), 2 * environment.height(), 5).iter().sum();
        assert!((integral - 1.0).abs() < 1e-3, "{name}: {integral}");
        println!("{name}: density integrates to 1 {:+.1e}", integral - 1.0);
    }
}

#[test]
fn samples_follow_the_density_by_a_chi_square_test() {
    // Bins of 60 x 28 do not line up with texels. The significance is 0.01 over all lights together (Sidak 1967).
    const SAMPLES: usize = 100_000;
    let lights = lights();
    let significance = 1.0 - 0.99f64.powf(1.0 / lights.len() as f64);
    for (name, environment) in lights {
        let sampler = EnvironmentSampler::new(&environment);
        let (width, height) = (60, 28);
        let expected = integrated_density(&sampler, width, height, 12);
        let mut counts = vec![0usize; width * height];
        let mut random = SequentialRandom::new(5);
        for _ in 0..SAMPLES {
            let direction = sampler.sample([random.next_number(), random.next_number()]).unwrap().direction;
            let (phi, theta) = sphere::angles_of_direction(direction);
            let column = (phi / std::f32::consts::TAU * width as f32) as usize;
            let row = (theta / std::f32::consts::PI * height as f32) as usize;
            counts[row.min(height - 1) * width + column.min(width - 1)] += 1;
        }
        // Bins with few expected samples are put together, smallest first, until each holds five.
        let mut pairs: Vec<(f64, f64)> =
            expected.iter().zip(&counts).map(|(&part, &count)| (part * SAMPLES as f64, count as f64)).collect();
        pairs.sort_by(|one, other| one.0.total_cmp(&other.0));
        let (mut statistic, mut cells, mut pool) = (0.0, 0usize, (0.0, 0.0));
        for (part, count) in pairs {
            pool = (pool.0 + part, pool.1 + count);
            if pool.0 >= 5.0 {
                statistic += (pool.1 - pool.0) * (pool.1 - pool.0) / pool.0;
                cells += 1;
                pool = (0.0, 0.0);
            }
        }
        assert!(cells > 4, "{name}: {cells} cells");
        let tail = 1.0 - ChiSquared::new((cells - 1) as f64).unwrap().cdf(statistic);
        assert!(tail > significance, "{name}: chi-square {statistic:.1} in {cells} cells, tail {tail:.2e}");
    }
}

#[test]
fn a_sample_is_a_unit_vector_with_the_density_that_is_told() {
    for (name, environment) in lights() {
        let sampler = EnvironmentSampler::new(&environment);
        let mut random = SequentialRandom::new(6);
        for index in 0..5_000 {
            let edge = |u: f32| [0.0, 0.999_999_94, u][(index % 50).min(2)];
            let u = [edge(random.next_number()), edge(random.next_number())];
            let LightSample { direction, density } = sampler.sample(u).unwrap();
            assert!((direction.length() - 1.0).abs() < 1e-5, "{name}: {direction}");
            assert!(density.is_finite() && density > 0.0, "{name}: {density}");
            let told = sampler.pdf(direction);
            assert!((told / density - 1.0).abs() < 5e-3, "{name} at {u:?}: {told} against {density}");
        }
    }
}

#[test]
fn wherever_there_is_light_there_is_density() {
    for (name, environment) in lights() {
        let sampler = EnvironmentSampler::new(&environment);
        let mean = f64::from(luminance(environment.mean_radiance()));
        for row in 0..100 {
            for column in 0..200 {
                let direction = sphere::direction_of_texel(row, column, 200, 100);
                let density = f64::from(sampler.pdf(direction));
                let part = f64::from(luminance(environment.radiance_towards(direction))) / mean;
                // What is above the mean over density is bounded: of that, no sample weighs more than 1.6 times the mean.
                let least = ((part - 1.0) / 1.6).max(0.0);
                assert!(density > 1e-3 && density * 4.0 * std::f64::consts::PI > least, "{name} at {direction}");
            }
        }
    }
}

#[test]
fn what_is_below_the_mean_is_left_to_the_lobe_and_an_even_light_is_not() {
    let even_part = 1.0 / 64.0 / (4.0 * std::f32::consts::PI);
    let mut environment = Environment::constant(16, 8, Vec3::ONE);
    // Half a sky ten times as bright; rows 0 to 3, so that the corners of the lower half's cells lie below the mean.
    (0..4 * 16).for_each(|texel| environment.radiance[(texel / 16, texel % 16)] = Vec3::splat(10.0));
    let sampler = EnvironmentSampler::new(&environment);
    for (phi, theta) in [(0.3, 2.2), (3.0, 2.8), (5.5, 3.1)] {
        let density = sampler.pdf(sphere::direction_of_angles(phi, theta));
        assert!((density / even_part - 1.0).abs() < 1e-4, "{density} for {even_part}");
    }
    assert!(sampler.pdf(Vec3::Y) > 50.0 * even_part);
    // Up and down by a thousandth: nearly nothing is above the mean, and density follows luminance.
    let rippled = Environment {
        radiance: Image::from_fn(16, 8, |_, column| Vec3::splat(1.0 + 1e-3 * (column as f32 * 0.8).sin())),
    };
    let sampler = EnvironmentSampler::new(&rippled);
    for phi in [0.2, 1.7, 4.4] {
        let density = sampler.pdf(sphere::direction_of_angles(phi, 1.5));
        assert!((density * 4.0 * std::f32::consts::PI - 1.0).abs() < 5e-3, "{density}");
    }
}

#[test]
fn the_estimate_of_irradiance_is_unbiased() {
    let lights = lights();
    for (name, environment) in &lights {
        let sampler = EnvironmentSampler::new(environment);
        for normal in [Vec3::Y, Vec3::new(-0.48, -0.6, -0.64)] {
            let truth = environment.irradiance(normal);
            let mut random = SequentialRandom::new(17);
            let mut moments = [Moments::default(); 3];
            for _ in 0..20_000 {
                let LightSample { direction, density } =
                    sampler.sample([random.next_number(), random.next_number()]).unwrap();
                let value = environment.radiance_towards(direction) * direction.dot(normal).max(0.0) / density;
                (0..3).for_each(|channel| moments[channel].add(f64::from(value[channel])));
            }
            for (channel, moments) in moments.iter().enumerate() {
                let standard_error = (moments.variance() / moments.count as f64).sqrt();
                let quadrature = 1e-3 * truth.max_element();
                let error = (moments.mean - truth[channel]).abs();
                assert!(
                    error <= 4.5 * standard_error + quadrature,
                    "{name} {normal} channel {channel}: {} +- {standard_error} against {truth}",
                    moments.mean
                );
            }
        }
    }
}

#[test]
fn a_small_sun_is_hit_almost_every_time() {
    let environment = one_texel_sun(64, 32, 9, 40);
    let sampler = EnvironmentSampler::new(&environment);
    let mut random = SequentialRandom::new(3);
    let moments: Moments = (0..20_000)
        .map(|_| {
            let LightSample { direction, density } =
                sampler.sample([random.next_number(), random.next_number()]).unwrap();
            f64::from(environment.radiance_towards(direction).x / density)
        })
        .collect();
    let spread = moments.variance().sqrt() / moments.mean;
    println!("relative standard deviation of one sample of a one-texel sun: {spread:.3}");
    assert!(spread < 0.15, "relative standard deviation of one sample: {spread}");
}

#[test]
fn a_black_light_gives_no_sample_and_damaged_texels_count_as_black() {
    let black = EnvironmentSampler::new(&Environment::constant(8, 4, Vec3::ZERO));
    assert!(black.is_black() && black.sample([0.3, 0.7]).is_none());
    assert_eq!(black.pdf(Vec3::X), 0.0);
    let mut damaged = Environment::constant(8, 4, Vec3::ONE);
    damaged.radiance[(1, 1)] = Vec3::new(f32::NAN, f32::INFINITY, -3.0);
    let sampler = EnvironmentSampler::new(&damaged);
    assert!(sampler.sample([0.3, 0.7]).unwrap().density.is_finite() && sampler.pdf(Vec3::ZERO).is_finite());
    let huge = EnvironmentSampler::new(&Environment::constant(8, 4, Vec3::splat(1e38)));
    assert!((huge.pdf(Vec3::X) - 0.0796).abs() < 1e-3);
}
