//! Scores by the rules of others: those of published benchmarks, so that a figure here stands beside theirs.
//!
//! [`orb`] is Stanford-ORB, [`owl`] Objects with Lighting. Masks, scales, tone curves and windows are those of their own
//! scripts, to the letter; what needs a trained network (LPIPS) is not computed. Each source is named at its line.
//!
//! It refuses to improve on them: where a rule is odd it is kept, and said.

pub mod orb;
pub mod owl;
mod windows;

use crate::image::{Image, RgbImage};

/// Decibels of a mean squared error for a peak of 1.
fn decibels(mean_square: f64) -> f64 {
    -10.0 * mean_square.log10()
}

/// A channel of a picture, black outside a mask.
fn masked_channel(picture: &RgbImage, channel: usize, mask: &Image<bool>) -> Image<f64> {
    Image::from_fn(picture.width(), picture.height(), |row, column| {
        if mask[(row, column)] { f64::from(picture[(row, column)][channel]) } else { 0.0 }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::GreyImage;
    use glam::Vec3;

    /// Two pictures and a mask of 32 x 24 pixels. The figures below are of the same formulas in numpy, by
    /// `scipy.ndimage` (erosion, Gaussian windows) and scikit-image (PSNR, structural similarity).
    fn pictures() -> (RgbImage, RgbImage, GreyImage) {
        let wave = |a: f32, b: f32, row: usize, column: usize, channel: usize| {
            let shift = channel as f32;
            0.35 + 0.3 * (a * row as f32 + shift).sin() * (b * column as f32 - shift).cos()
        };
        let truth = Image::from_fn(32, 24, |row, column| {
            let spot = if (5..9).contains(&row) && (6..12).contains(&column) { 3.0 } else { 1.0 };
            Vec3::from_array([0, 1, 2].map(|channel| spot * wave(0.31, 0.23, row, column, channel)))
        });
        let picture = Image::from_fn(32, 24, |row, column| {
            let gain = [1.1, 0.9, 1.3];
            Vec3::from_array([0, 1, 2].map(|channel| 0.8 * gain[channel] * wave(0.30, 0.25, row, column, channel)))
        });
        let mask = Image::from_fn(32, 24, |row, column| {
            let (down, across) = ((row as f32 - 12.0) / 11.0, (column as f32 - 16.0) / 14.0);
            if down * down + across * across < 1.0 { 1.0 } else { 0.0 }
        });
        (picture, truth, mask)
    }

    #[test]
    fn stanford_orb_scores_as_its_own_script_does() {
        let (picture, truth, mask) = pictures();
        for (is_scaled, hdr, ldr, ssim) in [(false, 16.2718, 23.4450, 0.954_81), (true, 18.0126, 25.6056, 0.959_11)] {
            let score = orb::score(&picture, &truth, &mask, is_scaled).unwrap();
            assert!((score.psnr_hdr_db - hdr).abs() < 1e-3 && (score.psnr_ldr_db - ldr).abs() < 1e-3, "{score:?}");
            assert!((score.ssim - ssim).abs() < 1e-4, "{score:?}");
        }
        let black = picture.map(|_| Vec3::ZERO);
        let floor = orb::score(&black, &truth, &mask, true).unwrap();
        assert!(floor.psnr_ldr_db > 5.0 && floor.psnr_ldr_db.is_finite(), "{floor:?}");
        assert!(orb::score(&Image::filled(3, 3, Vec3::ONE), &truth, &mask, true).is_err());
    }

    #[test]
    fn objects_with_lighting_scores_as_its_own_script_does() {
        let (picture, truth, mask) = pictures();
        let stored = truth.map(|rgb| {
            let byte = |value: f32| (value.clamp(0.0, 1.0).powf(1.0 / 2.2) * 255.0).round() / 255.0;
            rgb.map(byte)
        });
        let score = owl::score(&picture, &stored, &mask).unwrap();
        assert!((score.exposure_stops - 0.14296).abs() < 2e-3, "{score:?}");
        for (found, expected) in score.balance.into_iter().zip([0.98449, 1.26778, 0.89103]) {
            assert!((found - expected).abs() < 3e-3, "{score:?}");
        }
        assert!((score.psnr_db - 20.8809).abs() < 0.02 && (score.ssim - 0.89683).abs() < 1e-3, "{score:?}");
        // A picture of another brightness is the same picture.
        let brighter = owl::score(&picture.map(|rgb| *rgb * 5.0), &stored, &mask).unwrap();
        assert!((brighter.psnr_db - score.psnr_db).abs() < 0.02, "{brighter:?}");
        assert!(owl::score(&picture.map(|_| Vec3::ZERO), &stored, &mask).is_err());
    }
}
