//! Masks, in whatever way programs write them: white on black, ones and zeros, or opacity.

use super::format::{Format, Source};
use super::{grey_of, raster, tiff};
use crate::error::{Finding, Result, Severity};
use crate::image::GreyImage;
use std::path::Path;

/// From here on a value of a mask is object.
const OBJECT: f32 = 0.5;

/// One value a pixel of a mask, object from 0.5 on; with what was made of it where that is not what [`read_grey`](super::read_grey)
/// gives.
///
/// Where a file's opacity tells two kinds of pixels apart, it is the mask, whatever the colours are. A mask of 0 and one other
/// value is one of 0 and 1: some programs write 1 for object where 255 is full scale. Errors as [`read_grey`](super::read_grey).
pub fn read_mask(path: &Path) -> Result<(GreyImage, Option<Finding>)> {
    mask_of(&Source::open(path)?)
}

/// A mask of bytes that are at hand; `path` is what errors name. As [`read_mask`].
pub fn read_mask_from(path: &Path, bytes: Vec<u8>) -> Result<(GreyImage, Option<Finding>)> {
    mask_of(&Source::of_bytes(path, bytes)?)
}

fn mask_of(source: &Source) -> Result<(GreyImage, Option<Finding>)> {
    let stored = match source.header.format {
        Format::Png | Format::Jpeg => Some(raster::read(source)?.0),
        Format::Tiff => Some(tiff::read(source)?),
        _ => None,
    };
    let tells_apart = |mask: &GreyImage| {
        let objects = mask.pixels().iter().filter(|value| **value >= OBJECT).count();
        objects > 0 && objects < mask.pixels().len()
    };
    let note = |code, message: &str| Some(Finding::new(Severity::Note, code, message.to_owned()));
    let grey = match stored {
        None => grey_of(source)?,
        Some(stored) => match stored.alpha().filter(tells_apart) {
            Some(alpha) => return Ok((alpha, note("mask-by-alpha", "the opacity of the mask's file is the mask"))),
            None => stored.grey(),
        },
    };
    let most = grey.pixels().iter().fold(0.0f32, |most, value| most.max(*value));
    let is_of_ones = most > 0.0 && most < OBJECT && grey.pixels().iter().all(|value| *value == 0.0 || *value == most);
    if !is_of_ones {
        return Ok((grey, None));
    }
    let told = note("mask-of-ones", "the mask holds 0 and one other value below half of full scale: that is object");
    Ok((grey.map(|value| value / most), told))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{Image, file};

    #[test]
    fn ones_and_opacity_are_masks_and_what_is_neither_stays() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mask.png");
        let is_object = |row: usize, column: usize| row > 0 && column < 2;
        let expected = Image::from_fn(4, 3, |row, column| f32::from(u8::from(is_object(row, column))));
        let grey = |inside: u8, outside: u8| {
            Image::from_fn(4, 3, |row, column| [if is_object(row, column) { inside } else { outside }; 3])
        };
        for (inside, code) in [(255, None), (1, Some("mask-of-ones")), (127, Some("mask-of-ones"))] {
            file::write_png_srgb8(&path, &grey(inside, 0)).unwrap();
            let (mask, told) = read_mask(&path).unwrap();
            assert_eq!((mask, told.map(|own| own.code)), (expected.clone(), code), "{inside}");
        }
        // Dark, but of more than two values: as it is.
        let dark = Image::from_fn(4, 3, |row, _| [row as u8; 3]);
        file::write_png_srgb8(&path, &dark).unwrap();
        let (mask, told) = read_mask(&path).unwrap();
        assert!(told.is_none() && (mask[(2, 0)] - 2.0 / 255.0).abs() < 1e-6);
        for colour in [0u8, 40, 255] {
            let alpha = Image::from_fn(4, 3, |row, column| {
                [colour, colour, colour, if is_object(row, column) { 255 } else { 0 }]
            });
            file::write_png_srgba8(&path, &alpha).unwrap();
            let (mask, told) = read_mask(&path).unwrap();
            assert_eq!((mask, told.map(|own| own.code)), (expected.clone(), Some("mask-by-alpha")), "{colour}");
        }
        let opaque = grey(255, 0).map(|&[r, g, b]| [r, g, b, 255]);
        file::write_png_srgba8(&path, &opaque).unwrap();
        assert_eq!(read_mask(&path).unwrap(), (expected, None));
    }
}
