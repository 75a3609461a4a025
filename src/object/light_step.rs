//! The step on the light while the reflectance is held.
//!
//! The unknown is the logarithm of radiance, so the light stays positive and a sun grows as fast as a sky. Two ways:
//! * [`newton`]: the loss is replaced by the quadratic that touches it (Laplace reweighted, logarithms made linear), the
//!   normal equations are solved by conjugate gradients on the matrix of the picture, and the step is halved until the
//!   loss falls. A few steps do what hundreds of first-order ones do.
//! * [`first_order`]: Adam through the net of the deep prior, as released.
//!
//! The deep prior joins the first way by alternation: the light is pulled to what the net says, the net is fitted to the
//! light. Of their difference a share may be carried along ([`DeepTie::carry`]); all of it is ADMM.

mod deep_tie;
mod quadratic;

pub use self::deep_tie::DeepTie;
use self::quadratic::{Quadratic, average};
use super::likelihood::Likelihood;
use super::matrices::LightMatrix;
use super::prior::deep::DeepPrior;
use super::prior::entropy::EntropyPrior;
use super::prior::gradient::GradientPrior;
use super::prior::{LogLight, shares};

/// Largest change of a logarithm in one step of Newton.
const LARGEST_STEP: f32 = 2.0;
/// Halvings of a step before it is given up.
const HALVINGS: usize = 6;

/// What holds the light beside the picture.
#[derive(Clone, Debug, Default)]
pub struct LightTerms {
    /// The gradient prior.
    pub gradient: Option<GradientPrior>,
    /// The entropy prior.
    pub entropy: Option<EntropyPrior>,
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
        if let Some(entropy) = &self.entropy {
            sum += entropy.energy_and_slopes(light).0;
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

/// How much a call of [`newton`] may do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NewtonBudget {
    /// Steps of Newton.
    pub steps: usize,
    /// Products of the matrix within each.
    pub products: usize,
}

/// What a step on the light did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LightOutcome {
    /// The objective at its end.
    pub objective: LightObjective,
    /// Numbers of pictures and steps that were not finite and were left out.
    pub not_finite: usize,
}

/// Improves the light by damped steps of Newton; ends early when a step gains less than 1e-4 of the objective.
pub fn newton(
    matrix: &LightMatrix,
    likelihood: &Likelihood,
    terms: &LightTerms,
    light: &mut LogLight,
    budget: NewtonBudget,
) -> LightOutcome {
    if terms.grey {
        light.make_grey();
    }
    let mut current = objective(matrix, likelihood, terms, light);
    let mut not_finite = 0;
    for _ in 0..budget.steps {
        let quadratic = Quadratic::new(matrix, likelihood, terms, light);
        not_finite += quadratic.not_finite;
        let step = quadratic.step(budget.products);
        let mut length = 1.0f32;
        let mut found = None;
        for _ in 0..HALVINGS {
            let mut moved = light.clone();
            for (logs, step) in moved.channels.iter_mut().zip(&step) {
                for (log, change) in logs.iter_mut().zip(step) {
                    match change.is_finite() {
                        true => *log += (length * change).clamp(-LARGEST_STEP, LARGEST_STEP),
                        false => not_finite += 1,
                    }
                }
            }
            let reached = objective(matrix, likelihood, terms, &moved);
            if reached.total() < current.total() {
                found = Some((moved, reached));
                break;
            }
            length *= 0.5;
        }
        let Some((moved, reached)) = found else { break };
        *light = moved;
        let gain = current.total() - reached.total();
        current = reached;
        if gain < 1e-4 * current.total() {
            break;
        }
    }
    LightOutcome { objective: current, not_finite }
}

/// One first-order step through the net, as released; returns the objective before it.
pub fn first_order(
    matrix: &LightMatrix,
    likelihood: &Likelihood,
    prior: &mut DeepPrior,
    grey: bool,
    rate: f32,
    light: &mut LogLight,
) -> LightOutcome {
    let (logs, tape) = prior.log_light_with_tape();
    light.channels = logs;
    if grey {
        light.make_grey();
    }
    let radiance = light.radiance();
    let state = likelihood.slopes(&matrix.forward(&radiance));
    let mut by_log = matrix.adjoint(&state.by_pixel);
    for channel in 0..3 {
        by_log[channel].iter_mut().zip(&radiance[channel]).for_each(|(slope, value)| *slope *= value);
    }
    if grey {
        average(&mut by_log);
    }
    prior.descend(tape, &by_log, rate);
    LightOutcome { objective: LightObjective { data: state.loss, prior: 0.0 }, not_finite: state.not_finite }
}
