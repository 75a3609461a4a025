//! Photos of every format keep their precision, their colours and their place, and tell what was done to them.

#![allow(clippy::type_complexity)]
#![allow(clippy::unwrap_used)]

use exr::prelude as openexr;
use exr::prelude::WritableImage;
use glam::Vec3;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};
use patina::image::file::{self, Encoding, PhotoFile, PhotoOptions, PhotoPixels};
use patina::image::{Image, transfer};
use patina::{ErrorKind, Place};
use std::io::Cursor;
use std::path::Path;
use tiff::encoder::{TiffEncoder, colortype};
use tiff::tags::{ExtraSamples, Tag};

fn read_with(bytes: Vec<u8>, options: PhotoOptions) -> patina::Result<PhotoFile> {
    file::read_photo_from(Path::new("photo"), bytes, &options)
}

fn read(bytes: Vec<u8>) -> PhotoFile {
    read_with(bytes, PhotoOptions::default()).unwrap()
}

fn codes(photo: &PhotoFile) -> Vec<&'static str> {
    photo.findings.iter().map(|finding| finding.code).collect()
}

/// All values of 16 bits in steps of 3, as an image of three channels.
fn words() -> (u32, u32, Vec<u16>) {
    let (width, height) = (64, 32);
    (width, height, (0..width * height * 3).map(|index| (index * 10 + 7) as u16).collect())
}

fn png16(icc: Option<Vec<u8>>) -> Vec<u8> {
    let (width, height, words) = words();
    let mut bytes = Vec::new();
    let mut encoder = PngEncoder::new(&mut bytes);
    if let Some(icc) = icc {
        encoder.set_icc_profile(icc).unwrap();
    }
    encoder.write_image(bytemuck::cast_slice(&words), width, height, ExtendedColorType::Rgb16).unwrap();
    bytes
}

fn tiff_of<C: colortype::ColorType>(size: (u32, u32), values: &[C::Inner], tags: &[(Tag, u16)], icc: &[u8]) -> Vec<u8>
where
    [C::Inner]: tiff::encoder::TiffValue,
{
    let mut bytes = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut bytes).unwrap();
    let mut image = encoder.new_image::<C>(size.0, size.1).unwrap();
    for (tag, value) in tags {
        image.encoder().write_tag(*tag, *value).unwrap();
    }
    if !icc.is_empty() {
        image.encoder().write_tag(Tag::IccProfile, icc).unwrap();
    }
    image.write_data(values).unwrap();
    bytes.into_inner()
}

#[test]
fn sixteen_bits_never_pass_through_eight() {
    let (width, height, words) = words();
    let tiff = tiff_of::<colortype::RGB16>((width, height), &words, &[], &[]);
    for bytes in [png16(None), tiff] {
        for (encoding, linear) in
            [(Encoding::Auto, transfer::linear_from_srgb as fn(f32) -> f32), (Encoding::Linear, |value| value)]
        {
            let photo = read_with(bytes.clone(), PhotoOptions { encoding, ..Default::default() }).unwrap();
            assert!(!photo.is_eight_bit);
            let clipped = photo.clipped.clone().unwrap();
            let pixels = photo.into_linear();
            assert_eq!((pixels.width(), pixels.height()), (64, 32));
            for (index, word) in words.iter().enumerate() {
                let expected = linear(f32::from(*word) / 65_535.0);
                assert!((pixels.pixels()[index / 3][index % 3] - expected).abs() <= 1e-7 + 1e-6 * expected);
            }
            let largest = words[..3].iter().max().unwrap();
            assert_eq!(clipped.pixels()[0], f32::from(*largest) / 65_535.0 >= 254.0 / 255.0);
        }
    }
}

#[test]
fn tiffs_of_bytes_floats_grey_and_opacity_are_read() {
    let bytes = [255u8, 0, 128, 10, 20, 30];
    let photo = read(tiff_of::<colortype::RGB8>((2, 1), &bytes, &[], &[]));
    assert_eq!(photo.pixels, PhotoPixels::Srgb8(Image::from_pixels(2, 1, vec![[255, 0, 128], [10, 20, 30]])));
    assert_eq!(photo.clipped.as_ref().unwrap().pixels(), [true, false]);
    let floats = [0.25f32, 2.0, -1.0];
    let photo = read(tiff_of::<colortype::RGB32Float>((1, 1), &floats, &[], &[]));
    assert_eq!(photo.into_linear().pixels(), [Vec3::from_array(floats)], "floats are linear");
    let photo = read(tiff_of::<colortype::Gray16>((1, 1), &[32_768], &[], &[]));
    assert!((photo.into_linear()[(0, 0)].y - transfer::linear_from_srgb(32_768.0 / 65_535.0)).abs() < 1e-6);
    let rgba = [100u8, 100, 100, 255, 50, 50, 50, 128];
    let with = |kind: u16| tiff_of::<colortype::RGBA8>((2, 1), &rgba, &[(Tag::ExtraSamples, kind)], &[]);
    let straight = read(with(ExtraSamples::UnassociatedAlpha.to_u16()));
    assert!((straight.alpha.as_ref().unwrap()[(0, 1)] - 128.0 / 255.0).abs() < 1e-6);
    let PhotoPixels::Srgb8(pixels) = straight.pixels else { panic!("bytes of sRGB stay so") };
    assert_eq!(pixels[(0, 1)], [50; 3]);
    let premultiplied = read(with(ExtraSamples::AssociatedAlpha.to_u16())).into_linear();
    let expected = transfer::linear_from_srgb(50.0 / 128.0);
    assert!((premultiplied[(0, 1)].x - expected).abs() < 1e-3, "{}", premultiplied[(0, 1)]);
}

#[test]
fn a_thumbnail_before_the_picture_of_a_tiff_is_stepped_over() {
    let mut file = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut file).unwrap();
    let mut thumbnail = encoder.new_image::<colortype::RGB8>(1, 1).unwrap();
    thumbnail.encoder().write_tag(Tag::NewSubfileType, 1u32).unwrap();
    thumbnail.write_data(&[9, 9, 9]).unwrap();
    encoder.write_image::<colortype::RGB8>(2, 1, &[10, 20, 30, 40, 50, 60]).unwrap();
    let photo = read(file.into_inner());
    assert_eq!(photo.pixels, PhotoPixels::Srgb8(Image::from_pixels(2, 1, vec![[10, 20, 30], [40, 50, 60]])));
}

#[test]
fn inks_and_raw_files_are_refused_with_a_way_out() {
    let cmyk = tiff_of::<colortype::CMYK8>((1, 1), &[1, 2, 3, 4], &[], &[]);
    let error = read_with(cmyk, PhotoOptions::default()).unwrap_err();
    assert!(error.kind() == ErrorKind::Unsupported && error.message().contains("CMYK"), "{error}");
    let dng = tiff_of::<colortype::RGB8>((1, 1), &[1, 2, 3], &[(Tag::Unknown(50_706), 1)], &[]);
    let error = read_with(dng, PhotoOptions::default()).unwrap_err();
    assert!(error.remedy_text().contains("linear 16-bit TIFF"), "{error}");
    let error = read_with(b"\0\0\0\x18ftypheic".to_vec(), PhotoOptions::default()).unwrap_err();
    assert!(error.message().contains("HEIC") && !error.remedy_text().is_empty(), "{error}");
    // A frame of four components.
    let jpeg = file::encode_jpeg(&Image::filled(16, 16, [90; 3]), 90).unwrap();
    let frame = jpeg.windows(2).position(|pair| pair == [0xff, 0xc0]).unwrap();
    let mut inks = jpeg[..frame].to_vec();
    inks.extend([0xff, 0xc0, 0, 20, 8, 0, 16, 0, 16, 4]);
    inks.extend([1, 0x11, 0, 2, 0x11, 0, 3, 0x11, 0, 4, 0x11, 0]);
    inks.extend(&jpeg[frame + 19..]);
    let error = read_with(inks, PhotoOptions::default()).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Unsupported, "{error}");
}

/// Linear Rec. 709 of linear Display P3 (both D65), computed from SMPTE RP 177 by another program, to four digits.
const REC709_FROM_P3: [[f32; 3]; 3] = [[1.2249, -0.2249, 0.0], [-0.0421, 1.0421, 0.0], [-0.0196, -0.0786, 1.0983]];

#[test]
fn profiles_are_converted_to_linear_rec_709_and_told() {
    let p3 = moxcms::ColorProfile::new_display_p3().encode().unwrap();
    let (width, height, words) = words();
    let tiff = tiff_of::<colortype::RGB16>((width, height), &words, &[], &p3);
    for bytes in [png16(Some(p3)), tiff] {
        let photo = read(bytes);
        assert_eq!(codes(&photo), ["colour-converted"]);
        assert!(photo.findings[0].message.contains("P3"), "{}", photo.findings[0].message);
        let pixels = photo.into_linear();
        for (pixel, stored) in pixels.pixels().iter().zip(words.chunks_exact(3)) {
            let linear: Vec<f32> =
                stored.iter().map(|word| transfer::linear_from_srgb(f32::from(*word) / 65_535.0)).collect();
            for (row, value) in REC709_FROM_P3.iter().zip(pixel.to_array()) {
                let expected: f32 = row.iter().zip(&linear).map(|(entry, value)| entry * value).sum();
                assert!((value - expected).abs() < 2e-3, "{value} for {expected}");
            }
        }
    }
    let srgb = read(png16(Some(moxcms::ColorProfile::new_srgb().encode().unwrap())));
    assert!(codes(&srgb).is_empty());
    assert!(codes(&read(png16(None))).is_empty());
    assert_eq!(codes(&read(tiff_of::<colortype::RGB16>((width, height), &words, &[], &[]))), ["profile-missing"]);
    assert_eq!(codes(&read(png16(Some(vec![7; 200])))), ["profile-damaged"]);
    // The user's word on the curve leaves the primaries to the profile.
    let wide = png16(Some(moxcms::ColorProfile::new_bt2020().encode().unwrap()));
    let linear = read_with(wide, PhotoOptions { encoding: Encoding::Linear, ..Default::default() }).unwrap();
    let first = Vec3::new(f32::from(words[0]), f32::from(words[1]), f32::from(words[2])) / 65_535.0;
    let red = Vec3::new(1.6605, -0.5876, -0.0728).dot(first);
    assert!((linear.into_linear()[(0, 0)].x - red).abs() < 1e-5);
}

#[test]
fn grey_profiles_and_large_gamuts_are_converted() {
    let gamma = moxcms::ColorProfile::new_gray_with_gamma(2.0).encode().unwrap();
    let photo = read(tiff_of::<colortype::Gray16>((1, 1), &[32_768], &[], &gamma));
    assert!((photo.into_linear()[(0, 0)].x - 0.25).abs() < 1e-3);
    let pro = moxcms::ColorProfile::new_pro_photo_rgb().encode().unwrap();
    let photo = read(tiff_of::<colortype::RGB16>((1, 1), &[30_000; 3], &[], &pro));
    let grey = photo.into_linear()[(0, 0)];
    assert!(grey.max_element() - grey.min_element() < 3e-3 && grey.x > 0.2, "grey stays grey: {grey}");
}

fn jpeg() -> Vec<u8> {
    let picture = Image::from_fn(48, 40, |row, column| [row as u8 * 6, column as u8 * 5, (row * column) as u8]);
    file::encode_jpeg(&picture, 90).unwrap()
}

#[test]
fn a_jpeg_without_its_end_is_read_only_when_all_pixels_are_there() {
    let whole = jpeg();
    let expected = read(whole.clone());
    for end in [whole.len() - 1, whole.len() - 2] {
        let photo = read(whole[..end].to_vec());
        assert_eq!(photo.pixels, expected.pixels);
        assert_eq!(codes(&photo), ["jpeg-no-end", "profile-missing"]);
    }
    for cut in 3..400 {
        let error = read_with(whole[..whole.len() - cut].to_vec(), PhotoOptions::default()).unwrap_err();
        assert!(matches!(error.place(), Place::Byte(..)), "cut by {cut}: {error}");
    }
}

#[test]
fn stray_bytes_of_a_jpeg_are_skipped_and_told() {
    let whole = jpeg();
    let expected = read(whole.clone());
    let table = whole.windows(2).position(|pair| pair == [0xff, 0xdb]).unwrap();
    let between = [&whole[..table], &[0, 17, 3], &whole[table..]].concat();
    let photo = read(between);
    assert_eq!(photo.pixels, expected.pixels);
    assert_eq!(codes(&photo), ["jpeg-stray-bytes", "profile-missing"]);
    let behind = [whole.as_slice(), b"a maker's note after the end"].concat();
    assert_eq!(read(behind).pixels, expected.pixels);
    let before_end = [&whole[..whole.len() - 2], &[0; 7], &whole[whole.len() - 2..]].concat();
    assert_eq!(read(before_end).pixels, expected.pixels);
}

/// EXR bytes of parts: name, place of the data window, channels with one value each.
fn exr_of(
    display: ((i32, i32), (usize, usize)),
    chromaticities: Option<exr::meta::attribute::Chromaticities>,
    parts: &[(&str, (i32, i32), (usize, usize), &[(&str, f32)])],
) -> Vec<u8> {
    let layers: Vec<_> = parts
        .iter()
        .map(|(name, position, size, channels)| {
            let channel = |(name, value): &(&str, f32)| {
                openexr::AnyChannel::new(*name, openexr::FlatSamples::F32(vec![*value; size.0 * size.1]))
            };
            let channels = openexr::AnyChannels::sort(channels.iter().map(channel).collect());
            let attributes = openexr::LayerAttributes {
                layer_name: (!name.is_empty()).then(|| (*name).into()),
                layer_position: openexr::Vec2(position.0, position.1),
                ..Default::default()
            };
            openexr::Layer::new(*size, attributes, openexr::Encoding::FAST_LOSSLESS, channels)
        })
        .collect();
    let window = openexr::IntegerBounds::new(display.0, display.1);
    let mut attributes = openexr::ImageAttributes::new(window);
    attributes.chromaticities = chromaticities;
    let mut bytes = Cursor::new(Vec::new());
    openexr::Image::from_layers(attributes, layers).write().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

#[test]
fn the_data_window_is_placed_in_the_display_window() {
    let rgb: &[(&str, f32)] = &[("R", 1.0), ("G", 2.0), ("B", 3.0)];
    let photo = read(exr_of(((10, 20), (8, 6)), None, &[("", (12, 21), (3, 2), rgb)]));
    assert_eq!((photo.size(), codes(&photo)), ((8, 6), vec!["exr-window"]));
    let inside = photo.is_inside.clone().unwrap();
    let pixels = photo.into_linear();
    for row in 0..6 {
        for column in 0..8 {
            let stored = (1..3).contains(&row) && (2..5).contains(&column);
            assert_eq!(inside[(row, column)], stored);
            assert_eq!(pixels[(row, column)], if stored { Vec3::new(1.0, 2.0, 3.0) } else { Vec3::ZERO });
        }
    }
    // Overscan is cut; a file whose windows are one says nothing.
    let photo = read(exr_of(((0, 0), (4, 4)), None, &[("", (-2, -2), (8, 8), rgb)]));
    assert_eq!((photo.size(), photo.is_inside.unwrap().pixels()), ((4, 4), [true; 16].as_slice()));
    assert!(codes(&read(exr_of(((3, 3), (4, 4)), None, &[("", (3, 3), (4, 4), rgb)]))).is_empty());
}

#[test]
fn parts_and_layers_are_chosen_told_and_named() {
    let albedo: &[(&str, f32)] = &[("R", 0.5), ("G", 0.5), ("B", 0.5)];
    let beauty: &[(&str, f32)] = &[("R", 7.0), ("G", 7.0), ("B", 7.0), ("A", 0.25)];
    let bytes =
        exr_of(((0, 0), (2, 2)), None, &[("albedo", (0, 0), (2, 2), albedo), ("beauty", (0, 0), (2, 2), beauty)]);
    let photo = read(bytes.clone());
    assert_eq!(codes(&photo), ["exr-layer"]);
    assert_eq!(photo.alpha.as_ref().unwrap().pixels(), [0.25; 4]);
    assert_eq!(photo.into_linear()[(0, 0)], Vec3::splat(7.0));
    let named = read_with(bytes.clone(), PhotoOptions { layer: Some("albedo"), ..Default::default() }).unwrap();
    assert_eq!(named.into_linear()[(0, 0)], Vec3::splat(0.5));
    let error = read_with(bytes, PhotoOptions { layer: Some("depth"), ..Default::default() }).unwrap_err();
    assert!(error.message().contains("'albedo', 'beauty'"), "{error}");
    let only = exr_of(((0, 0), (1, 1)), None, &[("", (0, 0), (1, 1), &[("N.R", 1.0), ("N.G", 1.0), ("N.B", 1.0)])]);
    assert!(read_with(only, PhotoOptions::default()).unwrap_err().remedy_text().contains("--layer"));
    let depth = exr_of(((0, 0), (1, 1)), None, &[("", (0, 0), (1, 1), &[("Z", 3.0)])]);
    assert!(read_with(depth, PhotoOptions::default()).is_err(), "distances are no picture");
}

#[test]
fn chromaticities_of_exr_are_honoured() {
    let xy = openexr::Vec2;
    let aces = exr::meta::attribute::Chromaticities {
        red: xy(0.713, 0.293),
        green: xy(0.165, 0.830),
        blue: xy(0.128, 0.044),
        white: xy(0.32168, 0.33767),
    };
    let red: &[(&str, f32)] = &[("R", 1.0), ("G", 0.0), ("B", 0.0)];
    let photo = read(exr_of(((0, 0), (1, 1)), Some(aces), &[("", (0, 0), (1, 1), red)]));
    assert_eq!(codes(&photo), ["colour-converted"]);
    // The first column of the matrix from ACEScg to Rec. 709 that ACES publishes: 1.70505 -0.13026 -0.02400.
    let pixel = photo.into_linear()[(0, 0)];
    assert!((pixel - Vec3::new(1.70505, -0.13026, -0.02400)).abs().max_element() < 2e-3, "{pixel}");
}

/// A picture of Radiance of two pixels by three, in flat scan lines after a header.
fn hdr(header: &str, resolution: &str, pixels: &[[u8; 4]]) -> Vec<u8> {
    [format!("{header}\n\n{resolution}\n").into_bytes(), pixels.concat()].concat()
}

#[test]
fn radiance_pictures_are_read_in_all_eight_directions() {
    // Upright: 1 2 over 3 4 over 5 6.
    let grey = |value: u8| [value * 16, value * 16, value * 16, 132];
    let cases = [
        ("-Y 3 +X 2", [1, 2, 3, 4, 5, 6]),
        ("-Y 3 -X 2", [2, 1, 4, 3, 6, 5]),
        ("+Y 3 +X 2", [5, 6, 3, 4, 1, 2]),
        ("+Y 3 -X 2", [6, 5, 4, 3, 2, 1]),
        ("+X 2 -Y 3", [1, 3, 5, 2, 4, 6]),
        ("-X 2 -Y 3", [2, 4, 6, 1, 3, 5]),
        ("+X 2 +Y 3", [5, 3, 1, 6, 4, 2]),
        ("-X 2 +Y 3", [6, 4, 2, 5, 3, 1]),
    ];
    for signature in ["#?RADIANCE", "#?RGBE"] {
        for (resolution, stored) in cases {
            let photo = read(hdr(&format!("{signature}\nFORMAT=32-bit_rle_rgbe"), resolution, &stored.map(grey)));
            assert_eq!(photo.size(), (2, 3), "{resolution}");
            let values: Vec<f32> = photo.into_linear().pixels().iter().map(|pixel| pixel.x).collect();
            assert_eq!(values, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0], "{resolution}");
        }
    }
}

#[test]
fn exposures_corrections_and_xyz_of_radiance_pictures_are_undone() {
    let pixel = [[128u8, 128, 128, 129]];
    let of = |lines: &str| read(hdr(&format!("#?RADIANCE\n{lines}"), "-Y 1 +X 1", &pixel));
    let plain = of("FORMAT=32-bit_rle_rgbe");
    assert!(codes(&plain).is_empty());
    assert_eq!(plain.into_linear()[(0, 0)], Vec3::ONE);
    let photo = of("EXPOSURE=4\nFORMAT=32-bit_rle_rgbe\nEXPOSURE= 2.0\nCOLORCORR=1 0.5 2\nCOLORCORR=1 1 2");
    assert_eq!(codes(&photo), ["hdr-exposure"]);
    assert_eq!(photo.into_linear()[(0, 0)], Vec3::new(0.125, 0.25, 0.031_25));
    // XYZ of (1, 1, 1) by IEC 61966-2-1: sums of the rows of its matrix.
    let photo = of("FORMAT=32-bit_rle_xyze");
    let expected = Vec3::new(1.2048, 0.9483, 0.9087);
    assert!((photo.into_linear()[(0, 0)] - expected).abs().max_element() < 1e-3);
    for broken in ["EXPOSURE=0\nFORMAT=32-bit_rle_rgbe", "EXPOSURE=x", "COLORCORR=1 2"] {
        let bytes = hdr(&format!("#?RADIANCE\n{broken}"), "-Y 1 +X 1", &pixel);
        let error = read_with(bytes, PhotoOptions::default()).unwrap_err();
        assert!(matches!(error.place(), Place::Byte(..)) && !error.remedy_text().is_empty(), "{error}");
    }
}
