//! Structural similarity (Wang et al. 2004) over windows as two libraries make them.

use crate::image::Image;

/// Constants of the similarity for values of [0, 1].
const C1: f64 = 0.01 * 0.01;
const C2: f64 = 0.03 * 0.03;

/// A window: weights along one axis, how pictures go on past their border, and what the variance is multiplied by.
pub(super) struct Window {
    /// Weights, an odd number of them, with the sum 1.
    pub weights: Vec<f64>,
    /// Whether the border pixel itself is repeated (`d c b a | a b c d`) or not (`d c b | a b c d`).
    pub repeats_border: bool,
    /// N / (N - 1) for the variance of a sample, or 1.
    pub of_sample: f64,
}

impl Window {
    /// The similarity at each pixel.
    pub fn similarity(&self, a: &Image<f64>, b: &Image<f64>) -> Image<f64> {
        let product = |a: &Image<f64>, b: &Image<f64>| {
            Image::from_pixels(a.width(), a.height(), a.pixels().iter().zip(b.pixels()).map(|(x, y)| x * y).collect())
        };
        let means = [a, b].map(|image| self.filtered(image));
        let squares = [product(a, a), product(b, b), product(a, b)].map(|image| self.filtered(&image));
        Image::from_fn(a.width(), a.height(), |row, column| {
            let place = (row, column);
            let (x, y) = (means[0][place], means[1][place]);
            let variance = |square: f64, mean: f64| self.of_sample * (square - mean);
            let (xx, yy) = (variance(squares[0][place], x * x), variance(squares[1][place], y * y));
            let xy = variance(squares[2][place], x * y);
            ((2.0 * x * y + C1) * (2.0 * xy + C2)) / ((x * x + y * y + C1) * (xx + yy + C2))
        })
    }

    fn filtered(&self, image: &Image<f64>) -> Image<f64> {
        let radius = (self.weights.len() / 2) as i64;
        let (width, height) = (image.width(), image.height());
        let sum = |at: &dyn Fn(usize) -> f64, place: usize, length: usize| -> f64 {
            let weighted = self.weights.iter().zip(-radius..);
            weighted.map(|(weight, step)| weight * at(self.inside(place as i64 + step, length))).sum()
        };
        let across = Image::from_fn(width, height, |row, column| sum(&|c| image[(row, c)], column, width));
        Image::from_fn(width, height, |row, column| sum(&|r| across[(r, column)], row, height))
    }

    /// The pixel that stands for one past the border.
    fn inside(&self, place: i64, length: usize) -> usize {
        let length = length as i64;
        let mut place = place;
        // Pictures smaller than a window are mirrored more than once.
        for _ in 0..8 {
            if place < 0 {
                place = if self.repeats_border { -place - 1 } else { -place };
            } else if place >= length {
                place = if self.repeats_border { 2 * length - 1 - place } else { 2 * length - 2 - place };
            }
        }
        place.clamp(0, length - 1) as usize
    }
}
