//! Numbers between two pictures of one view.

use super::cases::{Noisy, Reference};
use crate::error::Result;
use crate::image::metrics::scores;
use crate::image::transfer::srgb_from_linear;
use crate::image::{Image, RgbImage};
use crate::math::luminance;
use crate::math::statistics::quantile;
use glam::Vec3;
use serde::Serialize;

/// How near a picture comes to the reference, over pixels that surface covers wholly.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Figures {
    /// Root mean squared error after the one best factor, over the mean of the reference; the noise of both is taken off
    /// its square where it is known.
    pub rmse: f64,
    /// What the noise alone would give.
    pub noise: f64,
    /// The factor.
    pub factor: f64,
    /// Structural similarity of the luminance, the brightest fiftieth as white.
    pub ssim: f64,
}

/// How two noisy pictures differ in units of their noise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct ZScores {
    /// Mean over pixels and channels.
    pub mean: f64,
    /// Root of the mean square: with variances from 16 pictures on both sides about 1.035.
    pub root_mean_square: f64,
    /// Share beyond 3.
    pub above_3: f64,
}

fn pairs<'a>(reference: &'a Reference, picture: &'a RgbImage) -> impl Iterator<Item = (usize, Vec3, Vec3)> + 'a {
    let truth = reference.picture.mean.pixels();
    let counted = reference.counted.pixels().iter().enumerate().filter(|(_, counted)| **counted);
    counted.map(move |(index, _)| (index, picture.pixels()[index], truth[index]))
}

/// The factor that brings a picture nearest to the reference.
fn best_factor(reference: &Reference, picture: &RgbImage) -> f64 {
    let (mut across, mut square) = (0.0f64, 0.0f64);
    for (_, other, truth) in pairs(reference, picture) {
        across += other.as_dvec3().dot(truth.as_dvec3());
        square += other.as_dvec3().length_squared();
    }
    across / square.max(1e-30)
}

/// Root mean squared error after the best factor over the mean of the reference, noise and all.
pub fn plain_rmse(reference: &Reference, picture: &RgbImage) -> f64 {
    let factor = best_factor(reference, picture);
    let (mut squared, mut sum, mut count) = (0.0, 0.0, 0.0);
    for (_, other, truth) in pairs(reference, picture) {
        squared += (other.as_dvec3() * factor - truth.as_dvec3()).length_squared();
        sum += truth.as_dvec3().element_sum();
        count += 3.0;
    }
    (squared / count).sqrt() / (sum / count).max(1e-30)
}

/// The figures of a picture.
///
/// # Errors
/// Pictures of different sizes.
pub fn figures(reference: &Reference, picture: &Noisy) -> Result<Figures> {
    let factor = best_factor(reference, &picture.mean);
    let variance = |of: &Option<RgbImage>, index: usize| {
        of.as_ref().map_or(0.0, |variance| variance.pixels()[index].as_dvec3().element_sum())
    };
    let (mut noise, mut sum, mut count) = (0.0, 0.0, 0.0);
    for (index, _, truth) in pairs(reference, &picture.mean) {
        noise += factor * factor * variance(&picture.variance, index) + variance(&reference.picture.variance, index);
        sum += truth.as_dvec3().element_sum();
        count += 3.0;
    }
    let mean: f64 = (sum / f64::max(count, 1.0)).max(1e-30);
    let noise = (noise / f64::max(count, 1.0)).sqrt() / mean;
    let plain = plain_rmse(reference, &picture.mean);
    let bright: Vec<f64> = pairs(reference, &picture.mean).map(|(_, _, truth)| f64::from(luminance(truth))).collect();
    let white = quantile(&bright, 0.98).max(1e-20);
    let scaled = |image: &RgbImage, factor: f64| {
        let encode = |value: f32| srgb_from_linear((value * (factor / white) as f32).clamp(0.0, 1.0));
        image.map(|rgb| Vec3::new(encode(rgb.x), encode(rgb.y), encode(rgb.z)))
    };
    let (ours, theirs) = (scaled(&reference.picture.mean, 1.0), scaled(&picture.mean, factor));
    let ssim = scores(&theirs, &ours, Some(&reference.counted))?.ssim;
    Ok(Figures { rmse: (plain * plain - noise * noise).max(0.0).sqrt(), noise, factor, ssim })
}

/// The z-scores of a picture without any factor; both sides know their variance.
pub fn z_scores(reference: &Reference, picture: &Noisy) -> ZScores {
    let (Some(own), Some(others)) = (&reference.picture.variance, &picture.variance) else {
        return ZScores { mean: f64::NAN, root_mean_square: f64::NAN, above_3: f64::NAN };
    };
    let (mut sum, mut squares, mut above, mut count) = (0.0, 0.0, 0.0, 0.0f64);
    for (index, other, truth) in pairs(reference, &picture.mean) {
        let variance = own.pixels()[index].as_dvec3() + others.pixels()[index].as_dvec3();
        let difference = other.as_dvec3() - truth.as_dvec3();
        for channel in 0..3 {
            // A pixel without noise on either side has no z.
            if variance[channel] > 1e-14 + (1e-5 * f64::from(truth[channel])).powi(2) {
                let z = difference[channel] / variance[channel].sqrt();
                sum += z;
                squares += z * z;
                above += f64::from(u8::from(z.abs() > 3.0));
                count += 1.0;
            }
        }
    }
    let count = count.max(1.0);
    ZScores { mean: sum / count, root_mean_square: (squares / count).sqrt(), above_3: above / count }
}

/// Reference, picture after its factor, and twice their difference about grey, side by side.
pub fn side_by_side(reference: &Reference, picture: &Noisy) -> Image<[u8; 3]> {
    let factor = best_factor(reference, &picture.mean) as f32;
    let bright: Vec<f64> = pairs(reference, &picture.mean).map(|(_, _, truth)| f64::from(luminance(truth))).collect();
    let white = (quantile(&bright, 0.98) as f32).max(1e-20);
    let (width, height) = (picture.mean.width(), picture.mean.height());
    let image = Image::from_fn(3 * width, height, |row, column| {
        let place = (row, column % width);
        let (truth, other) = (reference.picture.mean[place] / white, picture.mean[place] * factor / white);
        match column / width {
            0 => truth,
            1 => other,
            _ if reference.counted[place] => Vec3::splat(0.5) + 2.0 * (other - truth),
            _ => Vec3::ZERO,
        }
    });
    crate::image::file::srgb8_from_linear(&image, 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::SequentialRandom;

    fn noisy(random: &mut SequentialRandom, deviation: f32, bias: f32) -> Noisy {
        let normal = |random: &mut SequentialRandom| {
            // Twelve uniform numbers.
            (0..12).map(|_| random.next_number()).sum::<f32>() - 6.0
        };
        let pixels = (0..64 * 64)
            .map(|index| {
                let truth = 0.5 + 0.4 * ((index % 64) as f32 / 9.0).sin();
                Vec3::splat(truth * (1.0 + bias)) + Vec3::from_array([(); 3].map(|()| deviation * normal(random)))
            })
            .collect();
        let variance = Image::filled(64, 64, Vec3::splat(deviation * deviation));
        Noisy { mean: Image::from_pixels(64, 64, pixels), variance: Some(variance) }
    }

    #[test]
    fn noise_is_no_error_and_a_bias_is() {
        let mut random = SequentialRandom::new(2);
        let picture = noisy(&mut random, 0.02, 0.0);
        let reference = Reference { picture, counted: Image::filled(64, 64, true), wrong: Vec::new() };
        let same = noisy(&mut random, 0.03, 0.0);
        let (figures_same, z_same) = (figures(&reference, &same).unwrap(), z_scores(&reference, &same));
        assert!(figures_same.rmse < 0.02 && figures_same.noise > 0.06, "{figures_same:?}");
        assert!((z_same.root_mean_square - 1.0).abs() < 0.05 && z_same.mean.abs() < 0.05, "{z_same:?}");
        // A factor is no error of shape, but no accident of noise either.
        let brighter = noisy(&mut random, 0.03, 0.1);
        let (figures_brighter, z_brighter) = (figures(&reference, &brighter).unwrap(), z_scores(&reference, &brighter));
        assert!(
            (figures_brighter.factor * 1.1 - 1.0).abs() < 0.01 && figures_brighter.rmse < 0.02,
            "{figures_brighter:?}"
        );
        assert!(z_brighter.root_mean_square > 1.3, "{z_brighter:?}");
        let mut wrong = noisy(&mut random, 0.0, 0.0);
        wrong.mean.pixels_mut().iter_mut().step_by(2).for_each(|rgb| *rgb *= 1.2);
        let figures_wrong = figures(&reference, &wrong).unwrap();
        assert!(figures_wrong.rmse > 0.08 && figures_wrong.ssim < figures_same.ssim, "{figures_wrong:?}");
    }
}
