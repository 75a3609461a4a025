//! The deep prior in alternation with Newton's steps on the light.

use super::newton::{LightOutcome, NewtonBudget, newton};
use super::terms::LightTerms;
use crate::object::likelihood::Likelihood;
use crate::object::matrices::LightMatrix;
use crate::object::prior::deep::DeepPrior;
use crate::object::prior::{LogLight, shares};

/// Steps of Adam in a block of [`DeepTie::warm`].
const WARM_BLOCK: usize = 25;
/// Blocks of it, at most.
const WARM_BLOCKS: usize = 12;
/// A block that leaves more than this share of the squared difference is the last.
const WARM_PATIENCE: f64 = 0.93;

/// The deep prior's part in alternation with Newton: its net, and the pull between it and the light.
#[derive(Clone, Debug)]
pub struct DeepTie {
    /// The net.
    pub prior: DeepPrior,
    /// How strongly light and net are pulled together: weight of the mean square over the sphere.
    pub weight: f64,
    /// Steps of Adam for each step of the light.
    pub net_steps: usize,
    /// Rate of Adam.
    pub rate: f32,
}

impl DeepTie {
    fn terms(&self, terms: &LightTerms) -> LightTerms {
        LightTerms { tie: Some((self.weight, self.prior.log_light())), ..terms.clone() }
    }

    /// The pull between a light and the net as it is now.
    pub fn energy(&self, light: &LogLight) -> f64 {
        self.terms(&LightTerms::default()).energy(light)
    }

    /// One round: light by Newton, net by Adam.
    pub fn round(
        &mut self,
        matrix: &LightMatrix,
        likelihood: &Likelihood,
        terms: &LightTerms,
        light: &mut LogLight,
        budget: NewtonBudget,
    ) -> LightOutcome {
        let outcome = newton(matrix, likelihood, &self.terms(terms), light, budget);
        self.follow(light);
        outcome
    }

    /// Fits the net to a light.
    pub fn follow(&mut self, light: &LogLight) {
        self.prior.fit(&light.channels, &shares(light.width, light.height), self.net_steps, self.rate);
    }

    /// Fits a net that knows nothing to the light that an estimation begins with, until it comes no nearer: an untrained
    /// one would pull that light to nothing.
    pub fn warm(&mut self, light: &LogLight) {
        let shares = shares(light.width, light.height);
        let mut before = f64::INFINITY;
        for _ in 0..WARM_BLOCKS {
            let error = self.prior.fit(&light.channels, &shares, WARM_BLOCK, self.rate);
            if !(error < WARM_PATIENCE * before) {
                break;
            }
            before = error;
        }
    }

    /// The light as the net has it.
    pub fn net_light(&self, width: usize, height: usize) -> LogLight {
        LogLight { width, height, channels: self.prior.log_light() }
    }
}
