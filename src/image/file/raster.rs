//! PNG and JPEG through the `image` crate.

use super::format::{Format, Source, malformed, too_large};
use super::guard::guarded;
use super::jpeg;
use super::stored::{Declared, Samples, Stored, refused};
use super::{exif, png};
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use ::image::codecs::{jpeg::JpegDecoder, png::PngDecoder};
use ::image::{DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader, Limits, error::ImageFormatHint};
use std::io::{BufRead, Cursor, Seek};
use std::path::Path;

/// What a decoder may allocate: 16 bits of four channels of the largest image.
const LARGEST_ALLOCATION: u64 = super::format::LARGEST_PIXEL_COUNT * 8;

/// (width, height) from the header alone.
pub fn size(reader: &mut (impl BufRead + Seek), path: &Path, format: Format) -> Result<(usize, usize)> {
    let format = if format == Format::Jpeg { ImageFormat::Jpeg } else { ImageFormat::Png };
    let outcome = guarded(path, || Ok(ImageReader::with_format(&mut *reader, format).into_dimensions()))?;
    let byte = reader.stream_position().unwrap_or(0);
    outcome.map(|(width, height)| (width as usize, height as usize)).map_err(|error| explain(error, path, byte))
}

/// Decodes a PNG or JPEG, and reads its EXIF.
pub fn read(source: &Source) -> Result<(Stored, exif::Exif)> {
    let mut findings = Vec::new();
    let is_jpeg = source.header.format == Format::Jpeg;
    if is_jpeg {
        findings = check_jpeg(source)?;
    }
    let decoded = match decode(source, &source.bytes) {
        Err(error) if !is_jpeg => {
            // A decoder of PNG misses what is missing: with an end behind them, the pixels are all there or none are taken.
            let has_end = source.bytes.windows(png::END.len()).any(|bytes| bytes == png::END);
            let ended = || decode(source, &[&source.bytes[..], png::END].concat()).ok();
            let Some(decoded) = (!has_end).then(ended).flatten() else { return Err(error) };
            findings.push(
                Finding::new(Severity::Note, "png-no-end", "the PNG has no end marker, but all pixels are there")
                    .remedy("copy the photo again if it may have been cut short"),
            );
            decoded
        }
        decoded => decoded?,
    };
    if is_jpeg {
        let per_pixel = usize::from(decoded.image.color().channel_count());
        let width = decoded.image.width() as usize;
        findings.extend(jpeg::told_of_filled(decoded.image.as_bytes(), width * per_pixel, per_pixel));
    }
    let declared = if is_jpeg { Declared::Nothing } else { png::declared(&source.bytes) };
    let Decoded { image, icc, exif } = decoded;
    let icc = icc.filter(|_| is_jpeg || !png::has_code_points(&source.bytes));
    let (width, height) = (image.width() as usize, image.height() as usize);
    let channels = usize::from(image.color().channel_count());
    let has_alpha = image.color().has_alpha();
    let samples = match image {
        DynamicImage::ImageLuma8(image) => Samples::Bytes(image.into_raw()),
        DynamicImage::ImageLumaA8(image) => Samples::Bytes(image.into_raw()),
        DynamicImage::ImageRgb8(image) => Samples::Bytes(image.into_raw()),
        DynamicImage::ImageRgba8(image) => Samples::Bytes(image.into_raw()),
        DynamicImage::ImageLuma16(image) => Samples::Words(image.into_raw()),
        DynamicImage::ImageLumaA16(image) => Samples::Words(image.into_raw()),
        DynamicImage::ImageRgb16(image) => Samples::Words(image.into_raw()),
        DynamicImage::ImageRgba16(image) => Samples::Words(image.into_raw()),
        other => return Err(refused(source, &format!("pixels of the kind {:?}", other.color()))),
    };
    let stored =
        Stored { width, height, channels, samples, has_alpha, is_premultiplied: false, icc, declared, findings };
    let exif = if is_jpeg { exif } else { exif.or_else(|| png::exif(&source.bytes)) };
    let exif = exif.map(|bytes| exif::read(&bytes)).unwrap_or_default();
    // A PNG says by its own chunks what its colours are.
    let stored = if is_jpeg { stored.with_exif(&exif) } else { stored };
    Ok((stored.checked(source)?, exif))
}

/// The EXIF block of a JPEG, whose pixels are not decoded.
pub fn exif_of_jpeg(source: &Source) -> Result<Option<Vec<u8>>> {
    guarded(&source.path, || {
        let decoder = JpegDecoder::new(Cursor::new(&source.bytes[..]));
        Ok(decoder.and_then(|mut decoder| decoder.exif_metadata()).ok().flatten())
    })
}

/// What a decoder gives.
struct Decoded {
    image: DynamicImage,
    icc: Option<Vec<u8>>,
    exif: Option<Vec<u8>>,
}

fn decode(source: &Source, bytes: &[u8]) -> Result<Decoded> {
    let mut cursor = Cursor::new(bytes);
    let outcome = guarded(&source.path, || {
        let mut limits = Limits::default();
        limits.max_alloc = Some(LARGEST_ALLOCATION);
        Ok(match source.header.format {
            Format::Jpeg => JpegDecoder::new(&mut cursor).and_then(|decoder| decoded_by(decoder, limits)),
            _ => PngDecoder::with_limits(&mut cursor, limits.clone()).and_then(|decoder| decoded_by(decoder, limits)),
        })
    })?;
    outcome.map_err(|error| explain(error, &source.path, cursor.position()))
}

fn decoded_by(mut decoder: impl ImageDecoder, limits: Limits) -> std::result::Result<Decoded, ImageError> {
    decoder.set_limits(limits)?;
    // A profile or EXIF block that cannot be read must not cost the pixels.
    let icc = decoder.icc_profile().ok().flatten();
    let exif = decoder.exif_metadata().ok().flatten();
    Ok(Decoded { image: DynamicImage::from_decoder(decoder)?, icc, exif })
}

/// Refuses a JPEG of inks and one without its last pixels; tells of an end marker that is missing and of stray bytes.
fn check_jpeg(source: &Source) -> Result<Vec<Finding>> {
    let facts = jpeg::facts(&source.bytes);
    if facts.components == 4 {
        return Err(refused(source, "CMYK"));
    }
    let mut findings = Vec::new();
    if !facts.has_end {
        let pixels = |bytes: &[u8]| decode(source, bytes).ok().map(|decoded| decoded.image);
        // The decoder would fill what is missing with grey.
        if !facts.has_scan || !facts.has_all_scans || !jpeg::is_whole_without_end(&source.bytes, pixels) {
            return Err(malformed(&source.path, source.bytes.len() as u64, "the JPEG ends before its last pixel")
                .remedy("the file is cut short: copy it again"));
        }
        findings.push(
            Finding::new(Severity::Note, "jpeg-no-end", "the JPEG has no end marker, but all pixels are there")
                .remedy("copy the photo again if it may have been cut short"),
        );
    }
    if facts.stray_bytes > 0 {
        let message = format!("{} bytes of the JPEG belong to no segment: they are skipped", facts.stray_bytes);
        findings.push(Finding::new(Severity::Note, "jpeg-stray-bytes", message).extent(facts.stray_bytes as f64));
    }
    Ok(findings)
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
