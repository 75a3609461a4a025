//! The environment: lookups, energy under turning and resizing, reading and repair, the procedural sky.

#![allow(clippy::unwrap_used, clippy::disallowed_methods)]

use super::beside::data;
use glam::{DVec3, Quat, Vec3};
use patina::image::{Image, RgbImage, file};
use patina::light::environment::{radiance_backward, radiance_of_tap};
use patina::light::sky::{SkySettings, sun_and_sky};
use patina::light::{Environment, EnvironmentSampler};
use patina::math::random::SequentialRandom;
use patina::math::{luminance, sphere};
use patina::{ErrorKind, Severity};
use std::f32::consts::{PI, TAU};

fn random_environment(width: usize, height: usize, seed: u64) -> Environment {
    let mut random = SequentialRandom::new(seed);
    Environment { radiance: Image::from_fn(width, height, |_, _| random_vector(&mut random).abs()) }
}

fn random_vector(random: &mut SequentialRandom) -> Vec3 {
    Vec3::new(random.next_number(), random.next_number(), random.next_number()) * 2.0 - 1.0
}

fn random_direction(random: &mut SequentialRandom) -> Vec3 {
    loop {
        let vector = random_vector(random);
        if vector.length_squared() <= 1.0 && vector.length_squared() > 1e-3 {
            return vector / vector.length();
        }
    }
}

/// One texel of a million among black.
fn one_texel_sun(width: usize, height: usize, row: usize, column: usize) -> Environment {
    let mut environment = Environment::constant(width, height, Vec3::ZERO);
    environment.radiance[(row, column)] = Vec3::splat(1e6);
    environment
}

fn assert_same_power(one: &Environment, other: &Environment, tolerance: f64, name: &str) {
    let (one, other) = (one.power(), other.power());
    let error = ((one - other).abs() / one.max(DVec3::splat(1e-30))).max_element();
    assert!(error < tolerance, "{name}: {one} became {other}, relative error {error:.2e}");
}

#[test]
fn texel_centres_give_texels_and_halfway_gives_the_mean() {
    let environment = random_environment(64, 32, 1);
    for (row, column) in [(0, 0), (31, 63), (12, 40)] {
        let found = environment.radiance_towards(7.0 * sphere::direction_of_texel(row, column, 64, 32));
        assert!((found - environment.radiance[(row, column)]).abs().max_element() < 1e-4);
    }
    let halfway = sphere::direction_of_angles(0.0, PI * 16.0 / 32.0);
    let corners = [(15, 63), (15, 0), (16, 63), (16, 0)].map(|place| environment.radiance[place]);
    let mean = corners.into_iter().sum::<Vec3>() / 4.0;
    assert!((environment.radiance_towards(halfway) - mean).abs().max_element() < 1e-4);
    assert!(environment.radiance_towards(Vec3::ZERO).is_finite(), "no direction at all is no panic");
}

#[test]
fn the_backward_lookup_is_the_transpose_at_the_wrap_and_the_poles_too() {
    let mut random = SequentialRandom::new(4);
    let environment = random_environment(16, 8, 2);
    let mut d_texels = vec![Vec3::ZERO; 16 * 8];
    let mut forward = 0.0f64;
    let special = [Vec3::Y, Vec3::NEG_Y, Vec3::NEG_Z, Vec3::new(-1e-7, 0.0, -1.0), Vec3::new(1e-6, 1.0, 0.0)];
    for index in 0..2000 {
        let direction = *special.get(index).unwrap_or(&random_direction(&mut random));
        let tap = environment.tap(direction);
        let d_radiance = random_vector(&mut random);
        forward += f64::from(radiance_of_tap(environment.radiance.pixels(), &tap).dot(d_radiance));
        radiance_backward(&mut d_texels, &tap, d_radiance);
    }
    let pairs = d_texels.iter().zip(environment.radiance.pixels());
    let backward: f64 = pairs.map(|(d, value)| d.as_dvec3().dot(value.as_dvec3())).sum();
    assert!((forward - backward).abs() < 1e-6 * 2000.0, "{forward} against {backward}");
}

#[test]
fn constant_light_has_known_power_mean_and_irradiance() {
    let radiance = Vec3::new(0.5, 1.0, 2.0);
    for (width, height) in [(64, 32), (1, 1), (5, 3)] {
        let environment = Environment::constant(width, height, radiance);
        let expected = radiance.as_dvec3() * std::f64::consts::PI;
        assert!((environment.power() - 4.0 * expected).abs().max_element() < 1e-9);
        assert!((environment.mean_radiance() - radiance).abs().max_element() < 1e-6);
        let irradiance = environment.irradiance(Vec3::new(0.6, 0.0, 0.8));
        assert!((irradiance - expected).abs().max_element() < 1e-3, "{irradiance}");
    }
}

#[test]
fn irradiance_equals_the_closed_form_of_a_sky_brighter_above() {
    // L = 1 + y on the map (linear in cos theta): E(up) = pi + 2 pi/3; the map's own interpolation error stays.
    let environment = Environment {
        radiance: Image::from_fn(256, 128, |row, column| {
            Vec3::splat(1.0 + sphere::direction_of_texel(row, column, 256, 128).y)
        }),
    };
    let expected = std::f64::consts::PI * (1.0 + 2.0 / 3.0);
    assert!((environment.irradiance(Vec3::Y).x - expected).abs() < 1e-3 * expected);
}

#[test]
fn whole_texel_turns_are_exact_and_others_follow_the_rotation() {
    let environment = random_environment(48, 24, 3);
    for texels in [0, 1, 7, 47, 48, -5] {
        let turned = environment.rotated_about_up(TAU * texels as f32 / 48.0);
        for row in 0..24 {
            for column in 0..48usize {
                let source = (column as i32 + texels).rem_euclid(48) as usize;
                assert_eq!(turned.radiance[(row, column)], environment.radiance[(row, source)]);
            }
        }
    }
    // A smooth light, so that the second interpolation costs little.
    let smooth = Environment {
        radiance: Image::from_fn(256, 128, |row, column| {
            let direction = sphere::direction_of_texel(row, column, 256, 128);
            Vec3::splat(2.0 + direction.x + 0.5 * direction.z * direction.y)
        }),
    };
    let mut random = SequentialRandom::new(8);
    for angle in [0.3f32, 1.0, -2.2, 5.0] {
        let turned = smooth.rotated_about_up(angle);
        assert_same_power(&smooth, &turned, 1e-6, "turned");
        for _ in 0..200 {
            let direction = random_direction(&mut random);
            let moved = Quat::from_rotation_y(angle) * direction;
            assert!((turned.radiance_towards(moved) - smooth.radiance_towards(direction)).x.abs() < 2e-3);
        }
    }
}

#[test]
fn a_turned_sun_keeps_its_energy() {
    let sun = one_texel_sun(64, 32, 9, 63);
    for step in 0..50 {
        assert_same_power(&sun, &sun.rotated_about_up(step as f32 * 0.137), 1e-5, "turned sun");
    }
}

#[test]
fn resizing_keeps_energy_constants_and_sign_at_any_size() {
    let sizes = [(64, 32), (128, 64), (31, 17), (100, 20), (20, 100), (1, 1), (2, 1), (65, 33), (200, 90)];
    for (width, height) in sizes {
        let constant = Environment::constant(64, 32, Vec3::new(0.1, 1.0, 10.0)).resampled(width, height);
        let worst = constant.radiance.pixels().iter().map(|&rgb| (rgb / Vec3::new(0.1, 1.0, 10.0) - 1.0).abs());
        assert!(worst.fold(0.0, |worst, error| error.max_element().max(worst)) < 1e-5, "{width}x{height}");
        for (name, environment) in [
            ("random", random_environment(64, 32, 6)),
            ("sun", one_texel_sun(64, 32, 8, 20)),
            ("sun at the pole", one_texel_sun(64, 32, 0, 0)),
            ("odd", random_environment(37, 23, 7)),
            ("one texel", random_environment(1, 1, 7)),
        ] {
            let resized = environment.resampled(width, height);
            assert_eq!((resized.width(), resized.height()), (width, height));
            assert_same_power(&environment, &resized, 1e-5, name);
            assert!(resized.radiance.pixels().iter().all(|rgb| rgb.min_element() >= 0.0 && rgb.is_finite()));
        }
    }
}

#[test]
fn resizing_keeps_the_place_of_the_light() {
    let original = sun_and_sky(128, 64, &SkySettings { sun_radius_radians: 0.3, ..SkySettings::noon() });
    for (width, height) in [(64, 32), (256, 128), (90, 50)] {
        let resized = original.resampled(width, height);
        for normal in [Vec3::Y, Vec3::X, Vec3::NEG_Z, Vec3::new(0.6, 0.8, 0.0)] {
            let (before, after) = (original.irradiance(normal), resized.irradiance(normal));
            let error = ((before - after) / before).abs().max_element();
            assert!(error < 1e-2, "{width}x{height} towards {normal}: {error}");
        }
    }
    // A texel dark beside a sun stays as dark as it was, on its far side too.
    let mut sun = Environment::constant(8, 4, Vec3::ONE);
    sun.radiance[(2, 4)] = Vec3::splat(1e5);
    let large = sun.resampled(64, 32);
    let dark = large.radiance.pixels().iter().map(|rgb| rgb.x).fold(f32::INFINITY, f32::min);
    assert!(dark > 0.3, "{dark}");
}

#[test]
fn real_environments_keep_their_power_at_the_size_of_a_fit() {
    let Some(folder) = data("envmaps") else { return };
    let entries = std::fs::read_dir(&folder).unwrap();
    let mut paths: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "hdr"));
    paths.sort();
    assert!(!paths.is_empty(), "no HDR file in {}", folder.display());
    for path in paths {
        let (environment, findings) = Environment::read(&path).unwrap();
        assert!(findings.is_empty(), "{}: {}", path.display(), findings[0]);
        let small = environment.resampled(64, 32);
        assert_same_power(&environment, &small, 1e-4, &path.display().to_string());
        assert!(!EnvironmentSampler::new(&small).is_black());
    }
}

#[test]
fn what_is_not_a_radiance_is_replaced_counted_and_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("broken.exr");
    let mut image = RgbImage::filled(8, 4, Vec3::splat(2.0));
    image[(1, 3)] = Vec3::new(f32::NAN, f32::NAN, 2.0);
    image[(2, 0)].y = -0.5;
    image[(3, 0)].y = -0.1;
    image[(0, 7)] = Vec3::splat(f32::INFINITY);
    image[(0, 0)].x = 60_000.0;
    file::write_exr_rgb(&path, &image).unwrap();
    let (environment, findings) = Environment::read(&path).unwrap();
    assert!(environment.radiance.pixels().iter().all(|rgb| rgb.is_finite() && rgb.min_element() >= 0.0));
    assert_eq!(environment.radiance[(1, 3)], Vec3::splat(2.0));
    assert_eq!(environment.radiance[(0, 7)], Vec3::splat(60_000.0));
    assert_eq!(environment.radiance[(2, 0)], Vec3::new(2.0, 0.0, 2.0));
    let told: Vec<_> = findings.iter().map(|finding| (finding.code, finding.severity)).collect();
    let warning = Severity::Warning;
    assert_eq!(
        told,
        [("environment-nan", warning), ("environment-infinite", warning), ("environment-negative", warning)]
    );
    assert!(findings[2].message.contains("2 texels"), "{}", findings[2]);
    assert!(findings[2].place.contains("broken.exr") && findings[2].place.contains("row 2 column 0"));

    file::write_exr_rgb(&path, &RgbImage::filled(2, 1, Vec3::NAN)).unwrap();
    assert_eq!(Environment::read(&path).unwrap_err().kind(), ErrorKind::NonFinite);
    assert!(Environment::from_image(RgbImage::default()).is_err());
}

#[test]
fn a_low_range_or_misshapen_environment_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sky.png");
    file::write_png_srgb8(&path, &Image::filled(6, 6, [255, 255, 255])).unwrap();
    let (environment, findings) = Environment::read(&path).unwrap();
    assert_eq!(environment.radiance[(0, 0)], Vec3::ONE);
    let codes: Vec<_> = findings.iter().map(|finding| finding.code).collect();
    assert_eq!(codes, ["environment-low-range", "environment-aspect"]);
}

#[test]
fn an_environment_survives_its_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("env.exr");
    let environment = random_environment(64, 32, 11);
    environment.write(&path).unwrap();
    assert_eq!(Environment::read(&path).unwrap(), (environment, vec![]));
}

#[test]
fn skies_have_the_light_that_was_asked_for_and_the_sun_where_it_belongs() {
    for (name, settings) in
        [("noon", SkySettings::noon()), ("evening", SkySettings::evening()), ("overcast", SkySettings::overcast())]
    {
        for (width, height) in [(64, 32), (128, 64), (9, 5), (1, 1)] {
            let sky = sun_and_sky(width, height, &settings);
            assert!(sky.radiance.pixels().iter().all(|rgb| rgb.is_finite() && rgb.min_element() >= 0.0), "{name}");
        }
        let sky = sun_and_sky(64, 32, &settings);
        let up = f64::from(luminance(sky.irradiance(Vec3::Y).as_vec3()));
        assert!((up / f64::from(settings.irradiance) - 1.0).abs() < 0.02, "{name}: {up}");
        // The ground is a diffuse surface under that light.
        let ground = sky.radiance_towards(Vec3::NEG_Y);
        let expected = settings.ground_reflectance * sky.irradiance(Vec3::Y).as_vec3() / PI;
        assert!((ground / expected - 1.0).abs().max_element() < 0.03, "{name}: {ground} against {expected}");
    }
    let settings = SkySettings::noon();
    let sky = sun_and_sky(64, 32, &settings);
    let sun = sphere::direction_of_angles(settings.sun_azimuth_radians, PI / 2.0 - settings.sun_elevation_radians);
    assert!(luminance(sky.radiance_towards(sun)) > 50.0 * luminance(sky.mean_radiance()));
    let away = sky.radiance_towards(Vec3::new(-sun.x, 0.5, -sun.z));
    assert!(away.z > 1.5 * away.x, "a clear sky is blue: {away}");
    let evening = sun_and_sky(64, 32, &SkySettings::evening());
    let low = sphere::direction_of_angles(SkySettings::evening().sun_azimuth_radians, PI / 2.0 - 0.15);
    let glow = evening.radiance_towards(low);
    assert!(glow.x > 1.5 * glow.z, "a low sun is warm: {glow}");
    let grey = sun_and_sky(64, 32, &SkySettings::overcast());
    let ratio = grey.radiance_towards(Vec3::Y) / grey.radiance_towards(Vec3::new(1.0, 0.05, 0.0));
    assert!((2.0..3.2).contains(&ratio.y), "an overcast sky is brightest above: {ratio}");
}

#[test]
fn the_energy_of_the_sun_depends_neither_on_its_radius_nor_on_the_size_of_the_map() {
    let towards_sun = |settings: &SkySettings, size: usize| {
        let sun = sphere::direction_of_angles(settings.sun_azimuth_radians, PI / 2.0 - settings.sun_elevation_radians);
        luminance(sun_and_sky(2 * size, size, settings).irradiance(sun).as_vec3())
    };
    let noon = SkySettings::noon();
    let reference = towards_sun(&noon, 64);
    for (radius, size) in [(0.02, 64), (0.1, 64), (noon.sun_radius_radians, 32), (noon.sun_radius_radians, 128)] {
        let found = towards_sun(&SkySettings { sun_radius_radians: radius, ..noon }, size);
        assert!((found / reference - 1.0).abs() < 0.02, "radius {radius}, {size} rows: {found} against {reference}");
    }
}
