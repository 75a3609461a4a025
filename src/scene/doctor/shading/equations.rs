//! The normal equations, made once for everything that is explained, and their solution for some of the unknowns.

use super::{FEATURES, OF_VIEW, Sighted};

/// The normal equations of gains and vectors of all views and of the features, with reflectances eliminated.
pub(super) struct Equations {
    size: usize,
    /// Upper and lower half, row by row.
    matrix: Vec<f64>,
    right: Vec<f64>,
    squares: f64,
}

impl Equations {
    pub(super) fn of(points: &[Sighted], views: usize, weights: &[Vec<f64>]) -> Self {
        let begin = OF_VIEW * views;
        let size = begin + FEATURES;
        let mut equations = Equations { size, matrix: vec![0.0; size * size], right: vec![0.0; size], squares: 0.0 };
        for (point, weights) in points.iter().zip(weights) {
            equations.add(point, weights, begin);
        }
        for row in begin..size {
            for column in 0..begin {
                equations.matrix[row * size + column] = equations.matrix[column * size + row];
            }
        }
        equations
    }

    fn add(&mut self, point: &Sighted, weights: &[f64], begin: usize) {
        let size = self.size;
        let total: f64 = weights.iter().sum();
        if total <= 0.0 {
            return;
        }
        let seen = || point.sights.iter().zip(weights);
        // The weighted mean over the views of a point is its reflectance: what is left are differences from it.
        let mean = seen().map(|(sight, weight)| weight * sight.log).sum::<f64>() / total;
        let mut mean_features = [0.0; FEATURES];
        for (sight, weight) in seen() {
            for (mean, feature) in mean_features.iter_mut().zip(&sight.features) {
                *mean += weight / total * feature;
            }
        }
        let unknowns = [1.0, point.normal.x, point.normal.y, point.normal.z];
        for (a, &weight_a) in seen() {
            let rest = a.log - mean;
            self.squares += weight_a * rest.powi(2);
            let features: [f64; FEATURES] = std::array::from_fn(|index| a.features[index] - mean_features[index]);
            for (i, &x) in unknowns.iter().enumerate() {
                let row = OF_VIEW * a.view + i;
                self.right[row] += weight_a * x * rest;
                for (column, feature) in features.iter().enumerate() {
                    self.matrix[row * size + begin + column] += weight_a * x * feature;
                }
            }
            for (i, &x) in features.iter().enumerate() {
                self.right[begin + i] += weight_a * x * rest;
                let row = (begin + i) * size + begin;
                for (own, &y) in self.matrix[row..row + FEATURES].iter_mut().zip(&features) {
                    *own += weight_a * x * y;
                }
            }
            for (b, &weight_b) in seen() {
                let own = if a.view == b.view { weight_a } else { 0.0 };
                let coupling = own - weight_a * weight_b / total;
                for (i, &x) in unknowns.iter().enumerate() {
                    let row = (OF_VIEW * a.view + i) * size + OF_VIEW * b.view;
                    for (j, &y) in unknowns.iter().enumerate() {
                        self.matrix[row + j] += coupling * x * y;
                    }
                }
            }
        }
    }

    /// The least sum of squared residuals when all unknowns are combinations of fewer, and those combined: each unknown
    /// is a list of (number among the fewer, factor).
    pub(super) fn least_squares(&self, fewer: usize, of: &[Vec<(usize, f64)>]) -> Option<(f64, Vec<f64>)> {
        let mut matrix = vec![0.0; fewer * fewer];
        let mut right = vec![0.0; fewer];
        for (row, from_row) in of.iter().enumerate() {
            for &(i, x) in from_row {
                right[i] += x * self.right[row];
            }
            for (column, from_column) in of.iter().enumerate() {
                let value = self.matrix[row * self.size + column];
                if value != 0.0 {
                    for &(i, x) in from_row {
                        for &(j, y) in from_column {
                            matrix[i * fewer + j] += x * y * value;
                        }
                    }
                }
            }
        }
        let found = solve(matrix, &right)?;
        let explained: f64 = found.iter().zip(&right).map(|(x, y)| x * y).sum();
        let whole = of.iter().map(|from| from.iter().map(|&(i, x)| x * found[i]).sum()).collect();
        Some(((self.squares - explained).max(0.0), whole))
    }
}

/// Solves a symmetric system by Cholesky's method. What all views have in common has no equation, and what is said twice has
/// one too many unknowns: a little is added to the diagonal, which keeps them small.
fn solve(mut matrix: Vec<f64>, right: &[f64]) -> Option<Vec<f64>> {
    let size = right.len();
    let trace: f64 = (0..size).map(|i| matrix[i * size + i]).sum();
    let little = 1e-7 * trace / size as f64;
    for i in 0..size {
        for j in 0..=i {
            let mut value = matrix[i * size + j] + if i == j { little } else { 0.0 };
            value -= (0..j).map(|k| matrix[i * size + k] * matrix[j * size + k]).sum::<f64>();
            if i == j {
                if !(value > 0.0) {
                    return None;
                }
                matrix[i * size + i] = value.sqrt();
            } else {
                matrix[i * size + j] = value / matrix[j * size + j];
            }
        }
    }
    let mut found = right.to_vec();
    for i in 0..size {
        let known: f64 = (0..i).map(|k| matrix[i * size + k] * found[k]).sum();
        found[i] = (found[i] - known) / matrix[i * size + i];
    }
    for i in (0..size).rev() {
        let known: f64 = (i + 1..size).map(|k| matrix[k * size + i] * found[k]).sum();
        found[i] = (found[i] - known) / matrix[i * size + i];
    }
    Some(found)
}
