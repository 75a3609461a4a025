//! Differences between images: RMSE, PSNR, SSIM, and their scale-aligned twins.
//!
//! All sums are in `f64` in a fixed order. Values are compared as given, with a peak of 1: whoever wants scores of
//! displayed pictures passes displayed pictures. A mask picks the pixels that count. Pixels in which one of the two
//! images is not finite are counted and left out; they are never a silent zero.
//!
//! The twins exist because albedo and light are known only up to one factor per channel (the gauge): the aligned
//! scores are those of the estimate times the factor that brings it nearest to the truth.

use super::raster::{GreyImage, Image, RgbImage};
use crate::error::{Error, ErrorKind, Result};
use crate::math::{luminance, parallel};
use glam::{DVec3, Vec3};

/// The scores of one image against another.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Scores {
    /// Root of the mean squared difference over pixels and channels.
    pub rmse: f64,
    /// `-20 log10(rmse)` in decibels, for a peak of 1; infinite when the images are equal.
    pub psnr: f64,
    /// Mean structural similarity of the luminance, see [`ssim_map`]; 1 when the images are equal.
    pub ssim: f64,
    /// Root of the sum of squared differences over the sum of squares of the truth. Infinite for a black truth, NaN when
    /// the estimate is black as well.
    pub relative_rmse: f64,
    /// Number of pixels that were compared; with 0 of them the scores are NaN.
    pub pixels: usize,
    /// Number of pixels of the mask that were left out because one of the images is not finite there.
    pub not_finite: usize,
}

/// The scores as they are and after the best factor per channel.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Comparison {
    /// Scores of the estimate itself.
    pub raw: Scores,
    /// Scores of the estimate times `scale`.
    pub aligned: Scores,
    /// The factor per channel, see [`best_scale_per_channel`].
    pub scale: [f32; 3],
}

/// Compares an estimate with the truth over the pixels of a mask, or over all. Error: images of different sizes.
pub fn compare(estimate: &RgbImage, truth: &RgbImage, mask: Option<&Image<bool>>) -> Result<Comparison> {
    let raw = scores(estimate, truth, mask)?;
    let scale = best_scale_per_channel(estimate, truth, mask)?;
    let aligned = scores(&estimate.map(|&rgb| rgb * scale), truth, mask)?;
    Ok(Comparison { raw, aligned, scale: scale.to_array() })
}

/// The scores of an estimate over the pixels of a mask, or over all. Error: images of different sizes.
pub fn scores(estimate: &RgbImage, truth: &RgbImage, mask: Option<&Image<bool>>) -> Result<Scores> {
    scores_without_noise(estimate, None, truth, mask)
}

/// The scores that an estimate would have without its noise. `half_difference` is half the difference of two estimates
/// with independent noise whose mean is `estimate`: its square is, in the mean, the variance of the noise, and is taken off
/// squared differences and off the estimate's variance in windows of the similarity. An error too small to be told from
/// that noise counts as large as one standard error of the difference: the root mean square error is never below what the
/// samples can show, and the ratio never infinite on account of noise. Error: images of different sizes.
pub fn scores_without_noise(
    estimate: &RgbImage,
    half_difference: Option<&RgbImage>,
    truth: &RgbImage,
    mask: Option<&Image<bool>>,
) -> Result<Scores> {
    let mut counted = counted_pixels(estimate, truth, mask)?;
    if let Some(noise) = half_difference {
        let of_noise = counted_pixels(noise, truth, Some(&counted.included))?;
        counted = Counted { not_finite: counted.not_finite + of_noise.not_finite, ..of_noise };
    }
    let mut squares = Squares::default();
    for index in counted.indices() {
        let before = squares.difference;
        squares.add(estimate.pixels()[index].as_dvec3(), truth.pixels()[index].as_dvec3());
        if let Some(noise) = half_difference {
            squares.difference -= noise.pixels()[index].as_dvec3().length_squared();
            squares.power += (squares.difference - before).powi(2);
        }
    }
    squares.rise_to_one_standard_error();
    let rmse = squares.rmse();
    let usable = |index: usize| {
        let images = [Some(estimate), Some(truth), half_difference];
        images.into_iter().flatten().all(|image| image.pixels()[index].is_finite())
    };
    let grey = |image: &RgbImage| luminance_where(image, usable);
    let noise = half_difference.map(grey);
    Ok(Scores {
        rmse,
        psnr: psnr_of_rmse(rmse),
        ssim: mean_ssim(&grey(estimate), noise.as_ref(), &grey(truth), &counted),
        relative_rmse: (squares.difference.max(0.0) / squares.truth).sqrt(),
        pixels: counted.count,
        not_finite: counted.not_finite,
    })
}

/// Root of the mean squared difference over pixels and channels. Error: images of different sizes.
pub fn rmse(estimate: &RgbImage, truth: &RgbImage, mask: Option<&Image<bool>>) -> Result<f64> {
    let counted = counted_pixels(estimate, truth, mask)?;
    let mut squares = Squares::default();
    for index in counted.indices() {
        squares.add(estimate.pixels()[index].as_dvec3(), truth.pixels()[index].as_dvec3());
    }
    Ok(squares.rmse())
}

/// Root of the mean squared difference of two grey images. Error: images of different sizes.
pub fn rmse_grey(estimate: &GreyImage, truth: &GreyImage, mask: Option<&Image<bool>>) -> Result<f64> {
    rmse(&estimate.map(|&value| Vec3::splat(value)), &truth.map(|&value| Vec3::splat(value)), mask)
}

/// The peak signal-to-noise ratio in decibels of a root-mean-square error, for a peak of 1.
pub fn psnr_of_rmse(rmse: f64) -> f64 {
    -20.0 * rmse.log10()
}

/// The factor per channel that brings the estimate nearest to the truth in the least-squares sense,
/// `sum(e t) / sum(e^2)`, at least 0. 1 where the estimate is black. Error: images of different sizes.
pub fn best_scale_per_channel(estimate: &RgbImage, truth: &RgbImage, mask: Option<&Image<bool>>) -> Result<Vec3> {
    let (mut product, mut square) = (DVec3::ZERO, DVec3::ZERO);
    for index in counted_pixels(estimate, truth, mask)?.indices() {
        let estimate = estimate.pixels()[index].as_dvec3();
        product += estimate * truth.pixels()[index].as_dvec3();
        square += estimate * estimate;
    }
    let scale = |channel: usize| {
        if square[channel] > 0.0 { (product[channel] / square[channel]).max(0.0) as f32 } else { 1.0 }
    };
    Ok(Vec3::new(scale(0), scale(1), scale(2)))
}

/// Sums of squares over pixels and channels.
#[derive(Default)]
struct Squares {
    difference: f64,
    truth: f64,
    pixels: usize,
    /// Sum of the squares of what each pixel added to `difference`, where noise was taken off.
    power: f64,
}

impl Squares {
    fn add(&mut self, estimate: DVec3, truth: DVec3) {
        self.difference += (estimate - truth).length_squared();
        self.truth += truth.length_squared();
        self.pixels += 1;
    }

    /// Where noise was taken off, the sum is known to about the root of the sum of its parts' variances.
    fn rise_to_one_standard_error(&mut self) {
        let variance = self.power - self.difference.powi(2) / self.pixels.max(1) as f64;
        self.difference = self.difference.max(variance.max(0.0).sqrt());
    }

    fn rmse(&self) -> f64 {
        (self.difference.max(0.0) / (3 * self.pixels) as f64).sqrt()
    }
}

/// Which pixels count.
struct Counted {
    included: Image<bool>,
    count: usize,
    not_finite: usize,
}

impl Counted {
    fn indices(&self) -> impl Iterator<Item = usize> + '_ {
        self.included.pixels().iter().enumerate().filter(|(_, included)| **included).map(|(index, _)| index)
    }
}

fn counted_pixels(estimate: &RgbImage, truth: &RgbImage, mask: Option<&Image<bool>>) -> Result<Counted> {
    let size = (truth.width(), truth.height());
    let other = [Some((estimate.width(), estimate.height())), mask.map(|mask| (mask.width(), mask.height()))];
    if let Some((width, height)) = other.into_iter().flatten().find(|other| *other != size) {
        let message = format!("an image of {width} x {height} cannot be compared with one of {} x {}", size.0, size.1);
        return Err(Error::new(ErrorKind::InvalidSetting, message).remedy("render it at the size of the other"));
    }
    let (mut count, mut not_finite) = (0, 0);
    let included = Image::from_fn(size.0, size.1, |row, column| {
        let place = (row, column);
        let wanted = mask.is_none_or(|mask| mask[place]);
        let finite = estimate[place].is_finite() && truth[place].is_finite();
        count += usize::from(wanted && finite);
        not_finite += usize::from(wanted && !finite);
        wanted && finite
    });
    Ok(Counted { included, count, not_finite })
}

/// The luminance of the pixels that both images know, and 0 in both where one does not: windows of the similarity beside
/// such a pixel see no difference there.
fn luminance_where(image: &RgbImage, is_usable: impl Fn(usize) -> bool) -> GreyImage {
    let pixels = image.pixels().iter().enumerate();
    let pixels = pixels.map(|(index, &rgb)| if is_usable(index) { luminance(rgb) } else { 0.0 });
    Image::from_pixels(image.width(), image.height(), pixels.collect())
}

/// Pixels on each side of the centre of an SSIM window: 11 x 11 in all.
const WINDOW_RADIUS: usize = 5;

/// The mean of the map over counted pixels whose window is whole; over all counted pixels when there is none.
fn mean_ssim(estimate: &GreyImage, noise: Option<&GreyImage>, truth: &GreyImage, counted: &Counted) -> f64 {
    let map = ssim_map_without_noise(estimate, noise, truth);
    let whole = |index: usize| {
        let (row, column) = (index / map.width(), index % map.width());
        let inside = |place: usize, length: usize| place >= WINDOW_RADIUS && place + WINDOW_RADIUS < length;
        inside(row, map.height()) && inside(column, map.width())
    };
    let any_whole = counted.indices().any(whole);
    let values = counted.indices().filter(|&index| !any_whole || whole(index)).map(|index| map.pixels()[index]);
    let (sum, count) = values.fold((0.0, 0usize), |(sum, count), value| (sum + value, count + 1));
    sum / count as f64
}

/// Structural similarity at each pixel, in [-1, 1], for a peak of 1.
///
/// Wang, Bovik, Sheikh and Simoncelli 2004, "Image Quality Assessment: From Error Visibility to Structural
/// Similarity", eq. 13, with their Gaussian window of 11 x 11 pixels and standard deviation 1.5, K1 = 0.01, K2 = 0.03.
/// Windows that reach over the border are cut and their weights scaled to sum to 1. The images are of equal size.
pub fn ssim_map(first: &GreyImage, second: &GreyImage) -> Image<f64> {
    ssim_map_without_noise(first, None, second)
}

/// [`ssim_map`] with the noise of the first image taken off its variance: `half_difference` as in
/// [`scores_without_noise`].
fn ssim_map_without_noise(first: &GreyImage, half_difference: Option<&GreyImage>, second: &GreyImage) -> Image<f64> {
    const C1: f64 = 0.01 * 0.01;
    const C2: f64 = 0.03 * 0.03;
    let moments = Image::from_fn(first.width(), first.height(), |row, column| {
        let (x, y) = (f64::from(first[(row, column)]), f64::from(second[(row, column)]));
        let noise = half_difference.map_or(0.0, |noise| f64::from(noise[(row, column)]));
        [x, y, x * x - noise * noise, y * y, x * y]
    });
    blurred(&moments).map(|&[mean_x, mean_y, square_x, square_y, product]| {
        let variance_y = (square_y - mean_y * mean_y).max(0.0);
        let covariance = product - mean_x * mean_y;
        // However much noise is taken off, no variance is less than what goes along with the other image.
        let least =
            if half_difference.is_some() && variance_y > 0.0 { covariance * covariance / variance_y } else { 0.0 };
        let variance_x = (square_x - mean_x * mean_x).max(least);
        // SSIM = (2 mu_x mu_y + C1)(2 sigma_xy + C2) / ((mu_x^2 + mu_y^2 + C1)(sigma_x^2 + sigma_y^2 + C2))
        (2.0 * mean_x * mean_y + C1) * (2.0 * covariance + C2)
            / ((mean_x * mean_x + mean_y * mean_y + C1) * (variance_x + variance_y + C2))
    })
}

/// The Gaussian window over each pixel: first along rows, then along columns.
fn blurred(image: &Image<[f64; 5]>) -> Image<[f64; 5]> {
    let (width, height) = (image.width(), image.height());
    if image.pixels().is_empty() {
        return image.clone();
    }
    let along_rows =
        each_row(width, height, |row, column| windowed(column, width, |neighbour| image[(row, neighbour)]));
    each_row(width, height, |row, column| windowed(row, height, |neighbour| along_rows[(neighbour, column)]))
}

fn each_row(width: usize, height: usize, pixel: impl Fn(usize, usize) -> [f64; 5] + Sync) -> Image<[f64; 5]> {
    let mut image = Image::filled(width, height, [0.0; 5]);
    parallel::each_chunk(image.pixels_mut(), width, &|row, pixels| {
        pixels.iter_mut().enumerate().for_each(|(column, value)| *value = pixel(row, column));
    });
    image
}

/// The window along one axis around `centre`, cut at the border.
fn windowed(centre: usize, length: usize, value: impl Fn(usize) -> [f64; 5]) -> [f64; 5] {
    static WEIGHTS: std::sync::LazyLock<[f64; WINDOW_RADIUS + 1]> =
        std::sync::LazyLock::new(|| std::array::from_fn(|offset| (-0.5 * (offset as f64 / 1.5).powi(2)).exp()));
    let mut sum = [0.0; 5];
    let mut total = 0.0;
    for neighbour in centre.saturating_sub(WINDOW_RADIUS)..(centre + WINDOW_RADIUS + 1).min(length) {
        let weight = WEIGHTS[centre.abs_diff(neighbour)];
        total += weight;
        sum.iter_mut().zip(value(neighbour)).for_each(|(sum, value)| *sum += weight * value);
    }
    sum.map(|sum| sum / total)
}
