//! Masks, in whatever way programs write them: white on black, ones and zeros, or opacity.
//!
//! One file alone may not say which: a mask that is 0 everywhere, or opaque everywhere, is one in each way. The masks of one
//! set are written alike, so that all of them decide: [`MaskFile`] is what a file holds, [`MaskWay`] what the set says.

use super::format::{Format, Source};
use super::{grey_of, raster, tiff};
use crate::error::{Finding, Result, Severity};
use crate::image::GreyImage;
use std::path::Path;

/// From here on a value of a mask is object.
const OBJECT: f32 = 0.5;

/// A mask as its file holds it.
#[derive(Clone, Debug)]
pub struct MaskFile {
    /// Its opacity, where the file has one.
    alpha: Option<GreyImage>,
    /// Its grey values in [0, 1].
    grey: GreyImage,
    /// What both say of the way it is written in.
    facts: MaskFacts,
}

/// What one mask says of the way that its set is written in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MaskFacts {
    /// Whether its opacity tells two kinds of pixels apart; `None` where it has none.
    alpha_tells: Option<bool>,
    /// Whether its grey values do.
    grey_tells: bool,
    /// Its largest grey value.
    most: f32,
    /// Whether its grey values are 0 and one other value.
    is_of_two: bool,
    /// Whether its grey values are a picture that was masked, no mask.
    is_picture: bool,
}

/// How the masks of one set are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MaskWay {
    /// Their opacity is the mask, whatever the colours are.
    by_alpha: bool,
    /// They are of 0 and one other value below half of full scale: some programs write 1 for object where 255 is full scale.
    of_ones: bool,
}

/// What is read of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Reading {
    Alpha,
    Ones,
    Grey,
}

/// The values of a mask, object from 0.5 on.
#[derive(Clone, Debug, PartialEq)]
pub struct MaskValues {
    /// One value a pixel.
    pub values: GreyImage,
    /// Whether they are the opacity of the file.
    pub are_opacity: bool,
    /// What was made of the file where that is not what [`read_grey`](super::read_grey) gives.
    pub told: Option<Finding>,
}

impl MaskFacts {
    fn is_dark(&self) -> bool {
        self.is_of_two && self.most > 0.0 && self.most < OBJECT
    }

    fn reading(&self, way: MaskWay) -> Reading {
        let by_alpha = match self.alpha_tells {
            Some(true) => true,
            Some(false) => way.by_alpha && (self.is_picture || !self.grey_tells || !self.is_of_two),
            None => false,
        };
        match () {
            () if by_alpha => Reading::Alpha,
            () if way.of_ones && self.is_dark() && !self.is_picture => Reading::Ones,
            () => Reading::Grey,
        }
    }

    /// Whether the mask is read otherwise when it goes by another way than its own.
    pub fn differs_by(&self, way: MaskWay) -> bool {
        self.reading(way) != self.reading(MaskWay::of_set([*self]))
    }
}

impl MaskWay {
    /// The way that most of a set's masks are written in, of those that tell.
    pub fn of_set(masks: impl IntoIterator<Item = MaskFacts>) -> Self {
        let (mut by_alpha, mut beside_alpha, mut dark, mut full) = (0usize, 0usize, 0usize, 0usize);
        for own in masks {
            by_alpha += usize::from(own.alpha_tells == Some(true));
            beside_alpha +=
                usize::from(own.alpha_tells == Some(false) && !own.is_picture && own.grey_tells && own.is_of_two);
            let is_by_grey = own.alpha_tells != Some(true) && !own.is_picture;
            dark += usize::from(is_by_grey && own.is_dark());
            full += usize::from(is_by_grey && own.most >= OBJECT);
        }
        MaskWay { by_alpha: by_alpha > beside_alpha, of_ones: dark > full }
    }
}

impl MaskFile {
    /// Reads a mask. Errors as [`read_grey`](super::read_grey).
    pub fn open(path: &Path) -> Result<Self> {
        Self::of(&Source::open(path)?)
    }

    /// A mask of bytes that are at hand; `path` is what errors name. Errors as [`read_grey`](super::read_grey).
    pub fn of_bytes(path: &Path, bytes: Vec<u8>) -> Result<Self> {
        Self::of(&Source::of_bytes(path, bytes)?)
    }

    fn of(source: &Source) -> Result<Self> {
        let stored = match source.header.format {
            Format::Png | Format::Jpeg => Some(raster::read(source)?.0),
            Format::Tiff => Some(tiff::read(source)?),
            _ => None,
        };
        let (alpha, grey) = match stored {
            None => (None, grey_of(source)?),
            Some(stored) => (stored.alpha(), stored.grey()),
        };
        let most = grey.pixels().iter().fold(0.0f32, |most, value| most.max(*value));
        let is_of_two = grey.pixels().iter().all(|value| *value == 0.0 || *value == most);
        let tells = |mask: &GreyImage, least: f32| {
            let objects = mask.pixels().iter().filter(|value| **value >= least).count();
            objects > 0 && objects < mask.pixels().len()
        };
        let facts = MaskFacts {
            alpha_tells: alpha.as_ref().map(|alpha| tells(alpha, OBJECT)),
            grey_tells: tells(&grey, if is_of_two && most > 0.0 { most } else { OBJECT }),
            most,
            is_of_two,
            is_picture: false,
        };
        Ok(MaskFile { alpha, grey, facts })
    }

    /// The same file, whose colours are a picture that is black where it is masked.
    pub fn of_picture(mut self) -> Self {
        self.facts.is_picture = true;
        self
    }

    /// What it says of the way that its set is written in.
    pub fn facts(&self) -> MaskFacts {
        self.facts
    }

    /// Its values, read as its set is written.
    pub fn into_values(self, way: MaskWay) -> MaskValues {
        let note = |code, message: &str| Some(Finding::new(Severity::Note, code, message.to_owned()));
        let grey = |values, told| MaskValues { values, are_opacity: false, told };
        match (self.facts.reading(way), self.alpha) {
            (Reading::Alpha, Some(values)) => {
                let told = note("mask-by-alpha", "the opacity of the mask's file is the mask");
                MaskValues { values, are_opacity: true, told }
            }
            (Reading::Ones, _) => grey(
                self.grey.map(|value| value / self.facts.most),
                note("mask-of-ones", "the mask holds 0 and one other value below half of full scale: that is object"),
            ),
            _ => grey(self.grey, None),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{Image, file};

    fn read_mask(path: &Path) -> Result<(GreyImage, Option<Finding>)> {
        let file = MaskFile::open(path)?;
        let way = MaskWay::of_set([file.facts()]);
        let MaskValues { values, told, .. } = file.into_values(way);
        Ok((values, told))
    }

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

    #[test]
    fn what_one_mask_leaves_open_the_others_of_its_set_decide() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mask.png");
        let halves = |left: u8, right: u8| move |_: usize, column: usize| if column < 2 { left } else { right };
        let grey = |left, right| {
            let value = halves(left, right);
            file::write_png_srgb8(&path, &Image::from_fn(4, 3, |row, column| [value(row, column); 3])).unwrap();
            MaskFile::open(&path).unwrap()
        };
        let opacity = |colour: u8, left, right| {
            let value = halves(left, right);
            let image = Image::from_fn(4, 3, |row, column| [colour, colour, colour, value(row, column)]);
            file::write_png_srgba8(&path, &image).unwrap();
            MaskFile::open(&path).unwrap()
        };
        // Which half of each mask is object, when all are of one set.
        let objects = |files: Vec<MaskFile>| -> Vec<[bool; 2]> {
            let way = MaskWay::of_set(files.iter().map(MaskFile::facts));
            let halves = |file: MaskFile| {
                let values = file.into_values(way).values;
                [values[(1, 0)] >= OBJECT, values[(1, 3)] >= OBJECT]
            };
            files.into_iter().map(halves).collect()
        };
        let [both, left, none] = [[true, true], [true, false], [false, false]];
        assert_eq!(objects(vec![grey(1, 0), grey(1, 1), grey(0, 0)]), [left, both, none]);
        // A soft edge that reaches just into the picture is no object where 255 is.
        let soft = || grey(40, 0);
        assert_eq!(objects(vec![soft()]), [left]);
        assert_eq!(objects(vec![grey(255, 0), soft(), grey(255, 255), grey(0, 0)]), [left, none, both, none]);
        // Black all over with an opacity is object where the opacity of its neighbours is the mask.
        assert_eq!(objects(vec![opacity(0, 255, 255)]), [none]);
        let set = vec![opacity(0, 255, 0), opacity(0, 255, 255), opacity(200, 0, 0)];
        assert_eq!(objects(set), [left, both, none]);
        let drawn_by_hand = grey(255, 0);
        assert_eq!(objects(vec![opacity(0, 255, 0), drawn_by_hand]), [left, left]);
        assert!(soft().facts().differs_by(MaskWay::of_set([grey(255, 0).facts()])));
        assert!(!grey(0, 0).facts().differs_by(MaskWay::of_set([grey(1, 0).facts()])));
    }
}
