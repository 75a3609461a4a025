//! PNG, JPEG and Radiance HDR through the `image` crate.

use super::guard::guarded;
use super::source::{Format, Source, implausible, malformed, too_large};
use crate::error::{Error, ErrorKind, Place, Result};
use crate::image::{GreyImage, Image, RgbImage, transfer};
use ::image::{DynamicImage, ImageError, ImageFormat, ImageReader, Limits, error::ImageFormatHint};
use glam::Vec3;
use std::io::{BufRead, Cursor, Seek};
use std::path::Path;

/// What a decoder may allocate: 16 bits of four channels of the largest image.
const LARGEST_ALLOCATION: u64 = super::source::LARGEST_PIXEL_COUNT * 8;

/// (width, height) from the header alone.
pub fn size(reader: &mut (impl BufRead + Seek), path: &Path, format: Format) -> Result<(usize, usize)> {
    let outcome = guarded(path, || Ok(ImageReader::with_format(&mut *reader, crate_format(format)).into_dimensions()))?;
    let byte = reader.stream_position().unwrap_or(0);
    outcome.map(|(width, height)| (width as usize, height as usize)).map_err(|error| explain(error, path, byte))
}

fn crate_format(format: Format) -> ImageFormat {
    match format {
        Format::Png => ImageFormat::Png,
        Format::Jpeg => ImageFormat::Jpeg,
        Format::Hdr => ImageFormat::Hdr,
        // The other formats have readers of their own and do not come here.
        Format::Exr | Format::Pfm => ImageFormat::OpenExr,
    }
}

fn decode(source: &Source) -> Result<DynamicImage> {
    if source.header.format == Format::Jpeg && !jpeg_is_complete(&source.bytes) {
        // The decoder would fill what is missing with grey.
        return Err(malformed(&source.path, source.bytes.len() as u64, "the JPEG ends before its last pixel")
            .remedy("the file is cut short: copy it again"));
    }
    let mut cursor = Cursor::new(source.bytes.as_slice());
    let outcome = guarded(&source.path, || {
        let mut limits = Limits::default();
        limits.max_alloc = Some(LARGEST_ALLOCATION);
        let mut reader = ImageReader::with_format(&mut cursor, crate_format(source.header.format));
        reader.limits(limits);
        Ok(reader.decode())
    })?;
    outcome.map_err(|error| explain(error, &source.path, cursor.position()))
}

/// Whether a JPEG holds the end marker after its first scan. In coded data 0xFF is always followed by another byte
/// than 0xD9; in the segments before it a thumbnail may hold one, so segments are stepped over.
fn jpeg_is_complete(bytes: &[u8]) -> bool {
    let mut position = 2;
    while let Some(&[0xff, marker, high, low]) = bytes.get(position..position + 4) {
        if marker == 0xff {
            position += 1;
            continue;
        }
        position += 2 + usize::from(u16::from_be_bytes([high, low]));
        if marker == 0xda {
            return bytes.get(position..).is_some_and(|scan| scan.windows(2).any(|pair| pair == [0xff, 0xd9]));
        }
    }
    false
}

fn explain(error: ImageError, path: &Path, byte: u64) -> Error {
    match error {
        ImageError::Limits(_) => too_large(path, "the image needs more memory than is allowed".into()),
        ImageError::Unsupported(error) => {
            let what = match error.format_hint() {
                ImageFormatHint::Exact(format) => format!("this kind of {}", format!("{format:?}").to_uppercase()),
                _ => "this kind of image".into(),
            };
            Error::new(ErrorKind::Unsupported, format!("{what} is not read: {error}"))
                .at(Place::File(path.into()))
                .remedy("convert it to 8- or 16-bit RGB PNG, or to OpenEXR")
        }
        ImageError::IoError(error) if error.kind() != std::io::ErrorKind::UnexpectedEof => Error::reading(path, error),
        ImageError::IoError(_) => malformed(path, byte, "the file ends before its last pixel")
            .remedy("the file is cut short or damaged: copy it again"),
        error => malformed(path, byte, format!("the file breaks its format: {error}"))
            .remedy("the file is cut short or damaged: copy it again"),
    }
}

fn checked<T>(source: &Source, width: u32, height: u32, pixels: Vec<T>) -> Result<Image<T>> {
    let (width, height) = (width as usize, height as usize);
    if pixels.len() != width * height || (width, height) != (source.header.width, source.header.height) {
        return Err(implausible(
            &source.path,
            format!("the decoded image is not the {width} x {height} of its header"),
        ));
    }
    Ok(Image::from_pixels(width, height, pixels))
}

fn is_sixteen_bit(image: &DynamicImage) -> bool {
    image.color().bytes_per_pixel() / image.color().channel_count() == 2
}

/// Linear RGB: HDR as stored, PNG and JPEG decoded from sRGB. An alpha channel is left out.
pub fn read_rgb(source: &Source) -> Result<RgbImage> {
    let image = decode(source)?;
    let (width, height) = (image.width(), image.height());
    let pixels = if source.header.format == Format::Hdr {
        image.into_rgb32f().pixels().map(|pixel| Vec3::from_array(pixel.0)).collect()
    } else if is_sixteen_bit(&image) {
        let linear: Vec<f32> =
            (0..=u16::MAX).map(|value| transfer::linear_from_srgb(f32::from(value) / 65_535.0)).collect();
        image.into_rgb16().pixels().map(|pixel| Vec3::from_array(pixel.0.map(|value| linear[value as usize]))).collect()
    } else {
        image.into_rgb8().pixels().map(|pixel| transfer::linear_from_srgb8(pixel.0)).collect()
    };
    checked(source, width, height, pixels)
}

/// One value a pixel in [0, 1] without decoding from sRGB (HDR: luminance as stored).
pub fn read_grey(source: &Source) -> Result<GreyImage> {
    let image = decode(source)?;
    let (width, height) = (image.width(), image.height());
    let pixels = if source.header.format == Format::Hdr {
        image.into_rgb32f().pixels().map(|pixel| super::grey_of_rgb(Vec3::from_array(pixel.0))).collect()
    } else if is_sixteen_bit(&image) {
        let pixel = |rgb: [u16; 3]| super::grey_of_rgb(Vec3::from_array(rgb.map(|value| f32::from(value) / 65_535.0)));
        image.into_rgb16().pixels().map(|rgb| pixel(rgb.0)).collect()
    } else {
        let pixel = |rgb: [u8; 3]| super::grey_of_rgb(Vec3::from_array(rgb.map(|value| f32::from(value) / 255.0)));
        image.into_rgb8().pixels().map(|rgb| pixel(rgb.0)).collect()
    };
    checked(source, width, height, pixels)
}

/// sRGB bytes as stored; 16 bits are rounded to 8.
pub fn read_srgb8(source: &Source) -> Result<Image<[u8; 3]>> {
    if source.header.format.is_linear() {
        return Err(Error::new(ErrorKind::Unsupported, "the file holds linear values, not sRGB bytes")
            .at(Place::File(source.path.clone()))
            .remedy("give a PNG or JPEG, or read it as a linear image"));
    }
    let image = decode(source)?;
    let (width, height) = (image.width(), image.height());
    checked(source, width, height, image.into_rgb8().pixels().map(|pixel| pixel.0).collect())
}
