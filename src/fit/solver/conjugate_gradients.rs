//! The way to the least of pixels' squares and of the beliefs' parabola: conjugate gradients, preconditioned by the diagonal
//! (Hestenes and Stiefel 1952).

use super::descent::Step;
use super::neighbours::Parabola;
use super::pixel_system::{Lanes, PixelSystem, Rows};
use super::sight::Slopes;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// Texels that one sum of a dot product goes over: sums are the same whatever the number of threads.
const CHUNK: usize = 1 << 14;

fn dot(a: &[Lanes], b: &[Lanes]) -> f64 {
    let of_chunk = |(a, b): (&[Lanes], &[Lanes])| -> f64 {
        a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
    };
    let sums: Vec<f64> = a.par_chunks(CHUNK).zip(b.par_chunks(CHUNK)).map(of_chunk).collect();
    sums.into_iter().sum()
}

/// `a = factor_of_a a + factor_of_b b`.
fn combine(a: &mut [Lanes], factor_of_a: f32, b: &[Lanes], factor_of_b: f32) {
    a.par_iter_mut().zip(b).for_each(|(a, b)| {
        for k in 0..8 {
            a[k] = factor_of_a * a[k] + factor_of_b * b[k];
        }
    });
}

/// The way to the least of pixels' squares and beliefs' parabola, about. `None` when `stop` was raised.
pub(super) fn conjugate_gradients(
    system: &mut PixelSystem,
    rows: Rows,
    beliefs: &Parabola,
    step: Step,
    stop: &AtomicBool,
) -> Option<Vec<Lanes>> {
    let mut diagonal = system.diagonal(rows);
    diagonal.par_iter_mut().enumerate().for_each(|(texel, diagonal)| {
        let of_beliefs = beliefs.diagonal(texel);
        for k in 0..8 {
            diagonal[k] += of_beliefs[k];
        }
    });
    let precondition = |residual: &[Lanes]| -> Vec<Lanes> {
        let lanes = if step.slopes == Slopes::OfWidths { 7 } else { 6 };
        let one = |(residual, diagonal): (&Lanes, &Lanes)| {
            std::array::from_fn(|k| if k < lanes && diagonal[k] > 0.0 { residual[k] / diagonal[k] } else { 0.0 })
        };
        residual.par_iter().zip(&diagonal).map(one).collect()
    };
    let mut residual = system.pull(rows);
    combine(&mut residual, 1.0, beliefs.slope(), -1.0);
    let mut way = vec![[0.0f32; 8]; residual.len()];
    let mut z = precondition(&residual);
    let mut direction = z.clone();
    let mut power = dot(&residual, &z);
    let first = power;
    for _ in 0..step.iterations {
        if stop.load(Ordering::Relaxed) {
            return None;
        }
        if power.is_nan() || power <= 1e-10 * first {
            break;
        }
        let mut product = system.product(rows, &direction);
        beliefs.add_product(&direction, &mut product);
        let along = dot(&direction, &product);
        if along.is_nan() || along <= 0.0 {
            break;
        }
        let length = (power / along) as f32;
        combine(&mut way, 1.0, &direction, length);
        combine(&mut residual, 1.0, &product, -length);
        z = precondition(&residual);
        let next = dot(&residual, &z);
        combine(&mut direction, (next / power) as f32, &z, 1.0);
        power = next;
    }
    Some(way)
}
