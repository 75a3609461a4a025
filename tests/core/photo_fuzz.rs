//! Damaged image files of every format: an error or a picture, never a panic, and no more memory than the file can ask for.
//!
//! `PATINA_FUZZ_CASES` is the number of damaged files a format; 10,000 when it is not set.

#![allow(clippy::unwrap_used)]

use patina::image::Image;
use patina::image::file::{self, PhotoOptions};
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};
use std::cell::Cell;
use std::io::Cursor;
use std::path::Path;
use tiff::encoder::{TiffEncoder, colortype};

/// Most pixels that a byte of any format stands for: runs of runs of one colour.
const MOST_PIXELS_PER_BYTE: usize = 1 << 15;

/// One way in which a file is damaged.
#[derive(Clone, Debug)]
enum Damage {
    /// Cut at this share of its length.
    Cut(f64),
    /// A bit is turned over.
    Bit(f64, u8),
    /// A byte is another one.
    Byte(f64, u8),
    /// Four bytes are a large number, in one of both byte orders, as in headers that claim much.
    Claim(f64, u32, bool),
    /// A piece is there twice.
    Repeat(f64, f64),
    /// A piece is missing.
    Lose(f64, f64),
}

fn damage() -> impl Strategy<Value = Damage> {
    let place = 0.0..1.0f64;
    // Headers are short and hold what claims much: half of the damage goes there.
    let early = prop_oneof![place.clone(), 0.0..0.2f64];
    let large = prop_oneof![any::<u32>(), Just(u32::MAX), Just(0x7fff_ffff), Just(0x10000), 0u32..70_000];
    prop_oneof![
        place.clone().prop_map(Damage::Cut),
        (early.clone(), 0u8..8).prop_map(|(place, bit)| Damage::Bit(place, bit)),
        (early.clone(), any::<u8>()).prop_map(|(place, byte)| Damage::Byte(place, byte)),
        (early.clone(), large, any::<bool>()).prop_map(|(place, value, order)| Damage::Claim(place, value, order)),
        (place.clone(), 0.0..0.2f64).prop_map(|(place, length)| Damage::Repeat(place, length)),
        (place, 0.0..0.2f64).prop_map(|(place, length)| Damage::Lose(place, length)),
    ]
}

fn damaged(mut bytes: Vec<u8>, damages: &[Damage]) -> Vec<u8> {
    for damage in damages {
        let at = |share: f64| ((share * bytes.len() as f64) as usize).min(bytes.len().saturating_sub(1));
        if bytes.is_empty() {
            break;
        }
        match *damage {
            Damage::Cut(share) => bytes.truncate(at(share)),
            Damage::Bit(share, bit) => {
                let place = at(share);
                bytes[place] ^= 1 << bit;
            }
            Damage::Byte(share, byte) => {
                let place = at(share);
                bytes[place] = byte;
            }
            Damage::Claim(share, value, little_endian) => {
                let place = at(share);
                let value = if little_endian { value.to_le_bytes() } else { value.to_be_bytes() };
                bytes.iter_mut().skip(place).zip(value).for_each(|(byte, value)| *byte = value);
            }
            Damage::Repeat(share, length) => {
                let (start, end) = (at(share), at((share + length).min(1.0)));
                let piece = bytes[start..end].to_vec();
                bytes.splice(start..start, piece);
            }
            Damage::Lose(share, length) => {
                let (start, end) = (at(share), at((share + length).min(1.0)));
                bytes.drain(start..end);
            }
        }
    }
    bytes
}

fn fuzz(files: Vec<Vec<u8>>) {
    let cases = std::env::var("PATINA_FUZZ_CASES").ok().and_then(|count| count.parse().ok()).unwrap_or(10_000);
    let config = Config { cases, failure_persistence: None, ..Config::default() };
    // The same files every time.
    let mut runner = TestRunner::new_with_rng(
        config,
        proptest::test_runner::TestRng::deterministic_rng(proptest::test_runner::RngAlgorithm::ChaCha),
    );
    for file in &files {
        file::read_photo_from(Path::new("whole"), file.clone(), &PhotoOptions::default()).unwrap();
    }
    let (read, refused) = (Cell::new(0u32), Cell::new(0u32));
    let strategy = (0..files.len(), proptest::collection::vec(damage(), 1..4));
    runner
        .run(&strategy, |(index, damages)| {
            let bytes = damaged(files[index].clone(), &damages);
            let length = bytes.len();
            let grey = file::MaskFile::of_bytes(Path::new("damaged"), bytes.clone())
                .map(|mask| mask.into_values(file::MaskWay::default()).values);
            match file::read_photo_from(Path::new("damaged"), bytes, &PhotoOptions::default()) {
                Ok(photo) => {
                    let (width, height) = photo.size();
                    prop_assert!(
                        width * height <= MOST_PIXELS_PER_BYTE * length,
                        "{width} x {height} of {length} bytes"
                    );
                    prop_assert!(grey.is_ok_and(|grey| (grey.width(), grey.height()) == (width, height)));
                    read.set(read.get() + 1);
                }
                Err(error) => {
                    prop_assert!(!error.message().is_empty() && !error.remedy_text().is_empty(), "{error}");
                    refused.set(refused.get() + 1);
                }
            }
            Ok(())
        })
        .unwrap();
    // Damage that is always found, or never, would test nothing.
    assert!(read.get() > cases / 100 && refused.get() > cases / 100, "{} read, {} refused", read.get(), refused.get());
}

fn picture() -> Image<[u8; 3]> {
    Image::from_fn(21, 17, |row, column| [row as u8 * 15, column as u8 * 12, (row * column) as u8])
}

fn written(write: impl Fn(&Path)) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("file");
    write(&path);
    std::fs::read(path).unwrap()
}

fn linear() -> patina::image::RgbImage {
    picture().map(|pixel| patina::image::transfer::linear_from_srgb8(*pixel) * 3.0)
}

#[test]
fn png() {
    let icc = moxcms::ColorProfile::new_display_p3().encode().unwrap();
    let words: Vec<u8> = picture().pixels().as_flattened().iter().flat_map(|byte| [*byte, 77]).collect();
    let mut with_profile = Vec::new();
    let mut encoder = image::codecs::png::PngEncoder::new(&mut with_profile);
    image::ImageEncoder::set_icc_profile(&mut encoder, icc).unwrap();
    image::ImageEncoder::write_image(encoder, &words, 21, 17, image::ExtendedColorType::Rgb16).unwrap();
    fuzz(vec![file::encode_png_srgb8(&picture()).unwrap(), with_profile]);
}

#[test]
fn jpeg() {
    let plain = file::encode_jpeg(&picture(), 80).unwrap();
    let icc = moxcms::ColorProfile::new_adobe_rgb().encode().unwrap();
    let mut with_profile = Vec::new();
    let mut encoder = image::codecs::jpeg::JpegEncoder::new(&mut with_profile);
    image::ImageEncoder::set_icc_profile(&mut encoder, icc).unwrap();
    let pixels = picture();
    encoder.encode(pixels.pixels().as_flattened(), 21, 17, image::ExtendedColorType::Rgb8).unwrap();
    let exif = b"\xff\xe1\0\x22Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0";
    let with_exif = [&plain[..2], exif, &plain[2..]].concat();
    fuzz(vec![plain, with_profile, with_exif]);
}

#[test]
fn tiff() {
    fn of<C: colortype::ColorType>(values: &[C::Inner], compression: tiff::encoder::Compression) -> Vec<u8>
    where
        [C::Inner]: tiff::encoder::TiffValue,
    {
        let mut bytes = Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut bytes).unwrap().with_compression(compression);
        encoder.write_image::<C>(21, 17, values).unwrap();
        bytes.into_inner()
    }
    let bytes = picture().pixels().as_flattened().to_vec();
    let words: Vec<u16> = bytes.iter().map(|byte| u16::from(*byte) * 257).collect();
    let floats: Vec<f32> = bytes.iter().map(|byte| f32::from(*byte)).collect();
    use tiff::encoder::Compression::{Deflate, Lzw, Uncompressed};
    fuzz(vec![
        of::<colortype::RGB8>(&bytes, Uncompressed),
        of::<colortype::RGB16>(&words, Deflate(Default::default())),
        of::<colortype::RGB32Float>(&floats, Lzw),
    ]);
}

#[test]
fn openexr() {
    let colour = written(|path| file::write_exr_rgb(path, &linear()).unwrap());
    let grey = written(|path| file::write_exr_grey(path, &linear().map(|pixel| pixel.y)).unwrap());
    fuzz(vec![colour, grey]);
}

#[test]
fn radiance() {
    let runs = written(|path| file::write_hdr(path, &linear()).unwrap());
    let flat = [b"#?RADIANCE\nEXPOSURE=2\nFORMAT=32-bit_rle_xyze\n\n+X 5 -Y 4\n".to_vec(), vec![99; 80]].concat();
    let old = b"#?RGBE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 5\n\x10\x20\x30\x80\x01\x01\x01\x04".to_vec();
    fuzz(vec![runs, flat, old]);
}

#[test]
fn float_maps() {
    let mut bytes = b"PF\n5 4\n-1.0\n".to_vec();
    (0..60).for_each(|value| bytes.extend((value as f32).to_le_bytes()));
    fuzz(vec![bytes]);
}
