//! MERL's `.binary`: three 32-bit sizes and the table as 64-bit floats, all little-endian.

use super::grid::{CELL_COUNT, PHI_DIFFERENCE_COUNT, THETA_DIFFERENCE_COUNT, THETA_HALF_COUNT};
use super::table::MeasuredBrdf;
use crate::error::{Error, ErrorKind, Place, Result};
use crate::files::write_atomically;
use std::io::{Read, Write};
use std::path::Path;

const HEADER: [i32; 3] = [THETA_HALF_COUNT as i32, THETA_DIFFERENCE_COUNT as i32, PHI_DIFFERENCE_COUNT as i32];
/// Bytes of every file.
pub const FILE_LENGTH: u64 = 12 + 3 * 8 * CELL_COUNT as u64;

impl MeasuredBrdf {
    /// Reads a `.binary` file bit for bit.
    ///
    /// Errors: missing or unreadable; a header that is not 90, 90, 180 (other sizes exist, and are not read here); a
    /// length that is not that of its table, told before memory is taken; no valid cell.
    pub fn read(path: &Path) -> Result<Self> {
        let file = std::fs::File::open(path).map_err(|source| Error::reading(path, source))?;
        let metadata = file.metadata().map_err(|source| Error::reading(path, source))?;
        if !metadata.is_file() {
            return Err(Error::new(ErrorKind::Unreadable, "this is not a file").at(Place::File(path.into())));
        }
        let mut reader = std::io::BufReader::with_capacity(1 << 16, file);
        let mut header = [0u8; 12];
        let length = metadata.len();
        if length < 12 {
            return Err(wrong_length(path, length));
        }
        reader.read_exact(&mut header).map_err(|source| Error::reading(path, source))?;
        let sizes: [i32; 3] = std::array::from_fn(|axis| {
            i32::from_le_bytes([header[4 * axis], header[4 * axis + 1], header[4 * axis + 2], header[4 * axis + 3]])
        });
        if sizes != HEADER {
            let [a, b, c] = sizes;
            return Err(Error::new(
                ErrorKind::Unsupported,
                format!("the header says {a} x {b} x {c}, not 90 x 90 x 180"),
            )
            .at(Place::Byte(path.into(), 0))
            .remedy("give an isotropic table in MERL's layout"));
        }
        if length != FILE_LENGTH {
            return Err(wrong_length(path, length));
        }
        let mut raw = Vec::with_capacity(3 * CELL_COUNT);
        let mut buffer = vec![0u8; 1 << 16];
        let mut left = 24 * CELL_COUNT;
        while left > 0 {
            let part = &mut buffer[..left.min(1 << 16)];
            reader.read_exact(part).map_err(|source| Error::reading(path, source))?;
            raw.extend(part.chunks_exact(8).map(|bytes| {
                let mut value = [0u8; 8];
                value.copy_from_slice(bytes);
                f64::from_le_bytes(value)
            }));
            left -= part.len();
        }
        Self::from_raw(raw).map_err(|error| error.at(Place::File(path.into())))
    }

    /// Writes the table as a `.binary` file, whole or not at all.
    pub fn write(&self, path: &Path) -> Result<()> {
        write_atomically(path, |writer| {
            for size in HEADER {
                writer.write_all(&size.to_le_bytes())?;
            }
            self.raw().iter().try_for_each(|value| writer.write_all(&value.to_le_bytes()))
        })
    }
}

fn wrong_length(path: &Path, length: u64) -> Error {
    let what = if length < FILE_LENGTH { "cut short" } else { "too long" };
    Error::new(ErrorKind::Malformed, format!("{what}: {length} bytes, where a table has {FILE_LENGTH}"))
        .at(Place::Byte(path.into(), length.min(FILE_LENGTH)))
        .remedy("copy the file again; it must be one isotropic table in MERL's layout")
}
