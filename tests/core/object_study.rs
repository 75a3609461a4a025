//! The study of object mode on a library and lights made up here: that every case of figures 3 to 5 is measured, that a
//! study goes on where it was stopped, and what it refuses.

#![allow(clippy::unwrap_used)]

use glam::Vec3;
use patina::ErrorKind;
use patina::files::write_bytes;
use patina::image::{Image, file};
use patina::lab::object_study::case::{HEADER, MEASURES};
use patina::lab::object_study::{Part, StudyOptions, run};
use patina::light::Environment;
use patina::measured::fits::neural::{NAMES_FILE, WEIGHT_COUNT, WEIGHTS_FILE};
use patina::object::starts::ModelKind;
use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};

// Places of the weights of a net: six numbers come in, two layers of 21 units follow, three numbers go out.
const UNITS: usize = 21;
const FIRST_BIASES: usize = 6 * UNITS;
const SECOND: usize = FIRST_BIASES + UNITS;
const THIRD: usize = SECOND + UNITS * UNITS + UNITS;
const THIRD_BIASES: usize = THIRD + 3 * UNITS;

/// Names that no weights were trained on, so that rows do not speak of seen materials.
const MATERIALS: [(&str, [f32; 3]); 2] = [("made-up-red", [0.5, 0.1, 0.05]), ("made-up-blue", [0.05, 0.15, 0.5])];

/// Writes a library of coloured materials with a highlight, which no model of those that are fitted has exactly.
fn write_library(folder: &Path) {
    std::fs::create_dir_all(folder).unwrap();
    let mut weights = vec![0.0f32; MATERIALS.len() * WEIGHT_COUNT];
    for ((_, albedo), weights) in MATERIALS.iter().zip(weights.chunks_exact_mut(WEIGHT_COUNT)) {
        // The first unit rises from 0 to 1 over the last thirteen degrees before the half vector meets the normal: the
        // third number that comes in is its cosine. The second layer hands it on.
        weights[2 * UNITS] = 40.0;
        weights[FIRST_BIASES] = -39.0;
        weights[SECOND] = 1.0;
        weights[THIRD..THIRD + 3].fill(1.2);
        for (bias, albedo) in weights[THIRD_BIASES..].iter_mut().zip(albedo) {
            *bias = (albedo / std::f32::consts::PI).ln_1p();
        }
    }
    let bytes: Vec<u8> = weights.iter().flat_map(|weight| weight.to_le_bytes()).collect();
    let names: String = MATERIALS.iter().map(|(name, _)| format!("{name}\n")).collect();
    write_bytes(&folder.join(NAMES_FILE), names.as_bytes()).unwrap();
    write_bytes(&folder.join(WEIGHTS_FILE), &bytes).unwrap();
}

/// A sky over a floor, with a sun in this column.
fn sky(sun_column: usize) -> Environment {
    let radiance = Image::from_fn(16, 8, |row, column| match (row, column) {
        (2, column) if column == sun_column => Vec3::new(30.0, 27.0, 22.0),
        (0..4, _) => Vec3::new(0.5, 0.7, 1.0),
        _ => Vec3::new(0.25, 0.2, 0.15),
    });
    Environment { radiance }
}

/// Writes two lights: one by the name of the light that studies hold out, one for the photos.
fn write_lights(folder: &Path) {
    std::fs::create_dir_all(folder).unwrap();
    sky(6).write(&folder.join("meadow.exr")).unwrap();
    file::write_hdr(&folder.join("studio_small_03.hdr"), &sky(10).radiance).unwrap();
}

/// A folder with library and lights.
fn inputs() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    write_library(&folder.path().join("library"));
    write_lights(&folder.path().join("lights"));
    folder
}

/// A quick study of one light.
fn options(folder: &Path, output: &str, materials: usize, parts: &[Part]) -> StudyOptions {
    StudyOptions {
        library: folder.join("library"),
        envmaps: folder.join("lights"),
        mesh: None,
        weights: None,
        leave_out_weights: Vec::new(),
        models: vec![ModelKind::CookTorrance],
        quick: true,
        materials: Some(materials),
        lights: Some(1),
        parts: parts.to_vec(),
        dsbrdf_minutes: 0.0,
        seed: 1,
        output: folder.join(output),
    }
}

fn run_whole(options: &StudyOptions) -> String {
    run(options, &AtomicBool::new(false), &|_| {}).unwrap()
}

/// The rows of `results.csv`, each as its key and its measures.
fn rows(folder: &Path) -> Vec<(String, Vec<f64>)> {
    let text = std::fs::read_to_string(folder.join("results.csv")).unwrap();
    assert_eq!(text.lines().next(), Some(HEADER));
    let row = |line: &str| {
        let fields: Vec<&str> = line.split(',').collect();
        assert_eq!(fields.len(), 4 + MEASURES.len(), "{line}");
        let values: Vec<f64> = fields[4..].iter().map(|field| field.parse().unwrap()).collect();
        (fields[..4].join(","), values)
    };
    text.lines().skip(1).map(row).collect()
}

/// The rows without their last measure, the seconds, which no two sittings share.
fn rows_without_seconds(folder: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(folder.join("results.csv")).unwrap();
    text.lines().skip(1).map(|line| line.rsplit_once(',').unwrap().0.to_string()).collect()
}

/// Whether a figure measures a column: what is known beforehand has no error.
fn is_measured(key: &str, column: usize) -> bool {
    match key.split(',').next() {
        Some("fig3") => !(2..=4).contains(&column),
        Some("fig4") => matches!(column, 2..=6 | 10),
        Some("fig5" | "schedules") => column != 9,
        _ => false,
    }
}

#[test]
#[ignore = "slow: cargo test -- --ignored"]
fn every_case_is_measured_and_a_second_sitting_adds_nothing() {
    let folder = inputs();
    let options = options(folder.path(), "study", 1, &[Part::Fig3, Part::Fig4, Part::Fig5, Part::Schedules]);
    let text = run_whole(&options);
    let found = rows(&options.output);
    let keys: Vec<&str> = found.iter().map(|(key, _)| key.as_str()).collect();
    assert_eq!(
        keys,
        [
            "fig3,made-up-red,meadow,cook-torrance (clean)",
            "fig4,made-up-red,meadow,known + no prior (clean)",
            "fig4,made-up-red,meadow,known + gradient (clean)",
            "fig4,made-up-red,meadow,known + entropy (clean)",
            "fig4,made-up-red,meadow,known + deep (clean)",
            "fig5,made-up-red,meadow,cook-torrance + deep (clean)",
            "fig5,made-up-red,meadow,cook-torrance + deep (noise)",
            "fig5,made-up-red,meadow,cook-torrance + deep (8bit)",
            "schedules,made-up-red,meadow,cook-torrance + deep + own schedule (clean)",
            "schedules,made-up-red,meadow,cook-torrance + deep + three times the rounds (clean)",
            "schedules,made-up-red,meadow,cook-torrance + deep + epsilon share 0.0001 (clean)",
            "schedules,made-up-red,meadow,cook-torrance + deep + epsilon share 0.01 (clean)",
            "schedules,made-up-red,meadow,cook-torrance + deep + released schedule (clean)",
        ]
    );
    for (key, values) in &found {
        for (column, value) in values.iter().enumerate() {
            // A case that failed is NaN in all columns.
            match is_measured(key, column) {
                true => assert!(value.is_finite() && *value >= 0.0, "{key}, {}: {value}", MEASURES[column].0),
                false => assert!(value.is_nan(), "{key}, {}: {value}", MEASURES[column].0),
            }
        }
        // The object under the light that was found looks like the photo, give or take a factor per channel.
        assert!(!key.ends_with("(clean)") || values[6] < 0.5, "{key}: {}", values[6]);
    }
    for figure in ["fig3", "fig4", "fig5"] {
        for end in [".md", ".csv", "-samples.csv", "_by_light.md"] {
            let path = options.output.join(format!("{figure}{end}"));
            assert!(path.metadata().unwrap().len() > 50, "{}", path.display());
        }
    }
    let read = |name: &str| std::fs::read(options.output.join(name)).unwrap();
    let page = String::from_utf8(read("report.html")).unwrap();
    assert!(page.contains("Figure 5") && page.contains("under single lamps") && page.contains("<img"));

    // What stands there is not done again, whether the library or the command line is asked.
    let results = read("results.csv");
    assert_eq!(run_whole(&options), text);
    assert_eq!(read("results.csv"), results);
    let text = |path: &Path| path.to_str().unwrap().to_string();
    let line = ["patina-lab", "study", "ibrdf", &text(&options.library), &text(&options.envmaps)];
    let line = line.into_iter().chain(["--quick", "--models", "cook-torrance", "--materials", "1", "--lights", "1"]);
    let output = text(&options.output);
    let line = line.chain(["--parts", "fig3,fig4,fig5,schedules", "-o", &output]).map(Into::into);
    assert_eq!(patina::lab::cli::run(line), ExitCode::SUCCESS);
    assert_eq!(read("results.csv"), results);
}

#[test]
#[ignore = "slow: cargo test -- --ignored"]
fn a_study_that_was_stopped_goes_on_to_the_same_rows() {
    let folder = inputs();
    let whole = options(folder.path(), "whole", 2, &[Part::Fig3]);
    run_whole(&whole);
    let expected = rows_without_seconds(&whole.output);
    assert_eq!(expected.len(), 2);

    let broken = options(folder.path(), "broken", 2, &[Part::Fig3]);
    let error = run(&broken, &AtomicBool::new(true), &|_| {}).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Stopped);
    assert!(!broken.output.join("results.csv").exists());

    // A stop in the midst of the second case: it is no row at all, least of all one that failed.
    let stop = AtomicBool::new(false);
    let tell = |text: &str| {
        if text.starts_with("photographing made-up-blue") {
            stop.store(true, Ordering::Relaxed);
        }
    };
    let error = run(&broken, &stop, &tell).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Stopped);
    assert_eq!(rows_without_seconds(&broken.output), expected[..1]);

    run_whole(&broken);
    assert_eq!(rows_without_seconds(&broken.output), expected);
    assert!(rows(&broken.output).iter().all(|(_, values)| values[0].is_finite() && values[9].is_finite()));
}

#[test]
fn results_of_another_study_and_missing_inputs_are_refused() {
    let folder = inputs();
    let asked = options(folder.path(), "study", 1, &[Part::Fig3]);
    let refused = |options: &StudyOptions| run(options, &AtomicBool::new(false), &|_| {}).unwrap_err();

    let results = asked.output.join("results.csv");
    std::fs::create_dir_all(&asked.output).unwrap();
    write_bytes(&results, b"name,value\na,1\n").unwrap();
    let error = refused(&asked);
    assert_eq!(error.kind(), ErrorKind::Malformed);
    assert!(error.remedy_text().contains("-o"), "{error}");
    assert_eq!(std::fs::read(&results).unwrap(), b"name,value\na,1\n");

    let error = refused(&StudyOptions { library: folder.path().join("lights"), ..asked.clone() });
    assert_eq!(error.kind(), ErrorKind::Missing);
    assert!(error.to_string().contains(NAMES_FILE) && !error.remedy_text().is_empty(), "{error}");

    // The only light there is would be held out, and none is left for photos.
    let lone = folder.path().join("lone");
    std::fs::create_dir_all(&lone).unwrap();
    sky(6).write(&lone.join("meadow.exr")).unwrap();
    let error = refused(&StudyOptions { envmaps: lone, ..asked });
    assert_eq!(error.kind(), ErrorKind::Missing);
    assert!(!error.remedy_text().is_empty(), "{error}");
}
