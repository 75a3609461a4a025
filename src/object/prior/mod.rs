//! What is known of light before any photo: priors on the logarithm of an environment.
//!
//! [`deep`] is the paper's, an untrained net; [`gradient`] is that of the work before it (Lombardi and Nishino
//! 2016), kept as its rival. Both act on the natural logarithm of radiance, texel by texel, weighted by solid angle.

pub mod deep;
pub mod gradient;

use crate::image::Image;
use crate::light::Environment;
use crate::math::sphere;
use glam::Vec3;

/// Which prior holds the light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum LightPriorKind {
    /// An untrained net (Chen, Nobuhara and Nishino 2020).
    #[default]
    Deep,
    // Results of the entropy prior, which is gone, are read as of this one.
    /// Sparse gradients (Lombardi and Nishino 2016).
    #[serde(alias = "entropy")]
    #[cfg_attr(feature = "cli", value(alias = "entropy"))]
    Gradient,
    /// Nothing: texels that light no pixel stay where they began.
    None,
}

/// The natural logarithm of an environment's radiance, channel by channel.
#[derive(Clone, Debug, PartialEq)]
pub struct LogLight {
    /// Width in texels.
    pub width: usize,
    /// Height in texels.
    pub height: usize,
    /// One row-major map a channel.
    pub channels: [Vec<f32>; 3],
}

/// Logarithms of radiance are kept within this distance of 0, so that no exponential overflows.
const LARGEST_LOG: f32 = 40.0;

impl LogLight {
    /// An even light.
    pub fn constant(width: usize, height: usize, logs: [f32; 3]) -> Self {
        LogLight { width, height, channels: logs.map(|log| vec![log; width * height]) }
    }

    /// The logarithm of an environment, raised to `floor` where it is darker.
    pub fn of(environment: &Environment, floor: f32) -> Self {
        let texels = environment.radiance.pixels();
        let channel = |channel: usize| texels.iter().map(|rgb| rgb[channel].max(floor).ln()).collect();
        LogLight { width: environment.width(), height: environment.height(), channels: [0, 1, 2].map(channel) }
    }

    /// The radiance, channel by channel.
    pub fn radiance(&self) -> [Vec<f32>; 3] {
        let exponential = |logs: &Vec<f32>| logs.iter().map(|log| log.clamp(-LARGEST_LOG, LARGEST_LOG).exp()).collect();
        [0, 1, 2].map(|channel| exponential(&self.channels[channel]))
    }

    /// The radiance, texel by texel.
    pub fn texels(&self) -> Vec<Vec3> {
        let [red, green, blue] = self.radiance();
        (0..red.len()).map(|texel| Vec3::new(red[texel], green[texel], blue[texel])).collect()
    }

    /// The environment.
    pub fn environment(&self) -> Environment {
        Environment { radiance: Image::from_pixels(self.width, self.height, self.texels()) }
    }

    /// Mean of the logarithm over the sphere, per channel.
    pub fn mean(&self) -> [f64; 3] {
        let shares = shares(self.width, self.height);
        [0, 1, 2].map(|channel| {
            self.channels[channel].iter().zip(&shares).map(|(log, share)| f64::from(*log) * f64::from(*share)).sum()
        })
    }

    /// Takes the mean colour of lights out: afterwards all channels have the same mean logarithm over all of them.
    pub fn level_colours(lights: &mut [LogLight]) {
        let mut means = [0.0; 3];
        for light in lights.iter() {
            means.iter_mut().zip(light.mean()).for_each(|(sum, mean)| *sum += mean / lights.len() as f64);
        }
        let middle = means.iter().sum::<f64>() / 3.0;
        for (channel, mean) in lights.iter_mut().flat_map(|light| light.channels.iter_mut().zip(means)) {
            channel.iter_mut().for_each(|log| *log += (middle - mean) as f32);
        }
    }

    /// Replaces every texel's colour by the mean of its logarithms.
    pub fn make_grey(&mut self) {
        for texel in 0..self.channels[0].len() {
            let mean = (0..3).map(|channel| self.channels[channel][texel]).sum::<f32>() / 3.0;
            (0..3).for_each(|channel| self.channels[channel][texel] = mean);
        }
    }
}

/// Share of the sphere that each texel covers; they sum to 1.
pub fn shares(width: usize, height: usize) -> Vec<f32> {
    let share = |row: usize| (sphere::solid_angle_of_texel(row, width, height) / (4.0 * std::f64::consts::PI)) as f32;
    (0..height).flat_map(|row| std::iter::repeat_n(share(row), width)).collect()
}
