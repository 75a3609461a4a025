//! Codes that scale and shift every layer of a net (feature-wise linear modulation).
//!
//! Source: Perez, Strub, de Vries, Dumoulin and Courville 2018, "FiLM: Visual Reasoning with a General Conditioning
//! Layer". With rows `x` of a group that has the code `c`, a layer gives `(x W) (1 + c G) + b + c S`, product and sum by
//! column. A code then chooses what a net pays attention to at every depth, where a code that is seen by the first layer
//! alone can only move along what that layer tells apart. The map stays an invertible one whatever the code: only the
//! raw numbers of splines depend on it.

use super::product::{Rows, multiply};
use std::ops::Range;

/// Where the weights of one layer are by which codes scale and shift it, in the slice of its net.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Modulation {
    code: usize,
    width: usize,
    /// `[code][width]`; empty in the first layer, of which the matrix itself sees the code.
    shift: Range<usize>,
    /// `[code][width]`; empty in a layer that sees nothing but the code.
    gate: Range<usize>,
}

impl Modulation {
    /// The modulation of a layer of `width` outputs, its weights from `start` on.
    pub fn new(start: usize, code: usize, width: usize, shifts: bool, scales: bool) -> Self {
        let shift = start..start + if shifts { code * width } else { 0 };
        let gate = shift.end..shift.end + if scales { code * width } else { 0 };
        Modulation { code, width, shift, gate }
    }

    /// Where its weights end.
    pub fn end(&self) -> usize {
        self.gate.end
    }

    /// Whether it scales.
    pub fn scales(&self) -> bool {
        !self.gate.is_empty()
    }

    fn groups(&self, codes: &[f32]) -> usize {
        codes.len() / self.code
    }

    /// `1 + c G` of each code, row by row.
    pub fn gates_of(&self, weights: &[f32], codes: &[f32], gates: &mut Vec<f32>) {
        let groups = self.groups(codes);
        gates.clear();
        gates.resize(groups * self.width, 1.0);
        let matrix = Rows::new(&weights[self.gate.clone()], self.code, self.width);
        multiply(Rows::new(codes, groups, self.code), matrix, gates, true);
    }

    /// `b + c S` of each code, row by row.
    pub fn shifts_of(&self, weights: &[f32], codes: &[f32], bias: &[f32]) -> Vec<f32> {
        let groups = self.groups(codes);
        let mut shifts = bias.repeat(groups);
        let matrix = Rows::new(&weights[self.shift.clone()], self.code, self.width);
        multiply(Rows::new(codes, groups, self.code), matrix, &mut shifts, true);
        shifts
    }

    /// The reverse of both, given what was scaled and the adjoint of what came out, which becomes that of what was
    /// scaled. Adds to `d_weights` (left out when empty) and `d_codes`; returns the adjoint of the shift of each group.
    pub fn pull_back(
        &self,
        weights: &[f32],
        codes: &[f32],
        gates: &[f32],
        products: &[f32],
        adjoint: &mut [f32],
        d_weights: &mut [f32],
        d_codes: &mut [f32],
    ) -> Vec<f32> {
        let (groups, width) = (self.groups(codes), self.width);
        let mut d_gates = vec![0.0f32; groups * width];
        let mut d_shifts = vec![0.0f32; groups * width];
        let block = (adjoint.len() / groups.max(1)).max(1);
        for (group, (adjoint, products)) in adjoint.chunks_mut(block).zip(products.chunks(block)).enumerate() {
            let own = group * width..(group + 1) * width;
            let (d_gate, d_shift, gate) = (&mut d_gates[own.clone()], &mut d_shifts[own.clone()], &gates[own]);
            for (adjoint, product) in adjoint.chunks_exact_mut(width).zip(products.chunks_exact(width)) {
                for column in 0..width {
                    d_gate[column] += adjoint[column] * product[column];
                    d_shift[column] += adjoint[column];
                    adjoint[column] *= gate[column];
                }
            }
        }
        let codes = Rows::new(codes, groups, self.code);
        for (span, adjoint) in [(&self.gate, &d_gates), (&self.shift, &d_shifts)] {
            if span.is_empty() {
                continue;
            }
            let adjoint = Rows::new(adjoint, groups, width);
            if !d_weights.is_empty() {
                multiply(codes.transpose(), adjoint, &mut d_weights[span.clone()], true);
            }
            let matrix = Rows::new(&weights[span.clone()], self.code, width);
            multiply(adjoint, matrix.transpose(), d_codes, true);
        }
        d_shifts
    }
}

/// Scales and shifts the rows of each group by its row of `gates` and `shifts`; groups have the same number of rows.
pub fn scale_and_shift(values: &mut [f32], gates: &[f32], shifts: &[f32], width: usize) {
    let block = (values.len() / (gates.len() / width).max(1)).max(1);
    let groups = gates.chunks_exact(width).zip(shifts.chunks_exact(width));
    for (block, (gate, shift)) in values.chunks_mut(block).zip(groups) {
        for row in block.chunks_exact_mut(width) {
            for column in 0..width {
                row[column] = row[column] * gate[column] + shift[column];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_code_scales_and_shifts_the_rows_of_its_group_and_no_other() {
        // Codes of two numbers, rows of three, two groups of two rows; weights of shift, then of gate.
        let modulation = Modulation::new(1, 2, 3, true, true);
        assert_eq!((modulation.end(), modulation.scales()), (13, true));
        let mut weights = vec![9.0f32; 13];
        weights[1..7].copy_from_slice(&[1.0, 0.0, 0.0, 0.0, 5.0, 0.0]);
        weights[7..13].copy_from_slice(&[0.0, 2.0, 0.0, 0.0, 0.0, 3.0]);
        let codes = [1.0, 0.0, 0.0, -1.0];
        let mut gates = Vec::new();
        modulation.gates_of(&weights, &codes, &mut gates);
        assert_eq!(gates, [1.0, 3.0, 1.0, 1.0, 1.0, -2.0]);
        let shifts = modulation.shifts_of(&weights, &codes, &[0.5, 0.0, 0.0]);
        assert_eq!(shifts, [1.5, 0.0, 0.0, 0.5, -5.0, 0.0]);
        let mut values = [1.0f32; 12];
        scale_and_shift(&mut values, &gates, &shifts, 3);
        assert_eq!(values, [2.5, 3.0, 1.0, 2.5, 3.0, 1.0, 1.5, -4.0, -2.0, 1.5, -4.0, -2.0]);
    }
}
