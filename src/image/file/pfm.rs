//! Portable float maps: a text header of three lines, then rows from the bottom to the top.
//!
//! Debevec 2001, "PFM Portable FloatMap Image Format". The magnitude of the scale factor is ignored, as most readers
//! do; its sign tells the byte order.

use super::format::{Source, malformed};
use crate::error::{Error, Result};
use crate::image::{GreyImage, Image, RgbImage};
use glam::Vec3;
use std::io::BufRead;
use std::path::Path;

/// The header of a PFM file.
pub struct PfmHeader {
    channels: usize,
    width: usize,
    height: usize,
    little_endian: bool,
    /// Where the pixels begin.
    data_offset: usize,
}

impl PfmHeader {
    /// (width, height) in pixels.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }
}

/// Reads the header from the start of a file.
pub fn read_header(reader: &mut impl BufRead, path: &Path) -> Result<PfmHeader> {
    let mut position = 0;
    let mut word = |name: &str| -> Result<String> { read_word(reader, path, &mut position, name) };
    let kind = word("the kind")?;
    let width = word("the width")?;
    let height = word("the height")?;
    let scale = word("the scale")?;
    let channels = match kind.as_str() {
        "PF" => 3,
        "Pf" => 1,
        _ => {
            let message = format!("a float map of the kind '{kind}' is not read");
            return Err(malformed(path, 0, message).remedy("save it as PF, of three channels, or Pf, of one"));
        }
    };
    let number = |text: &str| text.parse::<u32>().ok().map(|value| value as usize);
    let (Some(width), Some(height)) = (number(&width), number(&height)) else {
        return Err(malformed(path, 3, format!("'{width} {height}' is not a size in pixels")).remedy("save it again"));
    };
    let Some(scale) = scale.parse::<f32>().ok().filter(|scale| scale.is_finite() && *scale != 0.0) else {
        return Err(malformed(path, position, format!("the scale '{scale}' is not a number other than 0"))
            .remedy("save it again"));
    };
    Ok(PfmHeader { channels, width, height, little_endian: scale < 0.0, data_offset: position as usize })
}

/// The next word and the one white-space byte after it.
fn read_word(reader: &mut impl BufRead, path: &Path, position: &mut u64, name: &str) -> Result<String> {
    let mut text = String::new();
    loop {
        let mut byte = [0];
        if reader.read(&mut byte).map_err(|error| Error::reading(path, error))? == 0 {
            return Err(malformed(path, *position, format!("the file ends before {name}")).remedy("copy it again"));
        }
        *position += 1;
        match byte[0] {
            b'\r' => {}
            space if space.is_ascii_whitespace() => {
                if !text.is_empty() {
                    return Ok(text);
                }
            }
            letter => text.push(letter as char),
        }
        if text.len() > 32 {
            return Err(malformed(path, *position, format!("{name} is missing in the header of a float map"))
                .remedy("save it again"));
        }
    }
}

/// One value per sample in row-major order from the top, and the number of channels.
fn samples(source: &Source) -> Result<(usize, Vec<f32>)> {
    let header = read_header(&mut source.bytes.as_slice(), &source.path)?;
    let row_samples = header.width * header.channels;
    let data = &source.bytes[header.data_offset.min(source.bytes.len())..];
    let needed = row_samples * header.height * 4;
    if data.len() < needed {
        let message = format!("the file ends {} bytes before its last pixel", needed - data.len());
        return Err(malformed(&source.path, source.bytes.len() as u64, message).remedy("copy it again"));
    }
    let mut values = Vec::with_capacity(row_samples * header.height);
    for row in (0..header.height).rev() {
        let bytes = &data[row * row_samples * 4..(row + 1) * row_samples * 4];
        values.extend(bytes.chunks_exact(4).map(|bytes| {
            let bytes = [bytes[0], bytes[1], bytes[2], bytes[3]];
            if header.little_endian { f32::from_le_bytes(bytes) } else { f32::from_be_bytes(bytes) }
        }));
    }
    Ok((header.channels, values))
}

/// The colour image of a float map; grey is repeated.
pub fn read_rgb(source: &Source) -> Result<RgbImage> {
    let (channels, values) = samples(source)?;
    let pixels = match channels {
        1 => values.into_iter().map(Vec3::splat).collect(),
        _ => values.chunks_exact(3).map(Vec3::from_slice).collect(),
    };
    Ok(Image::from_pixels(source.header.width, source.header.height, pixels))
}

/// The grey image of a float map; colour gives its luminance.
pub fn read_grey(source: &Source) -> Result<GreyImage> {
    let (channels, values) = samples(source)?;
    let pixels = match channels {
        1 => values,
        _ => values.chunks_exact(3).map(|rgb| super::grey_of_rgb(Vec3::from_slice(rgb))).collect(),
    };
    Ok(Image::from_pixels(source.header.width, source.header.height, pixels))
}
