//! How fast a flow is, in evaluations and samples a second.

use crate::math::parallel;
use crate::math::random::SequentialRandom;
use crate::neural::columns::{ColumnTape, Nest, NestPoints};
use crate::neural::flow::{Flow, FlowTape};
use std::time::Instant;

/// Figures of one flow on all threads of the pool.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Speed {
    /// Log densities a second, every point with its own conditioners.
    pub evaluations_per_second: f64,
    /// Log densities a second with gradients of weights and codes.
    pub gradients_per_second: f64,
    /// Log densities a second in columns of 64 that share a conditioner, on one thread; 0 for a flow without columns.
    pub in_columns_per_second: f64,
    /// Exact samples a second.
    pub samples_per_second: f64,
    /// Points of a batch.
    pub batch: usize,
}

/// Times a flow on batches of `batch` points, the best of `repeats` each.
pub fn measure(flow: &Flow, batch: usize, repeats: usize) -> Speed {
    let mut random = SequentialRandom::new(1);
    let batch = batch.max(64) / 64 * 64;
    let points: Vec<[f64; 3]> = (0..batch).map(|_| [0; 3].map(|_| f64::from(random.next_number()))).collect();
    let code: Vec<f32> = (0..flow.architecture().code).map(|_| 0.2 * (random.next_number() - 0.5)).collect();
    let best = |work: &mut dyn FnMut()| -> f64 {
        let mut least = f64::INFINITY;
        for _ in 0..repeats.max(1) {
            let begin = Instant::now();
            work();
            least = least.min(begin.elapsed().as_secs_f64());
        }
        batch as f64 / least.max(1e-9)
    };
    let evaluations_per_second = best(&mut || drop(flow.log_density(&points, &code)));
    let samples_per_second = best(&mut || drop(flow.carry_from_uniform(&points, &code)));
    let gradients_per_second = best(&mut || drop(gradient(flow, &points, &code)));
    let in_columns_per_second = if flow.architecture().is_triangular() {
        let nest = Nest { azimuths: batch / 64, differences: 1, halves: 64 };
        let take = |axis: usize, count: usize| points[..count].iter().map(|point| point[axis]).collect();
        let at = NestPoints { azimuths: take(2, batch / 64), differences: take(1, batch / 64), halves: take(0, batch) };
        let mut tape = ColumnTape::default();
        best(&mut || drop(flow.columns(&code, nest, &at, &mut tape)))
    } else {
        0.0
    };
    Speed { evaluations_per_second, gradients_per_second, in_columns_per_second, samples_per_second, batch }
}

/// Derivatives of the sum of log densities by weights and code. Each task has sums of its own, added in a fixed order.
fn gradient(flow: &Flow, points: &[[f64; 3]], code: &[f32]) -> (Vec<f32>, Vec<f32>) {
    const TASKS: usize = 16;
    let parts = parallel::map_chunks(points, points.len().div_ceil(TASKS), |_, points| {
        let (mut d_weights, mut d_codes) = (vec![0.0; flow.weights.len()], vec![0.0; code.len()]);
        let mut tape = FlowTape::default();
        // In parts, so that what a pass leaves for the way back fits the cache.
        for part in points.chunks(crate::neural::flow::CHUNK) {
            flow.forward(&mut part.to_vec(), code, part.len(), &mut tape);
            flow.backward(&mut tape, &vec![1.0; part.len()], &mut d_weights, &mut d_codes);
        }
        (d_weights, d_codes)
    });
    let add = |sum: &mut [f32], part: &[f32]| sum.iter_mut().zip(part).for_each(|(sum, own)| *sum += own);
    parts.into_iter().fold((vec![0.0; flow.weights.len()], vec![0.0; code.len()]), |mut sum, part| {
        add(&mut sum.0, &part.0);
        add(&mut sum.1, &part.1);
        sum
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gradient_that_is_timed_is_that_of_one_pass() {
        let flow = crate::neural::shipped().unwrap().flow;
        let code = vec![0.1; flow.architecture().code];
        let mut random = SequentialRandom::new(2);
        let points: Vec<[f64; 3]> = (0..300).map(|_| [0; 3].map(|_| f64::from(random.next_number()))).collect();
        let (mut d_weights, mut d_codes) = (vec![0.0; flow.weights.len()], vec![0.0; code.len()]);
        let mut tape = FlowTape::default();
        flow.forward(&mut points.clone(), &code, points.len(), &mut tape);
        flow.backward(&mut tape, &vec![1.0; points.len()], &mut d_weights, &mut d_codes);
        let (weights, codes) = gradient(&flow, &points, &code);
        let largest = d_weights.iter().fold(0.0f32, |a, b| a.max(b.abs()));
        assert!(weights.iter().zip(&d_weights).all(|(a, b)| (a - b).abs() < 1e-3 * largest));
        assert!(
            codes.iter().zip(&d_codes).all(|(a, b)| (a - b).abs() < 1e-3 * (1.0 + b.abs())),
            "{codes:?} {d_codes:?}"
        );
    }
}
