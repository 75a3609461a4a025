//! How well a reflectance explains a photo by any light at all, and not by the one light that fits best.
//!
//! Light and reflectance are a blind deconvolution: with the best light for each reflectance, a mirror under a blurred
//! light explains every photo, and priors that like smooth light choose it. What is wanted is the probability of the
//! photo for a reflectance with the light summed out (Levin, Weiss, Durand and Freeman 2009 say so for blur kernels).
//! By Laplace's method around the best light `x`, in logarithms,
//! `-ln p = r^2 / (2 s^2) + x Q x / 2 + ln det(J J / s^2 + Q) / 2` up to what is the same for all reflectances. The last
//! term is what a sharp reflectance pays: it would have shown much finer light than the photo does.
//!
//! The belief on light has heavy tails, `Q` touches it at `x`. A normal distribution would charge a sun hundreds of nats
//! for its edge: more than a mirror pays for its sharpness, under which a blurred sun shows the same highlight.

use super::light_step::LightObjective;
use super::likelihood::Likelihood;
use super::matrices::LightMatrix;
use super::prior::{LogLight, shares};
use crate::neural::product::{Rows, multiply};

/// Standard deviation of what the model cannot explain, in natural logarithms.
const DEVIATION: f64 = 0.1;
/// Residuals beyond this many deviations count no more than linearly.
const ROBUST: f64 = 3.0;
/// One over the variance of the step between neighbouring texels of natural light at 16 rows, in natural logarithms, where
/// steps are small.
const STIFFNESS: f64 = 1.0;
/// The same for a texel's distance from the mean.
const PULL: f64 = 0.1;
/// Weight of the tail of steps, in nats: a step costs `TAIL ln(1 + STIFFNESS step^2 / (2 TAIL))`. Suns and windows have
/// edges of which a normal distribution knows nothing: it would have a blurred light and a mirror.
const TAIL: f64 = 2.0;

/// Minus the logarithm of the probability of the photo with the light summed out around `light`, in nats, up to a
/// number that is the same for all reflectances. Infinite when it cannot be computed.
pub fn negative_log_evidence(matrix: &LightMatrix, likelihood: &Likelihood, light: &LogLight) -> f64 {
    let radiance = light.radiance();
    let picture = matrix.forward(&radiance);
    let mut residuals = 0.0;
    for value in likelihood.residuals(&picture).flatten() {
        let size = (value / DEVIATION).abs();
        residuals += if size < ROBUST { 0.5 * size * size } else { ROBUST * (size - 0.5 * ROBUST) };
    }
    let prior = LightBelief::new(light.width, light.height, TAIL);
    let energy: f64 = light.channels.iter().map(|channel| prior.energy(channel)).sum();
    // The channels see the same geometry: one stands for all three.
    let channel = 1;
    let texels = matrix.texels();
    let mut square = information(matrix, likelihood, light, channel);
    prior.add_to(&light.channels[channel], &mut square);
    let volume = cholesky(&mut square, texels).map_or(f64::INFINITY, |logarithm| 1.5 * logarithm);
    residuals + energy + volume
}

/// What the photo tells of the logarithm of one channel of a light, texel by texel: `J J / s^2`.
pub(super) fn information(matrix: &LightMatrix, likelihood: &Likelihood, light: &LogLight, channel: usize) -> Vec<f64> {
    let radiance = light.radiance();
    let picture = matrix.forward(&radiance);
    let mut rows = matrix.dense(channel);
    let texels = matrix.texels();
    for (index, (row, pixel)) in rows.chunks_exact_mut(texels).zip(&picture).enumerate() {
        if likelihood.is_kept_bound(index, channel, pixel[channel]) {
            // Brighter than what saturates says nothing of how much.
            row.fill(0.0);
            continue;
        }
        let by_log = 1.0 / (DEVIATION * (f64::from(pixel[channel]).max(0.0) + likelihood.epsilon));
        for (value, radiance) in row.iter_mut().zip(&radiance[channel]) {
            *value = (f64::from(*value * radiance) * by_log) as f32;
        }
    }
    let mut gram = vec![0.0f32; texels * texels];
    let left = Rows::new(&rows, matrix.pixels(), texels);
    multiply(left.transpose(), left, &mut gram, false);
    gram.into_iter().map(f64::from).collect()
}

/// What is believed of one channel of a light before any photo: the matrix `Q` of the quadratic that touches the belief.
pub(super) fn belief(light: &LogLight, channel: usize) -> Vec<f64> {
    let texels = light.width * light.height;
    let mut square = vec![0.0; texels * texels];
    LightBelief::new(light.width, light.height, TAIL).add_to(&light.channels[channel], &mut square);
    square
}

/// The same figure of an objective whose light is known: residuals alone, on the scale of nats.
pub fn of_known_light(objective: LightObjective, pixels: usize) -> f64 {
    objective.data * 3.0 * pixels as f64 / DEVIATION
}

/// What natural light is before any photo: a field in logarithms whose steps have a heavy tail.
struct LightBelief {
    edges: Vec<(usize, usize, f64)>,
    pull: Vec<f64>,
    tail: f64,
}

impl LightBelief {
    fn new(width: usize, height: usize, tail: f64) -> Self {
        let shares = shares(width, height);
        let texels = width * height;
        // A finer map has smaller steps: variance of a step falls with its length.
        let stiffness = STIFFNESS * height as f64 / 16.0;
        let mut edges = Vec::with_capacity(2 * texels);
        for texel in 0..texels {
            let (row, column) = (texel / width, texel % width);
            let sine = (std::f64::consts::PI * (row as f64 + 0.5) / height as f64).sin().max(0.1);
            edges.push((texel, row * width + (column + 1) % width, stiffness / sine));
            if row + 1 < height {
                edges.push((texel, texel + width, stiffness * sine));
            }
        }
        let pull = shares.iter().map(|share| PULL * f64::from(*share) * texels as f64).collect();
        LightBelief { edges, pull, tail }
    }

    fn energy(&self, logs: &[f32]) -> f64 {
        let total: f64 = self.pull.iter().sum();
        let mean = self.pull.iter().zip(logs).map(|(pull, log)| pull * f64::from(*log)).sum::<f64>() / total;
        let pulls: f64 = self.pull.iter().zip(logs).map(|(pull, log)| pull * (f64::from(*log) - mean).powi(2)).sum();
        0.5 * pulls + self.edges.iter().map(|edge| self.tail * self.over_tail(edge, logs).ln_1p()).sum::<f64>()
    }

    /// What a step would cost under a normal distribution, over the weight of the tail.
    fn over_tail(&self, &(a, b, weight): &(usize, usize, f64), logs: &[f32]) -> f64 {
        0.5 * weight * f64::from(logs[a] - logs[b]).powi(2) / self.tail
    }

    /// Adds the quadratic that touches the energy at `logs`.
    fn add_to(&self, logs: &[f32], square: &mut [f64]) {
        let texels = self.pull.len();
        for (texel, pull) in self.pull.iter().enumerate() {
            square[texel * texels + texel] += pull;
        }
        for edge in &self.edges {
            let (a, b, weight) = *edge;
            let weight = weight / (1.0 + self.over_tail(edge, logs));
            square[a * texels + a] += weight;
            square[b * texels + b] += weight;
            square[a * texels + b] -= weight;
            square[b * texels + a] -= weight;
        }
    }
}

/// Factors a symmetric matrix by Cholesky's method and returns the logarithm of its determinant; `None` when it is not
/// positive definite. Row `k` then holds column `k` of the factor, from its diagonal on.
pub(super) fn cholesky(square: &mut [f64], size: usize) -> Option<f64> {
    let mut sum = 0.0;
    for column in 0..size {
        let (above, below) = square.split_at_mut(column * size);
        // Rows above hold the factor transposed: row k holds the entries of column k from its diagonal on.
        let row = &mut below[..size];
        for factor in above.chunks_exact(size) {
            let scale = factor[column];
            if scale != 0.0 {
                row[column..].iter_mut().zip(&factor[column..]).for_each(|(value, other)| *value -= scale * other);
            }
        }
        let pivot = row[column];
        if !(pivot > 0.0) || !pivot.is_finite() {
            return None;
        }
        sum += pivot.ln();
        let scale = pivot.sqrt().recip();
        row[column..].iter_mut().for_each(|value| *value *= scale);
    }
    Some(sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sun_costs_little_more_than_its_rim_and_the_quadratic_touches() {
        let (width, height) = (32, 16);
        let [heavy, normal] = [TAIL, 1e12].map(|tail| LightBelief::new(width, height, tail));
        let mut logs = vec![0.0f32; width * height];
        let even = heavy.energy(&logs);
        assert_eq!(even, 0.0);
        logs[5 * width + 7] = 9.0;
        assert!(heavy.energy(&logs) < 0.3 * normal.energy(&logs), "{} {}", heavy.energy(&logs), normal.energy(&logs));
        // Small steps cost the same.
        logs[5 * width + 7] = 0.05;
        assert!((heavy.energy(&logs) / normal.energy(&logs) - 1.0).abs() < 0.01);
        // What is added to a matrix is positive semidefinite: rows sum to the pull alone.
        let mut square = vec![0.0; (width * height).pow(2)];
        heavy.add_to(&logs, &mut square);
        for (row, pull) in square.chunks_exact(width * height).zip(&heavy.pull) {
            assert!((row.iter().sum::<f64>() - pull).abs() < 1e-9);
        }
    }

    #[test]
    fn the_determinant_is_that_of_a_known_matrix() {
        // (2 on the diagonal, -1 beside it) of size n has the determinant n + 1.
        let size = 30;
        let mut square = vec![0.0; size * size];
        for i in 0..size {
            square[i * size + i] = 2.0;
            if i + 1 < size {
                square[i * size + i + 1] = -1.0;
                square[(i + 1) * size + i] = -1.0;
            }
        }
        assert!((cholesky(&mut square.clone(), size).unwrap() - 31f64.ln()).abs() < 1e-10);
        square[0] = -1.0;
        assert!(cholesky(&mut square, size).is_none());
    }
}
