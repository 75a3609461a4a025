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
use super::posterior::{Band, Posterior};
use super::prior::{LogLight, shares};

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
/// The channel that stands for all three: they see the same geometry.
const CHANNEL: usize = 1;

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
    let texels = light.channels[CHANNEL].as_slice();
    let posterior = Posterior::new(prior.quadratic(texels), matrix, likelihood, light, CHANNEL, DEVIATION);
    residuals + energy + posterior.map_or(f64::INFINITY, |posterior| 3.0 * posterior.half_log_determinant)
}

/// Belief and photo around a light, for questions to it.
pub(super) fn posterior(matrix: &LightMatrix, likelihood: &Likelihood, light: &LogLight) -> Option<Posterior> {
    let belief = LightBelief::new(light.width, light.height, TAIL).quadratic(&light.channels[CHANNEL]);
    Posterior::new(belief, matrix, likelihood, light, CHANNEL, DEVIATION)
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
    width: usize,
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
        LightBelief { edges, pull, tail, width }
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

    /// The quadratic that touches the energy at `logs`.
    fn quadratic(&self, logs: &[f32]) -> Band {
        let mut band = Band::new(self.pull.len(), self.width);
        for (texel, pull) in self.pull.iter().enumerate() {
            band.add(texel, texel, *pull);
        }
        for edge in &self.edges {
            let (a, b, weight) = *edge;
            let weight = weight / (1.0 + self.over_tail(edge, logs));
            band.add(a, a, weight);
            band.add(b, b, weight);
            band.add(a, b, -weight);
        }
        band
    }
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
        assert!(heavy.quadratic(&logs).factor().is_some_and(f64::is_finite));
    }
}
