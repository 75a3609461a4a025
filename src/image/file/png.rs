//! What a PNG says of its colours beside an ICC profile: gamma, primaries, coding-independent code points.
//!
//! PNG specification, third edition, 11.3.2. The order of precedence is theirs: cICP, iCCP, sRGB, then gAMA and cHRM.

use super::colour::{ColourSpace, Curve, Primaries};
use super::stored::Declared;
use flate2::read::ZlibDecoder;
use glam::DVec2;
use std::io::Read;

/// What the chunks before the pixels declare; an ICC profile is not looked at here.
pub fn declared(bytes: &[u8]) -> Declared {
    match space_of(bytes) {
        Ok(Some(space)) => Declared::Space(space, "the gamma and primaries of the file"),
        Ok(None) => Declared::Nothing,
        Err(what) => Declared::NotRead(what),
    }
}

/// The chunk that a PNG ends with.
pub const END: &[u8; 12] = b"\0\0\0\0IEND\xae\x42\x60\x82";

/// Whether the file declares code points: they say what the colours are, whatever its profile says.
pub fn has_code_points(bytes: &[u8]) -> bool {
    chunks(bytes).any(|(name, body)| name == b"cICP" && body.len() == 4)
}

/// The EXIF block: of its own chunk, which may stand behind the pixels, or hexadecimal in a text, as ImageMagick wrote it
/// before there was that chunk.
pub fn exif(bytes: &[u8]) -> Option<Vec<u8>> {
    let own = || all_chunks(bytes).find(|(name, _)| *name == b"eXIf").map(|(_, body)| body.to_vec());
    own().or_else(|| all_chunks(bytes).find_map(|(name, body)| exif_of_text(name, body)))
}

/// The EXIF block of a text chunk whose keyword says that it holds one.
fn exif_of_text(name: &[u8], body: &[u8]) -> Option<Vec<u8>> {
    /// More than a camera writes, thumbnail included.
    const LARGEST: u64 = 1 << 20;
    let body =
        [&b"Raw profile type exif\0"[..], b"Raw profile type APP1\0"].iter().find_map(|key| body.strip_prefix(*key))?;
    let mut text = Vec::new();
    match name {
        b"tEXt" => text.extend_from_slice(body),
        b"zTXt" => drop(ZlibDecoder::new(body.get(1..)?).take(LARGEST).read_to_end(&mut text).ok()?),
        _ => return None,
    }
    // A line of its name and one of its length stand before it.
    let lines = text.split(|byte| *byte == b'\n').skip_while(|line| line.is_empty()).skip(2);
    let digits: Vec<u8> = lines.flatten().filter(|byte| byte.is_ascii_hexdigit()).copied().collect();
    let digit = |byte: u8| char::from(byte).to_digit(16).unwrap_or(0) as u8;
    Some(digits.chunks_exact(2).map(|pair| 16 * digit(pair[0]) + digit(pair[1])).collect())
}

/// The chunks before the pixels: name and content.
fn chunks(bytes: &[u8]) -> impl Iterator<Item = (&[u8], &[u8])> {
    all_chunks(bytes).take_while(|(name, _)| *name != b"IDAT")
}

/// All chunks before the end.
fn all_chunks(bytes: &[u8]) -> impl Iterator<Item = (&[u8], &[u8])> {
    let mut position = 8;
    std::iter::from_fn(move || {
        let head = bytes.get(position..position + 8)?;
        let length = u32::from_be_bytes([head[0], head[1], head[2], head[3]]) as usize;
        let body = bytes.get(position + 8..(position + 8).saturating_add(length))?;
        position = (position + 12).saturating_add(length);
        (&head[4..8] != b"IEND").then_some((&head[4..8], body))
    })
}

/// The colour space; `None` for sRGB, the name of what is not read as an error.
fn space_of(bytes: &[u8]) -> Result<Option<ColourSpace>, String> {
    let (mut gamma, mut primaries, mut code_points, mut is_srgb) = (None, None, None, false);
    for (name, body) in chunks(bytes) {
        let length = body.len();
        match name {
            b"gAMA" if length == 4 => gamma = numbers::<1>(body).map(|[gamma]| gamma),
            b"cHRM" if length == 32 => {
                let xy = DVec2::new;
                primaries = numbers::<8>(body).map(|[wx, wy, rx, ry, gx, gy, bx, by]| Primaries {
                    white: xy(wx, wy),
                    red: xy(rx, ry),
                    green: xy(gx, gy),
                    blue: xy(bx, by),
                });
            }
            b"cICP" if length == 4 => code_points = Some([body[0], body[1], body[2], body[3]]),
            b"sRGB" => is_srgb = true,
            _ => {}
        }
    }
    if let Some(points) = code_points {
        return space_of_code_points(points).map(|space| (!space.is_srgb()).then_some(space));
    }
    if is_srgb {
        return Ok(None);
    }
    let curve = match gamma {
        // 1 / 2.2 is how sRGB is written for programs that know no sRGB.
        Some(gamma) if (gamma - 1.0 / 2.2).abs() < 0.003 => Curve::Srgb,
        Some(gamma) if (gamma - 1.0).abs() < 0.003 => Curve::Linear,
        Some(gamma) if gamma > 0.1 && gamma < 10.0 => Curve::Gamma(1.0 / gamma),
        _ => Curve::Srgb,
    };
    let space = ColourSpace::of_curve(curve);
    let space = match primaries.and_then(|primaries| primaries.rec709_from_rgb()) {
        Some(matrix) => space.with_matrix(matrix),
        None => space,
    };
    Ok((!space.is_srgb()).then_some(space))
}

/// The inverse of the curve of ITU-R BT.709 (item 1.2), which BT.601 and BT.2020 share: what a camera of video undoes.
const INVERSE_BT709: [f64; 7] = [1.0 / 0.45, 1.0 / 1.099, 0.099 / 1.099, 1.0 / 4.5, 0.081, 0.0, 0.0];

/// The colour space of coding-independent code points (ITU-T H.273): primaries, transfer, matrix, range. The name of what is
/// not read as an error.
fn space_of_code_points([primaries, transfer, matrix, range]: [u8; 4]) -> Result<ColourSpace, String> {
    let curve = match transfer {
        // What is not specified is sRGB, as still images are.
        2 | 13 => Curve::Srgb,
        1 | 6 | 14 | 15 => Curve::Parametric(INVERSE_BT709),
        4 => Curve::Gamma(2.2),
        5 => Curve::Gamma(2.8),
        8 => Curve::Linear,
        16 => return Err("PQ (SMPTE ST 2084, HDR10)".into()),
        18 => return Err("HLG (hybrid log-gamma)".into()),
        other => return Err(format!("the transfer function {other} of cICP")),
    };
    let xy = DVec2::new;
    let primaries = match primaries {
        1 | 2 => Primaries::REC_709,
        5 => Primaries { green: xy(0.29, 0.60), ..Primaries::REC_709 },
        6 | 7 => {
            Primaries { red: xy(0.630, 0.340), green: xy(0.310, 0.595), blue: xy(0.155, 0.070), ..Primaries::REC_709 }
        }
        9 => Primaries::REC_2020,
        11 => Primaries { white: xy(0.314, 0.351), ..Primaries::DISPLAY_P3 },
        12 => Primaries::DISPLAY_P3,
        other => return Err(format!("the primaries {other} of cICP")),
    };
    if matrix != 0 || range != 1 {
        return Err("video levels (cICP: not RGB in full range)".into());
    }
    let space = ColourSpace::of_curve(curve);
    Ok(primaries.rec709_from_rgb().map_or(space.clone(), |matrix| space.with_matrix(matrix)))
}

/// Numbers in hundred-thousandths.
fn numbers<const COUNT: usize>(bytes: &[u8]) -> Option<[f64; COUNT]> {
    let values: Vec<f64> = bytes
        .chunks_exact(4)
        .map(|bytes| f64::from(u32::from_be_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])) / 1e5)
        .collect();
    values.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::ErrorKind;
    use crate::image::Image;
    use crate::image::file::{self, Encoding, PhotoOptions};
    use glam::Vec3;
    use std::path::Path;

    #[test]
    fn exif_is_found_behind_the_pixels_and_in_a_text() {
        let block = b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0";
        let plain = file::encode_png_srgb8(&Image::filled(4, 3, [9; 3])).unwrap();
        let (before_end, end) = plain.split_at(plain.len() - 12);
        let hexadecimal: String = block.iter().map(|byte| format!("{byte:02x}")).collect();
        let text = format!("\nexif\n      {}\n{}\n{}\n", block.len(), &hexadecimal[..40], &hexadecimal[40..]);
        let mut packed = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
        std::io::Write::write_all(&mut packed, text.as_bytes()).unwrap();
        let packed = [&b"Raw profile type exif\0\0"[..], &packed.finish().unwrap()].concat();
        let text = [&b"Raw profile type exif\0"[..], text.as_bytes()].concat();
        for (name, body) in [(b"eXIf", &block[..]), (b"tEXt", &text[..]), (b"zTXt", &packed[..])] {
            let mut chunk = [&(body.len() as u32).to_be_bytes()[..], name, body].concat();
            chunk.extend(crc32(&chunk[4..]).to_be_bytes());
            let bytes = [before_end, &chunk, end].concat();
            let photo = file::read_photo_from(Path::new("a.png"), bytes, &PhotoOptions::default()).unwrap();
            assert_eq!(photo.orientation, 6, "{}", String::from_utf8_lossy(name));
        }
        assert_eq!(exif(&plain), None);
        assert_eq!(exif(b"short"), None);
    }

    fn crc32(bytes: &[u8]) -> u32 {
        let mut sum = flate2::Crc::new();
        sum.update(bytes);
        sum.sum()
    }

    fn with_chunk(name: &[u8], body: &[u8]) -> Vec<u8> {
        let mut bytes = b"\x89PNG\r\n\x1a\n".to_vec();
        bytes.extend((body.len() as u32).to_be_bytes());
        bytes.extend(name);
        bytes.extend(body);
        bytes.extend([0; 4]);
        bytes.extend([0, 0, 0, 0]);
        bytes.extend(b"IDAT");
        bytes
    }

    #[test]
    fn gamma_primaries_and_code_points_are_read() {
        let space = |name: &[u8], body: &[u8]| match declared(&with_chunk(name, body)) {
            Declared::Space(space, _) => space,
            other => panic!("{other:?}"),
        };
        assert_eq!(declared(&with_chunk(b"gAMA", &45_455u32.to_be_bytes())), Declared::Nothing);
        assert_eq!(declared(&with_chunk(b"tEXt", b"a")), Declared::Nothing);
        let linear = space(b"gAMA", &100_000u32.to_be_bytes());
        assert_eq!(linear, ColourSpace::of_curve(Curve::Linear));
        let p3 = space(b"cICP", &[12, 13, 0, 1]);
        assert!(p3.curves[0] == Curve::Srgb && (p3.rec709_from_rgb.unwrap() * Vec3::X).x > 1.2);
        let video = space(b"cICP", &[1, 1, 0, 1]);
        for (linear, stored) in [(0.01f32, 0.045), (0.18, 1.099 * 0.18f32.powf(0.45) - 0.099)] {
            assert!((video.curves[0].linear(stored) - linear).abs() < 1e-5);
        }
        let wide = [31_270u32, 32_900, 70_800, 29_200, 17_000, 79_700, 13_100, 4_600];
        let wide: Vec<u8> = wide.into_iter().flat_map(u32::to_be_bytes).collect();
        let wide = space(b"cHRM", &wide);
        assert!(((wide.rec709_from_rgb.unwrap() * Vec3::X).x - 1.6605).abs() < 1e-3);
        assert_eq!(declared(b"\x89PNG\r\n\x1a\n\xff\xff\xff\xffgAMA"), Declared::Nothing);
    }

    /// The check sum of a chunk (PNG specification, annex D), bit by bit.
    fn check_sum(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(!0u32, |sum, byte| {
            (0..8).fold(sum ^ u32::from(*byte), |sum, _| if sum & 1 == 1 { 0xedb8_8320 ^ (sum >> 1) } else { sum >> 1 })
        })
    }

    /// A chunk with its length and its sum.
    fn chunk(name: &[u8], body: &[u8]) -> Vec<u8> {
        let whole = [name, body].concat();
        [&(body.len() as u32).to_be_bytes(), &whole[..], &check_sum(&whole).to_be_bytes()].concat()
    }

    #[test]
    fn code_points_go_before_a_profile() {
        let encoded = {
            use ::image::ImageEncoder;
            let mut bytes = Vec::new();
            let mut encoder = ::image::codecs::png::PngEncoder::new(&mut bytes);
            encoder.set_icc_profile(moxcms::ColorProfile::new_display_p3().encode().unwrap()).unwrap();
            encoder.write_image(&[200, 20, 20], 1, 1, ::image::ExtendedColorType::Rgb8).unwrap();
            bytes
        };
        let red = |bytes: &[u8]| {
            let photo = file::read_photo_from(Path::new("a.png"), bytes.to_vec(), &PhotoOptions::default()).unwrap();
            match photo.pixels {
                file::PhotoPixels::Srgb8(bytes) => f32::from(bytes.pixels()[0][0]),
                file::PhotoPixels::Linear(image) => image.pixels()[0].x,
            }
        };
        let linear = [&encoded[..33], &chunk(b"cICP", &[1, 8, 0, 1]), &encoded[33..]].concat();
        assert!(red(&encoded) > 0.6, "of Display P3, redder than Rec. 709");
        assert!((red(&linear) - 200.0 / 255.0).abs() < 1e-5);
        let srgb = [&encoded[..33], &chunk(b"cICP", &[1, 13, 0, 1]), &encoded[33..]].concat();
        assert_eq!(red(&srgb), 200.0);
    }

    #[test]
    fn a_file_without_its_end_is_read_where_all_pixels_are_there() {
        let whole = file::encode_png_srgb8(&Image::from_fn(9, 7, |row, column| [row as u8, column as u8, 90])).unwrap();
        let read = |bytes: &[u8]| file::read_photo_from(Path::new("a.png"), bytes.to_vec(), &PhotoOptions::default());
        assert!(whole.ends_with(END) && read(&whole).unwrap().findings.is_empty());
        let pixels = &whole[..whole.len() - END.len()];
        let photo = read(pixels).unwrap();
        assert_eq!(photo.findings[0].code, "png-no-end");
        assert_eq!(read(&pixels[..pixels.len() - 8]).unwrap_err().kind(), ErrorKind::Malformed);
        // A part of the pixels in a chunk that is whole by itself.
        let place = whole.windows(4).position(|name| name == b"IDAT").unwrap();
        let part = [&whole[..place - 4], &chunk(b"IDAT", &whole[place + 4..place + 20])].concat();
        assert_eq!(read(&part).unwrap_err().kind(), ErrorKind::Malformed);
    }

    #[test]
    fn a_photo_of_pq_is_refused_with_a_way_out_unless_its_curve_is_given() {
        let plain = file::encode_png_srgb8(&Image::filled(4, 3, [90, 100, 110])).unwrap();
        // Behind the header, which is the first chunk.
        let bytes = [&plain[..33], &chunk(b"cICP", &[9, 16, 0, 1]), &plain[33..]].concat();
        let read = |encoding| {
            let options = PhotoOptions { encoding, ..Default::default() };
            file::read_photo_from(Path::new("a.png"), bytes.clone(), &options)
        };
        let error = read(Encoding::Auto).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Unsupported);
        assert!(error.to_string().contains("PQ") && error.remedy_text().contains("sRGB"), "{error}");
        assert!(read(Encoding::Srgb).is_ok());
    }

    #[test]
    fn code_points_that_are_not_read_are_named() {
        for (points, name) in
            [([9, 16, 0, 1], "PQ"), ([9, 18, 0, 1], "HLG"), ([1, 13, 0, 0], "levels"), ([1, 9, 0, 1], "9")]
        {
            match declared(&with_chunk(b"cICP", &points)) {
                Declared::NotRead(what) => assert!(what.contains(name), "{what}"),
                other => panic!("{other:?}"),
            }
        }
    }
}
