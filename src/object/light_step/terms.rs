//! What a step on the light minimises.

use crate::object::likelihood::Likelihood;
use crate::object::matrices::LightMatrix;
use crate::object::prior::gradient::GradientPrior;
use crate::object::prior::{LogLight, shares};

/// What holds the light beside the picture.
#[derive(Clone, Debug, Default)]
pub struct LightTerms {
    /// The gradient prior.
    pub gradient: Option<GradientPrior>,
    /// A quadratic pull: weight of the mean square over the sphere, and where to.
    pub tie: Option<(f64, [Vec<f32>; 3])>,
    /// All channels are one: a grey light.
    pub grey: bool,
}

/// The terms of the objective at a light.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct LightObjective {
    /// The picture's.
    pub data: f64,
    /// The priors'.
    pub prior: f64,
}

impl LightObjective {
    /// Their sum.
    pub fn total(&self) -> f64 {
        self.data + self.prior
    }
}

impl LightTerms {
    /// The priors' part of the objective.
    pub fn energy(&self, light: &LogLight) -> f64 {
        let mut sum = 0.0;
        if let Some(gradient) = &self.gradient {
            sum += light.channels.iter().map(|channel| gradient.energy(channel)).sum::<f64>() / 3.0;
        }
        if let Some((weight, target)) = &self.tie {
            let shares = shares(light.width, light.height);
            for (channel, target) in light.channels.iter().zip(target) {
                let squares = channel.iter().zip(target).zip(&shares);
                let mean = squares.map(|((log, target), share)| f64::from(share * (log - target).powi(2))).sum::<f64>();
                sum += 0.5 * weight * mean / 3.0;
            }
        }
        sum
    }
}

/// Objective at a light.
pub fn objective(
    matrix: &LightMatrix,
    likelihood: &Likelihood,
    terms: &LightTerms,
    light: &LogLight,
) -> LightObjective {
    LightObjective { data: likelihood.loss(&matrix.forward(&light.radiance())), prior: terms.energy(light) }
}
