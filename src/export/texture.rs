//! Maps as texture files: PNG of 8 or 16 bits, OpenEXR, TIFF.
//!
//! A curve is applied here and nowhere else: colours are stored with the sRGB curve where a reader expects it, roughness
//! and its like as they are.

use crate::error::{Error, ErrorKind, Place, Result};
use crate::files::write_bytes;
use crate::image::{GreyImage, RgbImage, file, transfer};
use ::image::codecs::png::PngEncoder;
use ::image::{ExtendedColorType, ImageEncoder};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// The kind of a texture file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum TextureFormat {
    /// PNG of 8 bits.
    Png8,
    /// PNG of 16 bits.
    #[default]
    Png16,
    /// OpenEXR of 32-bit floats, linear.
    Exr,
    /// TIFF of 16 bits.
    Tiff,
}

impl TextureFormat {
    /// Ending of the file's name, without a dot.
    pub fn extension(self) -> &'static str {
        match self {
            TextureFormat::Png8 | TextureFormat::Png16 => "png",
            TextureFormat::Exr => "exr",
            TextureFormat::Tiff => "tif",
        }
    }

    /// Bytes of one channel of one texel before compression.
    pub fn bytes_per_channel(self) -> usize {
        match self {
            TextureFormat::Png8 => 1,
            TextureFormat::Png16 | TextureFormat::Tiff => 2,
            TextureFormat::Exr => 4,
        }
    }
}

/// How values in [0, 1] become whole numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Curve {
    /// By the sRGB curve: colours.
    Srgb,
    /// In proportion: roughness, metalness.
    Linear,
}

/// A map to be written.
#[derive(Clone, Copy, Debug)]
pub enum Texture<'a> {
    /// Three channels.
    Rgb(&'a RgbImage),
    /// One channel.
    Grey(&'a GreyImage),
}

impl Texture<'_> {
    fn size(&self) -> (usize, usize) {
        match self {
            Texture::Rgb(image) => (image.width(), image.height()),
            Texture::Grey(image) => (image.width(), image.height()),
        }
    }

    fn channels(&self) -> usize {
        match self {
            Texture::Rgb(_) => 3,
            Texture::Grey(_) => 1,
        }
    }

    /// All values, channels side by side.
    fn values(&self) -> Box<dyn Iterator<Item = f32> + '_> {
        match self {
            Texture::Rgb(image) => Box::new(image.pixels().iter().flat_map(|rgb| rgb.to_array())),
            Texture::Grey(image) => Box::new(image.pixels().iter().copied()),
        }
    }

    fn bytes8(&self, curve: Curve) -> Vec<u8> {
        let encode = |value: f32| match curve {
            Curve::Srgb => transfer::srgb8_from_linear_value(value),
            Curve::Linear => (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8,
        };
        self.values().map(encode).collect()
    }

    fn words16(&self, curve: Curve) -> impl Iterator<Item = u16> + '_ {
        self.values().map(move |value| {
            let encoded = match curve {
                Curve::Srgb => transfer::srgb_from_linear(value),
                Curve::Linear => value.clamp(0.0, 1.0),
            };
            (encoded * 65_535.0 + 0.5) as u16
        })
    }

    /// The bytes of a PNG file, of 16 bits or 8. Error: a map without texels.
    pub fn png(&self, curve: Curve, sixteen_bits: bool) -> Result<Vec<u8>> {
        let (width, height) = self.size();
        let (bytes, kind) = match (sixteen_bits, self.channels()) {
            // The encoder takes words in the order of the machine.
            (true, 3) => (self.words16(curve).flat_map(u16::to_ne_bytes).collect(), ExtendedColorType::Rgb16),
            (true, _) => (self.words16(curve).flat_map(u16::to_ne_bytes).collect(), ExtendedColorType::L16),
            (false, 3) => (self.bytes8(curve), ExtendedColorType::Rgb8),
            (false, _) => (self.bytes8(curve), ExtendedColorType::L8),
        };
        let mut file = Vec::new();
        PngEncoder::new(&mut file).write_image(&bytes, width as u32, height as u32, kind).map_err(|error| {
            Error::new(ErrorKind::InvalidSetting, format!("the map cannot be written as PNG: {error}"))
                .remedy("check the size of the map")
        })?;
        Ok(file)
    }

    /// The bytes of an uncompressed TIFF file of 16 bits. Error: more than four thousand million bytes.
    pub fn tiff(&self, curve: Curve) -> Result<Vec<u8>> {
        const HEADER: usize = 8;
        let (width, height) = self.size();
        let channels = self.channels();
        let length = width * height * channels * 2;
        let too_large = |_| {
            Error::new(ErrorKind::TooLarge, format!("a TIFF of {width} x {height} texels outgrows its format"))
                .remedy("write smaller maps with --size, or another format with --textures exr")
        };
        let end = u32::try_from(HEADER + length + 256).map_err(too_large)?;
        let mut file = Vec::with_capacity(end as usize);
        file.extend(b"II*\0");
        file.extend(((HEADER + length) as u32).to_le_bytes());
        file.extend(self.words16(curve).flat_map(u16::to_le_bytes));
        // Entries of the directory (TIFF 6.0, section 2): tag, type (3 short, 4 long), count, value or its place.
        let extra = (HEADER + length + 2 + 12 * 10 + 4) as u32;
        let bits = if channels == 1 { 16 } else { extra };
        let entries: [(u16, u16, u32, u32); 10] = [
            (256, 4, 1, width as u32),
            (257, 4, 1, height as u32),
            (258, 3, channels as u32, bits),
            (259, 3, 1, 1),
            (262, 3, 1, if channels == 1 { 1 } else { 2 }),
            (273, 4, 1, HEADER as u32),
            (277, 3, 1, channels as u32),
            (278, 4, 1, height as u32),
            (279, 4, 1, length as u32),
            (284, 3, 1, 1),
        ];
        file.extend((entries.len() as u16).to_le_bytes());
        for (tag, kind, count, value) in entries {
            file.extend(tag.to_le_bytes());
            file.extend(kind.to_le_bytes());
            file.extend(count.to_le_bytes());
            file.extend(value.to_le_bytes());
        }
        file.extend(0u32.to_le_bytes());
        file.extend([16u16; 3].into_iter().flat_map(u16::to_le_bytes));
        Ok(file)
    }

    /// Writes the file `folder/stem.EXT` and gives its path. OpenEXR keeps linear values whatever the curve.
    pub fn write(&self, folder: &Path, stem: &str, format: TextureFormat, curve: Curve) -> Result<PathBuf> {
        let path = folder.join(format!("{stem}.{}", format.extension()));
        match (format, self) {
            (TextureFormat::Png8, _) => write_bytes(&path, &self.png(curve, false)?)?,
            (TextureFormat::Png16, _) => write_bytes(&path, &self.png(curve, true)?)?,
            (TextureFormat::Tiff, _) => {
                write_bytes(&path, &self.tiff(curve).map_err(|error| error.at(Place::File(path.clone())))?)?;
            }
            (TextureFormat::Exr, Texture::Rgb(image)) => file::write_exr_rgb(&path, image)?,
            (TextureFormat::Exr, Texture::Grey(image)) => file::write_exr_grey(&path, image)?,
        }
        Ok(path)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;
    use glam::Vec3;

    fn colours() -> RgbImage {
        Image::from_fn(5, 3, |row, column| Vec3::new(row as f32 / 2.0, column as f32 / 4.0, 0.25))
    }

    #[test]
    fn pngs_read_back_within_half_a_step() {
        let folder = tempfile::tempdir().unwrap();
        for (format, step) in [(TextureFormat::Png8, 1.0 / 255.0), (TextureFormat::Png16, 1.0 / 65_535.0)] {
            let path = Texture::Rgb(&colours()).write(folder.path(), "colour", format, Curve::Srgb).unwrap();
            let back = file::read_rgb(&path).unwrap();
            for (a, b) in back.pixels().iter().zip(colours().pixels()) {
                // The slope of the curve is at most 2.3 above its foot.
                assert!((*a - *b).abs().max_element() <= 0.5 * 2.4 * step, "{a} {b}");
            }
            let grey = Image::from_fn(4, 4, |row, column| (row * 4 + column) as f32 / 15.0);
            let path = Texture::Grey(&grey).write(folder.path(), "grey", format, Curve::Linear).unwrap();
            let back = file::read_grey(&path).unwrap();
            assert!(back.pixels().iter().zip(grey.pixels()).all(|(a, b)| (a - b).abs() <= 0.5001 * step));
        }
    }

    #[test]
    fn the_directory_of_a_tiff_points_at_its_texels() {
        let bytes = Texture::Rgb(&colours()).tiff(Curve::Linear).unwrap();
        let word = |at: usize| usize::from(u16::from_le_bytes([bytes[at], bytes[at + 1]]));
        let long = |at: usize| word(at) + (word(at + 2) << 16);
        assert_eq!(&bytes[..4], b"II*\0");
        let directory = long(4);
        let entry = |tag: usize| {
            let at = (0..word(directory)).map(|i| directory + 2 + 12 * i).find(|&at| word(at) == tag).unwrap();
            if word(at + 2) == 3 && long(at + 4) == 1 { word(at + 8) } else { long(at + 8) }
        };
        assert_eq!((entry(256), entry(257), entry(277), entry(262)), (5, 3, 3, 2));
        assert_eq!([0, 2, 4].map(|i| word(entry(258) + i)), [16, 16, 16]);
        assert_eq!(entry(258) + 6, bytes.len());
        // Row 1, column 2: (0.5, 0.5, 0.25).
        let texel = entry(273) + 2 * 3 * (5 + 2);
        assert_eq!([0, 2, 4].map(|i| word(texel + i)), [32_768, 32_768, 16_384]);
    }
}
