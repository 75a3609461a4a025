//! What a file is and how large it claims to be, before anything is allocated for it.

use super::format::{
    Format, ImageHeader, LARGEST_FILE, LARGEST_PIXEL_COUNT, MOST_PIXELS_PER_BYTE, Source, implausible, malformed,
    raw_file, too_large,
};
use super::{hdr, openexr, pfm, raster, tiff};
use crate::error::{Error, ErrorKind, Place, Result};
use std::fs::File;
use std::io::{BufRead, BufReader, Cursor, Read, Seek};
use std::path::Path;

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
