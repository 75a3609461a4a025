//! A row-major table of pixels.

use glam::Vec3;
use std::ops::{Index, IndexMut};

/// A row-major table of pixels, row 0 at the top. Indexed as `image[(row, column)]`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Image<T> {
    width: usize,
    height: usize,
    pixels: Vec<T>,
}

/// Linear RGB, no upper bound.
pub type RgbImage = Image<Vec3>;
/// One linear value a pixel.
pub type GreyImage = Image<f32>;

impl<T> Image<T> {
    /// An image from its pixels in row-major order.
    ///
    /// # Panics
    /// When the number of pixels is not `width * height`: a defect of the caller, never of user data.
    pub fn from_pixels(width: usize, height: usize, pixels: Vec<T>) -> Self {
        assert_eq!(pixels.len(), width * height, "an image of {width} x {height}");
        Image { width, height, pixels }
    }

    /// An image computed from (row, column).
    pub fn from_fn(width: usize, height: usize, mut pixel: impl FnMut(usize, usize) -> T) -> Self {
        let mut pixels = Vec::with_capacity(width * height);
        for row in 0..height {
            pixels.extend((0..width).map(|column| pixel(row, column)));
        }
        Image { width, height, pixels }
    }

    /// Width in pixels.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        self.height
    }

    /// All pixels in row-major order.
    pub fn pixels(&self) -> &[T] {
        &self.pixels
    }

    /// All pixels in row-major order, to change.
    pub fn pixels_mut(&mut self) -> &mut [T] {
        &mut self.pixels
    }

    /// The pixels themselves.
    pub fn into_pixels(self) -> Vec<T> {
        self.pixels
    }

    /// The image of `change(pixel)`.
    pub fn map<U>(&self, change: impl FnMut(&T) -> U) -> Image<U> {
        Image { width: self.width, height: self.height, pixels: self.pixels.iter().map(change).collect() }
    }
}

impl<T: Clone> Image<T> {
    /// An image of one value.
    pub fn filled(width: usize, height: usize, value: T) -> Self {
        Image { width, height, pixels: vec![value; width * height] }
    }
}

impl<T> Index<(usize, usize)> for Image<T> {
    type Output = T;
    fn index(&self, (row, column): (usize, usize)) -> &T {
        debug_assert!(column < self.width);
        &self.pixels[row * self.width + column]
    }
}

impl<T> IndexMut<(usize, usize)> for Image<T> {
    fn index_mut(&mut self, (row, column): (usize, usize)) -> &mut T {
        debug_assert!(column < self.width);
        &mut self.pixels[row * self.width + column]
    }
}
