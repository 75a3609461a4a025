//! What a PNG says of its colours beside an ICC profile: gamma, primaries, coding-independent code points.
//!
//! PNG specification, third edition, 11.3.2. The order of precedence is theirs: cICP, iCCP, sRGB, then gAMA and cHRM.

use super::colour::{ColourSpace, Curve, Primaries};
use super::stored::Declared;
use glam::DVec2;

/// What the chunks before the pixels declare; an ICC profile is not looked at here.
pub fn declared(bytes: &[u8]) -> Declared {
    match space_of(bytes) {
        Ok(Some(space)) => Declared::Space(space, "the gamma and primaries of the file"),
        Ok(None) => Declared::Nothing,
        Err(what) => Declared::NotRead(what),
    }
}

/// The colour space; `None` for sRGB, the name of what is not read as an error.
fn space_of(bytes: &[u8]) -> Result<Option<ColourSpace>, String> {
    let mut position = 8;
    let (mut gamma, mut primaries, mut code_points, mut is_srgb) = (None, None, None, false);
    while let Some(head) = bytes.get(position..position + 8) {
        let length = u32::from_be_bytes([head[0], head[1], head[2], head[3]]) as usize;
        let Some(body) = bytes.get(position + 8..(position + 8).saturating_add(length)) else { break };
        match &head[4..8] {
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
            b"IDAT" | b"IEND" => break,
            _ => {}
        }
        position = (position + 12).saturating_add(length);
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

/// The colour space of coding-independent code points (ITU-T H.273): primaries, transfer, matrix, range. The name of what is
/// not read as an error.
fn space_of_code_points([primaries, transfer, matrix, range]: [u8; 4]) -> Result<ColourSpace, String> {
    let curve = match transfer {
        // Those of video are near enough to their own inverse only; sRGB is what still images carry.
        1 | 2 | 6 | 13 | 14 | 15 => Curve::Srgb,
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

    #[test]
    fn a_photo_of_pq_is_refused_with_a_way_out_unless_its_curve_is_given() {
        let plain = file::encode_png_srgb8(&Image::filled(4, 3, [90, 100, 110])).unwrap();
        let body = [&b"cICP"[..], &[9, 16, 0, 1]].concat();
        // Behind the header, which is the first chunk.
        let bytes = [&plain[..33], &4u32.to_be_bytes(), &body, &check_sum(&body).to_be_bytes(), &plain[33..]].concat();
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
