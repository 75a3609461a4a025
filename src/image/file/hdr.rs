//! Radiance pictures: runs of pixels with three mantissas and one exponent.
//!
//! Ward 1991, "Real pixels" (Graphics Gems II); the file format is that of Radiance's `picture_description`: a signature,
//! lines `NAME=value`, an empty line, the resolution, scan lines. Read are both signatures in use, `FORMAT` in RGB and
//! XYZ, `EXPOSURE`, `COLORCORR` and `PRIMARIES`, scan lines flat, in the old and in the new run coding, and all eight
//! directions of the scan lines. A mantissa m stands for m/256: most programs that write these files round so.
//!
//! `EXPOSURE` and `COLORCORR` are factors that the pixels were multiplied by, each time that a program did: the radiance is
//! what is left after dividing by their products.

use super::colour::{Primaries, is_identity, rec709_from_xyz_d65};
use super::format::{Source, malformed, too_large};
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::image::{Image, RgbImage};
use glam::{DMat3, DVec2, Vec3};
use std::io::BufRead;
use std::path::Path;

/// Headers are a few lines; longer ones hold the commands that made a picture.
const LONGEST_HEADER: u64 = 1 << 20;
/// Widths that the new run coding can have.
const NEW_RUN_WIDTHS: std::ops::RangeInclusive<usize> = 8..=32_767;

/// What stands before the pixels.
pub struct HdrHeader {
    /// Width and height of the upright picture, in pixels.
    width: usize,
    height: usize,
    is_xyz: bool,
    /// Product of all exposures and corrections, for each channel.
    applied: Vec3,
    /// Linear Rec. 709 of the stored channels; `None` where they are.
    rec709_from_stored: Option<DMat3>,
    /// Whether scan lines are columns of the picture.
    columns_first: bool,
    /// Whether scan lines begin at the right, and come from the bottom.
    from_right: bool,
    from_bottom: bool,
    /// Where the pixels begin.
    data_offset: usize,
}

impl HdrHeader {
    /// (width, height) of the upright picture, in pixels.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// Length and number of the scan lines.
    fn lines(&self) -> (usize, usize) {
        if self.columns_first { (self.height, self.width) } else { (self.width, self.height) }
    }
}

/// Reads the header from the start of a file.
pub fn read_header(reader: &mut impl BufRead, path: &Path) -> Result<HdrHeader> {
    let mut position = 0;
    let mut line = || read_line(reader, path, &mut position);
    let (signature, _) = line()?;
    // Also what some programs write in the place of the name: the two characters before it make the format.
    if !signature.starts_with("#?") {
        return Err(malformed(path, 0, "the signature of a Radiance picture is missing").remedy("save it again"));
    }
    let (mut exposure, mut correction, mut is_xyz, mut primaries) = (1.0f64, [1.0f64; 3], false, None);
    loop {
        let (text, at) = line()?;
        if text.is_empty() {
            break;
        }
        let Some((name, value)) = text.split_once('=') else { continue };
        let value = value.trim();
        match name.trim() {
            "EXPOSURE" => exposure *= factors::<1>(value, path, at, "EXPOSURE")?[0],
            "COLORCORR" => {
                let factors = factors::<3>(value, path, at, "COLORCORR")?;
                (0..3).for_each(|channel| correction[channel] *= factors[channel]);
            }
            "FORMAT" => {
                is_xyz = match value {
                    "32-bit_rle_rgbe" => false,
                    "32-bit_rle_xyze" => true,
                    other => {
                        return Err(Error::new(
                            ErrorKind::Unsupported,
                            format!("the pixel format '{other}' is not read"),
                        )
                        .at(Place::Byte(path.into(), at))
                        .remedy("save it as 32-bit_rle_rgbe, or as OpenEXR"));
                    }
                }
            }
            "PRIMARIES" => primaries = primaries_of(value),
            _ => {}
        }
    }
    let (resolution, at) = line()?;
    let Some((first, second)) = axes_of(&resolution) else {
        return Err(malformed(path, at, format!("'{resolution}' is not a resolution such as -Y 512 +X 1024"))
            .remedy("save it again"));
    };
    let columns_first = first.is_x;
    let (x, y) = if columns_first { (first, second) } else { (second, first) };
    // PRIMARIES describe RGB; XYZ needs none.
    let matrix = if is_xyz {
        Some(rec709_from_xyz_d65())
    } else {
        primaries.and_then(|primaries: Primaries| primaries.rec709_from_rgb()).filter(|matrix| !is_identity(matrix))
    };
    let applied = Vec3::from_array(correction.map(|factor| (factor * exposure) as f32));
    if !(applied.is_finite() && applied.min_element() > 0.0) {
        return Err(malformed(path, at, "the product of all EXPOSURE and COLORCORR lines is out of range")
            .remedy("remove these lines from the header if the pixels are right without them"));
    }
    Ok(HdrHeader {
        width: x.length,
        height: y.length,
        is_xyz,
        applied,
        rec709_from_stored: matrix,
        columns_first,
        from_right: !x.is_positive,
        // -Y comes from the top, as in most files.
        from_bottom: y.is_positive,
        data_offset: position as usize,
    })
}

/// A line without its end, and the byte it begins at.
fn read_line(reader: &mut impl BufRead, path: &Path, position: &mut u64) -> Result<(String, u64)> {
    let at = *position;
    let mut bytes = Vec::new();
    let left = LONGEST_HEADER.saturating_sub(at);
    std::io::Read::take(&mut *reader, left)
        .read_until(b'\n', &mut bytes)
        .map_err(|error| Error::reading(path, error))?;
    *position += bytes.len() as u64;
    if bytes.pop() != Some(b'\n') {
        return Err(malformed(path, *position, "the file ends within the header of a Radiance picture")
            .remedy("the file is cut short or damaged: copy it again"));
    }
    Ok((String::from_utf8_lossy(&bytes).trim().to_owned(), at))
}

fn factors<const COUNT: usize>(text: &str, path: &Path, at: u64, name: &str) -> Result<[f64; COUNT]> {
    let numbers: Option<Vec<f64>> = text
        .split_whitespace()
        .map(|word| word.parse().ok().filter(|number: &f64| number.is_finite() && *number > 0.0))
        .collect();
    numbers.and_then(|numbers| numbers.try_into().ok()).ok_or_else(|| {
        malformed(path, at, format!("{name} is '{text}', not {COUNT} positive numbers"))
            .remedy("remove the line from the header if the pixels are right without it")
    })
}

fn primaries_of(text: &str) -> Option<Primaries> {
    let numbers: Vec<f64> = text.split_whitespace().map_while(|word| word.parse().ok()).collect();
    let [rx, ry, gx, gy, bx, by, wx, wy] = numbers.try_into().ok()?;
    let xy = DVec2::new;
    Some(Primaries { red: xy(rx, ry), green: xy(gx, gy), blue: xy(bx, by), white: xy(wx, wy) })
}

/// One axis of the resolution.
#[derive(Clone, Copy)]
struct Axis {
    is_x: bool,
    is_positive: bool,
    length: usize,
}

fn axes_of(text: &str) -> Option<(Axis, Axis)> {
    let words: Vec<&str> = text.split_whitespace().collect();
    let [first, first_length, second, second_length] = words.try_into().ok()?;
    let axis = |name: &str, length: &str| {
        let (is_positive, is_x) = match name {
            "+X" => (true, true),
            "-X" => (false, true),
            "+Y" => (true, false),
            "-Y" => (false, false),
            _ => return None,
        };
        Some(Axis { is_x, is_positive, length: length.parse::<u32>().ok()? as usize })
    };
    let axes = (axis(first, first_length)?, axis(second, second_length)?);
    (axes.0.is_x != axes.1.is_x).then_some(axes)
}

/// Radiance in linear Rec. 709, upright, and what was done to get there.
pub fn read_rgb(source: &Source) -> Result<(RgbImage, Vec<Finding>)> {
    let header = read_header(&mut source.bytes.as_slice(), &source.path)?;
    let (length, count) = header.lines();
    let mut lines = Lines { bytes: &source.bytes, position: header.data_offset, path: &source.path };
    let least_bytes = if NEW_RUN_WIDTHS.contains(&length) { 4 + 8 * length.div_ceil(127) } else { 4 };
    let in_file = source.bytes.len().saturating_sub(header.data_offset);
    // The old run coding packs more into four bytes, but nothing that is a picture packs this much.
    if count.saturating_mul(least_bytes) / 64 > in_file {
        return Err(too_large(&source.path, format!("{in_file} bytes cannot hold {count} scan lines")));
    }
    let mut line = vec![[0u8; 4]; length];
    let mut pixels = vec![Vec3::ZERO; header.width * header.height];
    for index in 0..count {
        lines.read(&mut line)?;
        for (along, stored) in line.iter().enumerate() {
            let (x, y) = if header.columns_first { (index, along) } else { (along, index) };
            let column = if header.from_right { header.width - 1 - x } else { x };
            let row = if header.from_bottom { header.height - 1 - y } else { y };
            pixels[row * header.width + column] = decoded(*stored) / header.applied;
        }
    }
    if let Some(matrix) = header.rec709_from_stored.map(|matrix| matrix.as_mat3()) {
        pixels.iter_mut().for_each(|pixel| *pixel = matrix * *pixel);
    }
    Ok((Image::from_pixels(header.width, header.height, pixels), told(&header)))
}

/// The radiance of three mantissas and an exponent.
fn decoded([red, green, blue, exponent]: [u8; 4]) -> Vec3 {
    if exponent == 0 {
        return Vec3::ZERO;
    }
    // In two factors, of which neither leaves the range of floats.
    let scale = (f32::from(exponent) - 128.0).exp2() / 256.0;
    Vec3::new(f32::from(red), f32::from(green), f32::from(blue)) * scale
}

fn told(header: &HdrHeader) -> Vec<Finding> {
    let mut told = Vec::new();
    if header.applied != Vec3::ONE {
        let [red, green, blue] = header.applied.to_array();
        let factors = if red == green && green == blue { format!("{red}") } else { format!("{red}, {green}, {blue}") };
        let message = format!("pixels are divided by {factors}, the EXPOSURE and COLORCORR of the file");
        let stops = header.applied.to_array().map(|factor| factor.log2().abs()).into_iter().fold(0.0, f32::max);
        told.push(Finding::new(Severity::Note, "hdr-exposure", message).extent(f64::from(stops)));
    }
    if header.rec709_from_stored.is_some() {
        let from = if header.is_xyz { "CIE XYZ" } else { "the primaries of the file" };
        told.push(Finding::new(
            Severity::Note,
            "colour-converted",
            format!("colours are converted from {from} to Rec. 709"),
        ));
    }
    told
}

/// The scan lines of a file, one after another.
struct Lines<'a> {
    bytes: &'a [u8],
    position: usize,
    path: &'a Path,
}

impl Lines<'_> {
    fn take(&mut self, count: usize) -> Result<&[u8]> {
        let end = self.position.saturating_add(count);
        let Some(bytes) = self.bytes.get(self.position..end) else {
            return Err(malformed(self.path, self.bytes.len() as u64, "the file ends before its last pixel")
                .remedy("the file is cut short or damaged: copy it again"));
        };
        self.position = end;
        Ok(bytes)
    }

    fn overrun(&self) -> Error {
        malformed(self.path, self.position as u64, "a run of pixels is longer than its scan line")
            .remedy("the file is damaged: copy or save it again")
    }

    fn read(&mut self, line: &mut [[u8; 4]]) -> Result<()> {
        if let Some(&[2, 2, high, low]) = self.bytes.get(self.position..self.position.saturating_add(4))
            && high < 128
            && NEW_RUN_WIDTHS.contains(&line.len())
        {
            self.position += 4;
            if usize::from(u16::from_be_bytes([high, low])) != line.len() {
                return Err(self.overrun());
            }
            return (0..4).try_for_each(|channel| self.read_channel(line, channel));
        }
        self.read_old(line)
    }

    /// One channel of a line in the new run coding.
    fn read_channel(&mut self, line: &mut [[u8; 4]], channel: usize) -> Result<()> {
        let mut filled = 0;
        while filled < line.len() {
            let code = usize::from(self.take(1)?[0]);
            let (count, is_run) = if code > 128 { (code - 128, true) } else { (code, false) };
            if count == 0 || filled + count > line.len() {
                return Err(self.overrun());
            }
            let values = self.take(if is_run { 1 } else { count })?;
            for (place, pixel) in line[filled..filled + count].iter_mut().enumerate() {
                pixel[channel] = values[if is_run { 0 } else { place }];
            }
            filled += count;
        }
        Ok(())
    }

    /// A line of pixels as they are, where `1 1 1 n` repeats the one before n times; several in a row are the bytes of a
    /// larger number, the lowest first.
    fn read_old(&mut self, line: &mut [[u8; 4]]) -> Result<()> {
        let (mut filled, mut shift) = (0usize, 0u32);
        while filled < line.len() {
            let pixel: [u8; 4] = match self.take(4)? {
                &[red, green, blue, exponent] => [red, green, blue, exponent],
                _ => return Err(self.overrun()),
            };
            if pixel[..3] != [1, 1, 1] {
                line[filled] = pixel;
                filled += 1;
                shift = 0;
                continue;
            }
            let count = usize::from(pixel[3]).checked_shl(shift).filter(|_| shift < 24).unwrap_or(usize::MAX);
            if filled == 0 || count > line.len() - filled {
                return Err(self.overrun());
            }
            let repeated = line[filled - 1];
            line[filled..filled + count].fill(repeated);
            filled += count;
            shift += 8;
        }
        Ok(())
    }
}
