//! Diffuse reflectance at the end: all texels together, with the full footprints of the pixels.
//!
//! With light, F0 and width known, a pixel is `E sum_t w_t rho_t` plus what the lobe sends: linear, and sparse. Conjugate
//! gradients on the normal equations, one channel like the other, starting from the texel-by-texel solution and leaning
//! on it where pixels say little.

use super::observations::{Observation, Observations};
use crate::render::cached::ViewFootprints;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// One pixel's equation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DiffuseRow {
    /// Arriving light: times the mean reflectance under the footprint.
    pub arriving: [f32; 3],
    /// Photo less lobe.
    pub radiance: [f32; 3],
    /// Weight; 0 leaves it out.
    pub weight: f32,
}

/// What a pixel's diffuse reflectance sends back.
pub fn model(footprints: &[ViewFootprints], observation: &Observation, row: &DiffuseRow, rho: &[[f32; 3]]) -> [f32; 3] {
    let view = &footprints[observation.view as usize];
    let mut mean = [0.0f32; 3];
    for &(texel, weight) in view.texels_of(&view.points[observation.point as usize]) {
        for c in 0..3 {
            mean[c] += weight * rho[texel as usize][c];
        }
    }
    [0, 1, 2].map(|c| mean[c] * row.arriving[c])
}

/// What texels lean on, in units of the mean diagonal of the normal equations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leaning {
    /// Weight of the start values.
    pub start: f32,
    /// Weight of the difference between neighbours that pixels show: what is finer than the photos is smooth.
    pub neighbours: f32,
}

/// Solves for the reflectance of all texels of square maps, in place. `false` when `stop` was raised: `rho` is then of
/// no use.
pub fn solve(
    footprints: &[ViewFootprints],
    observations: &Observations,
    rows: &[DiffuseRow],
    rho: &mut [[f32; 3]],
    leaning: Leaning,
    iterations: usize,
    stop: &AtomicBool,
) -> bool {
    let texels = rho.len();
    let taps = |index: usize| {
        let observation = &observations.list[index];
        let view = &footprints[observation.view as usize];
        view.texels_of(&view.points[observation.point as usize])
    };
    // Rows are sorted by texel, so parts of them touch few texels of each other: each adds to its own list.
    const PARTS: usize = 16;
    let part = rows.len().div_ceil(PARTS).max(1);
    let transposed = |values: &(dyn Fn(usize) -> [f32; 3] + Sync)| -> Vec<[f32; 3]> {
        let sums: Vec<Vec<(u32, [f32; 3])>> = (0..PARTS)
            .into_par_iter()
            .map(|which| {
                let mut sum = vec![[0.0f32; 3]; texels];
                let mut touched = vec![false; texels];
                for index in which * part..((which + 1) * part).min(rows.len()) {
                    let value = values(index);
                    if value == [0.0; 3] {
                        continue;
                    }
                    for &(texel, weight) in taps(index) {
                        touched[texel as usize] = true;
                        for c in 0..3 {
                            sum[texel as usize][c] += weight * value[c];
                        }
                    }
                }
                (0..texels as u32).filter(|&t| touched[t as usize]).map(|t| (t, sum[t as usize])).collect()
            })
            .collect();
        let mut total = vec![[0.0f32; 3]; texels];
        for (texel, sum) in sums.into_iter().flatten() {
            for c in 0..3 {
                total[texel as usize][c] += sum[c];
            }
        }
        total
    };
    let forward =
        |x: &[[f32; 3]], index: usize| -> [f32; 3] { model(footprints, &observations.list[index], &rows[index], x) };
    let diagonal = transposed(&|index| [0, 1, 2].map(|c| rows[index].weight * rows[index].arriving[c].powi(2)));
    let seen = diagonal.iter().filter(|d| d[0] > 0.0).count().max(1);
    let mean = diagonal.iter().map(|d| f64::from(d[0] + d[1] + d[2]) / 3.0).sum::<f64>() / seen as f64;
    let ridge = (f64::from(leaning.start) * mean) as f32;
    let stiffness = (f64::from(leaning.neighbours) * mean) as f32;
    let size = texels.isqrt();
    let neighbours = |texel: usize| {
        let (row, column) = (texel / size, texel % size);
        let known = [
            (row > 0).then(|| texel - size),
            (row + 1 < size).then(|| texel + size),
            (column > 0).then(|| texel - 1),
            (column + 1 < size).then(|| texel + 1),
        ];
        let shown = diagonal[texel][0] > 0.0;
        known.into_iter().flatten().filter(move |_| shown).filter(|&other| diagonal[other][0] > 0.0)
    };
    let start = rho.to_vec();
    let normal = |x: &[[f32; 3]]| -> Vec<[f32; 3]> {
        let models: Vec<[f32; 3]> = (0..rows.len()).into_par_iter().map(|index| forward(x, index)).collect();
        let mut product =
            transposed(&|index| [0, 1, 2].map(|c| rows[index].weight * rows[index].arriving[c] * models[index][c]));
        product.par_iter_mut().enumerate().for_each(|(texel, product)| {
            let own = x[texel];
            for c in 0..3 {
                product[c] += ridge * own[c];
            }
            for other in neighbours(texel) {
                for c in 0..3 {
                    product[c] += stiffness * (own[c] - x[other][c]);
                }
            }
        });
        product
    };
    let applied = normal(&start);
    let mut residual =
        transposed(&|index| [0, 1, 2].map(|c| rows[index].weight * rows[index].arriving[c] * rows[index].radiance[c]));
    for ((residual, applied), start) in residual.iter_mut().zip(&applied).zip(&start) {
        for c in 0..3 {
            residual[c] += ridge * start[c] - applied[c];
        }
    }
    let precondition = |r: &[[f32; 3]]| -> Vec<[f32; 3]> {
        let one = |texel: usize| {
            let held = ridge + stiffness * neighbours(texel).count() as f32;
            [0, 1, 2].map(|c| r[texel][c] / (diagonal[texel][c] + held).max(1e-20))
        };
        (0..texels).into_par_iter().map(one).collect()
    };
    let dot = |a: &[[f32; 3]], b: &[[f32; 3]]| -> [f64; 3] {
        let mut sum = [0.0f64; 3];
        for (a, b) in a.iter().zip(b) {
            for c in 0..3 {
                sum[c] += f64::from(a[c]) * f64::from(b[c]);
            }
        }
        sum
    };
    let mut z = precondition(&residual);
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
        let product = normal(&direction);
        let along = dot(&direction, &product);
        let step = [0, 1, 2].map(|c| if along[c] > 0.0 { (power[c] / along[c]) as f32 } else { 0.0 });
        for index in 0..texels {
            for c in 0..3 {
                rho[index][c] += step[c] * direction[index][c];
                residual[index][c] -= step[c] * product[index][c];
            }
        }
        z = precondition(&residual);
        let next = dot(&residual, &z);
        for index in 0..texels {
            for c in 0..3 {
                let share = if power[c] > 0.0 { (next[c] / power[c]) as f32 } else { 0.0 };
                direction[index][c] = z[index][c] + share * direction[index][c];
            }
        }
        power = next;
    }
    for value in rho.iter_mut() {
        *value = value.map(|v| if v.is_finite() { v.clamp(0.0, 1.0) } else { 0.0 });
    }
    true
}
