//! Diffuse reflectance at the end: all texels together, with the full footprints of the pixels.
//!
//! With light, F0 and width known, a pixel is `E sum_t w_t rho_t` plus what the lobe sends: linear, and sparse
//! ([`super::diffuse_system`]). Conjugate gradients on the normal equations, one channel like the other, starting from the
//! texel-by-texel solution and leaning on it where pixels say little.

use super::diffuse_system::DiffuseSystem;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// Texels that one sum of a dot product goes over: sums are the same whatever the number of threads.
const DOT_CHUNK: usize = 1 << 14;

/// What texels lean on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leaning {
    /// Weight of the start values, in units of the mean diagonal of the normal equations.
    pub start: f32,
    /// Weight of the difference between neighbours that pixels show: what is finer than the photos is smooth.
    pub neighbours: Neighbours,
}

/// By how much neighbouring texels are believed to differ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Neighbours {
    /// A weight in units of the mean diagonal of the normal equations, the same for all.
    Alike(f32),
    /// A standard deviation of the difference of their logarithms, where weights are those of the pixels' noise.
    Relative(f32),
}

/// Leaning of the texels of square maps on their start and on each other.
struct Held {
    size: usize,
    /// Diagonal of the pixels' normal equations; a texel that no pixel shows has none.
    diagonal: Vec<[f32; 3]>,
    ridge: f32,
    stiffness: Stiffness,
}

/// Weight of the difference between two texels.
enum Stiffness {
    Alike(f32),
    /// Of differences relative to these values.
    Relative {
        precision: f32,
        least: f32,
        values: Vec<[f32; 3]>,
    },
}

impl Stiffness {
    #[inline]
    fn between(&self, one: usize, other: usize, channel: usize) -> f32 {
        match self {
            Stiffness::Alike(stiffness) => *stiffness,
            Stiffness::Relative { precision, least, values } => {
                precision / (values[one][channel].max(*least) * values[other][channel].max(*least))
            }
        }
    }
}

/// Texels darker than this share of the mean count as that bright where differences are relative.
const LEAST_SHARE: f32 = 0.05;

impl Held {
    fn new(diagonal: Vec<[f32; 3]>, leaning: Leaning, rho: &[[f32; 3]]) -> Self {
        let seen = diagonal.iter().filter(|d| d[0] > 0.0).count().max(1);
        let mean = diagonal.iter().map(|d| f64::from(d[0] + d[1] + d[2]) / 3.0).sum::<f64>() / seen as f64;
        let scaled = |weight: f32| (f64::from(weight) * mean) as f32;
        let stiffness = match leaning.neighbours {
            Neighbours::Alike(weight) => Stiffness::Alike(scaled(weight)),
            Neighbours::Relative(deviation) => {
                let shown = rho.iter().zip(&diagonal).filter(|(_, diagonal)| diagonal[0] > 0.0);
                let sum: f64 = shown.map(|(rho, _)| f64::from(rho.iter().sum::<f32>()) / 3.0).sum();
                let least = LEAST_SHARE * (sum / seen as f64).max(1e-6) as f32;
                Stiffness::Relative { precision: 1.0 / (deviation * deviation), least, values: rho.to_vec() }
            }
        };
        Held { size: diagonal.len().isqrt(), diagonal, ridge: scaled(leaning.start), stiffness }
    }

    /// The texels beside one that pixels show as well.
    fn neighbours(&self, texel: usize) -> impl Iterator<Item = usize> + '_ {
        let size = self.size;
        let (row, column) = (texel / size, texel % size);
        let known = [
            (row > 0).then(|| texel - size),
            (row + 1 < size).then(|| texel + size),
            (column > 0).then(|| texel - 1),
            (column + 1 < size).then(|| texel + 1),
        ];
        let shown = self.diagonal[texel][0] > 0.0;
        known.into_iter().flatten().filter(move |&other| shown && self.diagonal[other][0] > 0.0)
    }

    /// Adds what leaning makes of `x` to the product of the pixels' equations.
    fn add_product(&self, x: &[[f32; 3]], product: &mut [[f32; 3]]) {
        product.par_iter_mut().enumerate().for_each(|(texel, product)| {
            let own = x[texel];
            for c in 0..3 {
                product[c] += self.ridge * own[c];
            }
            for other in self.neighbours(texel) {
                for c in 0..3 {
                    product[c] += self.stiffness.between(texel, other, c) * (own[c] - x[other][c]);
                }
            }
        });
    }

    /// Residual over the diagonal.
    fn precondition(&self, residual: &[[f32; 3]], made: &mut [[f32; 3]]) {
        made.par_iter_mut().enumerate().for_each(|(texel, made)| {
            *made = [0, 1, 2].map(|c| {
                let pulls: f32 = self.neighbours(texel).map(|other| self.stiffness.between(texel, other, c)).sum();
                residual[texel][c] / (self.diagonal[texel][c] + self.ridge + pulls).max(1e-20)
            });
        });
    }
}

fn dot(a: &[[f32; 3]], b: &[[f32; 3]]) -> [f64; 3] {
    let of_chunk = |(a, b): (&[[f32; 3]], &[[f32; 3]])| {
        let mut sum = [0.0f64; 3];
        for (a, b) in a.iter().zip(b) {
            for c in 0..3 {
                sum[c] += f64::from(a[c]) * f64::from(b[c]);
            }
        }
        sum
    };
    let sums: Vec<[f64; 3]> = a.par_chunks(DOT_CHUNK).zip(b.par_chunks(DOT_CHUNK)).map(of_chunk).collect();
    sums.into_iter().fold([0.0; 3], |total, sum| [0, 1, 2].map(|c| total[c] + sum[c]))
}

/// `a = factor_of_a a + factor_of_b b` per channel.
fn combine(a: &mut [[f32; 3]], factor_of_a: [f32; 3], b: &[[f32; 3]], factor_of_b: [f32; 3]) {
    a.par_iter_mut().zip(b).for_each(|(a, b)| {
        for c in 0..3 {
            a[c] = factor_of_a[c] * a[c] + factor_of_b[c] * b[c];
        }
    });
}

/// Solves for the reflectance of all texels of square maps, in place; none is above `most`. `false` when `stop` was raised: `rho` is then of
/// no use.
pub fn solve(
    system: &mut DiffuseSystem,
    rho: &mut [[f32; 3]],
    leaning: Leaning,
    most: f32,
    iterations: usize,
    stop: &AtomicBool,
) -> bool {
    let held =
        Held::new(system.transposed(|row| row.arriving.map(|arriving| row.weight * arriving.powi(2))), leaning, rho);
    let mut residual = system.transposed(|row| [0, 1, 2].map(|c| row.weight * row.arriving[c] * row.radiance[c]));
    // What is leaned on is the start itself: there only neighbours pull.
    let mut applied = system.normal_product(rho);
    held.add_product(rho, &mut applied);
    combine(&mut residual, [1.0; 3], rho, [held.ridge; 3]);
    combine(&mut residual, [1.0; 3], &applied, [-1.0; 3]);
    let mut z = applied;
    held.precondition(&residual, &mut z);
    let mut direction = z.clone();
    let mut power = dot(&residual, &z);
    let first = power;
    for _ in 0..iterations {
        if (0..3).all(|c| power[c] <= 1e-10 * first[c]) {
            break;
        }
        if stop.load(Ordering::Relaxed) {
            return false;
        }
        let mut product = system.normal_product(&direction);
        held.add_product(&direction, &mut product);
        let along = dot(&direction, &product);
        let step = [0, 1, 2].map(|c| if along[c] > 0.0 { (power[c] / along[c]) as f32 } else { 0.0 });
        combine(rho, [1.0; 3], &direction, step);
        combine(&mut residual, [1.0; 3], &product, step.map(|step| -step));
        held.precondition(&residual, &mut z);
        let next = dot(&residual, &z);
        let share = [0, 1, 2].map(|c| if power[c] > 0.0 { (next[c] / power[c]) as f32 } else { 0.0 });
        combine(&mut direction, share, &z, [1.0; 3]);
        power = next;
    }
    for value in rho.iter_mut() {
        *value = value.map(|v| if v.is_finite() { v.clamp(0.0, most) } else { 0.0 });
    }
    true
}

#[cfg(test)]
mod tests {
    use super::super::diffuse_system::tests::{made_up, plain_models};
    use super::*;

    #[test]
    fn the_solution_is_that_of_least_squares() {
        let size = 16;
        let (footprints, observations, mut rows) = made_up(size, 400);
        // Photos of reflectances that no bound holds.
        for row in &mut rows {
            row.radiance = [0, 1, 2].map(|c| row.arriving[c] * (0.4 + 0.2 * row.radiance[c]));
        }
        let leaning = Leaning { start: 0.05, neighbours: Neighbours::Alike(0.1) };
        let start = vec![[0.3f32; 3]; size * size];
        let mut rho = start.clone();
        let mut system = DiffuseSystem::new(&footprints, &observations, &rows, size);
        assert!(solve(&mut system, &mut rho, leaning, 1.0, 200, &AtomicBool::new(false)));
        let diagonal = system.transposed(|row| row.arriving.map(|arriving| row.weight * arriving.powi(2)));
        let held = Held::new(diagonal, leaning, &start);
        // The objective, with what is leaned on, by channel: no small step from the solution makes it less.
        let objective = |x: &[[f32; 3]], c: usize| -> f64 {
            let models = plain_models(&footprints, &observations, &rows, x);
            let pixels = rows
                .iter()
                .zip(&models)
                .map(|(row, model)| f64::from(row.weight) * (f64::from(row.radiance[c]) - model[c]).powi(2));
            let leaning = (0..x.len()).map(|texel| {
                let own = f64::from(x[texel][c]);
                let pulls = held.neighbours(texel).map(|other| (own - f64::from(x[other][c])).powi(2)).sum::<f64>();
                f64::from(held.ridge) * (own - f64::from(start[texel][c])).powi(2)
                    + 0.5 * f64::from(held.stiffness.between(texel, texel, c)) * pulls
            });
            pixels.sum::<f64>() + leaning.sum::<f64>()
        };
        for texel in (0..size * size).step_by(7) {
            for c in 0..3 {
                assert!((0.01..0.99).contains(&rho[texel][c]), "{:?}", rho[texel]);
                let moved = |by: f32| {
                    let mut moved = rho.clone();
                    moved[texel][c] += by;
                    objective(&moved, c)
                };
                let (less, more) = (moved(-1e-2), moved(1e-2));
                let (slope, curvature) = ((more - less) / 2e-2, (more + less - 2.0 * objective(&rho, c)) / 1e-4);
                assert!((slope / curvature).abs() < 1e-3, "{texel} {c}: off by {}", slope / curvature);
            }
        }
    }
}
