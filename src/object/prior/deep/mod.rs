//! The deep illumination prior: light as what an untrained net makes of fixed noise.
//!
//! Chen, Nobuhara and Nishino 2020, section 5. Read [`net`] first; [`layers`] are its parts, [`planes`] the maps with
//! what lies beyond their borders. A net learns smooth structure sooner than noise, and it joins texels that no pixel
//! sees to those that some do: that is the whole prior, nothing was ever trained.
//!
//! What this folder refuses to do: it knows no picture and no reflectance. It is fitted to a map ([`DeepPrior::fit`]), or
//! handed derivatives by its logarithmic light ([`DeepPrior::descend`]).

pub mod layers;
pub mod net;
pub mod planes;

use crate::error::Result;
use crate::math::random::SequentialRandom;
use crate::neural::adam::Adam;
use net::{INPUT_CHANNELS, Net, NetTape};
use planes::Planes;

/// Largest value of the input, as released.
const INPUT_RANGE: f32 = 0.1;

/// A net with its weights, its input and its optimiser. The light is `exp(offset + what the net gives)`.
#[derive(Clone, Debug)]
pub struct DeepPrior {
    net: Net,
    input: Planes,
    weights: Vec<f32>,
    adam: Adam,
    /// Added to the logarithm of the light, per channel: its level before anything was learned.
    pub offset: [f32; 3],
}

impl DeepPrior {
    /// A prior for maps of `width x height` texels; the paper's net has 128 channels.
    ///
    /// # Errors
    /// `InvalidSetting` for a size the net cannot have.
    pub fn new(width: usize, height: usize, channels: usize, seed: u64) -> Result<Self> {
        let net = Net::new(width, height, channels.max(1))?;
        let mut random = SequentialRandom::new(seed);
        let weights = net.start(&mut random);
        let mut input = Planes::zeros(INPUT_CHANNELS, height, width);
        input.values.iter_mut().for_each(|value| *value = INPUT_RANGE * random.next_number());
        let adam = Adam::new(weights.len());
        Ok(DeepPrior { net, input, weights, adam, offset: [0.0; 3] })
    }

    /// The natural logarithm of the light, channel by channel.
    pub fn log_light(&self) -> [Vec<f32>; 3] {
        self.logs_of(self.net.forward(&self.weights, &self.input).0)
    }

    /// The same, with what is needed to go back.
    pub fn log_light_with_tape(&self) -> ([Vec<f32>; 3], NetTape) {
        let (result, tape) = self.net.forward(&self.weights, &self.input);
        (self.logs_of(result), tape)
    }

    fn logs_of(&self, result: Planes) -> [Vec<f32>; 3] {
        [0, 1, 2].map(|channel| result.channel(channel).iter().map(|value| value + self.offset[channel]).collect())
    }

    /// One step of Adam against the derivatives of a loss by the logarithmic light.
    pub fn descend(&mut self, tape: NetTape, by_log_light: &[Vec<f32>; 3], rate: f32) {
        let mut d_result = Planes::zeros(3, self.input.height, self.input.width);
        let area = d_result.area();
        for (target, source) in d_result.values.chunks_exact_mut(area).zip(by_log_light) {
            target.copy_from_slice(source);
        }
        let mut gradient = vec![0.0; self.weights.len()];
        self.net.backward(&self.weights, tape, &d_result, &mut gradient);
        self.adam.step(&mut self.weights, &gradient, rate);
    }

    /// Moves the net towards a logarithmic light by `steps` of Adam on the squared difference, each texel with its
    /// weight; returns the weighted mean square before the last step.
    pub fn fit(&mut self, target: &[Vec<f32>; 3], weights: &[f32], steps: usize, rate: f32) -> f64 {
        let total = 3.0 * weights.iter().map(|&weight| f64::from(weight)).sum::<f64>().max(1e-30);
        let mut error = f64::NAN;
        for _ in 0..steps {
            let (own, tape) = self.log_light_with_tape();
            let mut sum = 0.0;
            let slopes = [0, 1, 2].map(|channel| {
                let pairs = own[channel].iter().zip(&target[channel]).zip(weights);
                pairs
                    .map(|((own, target), weight)| {
                        let difference = own - target;
                        sum += f64::from(weight * difference * difference);
                        (2.0 / total) as f32 * weight * difference
                    })
                    .collect::<Vec<f32>>()
            });
            error = sum / total;
            self.descend(tape, &slopes, rate);
        }
        error
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn structure_is_learned_sooner_than_noise() {
        let (width, height) = (64, 32);
        let mut random = SequentialRandom::new(4);
        // A sky over a floor with a wide sun, against the same amount of noise.
        let structure: Vec<f32> = (0..width * height)
            .map(|texel| {
                let (row, column) = (texel / width, texel % width);
                let sun = (-((row as f32 - 8.0).powi(2) + (column as f32 - 20.0).powi(2)) / 18.0).exp();
                if row < 16 { 0.5 + 3.0 * sun } else { -1.0 }
            })
            .collect();
        let noise: Vec<f32> = structure.iter().map(|_| 3.4 * (random.next_number() - 0.5)).collect();
        let weights = vec![1.0; width * height];
        let left = |target: &Vec<f32>| {
            let mut prior = DeepPrior::new(width, height, 16, 1).unwrap();
            prior.fit(&[target.clone(), target.clone(), target.clone()], &weights, 60, 0.01)
        };
        let (structure, noise) = (left(&structure), left(&noise));
        assert!(structure < 0.15 && noise > 3.0 * structure, "{structure} {noise}");
    }

    #[test]
    fn the_same_seed_gives_the_same_bits_on_any_number_of_threads() {
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let mut prior = DeepPrior::new(64, 32, 16, 3).unwrap();
                let target = [0.5, 0.1, -0.7].map(|value| vec![value; 64 * 32]);
                prior.fit(&target, &vec![1.0; 64 * 32], 3, 0.01);
                prior.log_light()
            })
        };
        assert_eq!(run(1), run(3));
    }
}
