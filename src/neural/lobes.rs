//! From densities to reflectance: lobes of a flow, their codes and colours.
//!
//! The paper's equation 5 has reflectance proportional to the density; the code released with it learns densities of
//! `log(1 + stored value)` and undoes the logarithm. That is what weights are trained for, and all that is here.

use super::batch::LARGEST_EXPONENT;
use super::columns::{Nest, NestPoints};
use super::flow::Flow;
use super::pass::Pass;
use crate::math::parallel;

/// The stored value of a density, `expm1(exp(colour) p)` as released, and its derivative by the colour's logarithm (equal
/// to that by the density's).
pub fn stored_value(log_colour: f64, log_density: f64) -> (f64, f64) {
    let scaled = (log_colour + log_density).min(LARGEST_EXPONENT.ln()).exp();
    (scaled.exp_m1(), scaled * scaled.exp())
}

/// Columns of the cube: each has coordinates of `theta_difference` and `phi_difference`, and the same number of
/// `theta_half`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CubeColumns {
    /// `theta_difference` and `phi_difference` of each column, in [0, 1].
    pub at: Vec<[f64; 2]>,
    /// `theta_half` in [0, 1], `halves` a column.
    pub halves: Vec<f64>,
}

/// Columns that one thread takes at once.
const CHUNK: usize = 48;

impl CubeColumns {
    /// Points a column.
    pub fn per_column(&self) -> usize {
        self.halves.len() / self.at.len().max(1)
    }

    /// A stretch of the columns.
    fn part(&self, chunk: usize) -> (Nest, Vec<[f64; 2]>, &[f64]) {
        let range = chunk * CHUNK..((chunk + 1) * CHUNK).min(self.at.len());
        let per_column = self.per_column();
        let nest = Nest { azimuths: range.len(), differences: 1, halves: per_column };
        (nest, self.at[range.clone()].to_vec(), &self.halves[range.start * per_column..range.end * per_column])
    }

    /// The same points for `groups` codes.
    fn nested(at: &[[f64; 2]], halves: &[f64], groups: usize) -> NestPoints {
        NestPoints {
            azimuths: at.iter().map(|column| column[1]).collect::<Vec<_>>().repeat(groups),
            differences: at.iter().map(|column| column[0]).collect::<Vec<_>>().repeat(groups),
            halves: halves.repeat(groups),
        }
    }

    fn chunks(&self) -> usize {
        self.at.len().div_ceil(CHUNK)
    }
}

/// The logarithm of the density of each of `groups` codes at each point of the columns: `[group][column][half]`.
pub fn log_densities(flow: &Flow, codes: &[f32], groups: usize, columns: &CubeColumns) -> Vec<Vec<f32>> {
    let length = flow.architecture().code;
    // Many codes at once would make large intermediate results: a few groups at a time.
    let blocks: Vec<(usize, usize)> =
        (0..groups.div_ceil(12)).flat_map(|block| (0..columns.chunks()).map(move |chunk| (block, chunk))).collect();
    let parts = parallel::map_items(&blocks, |&(block, chunk)| {
        let range = block * 12..((block + 1) * 12).min(groups);
        let (nest, at, halves) = columns.part(chunk);
        let nested = CubeColumns::nested(&at, halves, range.len());
        Pass::of(flow).forward(flow, &codes[range.start * length..range.end * length], nest, &nested)
    });
    let mut densities: Vec<Vec<f32>> = (0..groups).map(|_| Vec::with_capacity(columns.halves.len())).collect();
    for ((block, _), part) in blocks.iter().zip(&parts) {
        let groups = (groups - block * 12).min(12);
        for (group, own) in part.chunks_exact((part.len() / groups).max(1)).enumerate() {
            densities[block * 12 + group].extend(own.iter().map(|&value| value as f32));
        }
    }
    densities
}

/// Adds to `d_codes` (a row a group) the derivative of the sum of adjoint times log density. `d_log_density` is laid
/// out as [`log_densities`] returns.
pub fn pull_back_codes(
    flow: &Flow,
    codes: &[f32],
    groups: usize,
    columns: &CubeColumns,
    d_log_density: &[Vec<f32>],
    d_codes: &mut [f32],
) {
    let parts = parallel::map(columns.chunks(), |chunk| {
        let (nest, at, halves) = columns.part(chunk);
        let nested = CubeColumns::nested(&at, halves, groups);
        let mut pass = Pass::of(flow);
        pass.forward(flow, codes, nest, &nested);
        let from = chunk * CHUNK * columns.per_column();
        let adjoint: Vec<f64> = d_log_density
            .iter()
            .flat_map(|own| own[from..from + halves.len()].iter().map(|&value| f64::from(value)))
            .collect();
        let mut d_codes = vec![0.0; codes.len()];
        pass.backward(flow, nest, &nested, &adjoint, &mut [], &mut d_codes);
        d_codes
    });
    for part in parts {
        d_codes.iter_mut().zip(&part).for_each(|(sum, own)| *sum += own);
    }
}
