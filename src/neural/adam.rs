//! Adam (Kingma and Ba 2015) on a slice of weights.

use crate::math::adam::{Decay, LARGEST_GRADIENT};

/// The paper's.
const DECAY: Decay = Decay { first: 0.9, second: 0.999 };
/// Added to the root of the second moment.
const EPSILON: f32 = 1e-10;

/// Moments of the gradient and how many steps made them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Adam {
    /// Mean of the gradient.
    pub first: Vec<f32>,
    /// Mean of its square.
    pub second: Vec<f32>,
    /// Steps done.
    pub steps: u64,
}

impl Adam {
    /// For `count` weights, nothing seen.
    pub fn new(count: usize) -> Self {
        Adam { first: vec![0.0; count], second: vec![0.0; count], steps: 0 }
    }

    /// Moves the weights against the gradient by steps of about `rate`. Parts of a gradient that are not finite count
    /// as zero.
    pub fn step(&mut self, weights: &mut [f32], gradient: &[f32], rate: f32) {
        self.steps += 1;
        let count = self.steps.min(1_000_000) as i32;
        let (one, two) = (1.0 - DECAY.first.powi(count), 1.0 - DECAY.second.powi(count));
        for index in 0..weights.len() {
            let own = if gradient[index].abs() < LARGEST_GRADIENT { gradient[index] } else { 0.0 };
            DECAY.accumulate(own, &mut self.first[index], &mut self.second[index]);
            weights[index] -= rate * (self.first[index] / one) / ((self.second[index] / two).sqrt() + EPSILON);
        }
    }
}

/// How the rate falls from the first step to the last.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RateSchedule {
    /// It does not.
    Constant,
    /// Along half a cosine down to a thousandth.
    Cosine,
}

impl RateSchedule {
    /// The factor of the rate at `step` of `steps`; it rises over the first hundred steps.
    pub fn factor(self, step: u64, steps: u64) -> f32 {
        match self {
            RateSchedule::Constant => 1.0,
            RateSchedule::Cosine => {
                let progress = (step as f64 / steps.max(1) as f64).min(1.0);
                let wave = 0.5 * (1.0 + (std::f64::consts::PI * progress).cos());
                let rise = ((step + 1) as f64 / 100.0).min(1.0);
                (rise * (0.001 + 0.999 * wave)) as f32
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bowl_is_descended_and_nan_does_no_harm() {
        let mut weights = [3.0f32, -2.0];
        let mut adam = Adam::new(2);
        for step in 0..2000 {
            let spoilt = if step % 7 == 0 { f32::NAN } else { 20.0 * weights[1] };
            let gradient = [2.0 * weights[0], spoilt];
            adam.step(&mut weights, &gradient, 0.05 * RateSchedule::Cosine.factor(step, 2000));
        }
        assert!(weights.iter().all(|weight| weight.abs() < 1e-2), "{weights:?}");
    }
}
