//! The fast path of a triangular flow: many values of `theta_half` share one pass of one net.
//!
//! Points form nested grids. A group has a code and `azimuths` values of `phi_difference`; each of these has
//! `differences` values of `theta_difference`; each of these has `halves` values of `theta_half`. The nets run once a
//! group, once an azimuth and once a difference. Nothing need be regular: every value is given.

use super::dense::Tape;
use super::flow::Flow;
use super::warp::{AZIMUTH, DIFFERENCE, HALF};

/// The shape of nested grids.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Nest {
    /// Values of `phi_difference` a group.
    pub azimuths: usize,
    /// Values of `theta_difference` an azimuth.
    pub differences: usize,
    /// Values of `theta_half` a difference.
    pub halves: usize,
}

impl Nest {
    /// Points a group.
    pub fn points(self) -> usize {
        self.columns() * self.halves
    }

    /// Columns a group.
    pub fn columns(self) -> usize {
        self.azimuths * self.differences
    }
}

/// Coordinates of nested grids in the unit cube, group after group.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NestPoints {
    /// `azimuths` a group.
    pub azimuths: Vec<f64>,
    /// `azimuths * differences` a group.
    pub differences: Vec<f64>,
    /// `azimuths * differences * halves` a group.
    pub halves: Vec<f64>,
}

/// What a pass leaves for the way back.
#[derive(Debug, Default)]
pub struct ColumnTape {
    nets: [Tape; 3],
}

impl Flow {
    /// The logarithm of the density at every point of nested grids; only for a triangular flow, on one thread.
    pub fn columns(&self, codes: &[f32], nest: Nest, at: &NestPoints, tape: &mut ColumnTape) -> Vec<f64> {
        let groups = at.azimuths.len() / nest.azimuths.max(1);
        let mut log_density = vec![0.0; groups * nest.points()];
        let levels = [
            (HALF, nest.columns(), nest.halves, &at.halves),
            (DIFFERENCE, nest.azimuths, nest.differences, &at.differences),
            (AZIMUTH, 1, nest.azimuths, &at.azimuths),
        ];
        let mut features = Vec::new();
        for (coupling, rows_per_group, per_row, values) in levels {
            features.clear();
            self.column_features(coupling, nest, at, &mut features);
            let (net, span) = self.conditioner(coupling);
            // Without codes all groups are one to the net.
            let rows_of_code = if self.architecture().code == 0 { groups * rows_per_group } else { rows_per_group };
            net.forward(&self.weights[span], &features, codes, rows_of_code, &mut tape.nets[coupling]);
            let (mut spline, _) = self.spline(coupling);
            // Points below one value of this level.
            let share = nest.points() / (rows_per_group * per_row).max(1);
            for (row, raw) in tape.nets[coupling].result().chunks_exact(net.outputs()).enumerate() {
                spline.set(raw);
                for index in row * per_row..(row + 1) * per_row {
                    let own = spline.at(values[index]).0.ln();
                    log_density[index * share..(index + 1) * share].iter_mut().for_each(|sum| *sum += own);
                }
            }
        }
        log_density
    }

    /// The reverse of [`Self::columns`]: adds to the adjoints of weights (left out when empty) and codes.
    pub fn columns_backward(
        &self,
        nest: Nest,
        at: &NestPoints,
        tape: &mut ColumnTape,
        d_log_density: &[f64],
        d_weights: &mut [f32],
        d_codes: &mut [f32],
    ) {
        let levels = [
            (HALF, nest.columns(), nest.halves, &at.halves),
            (DIFFERENCE, nest.azimuths, nest.differences, &at.differences),
            (AZIMUTH, 1, nest.azimuths, &at.azimuths),
        ];
        for (coupling, rows_per_group, per_row, values) in levels {
            let (net, span) = self.conditioner(coupling);
            let (mut spline, mut adjoint) = self.spline(coupling);
            let share = nest.points() / (rows_per_group * per_row).max(1);
            let raw_all = tape.nets[coupling].result();
            let mut d_raw = vec![0.0f32; raw_all.len()];
            let width = net.outputs();
            for (row, (raw, d_raw)) in raw_all.chunks_exact(width).zip(d_raw.chunks_exact_mut(width)).enumerate() {
                spline.set(raw);
                for index in row * per_row..(row + 1) * per_row {
                    let own: f64 = d_log_density[index * share..(index + 1) * share].iter().sum();
                    let (density, _) = spline.at(values[index]);
                    adjoint.add(&spline, values[index], own / density, 0.0);
                }
                adjoint.finish(&spline, raw, d_raw);
            }
            let own = if d_weights.is_empty() { &mut [] } else { &mut d_weights[span.clone()] };
            net.backward(&self.weights[span], &mut tape.nets[coupling], &d_raw, own, d_codes, None);
        }
    }

    fn column_features(&self, coupling: usize, nest: Nest, at: &NestPoints, features: &mut Vec<f32>) {
        let architecture = self.architecture();
        match coupling {
            HALF => {
                for (row, &azimuth) in at.azimuths.iter().enumerate() {
                    for &difference in &at.differences[row * nest.differences..(row + 1) * nest.differences] {
                        architecture.push_features(DIFFERENCE, difference, features);
                        architecture.push_features(AZIMUTH, azimuth, features);
                    }
                }
            }
            DIFFERENCE => at.azimuths.iter().for_each(|&u| architecture.push_features(AZIMUTH, u, features)),
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::SequentialRandom;
    use crate::neural::architecture::{Architecture, CODE};
    use crate::neural::flow::FlowTape;

    /// Densities of a path, and their gradients by weights and by codes.
    type Found = (Vec<f64>, Vec<f32>, Vec<f32>);

    /// What two groups of these codes are given by the general path and by columns.
    fn by_both_paths(flow: &Flow, codes: &[f32], random: &mut SequentialRandom) -> [Found; 2] {
        let nest = Nest { azimuths: 3, differences: 2, halves: 5 };
        let groups = 2;
        let mut numbers = |count: usize| -> Vec<f64> { (0..count).map(|_| f64::from(random.next_number())).collect() };
        let at = NestPoints {
            azimuths: numbers(groups * 3),
            differences: numbers(groups * 6),
            halves: numbers(groups * nest.points()),
        };
        let adjoint = numbers(groups * nest.points());
        let points = at.halves.iter().enumerate();
        let mut points: Vec<[f64; 3]> =
            points.map(|(index, &half)| [half, at.differences[index / 5], at.azimuths[index / 10]]).collect();
        let zeros = || (vec![0.0; flow.weights.len()], vec![0.0; codes.len()]);

        let mut tape = FlowTape::default();
        let general = flow.forward(&mut points, codes, nest.points(), &mut tape);
        let (mut d_weights, mut d_codes) = zeros();
        flow.backward(&mut tape, &adjoint, &mut d_weights, &mut d_codes);
        let mut tape = ColumnTape::default();
        let fast = flow.columns(codes, nest, &at, &mut tape);
        let (mut d_weights_fast, mut d_codes_fast) = zeros();
        flow.columns_backward(nest, &at, &mut tape, &adjoint, &mut d_weights_fast, &mut d_codes_fast);
        [(general, d_weights, d_codes), (fast, d_weights_fast, d_codes_fast)]
    }

    #[test]
    fn columns_give_the_densities_and_gradients_of_the_general_path() {
        let mut flow = Flow::new(Architecture::triangular(CODE, "test", 24, 2), 4).unwrap();
        let mut random = SequentialRandom::new(1);
        flow.weights.iter_mut().for_each(|weight| *weight += 0.3 * (random.next_number() - 0.5));
        let codes: Vec<f32> = (0..2 * CODE).map(|_| random.next_number() - 0.5).collect();
        let [general, fast] = by_both_paths(&flow, &codes, &mut random);
        assert!(general.0.iter().zip(&fast.0).all(|(a, b)| (a - b).abs() < 1e-4));
        assert!(general.0.iter().any(|value| value.abs() > 0.2));
        let close = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 2e-3 * (1.0 + a.abs()));
        assert!(close(&general.1, &fast.1) && close(&general.2, &fast.2));
    }

    #[test]
    fn of_the_shaped_weights_that_ship_as_well() {
        let trained = crate::neural::shaped().unwrap();
        let codes = &trained.codes[..2 * trained.flow.architecture().code];
        let [general, fast] = by_both_paths(&trained.flow, codes, &mut SequentialRandom::new(1));
        assert!(general.0.iter().zip(&fast.0).all(|(a, b)| (a - b).abs() < 1e-3), "{general:?} {fast:?}");
        // Gradients of single weights are large where knots are close to each other.
        let close = |a: &[f32], b: &[f32]| {
            let largest = a.iter().fold(0.0f32, |most, value| most.max(value.abs()));
            largest > 0.0 && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 2e-3 * largest)
        };
        assert!(close(&general.1, &fast.1) && close(&general.2, &fast.2));
    }
}
