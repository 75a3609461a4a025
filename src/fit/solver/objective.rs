//! The one function that a fit makes less: the negative logarithm of how likely photos and beliefs are, in nats.
//!
//! `J = sum over pixels of -ln Student((y - g I) / sigma)`, plus what is believed of neighbouring texels and of dielectrics.
//! What noise and gains are is learned from the capture ([`Learned`]); by those of one moment J is compared with itself.

use super::photo_gains::{GainSums, gains};
use super::pixel_noise::{PixelNoise, Residual};
use super::pixel_system::{CHUNK, PixelRow};
use super::pixels::Pixels;
use super::sight::Sight;
use crate::math::parallel;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Reflectances follow gains and gains reflectances, so that each pass leaves a share of what is wrong with the gains: the
/// larger, the fewer photos share a texel. Going further by this factor is successive over-relaxation of their logarithms.
const OVER_RELAXATION: f32 = 1.5;

/// The objective, term by term, in nats.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Objective {
    /// Whole pixels.
    pub pixels: f64,
    /// Neighbouring texels.
    pub neighbours: f64,
    /// F0 of dielectrics.
    #[serde(alias = "lobes")]
    pub dielectrics: f64,
}

impl Objective {
    /// All terms.
    pub fn total(&self) -> f64 {
        self.pixels + self.neighbours + self.dielectrics
    }
}

/// What is learned from the residuals of a capture.
#[derive(Clone)]
pub struct Learned {
    /// Gain of each view and channel.
    pub gains: Vec<[f32; 3]>,
    /// The noise.
    pub noise: PixelNoise,
    /// Radiance by which each pixel's variance is known.
    brightness: Vec<f32>,
}

impl Learned {
    /// By what pixels see, and what was known before.
    pub fn of(pixels: &Pixels, sight: &Sight, before: Option<&Learned>) -> Self {
        let mut learned = Learned {
            gains: before.map_or_else(|| vec![[1.0f32; 3]; pixels.views()], |before| before.gains.clone()),
            noise: PixelNoise::learn(&[]),
            brightness: Vec::new(),
        };
        learned.learn_noise(pixels, sight);
        // Gains are learned once something is known that they could be of.
        if before.is_some() {
            learned.gains = learned.better_gains(pixels, sight);
            learned.learn_noise(pixels, sight);
        }
        learned
    }

    /// These gains with the noise of others.
    pub fn with_noise_of(&self, other: &Learned) -> Self {
        Learned { gains: self.gains.clone(), noise: other.noise, brightness: other.brightness.clone() }
    }

    fn learn_noise(&mut self, pixels: &Pixels, sight: &Sight) {
        let brightness = |(index, radiance): (usize, &[f32; 3])| {
            let gain = self.gains[pixels.pixel(index).view as usize];
            (0..3).map(|c| gain[c] * radiance[c]).sum::<f32>() / 3.0
        };
        self.brightness = sight.radiance.par_iter().enumerate().map(brightness).collect();
        let residuals: Vec<Residual> =
            (0..pixels.count()).into_par_iter().map(|index| self.residual(pixels, sight, index).1).collect();
        self.noise = PixelNoise::learn(&residuals);
    }

    /// What is left of a photo's pixel; nothing where it is clipped and the model is as bright.
    fn residual(&self, pixels: &Pixels, sight: &Sight, index: usize) -> ([f32; 3], Residual) {
        let (own, radiance) = (pixels.pixel(index), &sight.radiance[index]);
        let gain = self.gains[own.view as usize];
        let left = [0, 1, 2].map(|c| own.radiance[c] - gain[c] * radiance[c]);
        let says_nothing = own.clipped && !left.iter().all(|left| *left > 0.0);
        let left = if says_nothing || !left.iter().all(|left| left.is_finite()) { [0.0; 3] } else { left };
        let square = left.iter().map(|left| left * left).sum();
        (left, Residual { radiance: self.brightness[index], square })
    }

    fn better_gains(&self, pixels: &Pixels, sight: &Sight) -> Vec<[f32; 3]> {
        let views = pixels.views();
        let parts = parallel::map_chunks(&sight.radiance, CHUNK, |which, chunk| {
            let mut sums = vec![GainSums::default(); views];
            for (offset, radiance) in chunk.iter().enumerate() {
                let index = which * CHUNK + offset;
                let own = pixels.pixel(index);
                if !own.clipped {
                    let weight = self.noise.weight(self.residual(pixels, sight, index).1);
                    sums[own.view as usize].add(weight, own.radiance, *radiance);
                }
            }
            sums
        });
        let mut total = vec![GainSums::default(); views];
        for part in &parts {
            total.iter_mut().zip(part).for_each(|(total, part)| total.merge(part));
        }
        let further = |before: f32, found: f32| before * (found / before).powf(OVER_RELAXATION);
        let found = gains(&total);
        self.gains.iter().zip(&found).map(|(before, found)| [0, 1, 2].map(|c| further(before[c], found[c]))).collect()
    }

    /// The pixels' equations, weighed by the noise.
    pub fn rows(&self, pixels: &Pixels, sight: &Sight) -> Vec<PixelRow> {
        let row = |index: usize| {
            let (left, residual) = self.residual(pixels, sight, index);
            let weight = if left == [0.0; 3] { 0.0 } else { self.noise.weight(residual) };
            PixelRow { left, gain: self.gains[pixels.pixel(index).view as usize], weight }
        };
        (0..pixels.count()).into_par_iter().map(row).collect()
    }

    /// Negative logarithm of the density of what is left of a pixel, in nats.
    pub fn nats(&self, pixels: &Pixels, sight: &Sight, index: usize) -> f64 {
        self.noise.nats(self.residual(pixels, sight, index).1)
    }

    /// The objective of what pixels see, beside what is believed of neighbours and of dielectrics.
    pub fn objective(&self, pixels: &Pixels, sight: &Sight, [neighbours, dielectrics]: [f64; 2]) -> Objective {
        let count = pixels.count();
        let nats = |index: usize| self.nats(pixels, sight, index);
        let of_chunk = |chunk: usize| -> f64 { (chunk * CHUNK..((chunk + 1) * CHUNK).min(count)).map(nats).sum() };
        let sums = parallel::map(count.div_ceil(CHUNK), of_chunk);
        Objective { pixels: sums.into_iter().sum(), neighbours, dielectrics }
    }
}
