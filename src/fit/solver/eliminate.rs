//! Taking the unknowns of a block out of its rows: what is left speaks of the light alone.
//!
//! With rows `A` over the light, columns `J` over the block's own unknowns, and a prior on those as rows below,
//! `min over d of |A L + J d - y|^2 + |P (d - p)|^2` is `|Q (A L - y)|^2` with `Q` the projection off the columns
//! `[J; P]`. Projecting by an orthonormal basis keeps the normal matrix positive; subtracting
//! `A'J (J'J + P'P)^-1 J'A` (the Schur complement of bundle adjustment, which is the same matrix) would not in `f32`.

/// A block's reflectance in one channel, with what it has to do with the light.
#[derive(Clone, Debug, Default)]
pub struct KeptUnknown {
    /// Unit direction of the unknown in the rows, over the light's coefficients.
    pub row: Vec<f32>,
    /// The right side along that direction.
    pub side: f64,
    /// Length of the unknown's column.
    pub length: f64,
    /// The reflectance now.
    pub value: f64,
}

/// The rows of a block with its unknowns: filled, then projected in place.
#[derive(Clone, Debug, Default)]
pub struct BlockRows {
    /// Number of light coefficients.
    pub light_count: usize,
    /// Rows over the light, then one for each unknown of the block.
    pub rows: Vec<f32>,
    /// Right sides.
    pub right: Vec<f64>,
    /// Per light coefficient, the squares of what reaches pixels through lobes and through diffuse reflectance, added up
    /// over the observations before the block's unknowns are taken out.
    pub powers: [Vec<f32>; 2],
    /// Columns of the block's unknowns over all rows, column after column.
    columns: Vec<f64>,
    /// The last unknown, as it was taken out: its unit row over the light, its right side, the length of its column.
    pub kept: KeptUnknown,
    observation_count: usize,
    unknown_count: usize,
}

impl BlockRows {
    /// Prepares for so many observations and unknowns; everything is zero.
    pub fn reset(&mut self, light_count: usize, observations: usize, unknowns: usize) {
        let total = observations + unknowns;
        self.light_count = light_count;
        self.observation_count = observations;
        self.unknown_count = unknowns;
        self.rows.clear();
        self.rows.resize(total * light_count, 0.0);
        self.right.clear();
        self.right.resize(total, 0.0);
        for power in &mut self.powers {
            power.clear();
            power.resize(light_count, 0.0);
        }
        self.columns.clear();
        self.columns.resize(total * unknowns, 0.0);
    }

    /// Sets the row of an observation: what a unit of each coefficient sends to it through the lobe and diffusely.
    pub fn set_row(&mut self, observation: usize, lobe: impl Iterator<Item = f32>, diffuse: impl Iterator<Item = f32>) {
        let range = observation * self.light_count..(observation + 1) * self.light_count;
        let [lobe_power, diffuse_power] = &mut self.powers;
        for ((((entry, lobe), diffuse), lobe_power), diffuse_power) in
            self.rows[range].iter_mut().zip(lobe).zip(diffuse).zip(lobe_power).zip(diffuse_power)
        {
            *entry = lobe + diffuse;
            *lobe_power += lobe * lobe;
            *diffuse_power += diffuse * diffuse;
        }
    }

    /// Sets the derivative of an observation by an unknown.
    pub fn set_unknown(&mut self, observation: usize, unknown: usize, value: f64) {
        let total = self.observation_count + self.unknown_count;
        self.columns[unknown * total + observation] = value;
    }

    /// Sets the prior of an unknown: one over its standard deviation, and its mean. A precision of 0 says nothing.
    pub fn set_prior(&mut self, unknown: usize, inverse_deviation: f64, mean: f64) {
        let total = self.observation_count + self.unknown_count;
        let row = self.observation_count + unknown;
        self.columns[unknown * total + row] = inverse_deviation;
        self.right[row] = inverse_deviation * mean;
    }

    /// Projects rows and right sides off the unknowns.
    pub fn eliminate(&mut self) {
        let total = self.observation_count + self.unknown_count;
        let light = self.light_count;
        for unknown in 0..self.unknown_count {
            let (before, own) = self.columns.split_at_mut(unknown * total);
            let own = &mut own[..total];
            let full: f64 = own.iter().map(|value| value * value).sum();
            // Twice is enough (Kahan, Parlett).
            for _ in 0..2 {
                for other in before.chunks_exact(total) {
                    let dot: f64 = other.iter().zip(own.iter()).map(|(a, b)| a * b).sum();
                    for (value, other) in own.iter_mut().zip(other) {
                        *value -= dot * other;
                    }
                }
            }
            let left: f64 = own.iter().map(|value| value * value).sum();
            // A column that the others span takes nothing more away.
            let scale = if left > 1e-18 * full && left > 0.0 { 1.0 / left.sqrt() } else { 0.0 };
            self.kept.length = if scale > 0.0 { left.sqrt() } else { 0.0 };
            for value in own.iter_mut() {
                *value *= scale;
            }
        }
        let mut share = vec![0.0f32; light];
        for column in self.columns.chunks_exact(total) {
            let dot: f64 = column.iter().zip(&self.right).map(|(a, b)| a * b).sum();
            for (right, value) in self.right.iter_mut().zip(column) {
                *right -= dot * value;
            }
            share.fill(0.0);
            for (row, &value) in self.rows.chunks_exact(light).zip(column).take(total) {
                if value != 0.0 {
                    for (share, entry) in share.iter_mut().zip(row) {
                        *share += value as f32 * entry;
                    }
                }
            }
            self.kept.side = dot;
            for (row, &value) in self.rows.chunks_exact_mut(light).zip(column) {
                if value != 0.0 {
                    for (entry, share) in row.iter_mut().zip(&share) {
                        *entry -= value as f32 * share;
                    }
                }
            }
        }
        self.kept.row = share;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::SequentialRandom;

    /// Solves a dense symmetric system by elimination.
    fn solve(matrix: &mut [Vec<f64>]) -> Vec<f64> {
        let count = matrix.len();
        for pivot in 0..count {
            for other in 0..count {
                if other != pivot {
                    let factor = matrix[other][pivot] / matrix[pivot][pivot];
                    for k in 0..=count {
                        matrix[other][k] -= factor * matrix[pivot][k];
                    }
                }
            }
        }
        (0..count).map(|k| matrix[k][count] / matrix[k][k]).collect()
    }

    fn normal(rows: &[(Vec<f64>, f64)]) -> Vec<Vec<f64>> {
        let count = rows[0].0.len();
        let mut matrix = vec![vec![0.0; count + 1]; count];
        for (row, right) in rows {
            for i in 0..count {
                for k in 0..count {
                    matrix[i][k] += row[i] * row[k];
                }
                matrix[i][count] += row[i] * right;
            }
        }
        matrix
    }

    #[test]
    fn elimination_gives_the_light_of_the_dense_joint_system() {
        let mut random = SequentialRandom::new(8);
        let mut number = || f64::from(random.next_number()) - 0.3;
        let (observations, light, unknowns) = (40, 6, 5);
        let mut rows = BlockRows::default();
        rows.reset(light, observations, unknowns);
        let mut dense = Vec::new();
        for i in 0..observations {
            let own: Vec<f64> = (0..light).map(|_| f64::from(number() as f32)).collect();
            let columns: Vec<f64> = (0..unknowns).map(|_| number()).collect();
            let right = number();
            rows.set_row(i, own.iter().map(|&value| value as f32), own.iter().map(|_| 0.0));
            for (unknown, &value) in columns.iter().enumerate() {
                rows.set_unknown(i, unknown, value);
            }
            rows.right[i] = right;
            dense.push(([own, columns].concat(), right));
        }
        // The first unknown is free, the others have priors; the last is a copy of the first column's direction.
        for unknown in 1..unknowns {
            let inverse = 0.5 * unknown as f64;
            rows.set_prior(unknown, inverse, 0.2);
            let mut row = vec![0.0; light + unknowns];
            row[light + unknown] = inverse;
            dense.push((row, inverse * 0.2));
        }
        rows.eliminate();
        let reduced: Vec<(Vec<f64>, f64)> = rows
            .rows
            .chunks_exact(light)
            .zip(&rows.right)
            .map(|(row, &right)| (row.iter().map(|&value| f64::from(value)).collect(), right))
            .collect();
        let eliminated = solve(&mut normal(&reduced));
        let joint = solve(&mut normal(&dense));
        for k in 0..light {
            assert!((eliminated[k] - joint[k]).abs() < 1e-5 * (1.0 + joint[k].abs()), "{eliminated:?} {joint:?}");
        }
    }
}
