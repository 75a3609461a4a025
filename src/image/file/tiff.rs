//! TIFF through the `tiff` crate: grey and RGB of 8 and 16 bits and of floats, with opacity, in strips, tiles and planes.
//!
//! The first picture of the file is read. A file with a smaller preview in that place is a camera's raw file and refused.

use super::format::{Source, implausible, malformed, too_large};
use super::guard::guarded;
use super::stored::{Declared, Samples, Stored, refused};
use super::{exif, format};
use crate::error::{Error, ErrorKind, Place, Result};
use std::io::{BufRead, Cursor, Read, Seek};
use std::path::Path;
use tiff::TiffUnsupportedError::{InterpretationWithBits, UnknownCompressionMethod, UnsupportedCompressionMethod};
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::{CompressionMethod, PhotometricInterpretation, Tag};
use tiff::{ColorType, TiffError};

/// Most bytes that one byte of a strip can stand for: deflate at its best (1032), with room for tags.
const BEST_RATIO: u64 = 1_100;
/// Pictures of reduced size that are stepped over.
const MOST_THUMBNAILS: usize = 8;

/// What a header says.
pub struct TiffHeader {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Whether samples are floats.
    pub is_float: bool,
}

/// Reads the first directory. Errors: damaged, claims more than the file can hold, not grey or RGB, a raw file.
pub fn read_header(reader: &mut (impl BufRead + Seek), path: &Path, length: u64) -> Result<TiffHeader> {
    let cannot = |error| Error::reading(path, error);
    reader.rewind().map_err(cannot)?;
    // Tags may lie anywhere: the whole file is needed to tell a raw file.
    let mut bytes = Vec::new();
    reader.take(length).read_to_end(&mut bytes).map_err(cannot)?;
    if exif::is_raw(&bytes) {
        return Err(format::raw_file(path));
    }
    if exif::claims_more_than_it_holds(&bytes) {
        return Err(implausible(path, format!("a tag claims more values than the file has bytes ({})", bytes.len())));
    }
    let outcome = guarded(path, || Ok(header_of(&mut Cursor::new(bytes.as_slice()))))?;
    let (header, colour) = outcome.map_err(|error| explain(error, path))?;
    let channels = match colour {
        ColorType::Gray(_) => 1,
        ColorType::GrayA(_) => 2,
        ColorType::RGB(_) => 3,
        ColorType::RGBA(_) => 4,
        ColorType::CMYK(_) | ColorType::CMYKA(_) => return Err(refused_kind(path, "CMYK")),
        other => return Err(refused_kind(path, &format!("{other:?}"))),
    };
    let pixels = (header.width as u64).saturating_mul(header.height as u64);
    let decoded = pixels.saturating_mul(channels * u64::from(colour.bit_depth().div_ceil(8)));
    if pixels > format::LARGEST_PIXEL_COUNT {
        return Err(too_large(path, format!("the file claims {} x {} pixels", header.width, header.height)));
    }
    if decoded / BEST_RATIO > length {
        let (width, height) = (header.width, header.height);
        return Err(implausible(path, format!("{length} bytes cannot hold the {width} x {height} pixels it claims")));
    }
    Ok(header)
}

fn header_of(cursor: &mut Cursor<&[u8]>) -> std::result::Result<(TiffHeader, ColorType), TiffError> {
    let mut decoder = at_picture(Decoder::new(cursor)?)?;
    let (width, height) = decoder.dimensions()?;
    let colour = decoder.colortype()?;
    let format = decoder.find_tag_unsigned_vec::<u16>(Tag::SampleFormat)?.unwrap_or_default();
    let header = TiffHeader { width: width as usize, height: height as usize, is_float: format.first() == Some(&3) };
    Ok((header, colour))
}

fn refused_compression(path: &Path, method: &str) -> Error {
    Error::new(ErrorKind::Unsupported, format!("a TIFF compressed by {method} is not read"))
        .at(Place::File(path.into()))
        .remedy("save it without compression, or with LZW or deflate (ZIP)")
}

fn refused_kind(path: &Path, kind: &str) -> Error {
    Error::new(ErrorKind::Unsupported, format!("a TIFF of the kind {kind} is not read"))
        .at(Place::File(path.into()))
        .remedy("export it as RGB TIFF with 8 or 16 bits a channel")
}

/// Goes on to the first picture that is none reduced in size (TIFF 6.0, NewSubfileType bit 0): some programs put the thumbnail
/// first. Where all are, the first is read.
fn at_picture<R: std::io::Read + std::io::Seek>(mut decoder: Decoder<R>) -> std::result::Result<Decoder<R>, TiffError> {
    let is_reduced = |decoder: &mut Decoder<R>| {
        let kind = decoder.find_tag_unsigned::<u32>(Tag::NewSubfileType);
        kind.map(|kind| kind.unwrap_or_default() & 1 == 1)
    };
    for _ in 0..MOST_THUMBNAILS {
        if !is_reduced(&mut decoder)? {
            return Ok(decoder);
        }
        if !decoder.more_images() {
            break;
        }
        decoder.next_image()?;
    }
    decoder.seek_to_image(0)?;
    Ok(decoder)
}

/// Decodes the first picture that is no thumbnail.
pub fn read(source: &Source) -> Result<Stored> {
    let outcome = guarded(&source.path, || Ok(decode(&source.bytes)))?;
    let (samples, mut stored) = outcome.map_err(|error| explain(error, &source.path))?;
    stored.samples = match samples {
        DecodingResult::U8(values) => Samples::Bytes(values),
        DecodingResult::U16(values) => Samples::Words(values),
        DecodingResult::F16(values) => Samples::Floats(values.into_iter().map(f32::from).collect()),
        DecodingResult::F32(values) => Samples::Floats(values),
        DecodingResult::F64(values) => Samples::Floats(values.into_iter().map(|value| value as f32).collect()),
        _ => return Err(refused_kind(&source.path, "32-bit or signed integers")),
    };
    if stored.channels == 0 {
        return Err(refused(source, "a colour space other than grey and RGB"));
    }
    stored.checked(source)
}

fn decode(bytes: &[u8]) -> std::result::Result<(DecodingResult, Stored), TiffError> {
    let mut limits = Limits::default();
    limits.decoding_buffer_size = (bytes.len() as u64).saturating_mul(BEST_RATIO + 1) as usize;
    limits.intermediate_buffer_size = limits.decoding_buffer_size;
    limits.ifd_value_size = bytes.len().max(1024);
    let mut decoder = at_picture(Decoder::new(Cursor::new(bytes))?.with_limits(limits))?;
    let (width, height) = decoder.dimensions()?;
    let (width, height) = (width as usize, height as usize);
    let (channels, bits) = match decoder.colortype()? {
        ColorType::Gray(bits) => (1, bits),
        ColorType::GrayA(bits) => (2, bits),
        ColorType::RGB(bits) => (3, bits),
        ColorType::RGBA(bits) => (4, bits),
        _ => (0, 0),
    };
    let extra = decoder.find_tag_unsigned_vec::<u16>(Tag::ExtraSamples)?.unwrap_or_default();
    let planes = decoder.find_tag_unsigned::<u16>(Tag::PlanarConfiguration)?.unwrap_or(1);
    let icc = decoder.find_tag(Tag::IccProfile)?.and_then(|value| value.into_u8_vec().ok());
    let mut samples = DecodingResult::U8(Vec::new());
    // Bits that are not whole bytes would come out packed.
    let channels = if matches!(bits, 8 | 16 | 32 | 64) { channels } else { 0 };
    if channels > 0 {
        let layout = decoder.read_image_to_buffer(&mut samples)?;
        if planes == 2 && channels > 1 && samples.as_buffer(0).as_bytes().len() >= layout.complete_len {
            samples = interleaved(samples, channels, width * height);
        }
    }
    let stored = Stored {
        width,
        height,
        channels,
        samples: Samples::Bytes(Vec::new()),
        has_alpha: matches!(extra.first(), Some(1 | 2)),
        is_premultiplied: extra.first() == Some(&1),
        icc,
        declared: Declared::Nothing,
        findings: Vec::new(),
    };
    Ok((samples, stored))
}

/// Planes one after another, as pixels with their channels side by side.
fn interleaved(samples: DecodingResult, channels: usize, pixels: usize) -> DecodingResult {
    fn mixed<T: Copy>(planes: Vec<T>, channels: usize, pixels: usize) -> Vec<T> {
        if planes.len() != channels * pixels {
            return planes;
        }
        (0..pixels)
            .flat_map(|pixel| (0..channels).map(move |c| (c, pixel)))
            .map(|(c, p)| planes[c * pixels + p])
            .collect()
    }
    match samples {
        DecodingResult::U8(values) => DecodingResult::U8(mixed(values, channels, pixels)),
        DecodingResult::U16(values) => DecodingResult::U16(mixed(values, channels, pixels)),
        DecodingResult::F16(values) => DecodingResult::F16(mixed(values, channels, pixels)),
        DecodingResult::F32(values) => DecodingResult::F32(mixed(values, channels, pixels)),
        DecodingResult::F64(values) => DecodingResult::F64(mixed(values, channels, pixels)),
        other => other,
    }
}

fn explain(error: TiffError, path: &Path) -> Error {
    match error {
        TiffError::UnsupportedError(UnsupportedCompressionMethod(method)) => match method {
            CompressionMethod::JPEG | CompressionMethod::ModernJPEG => refused_compression(path, "JPEG"),
            method => refused_compression(path, &format!("{method:?}")),
        },
        TiffError::UnsupportedError(UnknownCompressionMethod) => {
            refused_compression(path, "a method that is not known")
        }
        TiffError::UnsupportedError(InterpretationWithBits(PhotometricInterpretation::RGBPalette, _)) => {
            refused_kind(path, "indexed colours, whose pixels are numbers of a palette,")
        }
        TiffError::UnsupportedError(what) => refused_kind(path, &what.to_string()),
        TiffError::LimitsExceeded | TiffError::IntSizeError => {
            implausible(path, "the file claims more than it can hold".into())
        }
        TiffError::IoError(error) if error.kind() != std::io::ErrorKind::UnexpectedEof => Error::reading(path, error),
        other => malformed(path, 0, format!("the file breaks its format: {other}"))
            .remedy("the file is cut short or damaged: copy it again"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The directory of a picture of one pixel with this compression and meaning of its numbers.
    fn directory(compression: u16, interpretation: u16) -> Vec<u8> {
        let channels = if interpretation == 2 { 3 } else { 1 };
        let entries: [(u16, u16); 9] = [
            (256, 1),
            (257, 1),
            (258, 8),
            (259, compression),
            (262, interpretation),
            (273, 8),
            (277, channels),
            (278, 1),
            (279, 3),
        ];
        let mut bytes = b"II*\0\x08\0\0\0".to_vec();
        bytes.extend((entries.len() as u16).to_le_bytes());
        for (tag, value) in entries {
            bytes.extend([tag.to_le_bytes(), 3u16.to_le_bytes(), [1, 0], [0, 0], value.to_le_bytes(), [0, 0]].concat());
        }
        bytes.extend([0; 4]);
        bytes
    }

    #[test]
    fn what_is_not_read_is_named_with_the_way_out_that_helps() {
        let error = |compression, interpretation| {
            let bytes = directory(compression, interpretation);
            Source::of_bytes(Path::new("a.tif"), bytes).and_then(|source| read(&source)).err().unwrap()
        };
        let jpeg = error(7, 1);
        assert_eq!(jpeg.kind(), ErrorKind::Unsupported);
        assert!(jpeg.message().contains("compressed by JPEG") && jpeg.remedy_text().contains("LZW"), "{jpeg}");
        let palette = error(1, 3);
        assert!(palette.message().contains("palette") && palette.remedy_text().contains("RGB"), "{palette}");
    }
}
