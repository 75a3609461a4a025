//! The deep prior in alternation with Newton's steps on the light.

use super::newton::{LightOutcome, NewtonBudget, newton};
use super::terms::LightTerms;
use crate::object::likelihood::Likelihood;
use crate::object::matrices::LightMatrix;
use crate::object::prior::deep::DeepPrior;
use crate::object::prior::{LogLight, shares};

/// The deep prior's part in alternation with Newton: its net, and the difference that is carried along.
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
    /// Share of the difference that is carried along: 1 is ADMM, 0 is descent on one objective, that of
    /// [`DeepTie::energy`].
    pub carry: f32,
    carried: [Vec<f32>; 3],
}

impl DeepTie {
    /// A tie to a fresh net.
    pub fn new(prior: DeepPrior, texels: usize, weight: f64, net_steps: usize, rate: f32, carry: f32) -> Self {
        DeepTie { prior, weight, net_steps, rate, carry, carried: [0; 3].map(|_| vec![0.0; texels]) }
    }

    /// The pull between a light and the net as it is now: a function of both, whatever is carried along.
    pub fn energy(&self, light: &LogLight) -> f64 {
        let terms = LightTerms { tie: Some((self.weight, self.prior.log_light())), ..LightTerms::default() };
        terms.energy(light)
    }

    /// One round: light by Newton, net by Adam, difference carried along.
    pub fn round(
        &mut self,
        matrix: &LightMatrix,
        likelihood: &Likelihood,
        terms: &LightTerms,
        light: &mut LogLight,
        budget: NewtonBudget,
    ) -> LightOutcome {
        let net = self.prior.log_light();
        let pulled = |own: &[Vec<f32>; 3], sign: f32, carried: &[Vec<f32>; 3]| {
            [0, 1, 2].map(|channel| {
                own[channel].iter().zip(&carried[channel]).map(|(log, rest)| log + sign * rest).collect::<Vec<f32>>()
            })
        };
        let terms = LightTerms { tie: Some((self.weight, pulled(&net, -1.0, &self.carried))), ..terms.clone() };
        let outcome = newton(matrix, likelihood, &terms, light, budget);
        let target = pulled(&light.channels, 1.0, &self.carried);
        self.prior.fit(&target, &shares(light.width, light.height), self.net_steps, self.rate);
        let net = self.prior.log_light();
        for channel in 0..3 {
            for texel in 0..net[channel].len() {
                let apart = light.channels[channel][texel] - net[channel][texel];
                // What neither side can give up must not pile up.
                self.carried[channel][texel] = (self.carried[channel][texel] + self.carry * apart).clamp(-2.0, 2.0);
            }
        }
        outcome
    }

    /// The light as the net has it.
    pub fn net_light(&self, width: usize, height: usize) -> LogLight {
        LogLight { width, height, channels: self.prior.log_light() }
    }
}
