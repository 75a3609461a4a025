//! Photos of one object, each under a light of its own: one reflectance for all.

#![allow(clippy::unwrap_used)]

use super::object_scene::*;
use patina::ErrorKind;
use patina::image::file;
use patina::insight::truth::environment_errors;
use patina::light::Environment;
use patina::measured::analytic::LobeKind;
use patina::object::joint::{Estimate, Known, estimate};
use patina::object::nodes::NodeGrid;
use patina::object::observations::ObjectView;
use patina::object::picture::{log_errors, render};
use patina::object::prior::{LightPriorKind, LogLight};
use patina::object::settings::{LightsOf, ObjectSettings};
use patina::object::starts::StartedModel;
use patina::object::transport::TexelDirections;
use patina::object::{ObjectGeometry, result_read};
use std::f32::consts::FRAC_PI_2;
use std::sync::atomic::AtomicBool;

/// The sky, and the same turned and redder.
fn lights() -> [Environment; 2] {
    let turned = sky().rotated_about_up(1.3 * FRAC_PI_2);
    [sky(), Environment { radiance: turned.radiance.map(|radiance| *radiance * glam::Vec3::new(1.5, 1.0, 0.6)) }]
}

fn settings(lights: LightsOf) -> ObjectSettings {
    ObjectSettings { prior: LightPriorKind::Gradient, lights, pixels: 800, ..small() }
}

fn found(views: &[ObjectView], known: &Known, lights: LightsOf) -> Estimate {
    let model = StartedModel::lobes(LobeKind::CookTorrance);
    estimate(views, &model, known, &settings(lights), &AtomicBool::new(false), &|_| {}).unwrap()
}

/// Log error of the object under an unseen light: as it is, and after the best factor of each channel.
fn relit_error(geometry: &ObjectGeometry, found: &Estimate) -> (f64, f64) {
    let unseen = sky().rotated_about_up(2.2 * FRAC_PI_2);
    let truth = photograph(geometry, &unseen);
    let (directions, grid) = (TexelDirections::new(64, 32).unwrap(), NodeGrid::new(small().nodes));
    let relit = render(geometry, None, &directions, &grid, &found.table, &[&unseen]).swap_remove(0);
    log_errors(geometry, &relit, &truth, 1e-3)
}

/// Degrees between the suns.
fn sun_off(own: &LogLight, truth: &Environment) -> f64 {
    let own = own.environment();
    let errors = environment_errors(&own, &truth.resampled(own.width(), own.height())).unwrap();
    errors.brightest_angle_degrees.unwrap()
}

#[test]
fn photos_under_lights_of_their_own_share_the_reflectance_and_a_probe_fixes_its_scale() {
    let geometry = ObjectGeometry::sphere(48, 48, 24.0);
    let truths = lights();
    let views = [0, 1].map(|k| view_of(&geometry, photograph(&geometry, &truths[k])));
    let each = found(&views, &Known::default(), LightsOf::Each);
    let one = found(&views, &Known::default(), LightsOf::One);
    assert!(one.further_lights.is_empty() && each.further_lights.len() == 1);
    assert!(each.picture_log_rmse < 0.06, "{}", each.picture_log_rmse);
    assert!(one.picture_log_rmse > 4.0 * each.picture_log_rmse, "{} {}", one.picture_log_rmse, each.picture_log_rmse);
    let of_each = [&each.light, &each.further_lights[0]];
    let off = [0, 1].map(|k| (sun_off(of_each[k], &truths[k]), sun_off(of_each[k], &truths[1 - k])));
    assert!(off.iter().all(|(own, other)| *own < 20.0 && *other > 60.0), "each light is its own photo's: {off:?}");
    let (_, aligned) = relit_error(&geometry, &each);
    assert!(aligned < 0.2, "{aligned}");

    let probe = Known { probes: vec![sky()], ..Known::default() };
    let probed = found(&views, &probe, LightsOf::Each);
    assert_eq!(probed.light, LogLight::of(&sky().resampled(32, 16), 1e-12), "what is known stays");
    let (raw, open) = (relit_error(&geometry, &probed).0, relit_error(&geometry, &each).0);
    assert!(raw < 0.1 && raw < 0.5 * open, "{raw}, without a probe {open}");
}

#[test]
fn probes_that_cannot_be_are_told() {
    let geometry = ObjectGeometry::sphere(24, 24, 12.0);
    let view = view_of(&geometry, photograph(&geometry, &sky()));
    let model = StartedModel::lobes(LobeKind::Ward);
    for (lights, probes) in [(LightsOf::One, 1), (LightsOf::Each, 2)] {
        let known = Known { probes: vec![sky(); probes], ..Known::default() };
        let views = [view.clone(), view.clone()];
        let error = estimate(&views, &model, &known, &settings(lights), &AtomicBool::new(false), &|_| {}).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::InvalidSetting);
        assert!(error.remedy_text().contains("--lights each"), "{error}");
    }
}

#[test]
fn the_command_line_leaves_each_light_in_the_result_and_the_result_is_read_again() {
    let folder = tempfile::tempdir().unwrap();
    let geometry = ObjectGeometry::sphere(24, 24, 12.0);
    let photos = [0, 1].map(|k| folder.path().join(format!("photo_{k}.exr")));
    for (path, light) in photos.iter().zip(lights()) {
        file::write_exr_rgb(path, &photograph(&geometry, &light)).unwrap();
    }
    let result = folder.path().join("result");
    let run = |more: &[&str]| {
        let mut command = super::program::patina();
        command.arg("object").args(&photos).args(["--sphere", "--model", "ward", "--prior", "gradient", "--quick"]);
        command.args(["--light-height", "16", "--pixels", "300", "-o"]).arg(&result).args(more).output().unwrap()
    };
    let output = run(&["--lights", "each"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(result.join("env.exr").is_file() && result.join("env_1.exr").is_file());
    let report = std::fs::read_to_string(result.join("report.html")).unwrap();
    assert!(report.contains("light of photo_0") && report.contains("light of photo_1"));
    let read = result_read::read(&result).unwrap();
    assert_eq!((read.estimate.further_lights.len(), read.settings.lights), (1, LightsOf::Each));
    // A result of one light leaves nothing of it behind.
    assert!(run(&[]).status.success() && !result.join("env_1.exr").exists());
    let refused = run(&["--env", "noon", "--lights", "each"]);
    assert_eq!(refused.status.code(), Some(2), "{}", String::from_utf8_lossy(&refused.stderr));
}
