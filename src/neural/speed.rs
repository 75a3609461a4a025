//! How fast a flow is, in evaluations and samples a second.

use super::columns::{ColumnTape, Nest, NestPoints};
use super::flow::{Flow, FlowTape};
use crate::math::random::SequentialRandom;
use std::time::Instant;

/// Figures of one flow on all threads of the pool.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Speed {
    /// Log densities a second, every point with its own conditioners.
    pub evaluations_per_second: f64,
    /// Log densities a second with gradients of weights and codes, on one thread.
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
    let samples_per_second = best(&mut || drop(flow.from_uniform(&points, &code)));
    let (mut d_weights, mut d_codes) = (vec![0.0; flow.weights.len()], vec![0.0; code.len()]);
    let mut tape = FlowTape::default();
    let gradients_per_second = best(&mut || {
        // In parts, so that what a pass leaves for the way back fits the cache.
        for part in points.chunks(super::flow::CHUNK) {
            flow.forward(&mut part.to_vec(), &code, part.len(), &mut tape);
            flow.backward(&mut tape, &vec![1.0; part.len()], &mut d_weights, &mut d_codes);
        }
    });
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
