//! Files inside a ZIP archive, read only: stored and deflated entries, as PKWARE's APPNOTE 6.3 describes them.
//!
//! What is not read: encrypted entries, archives in several volumes, more than four gigabytes.

use crate::error::{Error, ErrorKind, Place, Result};
use std::io::Read;
use std::path::{Path, PathBuf};

/// The largest archive and the largest entry that are taken into memory, in bytes.
const LARGEST: u64 = 1 << 31;

/// An archive in memory and where its entries begin.
pub struct Archive {
    path: PathBuf,
    bytes: Vec<u8>,
    entries: Vec<Entry>,
}

struct Entry {
    name: String,
    method: u16,
    is_encrypted: bool,
    packed: usize,
    unpacked: usize,
    local_header: usize,
}

impl Archive {
    /// Opens an archive and lists its entries.
    ///
    /// # Errors
    /// `Malformed` when it is no archive or is cut short, `TooLarge` beyond two gigabytes.
    pub fn open(path: &Path) -> Result<Self> {
        let size = std::fs::metadata(path).map_err(|source| Error::reading(path, source))?.len();
        if size > LARGEST {
            return Err(Error::new(ErrorKind::TooLarge, format!("an archive of {size} bytes"))
                .at(Place::File(path.into()))
                .remedy("unpack it and give the folder"));
        }
        let bytes = std::fs::read(path).map_err(|source| Error::reading(path, source))?;
        let broken = |byte: usize, what: &str| {
            Error::new(ErrorKind::Malformed, format!("the archive {what}"))
                .at(Place::Byte(path.into(), byte as u64))
                .remedy("the file is cut short or damaged: copy it again")
        };
        // The end record is the last thing but a comment of at most 65,535 bytes.
        let earliest = bytes.len().saturating_sub(22 + 65_535);
        let end = (earliest..bytes.len().saturating_sub(21)).rev().find(|&at| bytes[at..].starts_with(b"PK\x05\x06"));
        let end = end.ok_or_else(|| broken(bytes.len(), "has no directory"))?;
        let count = number(&bytes, end + 10, 2).unwrap_or(0);
        let mut at = number(&bytes, end + 16, 4).unwrap_or(0);
        let mut entries = Vec::new();
        for _ in 0..count {
            let cut = || broken(at, "ends inside its directory");
            if !bytes.get(at..).is_some_and(|rest| rest.starts_with(b"PK\x01\x02")) {
                return Err(cut());
            }
            let field = |offset: usize, length: usize| number(&bytes, at + offset, length).ok_or_else(cut);
            let (name_length, extra, comment) = (field(28, 2)?, field(30, 2)?, field(32, 2)?);
            let name = bytes.get(at + 46..at + 46 + name_length).ok_or_else(cut)?;
            entries.push(Entry {
                name: String::from_utf8_lossy(name).into_owned(),
                method: field(10, 2)? as u16,
                is_encrypted: field(8, 2)? & 1 == 1,
                packed: field(20, 4)?,
                unpacked: field(24, 4)?,
                local_header: field(42, 4)?,
            });
            at += 46 + name_length + extra + comment;
        }
        Ok(Archive { path: path.into(), bytes, entries })
    }

    /// The content of an entry, at most as long as the directory says.
    ///
    /// # Errors
    /// `Missing` when there is none of this name, `Malformed` when it is damaged, `Unsupported` when it is encrypted or
    /// packed in another way.
    pub fn read(&self, name: &str) -> Result<Vec<u8>> {
        let place = || Place::File(self.path.join(name));
        let damaged = || {
            Error::new(ErrorKind::Malformed, "the entry of the archive is damaged")
                .at(place())
                .remedy("the file is cut short or damaged: copy it again")
        };
        let entry = self.entries.iter().find(|entry| entry.name == name).ok_or_else(|| {
            Error::new(ErrorKind::Missing, format!("the archive holds no {name}"))
                .at(Place::File(self.path.clone()))
                .remedy("save the project again in the program that made it")
        })?;
        if entry.is_encrypted || !matches!(entry.method, 0 | 8) {
            return Err(Error::new(
                ErrorKind::Unsupported,
                "the entry is encrypted or packed in a way that is not supported",
            )
            .at(place())
            .remedy("unpack the archive and pack it again as an ordinary ZIP"));
        }
        let header = entry.local_header;
        if !self.bytes.get(header..).is_some_and(|rest| rest.starts_with(b"PK\x03\x04")) {
            return Err(damaged());
        }
        let length = |offset| number(&self.bytes, header + offset, 2).ok_or_else(damaged);
        let start = header + 30 + length(26)? + length(28)?;
        let packed = start.checked_add(entry.packed).and_then(|end| self.bytes.get(start..end)).ok_or_else(damaged)?;
        // Deflate makes at most 1032 bytes of one: no more is taken on trust.
        if entry.unpacked > packed.len().saturating_mul(1040) + 64 {
            return Err(damaged());
        }
        if entry.method == 0 {
            return Ok(packed.to_vec());
        }
        let mut content = Vec::with_capacity(entry.unpacked);
        let mut unpacked = flate2::read::DeflateDecoder::new(packed).take(entry.unpacked as u64 + 1);
        unpacked.read_to_end(&mut content).map_err(|_| damaged())?;
        if content.len() != entry.unpacked { Err(damaged()) } else { Ok(content) }
    }

    /// Names of the entries.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.entries.iter().map(|entry| entry.name.as_str())
    }
}

fn number(bytes: &[u8], at: usize, length: usize) -> Option<usize> {
    let bytes = bytes.get(at..at.checked_add(length)?)?;
    Some(bytes.iter().rev().fold(0, |sum, byte| sum << 8 | usize::from(*byte)))
}

/// An archive of deflated entries (PKWARE's APPNOTE 6.3), with empty checksums; for tests of the readers.
#[cfg(any(test, feature = "lab"))]
pub fn packed(entries: &[(&str, &[u8])]) -> Vec<u8> {
    use std::io::Write;
    let (mut file, mut directory) = (Vec::new(), Vec::new());
    for (name, content) in entries {
        let mut encoder = flate2::write::DeflateEncoder::new(Vec::new(), flate2::Compression::default());
        // Writing to memory does not fail; if it did, the archive would not open.
        let data = encoder.write_all(content).and_then(|()| encoder.finish()).unwrap_or_default();
        let mut common = vec![20, 0, 0, 0, 8, 0, 0, 0, 0, 0, 0, 0, 0, 0];
        for value in [data.len() as u32, content.len() as u32] {
            common.extend(value.to_le_bytes());
        }
        common.extend((name.len() as u16).to_le_bytes());
        common.extend([0, 0]);
        directory.extend(b"PK\x01\x02\x14\x00");
        directory.extend(&common);
        directory.extend([0; 10]);
        directory.extend((file.len() as u32).to_le_bytes());
        directory.extend(name.as_bytes());
        file.extend(b"PK\x03\x04");
        file.extend(&common);
        file.extend(name.as_bytes());
        file.extend(data);
    }
    let start = file.len() as u32;
    file.extend(&directory);
    file.extend(b"PK\x05\x06\0\0\0\0");
    file.extend((entries.len() as u16).to_le_bytes());
    file.extend((entries.len() as u16).to_le_bytes());
    file.extend((directory.len() as u32).to_le_bytes());
    file.extend(start.to_le_bytes());
    file.extend([0, 0]);
    file
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_come_back_and_damage_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.zip");
        let text = "the same again and again ".repeat(50);
        let bytes = packed(&[("doc.xml", text.as_bytes()), ("other", b"x")]);
        std::fs::write(&path, &bytes).unwrap();
        let archive = Archive::open(&path).unwrap();
        assert_eq!(archive.names().collect::<Vec<_>>(), ["doc.xml", "other"]);
        assert_eq!(archive.read("doc.xml").unwrap(), text.as_bytes());
        assert_eq!(archive.read("absent").unwrap_err().kind(), ErrorKind::Missing);
        for length in 0..bytes.len() {
            std::fs::write(&path, &bytes[..length]).unwrap();
            assert!(Archive::open(&path).is_err(), "cut to {length} bytes");
        }
        for at in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[at] ^= 0xff;
            std::fs::write(&path, &damaged).unwrap();
            // Whatever it says, it does not panic.
            if let Ok(archive) = Archive::open(&path) {
                let _ = archive.read("doc.xml");
            }
        }
    }
}
