//! A photograph as its file has it: linear Rec. 709 or bytes of sRGB, with all that the file says of them.

use crate::error::Finding;
use crate::image::transfer;
use crate::image::{GreyImage, Image, RgbImage};

/// How the numbers of a file are encoded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Encoding {
    /// As the file says by its profile; integers without one are sRGB, floats are linear.
    #[default]
    Auto,
    /// sRGB (IEC 61966-2-1), with the primaries of the file.
    Srgb,
    /// Linear, with the primaries of the file.
    Linear,
    /// A power of 2.2, with the primaries of the file.
    Gamma22,
}

/// How a photo is read.
#[derive(Clone, Copy, Debug, Default)]
pub struct PhotoOptions<'a> {
    /// How its numbers are encoded.
    pub encoding: Encoding,
    /// The layer of an OpenEXR file by its name, or the last part of it; `None` takes the layer of radiance.
    pub layer: Option<&'a str>,
}

/// The pixels of a photo.
#[derive(Clone, Debug, PartialEq)]
pub enum PhotoPixels {
    /// Bytes of sRGB.
    Srgb8(Image<[u8; 3]>),
    /// Linear Rec. 709; values outside [0, 1] and values that are not finite are possible.
    Linear(RgbImage),
}

/// A photo and what its file says. All images have its size.
#[derive(Clone, Debug)]
pub struct PhotoFile {
    /// The pixels.
    pub pixels: PhotoPixels,
    /// Whether the file holds 8 bits a channel.
    pub is_eight_bit: bool,
    /// Pixels of which some stored channel is at full scale; `None` for files without a full scale.
    pub clipped: Option<Image<bool>>,
    /// Opacity in [0, 1], where the file has any.
    pub alpha: Option<GreyImage>,
    /// Pixels that the file holds; `None` for all. Others lie outside the data window of an OpenEXR file and are black.
    pub is_inside: Option<Image<bool>>,
    /// EXIF orientation, 1 to 8; the pixels are as stored.
    pub orientation: u8,
    /// Logarithm to base 2 of what the exposure makes of a radiance, by EXIF; it compares photos of one camera.
    pub exposure_stops: Option<f32>,
    /// What was done or noticed, without a place.
    pub findings: Vec<Finding>,
}

impl Default for PhotoFile {
    fn default() -> Self {
        PhotoFile {
            pixels: PhotoPixels::Linear(Image::default()),
            is_eight_bit: false,
            clipped: None,
            alpha: None,
            is_inside: None,
            orientation: 1,
            exposure_stops: None,
            findings: Vec::new(),
        }
    }
}

impl PhotoFile {
    /// Width and height as stored, in pixels.
    pub fn size(&self) -> (usize, usize) {
        match &self.pixels {
            PhotoPixels::Srgb8(image) => (image.width(), image.height()),
            PhotoPixels::Linear(image) => (image.width(), image.height()),
        }
    }

    /// The pixels in linear Rec. 709.
    pub fn into_linear(self) -> RgbImage {
        match self.pixels {
            PhotoPixels::Srgb8(image) => image.map(|pixel| transfer::linear_from_srgb8(*pixel)),
            PhotoPixels::Linear(image) => image,
        }
    }

    /// The photo turned as its orientation says; it is upright then.
    pub fn turned(self) -> Self {
        let by = self.orientation;
        PhotoFile {
            pixels: match self.pixels {
                PhotoPixels::Srgb8(image) => PhotoPixels::Srgb8(turned(image, by)),
                PhotoPixels::Linear(image) => PhotoPixels::Linear(turned(image, by)),
            },
            clipped: self.clipped.map(|image| turned(image, by)),
            alpha: self.alpha.map(|image| turned(image, by)),
            is_inside: self.is_inside.map(|image| turned(image, by)),
            orientation: 1,
            ..self
        }
    }
}

/// Whether an EXIF orientation exchanges rows and columns.
pub fn swaps_sides(orientation: u8) -> bool {
    (5..=8).contains(&orientation)
}

/// Row and column in a stored picture of `size` (width and height) of a place in the upright one, by its EXIF orientation (CIPA
/// DC-008, 4.6.4): 1 is upright, 3 turned by 180 degrees, 6 needs a quarter turn clockwise, 8 one counterclockwise, 2, 4, 5 and
/// 7 are their mirrors. Other numbers are 1.
pub fn place_in_stored(orientation: u8, size: (usize, usize), (row, column): (usize, usize)) -> (usize, usize) {
    let (last_column, last_row) = (size.0.wrapping_sub(1), size.1.wrapping_sub(1));
    match orientation {
        2 => (row, last_column - column),
        3 => (last_row - row, last_column - column),
        4 => (last_row - row, column),
        5 => (column, row),
        6 => (last_row - column, row),
        7 => (last_row - column, last_column - row),
        8 => (column, last_column - row),
        _ => (row, column),
    }
}

/// The upright picture of a stored one, by its EXIF orientation.
pub fn turned<T: Copy>(image: Image<T>, orientation: u8) -> Image<T> {
    let stored = (image.width(), image.height());
    let size = if swaps_sides(orientation) { (stored.1, stored.0) } else { stored };
    if !(2..=8).contains(&orientation) {
        return image;
    }
    Image::from_fn(size.0, size.1, |row, column| image[place_in_stored(orientation, stored, (row, column))])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_turned_as_the_tag_says() {
        // Stored: a b c over d e f.
        let image = Image::from_pixels(3, 2, b"abcdef".to_vec());
        let upright = |orientation| String::from_utf8(turned(image.clone(), orientation).into_pixels()).unwrap();
        let expected = ["abcdef", "cbafed", "fedcba", "defabc", "adbecf", "daebfc", "fcebda", "cfbead"];
        for (index, expected) in expected.iter().enumerate() {
            assert_eq!(upright(index as u8 + 1), *expected, "orientation {}", index + 1);
        }
        assert_eq!(turned(image.clone(), 6).width(), 2);
        assert_eq!(turned(image, 9).width(), 3);
    }
}
