//! What EXIF says of a photo: how it lies, and how it was exposed. Also what the directories of a TIFF say before it is
//! decoded: whether it is a camera's raw file.
//!
//! EXIF is a TIFF without pixels (CIPA DC-008, 4.6). A dozen tags of fixed size are wanted, so that the reader is this
//! page: it borrows the bytes, follows no chain and takes no memory. What is damaged is as if it were not there.

/// Facts of a photo.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Exif {
    /// Orientation, 1 to 8: how the stored rows and columns lie in the upright picture (CIPA DC-008, table 3).
    pub orientation: Option<u8>,
    /// Time of exposure in seconds.
    pub exposure_seconds: Option<f64>,
    /// Focal length over the diameter of the aperture.
    pub f_number: Option<f64>,
    /// Sensitivity.
    pub iso: Option<f64>,
    /// Whether colours are those of Adobe RGB: not sRGB, and by the rule R03 (DCF 2.0, 4.4), or by the number some cameras
    /// write for it.
    pub is_adobe_rgb: bool,
    /// Whether colours are said not to be sRGB, but not what they are.
    pub is_uncalibrated: bool,
}

impl Exif {
    /// Logarithm to base 2 of what the exposure makes of a radiance, `log2(t S / (100 N²))`: the negative of the exposure
    /// value at ISO 100. An unknown aperture or sensitivity counts as 1 or 100: phones have one aperture. `None` without a
    /// time.
    pub fn exposure_stops(&self) -> Option<f32> {
        let stops = (self.exposure_seconds? * self.iso.unwrap_or(100.0) / 100.0).log2()
            - 2.0 * self.f_number.unwrap_or(1.0).log2();
        stops.is_finite().then_some(stops as f32)
    }
}

const ORIENTATION: u16 = 274;
const SUB_DIRECTORIES: u16 = 330;
const EXIF_DIRECTORY: u16 = 0x8769;
const EXPOSURE_TIME: u16 = 33_434;
const F_NUMBER: u16 = 33_437;
const SENSITIVITY: u16 = 34_855;
const COLOUR_SPACE: u16 = 0xa001;
const INTEROPERABILITY_DIRECTORY: u16 = 0xa005;
const INTEROPERABILITY_INDEX: u16 = 1;
/// Values of the tag of the colour space.
const SRGB: f64 = 1.0;
const ADOBE_RGB: f64 = 2.0;
const UNCALIBRATED: f64 = 65_535.0;
const DNG_VERSION: u16 = 50_706;
const SUBFILE_TYPE: u16 = 254;
const PHOTOMETRIC: u16 = 262;
/// Colour filter array and linear raw, the kinds of pixels of raw files (TIFF/EP; DNG 1.7).
const RAW_PHOTOMETRICS: [f64; 2] = [32_803.0, 34_892.0];
/// Directories beside the first that are looked at.
const MOST_SUB_DIRECTORIES: usize = 8;

/// Reads the EXIF block of a JPEG or PNG, with or without the six letters before it, or a whole TIFF.
pub fn read(bytes: &[u8]) -> Exif {
    let bytes = bytes.strip_prefix(b"Exif\0\0").unwrap_or(bytes);
    let Some((tiff, first)) = Tiff::open(bytes) else { return Exif::default() };
    let positive = |value: f64| (value > 0.0 && value.is_finite()).then_some(value);
    let mut exif = Exif {
        orientation: tiff.number(first, ORIENTATION, 0).filter(|v| (1.0..=8.0).contains(v)).map(|v| v as u8),
        ..Exif::default()
    };
    if let Some(directory) = tiff.number(first, EXIF_DIRECTORY, 0) {
        let directory = directory as usize;
        let number = |tag| tiff.number(directory, tag, 0).and_then(positive);
        exif.exposure_seconds = number(EXPOSURE_TIME);
        exif.f_number = number(F_NUMBER);
        exif.iso = number(SENSITIVITY);
        let space = tiff.number(directory, COLOUR_SPACE, 0);
        let rules = tiff.number(directory, INTEROPERABILITY_DIRECTORY, 0).map(|rules| rules as usize);
        let letter = |index| tiff.number(rules?, INTEROPERABILITY_INDEX, index).map(|letter| letter as u8);
        let is_third = [Some(b'R'), Some(b'0'), Some(b'3')] == [0, 1, 2].map(letter);
        exif.is_adobe_rgb = space == Some(ADOBE_RGB) || (is_third && space != Some(SRGB));
        exif.is_uncalibrated = space == Some(UNCALIBRATED) && !exif.is_adobe_rgb;
    }
    exif
}

/// Whether a TIFF is a camera's raw file: DNG, or a directory with the pixels of a sensor, or a preview before all else.
pub fn is_raw(bytes: &[u8]) -> bool {
    let Some((tiff, first)) = Tiff::open(bytes) else { return false };
    let raw_pixels = |directory| {
        tiff.number(directory, PHOTOMETRIC, 0).is_some_and(|photometric| RAW_PHOTOMETRICS.contains(&photometric))
    };
    let is_preview = tiff.number(first, SUBFILE_TYPE, 0).is_some_and(|kind| kind as u64 & 1 == 1);
    let sub_directories = (0..MOST_SUB_DIRECTORIES).map_while(|index| tiff.number(first, SUB_DIRECTORIES, index));
    bytes.get(8..10) == Some(b"CR")
        || tiff.number(first, DNG_VERSION, 0).is_some()
        || raw_pixels(first)
        || sub_directories.into_iter().any(|directory| is_preview || raw_pixels(directory as usize))
}

/// Whether a tag of the first directory claims more values than the file has bytes: decoders make room for all of them
/// before they read one.
pub fn claims_more_than_it_holds(bytes: &[u8]) -> bool {
    let Some((tiff, directory)) = Tiff::open(bytes) else { return false };
    tiff.entries(directory).filter_map(|entry| tiff.word(entry.checked_add(4)?)).any(|count| count > bytes.len())
}

/// The bytes of a TIFF with offsets of four bytes, or of a BigTIFF with eight.
struct Tiff<'a> {
    bytes: &'a [u8],
    little_endian: bool,
    is_big: bool,
}

impl<'a> Tiff<'a> {
    /// The file and the place of its first directory.
    fn open(bytes: &'a [u8]) -> Option<(Self, usize)> {
        let (little_endian, is_big) = match bytes.get(..4)? {
            b"II*\0" => (true, false),
            b"MM\0*" => (false, false),
            b"II+\0" => (true, true),
            b"MM\0+" => (false, true),
            _ => return None,
        };
        let tiff = Tiff { bytes, little_endian, is_big };
        let first = tiff.word(if is_big { 8 } else { 4 })?;
        Some((tiff, first))
    }

    /// A count or an offset.
    fn word(&self, place: usize) -> Option<usize> {
        if !self.is_big {
            return self.u32(place).map(|value| value as usize);
        }
        let bytes: [u8; 8] = self.bytes.get(place..place.checked_add(8)?)?.try_into().ok()?;
        let value = if self.little_endian { u64::from_le_bytes(bytes) } else { u64::from_be_bytes(bytes) };
        usize::try_from(value).ok()
    }

    fn u16(&self, place: usize) -> Option<u16> {
        let bytes: [u8; 2] = self.bytes.get(place..place.checked_add(2)?)?.try_into().ok()?;
        Some(if self.little_endian { u16::from_le_bytes(bytes) } else { u16::from_be_bytes(bytes) })
    }

    fn u32(&self, place: usize) -> Option<u32> {
        let bytes: [u8; 4] = self.bytes.get(place..place.checked_add(4)?)?.try_into().ok()?;
        Some(if self.little_endian { u32::from_le_bytes(bytes) } else { u32::from_be_bytes(bytes) })
    }

    /// Where the entries of a directory begin.
    fn entries(&self, directory: usize) -> impl Iterator<Item = usize> {
        let (head, size) = if self.is_big { (8, 20) } else { (2, 12) };
        let count = if self.is_big { self.word(directory) } else { self.u16(directory).map(usize::from) };
        // A directory has no more entries than a number of two bytes can say; what claims more is damaged.
        let count = count.filter(|count| *count <= usize::from(u16::MAX)).unwrap_or(0);
        (0..count).map_while(move |entry| directory.checked_add(head + size * entry))
    }

    /// The number `index` of a tag in a directory.
    fn number(&self, directory: usize, tag: u16, index: usize) -> Option<f64> {
        let entry = self.entries(directory).find(|&entry| self.u16(entry) == Some(tag))?;
        let kind = self.u16(entry + 2)?;
        let size = match kind {
            1 | 2 | 7 => 1,
            3 => 2,
            4 | 13 => 4,
            5 | 10 | 16 | 18 => 8,
            _ => return None,
        };
        let word = if self.is_big { 8 } else { 4 };
        let count = self.word(entry.checked_add(4)?)?;
        if index >= count {
            return None;
        }
        let value = entry.checked_add(4 + word)?;
        let inside = count.checked_mul(size)? <= word;
        let place = if inside { value } else { self.word(value)? };
        let place = place.checked_add(index.checked_mul(size)?)?;
        match kind {
            1 | 2 | 7 => self.bytes.get(place).map(|&byte| f64::from(byte)),
            3 => self.u16(place).map(f64::from),
            4 | 13 => self.u32(place).map(f64::from),
            16 | 18 => self.word(place).map(|value| value as f64),
            5 => Some(f64::from(self.u32(place)?) / f64::from(self.u32(place.checked_add(4)?)?)),
            _ => Some(f64::from(self.u32(place)? as i32) / f64::from(self.u32(place.checked_add(4)?)? as i32)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;
    use crate::image::file::{self, PhotoOptions};
    use std::path::Path;

    /// An EXIF block with an orientation and an exposure, in either byte order.
    fn block(little_endian: bool) -> Vec<u8> {
        let two = |value: u16| if little_endian { value.to_le_bytes() } else { value.to_be_bytes() };
        let four = |value: u32| if little_endian { value.to_le_bytes() } else { value.to_be_bytes() };
        let mut bytes = if little_endian { b"II*\0".to_vec() } else { b"MM\0*".to_vec() };
        let short = |bytes: &mut Vec<u8>, tag: u16, value: u16| {
            bytes.extend([two(tag), two(3)].concat());
            bytes.extend(four(1));
            bytes.extend([two(value), two(0)].concat());
        };
        let long = |bytes: &mut Vec<u8>, tag: u16, kind: u16, value: u32| {
            bytes.extend([two(tag), two(kind)].concat());
            bytes.extend([four(1), four(value)].concat());
        };
        bytes.extend(four(8));
        bytes.extend(two(2));
        short(&mut bytes, ORIENTATION, 6);
        long(&mut bytes, EXIF_DIRECTORY, 4, 38);
        bytes.extend(four(0));
        assert_eq!(bytes.len(), 38);
        bytes.extend(two(3));
        long(&mut bytes, EXPOSURE_TIME, 5, 80);
        long(&mut bytes, F_NUMBER, 5, 88);
        short(&mut bytes, SENSITIVITY, 400);
        bytes.extend(four(0));
        assert_eq!(bytes.len(), 80);
        bytes.extend([four(1), four(8), four(28), four(10)].concat());
        bytes
    }

    #[test]
    fn a_big_tiff_is_read_and_one_that_claims_too_much_is_nothing() {
        let entry = |tag: u16, kind: u16, count: u64, value: u64| {
            [&tag.to_be_bytes()[..], &kind.to_be_bytes(), &count.to_be_bytes(), &value.to_be_bytes()].concat()
        };
        let head = [&b"MM\0+\0\x08\0\0"[..], &16u64.to_be_bytes()].concat();
        let directory =
            [2u64.to_be_bytes().to_vec(), entry(ORIENTATION, 3, 1, 6 << 48), entry(EXIF_DIRECTORY, 18, 1, 64)];
        let exposure = [1u64.to_be_bytes().to_vec(), entry(EXPOSURE_TIME, 5, 1, (1 << 32) | 8)];
        let bytes = [head, directory.concat(), exposure.concat()].concat();
        let exif = read(&bytes);
        assert_eq!((exif.orientation, exif.exposure_seconds), (Some(6), Some(0.125)));
        assert!(!is_raw(&bytes) && !claims_more_than_it_holds(&bytes));
        assert!(claims_more_than_it_holds(&[&bytes[..28], &u64::MAX.to_be_bytes(), &bytes[36..]].concat()));
        for length in 0..bytes.len() {
            read(&bytes[..length]);
        }
        let mut damaged = bytes.clone();
        damaged[16..24].fill(0xff);
        assert_eq!(read(&damaged), Exif::default());
    }

    #[test]
    fn orientation_and_exposure_are_read_in_both_byte_orders() {
        for bytes in [block(true), block(false), [b"Exif\0\0".to_vec(), block(true)].concat()] {
            let exif = read(&bytes);
            assert_eq!(exif.orientation, Some(6));
            assert_eq!((exif.exposure_seconds, exif.f_number, exif.iso), (Some(0.125), Some(2.8), Some(400.0)));
            // An eighth of a second is -3 stops, ISO 400 is +2, f/2.8 is -2.97.
            let stops = exif.exposure_stops().unwrap();
            assert!((stops - (-1.0 - 2.0 * 2.8f32.log2())).abs() < 1e-5, "{stops}");
            assert!(!is_raw(&bytes));
        }
        assert_eq!(Exif::default().exposure_stops(), None);
    }

    /// An EXIF block whose colours are of a space by number and of a rule.
    pub fn block_of_colours(space: u16, rule: &[u8; 4]) -> Vec<u8> {
        let entry = |tag: u16, kind: u16, count: u32, value: [u8; 4]| {
            [&tag.to_le_bytes()[..], &kind.to_le_bytes(), &count.to_le_bytes(), &value].concat()
        };
        let directory =
            |entries: &[Vec<u8>]| [&(entries.len() as u16).to_le_bytes()[..], &entries.concat(), &[0; 4]].concat();
        let space = [space.to_le_bytes(), [0, 0]].concat().try_into().unwrap();
        let first = directory(&[entry(EXIF_DIRECTORY, 4, 1, 26u32.to_le_bytes())]);
        let second = directory(&[
            entry(COLOUR_SPACE, 3, 1, space),
            entry(INTEROPERABILITY_DIRECTORY, 4, 1, 56u32.to_le_bytes()),
        ]);
        let third = directory(&[entry(INTEROPERABILITY_INDEX, 2, 4, *rule)]);
        [b"II*\0\x08\0\0\0".to_vec(), first, second, third].concat()
    }

    #[test]
    fn adobe_rgb_is_told_by_the_rule_or_by_its_number() {
        for (space, rule, is_adobe) in
            [(65_535, b"R03\0", true), (65_535, b"R98\0", false), (1, b"R98\0", false), (2, b"R98\0", true)]
        {
            assert_eq!(read(&block_of_colours(space, rule)).is_adobe_rgb, is_adobe, "{space}");
        }
    }

    #[test]
    fn a_jpeg_of_adobe_rgb_is_converted() {
        let plain = file::encode_jpeg(&Image::filled(16, 16, [40, 200, 60]), 95).unwrap();
        let linear = |rule: &[u8; 4]| {
            let block = [b"Exif\0\0".to_vec(), block_of_colours(65_535, rule)].concat();
            let length = (block.len() as u16 + 2).to_be_bytes();
            let bytes = [&plain[..2], &[0xff, 0xe1], &length, &block, &plain[2..]].concat();
            let photo = file::read_photo_from(Path::new("a.jpg"), bytes, &PhotoOptions::default()).unwrap();
            (photo.findings[0].code, photo.into_linear()[(8, 8)])
        };
        let ((told, adobe), (told_of_other, srgb)) = (linear(b"R03\0"), linear(b"R98\0"));
        assert_eq!((told, told_of_other), ("colour-converted", "colour-uncalibrated"));
        // The green of Adobe RGB is purer than that of Rec. 709: its red lies below.
        assert!(adobe.x < srgb.x - 0.01, "{adobe} {srgb}");
    }

    #[test]
    fn colours_that_are_not_calibrated_are_told_where_no_encoding_is_given() {
        let plain = file::encode_jpeg(&Image::filled(16, 16, [40, 200, 60]), 95).unwrap();
        let block = [b"Exif\0\0".to_vec(), block_of_colours(65_535, b"R98\0")].concat();
        let length = (block.len() as u16 + 2).to_be_bytes();
        let bytes = [&plain[..2], &[0xff, 0xe1], &length, &block, &plain[2..]].concat();
        let codes = |encoding| {
            let options = PhotoOptions { encoding, ..PhotoOptions::default() };
            let photo = file::read_photo_from(Path::new("a.jpg"), bytes.clone(), &options).unwrap();
            photo.findings.iter().map(|finding| finding.code).collect::<Vec<_>>()
        };
        assert_eq!(codes(file::Encoding::Auto), ["colour-uncalibrated"]);
        for encoding in [file::Encoding::Linear, file::Encoding::Srgb, file::Encoding::Gamma22] {
            assert!(codes(encoding).is_empty(), "{encoding:?}");
        }
    }

    #[test]
    fn a_tag_with_more_values_than_bytes_is_a_claim() {
        for little_endian in [true, false] {
            let mut bytes = block(little_endian);
            assert!(!claims_more_than_it_holds(&bytes));
            // The count of the first tag: 256 or 65,536 times as many.
            bytes[8 + 2 + 4 + 1] = 1;
            assert!(claims_more_than_it_holds(&bytes));
        }
        assert!(!claims_more_than_it_holds(b"II*\0") && !claims_more_than_it_holds(b""));
    }

    #[test]
    fn every_cut_and_every_changed_byte_is_survived() {
        let bytes = block(true);
        for length in 0..bytes.len() {
            let exif = read(&bytes[..length]);
            assert!(exif.exposure_stops().is_none_or(f32::is_finite));
        }
        for place in 0..bytes.len() {
            for value in [0, 1, 0x7f, 0xff] {
                let mut changed = bytes.clone();
                changed[place] = value;
                let exif = read(&changed);
                assert!(exif.exposure_stops().is_none_or(f32::is_finite));
                assert!(exif.orientation.is_none_or(|orientation| (1..=8).contains(&orientation)));
                is_raw(&changed);
            }
        }
    }
}
