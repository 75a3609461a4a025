//! Image files: PNG, JPEG, OpenEXR, Radiance HDR, PFM.
//!
//! The format is told by the content, not by the name. What a file claims is checked before memory is taken for it,
//! and a decoder that panics on a damaged file becomes an error. Values leave here linear; sRGB is decoded and encoded
//! at this border only. Files are written whole or not at all, through [`crate::files`].
//!
//! What is not done here: colour profiles (RGB is taken for Rec. 709), EXIF orientation (pixels are as stored), and any
//! judgement of values: a NaN in a file is a NaN in the image, and its reader decides.

mod guard;
mod openexr;
mod pfm;
mod raster;
mod source;

pub use source::{Format, read_header};

use super::{GreyImage, Image, RgbImage, transfer};
use crate::error::{Error, ErrorKind, Result};
use crate::files::{write_atomically, write_bytes};
use ::image::ExtendedColorType;
use ::image::codecs::{hdr::HdrEncoder, jpeg::JpegEncoder, png::PngEncoder};
use ::image::{ImageEncoder, ImageError};
use glam::Vec3;
use source::Source;
use std::path::Path;

/// Linear RGB of an image file: EXR, HDR and PFM as stored, PNG and JPEG decoded from sRGB. Alpha is left out, a grey
/// file is repeated in all channels. Values are not checked: they may be negative or not finite.
///
/// Errors: missing, unreadable, damaged or cut short (with the byte), more than [`LARGEST_PIXEL_COUNT`](source::LARGEST_PIXEL_COUNT) pixels, a kind
/// that is not read.
pub fn read_rgb(path: &Path) -> Result<RgbImage> {
    let source = Source::open(path)?;
    match source.header.format {
        Format::Png | Format::Jpeg | Format::Hdr => raster::read_rgb(&source),
        Format::Exr => openexr::read_rgb(&source),
        Format::Pfm => pfm::read_rgb(&source),
    }
}

/// One value a pixel: the lone channel of an EXR or PFM, of any name, as stored; the grey value of a PNG or JPEG over
/// its largest value, in [0, 1], without decoding from sRGB. Colour gives its luminance. Errors as [`read_rgb`].
pub fn read_grey(path: &Path) -> Result<GreyImage> {
    let source = Source::open(path)?;
    match source.header.format {
        Format::Png | Format::Jpeg | Format::Hdr => raster::read_grey(&source),
        Format::Exr => openexr::read_grey(&source),
        Format::Pfm => pfm::read_grey(&source),
    }
}

/// The bytes of a PNG or JPEG, sRGB-encoded as stored; 16 bits are rounded to 8. Errors as [`read_rgb`], and
/// `Unsupported` for a linear format.
pub fn read_srgb8(path: &Path) -> Result<Image<[u8; 3]>> {
    raster::read_srgb8(&Source::open(path)?)
}

/// (width, height) in pixels, without decoding. Errors as [`read_rgb`].
pub fn read_size(path: &Path) -> Result<(usize, usize)> {
    read_header(path).map(|header| (header.width, header.height))
}

/// Writes OpenEXR with float channels `R G B`: one part, scanlines, ZIP.
pub fn write_exr_rgb(path: &Path, image: &RgbImage) -> Result<()> {
    write_atomically(path, |writer| openexr::write_rgb(writer, image))
}

/// Writes OpenEXR with one float channel `Y`: one part, scanlines, ZIP.
pub fn write_exr_grey(path: &Path, image: &GreyImage) -> Result<()> {
    write_atomically(path, |writer| openexr::write_grey(writer, image))
}

/// Writes Radiance HDR. The format holds no negative values and 8 bits of the largest channel: negative and NaN become
/// 0, and small channels beside a large one lose digits.
pub fn write_hdr(path: &Path, image: &RgbImage) -> Result<()> {
    // Above this the shared exponent would leave its byte.
    const LARGEST: f32 = 1e38;
    let clean = |value: f32| if value > 0.0 { value.min(LARGEST) } else { 0.0 };
    let pixels: Vec<::image::Rgb<f32>> =
        image.pixels().iter().map(|rgb| ::image::Rgb(rgb.to_array().map(clean))).collect();
    write_atomically(path, |writer| {
        HdrEncoder::new(writer).encode(&pixels, image.width(), image.height()).map_err(input_output_error)
    })
}

/// Writes sRGB bytes as PNG.
pub fn write_png_srgb8(path: &Path, image: &Image<[u8; 3]>) -> Result<()> {
    write_bytes(path, &encode_png_srgb8(image)?)
}

/// sRGB bytes as the bytes of a PNG file. Error: an image without pixels.
pub fn encode_png_srgb8(image: &Image<[u8; 3]>) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    PngEncoder::new(&mut bytes)
        .write_image(
            image.pixels().as_flattened(),
            image.width() as u32,
            image.height() as u32,
            ExtendedColorType::Rgb8,
        )
        .map_err(|error| cannot_encode("PNG", &error))?;
    Ok(bytes)
}

/// sRGB bytes as the bytes of a JPEG file; `quality` in 1 to 100 is clamped.
/// Errors: an image without pixels or with more than 65,535 a side.
pub fn encode_jpeg(image: &Image<[u8; 3]>, quality: u8) -> Result<Vec<u8>> {
    if image.pixels().is_empty() {
        return Err(Error::new(ErrorKind::InvalidSetting, "an image without pixels cannot be written as JPEG")
            .remedy("give one with pixels"));
    }
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, quality.clamp(1, 100))
        .write_image(
            image.pixels().as_flattened(),
            image.width() as u32,
            image.height() as u32,
            ExtendedColorType::Rgb8,
        )
        .map_err(|error| cannot_encode("JPEG", &error))?;
    Ok(bytes)
}

/// sRGB bytes of a linear image after an exposure in stops (factor `2^stops`). Values outside [0, 1] are clipped; a
/// pixel with a NaN is magenta, so that it is seen.
pub fn srgb8_from_linear(image: &RgbImage, exposure_stops: f32) -> Image<[u8; 3]> {
    const NOT_A_NUMBER: [u8; 3] = [255, 0, 255];
    let exposure = exposure_stops.exp2();
    image.map(|rgb| {
        if rgb.is_nan() { NOT_A_NUMBER } else { (*rgb * exposure).to_array().map(transfer::srgb8_from_linear_value) }
    })
}

/// Luminance, exact for grey: rounding must not change a value that was stored three times.
fn grey_of_rgb(rgb: Vec3) -> f32 {
    if rgb.x == rgb.y && rgb.y == rgb.z { rgb.x } else { crate::math::luminance(rgb) }
}

fn input_output_error(error: ImageError) -> std::io::Error {
    match error {
        ImageError::IoError(error) => error,
        other => std::io::Error::other(other.to_string()),
    }
}

fn cannot_encode(format: &str, error: &ImageError) -> Error {
    Error::new(ErrorKind::InvalidSetting, format!("the image cannot be written as {format}: {error}"))
        .remedy("check the size of the image")
}
