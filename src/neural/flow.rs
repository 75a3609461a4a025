//! The invertible flow: couplings that carry a density on the unit cube to the uniform one and back.
//!
//! Source: Chen, Nobuhara and Nishino 2020, "Invertible Neural BRDF for Object Inverse Rendering", equation 6. With
//! data `y` and couplings applied in turn, `p(y)` is the product of the slopes of all transforms. What is here holds
//! for any order of couplings; [`super::columns`] is the fast path of a triangular one, tested against this one.

use super::architecture::Architecture;
use super::dense::{DenseNet, Tape};
use super::spline::{Spline, SplineAdjoint};
use crate::error::{Error, ErrorKind, Result};
use crate::math::random::SequentialRandom;
use rayon::prelude::*;
use std::ops::Range;

/// Points that one thread takes at once: what the nets make of so many stays in the cache of a core.
pub(crate) const CHUNK: usize = 256;

/// A flow with its weights.
#[derive(Clone, Debug)]
pub struct Flow {
    architecture: Architecture,
    nets: Vec<DenseNet>,
    spans: Vec<Range<usize>>,
    /// Weights of all conditioners, one after the other.
    pub weights: Vec<f32>,
}

/// What a pass through the couplings leaves for the way back.
#[derive(Debug, Default)]
pub struct FlowTape {
    nets: Vec<Tape>,
    /// The points before each coupling.
    points: Vec<Vec<[f64; 3]>>,
}

impl Flow {
    /// A flow with weights drawn from `seed`: near the identity. Fails for an architecture whose parts do not fit.
    pub fn new(architecture: Architecture, seed: u64) -> Result<Self> {
        if !architecture.is_sound() {
            return Err(Error::new(ErrorKind::Malformed, "the parts of this flow do not fit each other")
                .remedy("use weights that this program wrote, or another configuration"));
        }
        let nets: Vec<DenseNet> = architecture.couplings.iter().map(|coupling| architecture.net(coupling)).collect();
        let mut spans = Vec::new();
        let mut end = 0;
        for net in &nets {
            spans.push(end..end + net.weight_count());
            end += net.weight_count();
        }
        let mut weights = vec![0.0; end];
        let mut random = SequentialRandom::new(seed);
        for (net, span) in nets.iter().zip(&spans) {
            net.start(&mut weights[span.clone()], &mut random);
        }
        Ok(Flow { architecture, nets, spans, weights })
    }

    /// What it is made of.
    pub fn architecture(&self) -> &Architecture {
        &self.architecture
    }

    /// The conditioner of a coupling, and where its weights are.
    pub fn conditioner(&self, coupling: usize) -> (&DenseNet, Range<usize>) {
        (&self.nets[coupling], self.spans[coupling].clone())
    }

    /// A spline of the shape of a coupling's, and sums of its adjoints.
    pub fn spline(&self, coupling: usize) -> (Spline, SplineAdjoint) {
        let shape = self.architecture.spline(&self.architecture.couplings[coupling]);
        (Spline::new(shape), SplineAdjoint::new(shape))
    }

    fn features(&self, coupling: usize, points: &[[f64; 3]]) -> Vec<f32> {
        let mut features = Vec::new();
        for point in points {
            for &axis in &self.architecture.couplings[coupling].given {
                self.architecture.push_features(axis, point[axis], &mut features);
            }
        }
        features
    }

    /// Carries points to the uniform cube, on one thread; returns the logarithm of the density at each (natural).
    /// Points come in groups of `per_group` that share a row of `codes`.
    pub fn forward(&self, points: &mut [[f64; 3]], codes: &[f32], per_group: usize, tape: &mut FlowTape) -> Vec<f64> {
        let mut log_density = vec![0.0; points.len()];
        tape.nets.resize_with(self.nets.len(), Tape::default);
        tape.points.resize_with(self.nets.len(), Vec::new);
        for (index, coupling) in self.architecture.couplings.iter().enumerate() {
            tape.points[index].clear();
            tape.points[index].extend_from_slice(points);
            let features = self.features(index, points);
            let net = &self.nets[index];
            net.forward(&self.weights[self.spans[index].clone()], &features, codes, per_group, &mut tape.nets[index]);
            let (mut spline, _) = self.spline(index);
            let raw = tape.nets[index].result().chunks_exact(net.outputs());
            for ((point, log_density), raw) in points.iter_mut().zip(&mut log_density).zip(raw) {
                spline.set(raw);
                let (density, moved) = spline.at(point[coupling.transforms]);
                *log_density += density.ln();
                point[coupling.transforms] = moved;
            }
        }
        log_density
    }

    /// The reverse of [`Self::forward`]: given the adjoint of each log density, adds to the adjoints of weights and
    /// codes and returns those of the points. An empty `d_weights` leaves the weights out.
    pub fn backward(
        &self,
        tape: &mut FlowTape,
        d_log_density: &[f64],
        d_weights: &mut [f32],
        d_codes: &mut [f32],
    ) -> Vec<[f64; 3]> {
        let mut d_points = vec![[0.0; 3]; d_log_density.len()];
        for (index, coupling) in self.architecture.couplings.iter().enumerate().rev() {
            let net = &self.nets[index];
            let width = net.outputs();
            let (mut spline, mut adjoint) = self.spline(index);
            let mut d_raw = vec![0.0f32; d_points.len() * width];
            let raw = tape.nets[index].result();
            let axis = coupling.transforms;
            for (row, point) in tape.points[index].iter().enumerate() {
                let raw = &raw[row * width..(row + 1) * width];
                spline.set(raw);
                let (density, _) = spline.at(point[axis]);
                let d_density = d_log_density[row] / density;
                d_points[row][axis] = adjoint.add(&spline, point[axis], d_density, d_points[row][axis]);
                adjoint.finish(&spline, raw, &mut d_raw[row * width..(row + 1) * width]);
            }
            let span = self.spans[index].clone();
            let seen: usize = d_features_per_row(&self.architecture, index);
            let mut d_features = vec![0.0f32; d_points.len() * seen];
            let own = if d_weights.is_empty() { &mut [] } else { &mut d_weights[span.clone()] };
            let weights = &self.weights[span];
            net.backward(weights, &mut tape.nets[index], &d_raw, own, d_codes, Some(&mut d_features));
            for (row, point) in tape.points[index].iter().enumerate() {
                let mut from = row * seen;
                for &given in &coupling.given {
                    let size = feature_size(&self.architecture, given);
                    d_points[row][given] +=
                        self.architecture.pull_features(given, point[given], &d_features[from..from + size]);
                    from += size;
                }
            }
        }
        d_points
    }

    /// [`Self::forward`] where there is no way back: one tape serves all couplings, and stays warm.
    fn carry(&self, points: &mut [[f64; 3]], code: &[f32], log_density: &mut [f64], tape: &mut Tape) {
        for (index, coupling) in self.architecture.couplings.iter().enumerate() {
            let features = self.features(index, points);
            let net = &self.nets[index];
            net.forward(&self.weights[self.spans[index].clone()], &features, code, points.len(), tape);
            let (mut spline, _) = self.spline(index);
            let raw = tape.result().chunks_exact(net.outputs());
            for ((point, log_density), raw) in points.iter_mut().zip(log_density.iter_mut()).zip(raw) {
                spline.set(raw);
                let (density, moved) = spline.at(point[coupling.transforms]);
                *log_density += density.ln();
                point[coupling.transforms] = moved;
            }
        }
    }

    /// Where points of the density are carried in the uniform cube, and the logarithm of the density at each, under one
    /// code (empty for a flow without codes).
    fn carried(&self, points: &[[f64; 3]], code: &[f32]) -> (Vec<[f64; 3]>, Vec<f64>) {
        let (mut moved, mut log_density) = (points.to_vec(), vec![0.0; points.len()]);
        let parts = moved.par_chunks_mut(CHUNK).zip(log_density.par_chunks_mut(CHUNK));
        parts.for_each_init(Tape::default, |tape, (moved, log_density)| self.carry(moved, code, log_density, tape));
        (moved, log_density)
    }

    /// The logarithm of the density at each point of the cube, under one code (empty for a flow without codes).
    pub fn log_density(&self, points: &[[f64; 3]], code: &[f32]) -> Vec<f64> {
        self.carried(points, code).1
    }

    /// Carries points of the density to the uniform cube.
    pub fn to_uniform(&self, points: &[[f64; 3]], code: &[f32]) -> Vec<[f64; 3]> {
        self.carried(points, code).0
    }

    /// Carries uniform points to the density: exact sampling. Returns each point and the logarithm of its density.
    pub fn carry_from_uniform(&self, points: &[[f64; 3]], code: &[f32]) -> Vec<([f64; 3], f64)> {
        points
            .par_chunks(CHUNK)
            .map_init(Tape::default, |tape, chunk| {
                let mut points = chunk.to_vec();
                let mut log_density = vec![0.0; points.len()];
                for (index, coupling) in self.architecture.couplings.iter().enumerate().rev() {
                    let features = self.features(index, &points);
                    let net = &self.nets[index];
                    let weights = &self.weights[self.spans[index].clone()];
                    net.forward(weights, &features, code, points.len(), tape);
                    let (mut spline, _) = self.spline(index);
                    for (row, raw) in tape.result().chunks_exact(net.outputs()).enumerate() {
                        spline.set(raw);
                        let (moved, density) = spline.inverse(points[row][coupling.transforms]);
                        points[row][coupling.transforms] = moved;
                        log_density[row] += density.ln();
                    }
                }
                points.into_iter().zip(log_density).collect::<Vec<_>>()
            })
            .flatten_iter()
            .collect()
    }
}

fn feature_size(architecture: &Architecture, axis: usize) -> usize {
    let mut features = Vec::new();
    architecture.push_features(axis, 0.5, &mut features);
    features.len()
}

fn d_features_per_row(architecture: &Architecture, coupling: usize) -> usize {
    architecture.couplings[coupling].given.iter().map(|&axis| feature_size(architecture, axis)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::neural::architecture::CODE;

    /// A flow that is far from the identity, a code, and points.
    fn bent(architecture: Architecture, count: usize) -> (Flow, Vec<f32>, Vec<[f64; 3]>) {
        let mut flow = Flow::new(architecture, 4).unwrap();
        let mut random = SequentialRandom::new(9);
        flow.weights.iter_mut().for_each(|weight| *weight += 0.05 * (random.next_number() - 0.5));
        for index in 0..flow.nets.len() {
            // The last layer starts small: make it matter.
            let span = flow.spans[index].clone();
            let last = flow.nets[index].layers().last().map_or(0, |layer| layer.outputs) * 30;
            let from = span.end.saturating_sub(last).max(span.start);
            flow.weights[from..span.end].iter_mut().for_each(|weight| *weight *= 6.0);
        }
        let code = (0..CODE).map(|_| 0.5 * (random.next_number() - 0.5)).collect();
        let points = (0..count).map(|_| [0; 3].map(|_| f64::from(random.next_number()))).collect();
        (flow, code, points)
    }

    #[test]
    fn there_and_back_again() {
        for architecture in [Architecture::paper(CODE), Architecture::compact(CODE)] {
            let (flow, code, points) = bent(architecture, 3000);
            let back = flow.carry_from_uniform(&flow.to_uniform(&points, &code), &code);
            let log_density = flow.log_density(&points, &code);
            let spread = log_density.iter().fold(0.0f64, |most, value| most.max(value.abs()));
            assert!(spread > 0.3, "the flow is bent: {spread}");
            for ((point, (returned, of_returned)), own) in points.iter().zip(&back).zip(&log_density) {
                assert!((0..3).all(|axis| (point[axis] - returned[axis]).abs() < 1e-5), "{point:?} {returned:?}");
                assert!((own - of_returned).abs() < 1e-3);
            }
        }
    }

    #[test]
    fn gradients_of_weights_code_and_points_equal_finite_differences() {
        for architecture in [Architecture::paper(CODE), Architecture::compact(CODE)] {
            let (mut flow, code, points) = bent(architecture, 12);
            let adjoint: Vec<f64> = (0..points.len()).map(|index| (index as f64).cos()).collect();
            let value = |flow: &Flow, points: &[[f64; 3]], code: &[f32]| -> f64 {
                flow.log_density(points, code).iter().zip(&adjoint).map(|(a, b)| a * b).sum()
            };
            let mut tape = FlowTape::default();
            flow.forward(&mut points.clone(), &code, points.len(), &mut tape);
            let (mut d_weights, mut d_code) = (vec![0.0; flow.weights.len()], vec![0.0; CODE]);
            let d_points = flow.backward(&mut tape, &adjoint, &mut d_weights, &mut d_code);
            let agree = |a: &[f64], b: &[f64]| {
                let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|x| x * x).sum::<f64>().sqrt();
                norm(&mut a.iter().zip(b).map(|(a, b)| a - b)) < 0.05 * norm(&mut b.iter().copied())
            };
            // Kinks of rectifiers and knots of splines may lie within a step: single numbers are compared loosely,
            // all of them together tightly.
            let (mut differences, mut derivatives) = (Vec::new(), Vec::new());
            for index in 0..CODE {
                let (mut up, mut down) = (code.clone(), code.clone());
                up[index] += 2e-3;
                down[index] -= 2e-3;
                differences.push((value(&flow, &points, &up) - value(&flow, &points, &down)) / 4e-3);
                derivatives.push(f64::from(d_code[index]));
            }
            assert!(agree(&differences, &derivatives), "{differences:?} {derivatives:?}");
            differences.clear();
            derivatives.clear();
            for row in 0..points.len() {
                for axis in 0..3 {
                    let (mut up, mut down) = (points.clone(), points.clone());
                    up[row][axis] += 1e-4;
                    down[row][axis] -= 1e-4;
                    differences.push((value(&flow, &up, &code) - value(&flow, &down, &code)) / 2e-4);
                    derivatives.push(d_points[row][axis]);
                }
            }
            assert!(agree(&differences, &derivatives), "{differences:?} {derivatives:?}");
            differences.clear();
            derivatives.clear();
            // Weights where the gradient is largest.
            let mut order: Vec<usize> = (0..flow.weights.len()).collect();
            order.sort_by(|&a, &b| d_weights[b].abs().total_cmp(&d_weights[a].abs()));
            for &index in order.iter().take(20) {
                let own = flow.weights[index];
                flow.weights[index] = own + 1e-3;
                let up = value(&flow, &points, &code);
                flow.weights[index] = own - 1e-3;
                let down = value(&flow, &points, &code);
                flow.weights[index] = own;
                differences.push((up - down) / 2e-3);
                derivatives.push(f64::from(d_weights[index]));
            }
            assert!(agree(&differences, &derivatives), "{differences:?} {derivatives:?}");
        }
    }

    #[test]
    fn no_number_is_lost_whatever_the_weights() {
        let mut random = SequentialRandom::new(8);
        for scale in [1e-3f32, 1.0, 1e3, 1e20, f32::INFINITY] {
            let (mut flow, mut code, points) = bent(Architecture::triangular(CODE, "fuzz", 24, 2), 160_000);
            flow.weights.iter_mut().for_each(|weight| *weight *= scale * (random.next_number() - 0.3));
            code.iter_mut().for_each(|number| *number *= 1e6);
            let log_density = flow.log_density(&points, &code);
            assert!(log_density.iter().all(|value| value.is_finite()));
            let drawn = flow.carry_from_uniform(&points[..40_000], &code);
            assert!(drawn.iter().all(|(point, log)| log.is_finite() && point.iter().all(|u| (0.0..1.0).contains(u))));
        }
    }
}
