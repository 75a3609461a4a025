//! Stanford-ORB (Kuang et al. 2023): `orb/utils/metrics.py` and `orb/utils/test.py` of the benchmark.
//!
//! Pictures are linear, 512 x 512; the ground truth is that of 2048 x 2048 made smaller by the mean over areas. Errors are
//! means over all pixels, the black ones outside the mask too, so that they come out some 8 dB above those of the object
//! alone; and no score is below that of a grey picture.

use super::windows::Window;
use super::{decibels, masked_channel};
use crate::error::{Error, ErrorKind, Result};
use crate::image::transfer::srgb_from_linear;
use crate::image::{GreyImage, Image, RgbImage};
use glam::Vec3;

/// Width and height of scored pictures in pixels.
pub const RESOLUTION: usize = 512;
/// The mask is eroded by so many pixels on each side.
const ERODED_PIXELS: i64 = 2;
/// Above this a linear picture counts as this.
const MOST_HDR: f32 = 4.0;
/// A channel whose squares sum to less has no scale of its own.
const NO_SIGNAL: f64 = 1e-6;

/// Scores of a picture.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct OrbScore {
    /// PSNR of linear values up to 4, after both were brightened as sRGB brightens the ground truth, in decibels.
    pub psnr_hdr_db: f64,
    /// PSNR of sRGB values in [0, 1], in decibels.
    pub psnr_ldr_db: f64,
    /// Structural similarity of sRGB values, windows of 3 x 3.
    pub ssim: f64,
}

/// Scores a linear picture. `alpha` is the mask of the ground truth at the same size. `is_scaled`: each channel is first
/// multiplied by its best factor, as for pictures under another light.
///
/// # Errors
/// `InvalidScene` for pictures of different sizes.
pub fn score(picture: &RgbImage, truth: &RgbImage, alpha: &GreyImage, is_scaled: bool) -> Result<OrbScore> {
    let size = (truth.width(), truth.height());
    if (picture.width(), picture.height()) != size || (alpha.width(), alpha.height()) != size {
        return Err(Error::new(ErrorKind::InvalidScene, "picture, ground truth and mask differ in size"));
    }
    let mask = eroded(&alpha.map(|alpha| *alpha > 0.5));
    let within = |image: &RgbImage| {
        Image::from_fn(size.0, size.1, |row, column| match mask[(row, column)] {
            true => image[(row, column)].max(Vec3::ZERO),
            false => Vec3::ZERO,
        })
    };
    let (picture, truth) = (within(picture), within(truth));
    let brightening = {
        let clipped: Vec<Vec3> = truth.pixels().iter().map(|rgb| rgb.clamp(Vec3::ZERO, Vec3::ONE)).collect();
        let mean = |value: &dyn Fn(f32) -> f32| {
            let sum: f64 = clipped.iter().flat_map(|rgb| rgb.to_array()).map(|own| f64::from(value(own))).sum();
            sum / (3 * clipped.len()) as f64
        };
        let linear = mean(&|own| own);
        if linear > 1e-8 { mean(&srgb_from_linear) / linear } else { 1.0 }
    } as f32;
    let brightened = |image: &RgbImage| image.map(|rgb| *rgb * brightening);
    let (psnr_hdr_db, ..) = psnr(brightened(&picture), brightened(&truth), &mask, MOST_HDR, false, is_scaled);
    let (psnr_ldr_db, picture, truth) = psnr(picture, truth, &mask, 1.0, true, is_scaled);
    Ok(OrbScore { psnr_hdr_db, psnr_ldr_db, ssim: ssim(&picture, &truth, &mask) })
}

/// The score, and the two pictures that were compared.
fn psnr(
    picture: RgbImage,
    truth: RgbImage,
    mask: &Image<bool>,
    most: f32,
    is_encoded: bool,
    is_scaled: bool,
) -> (f64, RgbImage, RgbImage) {
    let scale = if is_scaled { scale_of(&picture, &truth, mask) } else { Vec3::ONE };
    let shown = |image: RgbImage, scale: Vec3| {
        image.map(|rgb| {
            let clipped = (*rgb * scale).clamp(Vec3::ZERO, Vec3::splat(most));
            if is_encoded { clipped.map(srgb_from_linear) } else { clipped }
        })
    };
    let (picture, truth) = (shown(picture, scale), shown(truth, Vec3::ONE));
    let mean_square = |value: &dyn Fn(usize) -> Vec3| {
        let sum: f64 = truth
            .pixels()
            .iter()
            .enumerate()
            .map(|(index, truth)| (value(index) - *truth).as_dvec3().length_squared())
            .sum();
        sum / (3 * truth.pixels().len()) as f64
    };
    let own = decibels(mean_square(&|index| picture.pixels()[index]));
    let grey = decibels(mean_square(&|index| if mask.pixels()[index] { Vec3::splat(0.5) } else { Vec3::ZERO }));
    (own.max(grey), picture, truth)
}

/// The factor of each channel that brings the picture nearest to the truth over the mask.
fn scale_of(picture: &RgbImage, truth: &RgbImage, mask: &Image<bool>) -> Vec3 {
    let mut scale = Vec3::ONE;
    for channel in 0..3 {
        let pairs = || {
            let counted = picture.pixels().iter().zip(truth.pixels()).zip(mask.pixels()).filter(|(_, counts)| **counts);
            counted.map(|((x, y), _)| (f64::from(x[channel]), f64::from(y[channel])))
        };
        let squares: f64 = pairs().map(|(x, _)| x * x).sum();
        // A channel without signal is scaled as if it were 1 everywhere.
        let (product, squares) = if squares <= NO_SIGNAL {
            (pairs().map(|(_, y)| y).sum(), pairs().count() as f64)
        } else {
            (pairs().map(|(x, y)| x * y).sum::<f64>(), squares)
        };
        scale[channel] = if squares > 0.0 { (product / squares) as f32 } else { 1.0 };
    }
    scale
}

/// Pixels all of whose neighbours within a square lie in the mask; beyond the border everything does (OpenCV's `erode`).
fn eroded(mask: &Image<bool>) -> Image<bool> {
    let inside = |row: i64, column: i64| {
        let is_outside = row < 0 || column < 0 || row >= mask.height() as i64 || column >= mask.width() as i64;
        is_outside || mask[(row as usize, column as usize)]
    };
    Image::from_fn(mask.width(), mask.height(), |row, column| {
        (-ERODED_PIXELS..=ERODED_PIXELS).all(|down| {
            (-ERODED_PIXELS..=ERODED_PIXELS).all(|across| inside(row as i64 + down, column as i64 + across))
        })
    })
}

/// `1 - 2 ssim_loss` of kornia with windows of 3: a Gaussian of 1.5 pixels, borders mirrored without their pixel, the loss of
/// each pixel within [0, 1].
fn ssim(picture: &RgbImage, truth: &RgbImage, mask: &Image<bool>) -> f64 {
    let side = (-0.5 / (1.5f64 * 1.5)).exp();
    let sum = 1.0 + 2.0 * side;
    let window = Window { weights: vec![side / sum, 1.0 / sum, side / sum], repeats_border: false, of_sample: 1.0 };
    let loss: f64 = (0..3)
        .map(|channel| {
            let of = |image: &RgbImage| masked_channel(image, channel, mask);
            let map = window.similarity(&of(picture), &of(truth));
            map.pixels().iter().map(|own| (0.5 * (1.0 - own)).clamp(0.0, 1.0)).sum::<f64>()
        })
        .sum();
    1.0 - 2.0 * loss / (3 * mask.pixels().len().max(1)) as f64
}
