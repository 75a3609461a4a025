//! Tables of measured reflectance: their file bit for bit, and what damaged files say.

#![allow(clippy::unwrap_used)]

use super::beside::data;
use patina::ErrorKind;
use patina::measured::binary::FILE_LENGTH;
use patina::measured::fits::neural::{NAMES_FILE, WEIGHT_COUNT, WEIGHTS_FILE};
use patina::measured::grid::{self, CELL_COUNT};
use patina::measured::{HalfDifference, MeasuredBrdf, NeuralFits};
use std::io::Write;
use std::path::{Path, PathBuf};

/// The folder of neural fits, if it is there.
fn library() -> Option<PathBuf> {
    data(&format!("brdf/{WEIGHTS_FILE}"))?;
    data("brdf")
}

fn write(path: &Path, bytes: &[u8]) {
    std::fs::File::create(path).unwrap().write_all(bytes).unwrap();
}

#[test]
fn a_file_survives_reading_and_writing_bit_for_bit() {
    // Values that rounding would change: negative zero, subnormal, not a number with a payload, infinity.
    let mut raw: Vec<f64> = (0..3 * CELL_COUNT).map(|i| ((i * 7919) % 1000) as f64 * 1.1 - 300.0).collect();
    raw[0] = -0.0;
    raw[1] = f64::from_bits(1);
    raw[2] = f64::from_bits(0x7ff8_0000_dead_beef);
    raw[3] = f64::INFINITY;
    let table = MeasuredBrdf::from_raw(raw).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let (first, second) = (folder.path().join("a.binary"), folder.path().join("b.binary"));
    table.write(&first).unwrap();
    let read = MeasuredBrdf::read(&first).unwrap();
    assert!(read.raw().iter().zip(table.raw()).all(|(a, b)| a.to_bits() == b.to_bits()));
    read.write(&second).unwrap();
    let (first, second) = (std::fs::read(first).unwrap(), std::fs::read(second).unwrap());
    assert_eq!(first.len() as u64, FILE_LENGTH);
    assert!(first == second);
    // Layout: sizes 90, 90, 180, then red at phi + 180 (theta_d + 90 theta_h), green a table later.
    assert_eq!(first[..12], [90, 0, 0, 0, 90, 0, 0, 0, 180, 0, 0, 0]);
    let cell = 17 + 180 * (3 + 90 * 5);
    for channel in 0..3 {
        let byte = 12 + 8 * (channel * CELL_COUNT + cell);
        let stored = f64::from_le_bytes(first[byte..byte + 8].try_into().unwrap());
        assert_eq!(stored.to_bits(), read.raw_value(grid::cell_of_indices(5, 3, 17))[channel].to_bits());
    }
    assert!(!read.is_valid(2) && !read.is_valid(3) && read.is_valid(0) == (read.raw()[CELL_COUNT] >= 0.0));
}

#[test]
fn damaged_files_are_told_apart() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.binary");
    let kind = |bytes: &[u8]| {
        write(&path, bytes);
        let error = MeasuredBrdf::read(&path).unwrap_err();
        assert!(error.to_string().contains("x.binary"), "{error}");
        assert!(!error.remedy_text().is_empty(), "{error}");
        error.kind()
    };
    let header: Vec<u8> = [90i32, 90, 180].iter().flat_map(|n| n.to_le_bytes()).collect();
    assert_eq!(kind(&[]), ErrorKind::Malformed);
    assert_eq!(kind(&header[..11]), ErrorKind::Malformed);
    assert_eq!(kind(&header), ErrorKind::Malformed);
    let mut short = header.clone();
    short.resize(1_000_000, 0);
    assert_eq!(kind(&short), ErrorKind::Malformed);
    for sizes in [[90i32, 90, 360], [0, 0, 0], [-1, -1, -1], [i32::MAX; 3], [180, 90, 90]] {
        let mut bytes: Vec<u8> = sizes.iter().flat_map(|n| n.to_le_bytes()).collect();
        bytes.resize(100, 0);
        assert_eq!(kind(&bytes), ErrorKind::Unsupported);
    }
    // Claimed length of 4 GiB without a byte behind it: refused before memory is taken.
    write(&path, &header);
    std::fs::OpenOptions::new().write(true).open(&path).unwrap().set_len(1 << 32).unwrap();
    assert_eq!(MeasuredBrdf::read(&path).unwrap_err().kind(), ErrorKind::Malformed);
    for length in [FILE_LENGTH - 1, FILE_LENGTH + 8] {
        std::fs::OpenOptions::new().write(true).open(&path).unwrap().set_len(length).unwrap();
        assert_eq!(MeasuredBrdf::read(&path).unwrap_err().kind(), ErrorKind::Malformed);
    }
    // The right length, nothing measured.
    let mut empty = header;
    empty.extend((0..3 * CELL_COUNT).flat_map(|_| (-1.0f64).to_le_bytes()));
    assert_eq!(kind(&empty), ErrorKind::NonFinite);
    assert_eq!(MeasuredBrdf::read(&folder.path().join("none")).unwrap_err().kind(), ErrorKind::Missing);
    assert!(MeasuredBrdf::read(folder.path()).is_err());
}

#[test]
fn a_damaged_library_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let read = || NeuralFits::read(folder.path()).unwrap_err();
    assert_eq!(read().kind(), ErrorKind::Missing);
    let (names, weights) = (folder.path().join(NAMES_FILE), folder.path().join(WEIGHTS_FILE));
    write(&names, b"\n \n");
    assert_eq!(read().kind(), ErrorKind::Malformed);
    write(&names, b"one\ntwo\n");
    assert_eq!(read().kind(), ErrorKind::Missing);
    write(&weights, &vec![0; WEIGHT_COUNT * 4]);
    assert_eq!(read().kind(), ErrorKind::Malformed);
    write(&weights, &vec![0; WEIGHT_COUNT * 8]);
    let fits = NeuralFits::read(folder.path()).unwrap();
    assert_eq!(fits.materials.len(), 2);
    assert_eq!(fits.materials[1].value(HalfDifference::default()), [0.0; 3]);
    assert!(fits.find("on").unwrap_err().remedy_text().contains("one"));
    write(&weights, &vec![0xff; WEIGHT_COUNT * 8]);
    assert_eq!(read().kind(), ErrorKind::NonFinite);
    write(&names, b"one\none\n");
    assert_eq!(read().kind(), ErrorKind::Malformed);
    write(&names, &[0xff; 20]);
    assert_eq!(read().kind(), ErrorKind::Malformed);
}

#[test]
fn neural_fits_become_tables() {
    let Some(folder) = library() else { return };
    let fits = NeuralFits::read(&folder).unwrap();
    assert_eq!(fits.materials.len(), 88);
    let fit = fits.find("chrome-steel").unwrap();
    let clock = std::time::Instant::now();
    let table = fit.table();
    println!("one table in {:.2} s", clock.elapsed().as_secs_f64());
    for cell in (0..CELL_COUNT).step_by(4999) {
        let at = grid::coordinates_of_cell(cell);
        assert_eq!(table.is_valid(cell), grid::is_above_horizon(at));
        if table.is_valid(cell) {
            let (value, truth) = (table.value(cell), fit.value(at));
            assert!((0..3).all(|c| (value[c] - truth[c]).abs() <= 1e-12 * truth[c]));
        }
    }
    // A mirror, and a cloth that is none: the peak tells them apart.
    let ratio = |name: &str| {
        let table = fits.find(name).unwrap().table();
        table.value(grid::cell_of_indices(0, 10, 90))[1] / table.value(grid::cell_of_indices(60, 10, 90))[1]
    };
    assert!(ratio("chrome-steel") > 1e3 && ratio("white-fabric") < 3.0);
}
