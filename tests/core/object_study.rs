//! The study of object mode on a library and lights made up here: that every case of figures 3 to 5 is measured, that a
//! study goes on where it was stopped, and what it refuses.

#![allow(clippy::unwrap_used)]

use glam::Vec3;
use patina::ErrorKind;
use patina::files::write_bytes;
use patina::image::{Image, file};
use patina::lab::object_study::case::MEASURES;
use patina::lab::object_study::{StudyOptions, VERSION, run};
use patina::lab::study::{Results, Sitting, Tally};
use patina::light::Environment;
use patina::measured::fits::neural::{NAMES_FILE, WEIGHT_COUNT, WEIGHTS_FILE};
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

/// A quick study.
fn options(folder: &Path) -> StudyOptions {
    StudyOptions {
        library: folder.join("library"),
        envmaps: folder.join("lights"),
        mesh: None,
        weights: None,
        leave_out_weights: Vec::new(),
        quick: true,
        pictures: Some(folder.join("pictures")),
    }
}

fn sit(options: &StudyOptions, results: &Path, pattern: &str, stop: &AtomicBool) -> patina::Result<Tally> {
    let pattern = pattern.parse().unwrap();
    run(options, results, &Sitting { budget: None, pattern, stop, tell: &|_| {} })
}

/// The lines of a results file, each as its case and its measures.
fn rows(results: &Path) -> Vec<(String, Vec<f64>)> {
    let results = Results::read(results).unwrap();
    let row = |line: &&patina::lab::study::CaseLine| {
        (line.case.clone(), MEASURES.iter().map(|(key, ..)| line.figure(key)).collect())
    };
    results.valid(VERSION).iter().map(row).collect()
}

/// The same without the seconds, which no two sittings share.
fn rows_without_seconds(results: &Path) -> Vec<String> {
    rows(results).iter().map(|(key, values)| format!("{key} {:?}", &values[..values.len() - 1])).collect()
}

/// Whether a figure measures a column: what is known beforehand has no error.
fn is_measured(key: &str, column: usize) -> bool {
    let (light, lamps) = ((2..=8).contains(&column), column == 13);
    match key.split(' ').next() {
        Some("fig3") => !light,
        Some("fig4") => light || matches!(column, 9 | 10 | 14),
        Some("fig5" | "schedules") => !lamps,
        _ => false,
    }
}

/// Cases of the first material by the rival that is quick to fit, and those without a model.
const PATTERN: &str = "made-up-red cook-torrance,fig4 made-up-red,schedules made-up-red cook-torrance";

#[test]
#[ignore = "slow: cargo test -- --ignored"]
fn every_case_is_measured_and_a_second_sitting_adds_nothing() {
    let folder = inputs();
    let (options, stop) = (options(folder.path()), AtomicBool::new(false));
    let path = folder.path().join("results/ibrdf.jsonl");
    let tally = sit(&options, &path, PATTERN, &stop).unwrap();
    assert_eq!((tally.taken, tally.failed), (16, 0));
    let found = rows(&path);
    let mut keys: Vec<&str> = found.iter().map(|(key, _)| key.as_str()).collect();
    keys.sort_unstable();
    let mut expected = vec!["fig3 quick/development/made-up-red/meadow/cook-torrance (clean)/seed 1".to_string()];
    for prior in ["no prior", "gradient", "deep"] {
        expected.push(format!("fig4 quick/development/made-up-red/meadow/known + {prior} (clean)/seed 1"));
    }
    for (spoilt, seeds) in [("clean", 1), ("noise", 3), ("8bit", 3)] {
        for seed in 1..=seeds {
            expected
                .push(format!("fig5 quick/development/made-up-red/meadow/cook-torrance + deep ({spoilt})/seed {seed}"));
        }
    }
    let ways =
        ["own schedule", "three times the rounds", "epsilon share 0.0001", "epsilon share 0.01", "released schedule"];
    for way in ways {
        expected.push(format!(
            "schedules quick/development/made-up-red/meadow/cook-torrance + deep + {way} (clean)/seed 1"
        ));
    }
    expected.sort();
    assert_eq!(keys, expected);
    for (key, values) in &found {
        for (column, value) in values.iter().enumerate() {
            match is_measured(key, column) {
                true => assert!(value.is_finite() && *value >= 0.0, "{key}, {}: {value}", MEASURES[column].0),
                false => assert!(value.is_nan(), "{key}, {}: {value}", MEASURES[column].0),
            }
        }
        // The object under the light that was found looks like the photo, give or take a factor per channel.
        assert!(!key.contains("(clean)") || values[10] < 0.5, "{key}: {}", values[10]);
    }
    assert_eq!(std::fs::read_dir(folder.path().join("pictures")).unwrap().count(), 16);

    // What stands there is not done again, whether the library or the command line is asked.
    let results = std::fs::read(&path).unwrap();
    assert_eq!(sit(&options, &path, PATTERN, &stop).unwrap().done_before, 16);
    let text = |path: &Path| path.to_str().unwrap().to_string();
    let (library, lights) = (text(&options.library), text(&options.envmaps));
    let (kept, tables) = (text(&folder.path().join("results")), text(&folder.path().join("tables")));
    let line = ["patina-lab", "study", "ibrdf", &library, &lights, "--quick", "--cases", PATTERN, "--results", &kept];
    assert_eq!(patina::lab::cli::run(line.into_iter().map(Into::into)), ExitCode::SUCCESS);
    assert_eq!(std::fs::read(&path).unwrap(), results);
    let line = ["patina-lab", "study", "tables", "--results", &kept, "-o", &tables];
    assert_eq!(patina::lab::cli::run(line.into_iter().map(Into::into)), ExitCode::SUCCESS);
    for figure in ["fig3-quick", "fig4-quick", "fig5-quick"] {
        for end in [".md", ".csv", "-samples.csv", "_by_light.md", "_by_half.md"] {
            let path = folder.path().join("tables").join(format!("{figure}{end}"));
            assert!(path.metadata().unwrap().len() > 50, "{}", path.display());
        }
    }
    let all = std::fs::read_to_string(folder.path().join("tables/studies.md")).unwrap();
    assert!(all.contains("Figure 5") && all.contains("1 of 4 cases are done"), "{all}");
}

#[test]
#[ignore = "slow: cargo test -- --ignored"]
fn a_study_that_was_stopped_goes_on_to_the_same_lines() {
    let folder = inputs();
    let (options, stop) = (options(folder.path()), AtomicBool::new(false));
    let (whole, broken) = (folder.path().join("whole.jsonl"), folder.path().join("broken.jsonl"));
    sit(&options, &whole, "fig3 cook-torrance", &stop).unwrap();
    let expected = rows_without_seconds(&whole);
    assert_eq!(expected.len(), 2);

    let error = sit(&options, &broken, "fig3 cook-torrance", &AtomicBool::new(true)).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Stopped);
    assert!(rows(&broken).is_empty());
    // A stop as the first case ends: the second is no line at all, least of all one that failed.
    let tell = |text: &str| stop.store(text.starts_with("1 of 2"), Ordering::Relaxed);
    let sitting = Sitting { budget: None, pattern: "fig3 cook-torrance".parse().unwrap(), stop: &stop, tell: &tell };
    assert_eq!(run(&options, &broken, &sitting).unwrap_err().kind(), ErrorKind::Stopped);
    assert_eq!(rows_without_seconds(&broken), expected[..1]);
    stop.store(false, Ordering::Relaxed);
    sit(&options, &broken, "fig3 cook-torrance", &stop).unwrap();
    assert_eq!(rows_without_seconds(&broken), expected);
}

#[test]
fn damaged_results_and_missing_inputs_are_refused() {
    let folder = inputs();
    let asked = options(folder.path());
    let results = folder.path().join("results.jsonl");
    let refused = |options: &StudyOptions| sit(options, &results, "fig3", &AtomicBool::new(false)).unwrap_err();

    write_bytes(&results, b"name,value\na,1\n").unwrap();
    let error = refused(&asked);
    assert_eq!(error.kind(), ErrorKind::Malformed);
    assert!(error.to_string().contains("line 1") && !error.remedy_text().is_empty(), "{error}");
    assert_eq!(std::fs::read(&results).unwrap(), b"name,value\na,1\n");
    std::fs::remove_file(&results).unwrap();

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
