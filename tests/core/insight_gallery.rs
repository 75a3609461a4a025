//! What a user does after a fit: pictures under other lights, a turntable, a moved scale, the table of baked-in light.

#![allow(clippy::unwrap_used)]

use super::common::*;
use glam::{Vec2, Vec3};
use patina::ErrorKind;
use patina::export::{RunFolder, RunResult};
use patina::image::display::{DisplaySettings, ToneCurve};
use patina::image::{Image, RgbImage, file};
use patina::job::entanglement::{Entanglement, EntanglementSettings, entanglement};
use patina::job::gallery::{
    NamedLight, Turning, TurntableSettings, camera_of_frame, relight_strip, save_picture, turntable, write_turntable,
};
use patina::job::gauge::{Move, factor_of_patch, move_run, move_scale};
use patina::job::pictures::{light_of, parameters, relit};
use patina::job::prepare::RunSettings;
use patina::light::Environment;
use patina::material::MaterialMaps;
use patina::measured::table::MeasuredBrdf;
use patina::render::picture::{PictureSettings, render};
use patina::render::{Parameters, Surface};
use patina::scene::Scene;
use patina::scene::demo::DemoSettings;
use std::ffi::OsString;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

static GO: AtomicBool = AtomicBool::new(false);

fn quick_picture() -> PictureSettings {
    PictureSettings { samples: 4, max_bounces: 2, ..Default::default() }
}

fn light(name: &str) -> NamedLight {
    NamedLight { name: name.into(), environment: light_of(name, 16).unwrap().environment }
}

/// Maps of the trial's ball and floor that differ from texel to texel.
fn maps() -> MaterialMaps {
    MaterialMaps {
        diffuse: Image::from_fn(16, 16, |row, column| {
            Vec3::new(0.1 + 0.02 * row as f32, 0.3, 0.1 + 0.02 * column as f32)
        }),
        specular: Image::filled(16, 16, Vec3::splat(0.04)),
        roughness: Image::from_fn(16, 16, |row, _| 0.1 + 0.05 * row as f32),
    }
}

#[test]
fn a_strip_holds_the_same_view_under_each_light() {
    let trial = Trial::default();
    let (surface, own, camera) = (trial.surface(), trial.truth(), camera_at(0.0, 35.0, 20, 16));
    let lights = [light("noon"), light("overcast")];
    let told = std::cell::Cell::new(0.0);
    let settings = quick_picture();
    let strip = relight_strip(&surface, &own, &camera, &lights, &settings, &GO, &|share| told.set(share)).unwrap();
    assert_eq!((strip.len(), told.get()), (2, 1.0));
    for (picture, light) in strip.iter().zip(&lights) {
        assert_eq!(picture, &relit(&surface, &own, &light.environment, &camera, 0, &settings, &GO));
    }
    let stopped = relight_strip(&surface, &own, &camera, &lights, &settings, &AtomicBool::new(true), &|_| {});
    assert_eq!(stopped.unwrap_err().kind(), ErrorKind::Stopped);
}

#[test]
fn a_turntable_comes_around_and_both_ways_of_turning_show_the_same() {
    // A ball of one material: the light turned one way is the camera turned the other.
    let trial = Trial { mesh: laid_out(patina::scene::synthetic::shapes::sphere(0.7, 6)), ..Default::default() };
    let (surface, own) = (trial.surface(), trial.truth());
    let settings = TurntableSettings { frames: 4, size: (24, 24), turning: Turning::Camera, start: None };
    let picture = PictureSettings { samples: 64, background_visible: false, ..quick_picture() };
    let frames = |turning: Turning| {
        let mut frames = Vec::new();
        let settings = TurntableSettings { turning, ..settings.clone() };
        turntable(&surface, &own, None, &settings, &picture, &GO, &mut |number, picture| {
            assert_eq!(number, frames.len());
            frames.push(picture.radiance);
            Ok(())
        })
        .unwrap();
        frames
    };
    let (camera, light) = (frames(Turning::Camera), frames(Turning::Light));
    let distance = |a: &RgbImage, b: &RgbImage| -> f32 {
        a.pixels().iter().zip(b.pixels()).map(|(a, b)| (*a - *b).length()).sum::<f32>() / a.pixels().len() as f32
    };
    assert_eq!((camera.len(), light.len()), (4, 4));
    let noise = distance(&camera[1], &light[3]).max(distance(&camera[3], &light[1]));
    assert!(noise < 0.3 * distance(&camera[1], &camera[3]), "{noise} {}", distance(&camera[1], &camera[3]));
    assert!(distance(&camera[0], &camera[2]) > 0.02);
    let (first, beyond) =
        (camera_of_frame(surface.mesh(), &settings, 0), camera_of_frame(surface.mesh(), &settings, 4));
    assert!((first.position_in_world() - beyond.position_in_world()).length() < 1e-4);
}

#[test]
fn a_turntable_is_numbered_files_and_a_stop_leaves_whole_ones() {
    let trial = Trial::default();
    let (surface, own) = (trial.surface(), trial.truth());
    let folder = tempfile::tempdir().unwrap();
    let settings = TurntableSettings { frames: 3, size: (16, 12), turning: Turning::Camera, start: None };
    let display = DisplaySettings::default();
    let files =
        write_turntable(folder.path(), &surface, &own, None, &settings, &quick_picture(), &display, &GO, &|_| {})
            .unwrap();
    assert_eq!(files.len(), 3);
    assert!(files[2].ends_with("frame_0002.png"));
    assert!(files.iter().all(|path| file::read_size(path).unwrap() == (16, 12)));

    let other = tempfile::tempdir().unwrap();
    let stop = AtomicBool::new(false);
    let raise = |_| stop.store(true, Ordering::Relaxed);
    let outcome =
        write_turntable(other.path(), &surface, &own, None, &settings, &quick_picture(), &display, &stop, &raise);
    assert_eq!(outcome.unwrap_err().kind(), ErrorKind::Stopped);
    assert_eq!(std::fs::read_dir(other.path()).unwrap().count(), 1);
    let none = TurntableSettings { frames: 0, ..settings };
    let outcome = turntable(&surface, &own, None, &none, &quick_picture(), &GO, &mut |_, _| Ok(()));
    assert_eq!(outcome.unwrap_err().kind(), ErrorKind::InvalidSetting);
}

#[test]
fn a_saved_picture_is_what_the_screen_shows_or_radiance() {
    let folder = tempfile::tempdir().unwrap();
    let picture = Image::from_fn(9, 6, |row, column| Vec3::new(row as f32 * 0.3, column as f32 * 0.1, 0.2));
    let display =
        DisplaySettings { exposure_stops: 1.0, curve: ToneCurve::Filmic, stripes: true, ..Default::default() };
    let png = folder.path().join("sub/a.PNG");
    save_picture(&png, &picture, &display).unwrap();
    let bytes = file::read_srgb8(&png).unwrap();
    for row in 0..6 {
        for column in 0..9 {
            let expected = display.bytes(picture[(row, column)], row as u32, column as u32);
            assert_eq!(bytes[(row, column)], expected);
        }
    }
    let exr = folder.path().join("a.exr");
    save_picture(&exr, &picture, &display).unwrap();
    assert_eq!(file::read_rgb(&exr).unwrap(), picture);
    for name in ["a.jpg", "a"] {
        let error = save_picture(&folder.path().join(name), &picture, &display).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Unsupported);
        assert!(!folder.path().join(name).exists());
    }
}

fn demo() -> Scene {
    let small =
        DemoSettings { views: 3, held_out: 2, width: 32, height: 24, map_size: 64, seed: 1, ..Default::default() };
    patina::job::demo::scene(&small, &mut Vec::new(), &GO, &|_| {}).unwrap()
}

#[test]
fn light_that_is_baked_into_the_maps_shows_under_other_lights_only() {
    let scene = demo();
    let truth = scene.truth.as_ref().unwrap();
    let surface = Surface::new(scene.mesh.clone()).unwrap();
    let settings = EntanglementSettings::default();
    let lights = [light("evening"), light("overcast")];
    let table = |own: &Parameters<f32>| match entanglement(&scene, &surface, own, &lights, &settings, &GO, &|_| {}) {
        Ok(Entanglement::Known(rows)) => rows,
        other => panic!("{other:?}"),
    };
    let rows = table(&parameters(&truth.maps, &truth.environment));
    let names: Vec<&str> = rows.iter().map(|row| row.light.as_str()).collect();
    assert_eq!(names, ["the light of the photos", "novel lighting", "evening", "overcast"]);
    assert_eq!(rows.iter().map(|row| row.is_own).collect::<Vec<_>>(), [true, false, false, false]);

    // Reflectance times 0.8, light over it: right again once the scale is aligned.
    let moved = move_scale(&truth.maps, &truth.environment, Vec3::splat(0.8)).unwrap();
    let scaled = table(&parameters(&moved.maps, &moved.environment));
    // Light on the map: brightness that changes along it, as shadows would.
    let mut baked = truth.maps.clone();
    let size = baked.diffuse.width();
    for (index, diffuse) in baked.diffuse.pixels_mut().iter_mut().enumerate() {
        *diffuse *= if (index / size / 4 + index % size / 4).is_multiple_of(2) { 0.5 } else { 1.0 };
    }
    let baked = table(&parameters(&baked, &truth.environment));
    for row in 1..4 {
        let (own, scaled, baked) = (&rows[row].score, &scaled[row].score, &baked[row].score);
        assert!(own.views > 0 && own.raw.rmse_linear.is_finite());
        assert!(scaled.raw.rmse_linear > scaled.aligned.rmse_linear);
        assert!(baked.aligned.rmse_linear > 1.5 * own.aligned.rmse_linear, "{row}: {baked:?} {own:?}");
    }
    // Overcast light has no sun whose noise hides the scale.
    assert!(scaled[3].score.raw.rmse_linear > 2.0 * rows[3].score.raw.rmse_linear, "{scaled:?}");

    let unknown = Scene { truth: None, ..scene.clone() };
    let own = parameters(&truth.maps, &truth.environment);
    let outcome = entanglement(&unknown, &surface, &own, &lights, &settings, &GO, &|_| {}).unwrap();
    assert!(matches!(outcome, Entanglement::Unknown(sentence) if sentence.ends_with('.')));
    let stopped = entanglement(&scene, &surface, &own, &lights, &settings, &AtomicBool::new(true), &|_| {});
    assert_eq!(stopped.unwrap_err().kind(), ErrorKind::Stopped);
}

#[test]
fn a_moved_scale_leaves_pictures_of_diffuse_surfaces_as_they_were() {
    let trial = Trial::default();
    let surface = trial.surface();
    let (maps, light) = (maps(), sky());
    let factor = Vec3::new(1.3, 0.7, 0.9);
    let moved = move_scale(&maps, &light, factor).unwrap();
    assert_eq!((moved.bounded_share, &moved.maps.roughness), (0.0, &maps.roughness));
    assert!((moved.maps.diffuse[(3, 4)] - maps.diffuse[(3, 4)] * factor).abs().max_element() < 1e-6);
    assert!((moved.maps.specular[(3, 4)] - maps.specular[(3, 4)] * factor).abs().max_element() < 1e-6);
    let picture = |maps: &MaterialMaps, light: &Environment, bounces: usize, lobe: f32| {
        let settings = PictureSettings {
            samples: 16,
            max_bounces: bounces,
            lobe_strength: lobe,
            background_visible: false,
            ..Default::default()
        };
        render(&surface, &camera_at(20.0, 35.0, 24, 20), &parameters(maps, light), 0, &settings, &GO).radiance
    };
    let change = |bounces: usize, lobe: f32| -> f32 {
        let before = picture(&maps, &light, bounces, lobe);
        let after = picture(&moved.maps, &moved.environment, bounces, lobe);
        let pairs = before.pixels().iter().zip(after.pixels());
        pairs.map(|(a, b)| (*a - *b).abs().max_element() / a.max_element().max(0.01)).fold(0.0, f32::max)
    };
    assert!(change(1, 0.0) < 1e-4, "direct light on diffuse surfaces is free: {}", change(1, 0.0));
    assert!(change(3, 0.0) > 1e-3, "interreflection breaks the freedom");

    let high = move_scale(&maps, &light, Vec3::splat(3.0)).unwrap();
    assert!(high.bounded_share > 0.0 && high.maps.diffuse.pixels().iter().all(|rgb| rgb.max_element() <= 1.0));
    for wrong in [Vec3::ZERO, Vec3::new(1.0, -1.0, 1.0), Vec3::NAN, Vec3::splat(f32::INFINITY), Vec3::splat(1e-44)] {
        assert_eq!(move_scale(&maps, &light, wrong).unwrap_err().kind(), ErrorKind::InvalidSetting, "{wrong}");
    }
}

#[test]
fn a_pinned_patch_gets_its_reflectance() {
    let maps = maps();
    let uv = Vec2::new(0.40, 0.55);
    for radius in [0, 3] {
        let factor = factor_of_patch(&maps, uv, radius, Vec3::splat(0.18)).unwrap();
        let moved = move_scale(&maps, &sky(), factor).unwrap();
        let again = factor_of_patch(&moved.maps, uv, radius, Vec3::splat(0.18)).unwrap();
        assert!((again - Vec3::ONE).abs().max_element() < 1e-5, "{again}");
        if radius == 0 {
            // v 0.55 of 16 texels is row 7, u 0.40 column 6.
            assert!((moved.maps.diffuse[(7, 6)] - Vec3::splat(0.18)).abs().max_element() < 1e-6);
        }
    }
    let mut black = maps.clone();
    black.diffuse[(7, 6)] = Vec3::new(0.5, 0.0, 0.5);
    let grey = Vec3::splat(0.18);
    for error in [
        factor_of_patch(&black, uv, 0, grey),
        factor_of_patch(&maps, Vec2::new(1.2, 0.5), 0, grey),
        factor_of_patch(&maps, Vec2::NAN, 0, grey),
        factor_of_patch(&maps, uv, 0, Vec3::splat(1.5)),
        factor_of_patch(&maps, uv, 0, Vec3::ZERO),
    ] {
        assert_eq!(error.unwrap_err().kind(), ErrorKind::InvalidSetting);
    }
}

/// A run folder of the demo's truth.
fn run_of_demo(path: &Path) -> RunResult {
    let truth_of = patina::scene::demo::build(&DemoSettings { map_size: 64, ..Default::default() }).unwrap().scene;
    let truth = truth_of.truth.unwrap();
    let result = RunResult {
        times_seen: Image::filled(64, 64, 1.0),
        maps: truth.maps,
        environment: truth.environment,
        mesh: truth_of.mesh,
        lobe: Default::default(),
    };
    let folder = RunFolder::create(path).unwrap();
    folder.write_settings(&RunSettings::default()).unwrap();
    folder.write_result(&result).unwrap();
    result
}

fn patina(arguments: &[&str]) -> String {
    let all = std::iter::once("patina").chain(arguments.iter().copied()).map(OsString::from);
    format!("{:?}", patina::cli::run(all))
}

#[test]
fn a_run_is_moved_into_a_new_folder_and_the_command_line_does_the_same() {
    let base = tempfile::tempdir().unwrap();
    let path = |name: &str| base.path().join(name);
    let text = |name: &str| path(name).to_string_lossy().into_owned();
    let before = run_of_demo(&path("run"));
    let factor = Vec3::new(0.8, 0.9, 0.7);
    let moved = move_run(&path("run"), &Move::Factor(factor), &path("moved")).unwrap();
    assert_eq!((moved.factor, moved.findings.len()), (factor, 0));
    let after = RunFolder::open(&path("moved")).unwrap().read_result().unwrap();
    let expected = move_scale(&before.maps, &before.environment, factor).unwrap();
    assert_eq!((after.maps, after.environment), (expected.maps, expected.environment));
    assert_eq!(RunFolder::open(&path("run")).unwrap().read_result().unwrap().maps, before.maps, "the old run");
    for full in ["moved", "run"] {
        let error = move_run(&path("run"), &Move::Factor(factor), &path(full)).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Unwritable);
    }

    let (run, none) = (text("run"), text("none"));
    let success = format!("{:?}", std::process::ExitCode::SUCCESS);
    assert_eq!(patina(&["gauge", &text("run"), "--factor", "0.8,0.9,0.7", "-o", &text("typed")]), success);
    let typed = RunFolder::open(&path("typed")).unwrap().read_result().unwrap();
    assert_eq!(typed.maps.diffuse, move_scale(&before.maps, &before.environment, factor).unwrap().maps.diffuse);
    // A texel of the floor.
    let (row, column) = (40, 20);
    let patch = format!("{},{}=0.18", (column as f32 + 0.5) / 64.0, 1.0 - (row as f32 + 0.5) / 64.0);
    let new = text("grey");
    let grey = ["gauge", &run, "--patch", &patch, "--radius", "0", "-o", &new];
    assert_eq!(patina(&grey), success);
    let pinned = RunFolder::open(&path("grey")).unwrap().read_result().unwrap().maps.diffuse[(row, column)];
    assert!((pinned - Vec3::splat(0.18)).abs().max_element() < 1e-5, "{pinned}");
    for wrong in [["--factor", "1,2"], ["--factor", "0"], ["--patch", "nonsense"]] {
        let typed = ["gauge", &run, wrong[0], wrong[1], "-o", &none];
        assert_ne!(patina(&typed), success, "{wrong:?}");
        assert!(!path("none").exists());
    }

    // Lights of one name from several folders, and dots in names: each has pictures of its own.
    let dark = |name: &str, radiance: f32| {
        file::write_exr_rgb(&path(name), &RgbImage::filled(8, 4, Vec3::splat(radiance))).unwrap();
        text(name)
    };
    let lights = [dark("a/sky.v2.exr", 1.0), dark("b/sky.v2.exr", 2.0)];
    let mut relight = vec!["relight", &run, "--views", "0000", "--samples", "1", "--shrink", "8", "--env"];
    relight.extend(lights.iter().map(String::as_str));
    assert_eq!(patina(&relight), success);
    let pictures = ["0000_sky.v2", "0000_sky.v2_2"].map(|name| {
        assert!(path("run").join(format!("relight/{name}.png")).is_file(), "{name}");
        file::read_rgb(&path("run").join(format!("relight/{name}.exr"))).unwrap()
    });
    assert_eq!((pictures[0].width(), pictures[0].height()), (pictures[1].width(), pictures[1].height()));
    for wrong in [["--rotate", "nan"], ["--bounces", "0"], ["--bounces", "17"], ["--samples", "0"]] {
        let typed = ["relight", &run, "--env", "noon", wrong[0], wrong[1]];
        assert_ne!(patina(&typed), success, "{wrong:?}");
    }

    let turn = ["relight", &run, "--env", "overcast", "--turntable", "2", "--size", "24x18", "--samples", "2"];
    assert_eq!(patina(&turn), success);
    let frame = path("run").join("relight/turntable_overcast/frame_0001.png");
    assert_eq!(file::read_size(&frame).unwrap(), (24, 18));
    // A material on the whole surface turns with it.
    let gold = path("gold.binary");
    MeasuredBrdf::from_fn(|_| [0.3, 0.2, 0.02]).write(&gold).unwrap();
    let (gold, other) = (text("gold.binary"), text("turned"));
    let mut of_gold = turn.to_vec();
    of_gold.extend(["--material", &gold, "-o", &other]);
    assert_eq!(patina(&of_gold), success);
    let turned = file::read_srgb8(&path("turned/turntable_overcast/frame_0001.png")).unwrap();
    assert_ne!(turned, file::read_srgb8(&frame).unwrap());
    let wrong = ["relight", &run, "--env", "noon", "--turntable", "2", "--size", "24"];
    assert_ne!(patina(&wrong), success);
}
