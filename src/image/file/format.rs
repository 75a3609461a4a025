//! Which formats are read, the limits of a file, and the errors that all readers share.

use crate::error::{Error, ErrorKind, Place};
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
    pub fn of_first_bytes(bytes: &[u8]) -> Option<Self> {
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
pub const LARGEST_FILE: u64 = 1 << 32;
/// Most pixels a byte of a PNG, HDR or ZIP-compressed EXR can stand for (1 bit a pixel, deflate at its best of 1032:1).
pub const MOST_PIXELS_PER_BYTE: u64 = 16_384;

/// A whole file in memory, its format and size known and within limits.
pub struct Source {
    pub path: PathBuf,
    pub bytes: Vec<u8>,
    pub header: ImageHeader,
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
