//! The flow as a [`ReflectanceModel`]: a grid of nodes decoded from codes and colours, read by interpolation.
//!
//! A joint estimation asks for a million values per step, of which few differ. The nodes are evaluated exactly, the
//! rest is linear between them in `log(1 + stored value)`; what that costs is measured by
//! [`FlowModel::interpolation_error`] and small beside the error of any fit. Who needs exact values asks
//! [`FlowModel::exact`] or, for whole tables, [`FlowModel::table`].
//!
//! Parameters: per lobe its shape if there is one and three codes (red, green, blue), see [`super::code_rows`]; then per
//! lobe three logarithms of colours.

use super::code_rows::CodeRows;
use super::lobes::{CubeColumns, log_densities, pull_back_codes, stored_value};
use super::nodes::GridShape;
use super::warp::{AZIMUTH, DIFFERENCE, HALF, to_cube};
use super::weights::Trained;
use crate::math::parallel;
use crate::measured::coordinates::HalfDifference;
use crate::measured::grid::{
    CELL_COUNT, PHI_DIFFERENCE_COUNT, THETA_DIFFERENCE_COUNT, THETA_HALF_COUNT, cell_of_indices, coordinates_of_cell,
};
use crate::measured::model::ReflectanceModel;
use crate::measured::table::{CHANNEL_SCALE, INVALID, MeasuredBrdf};
use rayon::prelude::*;
use std::sync::{Arc, Mutex, PoisonError};

/// What was decoded last: parameters, and `log(1 + stored value)` at each node.
type Decoded = Arc<(Vec<f64>, Vec<[f32; 3]>)>;

/// A trained flow that stands for reflectance by some lobes.
#[derive(Debug)]
pub struct FlowModel {
    trained: Arc<Trained>,
    lobes: usize,
    grid: GridShape,
    last: Mutex<Option<Decoded>>,
}

impl FlowModel {
    /// A model of `lobes` lobes (at least one) on the usual grid.
    pub fn new(trained: Arc<Trained>, lobes: usize) -> Self {
        Self::with(trained, lobes, GridShape::default())
    }

    /// A model with a grid of its own; every side has at least two nodes.
    pub fn with(trained: Arc<Trained>, lobes: usize, grid: GridShape) -> Self {
        let grid = GridShape {
            halves: grid.halves.max(2),
            differences: grid.differences.max(2),
            azimuths: grid.azimuths.max(2),
        };
        FlowModel { trained, lobes: lobes.max(1), grid, last: Mutex::new(None) }
    }

    /// The weights it stands on.
    pub fn trained(&self) -> &Arc<Trained> {
        &self.trained
    }

    /// How many lobes there are.
    pub fn lobes(&self) -> usize {
        self.lobes
    }

    /// How parameters become the rows of codes of the flow.
    pub(super) fn code_rows(&self) -> CodeRows {
        CodeRows::of(&self.trained.account.architecture, self.lobes)
    }

    /// How many of the parameters are codes; the rest are logarithms of colours, three a lobe.
    pub fn code_parameters(&self) -> usize {
        self.code_rows().parameters()
    }

    /// Codes within the ball, a row for each lobe and channel, and the logarithms of the colours.
    pub(super) fn unpack(&self, parameters: &[f64]) -> (Vec<f32>, Vec<f64>) {
        let colours = parameters[self.code_parameters()..].iter();
        let held = |&colour: &f64| if colour.is_finite() { colour.clamp(-30.0, 10.0) } else { 0.0 };
        (self.code_rows().rows(parameters), colours.map(held).collect())
    }

    /// Parameters that give a material of the library back: its codes in the first lobe, the others dark.
    pub fn of_material(&self, name: &str) -> Option<Vec<f64>> {
        let (codes, colours) = self.trained.material(name)?;
        let mut parameters = vec![0.0; self.parameter_count()];
        let from = self.code_parameters();
        for lobe in 0..self.lobes {
            self.code_rows().set_lobe(lobe, |channel| codes[channel], &mut parameters);
            for channel in 0..3 {
                let dark = if lobe == 0 { 0.0 } else { -20.0 };
                parameters[from + 3 * lobe + channel] = f64::from(colours[channel]) + dark;
            }
        }
        Some(parameters)
    }

    /// Stored values, summed over lobes, at points of columns: `[column][half]`.
    fn stored(&self, parameters: &[f64], columns: &CubeColumns) -> Vec<[f32; 3]> {
        let (codes, colours) = self.unpack(parameters);
        let densities = log_densities(&self.trained.flow, &codes, 3 * self.lobes, columns);
        let mut stored = vec![[0.0f32; 3]; columns.halves.len()];
        parallel::each_chunk(&mut stored, 1024, &|chunk, stored| {
            for (value, index) in stored.iter_mut().zip(1024 * chunk..) {
                for (group, density) in densities.iter().enumerate() {
                    value[group % 3] += stored_value(colours[group], f64::from(density[index])).0 as f32;
                }
            }
        });
        stored
    }

    /// `log(1 + stored value)` at every node, exact. The last result is kept.
    pub fn decode(&self, parameters: &[f64]) -> Decoded {
        // The lock is not held while decoding: a thread that waits for its share of the work may come here again.
        let kept = self.last.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if let Some(decoded) = kept.filter(|decoded| decoded.0 == parameters) {
            return decoded;
        }
        let all: Vec<usize> = (0..self.grid.azimuths * self.grid.differences).collect();
        let mut nodes = self.stored(parameters, &self.grid.columns(&all));
        nodes.iter_mut().for_each(|value| *value = value.map(f32::ln_1p));
        let decoded = Arc::new((parameters.to_vec(), nodes));
        *self.last.lock().unwrap_or_else(PoisonError::into_inner) = Some(Arc::clone(&decoded));
        decoded
    }

    /// Adds to `gradient` the derivative of the sum over nodes of adjoint times `log(1 + stored value)`. Columns of
    /// nodes whose adjoint is zero cost nothing.
    pub fn pull_back_nodes(&self, parameters: &[f64], d_nodes: &[[f32; 3]], gradient: &mut [f64]) {
        let halves = self.grid.halves;
        let touched: Vec<usize> = d_nodes
            .chunks_exact(halves)
            .enumerate()
            .filter(|(_, column)| column.iter().any(|value| *value != [0.0; 3]))
            .map(|(column, _)| column)
            .collect();
        if touched.is_empty() {
            return;
        }
        let columns = self.grid.columns(&touched);
        let (codes, colours) = self.unpack(parameters);
        let groups = 3 * self.lobes;
        let densities = log_densities(&self.trained.flow, &codes, groups, &columns);
        let mut adjoint: Vec<Vec<f32>> = vec![vec![0.0; columns.halves.len()]; groups];
        let from = self.code_parameters();
        for (slot, &column) in touched.iter().enumerate() {
            for half in 0..halves {
                let (index, node) = (slot * halves + half, column * halves + half);
                for channel in 0..3 {
                    let parts = (0..self.lobes).map(|lobe| 3 * lobe + channel);
                    let value = |group: usize| stored_value(colours[group], f64::from(densities[group][index]));
                    let total: f64 = parts.clone().map(|group| value(group).0).sum();
                    for group in parts {
                        let own = f64::from(d_nodes[node][channel]) * value(group).1 / (1.0 + total);
                        adjoint[group][index] = own as f32;
                        gradient[from + group] += own;
                    }
                }
            }
        }
        let mut d_codes = vec![0.0f32; codes.len()];
        pull_back_codes(&self.trained.flow, &codes, groups, &columns, &adjoint, &mut d_codes);
        self.code_rows().add_slopes(&d_codes, gradient);
    }

    /// Exact reflectance in 1/sr at each point, no grid between: slow, a net for each point.
    pub fn exact(&self, parameters: &[f64], at: &[HalfDifference]) -> Vec<[f64; 3]> {
        let points: Vec<Option<[f64; 3]>> = at.iter().map(|&at| to_cube(at)).collect();
        let inside: Vec<[f64; 3]> = points.iter().flatten().copied().collect();
        let columns = CubeColumns {
            at: inside.iter().map(|point| [point[DIFFERENCE], point[AZIMUTH]]).collect(),
            halves: inside.iter().map(|point| point[HALF]).collect(),
        };
        let mut stored = self.stored(parameters, &columns).into_iter();
        let value = |stored: [f32; 3]| [0, 1, 2].map(|channel| f64::from(stored[channel]) * CHANNEL_SCALE[channel]);
        points.iter().map(|point| point.and_then(|_| stored.next()).map_or([0.0; 3], value)).collect()
    }

    /// Reads values in 1/sr between the decoded nodes, one at a time; 0 below the horizon.
    pub fn reader(&self, parameters: &[f64]) -> impl Fn(HalfDifference) -> [f64; 3] + Send + Sync + use<> {
        let (decoded, grid) = (self.decode(parameters), self.grid);
        move |at| value_between(grid, &decoded.1, at)
    }

    /// The whole table, exact at every cell; cells below the horizon are invalid.
    pub fn table(&self, parameters: &[f64]) -> MeasuredBrdf {
        let mut raw = vec![INVALID; 3 * CELL_COUNT];
        // A few azimuths at a time keep memory small.
        for azimuths in (0..PHI_DIFFERENCE_COUNT).collect::<Vec<_>>().chunks(20) {
            let mut columns = CubeColumns::default();
            let mut cells: Vec<Option<usize>> = Vec::new();
            for &azimuth in azimuths {
                for difference in 0..THETA_DIFFERENCE_COUNT {
                    let first = coordinates_of_cell(cell_of_indices(0, difference, azimuth));
                    let Some(point) = to_cube(first) else { continue };
                    columns.at.push([point[DIFFERENCE], point[AZIMUTH]]);
                    for half in 0..THETA_HALF_COUNT {
                        let cell = cell_of_indices(half, difference, azimuth);
                        let point = to_cube(coordinates_of_cell(cell));
                        columns.halves.push(point.map_or(0.0, |point| point[HALF]));
                        cells.push(point.map(|_| cell));
                    }
                }
            }
            for (cell, value) in cells.iter().zip(self.stored(parameters, &columns)) {
                if let Some(cell) = cell {
                    (0..3).for_each(|channel| raw[channel * CELL_COUNT + cell] = f64::from(value[channel]));
                }
            }
        }
        // A table of a flow is valid at the mirror direction at least: this cannot fail.
        MeasuredBrdf::from_raw(raw).unwrap_or_else(|_| MeasuredBrdf::from_fn(|_| [0.0; 3]))
    }

    /// Root of the mean squared difference of logarithms of stored values (the figure of
    /// [`crate::measured::metrics`]) between interpolation and exact values, over every `stride`-th cell of a table.
    pub fn interpolation_error(&self, parameters: &[f64], stride: usize) -> f64 {
        let at: Vec<HalfDifference> = (0..CELL_COUNT)
            .step_by(stride.max(1))
            .map(coordinates_of_cell)
            .filter(|&at| to_cube(at).is_some())
            .collect();
        let exact = self.exact(parameters, &at);
        let mut between = vec![[0.0; 3]; at.len()];
        self.evaluate(parameters, &at, &mut between);
        let log = |value: f64, channel: usize| crate::measured::metrics::log_raw(value, channel);
        let squares: f64 = exact
            .iter()
            .zip(&between)
            .flat_map(|(a, b)| [0, 1, 2].map(|channel| (log(a[channel], channel) - log(b[channel], channel)).powi(2)))
            .sum();
        (squares / (3 * at.len()).max(1) as f64).sqrt()
    }
}

/// The value in 1/sr between nodes of `log(1 + stored value)`; 0 below the horizon.
fn value_between(grid: GridShape, nodes: &[[f32; 3]], at: HalfDifference) -> [f64; 3] {
    let Some(tap) = grid.tap(at) else { return [0.0; 3] };
    [0, 1, 2].map(|channel| {
        let log: f32 =
            tap.node.iter().zip(&tap.weight).map(|(&node, weight)| weight * nodes[node as usize][channel]).sum();
        f64::from(log).exp_m1() * CHANNEL_SCALE[channel]
    })
}

impl ReflectanceModel for FlowModel {
    fn name(&self) -> &str {
        "ibrdf"
    }

    fn parameter_count(&self) -> usize {
        self.code_parameters() + 3 * self.lobes
    }

    /// Codes in the middle of the ball, all lobes grey and as bright as the library on average.
    fn start(&self) -> Vec<f64> {
        let mut parameters = vec![0.0; self.parameter_count()];
        let colours = &self.trained.log_colours;
        let mean = colours.iter().map(|&colour| f64::from(colour)).sum::<f64>() / colours.len().max(1) as f64;
        let from = self.code_parameters();
        parameters[from..].fill(mean - (self.lobes as f64).ln());
        parameters
    }

    fn evaluate(&self, parameters: &[f64], at: &[HalfDifference], values: &mut [[f64; 3]]) {
        let decoded = self.decode(parameters);
        let nodes = &decoded.1;
        values.par_iter_mut().zip(at).with_min_len(2048).for_each(|(value, &at)| {
            *value = value_between(self.grid, nodes, at);
        });
    }

    fn pull_back(&self, parameters: &[f64], at: &[HalfDifference], adjoint: &[[f64; 3]], gradient: &mut [f64]) {
        let decoded = self.decode(parameters);
        let mut d_nodes = vec![[0.0f32; 3]; self.grid.count()];
        for (&at, adjoint) in at.iter().zip(adjoint) {
            let Some(tap) = self.grid.tap(at) else { continue };
            for channel in 0..3 {
                let log: f32 = tap
                    .node
                    .iter()
                    .zip(&tap.weight)
                    .map(|(&node, weight)| weight * decoded.1[node as usize][channel])
                    .sum();
                let own = (adjoint[channel] * CHANNEL_SCALE[channel] * f64::from(log).exp()) as f32;
                if own != 0.0 {
                    for (&node, weight) in tap.node.iter().zip(&tap.weight) {
                        d_nodes[node as usize][channel] += own * weight;
                    }
                }
            }
        }
        self.pull_back_nodes(parameters, &d_nodes, gradient);
    }

    fn project(&self, parameters: &mut [f64]) {
        let (codes, colours) = self.unpack(parameters);
        let (rows, from, length) = (self.code_rows(), self.code_parameters(), self.trained.account.architecture.code);
        for lobe in 0..self.lobes {
            rows.set_lobe(lobe, |channel| &codes[(3 * lobe + channel) * length..][..length], parameters);
        }
        parameters[from..].iter_mut().zip(colours).for_each(|(slot, value)| *slot = value);
    }
}
