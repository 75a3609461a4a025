//! Image files: PNG, JPEG, TIFF, OpenEXR, Radiance HDR, PFM.
//!
//! The format is told by the content, not by the name. What a file claims is checked before memory is taken for it,
//! and a decoder that panics on a damaged file becomes an error. Values leave here in linear Rec. 709: curves, profiles and
//! primaries are applied at this border only ([`ColourSpace`](colour::ColourSpace)). Files are written whole or not at all,
//! through [`crate::files`].
//!
//! [`read_photo`] is the whole of it: pixels, opacity, orientation, exposure, and what was done to them as findings.
//! [`read_rgb`] and [`read_grey`] are for maps and lights, [`MaskFile`] for masks.
//!
//! What is not done here: turning pictures by their EXIF orientation (the camera decides: `scene::read`), and any
//! judgement of values: a NaN in a file is a NaN in the image, and its reader decides. Raw files of cameras are refused.

mod colour;
mod exif;
mod exr_layers;
mod format;
mod guard;
mod hdr;
mod jpeg;
mod mask;
mod openexr;
mod pfm;
mod photo;
mod png;
mod profile;
mod raster;
mod source;
mod stored;
mod tiff;

pub use format::Format;
pub(crate) use guard::guarded;
pub use guard::keep_decoders_quiet;
pub use mask::{MaskFacts, MaskFile, MaskValues, MaskWay};
pub use photo::{Encoding, PhotoFile, PhotoOptions, PhotoPixels, place_in_stored, swaps_sides, turned};
pub use source::read_header;

use super::{GreyImage, Image, RgbImage, transfer};
use crate::error::{Error, ErrorKind, Place, Result};
use crate::files::{write_atomically, write_bytes};
use ::image::ExtendedColorType;
use ::image::codecs::{hdr::HdrEncoder, jpeg::JpegEncoder, png::PngEncoder};
use ::image::{ImageEncoder, ImageError};
use format::Source;
use glam::Vec3;
use std::path::Path;

/// A photo with all that its file says of it. Values are not checked: they may be negative or not finite.
///
/// # Errors
/// Missing, unreadable, damaged or cut short (with the byte), more than [`LARGEST_PIXEL_COUNT`](format::LARGEST_PIXEL_COUNT) pixels, a kind that is not
/// read, inks for colours; for OpenEXR a layer that is not there, or layers whose names do not say which is radiance.
pub fn read_photo(path: &Path, options: &PhotoOptions) -> Result<PhotoFile> {
    photo_of(&Source::open(path)?, options)
}

/// A photo of bytes that are at hand; `path` is what errors name. Errors as [`read_photo`].
pub fn read_photo_from(path: &Path, bytes: Vec<u8>, options: &PhotoOptions) -> Result<PhotoFile> {
    photo_of(&Source::of_bytes(path, bytes)?, options)
}

fn photo_of(source: &Source, options: &PhotoOptions) -> Result<PhotoFile> {
    let with_exif = |photo: PhotoFile, exif: exif::Exif| PhotoFile {
        orientation: exif.orientation.unwrap_or(1),
        exposure_stops: exif.exposure_stops(),
        ..photo
    };
    let floats = |image: RgbImage, findings| {
        let decode = |pixel: &Vec3| pixel.map(transfer::linear_from_srgb);
        let image = if options.encoding == Encoding::Srgb { image.map(decode) } else { image };
        PhotoFile { pixels: PhotoPixels::Linear(image), findings, ..PhotoFile::default() }
    };
    Ok(match source.header.format {
        Format::Png | Format::Jpeg => {
            let (stored, exif) = raster::read(source)?;
            with_exif(stored.into_photo(source, options.encoding)?, exif)
        }
        Format::Tiff => {
            let exif = exif::read(&source.bytes);
            with_exif(tiff::read(source)?.with_exif(&exif).into_photo(source, options.encoding)?, exif)
        }
        Format::Exr => {
            let photo = openexr::read_photo(source, options.layer)?;
            if options.encoding != Encoding::Srgb {
                return Ok(photo);
            }
            let PhotoFile { pixels, findings, .. } = &photo;
            let PhotoPixels::Linear(image) = pixels else { return Ok(photo) };
            PhotoFile { pixels: floats(image.clone(), Vec::new()).pixels, findings: findings.clone(), ..photo }
        }
        Format::Hdr => {
            let (image, findings) = hdr::read_rgb(source)?;
            floats(image, findings)
        }
        Format::Pfm => floats(pfm::read_rgb(source)?, Vec::new()),
    })
}

/// Linear RGB of an image file, as [`read_photo`] reads it by default: floats as stored, integers decoded by their profile
/// or from sRGB. Alpha is left out, a grey file is repeated in all channels. Errors as [`read_photo`].
pub fn read_rgb(path: &Path) -> Result<RgbImage> {
    Ok(read_photo(path, &PhotoOptions::default())?.into_linear())
}

/// One value a pixel: the lone channel of an EXR or PFM, of any name, as stored; the grey value of a PNG, JPEG or TIFF over
/// its largest value, in [0, 1], without decoding from sRGB. Colour gives its luminance. Errors as [`read_rgb`].
pub fn read_grey(path: &Path) -> Result<GreyImage> {
    grey_of(&Source::open(path)?)
}

fn grey_of(source: &Source) -> Result<GreyImage> {
    match source.header.format {
        Format::Png | Format::Jpeg => Ok(raster::read(source)?.0.grey()),
        Format::Tiff => Ok(tiff::read(source)?.grey()),
        Format::Hdr => Ok(hdr::read_rgb(source)?.0.map(|&rgb| grey_of_rgb(rgb))),
        Format::Exr => openexr::read_grey(source),
        Format::Pfm => pfm::read_grey(source),
    }
}

/// The bytes of a PNG, JPEG or TIFF, sRGB-encoded as stored; 16 bits are rounded to 8. Errors as [`read_rgb`], and
/// `Unsupported` for a file of floats.
pub fn read_srgb8(path: &Path) -> Result<Image<[u8; 3]>> {
    let source = Source::open(path)?;
    match source.header.format {
        Format::Png | Format::Jpeg => Ok(raster::read(&source)?.0.bytes()),
        Format::Tiff if !source.header.is_linear => Ok(tiff::read(&source)?.bytes()),
        _ => Err(Error::new(ErrorKind::Unsupported, "the file holds linear values, not sRGB bytes")
            .at(Place::File(source.path.clone()))
            .remedy("give a PNG or JPEG, or read it as a linear image")),
    }
}

/// (width, height) in pixels, without decoding. Errors as [`read_rgb`].
pub fn read_size(path: &Path) -> Result<(usize, usize)> {
    read_header(path).map(|header| (header.width, header.height))
}

/// The EXIF orientation of a photo, 1 where it has none, without decoding its pixels. Errors as [`read_size`].
pub fn read_orientation(path: &Path) -> Result<u8> {
    let source = Source::open(path)?;
    let exif = match source.header.format {
        Format::Png => png::exif(&source.bytes),
        Format::Jpeg => raster::exif_of_jpeg(&source)?,
        Format::Tiff => Some(source.bytes),
        _ => None,
    };
    Ok(exif.and_then(|bytes| exif::read(&bytes).orientation).unwrap_or(1))
}

/// Writes OpenEXR with float channels `R G B`: one part, scanlines, ZIP.
pub fn write_exr_rgb(path: &Path, image: &RgbImage) -> Result<()> {
    write_atomically(path, |writer| openexr::write_rgb(writer, image))
}

/// Writes OpenEXR with float channels `R G B A`: one part, scanlines, ZIP. Colours are multiplied by alpha, as the format
/// has it.
pub fn write_exr_rgba(path: &Path, image: &RgbImage, alpha: &GreyImage) -> Result<()> {
    write_atomically(path, |writer| openexr::write_rgba(writer, image, alpha))
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

/// Writes sRGB bytes with alpha as PNG; colours are not multiplied by alpha, as the format has it.
pub fn write_png_srgba8(path: &Path, image: &Image<[u8; 4]>) -> Result<()> {
    write_bytes(path, &encode_png(image, ExtendedColorType::Rgba8)?)
}

/// sRGB bytes as the bytes of a PNG file. Error: an image without pixels.
pub fn encode_png_srgb8(image: &Image<[u8; 3]>) -> Result<Vec<u8>> {
    encode_png(image, ExtendedColorType::Rgb8)
}

fn encode_png<const CHANNELS: usize>(image: &Image<[u8; CHANNELS]>, kind: ExtendedColorType) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    PngEncoder::new(&mut bytes)
        .write_image(image.pixels().as_flattened(), image.width() as u32, image.height() as u32, kind)
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
