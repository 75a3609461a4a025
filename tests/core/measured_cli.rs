//! `patina measured`, from the command line.

#![allow(clippy::unwrap_used)]

use super::beside::data;
use patina::image::file;
use patina::measured::fits::neural::{NAMES_FILE, WEIGHT_COUNT, WEIGHTS_FILE};
use std::io::Write;
use std::path::PathBuf;
use std::process::{ExitCode, Output};

fn patina(arguments: &[&str]) -> Output {
    super::program::patina().arg("measured").args(arguments).output().unwrap()
}

/// What a command prints that must succeed.
fn done(arguments: &[&str]) -> String {
    let output = patina(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// What the lab is asked for must succeed.
fn lab(arguments: &[&str]) {
    let line = ["patina-lab", "measured"].iter().chain(arguments).map(Into::into);
    assert_eq!(patina::lab::cli::run(line), ExitCode::SUCCESS, "{arguments:?}");
}

fn library() -> Option<PathBuf> {
    data("brdf/merl_dev88_names.txt")?;
    data("brdf")
}

#[test]
fn mistakes_are_told_with_a_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path().to_str().unwrap();
    for (arguments, part) in [
        (vec!["list", here], "merl_dev88_names.txt"),
        (vec!["show", "brass", "-o", here], "--library"),
        (vec!["show", "none.binary", "-o", here], "none.binary"),
        (vec!["fit", "x.binary", "--model", "phong", "-o", here], "cook-torrance"),
    ] {
        let output = patina(&arguments);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {text}");
        assert!(text.contains(part), "{arguments:?}: {text}");
    }
}

#[test]
fn a_material_is_converted_shown_and_fitted() {
    let Some(library) = library() else { return };
    let library = library.to_str().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_string();
    assert!(done(&["list", library]).contains("88 materials"));
    let table = path("brass.binary");
    done(&["convert", "brass", "--library", library, "-o", &table]);
    done(&["show", &table, "-o", &path("show"), "--size", "32"]);
    for file in ["sphere.png", "lobes.svg", "lobes.csv"] {
        assert!(folder.path().join("show").join(file).metadata().unwrap().len() > 100, "{file}");
    }
    let told = done(&["fit", &table, "--model", "bivariate", "-o", &path("fit")]);
    assert!(told.contains("bivariate table: log-RMSE 0."), "{told}");
    let fit: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(folder.path().join("fit/fit.json")).unwrap()).unwrap();
    assert_eq!(fit["material"], "brass");
    let study = ["rivals", library, "--materials", "pink-felt", "--models", "bivariate,ward", "-o", &path("rivals")];
    lab(&study);
    assert_eq!(std::fs::read_to_string(folder.path().join("rivals/rivals.jsonl")).unwrap().lines().count(), 2);
    let table = || std::fs::read_to_string(folder.path().join("rivals/rivals.md")).unwrap();
    let first = table();
    assert!(first.contains("| Ward |"));
    // The second time nothing is fitted, and the tables are the same.
    lab(&study);
    assert_eq!(table(), first);
}

#[test]
fn a_material_of_the_flow_that_ships_is_projected_onto_maps() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join("projected").join(name);
    let told = done(&["project", "brass", "-o", folder.path().join("projected").to_str().unwrap()]);
    assert!(told.contains("codes of the neural model") && told.contains("log-RMSE"), "{told}");
    let report: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(path("project.json")).unwrap()).unwrap();
    assert_eq!(report["material"], "brass");
    // What is not finite is null in the file.
    let number = |value: &serde_json::Value| value.as_f64().unwrap_or(f64::NAN);
    for figure in ["log_rmse", "log10_rmse", "cosine_rmse", "cosine_mean"] {
        let error = number(&report["error"][figure]);
        assert!(error > 0.0 && error < 20.0, "{figure}: {error}");
    }
    assert!(number(&report["error"]["cells"]) > 1e5 && number(&report["sphere_psnr_db"]) > 5.0, "{report}");
    let maps = &report["maps"];
    let colour = |channel: usize| number(&maps["diffuse"][channel]) + number(&maps["specular"][channel]);
    for channel in 0..3 {
        let parts = ["diffuse", "specular"].map(|map| number(&maps[map][channel]));
        assert!(parts.iter().all(|part| (0.0..=1.0).contains(part)), "{maps}");
    }
    assert!(colour(0) > colour(2), "brass is yellow: {maps}");
    assert!(number(&maps["roughness"]) > 0.0 && number(&maps["roughness"]) <= 1.0, "{maps}");
    assert!(report["parameters"].as_array().unwrap().iter().all(|value| number(value).is_finite()));
    // Two spheres of 256 pixels side by side, the lobes, and the table that the maps stand for.
    let (width, height) = file::read_size(&path("spheres.png")).unwrap();
    assert!(width >= 512 && height >= 256, "{width} x {height}");
    assert!(std::fs::read_to_string(path("lobes.svg")).unwrap().contains("<svg"));
    assert_eq!(path("project.binary").metadata().unwrap().len(), patina::measured::binary::FILE_LENGTH);
}

#[test]
fn the_spheres_of_a_library_are_drawn_on_one_sheet() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| {
        std::fs::File::create(folder.path().join(name)).unwrap().write_all(bytes).unwrap();
    };
    // Nets that give the same value everywhere, by their last biases: a red material and a blue one.
    write(NAMES_FILE, b"red-matt\nblue-matt\n");
    let mut weights = vec![0.0f32; 2 * WEIGHT_COUNT];
    for (material, reflectance) in [[0.25f32, 0.02, 0.02], [0.02, 0.02, 0.25]].into_iter().enumerate() {
        let last = (material + 1) * WEIGHT_COUNT;
        weights[last - 3..last].copy_from_slice(&reflectance.map(f32::ln_1p));
    }
    write(WEIGHTS_FILE, &weights.iter().flat_map(|weight| weight.to_le_bytes()).collect::<Vec<u8>>());
    let sheet = folder.path().join("sheet.png");
    lab(&["thumbnails", folder.path().to_str().unwrap(), "--size", "32", "-o", sheet.to_str().unwrap()]);
    let picture = file::read_srgb8(&sheet).unwrap();
    assert!(picture.width() >= 32 && picture.height() >= 32);
    // Paper and letters are grey, so what is red or blue is a sphere.
    let count = |strong: usize, weak: usize| {
        let is_strong = |pixel: &[u8; 3]| pixel[strong] > 70 && f32::from(pixel[strong]) > 1.5 * f32::from(pixel[weak]);
        picture.pixels().iter().filter(|pixel| is_strong(pixel)).count()
    };
    assert!(count(0, 2) > 50 && count(2, 0) > 50, "{} red and {} blue pixels", count(0, 2), count(2, 0));
}
