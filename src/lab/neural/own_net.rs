//! One net for one material: all weights of a flow fitted to one table.
//!
//! The paper's unconditional model. The three channels share the net, each has a code that tells it from the others; a
//! code and its colour are fitted with the weights. What is made small is the square of the main figure of
//! [`crate::measured::metrics`], by which models are compared, on cells drawn anew for every step. The paper makes the
//! negative likelihood small, which cares for bright parts only: `patina measured train --only` does that.
//!
//! Adam moves everything, from weights that were trained on a library and the codes of it that come nearest, or from
//! weights drawn at random. A step is a function of the seed and its number, sums are taken in a fixed order: the bits
//! do not depend on the threads.

use crate::error::{Error, ErrorKind, Result};
use crate::math::parallel;
use crate::math::random::mix;
use crate::measured::metrics::{LOG_FLOOR, TableError, table_error};
use crate::measured::table::MeasuredBrdf;
use crate::neural::adam::{Adam, RateSchedule};
use crate::neural::architecture::Architecture;
use crate::neural::cells::{Batch, CountedColumns};
use crate::neural::columns::{Nest, NestPoints};
use crate::neural::flow::Flow;
use crate::neural::lobes::stored_value;
use crate::neural::model::FlowModel;
use crate::neural::pass::Pass;
use crate::neural::train::project_to_ball;
use crate::neural::weights::Trained;
use std::sync::Arc;

/// Name of the model in tables.
pub const NAME: &str = "iBRDF (one net per material)";
/// Name of the model on the command line.
pub const KEY: &str = "ibrdf";

/// Name of the file of weights in a folder of a fit.
pub const FILE: &str = "weights.safetensors";

/// Steps at the end of a round that say how well it went.
const LATE: u64 = 100;

/// Columns that one thread takes at once: fixed, so that sums are taken in the same order whatever the threads.
const CHUNK: usize = 64;

/// Where the weights begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OwnNetStart {
    /// At those of the library, with the codes that come nearest.
    Library,
    /// Drawn at random, of the same architecture.
    Scratch,
}

/// How a net is fitted to a table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OwnNetSettings {
    /// Columns drawn for a step.
    pub columns: usize,
    /// Cells of each column.
    pub per_column: usize,
    /// Steps of Adam a round.
    pub steps: u64,
    /// Rounds at most: rates rise again for the next one.
    pub rounds: u64,
    /// No further round follows one that ended below this log-RMSE.
    pub enough: f64,
    /// Rate of the weights at the start; all rates fall along half a cosine.
    pub rate: f32,
    /// Rate of codes and of the logarithms of colours.
    pub code_rate: f32,
    /// Where the weights begin.
    pub start: OwnNetStart,
    /// The floor of the density, see [`Architecture::floor_digits`]: lower than the library's, since logarithms of what is
    /// measured as zero count.
    pub floor_digits: u8,
    /// Seed of the cells, and of weights that are drawn.
    pub seed: u64,
}

impl Default for OwnNetSettings {
    fn default() -> Self {
        OwnNetSettings {
            columns: 192,
            per_column: 10,
            steps: 1000,
            rounds: 3,
            enough: 0.2,
            rate: 3e-3,
            code_rate: 1e-2,
            start: OwnNetStart::Library,
            floor_digits: 8,
            seed: 1,
        }
    }
}

/// A fit.
#[derive(Debug)]
pub struct OwnNetFit {
    /// The flow with its own weights; codes and colours are those of the material.
    pub model: FlowModel,
    /// Codes and colours, parameters of the model.
    pub parameters: Vec<f64>,
    /// Error over all cells that count, exact values of the flow.
    pub error: TableError,
    /// The main figure on the cells of the last hundred steps.
    pub late_log_rmse: f64,
    /// Where its weights began.
    pub start: OwnNetStart,
}

impl OwnNetFit {
    /// Numbers that were fitted: weights, codes and colours.
    pub fn parameter_count(&self) -> usize {
        self.model.trained().flow.weights.len() + self.parameters.len()
    }

    /// The weights with codes and colours under a material's name, to be written and read as any trained flow. `command`
    /// is told as what made them.
    pub fn named(&self, material: &str, command: &str) -> Trained {
        let mut own = Trained::clone(self.model.trained());
        own.account.materials = vec![material.into()];
        own.account.left_out = Vec::new();
        own.account.data = match self.start {
            OwnNetStart::Library => format!("one material, {material}; begun from weights of: {}", own.account.data),
            OwnNetStart::Scratch => format!("one material, {material}; begun from weights drawn at random"),
        };
        own.account.command = command.into();
        own.account.log_error = self.error.log_rmse;
        own
    }
}

/// What one step found.
#[derive(Default)]
struct Found {
    squared_error: f64,
    d_weights: Vec<f32>,
    d_codes: Vec<f32>,
    d_colours: [f64; 3],
}

/// Fits all weights of a flow of the architecture of `library` to a table.
///
/// # Errors
/// A table of which no cell counts, a library without codes when the start is asked from there.
pub fn fit_own_net(library: &Trained, table: &MeasuredBrdf, settings: &OwnNetSettings) -> Result<OwnNetFit> {
    let columns = CountedColumns::of(table);
    if columns.is_empty() {
        return Err(Error::new(ErrorKind::NonFinite, "no cell of the table counts: its red is 0 everywhere"));
    }
    let mut own = start(library, table, settings)?;
    let length = own.account.architecture.code;
    let mut of_weights = Adam::new(own.flow.weights.len());
    let mut of_rest = Adam::new(own.codes.len() + 3);
    let mut late_log_rmse = f64::INFINITY;
    for round in 0..settings.rounds.max(1) {
        if late_log_rmse < settings.enough {
            break;
        }
        let (mut late, mut late_steps) = (0.0, 0);
        for step in 0..settings.steps {
            let batch = columns.draw(
                settings.columns,
                settings.per_column,
                mix(settings.seed ^ mix((round * settings.steps + step) ^ 0x0e7)),
            );
            let found = evaluate(&own, &columns, &batch);
            if step + LATE >= settings.steps {
                late += found.squared_error;
                late_steps += 1;
            }
            let factor = RateSchedule::Cosine.factor(step, settings.steps);
            of_weights.step(&mut own.flow.weights, &found.d_weights, settings.rate * factor);
            let mut rest: Vec<f32> = own.codes.iter().chain(&own.log_colours).copied().collect();
            let of_colours = found.d_colours.iter().map(|&slope| slope as f32);
            let gradient: Vec<f32> = found.d_codes.iter().copied().chain(of_colours).collect();
            of_rest.step(&mut rest, &gradient, settings.code_rate * factor);
            let (codes, colours) = rest.split_at(own.codes.len());
            own.codes.copy_from_slice(codes);
            own.log_colours.copy_from_slice(colours);
            own.codes.chunks_mut(length.max(1)).for_each(project_to_ball);
        }
        late_log_rmse = (late / f64::from(late_steps.max(1))).sqrt();
    }
    let parameters: Vec<f64> = own.codes.iter().chain(&own.log_colours).map(|&value| f64::from(value)).collect();
    let model = FlowModel::new(Arc::new(own), 1);
    let error = table_error(&model.table(&parameters), table)?;
    Ok(OwnNetFit { model, parameters, error, late_log_rmse, start: settings.start })
}

/// Weights, codes and colours to start from.
fn start(library: &Trained, table: &MeasuredBrdf, settings: &OwnNetSettings) -> Result<Trained> {
    let length = library.account.architecture.code;
    let nearest = crate::neural::fit::nearest_codes(library, table, settings.seed)?;
    // Each channel has a code to itself, shape included.
    let floor_digits = settings.floor_digits;
    let architecture = Architecture { floor_digits, shape: 0, ..library.account.architecture.clone() };
    let mut own = Trained { codes: Vec::new(), log_colours: Vec::new(), ..library.clone() };
    own.account.materials = vec!["fitted".into()];
    own.account.architecture = architecture.clone();
    let weights = std::mem::take(&mut own.flow.weights);
    own.flow = Flow::new(architecture, settings.seed)?;
    if settings.start == OwnNetStart::Library {
        own.flow.weights = weights;
    }
    for (channel, (row, colour)) in nearest.into_iter().enumerate() {
        own.log_colours.push(colour as f32);
        match settings.start {
            OwnNetStart::Library => own.codes.extend_from_slice(&library.codes[row * length..(row + 1) * length]),
            OwnNetStart::Scratch => own.codes.extend((0..length).map(|i| if i % 3 == channel { 0.3 } else { 0.0 })),
        }
    }
    Ok(own)
}

/// Error and gradient on the cells of a batch.
fn evaluate(own: &Trained, columns: &CountedColumns, batch: &Batch) -> Found {
    let per_column = batch.cells.len() / batch.columns.len().max(1);
    let scale = 1.0 / (3 * batch.cells.len()) as f64;
    let of_chunk = |chunk: usize, picked: &[usize]| -> Found {
        let cells = &batch.cells[chunk * CHUNK * per_column..][..picked.len() * per_column];
        let nest = Nest { azimuths: picked.len(), differences: 1, halves: per_column };
        let at = NestPoints {
            azimuths: picked.iter().map(|&column| columns.at[column][1]).collect::<Vec<_>>().repeat(3),
            differences: picked.iter().map(|&column| columns.at[column][0]).collect::<Vec<_>>().repeat(3),
            halves: cells.iter().map(|&cell| f64::from(columns.half[cell])).collect::<Vec<_>>().repeat(3),
        };
        let mut pass = Pass::of(&own.flow);
        let log_density = pass.forward(&own.flow, &own.codes, nest, &at);
        let mut found = Found::default();
        let mut adjoint = Vec::with_capacity(log_density.len());
        for (channel, densities) in log_density.chunks_exact(cells.len()).enumerate() {
            let colour = f64::from(own.log_colours[channel]);
            for (&cell, &density) in cells.iter().zip(densities) {
                let (stored, slope) = stored_value(colour, density);
                let difference = (stored + LOG_FLOOR).ln() - f64::from(columns.log_stored[cell][channel]);
                found.squared_error += scale * difference * difference;
                let pull = 2.0 * scale * difference * slope / (stored + LOG_FLOOR);
                found.d_colours[channel] += pull;
                adjoint.push(pull);
            }
        }
        found.d_weights = vec![0.0; own.flow.weights.len()];
        found.d_codes = vec![0.0; own.codes.len()];
        pass.backward(&own.flow, nest, &at, &adjoint, &mut found.d_weights, &mut found.d_codes);
        found
    };
    let parts: Vec<Found> = parallel::map_chunks(&batch.columns, CHUNK, of_chunk);
    let add = |mut sum: Found, part: Found| {
        sum.squared_error += part.squared_error;
        sum.d_weights.iter_mut().zip(&part.d_weights).for_each(|(sum, own)| *sum += own);
        sum.d_codes.iter_mut().zip(&part.d_codes).for_each(|(sum, own)| *sum += own);
        sum.d_colours.iter_mut().zip(&part.d_colours).for_each(|(sum, own)| *sum += own);
        sum
    };
    parts.into_iter().reduce(add).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::SequentialRandom;
    use crate::neural::lobes::{CubeColumns, log_densities};

    /// A glossy material that waves with `phi_difference` and is nearly black in green away from the mirror direction.
    fn table() -> MeasuredBrdf {
        MeasuredBrdf::from_fn(|at| {
            let lobe = (-(at.theta_half / 0.2).powi(2)).exp() * (1.0 + 3.0 * at.theta_difference.powi(4));
            let wave = 1.0 + 0.3 * (2.0 * at.phi_difference).cos() * at.theta_difference;
            [0.05 * wave + lobe, 0.002 + 0.3 * (-(at.theta_half / 0.5).powi(2)).exp(), 0.02 + 0.5 * lobe]
        })
    }

    fn few(steps: u64) -> OwnNetSettings {
        OwnNetSettings { columns: 96, per_column: 8, steps, rounds: 1, ..OwnNetSettings::default() }
    }

    #[test]
    #[ignore = "slow: 250 steps of a whole net"]
    fn a_known_table_is_recovered_and_the_flow_stays_a_flow() {
        let table = table();
        let library = crate::neural::shipped().unwrap();
        let before = fit_own_net(&library, &table, &few(0)).unwrap();
        let found = fit_own_net(&library, &table, &few(250)).unwrap();
        assert!(found.error.log_rmse < 0.5 * before.error.log_rmse.min(0.5), "{:?} {:?}", before.error, found.error);
        assert!((found.late_log_rmse - found.error.log_rmse).abs() < 0.5 * found.error.log_rmse);
        let own = found.model.trained();
        assert_eq!(found.parameter_count(), own.flow.weights.len() + 3 * own.account.architecture.code + 3);
        // The density integrates to 1: midpoints of even parts.
        let (columns, halves) = (32 * 24, 512);
        let even = |index: usize, count: usize| (index as f64 + 0.5) / count as f64;
        let points = CubeColumns {
            at: (0..columns).map(|column| [even(column / 24, 32), even(column % 24, 24)]).collect(),
            halves: (0..columns * halves).map(|index| even(index % halves, halves)).collect(),
        };
        for densities in log_densities(&own.flow, &own.codes, 3, &points) {
            let mass = densities.iter().map(|&log| f64::from(log).exp()).sum::<f64>() / densities.len() as f64;
            assert!((mass - 1.0).abs() < 4e-3, "{mass}");
        }
        // The inverse is one.
        let mut random = SequentialRandom::new(5);
        let uniform: Vec<[f64; 3]> = (0..500).map(|_| [0; 3].map(|_| f64::from(random.next_number()))).collect();
        for code in own.codes.chunks_exact(own.account.architecture.code) {
            let drawn: Vec<[f64; 3]> =
                own.flow.carry_from_uniform(&uniform, code).into_iter().map(|(point, _)| point).collect();
            let back = own.flow.to_uniform(&drawn, code);
            let near = |(a, b): (&[f64; 3], &[f64; 3])| (0..3).all(|axis| (a[axis] - b[axis]).abs() < 1e-5);
            assert!(back.iter().zip(&uniform).all(near));
        }
    }

    #[test]
    #[ignore = "slow: three fits, each judged over its whole table"]
    fn a_fit_has_the_same_bits_again_and_on_one_thread() {
        let (table, library) = (table(), crate::neural::shipped().unwrap());
        let first = fit_own_net(&library, &table, &few(12)).unwrap();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let again = pool.install(|| fit_own_net(&library, &table, &few(12))).unwrap();
        assert_eq!(first.model.trained().flow.weights, again.model.trained().flow.weights);
        assert_eq!((&first.parameters, first.error), (&again.parameters, again.error));
        // Its weights are a file that is read as any other.
        let folder = tempfile::tempdir().unwrap();
        first.named("velvet", "a test").write(&folder.path().join(FILE)).unwrap();
        let read = Trained::read(&folder.path().join(FILE)).unwrap();
        let parameters = FlowModel::new(Arc::new(read), 1).of_material("velvet").unwrap();
        assert_eq!(parameters, first.parameters);
        let other = OwnNetSettings { seed: 2, start: OwnNetStart::Scratch, ..few(12) };
        assert_ne!(fit_own_net(&library, &table, &other).unwrap().parameters, first.parameters);
    }

    #[test]
    fn a_black_table_and_weights_without_materials_are_refused() {
        let library = crate::neural::shipped().unwrap();
        let black = MeasuredBrdf::from_fn(|_| [0.0; 3]);
        assert!(fit_own_net(&library, &black, &few(1)).is_err());
        let empty = Trained { codes: Vec::new(), log_colours: Vec::new(), ..library };
        assert_eq!(fit_own_net(&empty, &table(), &few(1)).unwrap_err().kind(), ErrorKind::Missing);
    }
}
