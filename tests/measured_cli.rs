//! `patina measured`, from the command line.

#![allow(clippy::unwrap_used)]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn patina(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_patina")).arg("measured").args(arguments).output().unwrap()
}

fn library() -> Option<PathBuf> {
    let data = std::env::var_os("PATINA_DATA")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data"), PathBuf::from);
    let folder = data.join("brdf");
    if folder.join("merl_dev88_names.txt").is_file() {
        return Some(folder);
    }
    println!("skipped: {} not present", folder.display());
    None
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
    let done = |arguments: &[&str]| {
        let output = patina(arguments);
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
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
    assert!(done(&study).contains("| Ward |"));
    assert_eq!(std::fs::read_to_string(folder.path().join("rivals/rivals.jsonl")).unwrap().lines().count(), 2);
    // The second time nothing is fitted, and the tables are the same.
    assert!(done(&study).contains("| Ward |"));
}
