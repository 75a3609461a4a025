//! What a photo leaves open of a light: the quadratic of belief and photo around a light, `J J / s^2 + Q`.
//!
//! A light has more texels than a fit has pixels, and the belief joins neighbours only. So `Q` is factored as a band,
//! `L L`, and the photo enters through one number a pixel: `det(J J / s^2 + Q) = det Q det(1 + Y Y)` with `L Y = J / s`
//! (the lemma on determinants; for inverses that of Woodbury). A light of 32 x 64 takes a tenth of a second so, where the
//! square of its texels takes seconds.

use super::likelihood::Likelihood;
use super::matrices::LightMatrix;
use super::prior::LogLight;
use crate::neural::product::{Rows, multiply};

/// A symmetric matrix of texels that joins those at most `band` apart, row by row: row `i` holds the columns from
/// `i - band` to `i`.
#[derive(Clone, Debug)]
pub(super) struct Band {
    size: usize,
    band: usize,
    values: Vec<f64>,
}

impl Band {
    /// Zero.
    pub fn new(size: usize, band: usize) -> Self {
        Band { size, band, values: vec![0.0; size * (band + 1)] }
    }

    /// Adds to an element and its mirror image. Panics when they lie outside the band: a defect of the caller.
    pub fn add(&mut self, a: usize, b: usize, value: f64) {
        let (row, column) = (a.max(b), a.min(b));
        assert!(row - column <= self.band, "{row} {column} of a band of {}", self.band);
        self.values[row * (self.band + 1) + self.band + column - row] += value;
    }

    /// Columns `from..to` of a row of the band.
    fn row(&self, row: usize, from: usize, to: usize) -> &[f64] {
        let begin = row * (self.band + 1) + self.band;
        &self.values[begin + from - row..begin + to - row]
    }

    /// Becomes its lower factor by Cholesky's method; returns the logarithm of the determinant, `None` when the matrix is
    /// not positive definite.
    pub fn factor(&mut self) -> Option<f64> {
        let mut logarithm = 0.0;
        for row in 0..self.size {
            let first = row.saturating_sub(self.band);
            for column in first..=row {
                let from = first.max(column.saturating_sub(self.band));
                let known: f64 =
                    self.row(row, from, column).iter().zip(self.row(column, from, column)).map(|(a, b)| a * b).sum();
                let at = row * (self.band + 1) + self.band + column - row;
                let rest = self.values[at] - known;
                if column < row {
                    self.values[at] = rest / self.values[column * (self.band + 1) + self.band];
                } else if rest > 0.0 && rest.is_finite() {
                    self.values[at] = rest.sqrt();
                    logarithm += rest.ln();
                } else {
                    return None;
                }
            }
        }
        Some(logarithm)
    }

    /// Solves `L y = x` for many right sides at once: `columns` numbers a row, in place.
    fn solve_lower(&self, right: &mut [f32], columns: usize) {
        for row in 0..self.size {
            let (above, own) = right.split_at_mut(row * columns);
            let own = &mut own[..columns];
            let first = row.saturating_sub(self.band);
            for (column, factor) in (first..row).zip(self.row(row, first, row)) {
                let factor = *factor as f32;
                if factor != 0.0 {
                    let other = &above[column * columns..(column + 1) * columns];
                    own.iter_mut().zip(other).for_each(|(value, other)| *value -= factor * other);
                }
            }
            let scale = (1.0 / self.values[row * (self.band + 1) + self.band]) as f32;
            own.iter_mut().for_each(|value| *value *= scale);
        }
    }
}

/// Belief and photo around a light, factored.
pub(super) struct Posterior {
    belief: Band,
    /// `Y`: a row a texel, a column a pixel.
    seen: Vec<f32>,
    /// The factor of `1 + Y Y`.
    pixels: Vec<f64>,
    count: usize,
    /// Half the logarithm of the determinant of the whole.
    pub half_log_determinant: f64,
}

impl Posterior {
    /// Of a belief and what the photo tells of one channel of a light. `None` when it is not positive definite.
    pub fn new(
        belief: Band,
        matrix: &LightMatrix,
        likelihood: &Likelihood,
        light: &LogLight,
        channel: usize,
        deviation: f64,
    ) -> Option<Self> {
        let slopes = slopes_by_texel(matrix, likelihood, light, channel, deviation);
        Self::of(belief, slopes, matrix.pixels())
    }

    /// Of a belief and slopes over the deviation: a row a texel, `count` pixels in each.
    fn of(mut belief: Band, mut seen: Vec<f32>, count: usize) -> Option<Self> {
        let of_belief = belief.factor()?;
        belief.solve_lower(&mut seen, count);
        let mut gram = vec![0.0f32; count * count];
        let rows = Rows::new(&seen, belief.size, count);
        multiply(rows.transpose(), rows, &mut gram, false);
        let mut pixels: Vec<f64> = gram.into_iter().map(f64::from).collect();
        (0..count).for_each(|pixel| pixels[pixel * count + pixel] += 1.0);
        let of_photo = cholesky(&mut pixels, count)?;
        Some(Posterior { belief, seen, pixels, count, half_log_determinant: 0.5 * (of_belief + of_photo) })
    }

    /// The variance of a weighted sum of the light's texels: before the photo, and with it.
    pub fn variances(&self, weights: &[f64]) -> (f64, f64) {
        let mut solved: Vec<f32> = weights.iter().map(|&weight| weight as f32).collect();
        self.belief.solve_lower(&mut solved, 1);
        let before: f64 = solved.iter().map(|&value| f64::from(value).powi(2)).sum();
        let mut told = vec![0.0f64; self.count];
        for (row, &value) in self.seen.chunks_exact(self.count).zip(&solved) {
            told.iter_mut().zip(row).for_each(|(sum, own)| *sum += f64::from(own * value));
        }
        let mut taken = 0.0;
        for (column, row) in self.pixels.chunks_exact(self.count).enumerate() {
            let own = told[column] / row[column];
            taken += own * own;
            told[column + 1..].iter_mut().zip(&row[column + 1..]).for_each(|(rest, value)| *rest -= own * value);
        }
        (before, before - taken)
    }
}

/// Derivatives of the logarithms of one channel of the picture by those of the light, over the deviation: a row a texel,
/// a column a pixel.
fn slopes_by_texel(
    matrix: &LightMatrix,
    likelihood: &Likelihood,
    light: &LogLight,
    channel: usize,
    deviation: f64,
) -> Vec<f32> {
    let radiance = light.radiance();
    let picture = matrix.forward(&radiance);
    let (texels, pixels) = (matrix.texels(), matrix.pixels());
    let mut by_texel = vec![0.0f32; texels * pixels];
    for (index, (row, pixel)) in matrix.dense(channel).chunks_exact(texels).zip(&picture).enumerate() {
        if likelihood.is_kept_bound(index, channel, pixel[channel]) {
            // Brighter than what saturates says nothing of how much.
            continue;
        }
        let by_log = 1.0 / (deviation * (f64::from(pixel[channel]).max(0.0) + likelihood.epsilon));
        for (texel, (value, radiance)) in row.iter().zip(&radiance[channel]).enumerate() {
            by_texel[texel * pixels + index] = (f64::from(value * radiance) * by_log) as f32;
        }
    }
    by_texel
}

/// Factors a symmetric matrix by Cholesky's method and returns the logarithm of its determinant; `None` when it is not
/// positive definite. Row `k` then holds column `k` of the factor, from its diagonal on.
fn cholesky(square: &mut [f64], size: usize) -> Option<f64> {
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
    use crate::math::random::SequentialRandom;

    #[test]
    fn determinants_and_solutions_are_those_of_known_matrices() {
        // (2 on the diagonal, -1 beside it) of size n has the determinant n + 1.
        let size = 30;
        let mut square = vec![0.0; size * size];
        let mut band = Band::new(size, 4);
        for i in 0..size {
            square[i * size + i] = 2.0;
            band.add(i, i, 2.0);
            if i + 1 < size {
                square[i * size + i + 1] = -1.0;
                square[(i + 1) * size + i] = -1.0;
                band.add(i, i + 1, -1.0);
            }
        }
        assert!((cholesky(&mut square.clone(), size).unwrap() - 31f64.ln()).abs() < 1e-10);
        assert!((band.factor().unwrap() - 31f64.ln()).abs() < 1e-10);
        // The inverse has k (n + 1 - k) / (n + 1) on its diagonal: the squared length of what solves the lower triangle.
        let mut unit = vec![0.0f32; size];
        unit[9] = 1.0;
        band.solve_lower(&mut unit, 1);
        let squares: f32 = unit.iter().map(|value| value * value).sum();
        assert!((squares - 10.0 * 21.0 / 31.0).abs() < 1e-4, "{squares}");
        square[0] = -1.0;
        assert!(cholesky(&mut square, size).is_none());
        let mut negative = Band::new(3, 1);
        negative.add(0, 0, -1.0);
        assert!(negative.factor().is_none());
    }
    #[test]
    fn determinant_and_variances_are_those_of_the_whole_square() {
        let (texels, count, width) = (24, 7, 5);
        let mut random = SequentialRandom::new(2);
        let mut number = || f64::from(random.next_number()) - 0.5;
        let mut band = Band::new(texels, width);
        let mut whole = vec![0.0; texels * texels];
        for a in 0..texels {
            for b in a..(a + width + 1).min(texels) {
                let value = if a == b { 3.0 } else { 0.4 * number() };
                band.add(a, b, value);
                whole[a * texels + b] = value;
                whole[b * texels + a] = value;
            }
        }
        let mut belief = whole.clone();
        let seen: Vec<f32> = (0..texels * count).map(|_| (3.0 * number()) as f32).collect();
        for (a, row) in whole.chunks_exact_mut(texels).enumerate() {
            for (b, value) in row.iter_mut().enumerate() {
                *value +=
                    (0..count).map(|p| f64::from(seen[a * count + p]) * f64::from(seen[b * count + p])).sum::<f64>();
            }
        }
        let weights: Vec<f64> = (0..texels).map(|_| number()).collect();
        let posterior = Posterior::of(band, seen, count).unwrap();
        let half = 0.5 * cholesky(&mut whole, texels).unwrap();
        assert!((posterior.half_log_determinant - half).abs() < 1e-4 * half.abs());
        cholesky(&mut belief, texels).unwrap();
        let variance = |factor: &[f64]| {
            let mut rest = weights.clone();
            let mut sum = 0.0;
            for (column, row) in factor.chunks_exact(texels).enumerate() {
                let own = rest[column] / row[column];
                sum += own * own;
                (column + 1..texels).for_each(|later| rest[later] -= own * row[later]);
            }
            sum
        };
        let (before, after) = posterior.variances(&weights);
        assert!((before / variance(&belief) - 1.0).abs() < 1e-4 && (after / variance(&whole) - 1.0).abs() < 1e-3);
    }
}
