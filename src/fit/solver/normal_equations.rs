//! Rows over the light, added up to square equations.

use super::eliminate::BlockRows;
use faer::linalg::matmul::triangular::{BlockStructure, matmul};
use faer::{Accum, MatMut, MatRef, Par};

/// Rows that are added to a normal matrix at once.
const ROWS_AT_ONCE: usize = 512;

/// Normal equations of one channel, added up from rows.
#[derive(Clone, Debug)]
pub struct NormalEquations {
    pub(super) count: usize,
    /// Lower triangle, row after row.
    pub(super) matrix: Vec<f64>,
    pub(super) right: Vec<f64>,
    /// Of each coefficient: squares of what came through lobes and diffusely, see [`BlockRows::powers`].
    powers: [Vec<f64>; 2],
    /// Rows that wait, row after row.
    rows: Vec<f32>,
    sides: Vec<f32>,
    product: Vec<f32>,
}

impl NormalEquations {
    /// Equations of so many coefficients; everything is zero.
    pub fn new(count: usize) -> Self {
        NormalEquations {
            count,
            matrix: vec![0.0; count * count],
            right: vec![0.0; count],
            powers: [vec![0.0; count], vec![0.0; count]],
            rows: Vec::new(),
            sides: Vec::new(),
            product: Vec::new(),
        }
    }

    /// Adds the rows of a block.
    pub fn add(&mut self, rows: &BlockRows) {
        self.rows.extend_from_slice(&rows.rows);
        self.sides.extend(rows.right.iter().map(|&value| value as f32));
        for (own, other) in self.powers.iter_mut().zip(&rows.powers) {
            own.iter_mut().zip(other).for_each(|(own, &other)| *own += f64::from(other));
        }
        if self.sides.len() >= ROWS_AT_ONCE {
            self.flush();
        }
    }

    /// Adds one row of few entries (coefficient, value): a background pixel.
    pub fn add_sparse(&mut self, entries: &[(u32, f64)], side: f64) {
        for &(row, value) in entries {
            self.right[row as usize] += value * side;
            for &(column, other) in entries {
                if column <= row {
                    self.matrix[row as usize * self.count + column as usize] += value * other;
                }
            }
        }
    }

    /// Adds the rows that wait.
    pub fn flush(&mut self) {
        let (count, rows) = (self.count, self.sides.len());
        if rows == 0 {
            return;
        }
        for (row, &side) in self.rows.chunks_exact(count).zip(&self.sides) {
            for (total, &entry) in self.right.iter_mut().zip(row) {
                *total += f64::from(entry * side);
            }
        }
        self.product.resize(count * count, 0.0);
        let transposed = MatRef::from_column_major_slice(&self.rows, count, rows);
        matmul(
            MatMut::from_column_major_slice_mut(&mut self.product, count, count),
            BlockStructure::TriangularUpper,
            Accum::Replace,
            transposed,
            BlockStructure::Rectangular,
            transposed.transpose(),
            BlockStructure::Rectangular,
            1.0f32,
            Par::Seq,
        );
        // The upper triangle in columns is the lower one in rows.
        for row in 0..count {
            let range = row * count..row * count + row + 1;
            for (total, &value) in self.matrix[range.clone()].iter_mut().zip(&self.product[range]) {
                *total += f64::from(value);
            }
        }
        self.rows.clear();
        self.sides.clear();
    }

    /// Adds equations of the same size.
    pub fn merge(&mut self, other: &NormalEquations) {
        for (total, value) in self.matrix.iter_mut().zip(&other.matrix) {
            *total += value;
        }
        for (total, value) in self.right.iter_mut().zip(&other.right) {
            *total += value;
        }
        for (own, other) in self.powers.iter_mut().zip(&other.powers) {
            own.iter_mut().zip(other).for_each(|(own, &other)| *own += other);
        }
    }

    /// How well each coefficient would be known if all others were: the diagonal.
    pub fn diagonal(&self) -> Vec<f64> {
        (0..self.count).map(|row| self.matrix[row * self.count + row]).collect()
    }

    /// See [`BlockRows::powers`].
    pub fn powers(&self) -> &[Vec<f64>; 2] {
        &self.powers
    }
}
