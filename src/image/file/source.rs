//! What a file is and how large it claims to be, before anything is allocated for it.

use super::{hdr, openexr, pfm, raster, tiff};
use crate::error::{Error, ErrorKind, Place, Result};
use std::fs::File;
use std::io::{BufRead, BufReader, Cursor, Read, Seek};
use std::path::{Path, PathBuf};

/// Formats that are read, told apart by content and not by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Format {
    /// 8 or 16 bits a channel, sRGB.
    Png,
    /// 8 bits a channel, sRGB.
    Jpeg,
    /// 8 or 16 bits a channel, sRGB; or floats, linear.
    Tiff,
    /// OpenEXR: 16 or 32 bits a channel, linear.
    Exr,
    /// Radiance HDR: shared exponent, linear.
    Hdr,
    /// Portable float map: 32 bits a channel, linear.
    Pfm,
}

impl Format {
    /// The format of a file that begins with these bytes.
    fn of_first_bytes(bytes: &[u8]) -> Option<Self> {
        const MAGIC: [(&[u8], Format); 10] = [
            (b"\x89PNG\r\n\x1a\n", Format::Png),
            (b"\xff\xd8\xff", Format::Jpeg),
            (b"II*\0", Format::Tiff),
            (b"MM\0*", Format::Tiff),
            (b"II+\0", Format::Tiff),
            (b"MM\0+", Format::Tiff),
            (b"\x76\x2f\x31\x01", Format::Exr),
            (b"#?", Format::Hdr),
            (b"PF", Format::Pfm),
            (b"Pf", Format::Pfm),
        ];
        MAGIC.iter().find(|(magic, _)| bytes.starts_with(magic)).map(|&(_, format)| format)
    }
}

/// What is known of an image file without decoding its pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImageHeader {
    /// The format of the content.
    pub format: Format,
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Whether values are linear floats. Integers are sRGB-encoded unless the file says otherwise.
    pub is_linear: bool,
}

/// Largest number of pixels that is read: 16,384 x 16,384.
pub const LARGEST_PIXEL_COUNT: u64 = 1 << 28;
/// Largest file that is read, in bytes.
const LARGEST_FILE: u64 = 1 << 32;
/// Most pixels a byte of a PNG, HDR or ZIP-compressed EXR can stand for (1 bit a pixel, deflate at its best of 1032:1).
const MOST_PIXELS_PER_BYTE: u64 = 16_384;

/// A whole file in memory, its format and size known and within limits.
pub struct Source {
    pub path: PathBuf,
    pub bytes: Vec<u8>,
    pub header: ImageHeader,
}

impl Source {
    /// Reads a file whose claims are plausible. Errors: not there, not readable, empty, unknown content, too large.
    pub fn open(path: &Path) -> Result<Self> {
        let (mut reader, length) = open_file(path)?;
        let header = header_of(&mut reader, path, length)?;
        reader.rewind().map_err(|error| Error::reading(path, error))?;
        let mut bytes = Vec::with_capacity(length as usize);
        reader.read_to_end(&mut bytes).map_err(|error| Error::reading(path, error))?;
        Ok(Source { path: path.into(), bytes, header })
    }

    /// A file whose bytes are at hand, under the path that errors name. Errors as [`Source::open`].
    pub fn of_bytes(path: &Path, bytes: Vec<u8>) -> Result<Self> {
        let length = bytes.len() as u64;
        if length > LARGEST_FILE {
            return Err(too_large(path, format!("the file has {length} bytes")));
        }
        let header = header_of(&mut Cursor::new(bytes.as_slice()), path, length)?;
        Ok(Source { path: path.into(), bytes, header })
    }
}

/// The header of a file. Errors as those of reading it.
pub fn read_header(path: &Path) -> Result<ImageHeader> {
    let (mut reader, length) = open_file(path)?;
    header_of(&mut reader, path, length)
}

fn open_file(path: &Path) -> Result<(BufReader<File>, u64)> {
    let file = File::open(path).map_err(|error| Error::reading(path, error))?;
    let metadata = file.metadata().map_err(|error| Error::reading(path, error))?;
    if metadata.is_dir() {
        return Err(Error::new(ErrorKind::Unreadable, "a folder, not an image file")
            .at(Place::File(path.into()))
            .remedy("name a file in it"));
    }
    if metadata.len() > LARGEST_FILE {
        return Err(too_large(path, format!("the file has {} bytes", metadata.len())));
    }
    Ok((BufReader::new(file), metadata.len()))
}

fn header_of(reader: &mut (impl BufRead + Seek), path: &Path, length: u64) -> Result<ImageHeader> {
    let first = reader.fill_buf().map_err(|error| Error::reading(path, error))?;
    if first.is_empty() {
        return Err(malformed(path, 0, "the file is empty").remedy("copy it again"));
    }
    let Some(format) = Format::of_first_bytes(first) else { return Err(unknown(path, first)) };
    let mut is_linear = matches!(format, Format::Exr | Format::Hdr | Format::Pfm);
    let (width, height) = match format {
        Format::Png | Format::Jpeg => raster::size(reader, path, format)?,
        Format::Tiff => {
            let header = tiff::read_header(reader, path, length)?;
            is_linear = header.is_float;
            (header.width, header.height)
        }
        Format::Hdr => hdr::read_header(reader, path)?.size(),
        Format::Exr => openexr::size(reader, path, length)?,
        Format::Pfm => pfm::read_header(reader, path)?.size(),
    };
    if width == 0 || height == 0 {
        return Err(malformed(path, 0, "the image has no pixels").remedy("export it again"));
    }
    let pixels = width as u64 * height as u64;
    if pixels > LARGEST_PIXEL_COUNT {
        return Err(too_large(path, format!("the file claims {width} x {height} pixels")));
    }
    let most_per_byte = match format {
        Format::Png | Format::Hdr => MOST_PIXELS_PER_BYTE,
        // A block of 64 pixels takes a bit of each scan at least.
        Format::Jpeg => 1024,
        // Their readers know what they hold.
        Format::Tiff | Format::Exr | Format::Pfm => u64::MAX,
    };
    if pixels / most_per_byte > length {
        return Err(implausible(path, format!("{length} bytes cannot hold the {width} x {height} pixels it claims")));
    }
    Ok(ImageHeader { format, width, height, is_linear })
}

/// A file of another content. What photos come in is named, with a way out.
fn unknown(path: &Path, first: &[u8]) -> Error {
    let at = |place: usize, magic: &[u8]| first.get(place..).is_some_and(|rest| rest.starts_with(magic));
    let raw =
        [(0, b"FUJIFILMCCD-RAW".as_slice()), (0, b"IIU\0"), (0, b"IIRO"), (0, b"IIRS"), (0, b"MMOR"), (4, b"ftypcrx")];
    if raw.iter().any(|(place, magic)| at(*place, magic)) {
        return raw_file(path);
    }
    let phone = [b"ftypheic".as_slice(), b"ftypheix", b"ftyphevc", b"ftypmif1", b"ftypmsf1", b"ftypavif"];
    let kind = if phone.iter().any(|magic| at(4, magic)) {
        "HEIC or AVIF, which is"
    } else if at(8, b"WEBP") {
        "WebP, which is"
    } else if at(0, b"GIF8") {
        "GIF, which is"
    } else {
        ""
    };
    let message = if kind.is_empty() {
        "the content is not PNG, JPEG, TIFF, OpenEXR, Radiance HDR or PFM".to_owned()
    } else {
        format!("the content is {kind} not read")
    };
    Error::new(ErrorKind::Unsupported, message)
        .at(Place::File(path.into()))
        .remedy("convert the image to PNG, JPEG, TIFF or OpenEXR, in its full size and with its colour profile")
}

/// A camera's raw file. No library reads them that is kept well and may be linked here; developing them is a craft besides.
pub fn raw_file(path: &Path) -> Error {
    Error::new(ErrorKind::Unsupported, "a camera's raw file is not read")
        .at(Place::File(path.into()))
        .remedy("develop it to a linear 16-bit TIFF, all photos alike: no sharpening, no tone curve, one white balance")
}

/// A file that breaks its format at a byte.
pub fn malformed(path: &Path, byte: u64, message: impl Into<String>) -> Error {
    Error::new(ErrorKind::Malformed, message).at(Place::Byte(path.into(), byte))
}

/// A file that claims more than it can hold.
pub fn implausible(path: &Path, message: String) -> Error {
    Error::new(ErrorKind::Malformed, message)
        .at(Place::File(path.into()))
        .remedy("the file is cut short or damaged: copy it again")
}

/// A file that claims more than is read.
pub fn too_large(path: &Path, message: String) -> Error {
    Error::new(ErrorKind::TooLarge, format!("{message}; at most {LARGEST_PIXEL_COUNT} pixels are read"))
        .at(Place::File(path.into()))
        .remedy("scale the image down")
}
