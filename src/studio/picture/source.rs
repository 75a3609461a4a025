//! What is shown: a picture of colours or of numbers, a place on it, the value there, and both in words.

use crate::image::value_scale::{Palette, ValueScale, three_digits};
use crate::image::{GreyImage, RgbImage};
use crate::math::luminance;
use glam::Vec3;
use std::fmt::Write;
use std::sync::Arc;

/// A picture to show. Texels that are NaN have no value: they are hatched.
#[derive(Clone, Debug)]
pub enum Source {
    /// Linear radiance or reflectance; exposure and tone curve apply.
    Colour(Arc<RgbImage>),
    /// One number a texel, shown by a colour scale; exposure and tone curve do not apply.
    Numbers {
        /// The numbers.
        image: Arc<GreyImage>,
        /// The range that the colours span.
        scale: ValueScale,
        /// The colours.
        palette: Palette,
    },
}

impl Source {
    /// Numbers on the common colour scale.
    pub fn numbers(image: Arc<GreyImage>, scale: ValueScale) -> Self {
        Source::Numbers { image, scale, palette: Palette::default() }
    }

    /// (width, height) in texels; either may be 0.
    pub fn size(&self) -> (usize, usize) {
        match self {
            Source::Colour(image) => (image.width(), image.height()),
            Source::Numbers { image, .. } => (image.width(), image.height()),
        }
    }

    /// The value of a texel; `None` outside the picture.
    pub fn value(&self, row: usize, column: usize) -> Option<Value> {
        let (width, height) = self.size();
        (row < height && column < width).then(|| match self {
            Source::Colour(image) => Value::Colour(image[(row, column)]),
            Source::Numbers { image, .. } => Value::Number(image[(row, column)]),
        })
    }

    /// The value under a place.
    pub fn value_at(&self, place: Place) -> Option<Value> {
        let (row, column) = place.texel()?;
        self.value(row, column)
    }
}

impl From<Arc<RgbImage>> for Source {
    fn from(image: Arc<RgbImage>) -> Self {
        Source::Colour(image)
    }
}

/// A place on a picture, in texels from its upper left corner: the centre of the first texel is at (0.5, 0.5).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Place {
    /// Down from the upper border.
    pub row: f32,
    /// Right from the left border.
    pub column: f32,
}

impl Place {
    /// The texel (row, column) under the place; `None` above or left of the picture.
    pub fn texel(self) -> Option<(usize, usize)> {
        (self.row >= 0.0 && self.column >= 0.0).then_some((self.row as usize, self.column as usize))
    }
}

/// The value of a texel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// Linear RGB.
    Colour(Vec3),
    /// A number.
    Number(f32),
}

impl Value {
    /// As linear RGB; a number three times.
    pub fn rgb(self) -> Vec3 {
        match self {
            Value::Colour(colour) => colour,
            Value::Number(number) => Vec3::splat(number),
        }
    }

    /// Whether the texel has no value.
    pub fn is_unseen(self) -> bool {
        self.rgb().is_nan()
    }

    /// The numbers as lines of three digits, for drawing on a texel.
    pub(super) fn lines(self) -> String {
        match self {
            Value::Colour(rgb) => rgb.to_array().map(three_digits).join("\n"),
            Value::Number(number) => three_digits(number),
        }
    }
}

/// One line for a status bar: place and value, of a width that does not change as the mouse moves, in a font of equal
/// widths. `more` adds named numbers, such as what other maps hold there.
pub fn describe(place: Place, value: Option<Value>, more: &[(&str, f32)]) -> String {
    let (row, column) = place.texel().unwrap_or_default();
    let mut line = format!("row {row:>5}  column {column:>5}");
    // Writing to a string cannot fail.
    let _ = match value {
        None => Ok(()),
        Some(value) if value.is_unseen() => write!(line, "  {:<50}", "no value"),
        Some(Value::Colour(rgb)) => {
            let [red, green, blue] = rgb.to_array().map(three_digits);
            let luminance = three_digits(luminance(rgb));
            write!(line, "  {red:>9} {green:>9} {blue:>9}  luminance {luminance:>9}")
        }
        Some(Value::Number(number)) => write!(line, "  {:>9}", three_digits(number)),
    };
    for (name, number) in more {
        let _ = write!(line, "  {name} {:>9}", three_digits(*number));
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_keeps_its_width_and_tells_the_numbers() {
        let place = Place { row: 120.7, column: 88.2 };
        let line = |rgb: Vec3| describe(place, Some(Value::Colour(rgb)), &[("roughness", 0.25)]);
        let usual = line(Vec3::new(0.0123, 0.0456, 0.789));
        assert!(usual.starts_with("row   120  column    88"), "{usual}");
        for part in ["0.0123", "0.0456", "0.789", "luminance", "roughness     0.250"] {
            assert!(usual.contains(part), "{usual}");
        }
        for rgb in [Vec3::ZERO, Vec3::splat(-1.234e-30), Vec3::splat(f32::INFINITY), Vec3::NAN] {
            assert_eq!(line(rgb).len(), usual.len(), "{}", line(rgb));
        }
        assert!(line(Vec3::NAN).contains("no value"));
    }

    #[test]
    fn values_are_found_only_within_the_picture() {
        let source =
            Source::Colour(Arc::new(RgbImage::from_fn(3, 2, |row, column| Vec3::new(row as f32, column as f32, 0.0))));
        let at = |row: f32, column: f32| source.value_at(Place { row, column });
        assert_eq!(at(1.9, 2.1), Some(Value::Colour(Vec3::new(1.0, 2.0, 0.0))));
        for (row, column) in [(-0.1, 0.0), (2.0, 0.0), (0.0, 3.0), (f32::NAN, 0.0), (f32::INFINITY, 0.0)] {
            assert_eq!(at(row, column), None);
        }
    }
}
