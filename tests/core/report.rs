//! The run folder and the report, from outside.

#![allow(clippy::unwrap_used)]

use glam::{Vec2, Vec3};
use patina::export::{LossRow, RunFolder, RunResult};
use patina::fit::solver::Objective;
use patina::image::{Image, RgbImage};
use patina::insight::capture::ViewCapture;
use patina::insight::intervals::IntervalCoverage;
use patina::insight::report::choice_table::{ChoiceRow, ChoiceTable};
use patina::insight::report::data::*;
use patina::insight::report::{RelitPicture, RelitStrip, ReportData, ReportImages, ViewPictures, write_report};
use patina::insight::scores::{aggregate, score_view};
use patina::insight::truth::{environment_errors, map_errors};
use patina::light::Environment;
use patina::material::MaterialMaps;
use patina::scene::{Mesh, PixelState};
use patina::{ErrorKind, Finding, Place, Severity};
use std::path::Path;

fn small_result() -> RunResult {
    let maps = MaterialMaps {
        diffuse: Image::from_fn(8, 4, |r, c| Vec3::new(r as f32 / 3.0, c as f32 / 7.0, 0.1)),
        specular: Image::from_fn(8, 4, |r, c| Vec3::splat((r * c) as f32 / 31.0)),
        roughness: Image::from_fn(8, 4, |r, c| 0.1 + (r + c) as f32 / 17.0),
    };
    let mesh = Mesh {
        positions: vec![Vec3::ZERO, Vec3::X / 3.0, Vec3::Y * 0.7, Vec3::Z],
        normals: vec![Vec3::Z; 4],
        uvs: vec![Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::splat(1.0 / 3.0)],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
    };
    let radiance = Image::from_fn(4, 2, |r, c| Vec3::splat(if r == 0 && c == 1 { 1e5 } else { 0.3 }));
    let times_seen = Image::from_fn(8, 4, |r, c| (r * c) as f32);
    RunResult { maps, environment: Environment { radiance }, mesh, times_seen, lobe: Default::default() }
}

#[test]
fn a_result_comes_back_bit_for_bit() {
    let parent = tempfile::tempdir().unwrap();
    let path = parent.path().join("deep/run");
    let folder = RunFolder::create(&path).unwrap();
    assert!(folder.is_run() && !folder.has_result());
    let result = small_result();
    result.write(&folder).unwrap();
    assert!(folder.has_result());
    assert_eq!(RunResult::read(&RunFolder::open(&path).unwrap()).unwrap(), result);
    // The same folder again: nothing is lost.
    RunFolder::create(&path).unwrap();
    assert_eq!(RunFolder::open(&path).unwrap().read_result().unwrap(), result);
    let leftovers = std::fs::read_dir(&path)
        .unwrap()
        .filter(|e| e.as_ref().unwrap().file_name().to_string_lossy().ends_with(".tmp"));
    assert_eq!(leftovers.count(), 0);
}

#[test]
fn a_missing_file_is_named_with_the_command_that_makes_it() {
    let parent = tempfile::tempdir().unwrap();
    let folder = RunFolder::create(parent.path()).unwrap();
    small_result().write(&folder).unwrap();
    std::fs::remove_file(folder.file("env.exr")).unwrap();
    let error = folder.read_result().unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Missing);
    assert_eq!(error.place(), &Place::File(folder.file("env.exr")));
    assert!(error.remedy_text().contains("patina fit"), "{error}");
    // With a checkpoint there is a shorter way.
    patina::files::write_bytes(&folder.checkpoint_path(), b"x").unwrap();
    assert!(folder.read_result().unwrap_err().remedy_text().contains("patina resume"));

    assert!(folder.read_loss().unwrap_err().to_string().contains("loss.csv"));
    let report = folder.read_report_json::<ReportData>().unwrap_err();
    assert!(report.remedy_text().contains("patina resume"), "{report}");
    assert_eq!(RunFolder::open(&folder.file("nowhere")).unwrap_err().kind(), ErrorKind::Missing);
    assert_eq!(RunFolder::open(&folder.file("seen.exr")).unwrap_err().kind(), ErrorKind::Missing);
}

#[test]
fn damaged_files_give_an_error_with_a_place() {
    let parent = tempfile::tempdir().unwrap();
    let folder = RunFolder::create(parent.path()).unwrap();
    small_result().write(&folder).unwrap();
    let whole = std::fs::read(folder.file("diffuse.exr")).unwrap();
    patina::files::write_bytes(&folder.file("diffuse.exr"), &whole[..whole.len() / 2]).unwrap();
    let error = folder.read_result().unwrap_err();
    assert!(error.to_string().contains("diffuse.exr") && !error.remedy_text().is_empty(), "{error}");

    // A map of another run, of another size.
    patina::files::write_bytes(&folder.file("diffuse.exr"), &whole).unwrap();
    std::fs::copy(folder.file("env.exr"), folder.file("specular.exr")).unwrap();
    let error = folder.read_result().unwrap_err();
    assert_eq!(error.place(), &Place::File(folder.file("specular.exr")), "{error}");

    // A result with a number that is not finite is not written in the first place.
    let mut broken = small_result();
    broken.maps.roughness[(2, 3)] = f32::NAN;
    let error = broken.write(&folder).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::NonFinite);
    assert!(error.message().contains("row 2 column 3"), "{error}");
}

#[test]
fn a_folder_that_is_not_a_run_is_left_alone() {
    let parent = tempfile::tempdir().unwrap();
    patina::files::write_bytes(&parent.path().join("mesh.obj"), b"precious").unwrap();
    let error = RunFolder::create(parent.path()).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Unwritable);
    assert!(!error.remedy_text().is_empty());
    assert_eq!(std::fs::read(parent.path().join("mesh.obj")).unwrap(), b"precious");
    assert_eq!(std::fs::read_dir(parent.path()).unwrap().count(), 1);
    assert!(RunFolder::create(&parent.path().join("mesh.obj")).is_err());
}

#[derive(Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Settings {
    steps: u32,
    background: String,
}

#[test]
fn settings_come_back_and_a_broken_line_is_named() {
    let parent = tempfile::tempdir().unwrap();
    let folder = RunFolder::create(parent.path()).unwrap();
    let settings = Settings { steps: 200, background: "use".into() };
    folder.write_settings(&settings).unwrap();
    assert_eq!(folder.read_settings::<Settings>().unwrap(), settings);
    for (text, line) in [
        ("steps = 200\nbackground = 7\n", 2),
        ("steps = 200\n\nbackground = \"use\"\nspeed = 1\n", 4),
        ("steps = -1\nbackground = \"use\"\n", 1),
        ("steps 200\n", 1),
    ] {
        patina::files::write_bytes(&folder.file("settings.toml"), text.as_bytes()).unwrap();
        let error = folder.read_settings::<Settings>().unwrap_err();
        assert_eq!(error.kind(), ErrorKind::InvalidSetting, "{error}");
        assert_eq!(error.place(), &Place::Line(folder.file("settings.toml"), line), "{error}");
    }
}

/// A shaded ball before a sky: a picture with edges, smooth parts and background.
fn ball(width: usize, height: usize, turn: f32, tint: Vec3, wobble: f32) -> (RgbImage, Image<PixelState>) {
    let mut states = Image::filled(width, height, PixelState::Background);
    let picture = Image::from_fn(width, height, |row, column| {
        let x = (column as f32 + 0.5 - 0.5 * width as f32) / (0.42 * height as f32);
        let y = (0.5 * height as f32 - row as f32 - 0.5) / (0.42 * height as f32);
        let radius = x.hypot(y);
        if radius > 1.0 {
            return Vec3::new(0.35, 0.5, 0.8) * (0.6 + 0.3 * y);
        }
        let normal = Vec3::new(x, y, (1.0 - radius * radius).max(0.0).sqrt());
        let sun = Vec3::new(turn.sin(), 0.7, turn.cos()) / 1.22;
        let highlight = normal.dot(sun).max(0.0).powf(40.0);
        let stripes = 0.75 + 0.25 * ((9.0 * (x + turn)).sin() * (9.0 * y).cos()).signum();
        let value = tint * stripes * (0.1 + 0.7 * normal.dot(sun).max(0.0)) + Vec3::splat(0.6 * highlight);
        let clipped = value.max_element() > 0.98;
        states[(row, column)] = if clipped { PixelState::SurfaceClipped } else { PixelState::Surface };
        value + Vec3::splat(wobble * (17.0 * x + 5.0 * turn).sin() * (23.0 * y).cos())
    });
    (picture, states)
}

fn example_rows() -> Vec<LossRow> {
    (0..400u64)
        .map(|step| {
            let first = step < 150;
            let start = if first { 0.2 } else { 0.03 };
            let age = if first { step } else { step - 150 } as f64;
            let image_loss = start * (-age / 40.0).exp() + 0.004 * (1.0 + 0.2 * (step as f64).sin());
            let mvcl = if first { 0.0 } else { 0.3 * (-age / 90.0).exp() };
            LossRow {
                step,
                stage: if first { "diffuse and light" } else { "all maps" }.into(),
                seconds: if first { 0.05 * step as f64 } else { 7.5 + 0.11 * age },
                loss: if step == 222 { f64::NAN } else { image_loss * mvcl.exp() },
                image_loss,
                mvcl,
                surface_rmse: None,
                held_out_rmse: step.is_multiple_of(25).then_some(0.02 + image_loss * 0.6),
            }
        })
        .collect()
}

fn write_example(folder: &RunFolder, views: usize) -> ReportData {
    let result = small_result();
    let size = 256;
    let maps = MaterialMaps {
        diffuse: Image::from_fn(size, size, |r, c| {
            let wave = 0.5 + 0.5 * ((r as f32 * 0.05).sin() * (c as f32 * 0.07).cos());
            Vec3::new(0.2 + 0.5 * wave, 0.3 * wave + 0.1, 0.15)
        }),
        specular: Image::from_fn(size, size, |r, _| Vec3::splat(if (r / 32) % 2 == 0 { 0.04 } else { 0.3 })),
        roughness: Image::from_fn(size, size, |_, c| 0.05 + 0.9 * c as f32 / size as f32),
    };
    let fitted = MaterialMaps {
        diffuse: maps.diffuse.map(|&d| d * 1.1),
        specular: maps.specular.map(|&s| s + Vec3::splat(0.01)),
        roughness: maps.roughness.map(|&r| (r * 0.9).max(0.01)),
    };
    let seen = Image::from_fn(size, size, |r, c| if r > 200 && c > 150 { 0.0 } else { (1 + (r + c) / 50) as f32 });
    let environment = |sun_column: usize| Environment {
        radiance: Image::from_fn(64, 32, |row, column| {
            let sky = if row < 16 { Vec3::new(0.4, 0.6, 1.0) } else { Vec3::splat(0.2) };
            if row == 7 && column == sun_column { Vec3::new(300.0, 280.0, 220.0) } else { sky }
        }),
    };
    let (fitted_light, true_light) = (environment(20), environment(21));

    let mut lines = Vec::new();
    let mut scored = Vec::new();
    let mut pictures = Vec::new();
    for index in 0..views {
        let held_out = index % 8 == 3;
        let turn = index as f32 * 0.4;
        let (photo, states) = ball(300, 200, turn, Vec3::new(0.8, 0.45, 0.25), 0.0);
        let (fit, _) = ball(300, 200, turn, Vec3::new(0.78, 0.47, 0.25), if held_out { 0.03 } else { 0.012 });
        let scores = score_view(&photo, &fit, &states, None, 0.0).unwrap();
        let name = format!("{index:08}");
        lines.push(ViewLine::new(&name, held_out, &scores, 1.0 + 0.01 * index as f64));
        let counted = patina::insight::scores::counted_pixels(&states, None);
        pictures.push(ViewPictures { name, held_out, photo, fit, counted: Some(counted) });
        scored.push((held_out, scores));
    }
    let of_kind = |kind: bool| aggregate(scored.iter().filter(|(held_out, _)| *held_out == kind).map(|(_, s)| s));
    let all_seen = seen.map(|&count: &f32| count > 0.0);
    let data = ReportData {
        title: "bronze ball <demo>".into(),
        objective: vec![[
            Objective { pixels: -1000.0, neighbours: 400.0, dielectrics: 0.0 },
            Objective { pixels: -1500.0, neighbours: 350.0, dielectrics: 12.0 },
        ]],
        program: "patina 0.1.0".into(),
        scene_facts: [
            ("triangles", "31 964"),
            ("charts", "212"),
            ("views", "48, 6 held out"),
            ("picture size", "768 × 576"),
            ("map size", "256 × 256"),
            ("environment", "64 × 32"),
        ]
        .map(|(name, value)| Fact { name: name.into(), value: value.into() })
        .into(),
        settings: (0..14)
            .map(|index| SettingLine {
                name: ["steps", "background", "map-size", "consistency", "learning-rate", "samples", "seed"][index % 7]
                    .into(),
                value: ["200", "use", "512", "exact", "0.01", "4", "7"][index % 7].into(),
                is_default: index % 5 != 1,
            })
            .collect(),
        findings: vec![
            (&Finding::new(Severity::Note, "up-estimated", "The up axis was estimated from the cameras.")
                .remedy("give --up when it is wrong"))
                .into(),
            (&Finding::new(Severity::Warning, "exposure-jump", "The exposure jumps by 0.8 stops.")
                .at(Place::View("00000017".into()))
                .remedy("fit exposures with --exposure per-view"))
                .into(),
        ],
        timings: [
            ("load", 1.2),
            ("atlas", 3.4),
            ("first hits", 2.2),
            ("fit", 42.0),
            ("held-out pictures", 4.1),
            ("report", f64::NAN),
        ]
        .map(|(stage, seconds)| StageTime { stage: stage.into(), seconds })
        .into(),
        peak_memory_bytes: patina::insight::memory::peak_bytes(),
        loss_history: example_rows(),
        capture: vec![ViewCapture {
            name: "00000017".into(),
            shift_x_pixels: 0.42,
            shift_y_pixels: -1.31,
            shift_error_pixels: 0.07,
            roll_degrees: -0.12,
            roll_error_degrees: 0.04,
            roll_corner_pixels: 0.4,
            shift_explains: 0.81,
            gain: 1.24,
            gain_error: 0.004,
            doubtful_mask_share: 0.013,
            unlike_share: 0.002,
        }],
        views: lines,
        aggregates: vec![
            NamedAggregate { name: "held-out views".into(), score: of_kind(true) },
            NamedAggregate { name: "training views".into(), score: of_kind(false) },
        ],
        truth: Some(TruthErrors {
            maps: Some(map_errors(&fitted, &maps, &all_seen).unwrap()),
            intervals: Some(IntervalCoverage {
                diffuse: 0.91,
                specular: 0.84,
                roughness: 0.77,
                wrong: 0.02,
                warned: 0.5,
            }),
            environment: Some(environment_errors(&fitted_light, &true_light).unwrap()),
            relit: Some(of_kind(true)),
        }),
        gauge_statement:
            "The mean of the light over the sphere is kept at its start value; reflectance takes the rest.".into(),
        evidence_statement: "Background pixels were used as pictures of the light.".into(),
        non_finite: vec![NonFiniteCount { name: "gradient of roughness".into(), count: 3 }],
        choices: Some(ChoiceTable {
            lines: vec![ChoiceRow { name: "no lobe".into(), share: Some(0.7), rmse: Some(0.04), ..Default::default() }],
            views: 4,
            pixels: 7273,
            ..ChoiceTable::default()
        }),
        texels: TexelCounts { seen: 201_331, unseen: 24_001 },
    };
    let relit = ["noon_grass_1k", "venice_sunset_1k"].map(|light| RelitStrip {
        light: light.into(),
        environment: Some(true_light.radiance.clone()),
        pictures: (0..2)
            .map(|index| {
                let picture = ball(300, 200, 1.0 + index as f32, Vec3::new(8.0, 4.0, 2.0), 0.0).0;
                let truth = (light.starts_with("noon")).then(|| picture.map(|&p| p * 1.1));
                RelitPicture { caption: format!("view {index}"), picture, truth }
            })
            .collect(),
    });
    let images = ReportImages {
        views: pictures,
        exposure_stops: 0.0,
        maps: Some(&fitted),
        truth_maps: Some(&maps),
        times_seen: Some(&seen),
        environment: Some(&fitted_light),
        truth_environment: Some(&true_light),
        relit: relit.into(),
        choices: None,
        viewer: Some("<p>all \"sides\"</p>".into()),
    };
    result.write(folder).unwrap();
    write_report(folder, &data, &images).unwrap();
    data
}

/// The page without the text of its pictures, in which any three letters may come by chance.
fn without_pictures(html: &str) -> String {
    let mut pieces = html.split(";base64,");
    let first = pieces.next().unwrap_or_default().to_string();
    pieces.fold(first, |text, piece| text + piece.split_once('"').map_or("", |(_, rest)| rest))
}

/// Every section with something in it. `PATINA_REPORT_EXAMPLE` names a folder to leave the page in, to look at.
#[test]
fn a_full_report_holds_every_section_in_one_file() {
    let parent = tempfile::tempdir().unwrap();
    let kept = std::env::var_os("PATINA_REPORT_EXAMPLE");
    let folder = RunFolder::create(kept.as_ref().map_or(parent.path(), Path::new)).unwrap();
    let data = write_example(&folder, 10);
    let html = std::fs::read_to_string(folder.report_html_path()).unwrap();
    for id in ["findings", "views", "scores", "relit", "maps", "light", "choices", "loss", "run"] {
        assert!(html.contains(&format!("<section id={id}>")), "{id}");
    }
    for text in [
        "bronze ball &lt;demo&gt;",
        "Held-out views",
        "Training views",
        "exposure-jump",
        "fit exposures with --exposure per-view",
        "noon_grass_1k",
        "fitted diffuse",
        "true light",
        "gradient of roughness",
        "relit pictures against the truth",
        "Background pixels were used",
        "class=changed",
        "held-out RMSE",
        "consistency",
    ] {
        assert!(html.contains(text), "{text}");
    }
    assert!(html.contains("srcdoc=\"&lt;p&gt;all &quot;sides&quot;"), "the 3D view is a page inside the page");
    assert_eq!(html.matches("<figure class=triple>").count(), 10);
    // Where the system tells no memory one line says so; nothing else is empty.
    let empty = html.matches("class=empty").count();
    assert!(empty <= usize::from(patina::insight::memory::peak_bytes().is_none()), "{empty} empty sections");
    let words = without_pictures(&html).replace("http://www.w3.org/2000/svg", "");
    for forbidden in ["<script", "http://", "https://", "<link", "NaN"] {
        assert!(!words.contains(forbidden), "{forbidden}");
    }
    assert!(html.len() < 15_000_000, "{} bytes", html.len());
    // report.json says the same; what was not finite is read as NaN.
    let back: ReportData = folder.read_report_json().unwrap();
    for (back, written) in back.views.iter().zip(&data.views) {
        assert_eq!((&back.name, back.held_out, back.pixels), (&written.name, written.held_out, written.pixels));
        assert!((back.raw.psnr_srgb_db - written.raw.psnr_srgb_db).abs() < 1e-9);
    }
    assert_eq!(back.views.len(), 10);
    assert!(back.objective == data.objective && html.contains("<td>-538"), "the objective's fall");
    assert!(back.loss_history[222].loss.is_nan() && back.timings[5].seconds.is_nan());
}

#[test]
fn an_empty_report_says_why_each_section_is_empty() {
    let parent = tempfile::tempdir().unwrap();
    let folder = RunFolder::create(parent.path()).unwrap();
    write_report(&folder, &ReportData::default(), &ReportImages::default()).unwrap();
    let html = std::fs::read_to_string(folder.report_html_path()).unwrap();
    for section in html.split("<section id=").skip(1) {
        assert!(section.contains("class=empty"), "{}", section.chars().take(40).collect::<String>());
    }
    assert!(html.contains("stopped before") && html.contains("No step was taken"));
}

#[test]
fn numbers_and_pixels_that_are_not_finite_do_not_break_the_page() {
    let parent = tempfile::tempdir().unwrap();
    let folder = RunFolder::create(parent.path()).unwrap();
    let nan = Image::filled(20, 10, Vec3::NAN);
    let maps = MaterialMaps { diffuse: nan.clone(), specular: nan.clone(), roughness: Image::filled(20, 10, f32::NAN) };
    let light = Environment { radiance: nan.clone() };
    let scores = score_view(&nan, &nan, &Image::filled(20, 10, PixelState::Surface), None, 0.0).unwrap();
    let data = ReportData {
        views: vec![ViewLine::new("broken", true, &scores, f64::NAN)],
        aggregates: vec![NamedAggregate { name: "held-out views".into(), score: aggregate([&scores]) }],
        loss_history: vec![LossRow {
            step: 0,
            stage: "s".into(),
            seconds: f64::NAN,
            loss: f64::INFINITY,
            image_loss: f64::NAN,
            mvcl: f64::NAN,
            surface_rmse: None,
            held_out_rmse: Some(f64::NAN),
        }],
        ..ReportData::default()
    };
    let view = |photo: RgbImage, fit: RgbImage| ViewPictures {
        name: "broken".into(),
        held_out: true,
        photo,
        fit,
        counted: None,
    };
    let empty = Image::filled(0, 0, Vec3::ZERO);
    let images = ReportImages {
        views: vec![
            view(nan.clone(), nan.clone()),
            view(empty.clone(), empty),
            view(nan.clone(), Image::filled(3, 3, Vec3::ONE)),
        ],
        maps: Some(&maps),
        environment: Some(&light),
        times_seen: Some(&maps.roughness),
        relit: vec![RelitStrip {
            light: "dark".into(),
            environment: Some(nan.clone()),
            pictures: vec![RelitPicture { caption: String::new(), picture: nan.clone(), truth: None }],
        }],
        ..ReportImages::default()
    };
    write_report(&folder, &data, &images).unwrap();
    let html = without_pictures(&std::fs::read_to_string(folder.report_html_path()).unwrap());
    assert!(!html.contains("NaN") && !html.contains(">inf"));
    folder.read_report_json::<ReportData>().unwrap();
}
