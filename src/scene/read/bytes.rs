//! A binary file read from its start, little endian, every step checked against its length.

use crate::error::{Error, ErrorKind, Place, Result};
use std::path::{Path, PathBuf};

/// The largest binary file of cameras, in bytes.
const LARGEST: u64 = 1 << 32;

/// The bytes of a file and how far they are read.
pub struct Bytes {
    path: PathBuf,
    bytes: Vec<u8>,
    at: usize,
}

impl Bytes {
    /// Opens a file of at most four gigabytes.
    pub fn open(path: &Path) -> Result<Self> {
        let size = std::fs::metadata(path).map_err(|source| Error::reading(path, source))?.len();
        if size > LARGEST {
            return Err(Error::new(ErrorKind::TooLarge, format!("a file of {size} bytes"))
                .at(Place::File(path.into()))
                .remedy("this is not the file it should be: check the path"));
        }
        let bytes = std::fs::read(path).map_err(|source| Error::reading(path, source))?;
        Ok(Bytes { path: path.into(), bytes, at: 0 })
    }

    /// The place that is read next.
    pub fn place(&self) -> Place {
        Place::Byte(self.path.clone(), self.at as u64)
    }

    /// How many bytes are left.
    pub fn left(&self) -> usize {
        self.bytes.len() - self.at
    }

    /// The next bytes.
    pub fn take(&mut self, length: usize, what: &str) -> Result<&[u8]> {
        if length > self.left() {
            return Err(Error::new(ErrorKind::Malformed, format!("the file ends before {what}"))
                .at(self.place())
                .remedy("the file is cut short or damaged: copy it again"));
        }
        self.at += length;
        Ok(&self.bytes[self.at - length..self.at])
    }

    /// Steps over bytes.
    pub fn skip(&mut self, length: usize, what: &str) -> Result<()> {
        self.take(length, what).map(|_| ())
    }

    fn array<const N: usize>(&mut self, what: &str) -> Result<[u8; N]> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N, what)?);
        Ok(array)
    }

    /// An unsigned number of 32 bits.
    pub fn u32(&mut self, what: &str) -> Result<u32> {
        self.array(what).map(u32::from_le_bytes)
    }

    /// An unsigned number of 64 bits.
    pub fn u64(&mut self, what: &str) -> Result<u64> {
        self.array(what).map(u64::from_le_bytes)
    }

    /// A double.
    pub fn f64(&mut self, what: &str) -> Result<f64> {
        self.array(what).map(f64::from_le_bytes)
    }

    /// A number of items of at least so many bytes each: more than the rest of the file can hold is an error.
    pub fn count(&mut self, what: &str, least_bytes: usize) -> Result<usize> {
        let place = self.place();
        let count = self.u64(what)?;
        if count > (self.left() / least_bytes.max(1)) as u64 {
            return Err(Error::new(ErrorKind::Malformed, format!("{what} is {count}: more than the file can hold"))
                .at(place)
                .remedy("the file is cut short or damaged: copy it again"));
        }
        Ok(count as usize)
    }

    /// Text up to a zero byte.
    pub fn text_to_zero(&mut self, what: &str) -> Result<String> {
        let length = self.bytes[self.at..].iter().position(|byte| *byte == 0).unwrap_or(self.left());
        let text = String::from_utf8_lossy(self.take(length, what)?).into_owned();
        self.skip(1, what)?;
        Ok(text)
    }
}
