//! Nets of dense layers with skips, forward and backward on a batch.
//!
//! Rows of a batch come in groups that share a code: the code's part of the first layer is computed once a group. A
//! layer may see the output of an earlier one beside that of the one before it (concatenation, as in a U-Net). In a
//! net with gates codes scale and shift every layer, see [`super::modulation`].
//! Weights of all layers lie in one slice that the caller owns: per layer a matrix `[inputs][outputs]`, then the bias;
//! behind them those of the gates.

pub use super::activation::Activation;
use super::modulation::{Modulation, scale_and_shift};
use super::product::{Rows, add_rows, multiply, sums_by_group};
use crate::math::random::SequentialRandom;

/// One layer: how many outputs, and which earlier layer's output it sees beside its predecessor's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Layer {
    /// Numbers that come out.
    pub outputs: usize,
    /// Index of the layer whose output is appended to the input.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub beside: Option<usize>,
}

/// The shape of a net; its weights live elsewhere.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DenseNet {
    features: usize,
    code: usize,
    layers: Vec<Layer>,
    activation: Activation,
    /// Where the matrix of each layer begins; one more entry at the end.
    offsets: Vec<usize>,
    /// How codes scale and shift each layer; empty in a net without gates.
    modulations: Vec<Modulation>,
}

/// What a forward pass leaves for the backward pass. Reused from batch to batch.
#[derive(Clone, Debug, Default)]
pub struct Tape {
    features: Vec<f32>,
    codes: Vec<f32>,
    rows_per_group: usize,
    outputs: Vec<Vec<f32>>,
    /// In a net with gates: products of rows and matrix, and the gates of each group, by layer.
    products: Vec<Vec<f32>>,
    gates: Vec<Vec<f32>>,
    adjoints: Vec<Vec<f32>>,
}

impl Tape {
    /// What the last layer gave, row by row.
    pub fn result(&self) -> &[f32] {
        self.outputs.last().map_or(&[], |last| last.as_slice())
    }
}

impl DenseNet {
    /// A net of these layers over `features` numbers a row and `code` numbers a group. Panics when a layer looks beside
    /// itself at a layer that does not come before it: a defect of the caller.
    pub fn new(features: usize, code: usize, layers: Vec<Layer>, activation: Activation) -> Self {
        let mut net = DenseNet { features, code, layers, activation, offsets: vec![0], modulations: Vec::new() };
        for index in 0..net.layers.len() {
            assert!(net.layers[index].beside.is_none_or(|beside| index > 0 && beside < index));
            let size = (net.inputs(index) + 1) * net.layers[index].outputs;
            net.offsets.push(net.offsets[index] + size);
        }
        net
    }

    /// The same net with gates: codes scale and shift every layer. Panics when a layer looks beside itself or there are
    /// no codes: a defect of the caller.
    pub fn with_gates(mut self) -> Self {
        assert!(self.code > 0 && self.layers.iter().all(|layer| layer.beside.is_none()));
        let mut end = self.weight_count();
        for (index, layer) in self.layers.iter().enumerate() {
            let sees_rows = index > 0 || self.features > 0;
            let own = Modulation::new(end, self.code, layer.outputs, index > 0, sees_rows);
            end = own.end();
            self.modulations.push(own);
        }
        self
    }

    /// The layers.
    pub fn layers(&self) -> &[Layer] {
        &self.layers
    }

    /// How many weights there are.
    pub fn weight_count(&self) -> usize {
        let plain = self.offsets.last().copied().unwrap_or(0);
        self.modulations.last().map_or(plain, Modulation::end)
    }

    /// Multiplications of one row, the code's part not counted.
    pub fn multiplications(&self) -> usize {
        (0..self.layers.len())
            .map(|index| (self.inputs(index) - if index == 0 { self.code } else { 0 }) * self.layers[index].outputs)
            .sum()
    }

    /// Numbers that come out of the last layer.
    pub fn outputs(&self) -> usize {
        self.layers.last().map_or(0, |layer| layer.outputs)
    }

    fn inputs(&self, index: usize) -> usize {
        if index == 0 { self.features + self.code } else { self.previous(index) + self.appended(index) }
    }

    fn previous(&self, index: usize) -> usize {
        self.layers[index - 1].outputs
    }

    fn appended(&self, index: usize) -> usize {
        self.layers[index].beside.map_or(0, |beside| self.layers[beside].outputs)
    }

    /// Writes weights to start from: uniform by fan-in (He et al. 2015), the last layer at a tenth of that. What scales and
    /// shifts by code begins small.
    pub fn start(&self, weights: &mut [f32], random: &mut SequentialRandom) {
        for index in 0..self.layers.len() {
            let outputs = self.layers[index].outputs;
            let last = index + 1 == self.layers.len();
            let bound = (6.0 / self.inputs(index) as f32).sqrt() * if last { 0.1 } else { 1.0 };
            let own = &mut weights[self.offsets[index]..self.offsets[index + 1]];
            let (matrix, bias) = own.split_at_mut(self.inputs(index) * outputs);
            matrix.iter_mut().for_each(|weight| *weight = bound * (2.0 * random.next_number() - 1.0));
            let bias_bound = if last { 0.0 } else { 0.2 };
            bias.iter_mut().for_each(|weight| *weight = bias_bound * (2.0 * random.next_number() - 1.0));
        }
        let plain = self.offsets[self.layers.len()];
        weights[plain..].iter_mut().for_each(|weight| *weight = 0.1 * (2.0 * random.next_number() - 1.0));
    }

    /// Evaluates rows of `features`, in groups of `rows_per_group` that share a row of `codes`. The result is on the
    /// tape: see [`Tape::result`].
    pub fn forward(&self, weights: &[f32], features: &[f32], codes: &[f32], rows_per_group: usize, tape: &mut Tape) {
        let groups = codes.len().checked_div(self.code).unwrap_or(1);
        let rows = features.len().checked_div(self.features).unwrap_or(groups * rows_per_group);
        assert_eq!(rows, groups * rows_per_group, "rows of a batch come in whole groups");
        tape.features.clear();
        tape.features.extend_from_slice(features);
        tape.codes.clear();
        tape.codes.extend_from_slice(codes);
        tape.rows_per_group = rows_per_group;
        tape.outputs.resize_with(self.layers.len(), Vec::new);
        tape.products.resize_with(self.modulations.len(), Vec::new);
        tape.gates.resize_with(self.modulations.len(), Vec::new);
        for index in 0..self.layers.len() {
            let width = self.layers[index].outputs;
            let own = &weights[self.offsets[index]..self.offsets[index + 1]];
            let (matrix, bias) = own.split_at(self.inputs(index) * width);
            let (before, rest) = tape.outputs.split_at_mut(index);
            let into = &mut rest[0];
            into.resize(rows * width, 0.0);
            if index == 0 {
                let (of_features, of_code) = matrix.split_at(self.features * width);
                let mut base: Vec<f32> = bias.repeat(groups);
                if self.code > 0 {
                    let codes = Rows::new(&tape.codes, groups, self.code);
                    multiply(codes, Rows::new(of_code, self.code, width), &mut base, true);
                }
                let features = Rows::new(&tape.features, rows, self.features);
                if let Some(modulation) = self.modulations.first().filter(|own| own.scales()) {
                    multiply(features, Rows::new(of_features, self.features, width), into, false);
                    modulation.gates_of(weights, &tape.codes, &mut tape.gates[0]);
                    tape.products[0].clone_from(into);
                    scale_and_shift(into, &tape.gates[0], &base, width);
                } else if rows > 0 {
                    for (block, base) in into.chunks_exact_mut(rows_per_group * width).zip(base.chunks_exact(width)) {
                        block.chunks_exact_mut(width).for_each(|row| row.copy_from_slice(base));
                    }
                    multiply(features, Rows::new(of_features, self.features, width), into, true);
                }
            } else if let Some(modulation) = self.modulations.get(index) {
                let size = self.previous(index);
                multiply(Rows::new(&before[index - 1], rows, size), Rows::new(matrix, size, width), into, false);
                modulation.gates_of(weights, &tape.codes, &mut tape.gates[index]);
                tape.products[index].clone_from(into);
                let shifts = modulation.shifts_of(weights, &tape.codes, bias);
                scale_and_shift(into, &tape.gates[index], &shifts, width);
            } else {
                into.chunks_exact_mut(width).for_each(|row| row.copy_from_slice(bias));
                let (of_previous, of_beside) = matrix.split_at(self.previous(index) * width);
                let previous = Rows::new(&before[index - 1], rows, self.previous(index));
                multiply(previous, Rows::new(of_previous, self.previous(index), width), into, true);
                if let Some(beside) = self.layers[index].beside {
                    let appended = self.appended(index);
                    multiply(
                        Rows::new(&before[beside], rows, appended),
                        Rows::new(of_beside, appended, width),
                        into,
                        true,
                    );
                }
            }
            if index + 1 < self.layers.len() {
                self.activation.apply(into);
            }
        }
    }

    /// Pulls the adjoint of the result back. Adds to `d_weights`, of the shape of the weights, and to `d_codes`, of the
    /// shape of the codes; writes `d_features` when asked for. An empty `d_weights` leaves the weights out.
    pub fn backward(
        &self,
        weights: &[f32],
        tape: &mut Tape,
        d_result: &[f32],
        d_weights: &mut [f32],
        d_codes: &mut [f32],
        d_features: Option<&mut [f32]>,
    ) {
        let count = self.layers.len();
        let rows = tape.outputs[0].len() / self.layers[0].outputs;
        let mut adjoints = std::mem::take(&mut tape.adjoints);
        adjoints.resize_with(count, Vec::new);
        for (index, adjoint) in adjoints.iter_mut().enumerate() {
            adjoint.clear();
            adjoint.resize(rows * self.layers[index].outputs, 0.0);
        }
        adjoints[count - 1].copy_from_slice(d_result);
        for index in (1..count).rev() {
            let width = self.layers[index].outputs;
            let (lower, upper) = adjoints.split_at_mut(index);
            let own = &mut upper[0];
            if index + 1 < count {
                self.activation.pull_back(&tape.outputs[index], own);
            }
            let by_group = self.modulations.get(index).map(|modulation| {
                let (gates, products) = (&tape.gates[index], &tape.products[index]);
                modulation.pull_back(weights, &tape.codes, gates, products, own, d_weights, d_codes)
            });
            let own = Rows::new(own, rows, width);
            let span = self.offsets[index]..self.offsets[index + 1];
            let matrix = &weights[span.clone()];
            let mut row_of = 0;
            let sources = [Some(index - 1), self.layers[index].beside];
            for source in sources.into_iter().flatten() {
                let size = self.layers[source].outputs;
                let part = row_of * width..(row_of + size) * width;
                let input = Rows::new(&tape.outputs[source], rows, size);
                if !d_weights.is_empty() {
                    let d_matrix = &mut d_weights[span.clone()];
                    multiply(input.transpose(), own, &mut d_matrix[part.clone()], true);
                }
                multiply(own, Rows::new(&matrix[part], size, width).transpose(), &mut lower[source], true);
                row_of += size;
            }
            if !d_weights.is_empty() {
                let bias = span.start + row_of * width..span.end;
                add_rows(by_group.as_deref().unwrap_or(own.values), &mut d_weights[bias]);
            }
        }
        let width = self.layers[0].outputs;
        if count > 1 {
            self.activation.pull_back(&tape.outputs[0], &mut adjoints[0]);
        }
        let matrix = &weights[..self.offsets[1]];
        let groups = tape.codes.len().checked_div(self.code).unwrap_or(1);
        let by_group = match self.modulations.first().filter(|own| own.scales()) {
            Some(modulation) => {
                let (gates, products) = (&tape.gates[0], &tape.products[0]);
                modulation.pull_back(weights, &tape.codes, gates, products, &mut adjoints[0], d_weights, d_codes)
            }
            None => sums_by_group(&adjoints[0], groups, tape.rows_per_group, width),
        };
        let first = Rows::new(&adjoints[0], rows, width);
        let code_part = self.features * width..(self.features + self.code) * width;
        let by_group = Rows::new(&by_group, groups, width);
        if !d_weights.is_empty() {
            let features = Rows::new(&tape.features, rows, self.features);
            multiply(features.transpose(), first, &mut d_weights[..self.features * width], true);
            if self.code > 0 {
                let codes = Rows::new(&tape.codes, groups, self.code);
                multiply(codes.transpose(), by_group, &mut d_weights[code_part.clone()], true);
            }
            add_rows(by_group.values, &mut d_weights[code_part.end..self.offsets[1]]);
        }
        if self.code > 0 {
            multiply(by_group, Rows::new(&matrix[code_part], self.code, width).transpose(), d_codes, true);
        }
        if let Some(d_features) = d_features {
            let of_features = Rows::new(&matrix[..self.features * width], self.features, width);
            multiply(first, of_features.transpose(), d_features, false);
        }
        tape.adjoints = adjoints;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gradients_of_weights_codes_and_features_equal_finite_differences() {
        let layers = |beside| -> Vec<Layer> {
            [(9, None), (6, None), (8, beside), (3, None)].map(|(outputs, beside)| Layer { outputs, beside }).into()
        };
        check_gradients(DenseNet::new(2, 4, layers(Some(0)), Activation::Squareplus));
        check_gradients(DenseNet::new(2, 4, layers(None), Activation::Squareplus).with_gates());
    }

    /// Gradients of a net of two features, codes of four and three outputs against finite differences.
    fn check_gradients(net: DenseNet) {
        let mut random = SequentialRandom::new(5);
        let mut numbers = |count: usize| -> Vec<f32> { (0..count).map(|_| random.next_number() - 0.5).collect() };
        let (features, codes, adjoint) = (numbers(6 * 2), numbers(3 * 4), numbers(6 * 3));
        let weights = numbers(net.weight_count());
        let objective = |weights: &[f32], features: &[f32], codes: &[f32]| -> f64 {
            let mut tape = Tape::default();
            net.forward(weights, features, codes, 2, &mut tape);
            tape.result().iter().zip(&adjoint).map(|(a, b)| f64::from(a * b)).sum()
        };
        let mut tape = Tape::default();
        net.forward(&weights, &features, &codes, 2, &mut tape);
        assert_eq!(tape.result().len(), 6 * 3);
        let (mut d_weights, mut d_codes, mut d_features) =
            (vec![0.0; weights.len()], vec![0.0; codes.len()], vec![0.0; features.len()]);
        net.backward(&weights, &mut tape, &adjoint, &mut d_weights, &mut d_codes, Some(&mut d_features));
        let step = 1e-2;
        let check = |values: &[f32], derivative: &[f32], value: &dyn Fn(&[f32]) -> f64| {
            for index in 0..values.len() {
                let (mut up, mut down) = (values.to_vec(), values.to_vec());
                up[index] += step;
                down[index] -= step;
                let difference = (value(&up) - value(&down)) / (2.0 * f64::from(step));
                assert!((difference - f64::from(derivative[index])).abs() < 2e-3, "{index}: {difference}");
            }
        };
        check(&weights, &d_weights, &|weights| objective(weights, &features, &codes));
        check(&codes, &d_codes, &|codes| objective(&weights, &features, codes));
        check(&features, &d_features, &|features| objective(&weights, features, &codes));
    }
}
