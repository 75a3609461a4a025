//! Image files: round trips, files of other programs, and files that lie.

#![allow(clippy::unwrap_used, clippy::disallowed_methods)]

use glam::Vec3;
use patina::image::file::{self, Format};
use patina::image::{GreyImage, Image, RgbImage};
use patina::math::random::SequentialRandom;
use patina::{ErrorKind, Place};
use std::path::{Path, PathBuf};

/// A small image with values from 1e-4 to 1e5.
fn wide_range_image(width: usize, height: usize) -> RgbImage {
    let mut random = SequentialRandom::new(5);
    Image::from_fn(width, height, |_, _| {
        Vec3::from_array(std::array::from_fn(|_| 10f32.powf(random.next_number() * 9.0 - 4.0)))
    })
}

fn byte_image(width: usize, height: usize) -> Image<[u8; 3]> {
    let mut random = SequentialRandom::new(9);
    Image::from_fn(width, height, |_, _| std::array::from_fn(|_| random.below(256) as u8))
}

/// A float map in the given byte order.
fn pfm_bytes(kind: &str, width: usize, height: usize, values: &[f32], little_endian: bool) -> Vec<u8> {
    let mut bytes = format!("{kind}\n{width} {height}\n{}\n", if little_endian { "-1.0" } else { "1.0" }).into_bytes();
    for value in values {
        bytes.extend(if little_endian { value.to_le_bytes() } else { value.to_be_bytes() });
    }
    bytes
}

/// One file of each format, all valid, of 9 x 7 pixels.
fn one_of_each(folder: &Path) -> Vec<PathBuf> {
    let path = |name: &str| folder.join(name);
    file::write_exr_rgb(&path("a.exr"), &wide_range_image(9, 7)).unwrap();
    file::write_exr_grey(&path("grey.exr"), &GreyImage::from_fn(9, 7, |row, column| (row * column) as f32)).unwrap();
    file::write_hdr(&path("a.hdr"), &wide_range_image(9, 7)).unwrap();
    file::write_png_srgb8(&path("a.png"), &byte_image(9, 7)).unwrap();
    std::fs::write(path("a.jpg"), file::encode_jpeg(&byte_image(9, 7), 90).unwrap()).unwrap();
    std::fs::write(path("a.pfm"), pfm_bytes("PF", 9, 7, &[0.5; 9 * 7 * 3], true)).unwrap();
    ["a.exr", "grey.exr", "a.hdr", "a.png", "a.jpg", "a.pfm"].map(path).to_vec()
}

#[test]
fn exr_keeps_every_bit_of_colour_and_grey() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("new/folder/a.exr");
    let mut image = wide_range_image(37, 21);
    image[(3, 4)] = Vec3::new(-1.0, f32::INFINITY, 0.0);
    file::write_exr_rgb(&path, &image).unwrap();
    assert_eq!(file::read_rgb(&path).unwrap(), image);
    assert_eq!(file::read_size(&path).unwrap(), (37, 21));

    let grey = GreyImage::from_fn(37, 21, |row, column| (row as f32 - 3.0) * 0.1 + column as f32);
    file::write_exr_grey(&path, &grey).unwrap();
    assert_eq!(file::read_grey(&path).unwrap(), grey);
    assert_eq!(file::read_rgb(&path).unwrap(), grey.map(|&value| Vec3::splat(value)));
}

#[test]
fn exr_with_half_and_integer_channels_of_any_name_is_read() {
    use exr::prelude::*;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("roughness.exr");
    let half: Vec<f16> = (0..6).map(|index| f16::from_f32(index as f32 * 0.25)).collect();
    let lone = AnyChannels::sort(smallvec_of(AnyChannel::new("roughness.V", FlatSamples::F16(half))));
    exr::image::Image::from_channels((3, 2), lone).write().to_file(&path).unwrap();
    assert_eq!(file::read_grey(&path).unwrap().pixels(), [0.0, 0.25, 0.5, 0.75, 1.0, 1.25]);

    let index = AnyChannels::sort(smallvec_of(AnyChannel::new("id", FlatSamples::U32((0..6).collect()))));
    exr::image::Image::from_channels((3, 2), index).write().to_file(&path).unwrap();
    assert_eq!(file::read_grey(&path).unwrap().pixels(), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
}

fn smallvec_of<T>(item: T) -> exr::prelude::SmallVec<[T; 4]> {
    std::iter::once(item).collect()
}

#[test]
fn exr_layers_choose_the_picture_and_name_the_channels_when_there_is_none() {
    use exr::prelude::*;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("layers.exr");
    let channel = |name: &str, value: f32| AnyChannel::new(name, FlatSamples::F32(vec![value; 6]));
    let write = |channels: Vec<AnyChannel<FlatSamples>>| {
        let channels = AnyChannels::sort(channels.into_iter().collect());
        exr::image::Image::from_channels((3, 2), channels).write().to_file(&path).unwrap();
    };
    let view_layer = |group: &str, value: f32| {
        ["R", "G", "B"].map(|letter| channel(&format!("ViewLayer.{group}.{letter}"), value)).to_vec()
    };
    // As Blender writes them: prefixed groups, depth and alpha beside.
    write([view_layer("AO", 7.0), view_layer("Combined", 0.25), vec![channel("ViewLayer.Depth.Z", 3.0)]].concat());
    assert_eq!(file::read_rgb(&path).unwrap().pixels(), [Vec3::splat(0.25); 6]);
    assert_eq!(file::read_grey(&path).unwrap().pixels(), [0.25; 6]);

    write(vec![channel("albedo.R", 1.0), channel("albedo.G", 1.0), channel("nx", 0.0), channel("ny", 0.0)]);
    let error = file::read_rgb(&path).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Unsupported);
    assert!(error.message().contains("albedo.R"), "{error}");
}

#[test]
fn hdr_keeps_one_part_in_a_hundred_of_the_largest_channel() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sky.hdr");
    let mut image = wide_range_image(33, 9);
    image[(0, 0)] = Vec3::new(f32::NAN, -1.0, 0.0);
    image[(0, 1)] = Vec3::new(1e6, f32::INFINITY, 1e6);
    file::write_hdr(&path, &image).unwrap();
    let read = file::read_rgb(&path).unwrap();
    for (stored, original) in read.pixels().iter().zip(image.pixels()).skip(2) {
        let difference = (*stored - *original).abs().max_element();
        assert!(difference <= original.max_element() / 127.0, "{stored} against {original}");
    }
    assert_eq!(read[(0, 0)], Vec3::ZERO);
    assert!(read[(0, 1)].is_finite() && read[(0, 1)].y > 1e37);
}

#[test]
fn pfm_runs_from_bottom_to_top_in_both_byte_orders() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("depth.pfm");
    for little_endian in [true, false] {
        std::fs::write(&path, pfm_bytes("Pf", 2, 2, &[1.0, 2.0, 3.0, 4.0], little_endian)).unwrap();
        assert_eq!(file::read_grey(&path).unwrap().pixels(), [3.0, 4.0, 1.0, 2.0]);
        let colour: Vec<f32> = (0..12).map(|index| index as f32).collect();
        std::fs::write(&path, pfm_bytes("PF", 2, 2, &colour, little_endian)).unwrap();
        assert_eq!(file::read_rgb(&path).unwrap()[(0, 0)], Vec3::new(6.0, 7.0, 8.0));
    }
    // The lines of a header written on Windows.
    std::fs::write(&path, [b"Pf\r\n1 1\r\n-1\r\n".as_slice(), &2.5f32.to_le_bytes()].concat()).unwrap();
    assert_eq!(file::read_grey(&path).unwrap().pixels(), [2.5]);
}

#[test]
fn png_is_decoded_from_srgb_in_eight_and_sixteen_bits() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    let bytes = byte_image(5, 4);
    file::write_png_srgb8(&path, &bytes).unwrap();
    assert_eq!(file::read_srgb8(&path).unwrap(), bytes);
    let linear = file::read_rgb(&path).unwrap();
    assert_eq!(file::srgb8_from_linear(&linear, 0.0), bytes);

    let sixteen = image::ImageBuffer::<image::Rgb<u16>, _>::from_raw(1, 1, vec![32_768u16, 65_535, 0]).unwrap();
    sixteen.save(&path).unwrap();
    let pixel = file::read_rgb(&path).unwrap()[(0, 0)];
    assert!((pixel - Vec3::new(0.214_05, 1.0, 0.0)).abs().max_element() < 1e-5, "{pixel}");
    let mask = image::GrayImage::from_raw(2, 1, vec![255, 51]).unwrap();
    mask.save(&path).unwrap();
    assert_eq!(file::read_grey(&path).unwrap().pixels(), [1.0, 0.2]);
}

#[test]
fn exposure_is_in_stops_and_nan_is_magenta() {
    let image = RgbImage::from_pixels(3, 1, vec![Vec3::splat(0.25), Vec3::new(0.0, f32::NAN, 0.0), Vec3::splat(9.0)]);
    let bytes = file::srgb8_from_linear(&image, 2.0);
    assert_eq!(bytes.pixels(), [[255; 3], [255, 0, 255], [255; 3]]);
    assert_eq!(file::srgb8_from_linear(&image, 0.0)[(0, 0)], [137; 3]);
}

#[test]
fn jpeg_is_close_to_what_was_encoded() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.jpg");
    let smooth = Image::from_fn(64, 48, |row, column| [row as u8 * 4, column as u8 * 3, 128]);
    std::fs::write(&path, file::encode_jpeg(&smooth, 95).unwrap()).unwrap();
    let read = file::read_srgb8(&path).unwrap();
    let worst = read.pixels().as_flattened().iter().zip(smooth.pixels().as_flattened());
    assert!(worst.map(|(a, b)| a.abs_diff(*b)).max().unwrap() < 16);
    assert!(file::encode_jpeg(&Image::filled(0, 0, [0; 3]), 90).is_err());
    assert!(file::encode_png_srgb8(&Image::filled(0, 3, [0; 3])).is_err());
}

#[test]
fn the_content_tells_the_format_not_the_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("really_a_png.jpg");
    file::write_png_srgb8(&path, &byte_image(4, 4)).unwrap();
    assert_eq!(file::read_header(&path).unwrap().format, Format::Png);
    assert_eq!(file::read_srgb8(&path).unwrap(), byte_image(4, 4));
    std::fs::write(&path, "<html>404</html>").unwrap();
    let error = file::read_rgb(&path).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Unsupported);
    assert!(!error.remedy_text().is_empty());
}

#[test]
fn every_cut_of_every_format_is_an_error_with_a_place() {
    let folder = tempfile::tempdir().unwrap();
    let short = folder.path().join("cut");
    for path in one_of_each(folder.path()) {
        assert_eq!(file::read_size(&path).unwrap(), (9, 7), "{}", path.display());
        let bytes = std::fs::read(&path).unwrap();
        // The last bytes of a PNG and a JPEG are an end mark that adds nothing to its pixels.
        let last = match path.extension().unwrap().to_str() {
            Some("png") => bytes.len() - 16,
            Some("jpg") => bytes.len() - 2,
            _ => bytes.len(),
        };
        for length in (0..last).step_by(3).chain([last - 1]) {
            std::fs::write(&short, &bytes[..length]).unwrap();
            let Err(error) = file::read_rgb(&short) else {
                panic!("{} cut to {length} of {} bytes was read", path.display(), bytes.len())
            };
            assert!(matches!(error.kind(), ErrorKind::Malformed | ErrorKind::Unsupported), "{error}");
            assert!(matches!(error.place(), Place::File(_) | Place::Byte(..)), "{error}");
            assert!(!error.remedy_text().is_empty(), "{error}");
        }
    }
}

#[test]
fn damaged_bytes_never_panic_and_never_take_much_memory() {
    let folder = tempfile::tempdir().unwrap();
    let damaged = folder.path().join("damaged");
    let mut random = SequentialRandom::new(77);
    let (mut read, mut refused) = (0, 0);
    for path in one_of_each(folder.path()) {
        let bytes = std::fs::read(&path).unwrap();
        for _ in 0..150 {
            let mut changed = bytes.clone();
            for _ in 0..1 + random.below(4) {
                let place = random.below(changed.len());
                changed[place] = random.next_bits() as u8;
            }
            std::fs::write(&damaged, &changed).unwrap();
            match file::read_rgb(&damaged) {
                Ok(image) => read += usize::from(image.width() > 0),
                Err(error) => refused += usize::from(!error.message().is_empty()),
            }
        }
    }
    assert!(read + refused == 900 && refused > 100 && read > 100, "{read} read, {refused} refused");
}

#[test]
fn files_that_claim_too_much_are_refused_before_memory_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    let lying = folder.path().join("lying");
    let expect = |bytes: Vec<u8>, kind: ErrorKind| {
        std::fs::write(&lying, bytes).unwrap();
        for error in [file::read_rgb(&lying).unwrap_err(), file::read_size(&lying).unwrap_err()] {
            assert_eq!(error.kind(), kind, "{error}");
            assert!(error.to_string().contains("lying") && !error.remedy_text().is_empty(), "{error}");
        }
    };
    // OpenEXR: the data window of a valid file moved to 10^9 and to 10^8 pixels.
    let path = folder.path().join("a.exr");
    file::write_exr_rgb(&path, &wide_range_image(9, 7)).unwrap();
    let exr = std::fs::read(&path).unwrap();
    let window = |right: i32, bottom: i32| {
        let mut bytes = exr.clone();
        for name in [b"dataWindow\0box2i\0".as_slice(), b"displayWindow\0box2i\0"] {
            let place = bytes.windows(name.len()).position(|part| part == name).unwrap() + name.len() + 4 + 8;
            bytes[place..place + 4].copy_from_slice(&right.to_le_bytes());
            bytes[place + 4..place + 8].copy_from_slice(&bottom.to_le_bytes());
        }
        bytes
    };
    expect(window(39_999, 24_999), ErrorKind::TooLarge);
    expect(window(9_999, 9_999), ErrorKind::Malformed);
    // The others by their headers.
    expect(pfm_bytes("PF", 40_000, 40_000, &[], true), ErrorKind::TooLarge);
    expect(pfm_bytes("PF4", 2, 2, &[0.5; 16], true), ErrorKind::Malformed);
    expect(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 40000 +X 40000\n".to_vec(), ErrorKind::TooLarge);
    expect(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 9000 +X 9000\n\x02\x02".to_vec(), ErrorKind::Malformed);
    let mut png = file::encode_png_srgb8(&byte_image(3, 3)).unwrap();
    png[16..20].copy_from_slice(&60_000u32.to_be_bytes());
    png[20..24].copy_from_slice(&60_000u32.to_be_bytes());
    let checksum = crc32(&png[12..29]);
    png[29..33].copy_from_slice(&checksum.to_be_bytes());
    expect(png, ErrorKind::TooLarge);
    // Cut short, but plausible so far: refused at its end.
    std::fs::write(&lying, pfm_bytes("Pf", 1000, 1000, &[0.0; 10], true)).unwrap();
    assert!(matches!(file::read_grey(&lying).unwrap_err().place(), Place::Byte(_, byte) if *byte == 58));
}

/// The checksum of PNG chunks, bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    let step = |crc: u32, _| if crc & 1 == 1 { 0xedb8_8320 ^ (crc >> 1) } else { crc >> 1 };
    !bytes.iter().fold(u32::MAX, |crc, &byte| (0..8).fold(crc ^ u32::from(byte), step))
}

#[test]
fn an_hdr_in_the_old_run_coding_that_overflows_is_an_error_not_a_panic() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("old.hdr");
    let mut bytes = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 16\n".to_vec();
    bytes.extend([[1, 1, 1, 200]; 40].concat());
    std::fs::write(&path, &bytes).unwrap();
    let error = file::read_rgb(&path).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Malformed, "{error}");
}

#[test]
fn missing_empty_and_folder_are_told_apart() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    assert_eq!(file::read_rgb(&path).unwrap_err().kind(), ErrorKind::Missing);
    std::fs::write(&path, b"").unwrap();
    let error = file::read_rgb(&path).unwrap_err();
    assert_eq!((error.kind(), error.place().clone()), (ErrorKind::Malformed, Place::Byte(path, 0)));
    assert_eq!(file::read_size(folder.path()).unwrap_err().kind(), ErrorKind::Unreadable);
}

#[test]
fn a_failed_write_keeps_the_old_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    file::write_exr_rgb(&path, &wide_range_image(3, 3)).unwrap();
    assert_eq!(file::write_exr_rgb(&path, &RgbImage::default()).unwrap_err().kind(), ErrorKind::Unwritable);
    assert_eq!(file::read_rgb(&path).unwrap(), wide_range_image(3, 3));
}
