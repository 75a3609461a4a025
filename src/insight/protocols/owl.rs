//! Objects with Lighting (Ummenhofer et al. 2024): `scripts/evaluate.py` and `utils/metrics.py` of the data set.
//!
//! The ground truth is 8 bits behind the curve (x 2^exposure)^(1/2.2). A linear picture first gets the exposure, then the
//! balance of its channels within [0.5, 2], with the least mean absolute error behind that curve, over pixels of the mask that
//! are not overexposed; then it is compared over the mask.
//!
//! The authors' script finds exposure and balance by general minimisers from a start value. Here both are searched over their
//! whole range and refined to a thousandth of a stop, so that a start value decides nothing. Channels do not hang on each other.

use super::windows::Window;
use super::{decibels, masked_channel};
use crate::error::{Error, ErrorKind, Result};
use crate::image::{GreyImage, Image, RgbImage};
use glam::Vec3;

/// The power of the tone curve.
pub const GAMMA: f64 = 2.2;
/// The darkest exposure that is looked at, in stops.
const LEAST_STOPS: f64 = -10.0;
/// Bounds of a channel's balance.
const BALANCE: (f64, f64) = (0.5, 2.0);
/// Step of the search, and how near it ends, in stops.
const STEP_STOPS: f64 = 0.25;
const END_STOPS: f64 = 1e-3;

/// Scores of a picture, and what was done to it first.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct OwlScore {
    /// The exposure in stops.
    pub exposure_stops: f64,
    /// The factor of each channel after it.
    pub balance: [f64; 3],
    /// PSNR over the mask, in decibels.
    pub psnr_db: f64,
    /// Structural similarity, mean over the mask: windows of 7 x 7 pixels of equal weight, variances of samples.
    pub ssim: f64,
}

/// The value that the data set shows for a radiance.
fn shown(radiance: f64, stops: f64) -> f64 {
    (radiance.max(0.0) * stops.exp2()).powf(1.0 / GAMMA).clamp(0.0, 1.0)
}

/// Scores a linear picture against a ground truth in [0, 1] as stored, over a mask in [0, 1].
///
/// # Errors
/// `InvalidScene` for pictures of different sizes, for an empty mask and for a black picture.
pub fn score(picture: &RgbImage, truth: &RgbImage, mask: &GreyImage) -> Result<OwlScore> {
    let size = (truth.width(), truth.height());
    if (picture.width(), picture.height()) != size || (mask.width(), mask.height()) != size {
        return Err(Error::new(ErrorKind::InvalidScene, "picture, ground truth and mask differ in size"));
    }
    let is_counted = |index: usize, least: f32| mask.pixels()[index] > least;
    let fitted: Vec<usize> =
        (0..truth.pixels().len()).filter(|&at| is_counted(at, 0.9) && truth.pixels()[at].max_element() < 1.0).collect();
    let pairs: [Vec<(f64, f64)>; 3] = std::array::from_fn(|channel| {
        let values = |at: &usize| (f64::from(picture.pixels()[*at][channel]), f64::from(truth.pixels()[*at][channel]));
        fitted.iter().map(values).collect()
    });
    let error_of = |channel: usize, stops: f64| {
        let sum: f64 = pairs[channel].iter().map(|&(x, y)| (shown(x, stops) - y).abs()).sum();
        sum / pairs[channel].len() as f64
    };
    let smallest = fitted.iter().map(|&at| f64::from(picture.pixels()[at].min_element())).filter(|own| *own > 0.0);
    let smallest = smallest.fold(f64::INFINITY, f64::min);
    if fitted.is_empty() || !smallest.is_finite() {
        return Err(Error::new(ErrorKind::InvalidScene, "the picture is black wherever it is compared")
            .remedy("look at the mask of the ground truth and at the frame of the mesh"));
    }
    let most_stops = (0.95f64.powf(GAMMA) / smallest).log2().max(LEAST_STOPS + 1.0);
    let exposure_stops = least_at((LEAST_STOPS, most_stops), &|stops| (0..3).map(|c| error_of(c, stops)).sum());
    let balance: [f64; 3] = std::array::from_fn(|channel| {
        let within = (BALANCE.0.log2(), BALANCE.1.log2());
        least_at(within, &|stops| error_of(channel, exposure_stops + stops)).exp2()
    });
    let compared = Image::from_fn(size.0, size.1, |row, column| {
        let rgb = picture[(row, column)];
        let value = |channel: usize| shown(f64::from(rgb[channel]) * balance[channel], exposure_stops) as f32;
        Vec3::new(value(0), value(1), value(2))
    });
    let counted = mask.map(|own| *own > 0.5);
    let of_mask: Vec<usize> = (0..counted.pixels().len()).filter(|&at| counted.pixels()[at]).collect();
    let difference = |at: &usize| (compared.pixels()[*at] - truth.pixels()[*at]).as_dvec3().length_squared();
    let mean_square = of_mask.iter().map(difference).sum::<f64>() / (3 * of_mask.len()) as f64;
    Ok(OwlScore { exposure_stops, balance, psnr_db: decibels(mean_square), ssim: ssim(&compared, truth, &counted) })
}

/// Where a function of one number is least: searched at even steps, refined by thirds.
fn least_at((from, to): (f64, f64), function: &dyn Fn(f64) -> f64) -> f64 {
    let steps = ((to - from) / STEP_STOPS).ceil().max(2.0) as usize;
    let at = |step: usize| from + (to - from) * step as f64 / steps as f64;
    let best = (0..=steps).min_by(|&a, &b| function(at(a)).total_cmp(&function(at(b)))).unwrap_or(0);
    let (mut low, mut high) = (at(best.saturating_sub(1)), at((best + 1).min(steps)));
    while high - low > END_STOPS {
        let third = (high - low) / 3.0;
        if function(low + third) <= function(high - third) {
            high -= third;
        } else {
            low += third;
        }
    }
    0.5 * (low + high)
}

/// The structural similarity of scikit-image with its defaults, per channel, mean over the mask.
fn ssim(picture: &RgbImage, truth: &RgbImage, mask: &Image<bool>) -> f64 {
    const SIDE: usize = 7;
    let count = (SIDE * SIDE) as f64;
    let window =
        Window { weights: vec![1.0 / SIDE as f64; SIDE], repeats_border: true, of_sample: count / (count - 1.0) };
    let counted = mask.pixels().iter().filter(|own| **own).count();
    let sum: f64 = (0..3)
        .map(|channel| {
            let of = |image: &RgbImage| masked_channel(image, channel, mask);
            let map = window.similarity(&of(picture), &of(truth));
            map.pixels().iter().zip(mask.pixels()).filter(|(_, own)| **own).map(|(value, _)| value).sum::<f64>()
        })
        .sum();
    sum / (3 * counted) as f64
}
