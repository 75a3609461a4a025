//! Fits codes and colours of lobes to a table, weights held.
//!
//! What is made small is the square of the main figure of [`crate::measured::metrics`] on a fixed sample of columns,
//! evaluated exactly there, plus nothing else: the ball of the codes is the only prior. Adam, as in the released code;
//! its single start at a code of zero is replaced by starts from the codes of the library that come nearest. Channels
//! share nothing, so each has its own best start.

use super::architecture::Architecture;
use super::cells::{counted_in_column, log_stored};
use super::lobes::{CubeColumns, log_densities, pull_back_codes, stored_value};
use super::model::FlowModel;
use super::warp::{AZIMUTH, DIFFERENCE, HALF};
use super::weights::Trained;
use crate::error::{Error, ErrorKind, Result};
use crate::math::random::SequentialRandom;
use crate::measured::grid::{PHI_DIFFERENCE_COUNT, THETA_DIFFERENCE_COUNT};
use crate::measured::metrics::{LOG_FLOOR, TableError, table_error};
use crate::measured::model::ReflectanceModel;
use crate::measured::table::MeasuredBrdf;

/// How a table is fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlowFitSettings {
    /// Columns of the sample.
    pub columns: usize,
    /// Cells of each column.
    pub per_column: usize,
    /// Steps of Adam.
    pub steps: usize,
    /// Rate of the codes at the start; it falls along half a cosine.
    pub code_rate: f64,
    /// Rate of the logarithms of colours, likewise.
    pub colour_rate: f64,
    /// Seed of the sample.
    pub seed: u64,
}

impl Default for FlowFitSettings {
    fn default() -> Self {
        FlowFitSettings { columns: 240, per_column: 20, steps: 250, code_rate: 0.03, colour_rate: 0.05, seed: 1 }
    }
}

impl FlowFitSettings {
    /// Settings that suit a flow: a shape has more numbers to find than codes alone.
    pub fn of(architecture: &Architecture) -> Self {
        match architecture.shape {
            0 => Self::default(),
            _ => FlowFitSettings { columns: 320, steps: 500, ..Self::default() },
        }
    }
}

/// A fit.
#[derive(Clone, Debug, PartialEq)]
pub struct FlowFit {
    /// Parameters of the model.
    pub parameters: Vec<f64>,
    /// Error over all cells that count, exact values of the flow.
    pub error: TableError,
    /// The main figure on the sample.
    pub sampled_log_rmse: f64,
    /// For each channel the row of the library's code that its first lobe started from.
    pub started_from: [usize; 3],
}

/// Cells of a table in columns, their logarithms, and their shares in the figure.
#[derive(Clone, Debug, Default)]
struct Sample {
    columns: CubeColumns,
    log_stored: Vec<[f64; 3]>,
    weight: Vec<f64>,
}

impl Sample {
    /// Draws columns evenly over both angles, and cells evenly over each column.
    fn draw(table: &MeasuredBrdf, settings: &FlowFitSettings) -> Self {
        let mut random = SequentialRandom::new(settings.seed);
        let mut sample = Sample::default();
        let wanted = settings.columns.max(1);
        let all = THETA_DIFFERENCE_COUNT * PHI_DIFFERENCE_COUNT;
        for stratum in 0..wanted {
            // Along a column-major walk every stretch has one; azimuths within are as good as random.
            let (low, high) = (stratum * all / wanted, (stratum + 1) * all / wanted);
            let place = low + random.below((high - low).max(1));
            let (difference, azimuth) = (place / PHI_DIFFERENCE_COUNT, place % PHI_DIFFERENCE_COUNT);
            let cells: Vec<(usize, [f64; 3])> = counted_in_column(table, difference, azimuth).collect();
            let Some((_, first)) = cells.first() else { continue };
            sample.columns.at.push([first[DIFFERENCE], first[AZIMUTH]]);
            for part in 0..settings.per_column.max(1) {
                let (low, high) = (
                    part * cells.len() / settings.per_column.max(1),
                    (part + 1) * cells.len() / settings.per_column.max(1),
                );
                // A short column has parts without cells: they stay in the shape, and weigh nothing.
                let (cell, point) = cells[(low + random.below((high - low).max(1))).min(cells.len() - 1)];
                sample.columns.halves.push(point[HALF]);
                sample.log_stored.push(log_stored(table, cell));
                sample.weight.push((high - low) as f64);
            }
        }
        let total: f64 = sample.weight.iter().sum();
        sample.weight.iter_mut().for_each(|weight| *weight /= total.max(1e-300));
        sample
    }

    /// Mean squared difference of one channel for a lobe of these log densities at its best colour, and that colour.
    fn best_colour(&self, log_density: &[f32], channel: usize) -> (f64, f64) {
        let error = |colour: f64| -> f64 {
            // Every third point is enough to choose a start by.
            (0..self.weight.len())
                .step_by(3)
                .map(|index| {
                    let stored = stored_value(colour, f64::from(log_density[index])).0;
                    self.weight[index] * ((stored + LOG_FLOOR).ln() - self.log_stored[index][channel]).powi(2)
                })
                .sum()
        };
        // The error has one valley in the colour: golden sections.
        let (mut low, mut high) = (-6.0, 4.0);
        for _ in 0..16 {
            let (a, b) = (high - 0.618 * (high - low), low + 0.618 * (high - low));
            if error(a) < error(b) { high = b } else { low = a }
        }
        let colour = 0.5 * (low + high);
        (error(colour), colour)
    }

    /// Error, logarithm of the best colour and row of each code of a library for one channel, the nearest first.
    fn ranked(&self, densities: &[Vec<f32>], channel: usize) -> Vec<(f64, f64, usize)> {
        let of_row = |(row, density): (usize, &Vec<f32>)| {
            let (error, colour) = self.best_colour(density, channel);
            (error, colour, row)
        };
        let mut ranked: Vec<(f64, f64, usize)> = densities.iter().enumerate().map(of_row).collect();
        ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
        ranked
    }
}

/// Fits the model to the table.
///
/// Errors: a table of which no cell counts.
pub fn fit_table(model: &FlowModel, table: &MeasuredBrdf, settings: &FlowFitSettings) -> Result<FlowFit> {
    let sample = Sample::draw(table, settings);
    if sample.weight.is_empty() {
        return Err(Error::new(ErrorKind::NonFinite, "no cell of the table counts: its red is 0 everywhere"));
    }
    let (start, started_from) = start(model, &sample);
    let (parameters, objective) = descend(model, &sample, start, settings);
    let error = table_error(&model.table(&parameters), table)?;
    Ok(FlowFit { parameters, error, sampled_log_rmse: objective.sqrt(), started_from })
}

/// For each channel the row of the nearest code of the library, and the logarithm of the colour at which it is nearest;
/// row 0 for a library without codes.
///
/// Errors: a library that holds no material, a table of which no cell counts.
pub(crate) fn nearest_codes(library: &Trained, table: &MeasuredBrdf, seed: u64) -> Result<[(usize, f64); 3]> {
    let sample = Sample::draw(table, &FlowFitSettings { seed, columns: 120, ..FlowFitSettings::default() });
    let rows = library.log_colours.len();
    if sample.weight.is_empty() || rows == 0 {
        return Err(Error::new(ErrorKind::Missing, "there is no code to start from")
            .remedy("use weights that hold materials, and a table with cells above 0"));
    }
    let densities = log_densities(&library.flow, &library.codes, rows, &sample.columns);
    Ok([0, 1, 2].map(|channel| {
        // There is a first one: the library has rows.
        let (_, colour, row) = sample.ranked(&densities, channel)[0];
        (row, colour)
    }))
}

/// The nearest codes of the library: the nearest in the first lobe, next ones fainter behind it. For each channel a row of
/// its own, where codes have no part that the channels share; otherwise rows of the nearest material.
fn start(model: &FlowModel, sample: &Sample) -> (Vec<f64>, [usize; 3]) {
    let trained = model.trained();
    let architecture = &trained.account.architecture;
    let (length, rows) = (architecture.code, trained.log_colours.len());
    let mut parameters = model.start();
    let mut from = [0; 3];
    if length == 0 || rows == 0 {
        return (parameters, from);
    }
    let densities = log_densities(&trained.flow, &trained.codes, rows, &sample.columns);
    let ranked = [0, 1, 2].map(|channel| sample.ranked(&densities, channel));
    let materials = if architecture.shape > 0 { nearest_materials(&ranked) } else { Vec::new() };
    for lobe in 0..model.lobes() {
        // The best codes are often twins, channels of one material: go further down the list for later lobes.
        let place = 7 * lobe;
        let of_channel = |channel: usize| -> (f64, usize) {
            let ranked = &ranked[channel];
            let within = materials.get(place.min(materials.len().max(1) - 1));
            let own = within.and_then(|&material| ranked.iter().find(|row| row.2 / 3 == material));
            let (_, colour, row) = *own.unwrap_or(&ranked[place.min(ranked.len() - 1)]);
            (colour, row)
        };
        let nearest = [0, 1, 2].map(of_channel);
        let code = |channel: usize| &trained.codes[nearest[channel].1 * length..][..length];
        model.code_rows().set_lobe(lobe, code, &mut parameters);
        let fainter = if lobe == 0 { 0.0 } else { -1.5 };
        for channel in 0..3 {
            parameters[model.code_parameters() + 3 * lobe + channel] = nearest[channel].0 + fainter;
        }
        if lobe == 0 {
            from = nearest.map(|(_, row)| row);
        }
    }
    (parameters, from)
}

/// Materials by the sum of the errors of the channels, each by the material's best row, the nearest first.
fn nearest_materials(ranked: &[Vec<(f64, f64, usize)>; 3]) -> Vec<usize> {
    let count = ranked[0].len() / 3;
    let mut errors: Vec<(f64, usize)> = (0..count).map(|material| (0.0, material)).collect();
    for rows in ranked {
        let mut seen = vec![false; count];
        for &(error, _, row) in rows.iter().filter(|row| row.2 / 3 < count) {
            if !std::mem::replace(&mut seen[row / 3], true) {
                errors[row / 3].0 += error;
            }
        }
    }
    errors.sort_by(|a, b| a.0.total_cmp(&b.0));
    errors.into_iter().map(|(_, material)| material).collect()
}

/// Adam from a start; returns the best parameters seen and their objective.
fn descend(model: &FlowModel, sample: &Sample, start: Vec<f64>, settings: &FlowFitSettings) -> (Vec<f64>, f64) {
    let flow = &model.trained().flow;
    let count = start.len();
    let of_codes = model.code_parameters();
    let groups = 3 * model.lobes();
    let mut parameters = start;
    model.project(&mut parameters);
    let (mut first, mut second) = (vec![0.0; count], vec![0.0; count]);
    let mut best = (parameters.clone(), f64::INFINITY);
    for step in 0..=settings.steps {
        let (codes, colours) = model.unpack(&parameters);
        let densities = log_densities(flow, &codes, groups, &sample.columns);
        let mut adjoint = vec![vec![0.0f32; sample.weight.len()]; groups];
        let mut gradient = vec![0.0; count];
        let mut objective = 0.0;
        for (index, &weight) in sample.weight.iter().enumerate() {
            for channel in 0..3 {
                let parts: Vec<(f64, f64)> = (0..model.lobes())
                    .map(|lobe| {
                        let group = 3 * lobe + channel;
                        stored_value(colours[group], f64::from(densities[group][index]))
                    })
                    .collect();
                let stored: f64 = parts.iter().map(|part| part.0).sum();
                let difference = (stored + LOG_FLOOR).ln() - sample.log_stored[index][channel];
                objective += weight / 3.0 * difference * difference;
                let pull = 2.0 * weight / 3.0 * difference / (stored + LOG_FLOOR);
                for (lobe, part) in parts.iter().enumerate() {
                    let group = 3 * lobe + channel;
                    adjoint[group][index] = (pull * part.1) as f32;
                    gradient[of_codes + group] += pull * part.1;
                }
            }
        }
        if objective < best.1 {
            best = (parameters.clone(), objective);
        }
        if step == settings.steps {
            break;
        }
        let mut d_codes = vec![0.0f32; codes.len()];
        pull_back_codes(flow, &codes, groups, &sample.columns, &adjoint, &mut d_codes);
        model.code_rows().add_slopes(&d_codes, &mut gradient);
        let wave = 0.5 * (1.0 + (std::f64::consts::PI * step as f64 / settings.steps as f64).cos());
        let (one, two) = (1.0 - 0.9f64.powi(step as i32 + 1), 1.0 - 0.99f64.powi(step as i32 + 1));
        for index in 0..count {
            let own = if gradient[index].is_finite() { gradient[index] } else { 0.0 };
            first[index] = 0.9 * first[index] + 0.1 * own;
            second[index] = 0.99 * second[index] + 0.01 * own * own;
            let rate = if index < of_codes { settings.code_rate } else { settings.colour_rate };
            parameters[index] -= rate * (0.02 + wave) * (first[index] / one) / ((second[index] / two).sqrt() + 1e-12);
        }
        model.project(&mut parameters);
    }
    best
}
