//! How much of a picture is how bright: luminance in stops, and the exposure that shows most of it.

use super::raster::RgbImage;
use crate::math::{luminance, statistics};

/// Lowest stop that is told apart; darker pixels count in the first bin.
pub const LOWEST_STOP: i32 = -20;
/// Highest stop that is told apart; brighter pixels count in the last bin.
pub const HIGHEST_STOP: i32 = 20;
/// Bins in one stop.
pub const BINS_PER_STOP: usize = 4;
/// Pixels that are looked at, about; of a larger picture every n-th row and column.
const MOST_PIXELS: usize = 1 << 20;
/// Pixels whose luminances are sorted for an exposure, about.
const MOST_SORTED: usize = 1 << 17;

/// Pixels of a picture by luminance, in bins of a quarter stop.
#[derive(Clone, Debug, PartialEq)]
pub struct Histogram {
    /// Number of pixels with a luminance in `2^s .. 2^(s + 1/4)`, with `s` from [`Histogram::stop_of`].
    pub counts: Vec<u64>,
    /// Pixels whose luminance is 0 or below.
    pub black: u64,
    /// Pixels with a channel that is not finite; they are in no bin.
    pub not_finite: u64,
    /// All pixels that were looked at.
    pub total: u64,
}

impl Histogram {
    /// The histogram of a picture; a picture of millions of pixels is sampled evenly.
    pub fn of(image: &RgbImage) -> Self {
        let bins = (HIGHEST_STOP - LOWEST_STOP) as usize * BINS_PER_STOP;
        let mut histogram = Histogram { counts: vec![0; bins], black: 0, not_finite: 0, total: 0 };
        for pixel in sampled(image, MOST_PIXELS) {
            histogram.total += 1;
            let value = luminance(pixel);
            if !pixel.is_finite() {
                histogram.not_finite += 1;
            } else if value <= 0.0 {
                histogram.black += 1;
            } else {
                let place = (value.log2() - LOWEST_STOP as f32) * BINS_PER_STOP as f32;
                histogram.counts[(place.max(0.0) as usize).min(bins - 1)] += 1;
            }
        }
        histogram
    }

    /// The stop at the lower edge of a bin: its luminances start at 2 to this power.
    pub fn stop_of(bin: usize) -> f32 {
        LOWEST_STOP as f32 + bin as f32 / BINS_PER_STOP as f32
    }

    /// First and last bin that hold pixels; `None` when none does.
    pub fn extent(&self) -> Option<(usize, usize)> {
        let first = self.counts.iter().position(|&count| count > 0)?;
        let last = self.counts.iter().rposition(|&count| count > 0)?;
        Some((first, last))
    }

    /// Share of all pixels in bins that start at this stop or above, in [0, 1].
    pub fn share_from(&self, stop: f32) -> f32 {
        let counts = self.counts.iter().enumerate().filter(|(bin, _)| Self::stop_of(*bin) >= stop - 1e-4);
        counts.map(|(_, &count)| count).sum::<u64>() as f32 / self.total.max(1) as f32
    }
}

/// Stops of exposure that bring the 95th percentile of the positive luminances to 0.8; 0 when there is none.
pub fn auto_exposure(image: &RgbImage) -> f32 {
    let positive = sampled(image, MOST_SORTED).map(luminance).filter(|&value| value > 0.0 && value.is_finite());
    let luminances: Vec<f64> = positive.map(f64::from).collect();
    let bright = statistics::quantile(&luminances, 0.95);
    if bright.is_finite() && bright > 0.0 { (0.8 / bright).log2() as f32 } else { 0.0 }
}

/// Every n-th row and column, so that about `most` pixels are left.
fn sampled(image: &RgbImage, most: usize) -> impl Iterator<Item = glam::Vec3> {
    let step = ((image.pixels().len() as f64 / most as f64).sqrt().ceil() as usize).max(1);
    let rows = image.pixels().chunks(image.width().max(1)).step_by(step);
    rows.flat_map(move |row| row.iter().copied().step_by(step))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;
    use glam::Vec3;

    #[test]
    fn pixels_fall_into_the_bins_of_their_stops() {
        let pixels = [0.25, 0.25, 1.0, 3.0, 0.0, -2.0, f32::NAN, f32::INFINITY, 1e30, 1e-30].map(Vec3::splat);
        let histogram = Histogram::of(&Image::from_pixels(10, 1, pixels.to_vec()));
        assert_eq!((histogram.total, histogram.black, histogram.not_finite), (10, 2, 2));
        assert_eq!(histogram.counts.iter().sum::<u64>(), 6);
        // Weights of luminance sum to 1 but for rounding: a bin below is as good.
        let near = |stop: f32| {
            let bin = ((stop - LOWEST_STOP as f32) * BINS_PER_STOP as f32) as usize;
            histogram.counts[bin - 1] + histogram.counts[bin]
        };
        assert_eq!((near(-2.0), near(0.0), near(1.5)), (2, 1, 1));
        assert_eq!(histogram.extent(), Some((0, histogram.counts.len() - 1)));
        assert!((histogram.share_from(1.0) - 0.2).abs() < 1e-6);
        assert_eq!(Histogram::of(&RgbImage::default()).extent(), None);
    }

    #[test]
    fn a_large_picture_is_sampled_evenly() {
        let image = Image::from_fn(2048, 1536, |_, column| Vec3::splat(if column < 1024 { 0.1 } else { 10.0 }));
        let histogram = Histogram::of(&image);
        assert!(histogram.total <= MOST_PIXELS as u64 && histogram.total > MOST_PIXELS as u64 / 4);
        assert!((histogram.share_from(0.0) - 0.5).abs() < 0.01);
    }

    #[test]
    fn the_bright_end_comes_to_four_fifths() {
        let ramp = Image::from_fn(1000, 1, |_, column| Vec3::splat(8.0 * (column + 1) as f32 / 1000.0));
        let bright = 8.0 * 0.95 * auto_exposure(&ramp).exp2();
        assert!((bright - 0.8).abs() < 0.01, "{bright}");
        assert_eq!(auto_exposure(&RgbImage::default()), 0.0);
        assert_eq!(auto_exposure(&Image::filled(3, 3, Vec3::splat(f32::NAN))), 0.0);
        assert_eq!(auto_exposure(&Image::filled(3, 3, Vec3::ZERO)), 0.0);
    }
}
