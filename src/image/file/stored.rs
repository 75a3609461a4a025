//! Pixels as PNG, JPEG and TIFF hold them, before curves and matrices; and the way from there to linear Rec. 709.

mod interpretation;

use super::colour::{ColourSpace, Curve};
use super::exif::Exif;
use super::format::Source;
use super::photo::{Encoding, PhotoFile, PhotoPixels};
use super::profile;
use crate::error::{Finding, Result};
use crate::image::{GreyImage, Image, RgbImage};
use glam::Vec3;
use interpretation::{Interpretation, interpretation};

pub use interpretation::refused;

/// From here on a channel of 8 bits is clipped, and one of 16 bits at the same share of full scale: cameras and JPEG move a
/// saturated value by a step.
const CLIPPED_BYTE: u8 = 254;

/// Samples in row-major order, the channels of a pixel side by side.
pub enum Samples {
    /// 8 bits.
    Bytes(Vec<u8>),
    /// 16 bits.
    Words(Vec<u16>),
    /// Floats.
    Floats(Vec<f32>),
}

impl Samples {
    fn len(&self) -> usize {
        match self {
            Samples::Bytes(values) => values.len(),
            Samples::Words(values) => values.len(),
            Samples::Floats(values) => values.len(),
        }
    }

    /// A sample as share of full scale; floats as they are.
    fn share(&self, index: usize) -> f32 {
        match self {
            Samples::Bytes(values) => f32::from(values[index]) / 255.0,
            Samples::Words(values) => f32::from(values[index]) / 65_535.0,
            Samples::Floats(values) => values[index],
        }
    }
}

/// What a file declares of its colours beside a profile.
#[derive(Clone, Debug, Default, PartialEq)]
#[allow(clippy::large_enum_variant, reason = "there is one for each file that is open")]
pub enum Declared {
    /// Nothing, or that they are sRGB.
    #[default]
    Nothing,
    /// A colour space, and what names it, in words after "by".
    Space(ColourSpace, &'static str),
    /// What is not read, by its name.
    NotRead(String),
    /// That they are not sRGB, but not what they are.
    Uncalibrated,
}

/// What a decoder hands over.
pub struct Stored {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Channels of a pixel: grey, grey and alpha, colour, colour and alpha.
    pub channels: usize,
    /// The samples.
    pub samples: Samples,
    /// Whether the last of two or four channels is opacity; otherwise it is of unknown meaning and left out.
    pub has_alpha: bool,
    /// Whether colours were multiplied by the opacity.
    pub is_premultiplied: bool,
    /// The embedded profile.
    pub icc: Option<Vec<u8>>,
    /// What the file declares without a profile.
    pub declared: Declared,
    /// What was noticed.
    pub findings: Vec<Finding>,
}

impl Stored {
    /// Errors where the samples are not those of a whole picture of the source's size.
    pub fn checked(self, source: &Source) -> Result<Self> {
        let (width, height) = (self.width, self.height);
        if self.samples.len() != width * height * self.channels
            || !(1..=4).contains(&self.channels)
            || (width, height) != (source.header.width, source.header.height)
        {
            return Err(super::format::implausible(
                &source.path,
                format!("the decoded image is not the {width} x {height} of its header"),
            ));
        }
        Ok(self)
    }

    /// With what EXIF says of the colours of integers, where the file itself says nothing.
    pub fn with_exif(mut self, exif: &Exif) -> Self {
        let may_say = self.declared == Declared::Nothing && !matches!(self.samples, Samples::Floats(_));
        if exif.is_adobe_rgb && may_say {
            self.declared = Declared::Space(ColourSpace::adobe_rgb(), "EXIF, which names Adobe RGB,");
        } else if exif.is_uncalibrated && may_say {
            self.declared = Declared::Uncalibrated;
        }
        self
    }

    fn pixel_count(&self) -> usize {
        self.width * self.height
    }

    /// The samples of a pixel's colour as shares of full scale; grey is repeated.
    fn shares(&self, pixel: usize) -> Vec3 {
        let first = pixel * self.channels;
        match self.channels {
            1 | 2 => Vec3::splat(self.samples.share(first)),
            _ => Vec3::new(self.samples.share(first), self.samples.share(first + 1), self.samples.share(first + 2)),
        }
    }

    /// Whether some channel of a pixel's colour is at full scale; floats have none.
    fn is_clipped(&self, pixel: usize) -> bool {
        let colours = if self.channels < 3 { 1 } else { 3 };
        let range = pixel * self.channels..pixel * self.channels + colours;
        match &self.samples {
            Samples::Bytes(values) => values[range].iter().any(|&value| value >= CLIPPED_BYTE),
            Samples::Words(values) => values[range].iter().any(|&value| value >= u16::from(CLIPPED_BYTE) * 257),
            Samples::Floats(_) => false,
        }
    }

    /// One value a pixel as stored; colour gives its luminance.
    pub fn grey(&self) -> GreyImage {
        let pixels = (0..self.pixel_count()).map(|pixel| super::grey_of_rgb(self.shares(pixel))).collect();
        Image::from_pixels(self.width, self.height, pixels)
    }

    /// Opacity, where there is any.
    pub fn alpha(&self) -> Option<GreyImage> {
        let places = (self.has_alpha && matches!(self.channels, 2 | 4)).then(|| 0..self.pixel_count())?;
        let last = self.channels - 1;
        let values = places.map(|pixel| self.samples.share(pixel * self.channels + last)).collect();
        Some(Image::from_pixels(self.width, self.height, values))
    }

    /// Bytes as stored, without alpha; 16 bits are rounded.
    pub fn bytes(&self) -> Image<[u8; 3]> {
        let byte = |index: usize| match &self.samples {
            Samples::Bytes(values) => values[index],
            samples => (samples.share(index) * 255.0 + 0.5) as u8,
        };
        let pixels = (0..self.pixel_count()).map(|pixel| {
            let first = pixel * self.channels;
            if self.channels < 3 { [byte(first); 3] } else { [byte(first), byte(first + 1), byte(first + 2)] }
        });
        Image::from_pixels(self.width, self.height, pixels.collect())
    }

    /// The photo in linear Rec. 709, or in bytes of sRGB where that is what the file holds.
    pub fn into_photo(mut self, source: &Source, encoding: Encoding) -> Result<PhotoFile> {
        let is_float = matches!(self.samples, Samples::Floats(_));
        let mut findings = std::mem::take(&mut self.findings);
        let told = interpretation(&self, source, encoding, is_float, &mut findings)?;
        let alpha = self.alpha();
        let clipped = (!is_float).then(|| {
            let clipped = (0..self.pixel_count()).map(|pixel| self.is_clipped(pixel)).collect();
            Image::from_pixels(self.width, self.height, clipped)
        });
        let is_eight_bit = matches!(self.samples, Samples::Bytes(_));
        let premultiplied = alpha.as_ref().filter(|_| self.is_premultiplied);
        let pixels = match told {
            Interpretation::Space(space) if is_eight_bit && space.is_srgb() && premultiplied.is_none() => {
                PhotoPixels::Srgb8(self.bytes())
            }
            told => PhotoPixels::Linear(self.linear(told, premultiplied)),
        };
        Ok(PhotoFile { pixels, is_eight_bit, clipped, alpha, findings, ..PhotoFile::default() })
    }

    /// Linear Rec. 709 of all pixels; colours that were multiplied by their opacity are divided by it.
    fn linear(&self, told: Interpretation, premultiplied: Option<&GreyImage>) -> RgbImage {
        let straight = |pixel: usize, shares: Vec3| match premultiplied.map(|alpha| alpha.pixels()[pixel]) {
            Some(alpha) if alpha > 0.0 => (shares / alpha).min(Vec3::ONE),
            _ => shares,
        };
        let shares = (0..self.pixel_count()).map(|pixel| straight(pixel, self.shares(pixel)));
        let pixels: Vec<Vec3> = match told {
            Interpretation::Tables(transform) => {
                let shares: Vec<Vec3> = shares.collect();
                profile::through_tables(transform.as_ref(), &shares).unwrap_or(shares)
            }
            Interpretation::Space(space) => {
                let tables = Tables::new(&space, &self.samples, self.pixel_count());
                let matrix = space.rec709_from_rgb;
                shares
                    .enumerate()
                    .map(|(pixel, shares)| {
                        let linear = match (&tables, premultiplied) {
                            (Some(tables), None) => tables.linear(self, pixel),
                            _ => Vec3::from_array(std::array::from_fn(|c| space.curves[c].linear(shares[c]))),
                        };
                        matrix.map_or(linear, |matrix| matrix * linear)
                    })
                    .collect()
            }
        };
        Image::from_pixels(self.width, self.height, pixels)
    }
}

/// The linear value of each integer, for each channel.
struct Tables([Vec<f32>; 3]);

impl Tables {
    /// `None` for floats, and where a table would have more entries than there are pixels.
    fn new(space: &ColourSpace, samples: &Samples, pixels: usize) -> Option<Self> {
        let last = match samples {
            Samples::Bytes(_) => u8::MAX.into(),
            Samples::Words(_) => u16::MAX,
            Samples::Floats(_) => return None,
        };
        if pixels < usize::from(last) {
            return None;
        }
        let table = |curve: &Curve| -> Vec<f32> {
            (0..=last).map(|value| curve.linear(f32::from(value) / f32::from(last))).collect()
        };
        let [red, green, blue] = &space.curves;
        let first = table(red);
        let other = |curve: &Curve| if curve == red { first.clone() } else { table(curve) };
        Some(Tables([first.clone(), other(green), other(blue)]))
    }

    fn linear(&self, stored: &Stored, pixel: usize) -> Vec3 {
        let at = |channel: usize| {
            let index = pixel * stored.channels + if stored.channels < 3 { 0 } else { channel };
            match &stored.samples {
                Samples::Bytes(values) => self.0[channel][usize::from(values[index])],
                Samples::Words(values) => self.0[channel][usize::from(values[index])],
                Samples::Floats(values) => values[index],
            }
        };
        Vec3::new(at(0), at(1), at(2))
    }
}
