//! The measured materials that a user gives to parts of a surface: by name, by folder, by file, and what mistakes say.

#![allow(clippy::unwrap_used)]

use glam::{Vec2, Vec3};
use patina::error::{Error, ErrorKind, Finding, Place, Severity};
use patina::image::{Image, file};
use patina::job::regions::read;
use patina::math::frame::Frame;
use patina::measured::MeasuredBrdf;
use patina::measured::fits::neural::{NAMES_FILE, WEIGHT_COUNT, WEIGHTS_FILE};
use patina::render::regions::Regions;
use std::f64::consts::PI;
use std::io::Write;
use std::path::{Path, PathBuf};

fn write(path: &Path, bytes: &[u8]) {
    std::fs::File::create(path).unwrap().write_all(bytes).unwrap();
}

/// Writes the table of a matt material that reflects this share of the light.
fn write_matt(path: &Path, albedo: f64) {
    MeasuredBrdf::from_fn(move |_| [albedo / PI; 3]).write(path).unwrap();
}

/// Writes a mask that is white where `holds` says so, by row and column.
fn write_mask(path: &Path, width: usize, height: usize, holds: impl Fn(usize, usize) -> bool) {
    let mask = Image::from_fn(width, height, |row, column| if holds(row, column) { [255u8; 3] } else { [0; 3] });
    file::write_png_srgb8(path, &mask).unwrap();
}

/// A library folder of two matt materials: the nets give the same value everywhere, by their last biases.
fn write_library(folder: &Path) {
    write(&folder.join(NAMES_FILE), b"matt-grey\nplain-dark\n");
    let mut weights = vec![0.0f32; 2 * WEIGHT_COUNT];
    for (material, albedo) in [0.6f32, 0.2].into_iter().enumerate() {
        let last = (material + 1) * WEIGHT_COUNT;
        weights[last - 3..last].fill((albedo / std::f32::consts::PI).ln_1p());
    }
    let bytes: Vec<u8> = weights.iter().flat_map(|weight| weight.to_le_bytes()).collect();
    write(&folder.join(WEIGHTS_FILE), &bytes);
}

fn text(path: &Path) -> String {
    path.to_str().unwrap().into()
}

fn read_one(material: &str, library: Option<&Path>) -> (Regions, Vec<Finding>) {
    read(&[material.into()], &[], library).unwrap().unwrap()
}

/// Albedo of the matt material at a place of the texture square; `None` where the maps hold.
fn albedo_at(regions: &Regions, uv: [f32; 2]) -> Option<f32> {
    let frame = Frame::around(Vec3::Z);
    regions.at(Vec2::from_array(uv)).map(|own| own.reflect(&frame, Vec3::Z, Vec3::Z)[1] * std::f32::consts::PI)
}

fn is_about(found: Option<f32>, expected: f32) -> bool {
    found.is_some_and(|found| (found - expected).abs() < 1e-3)
}

#[test]
fn a_material_is_named_by_the_flow_that_ships_by_a_result_folder_or_by_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let (result, table) = (folder.path().join("vase-run"), folder.path().join("chalk.binary"));
    std::fs::create_dir(&result).unwrap();
    write_matt(&result.join("reflectance.binary"), 0.5);
    write_matt(&table, 0.8);
    write_library(folder.path());
    // One material without a mask holds everywhere.
    for (material, library, name, expected) in [
        (text(&result), None, "vase-run", 0.5),
        (text(&table), None, "chalk", 0.8),
        ("matt-grey".to_string(), Some(folder.path()), "matt-grey", 0.6),
    ] {
        let (regions, findings) = read_one(&material, library);
        assert_eq!(regions.materials().len(), 1, "{name}");
        assert_eq!(regions.materials()[0].name, name);
        for uv in [[0.01, 0.99], [0.5, 0.5], [0.99, 0.01]] {
            assert!(is_about(albedo_at(&regions, uv), expected), "{name} at {uv:?}: {:?}", albedo_at(&regions, uv));
        }
        assert!(findings.is_empty(), "{name}: {findings:?}");
    }
    let (regions, findings) = read_one("white-fabric", None);
    assert_eq!(regions.materials()[0].name, "white-fabric");
    let straight = albedo_at(&regions, [0.5, 0.5]).unwrap();
    assert!(straight > 0.05 && straight < 2.0, "{straight}");
    assert!(findings.is_empty(), "{findings:?}");
    // Without a material there is nothing to do.
    assert!(read(&[], &[], None).unwrap().is_none());
}

#[test]
fn a_material_that_makes_light_of_nothing_is_told_and_used() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("glowing.binary");
    write_matt(&path, 1.5);
    let (regions, findings) = read_one(&text(&path), None);
    assert!(is_about(albedo_at(&regions, [0.5, 0.5]), 1.5));
    assert_eq!(findings.len(), 1, "{findings:?}");
    assert_eq!((findings[0].severity, findings[0].code), (Severity::Warning, "region-gains-energy"));
    assert!(findings[0].message.contains("glowing reflects up to 1.50 times"), "{}", findings[0].message);
    assert!(!findings[0].remedy.is_empty());
}

#[test]
fn masks_say_where_materials_hold_and_the_last_one_wins() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    write_library(folder.path());
    let materials = ["matt-grey".to_string(), "plain-dark".to_string()];
    let regions_of = |masks: [PathBuf; 2]| read(&materials, &masks, Some(folder.path())).unwrap().unwrap();
    // The first holds in the left half, the second in the upper half: row 0 of a mask is v = 1.
    write_mask(&path("left.png"), 4, 2, |_, column| column < 2);
    write_mask(&path("upper.png"), 4, 2, |row, _| row == 0);
    let (regions, findings) = regions_of([path("left.png"), path("upper.png")]);
    assert!(findings.is_empty(), "{findings:?}");
    assert!(is_about(albedo_at(&regions, [0.1, 0.1]), 0.6));
    assert!(is_about(albedo_at(&regions, [0.9, 0.9]), 0.2));
    assert!(is_about(albedo_at(&regions, [0.1, 0.9]), 0.2), "the last mask wins");
    assert_eq!(albedo_at(&regions, [0.9, 0.1]), None);
    // The other way round.
    let (regions, _) = regions_of([path("upper.png"), path("left.png")]);
    assert!(is_about(albedo_at(&regions, [0.1, 0.9]), 0.2) && is_about(albedo_at(&regions, [0.9, 0.9]), 0.6));
    // A mask that covers nothing leaves the maps where they are, and is told.
    write_mask(&path("black.png"), 4, 2, |_, _| false);
    let (regions, findings) = regions_of([path("black.png"), path("upper.png")]);
    assert_eq!(findings.len(), 1, "{findings:?}");
    assert!(findings[0].code == "region-empty" && findings[0].place.contains("black.png"), "{findings:?}");
    assert_eq!(albedo_at(&regions, [0.1, 0.1]), None);
    assert!(is_about(albedo_at(&regions, [0.1, 0.9]), 0.2));
}

/// What a call says that must fail, with a remedy.
fn mistake(materials: &[&str], masks: &[PathBuf], library: Option<&Path>) -> Error {
    let materials: Vec<String> = materials.iter().map(|material| (*material).into()).collect();
    let error = read(&materials, masks, library).err().unwrap();
    assert!(!error.remedy_text().is_empty(), "{error}");
    error
}

#[test]
fn materials_that_are_not_there_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let error = mistake(&["no-such-material"], &[], None);
    assert_eq!((error.kind(), error.place()), (ErrorKind::Missing, &Place::Setting("material".into())));
    assert!(error.message().contains("no-such-material") && error.remedy_text().contains("--library"), "{error}");

    let absent = folder.path().join("absent.binary");
    let error = mistake(&[&text(&absent)], &[], None);
    assert_eq!((error.kind(), error.place()), (ErrorKind::Missing, &Place::File(absent)));

    // A folder that is no result of an estimation.
    let error = mistake(&[&text(folder.path())], &[], None);
    let inside = folder.path().join("reflectance.binary");
    assert_eq!((error.kind(), error.place()), (ErrorKind::Missing, &Place::File(inside)));

    // A file that is no table.
    let short = folder.path().join("short.binary");
    write(&short, b"90");
    let error = mistake(&[&text(&short)], &[], None);
    assert_eq!(error.kind(), ErrorKind::Malformed);
    assert!(error.to_string().contains("short.binary"), "{error}");

    // A library that is none, and a name that it does not have.
    let error = mistake(&["matt-grey"], &[], Some(folder.path()));
    assert_eq!((error.kind(), error.place()), (ErrorKind::Missing, &Place::File(folder.path().join(NAMES_FILE))));
    write_library(folder.path());
    let error = mistake(&["matt-gray"], &[], Some(folder.path()));
    assert_eq!(error.kind(), ErrorKind::Missing);
    assert!(error.message().contains("matt-gray") && error.remedy_text().contains("matt-grey"), "{error}");
}

#[test]
fn masks_that_do_not_fit_are_told_apart() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    write_library(folder.path());
    write_mask(&path("wide.png"), 8, 4, |_, _| true);
    write_mask(&path("small.png"), 4, 4, |_, _| true);
    let both = ["matt-grey", "plain-dark"];
    let library = Some(folder.path());

    // Numbers are compared before anything is read: neither of these materials exists.
    for (materials, masks) in [(vec!["none", "nowhere"], vec!["wide.png"]), (vec!["none"], vec!["wide.png"; 2])] {
        let masks: Vec<PathBuf> = masks.into_iter().map(path).collect();
        let error = mistake(&materials, &masks, None);
        assert_eq!((error.kind(), error.place()), (ErrorKind::InvalidSetting, &Place::Setting("region".into())));
        let counts = format!("{} materials and {} regions", materials.len(), masks.len());
        assert!(error.message().contains(&counts) && error.remedy_text().contains("one mask"), "{error}");
    }
    assert_eq!(
        mistake(&both, &[], library).kind(),
        ErrorKind::InvalidSetting,
        "two materials cannot both be everywhere"
    );

    let error = mistake(&both, &[path("wide.png"), path("small.png")], library);
    assert_eq!(error.kind(), ErrorKind::InvalidSetting);
    assert!(error.message().contains("differ in size") && error.remedy_text().contains("one size"), "{error}");

    let error = mistake(&both, &[path("wide.png"), path("absent.png")], library);
    assert_eq!((error.kind(), error.place()), (ErrorKind::Missing, &Place::File(path("absent.png"))));

    write(&path("words.png"), b"this is no picture");
    let error = mistake(&["matt-grey"], &[path("words.png")], library);
    assert_eq!((error.kind(), error.place()), (ErrorKind::Unsupported, &Place::File(path("words.png"))));
}
