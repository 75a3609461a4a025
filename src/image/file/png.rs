//! What a PNG says of its colours beside an ICC profile: gamma, primaries, coding-independent code points.
//!
//! PNG specification, third edition, 11.3.2. The order of precedence is theirs: cICP, iCCP, sRGB, then gAMA and cHRM.

use super::colour::{ColourSpace, Curve, Primaries};
use glam::DVec2;

/// What the chunks before the pixels declare; `None` when nothing or sRGB. An ICC profile is not looked at here.
pub fn declared(bytes: &[u8]) -> Option<ColourSpace> {
    let mut position = 8;
    let (mut gamma, mut primaries, mut code_points, mut is_srgb) = (None, None, None, false);
    while let Some(head) = bytes.get(position..position + 8) {
        let length = u32::from_be_bytes([head[0], head[1], head[2], head[3]]) as usize;
        let Some(body) = bytes.get(position + 8..(position + 8).saturating_add(length)) else { break };
        match &head[4..8] {
            b"gAMA" if length == 4 => gamma = Some(numbers::<1>(body)?[0]),
            b"cHRM" if length == 32 => {
                let [wx, wy, rx, ry, gx, gy, bx, by] = numbers::<8>(body)?;
                let xy = DVec2::new;
                primaries = Some(Primaries { white: xy(wx, wy), red: xy(rx, ry), green: xy(gx, gy), blue: xy(bx, by) });
            }
            b"cICP" if length == 4 => code_points = Some((body[0], body[1])),
            b"sRGB" => is_srgb = true,
            b"IDAT" | b"IEND" => break,
            _ => {}
        }
        position = (position + 12).saturating_add(length);
    }
    if let Some((primaries, transfer)) = code_points {
        let curve = match transfer {
            8 => Curve::Linear,
            // Those of video are near enough to their own inverse only; sRGB is what still images carry.
            _ => Curve::Srgb,
        };
        let primaries = match primaries {
            9 => Primaries::REC_2020,
            12 => Primaries::DISPLAY_P3,
            _ => Primaries::REC_709,
        };
        return Some(ColourSpace::of_curve(curve).with_matrix(primaries.rec709_from_rgb()?));
    }
    if is_srgb {
        return None;
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
    (!space.is_srgb()).then_some(space)
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
    use glam::Vec3;

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
        assert_eq!(declared(&with_chunk(b"gAMA", &45_455u32.to_be_bytes())), None);
        assert_eq!(declared(&with_chunk(b"tEXt", b"a")), None);
        let linear = declared(&with_chunk(b"gAMA", &100_000u32.to_be_bytes())).unwrap();
        assert_eq!(linear, ColourSpace::of_curve(Curve::Linear));
        let p3 = declared(&with_chunk(b"cICP", &[12, 13, 0, 1])).unwrap();
        assert!(p3.curves[0] == Curve::Srgb && (p3.rec709_from_rgb.unwrap() * Vec3::X).x > 1.2);
        let wide = [31_270u32, 32_900, 70_800, 29_200, 17_000, 79_700, 13_100, 4_600];
        let wide: Vec<u8> = wide.into_iter().flat_map(u32::to_be_bytes).collect();
        let wide = declared(&with_chunk(b"cHRM", &wide)).unwrap();
        assert!(((wide.rec709_from_rgb.unwrap() * Vec3::X).x - 1.6605).abs() < 1e-3);
        assert_eq!(declared(b"\x89PNG\r\n\x1a\n\xff\xff\xff\xffgAMA"), None);
    }
}
