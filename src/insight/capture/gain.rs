//! How much brighter a photo is than the model's picture of it.

use super::shift::{BLOCK, FEWEST_BLOCKS};
use crate::image::{Image, RgbImage};
use crate::math::statistics::quantile;

/// Pixels that a block needs.
const FEWEST_PIXELS: usize = 12;

/// Logarithms of photo over model by channel, with their standard error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogGain {
    /// Natural logarithms, red, green, blue.
    pub log: [f64; 3],
    /// Standard error of the mean of the three.
    pub error: f64,
}

impl LogGain {
    /// Mean of the channels.
    pub fn mean(&self) -> f64 {
        self.log.iter().sum::<f64>() / 3.0
    }
}

/// The gain between two pictures in linear radiance over the pixels of `valid`: in each block the ratio of sums, of the
/// blocks the median. Its error is that of a median of as many independent blocks. Blocks darker than a twentieth of
/// `level` say nothing. `None` where fewer than eight blocks do.
pub fn gain_between(photo: &RgbImage, model: &RgbImage, valid: &Image<bool>, level: f32) -> Option<LogGain> {
    let (width, height) = (photo.width(), photo.height());
    let mut logs: [Vec<f64>; 4] = Default::default();
    for top in (0..height).step_by(BLOCK) {
        for left in (0..width).step_by(BLOCK) {
            let (mut sums, mut count) = ([[0.0f64; 2]; 3], 0usize);
            for row in top..(top + BLOCK).min(height) {
                for column in (left..(left + BLOCK).min(width)).filter(|&column| valid[(row, column)]) {
                    count += 1;
                    for (channel, [own, other]) in sums.iter_mut().enumerate() {
                        *own += f64::from(photo[(row, column)][channel]);
                        *other += f64::from(model[(row, column)][channel]);
                    }
                }
            }
            let least = 0.05 * f64::from(level) * count as f64;
            let is_bright = sums.iter().flatten().all(|sum| *sum > least);
            if count >= FEWEST_PIXELS && is_bright {
                let ratio = sums.map(|[own, other]| (own / other).ln());
                for (list, log) in logs.iter_mut().zip(ratio.into_iter().chain([ratio.iter().sum::<f64>() / 3.0])) {
                    list.push(log);
                }
            }
        }
    }
    let [red, green, blue, mean] = logs;
    if mean.len() < FEWEST_BLOCKS {
        return None;
    }
    let middle = quantile(&mean, 0.5);
    let departures: Vec<f64> = mean.iter().map(|log| (log - middle).abs()).collect();
    // 1.4826 makes a standard deviation of the median departure, 1.2533 the error of a median of that of a mean.
    let error = 1.2533 * 1.4826 * quantile(&departures, 0.5) / (mean.len() as f64).sqrt();
    Some(LogGain { log: [red, green, blue].map(|logs| quantile(&logs, 0.5)), error })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::SequentialRandom;
    use glam::Vec3;

    #[test]
    fn a_known_gain_is_found_under_noise_highlights_and_a_mask() {
        let mut random = SequentialRandom::new(3);
        let model =
            Image::from_fn(40, 40, |row, column| Vec3::new(0.2, 0.3, 0.4) * (1.0 + 0.01 * (row + column) as f32));
        let mut photo = model.map(|&value| value * Vec3::new(1.3, 1.2, 1.1) * (0.9 + 0.2 * random.next_number()));
        let mut valid = Image::filled(40, 40, true);
        for index in 0..40 {
            photo[(index, 5)] = Vec3::splat(50.0);
            photo[(7, index)] = Vec3::splat(f32::NAN);
            valid[(7, index)] = false;
        }
        let gain = gain_between(&photo, &model, &valid, 0.3).unwrap();
        for (log, known) in gain.log.iter().zip([1.3f64, 1.2, 1.1]) {
            assert!((log - known.ln()).abs() < 0.03, "{gain:?}");
        }
        assert!((0.0005..0.03).contains(&gain.error), "{gain:?}");
        assert!(gain_between(&photo, &model, &valid, 100.0).is_none(), "all of it is dark");
    }
}
