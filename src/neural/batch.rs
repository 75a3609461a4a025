//! One step's points, their densities, and the gradient of the likelihood on them.
//!
//! The objective is equation 7 of the paper: the mean over materials and channels of the expectation of `log p` under
//! the target density `q`. Points are not drawn from `q`. They cover the cube evenly (jittered strata), each weighs its
//! density, and since the expectation of `d log p` under `p` itself is zero, `q - p` may stand for `q`:
//! `d/dw E_q[log p] = E_uniform[(q - p) d log p / dw]`. The noise of that sum falls to zero where the flow is right.

use super::columns::{Nest, NestPoints};
use super::flow::Flow;
use super::pass::Pass;
use super::target::TargetGrid;
use crate::math::parallel;
use crate::math::random::{SequentialRandom, mix};

/// Groups that one thread takes at once: fixed, so that sums are taken in the same order whatever the threads.
const GROUPS_PER_CHUNK: usize = 8;

/// What training makes small: the negative likelihood, and a part of the squared log error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Objective {
    /// Weight of the mean squared difference of logarithms of stored values, in nats; 0 in the paper. Likelihood cares
    /// for bright parts, this for dark ones, by which models are compared.
    pub log_error_weight: f64,
}

/// Differences of logarithms beyond this pull no harder: a measured zero has no logarithm to reach.
const LARGEST_DIFFERENCE: f64 = 2.0;

/// `log(1 + stored value)` is held below this: a stored value of 10^34 is bright enough.
pub const LARGEST_EXPONENT: f64 = 80.0;

/// A density to learn in this step: the target.
#[derive(Clone, Copy, Debug)]
pub struct Task<'a> {
    /// The target.
    pub target: &'a TargetGrid,
}

/// Sums over the points of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Figures {
    /// Mean of `q log p` in nats: the likelihood of equation 7.
    pub log_likelihood: f64,
    /// Mean of `q log(q / p) - q + p` in nats: what the likelihood lacks to its bound. Never negative.
    pub divergence: f64,
    /// Mean squared difference of the logarithms of stored values.
    pub squared_log_error: f64,
}

/// What one step found.
#[derive(Debug)]
pub struct Found {
    /// Means over all points.
    pub figures: Figures,
    /// Adjoint of the negative likelihood by weight.
    pub d_weights: Vec<f32>,
    /// By number of the code of each task.
    pub d_codes: Vec<f32>,
}

/// Points of one group: strata in all three coordinates, jittered by the key.
fn scatter(nest: Nest, key: u64, into: &mut NestPoints) {
    let mut random = SequentialRandom::new(key);
    let mut jitter = || f64::from(random.next_number());
    let turn = jitter();
    for azimuth in 0..nest.azimuths {
        into.azimuths.push((azimuth as f64 + turn) / nest.azimuths as f64);
        let shift = jitter();
        for difference in 0..nest.differences {
            into.differences.push((difference as f64 + shift) / nest.differences as f64);
            let shift = jitter();
            into.halves.extend((0..nest.halves).map(|half| (half as f64 + shift) / nest.halves as f64));
        }
    }
}

/// Evaluates tasks on `nest` points each, drawn by `key`, and pulls the gradient of the objective back, if there is one.
/// `codes` has one row per task.
pub fn evaluate(flow: &Flow, tasks: &[Task], codes: &[f32], nest: Nest, key: u64, learn: Option<Objective>) -> Found {
    let log_error_weight = learn.map_or(0.0, |objective| objective.log_error_weight);
    let length = flow.architecture().code;
    let points = nest.points();
    let scale = 1.0 / (tasks.len() * points) as f64;
    let chunk_count = tasks.len().div_ceil(GROUPS_PER_CHUNK);
    let of_chunk = |chunk: usize| -> Found {
        let range = chunk * GROUPS_PER_CHUNK..((chunk + 1) * GROUPS_PER_CHUNK).min(tasks.len());
        let codes = &codes[range.start * length..range.end * length];
        let mut at = NestPoints::default();
        let mut stored = Vec::with_capacity(range.len() * points);
        for index in range.clone() {
            let (from_azimuth, from_column) = (at.azimuths.len(), at.differences.len());
            scatter(nest, mix(key ^ mix(index as u64 + 1)), &mut at);
            for column in from_column..at.differences.len() {
                let azimuth = at.azimuths[from_azimuth + (column - from_column) / nest.differences];
                let target = tasks[index].target.column(at.differences[column], azimuth);
                stored
                    .extend(at.halves[column * nest.halves..(column + 1) * nest.halves].iter().map(|&u| target.at(u)));
            }
        }
        let mut tape = Pass::of(flow);
        let log_density = tape.forward(flow, codes, nest, &at);
        let mut figures = Figures::default();
        let mut d_log_density = Vec::with_capacity(log_density.len());
        for (index, (&log_p, &stored)) in log_density.iter().zip(&stored).enumerate() {
            let mean = tasks[range.start + index / points].target.mean();
            let (p, q) = (log_p.exp(), stored / mean);
            figures.log_likelihood += q * log_p * scale;
            figures.divergence += (if q > 0.0 { q * (q.ln() - log_p) } else { 0.0 } - q + p) * scale;
            let difference = ((mean * p).min(LARGEST_EXPONENT).exp_m1() + 1e-6).ln() - (stored.exp_m1() + 1e-6).ln();
            figures.squared_log_error += difference * difference * scale;
            // Early on a density can be far too high somewhere: it should not shout down all others.
            let of_likelihood = -(q - p).clamp(-20.0, 20.0);
            let exponent = (mean * p).min(LARGEST_EXPONENT);
            let slope = exponent * exponent.exp() / (exponent.exp_m1() + 1e-6);
            let of_log_error = 2.0 * difference.clamp(-LARGEST_DIFFERENCE, LARGEST_DIFFERENCE) * slope;
            d_log_density.push(scale * (of_likelihood + log_error_weight * of_log_error));
        }
        let mut found = Found { figures, d_weights: Vec::new(), d_codes: vec![0.0; codes.len()] };
        if learn.is_some() {
            found.d_weights = vec![0.0; flow.weights.len()];
            tape.backward(flow, nest, &at, &d_log_density, &mut found.d_weights, &mut found.d_codes);
        }
        found
    };
    // A few chunks at a time, added in order: memory stays small and the bits the same.
    let mut sum = Found { figures: Figures::default(), d_weights: Vec::new(), d_codes: Vec::new() };
    for first in (0..chunk_count).step_by(8) {
        for found in parallel::map((chunk_count - first).min(8), |index| of_chunk(first + index)) {
            sum.figures.log_likelihood += found.figures.log_likelihood;
            sum.figures.divergence += found.figures.divergence;
            sum.figures.squared_log_error += found.figures.squared_log_error;
            if sum.d_weights.is_empty() {
                sum.d_weights = found.d_weights;
            } else {
                sum.d_weights.iter_mut().zip(&found.d_weights).for_each(|(sum, own)| *sum += own);
            }
            sum.d_codes.extend(found.d_codes);
        }
    }
    sum
}
