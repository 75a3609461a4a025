//! The way to the least of pixels' squares and of the beliefs' parabola: conjugate gradients, preconditioned by the diagonal
//! (Hestenes and Stiefel 1952).
//!
//! A list of all texels is longer than any cache, so that what an iteration costs is how often lists are gone over: once
//! for what goes along the direction, once for the next one.

use super::neighbours::Parabola;
use super::pixel_system::{CHUNK, Lanes, PixelSystem, Rows};
use super::sight::Slopes;
use super::way::Step;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// Sums of a dot product, lane by lane.
#[derive(Clone, Copy, Default)]
struct Dot([f64; 8]);

impl Dot {
    #[inline]
    fn add(&mut self, a: &Lanes, b: &Lanes) {
        for k in 0..8 {
            self.0[k] += f64::from(a[k]) * f64::from(b[k]);
        }
    }

    fn total(of_chunks: &[Dot]) -> f64 {
        of_chunks.iter().flat_map(|own| own.0).sum()
    }
}

fn dot(a: &[Lanes], b: &[Lanes]) -> f64 {
    let of_chunk = |(a, b): (&[Lanes], &[Lanes])| {
        let mut dot = Dot::default();
        a.iter().zip(b).for_each(|(a, b)| dot.add(a, b));
        dot
    };
    Dot::total(&a.par_chunks(CHUNK).zip(b.par_chunks(CHUNK)).map(of_chunk).collect::<Vec<_>>())
}

/// Divides by the diagonal of the curvature, in as many lanes as move.
struct Preconditioner {
    diagonal: Vec<Lanes>,
    lanes: usize,
}

impl Preconditioner {
    #[inline]
    fn of(&self, texel: usize, residual: &Lanes) -> Lanes {
        let diagonal = &self.diagonal[texel];
        std::array::from_fn(|k| if k < self.lanes && diagonal[k] > 0.0 { residual[k] / diagonal[k] } else { 0.0 })
    }
}

/// The way to the least of pixels' squares and beliefs' parabola, about; `ahead` hears of it after each iteration, with how many
/// are done. `None` when `stop` was raised.
pub(super) fn conjugate_gradients(
    system: &mut PixelSystem,
    rows: Rows,
    beliefs: &Parabola,
    step: Step,
    stop: &AtomicBool,
    ahead: &mut dyn FnMut(usize, &[Lanes]),
) -> Option<Vec<Lanes>> {
    let mut diagonal = system.diagonal(rows);
    diagonal.par_iter_mut().enumerate().for_each(|(texel, diagonal)| {
        let of_beliefs = beliefs.diagonal(texel);
        (0..8).for_each(|k| diagonal[k] += of_beliefs[k]);
    });
    let preconditioner = Preconditioner { diagonal, lanes: if step.slopes == Slopes::OfWidths { 7 } else { 6 } };
    let mut residual = system.pull(rows);
    residual.par_iter_mut().zip(beliefs.slope()).for_each(|(own, slope)| (0..8).for_each(|k| own[k] -= slope[k]));
    let mut way = vec![[0.0f32; 8]; residual.len()];
    let mut direction: Vec<Lanes> =
        residual.par_iter().enumerate().map(|(texel, own)| preconditioner.of(texel, own)).collect();
    let mut product = vec![[0.0f32; 8]; residual.len()];
    let mut power = dot(&residual, &direction);
    let first = power;
    for iteration in 1..=step.iterations {
        if stop.load(Ordering::Relaxed) {
            return None;
        }
        if power.is_nan() || power <= 1e-10 * first {
            break;
        }
        system.product(rows, &direction, &mut product);
        beliefs.add_product(&direction, &mut product);
        let along = dot(&direction, &product);
        if along.is_nan() || along <= 0.0 {
            break;
        }
        let length = (power / along) as f32;
        let lists = way.par_chunks_mut(CHUNK).zip(residual.par_chunks_mut(CHUNK)).enumerate();
        let go = |(chunk, (way, residual)): (usize, (&mut [Lanes], &mut [Lanes]))| {
            let mut dot = Dot::default();
            for (texel, (way, residual)) in (chunk * CHUNK..).zip(way.iter_mut().zip(residual)) {
                for k in 0..8 {
                    way[k] += length * direction[texel][k];
                    residual[k] -= length * product[texel][k];
                }
                dot.add(residual, &preconditioner.of(texel, residual));
            }
            dot
        };
        let next = Dot::total(&lists.map(go).collect::<Vec<_>>());
        let kept = (next / power) as f32;
        direction.par_iter_mut().zip(&residual).enumerate().for_each(|(texel, (direction, residual))| {
            let down = preconditioner.of(texel, residual);
            (0..8).for_each(|k| direction[k] = kept * direction[k] + down[k]);
        });
        power = next;
        ahead(iteration, &way);
    }
    Some(way)
}
