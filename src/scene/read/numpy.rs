//! Arrays of numpy: `.npy` (format 1 to 3, little-endian floats and integers, in the order of C or of Fortran) and archives of
//! them, `.npz`, of which only those that are asked for are read.

use super::zip::Archive;
use crate::error::{Error, ErrorKind, Place, Result};
use std::path::{Path, PathBuf};

/// An array of numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// Length of each dimension.
    pub shape: Vec<usize>,
    /// The values, the last dimension running fastest.
    pub values: Vec<f64>,
}

/// The largest file that is read, in bytes.
const LARGEST: u64 = 1 << 28;

/// Reads an array from a file.
pub fn read(path: &Path) -> Result<Array> {
    let size = std::fs::metadata(path).map_err(|source| Error::reading(path, source))?.len();
    if size > LARGEST {
        return Err(Error::new(ErrorKind::TooLarge, format!("an array of {size} bytes"))
            .at(Place::File(path.into()))
            .remedy("this is not the file it should be: check the path"));
    }
    parse(&std::fs::read(path).map_err(|source| Error::reading(path, source))?, path)
}

/// An archive of arrays.
pub struct Arrays {
    path: PathBuf,
    archive: Archive,
}

impl Arrays {
    /// Opens an archive; no array is read yet.
    pub fn open(path: &Path) -> Result<Self> {
        Ok(Arrays { path: path.into(), archive: Archive::open(path)? })
    }

    /// An array by its name without `.npy`; `None` where there is none of the name.
    pub fn get(&self, name: &str) -> Result<Option<Array>> {
        let name = format!("{name}.npy");
        if !self.archive.names().any(|own| own == name) {
            return Ok(None);
        }
        parse(&self.archive.read(&name)?, &self.path.join(&name)).map(Some)
    }
}

fn parse(bytes: &[u8], path: &Path) -> Result<Array> {
    let malformed = |what: &str| {
        Error::new(ErrorKind::Malformed, format!("the array {what}"))
            .at(Place::File(path.into()))
            .remedy("save it again with numpy.save as float64")
    };
    if !bytes.starts_with(b"\x93NUMPY") || bytes.len() < 12 {
        return Err(malformed("is not one of numpy"));
    }
    let (start, length): (usize, usize) = match bytes[6] {
        1 => (10, usize::from(u16::from_le_bytes([bytes[8], bytes[9]]))),
        _ => (12, u32::from_le_bytes([bytes[8], bytes[9], bytes[10], bytes[11]]) as usize),
    };
    let header =
        start.checked_add(length).and_then(|end| bytes.get(start..end)).ok_or_else(|| malformed("is cut short"))?;
    let header = String::from_utf8_lossy(header);
    let after = |key: &str| header.split_once(&format!("'{key}':")).map(|(_, rest)| rest.trim_start());
    let kind = after("descr").and_then(|rest| rest.strip_prefix('\'')?.split('\'').next()).unwrap_or_default();
    let is_fortran_order = after("fortran_order").is_some_and(|rest| rest.starts_with("True"));
    let shape = after("shape").and_then(|rest| rest.strip_prefix('(')?.split(')').next()).unwrap_or_default();
    let shape: Option<Vec<usize>> =
        shape.split(',').map(str::trim).filter(|word| !word.is_empty()).map(|word| word.parse().ok()).collect();
    let shape = shape.ok_or_else(|| malformed("has no shape"))?;
    let count = shape.iter().try_fold(1usize, |product, length| product.checked_mul(*length));
    let data = &bytes[start + length..];
    let size = match kind {
        "<f8" | "<i8" => 8,
        "<f4" | "<i4" => 4,
        _ => return Err(malformed(&format!("holds '{kind}', not little-endian floats or integers"))),
    };
    if count.and_then(|count| count.checked_mul(size)) != Some(data.len()) {
        return Err(malformed("is not as long as its shape says"));
    }
    let value = |chunk: &[u8]| {
        let mut eight = [0; 8];
        eight[..size].copy_from_slice(chunk);
        let four = [eight[0], eight[1], eight[2], eight[3]];
        match kind {
            "<f8" => f64::from_le_bytes(eight),
            "<i8" => i64::from_le_bytes(eight) as f64,
            "<f4" => f64::from(f32::from_le_bytes(four)),
            _ => f64::from(i32::from_le_bytes(four)),
        }
    };
    let values: Vec<f64> = data.chunks_exact(size).map(value).collect();
    let values = if is_fortran_order { with_last_fastest(&values, &shape) } else { values };
    Ok(Array { shape, values })
}

/// The values of an array whose first dimension runs fastest, in the order in which the last one does.
fn with_last_fastest(values: &[f64], shape: &[usize]) -> Vec<f64> {
    let place = |mut index: usize| {
        // From the last dimension to the first: the digits of the index, weighed by the lengths before them.
        let mut stride: usize = shape.iter().product();
        let mut place = 0;
        for length in shape.iter().rev() {
            stride /= length;
            place += index % length * stride;
            index /= length;
        }
        place
    };
    (0..values.len()).map(|index| values[place(index)]).collect()
}

/// An array of doubles as a file; for tests of the readers.
#[cfg(any(test, feature = "lab"))]
pub fn written(shape: &[usize], values: &[f64]) -> Vec<u8> {
    let shape: Vec<String> = shape.iter().map(|length| format!("{length},")).collect();
    let header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({}), }}\n", shape.join(" "));
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    values.iter().for_each(|value| bytes.extend(value.to_le_bytes()));
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_come_back_and_damage_is_an_error() {
        let bytes = written(&[2, 3], &[1.0, 2.0, 3.0, 4.0, 5.0, 6.5]);
        let array = parse(&bytes, Path::new("a.npy")).unwrap();
        assert_eq!((array.shape.as_slice(), array.values[5]), (&[2usize, 3][..], 6.5));
        for length in 0..bytes.len() {
            assert!(parse(&bytes[..length], Path::new("a.npy")).is_err(), "cut to {length}");
        }
        let text = String::from_utf8_lossy(&bytes[10..60]).into_owned();
        assert!(text.contains("fortran_order"));
        let fortran: Vec<u8> = bytes.clone();
        let at = fortran.windows(5).position(|window| window == b"False").unwrap();
        let mut fortran = fortran;
        fortran[at..at + 5].copy_from_slice(b"True ");
        // Columns of two: 1 2, 3 4, 5 6.5.
        let array = parse(&fortran, Path::new("a.npy")).unwrap();
        assert_eq!(array.values, [1.0, 3.0, 5.0, 2.0, 4.0, 6.5]);
        let cube: Vec<f64> = (0..24).map(f64::from).collect();
        let turned = with_last_fastest(&cube, &[2, 3, 4]);
        // Element (1, 2, 3) is the last of both, (0, 1, 0) the third, (1, 0, 0) the second of Fortran's.
        assert_eq!((turned[23], turned[4], turned[12]), (23.0, 2.0, 1.0));
    }
}
