//! Densities over nested grids of points by the fastest path a flow has.

use super::columns::{ColumnTape, Nest, NestPoints};
use super::flow::{Flow, FlowTape};
use super::warp::{AZIMUTH, DIFFERENCE, HALF};

/// The fast path of a triangular flow, or the general one.
#[derive(Debug)]
pub enum Pass {
    /// Columns share nets.
    Columns(Box<ColumnTape>),
    /// Every point has its own.
    General(FlowTape),
}

impl Pass {
    /// The fastest path that a flow can take.
    pub fn of(flow: &Flow) -> Self {
        if flow.architecture().is_triangular() {
            Pass::Columns(Box::default())
        } else {
            Pass::General(FlowTape::default())
        }
    }

    /// The logarithm of the density at every point, on one thread. `codes` has a row per group, or is empty.
    pub fn forward(&mut self, flow: &Flow, codes: &[f32], nest: Nest, at: &NestPoints) -> Vec<f64> {
        match self {
            Pass::Columns(tape) => flow.columns(codes, nest, at, tape),
            Pass::General(tape) => {
                let mut points: Vec<[f64; 3]> = Vec::with_capacity(at.halves.len());
                for (index, &half) in at.halves.iter().enumerate() {
                    let column = index / nest.halves;
                    let mut point = [0.0; 3];
                    point[HALF] = half;
                    point[DIFFERENCE] = at.differences[column];
                    point[AZIMUTH] = at.azimuths[column / nest.differences];
                    points.push(point);
                }
                // Without codes all rows are one group.
                let per_group = if codes.is_empty() { points.len() } else { nest.points() };
                flow.forward(&mut points, codes, per_group, tape)
            }
        }
    }

    /// The reverse: adds to the adjoints of weights (left out when empty) and codes.
    pub fn backward(
        &mut self,
        flow: &Flow,
        nest: Nest,
        at: &NestPoints,
        d_log_density: &[f64],
        d_weights: &mut [f32],
        d_codes: &mut [f32],
    ) {
        match self {
            Pass::Columns(tape) => flow.columns_backward(nest, at, tape, d_log_density, d_weights, d_codes),
            Pass::General(tape) => {
                flow.backward(tape, d_log_density, d_weights, d_codes);
            }
        }
    }
}
