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

/// The quadratic around a light: derivatives, and what its matrix is made of.
struct Quadratic<'a> {
    matrix: &'a LightMatrix,
    terms: &'a LightTerms,
    radiance: [Vec<f32>; 3],
    curvature: Vec<[f32; 3]>,
    edges: Option<[Vec<f32>; 3]>,
    /// Diagonal that belongs to no other part: the tie, and a little for texels that nothing holds.
    ridge: Vec<f32>,
    slopes: [Vec<f32>; 3],
    diagonal: [Vec<f32>; 3],
    not_finite: usize,
}

impl<'a> Quadratic<'a> {
    fn new(matrix: &'a LightMatrix, likelihood: &Likelihood, terms: &'a LightTerms, light: &LogLight) -> Self {
        let radiance = light.radiance();
        let state = likelihood.slopes(&matrix.forward(&radiance));
        let shares = shares(light.width, light.height);
        let mut slopes = matrix.adjoint(&state.by_pixel);
        let mut diagonal = matrix.squared_adjoint(&state.curvature);
        for channel in 0..3 {
            for texel in 0..radiance[channel].len() {
                slopes[channel][texel] *= radiance[channel][texel];
                diagonal[channel][texel] *= radiance[channel][texel].powi(2);
            }
        }
        let edges = terms.gradient.as_ref().map(|prior| {
            let weights = [0, 1, 2].map(|channel| {
                let mut weights = prior.edge_weights(&light.channels[channel]);
                weights.iter_mut().for_each(|weight| *weight /= 3.0);
                weights
            });
            for channel in 0..3 {
                prior.add_product(&weights[channel], &light.channels[channel], &mut slopes[channel]);
                prior.add_diagonal(&weights[channel], &mut diagonal[channel]);
            }
            weights
        });
        if let Some(entropy) = &terms.entropy {
            let (_, by_log) = entropy.energy_and_slopes(light);
            for channel in &mut slopes {
                channel.iter_mut().zip(&by_log).for_each(|(slope, value)| *slope += value);
            }
        }
        let mut ridge: Vec<f32> = shares.iter().map(|share| 1e-5 * share).collect();
        if let Some((weight, target)) = &terms.tie {
            for (texel, share) in shares.iter().enumerate() {
                ridge[texel] += (*weight / 3.0) as f32 * share;
                for channel in 0..3 {
                    let pull = (*weight / 3.0) as f32 * share;
                    slopes[channel][texel] += pull * (light.channels[channel][texel] - target[channel][texel]);
                }
            }
        }
        for channel in &mut diagonal {
            channel.iter_mut().zip(&ridge).for_each(|(sum, value)| *sum += value);
        }
        if terms.grey {
            average(&mut slopes);
            average(&mut diagonal);
        }
        let not_finite = state.not_finite;
        Quadratic { matrix, terms, radiance, curvature: state.curvature, edges, ridge, slopes, diagonal, not_finite }
    }

    /// The matrix of the quadratic times a direction.
    fn product(&self, direction: &[Vec<f32>; 3]) -> [Vec<f32>; 3] {
        let scaled = [0, 1, 2].map(|channel| {
            direction[channel].iter().zip(&self.radiance[channel]).map(|(a, b)| a * b).collect::<Vec<f32>>()
        });
        let mut picture = self.matrix.forward(&scaled);
        for (pixel, curvature) in picture.iter_mut().zip(&self.curvature) {
            (0..3).for_each(|channel| pixel[channel] *= curvature[channel]);
        }
        let mut product = self.matrix.adjoint(&picture);
        for channel in 0..3 {
            for texel in 0..self.ridge.len() {
                product[channel][texel] = product[channel][texel] * self.radiance[channel][texel]
                    + self.ridge[texel] * direction[channel][texel];
            }
            if let (Some(prior), Some(edges)) = (&self.terms.gradient, &self.edges) {
                prior.add_product(&edges[channel], &direction[channel], &mut product[channel]);
            }
        }
        if self.terms.grey {
            average(&mut product);
        }
        product
    }

    /// Solves for the step by conjugate gradients with the diagonal as preconditioner, channel by channel.
    fn step(&self, products: usize) -> [Vec<f32>; 3] {
        let texels = self.ridge.len();
        let mut step = [0; 3].map(|_| vec![0.0f32; texels]);
        let mut residual = self.slopes.clone();
        residual.iter_mut().flatten().for_each(|value| *value = -*value);
        let precondition = |residual: &[Vec<f32>; 3]| {
            [0, 1, 2].map(|channel| {
                let pairs = residual[channel].iter().zip(&self.diagonal[channel]);
                pairs.map(|(value, diagonal)| value / diagonal.max(1e-20)).collect::<Vec<f32>>()
            })
        };
        let mut direction = precondition(&residual);
        let mut along = dots(&residual, &direction);
        let first = along;
        for _ in 0..products {
            let product = self.product(&direction);
            let curvature = dots(&direction, &product);
            for channel in 0..3 {
                if !(curvature[channel] > 0.0) || along[channel] < 1e-8 * first[channel] {
                    continue;
                }
                let length = (along[channel] / curvature[channel]) as f32;
                for texel in 0..texels {
                    step[channel][texel] += length * direction[channel][texel];
                    residual[channel][texel] -= length * product[channel][texel];
                }
            }
            let scaled = precondition(&residual);
            let next = dots(&residual, &scaled);
            for channel in 0..3 {
                let ratio = if along[channel] > 0.0 { (next[channel] / along[channel]) as f32 } else { 0.0 };
                let pairs = direction[channel].iter_mut().zip(&scaled[channel]);
                pairs.for_each(|(value, scaled)| *value = scaled + ratio * *value);
            }
            along = next;
        }
        step
    }
}

fn dots(a: &[Vec<f32>; 3], b: &[Vec<f32>; 3]) -> [f64; 3] {
    [0, 1, 2].map(|channel| a[channel].iter().zip(&b[channel]).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum())
}

/// Replaces the channels by their mean.
fn average(channels: &mut [Vec<f32>; 3]) {
    for texel in 0..channels[0].len() {
        let mean = (channels[0][texel] + channels[1][texel] + channels[2][texel]) / 3.0;
        (0..3).for_each(|channel| channels[channel][texel] = mean);
    }
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
