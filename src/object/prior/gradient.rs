//! The gradient prior: natural light is even, but for few strong edges.
//!
//! Lombardi and Nishino 2016 found heavy-tailed gradients in natural illumination. Here: the mean over the sphere of
//! `sqrt(g^2 + w^2) - w` of the steps between neighbours in logarithms, a step counted by the angle it spans.

use super::shares;

/// Steps over less than this part of a row's height are not stretched further: near the poles.
const LARGEST_STRETCH: f32 = 6.0;

/// The prior with its weights on edges.
#[derive(Clone, Debug)]
pub struct GradientPrior {
    /// Weight of the mean absolute step.
    pub weight: f64,
    /// Where the penalty turns from square to absolute, in natural logarithms.
    pub edge_width: f32,
    width: usize,
    height: usize,
    shares: Vec<f32>,
    /// Stretch of steps along a row.
    stretch: Vec<f32>,
}

impl GradientPrior {
    /// The prior for maps of `width x height` texels.
    pub fn new(width: usize, height: usize, weight: f64, edge_width: f32) -> Self {
        let stretch = |row: usize| {
            let sine = (std::f32::consts::PI * (row as f32 + 0.5) / height as f32).sin();
            // One row is pi / height high; one column is 2 pi sin / width wide.
            (width as f32 / (2.0 * height as f32 * sine)).min(LARGEST_STRETCH)
        };
        GradientPrior {
            weight,
            edge_width,
            width,
            height,
            shares: shares(width, height),
            stretch: (0..height).map(stretch).collect(),
        }
    }

    /// Calls `each` with (texel, neighbour, stretch, share) of every edge.
    fn for_each_edge(&self, mut each: impl FnMut(usize, usize, f32, f32)) {
        for row in 0..self.height {
            for column in 0..self.width {
                let texel = row * self.width + column;
                let beside = row * self.width + (column + 1) % self.width;
                each(texel, beside, self.stretch[row], self.shares[texel]);
                if row + 1 < self.height {
                    each(texel, texel + self.width, 1.0, self.shares[texel]);
                }
                // Across a pole lies the same row, half a turn away: each pair once.
                let half = self.width / 2;
                if (row == 0 || row + 1 == self.height) && column < half {
                    each(texel, texel + half, 1.0, self.shares[texel]);
                }
            }
        }
    }

    /// The penalty of one channel.
    pub fn energy(&self, logs: &[f32]) -> f64 {
        let mut sum = 0.0;
        self.for_each_edge(|texel, other, stretch, share| {
            let step = stretch * (logs[other] - logs[texel]);
            sum += f64::from(share * (step.hypot(self.edge_width) - self.edge_width));
        });
        self.weight * sum
    }

    /// Weights of the quadratic that touches and bounds the penalty at `logs`, edge by edge.
    pub fn edge_weights(&self, logs: &[f32]) -> Vec<f32> {
        let mut weights = Vec::with_capacity(2 * logs.len());
        self.for_each_edge(|texel, other, stretch, share| {
            let step = stretch * (logs[other] - logs[texel]);
            weights.push(self.weight as f32 * share * stretch * stretch / step.hypot(self.edge_width));
        });
        weights
    }

    /// Adds the product of that quadratic's matrix with a map: at `logs` itself it is the derivative of the penalty.
    pub fn add_product(&self, edge_weights: &[f32], map: &[f32], product: &mut [f32]) {
        let mut edge = 0;
        self.for_each_edge(|texel, other, _, _| {
            let flow = edge_weights[edge] * (map[texel] - map[other]);
            product[texel] += flow;
            product[other] -= flow;
            edge += 1;
        });
    }

    /// Adds the diagonal of that matrix.
    pub fn add_diagonal(&self, edge_weights: &[f32], diagonal: &mut [f32]) {
        let mut edge = 0;
        self.for_each_edge(|texel, other, _, _| {
            diagonal[texel] += edge_weights[edge];
            diagonal[other] += edge_weights[edge];
            edge += 1;
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::SequentialRandom;

    #[test]
    fn the_product_at_the_map_is_the_derivative() {
        let prior = GradientPrior::new(16, 8, 0.3, 0.1);
        let mut random = SequentialRandom::new(1);
        let logs: Vec<f32> = (0..128).map(|_| random.next_number()).collect();
        let mut derivative = vec![0.0; 128];
        prior.add_product(&prior.edge_weights(&logs), &logs, &mut derivative);
        for texel in [0, 5, 77, 127] {
            let at = |step: f32| {
                let mut moved = logs.clone();
                moved[texel] += step;
                prior.energy(&moved)
            };
            let difference = (at(1e-2) - at(-1e-2)) / 2e-2;
            assert!((difference - f64::from(derivative[texel])).abs() < 0.02 * difference.abs() + 1e-5);
        }
        assert!(prior.energy(&[0.7; 128]) < 1e-9, "an even light costs nothing");
    }
}
