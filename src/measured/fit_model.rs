//! Fits a model of few parameters to a table by Levenberg and Marquardt's method, from several starts.
//!
//! What is minimised is the square of the main figure of [`super::metrics`], estimated on a sample of the cells: of each
//! column over `phi_difference` (one per pair of half and difference angle) a few of the cells that count are drawn,
//! each with the weight `cells of the column / cells drawn from it`. Every cell stands for the same share of the
//! figure then, whichever were drawn, so that the expectation of the objective is the square of the figure over all
//! cells. The figure that is reported is always taken over all cells.
//!
//! Deterministic: the sample comes from a seed, sums are reduced in a fixed order.

use super::coordinates::HalfDifference;
use super::grid::{self, PHI_DIFFERENCE_COUNT};
use super::metrics::{LOG_FLOOR, TableError, log_raw, model_error};
use super::model::ReflectanceModel;
use super::table::{CHANNEL_SCALE, MeasuredBrdf};
use crate::error::{Error, ErrorKind, Result};
use crate::math::parallel;
use crate::math::random::SequentialRandom;

/// How a model is fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModelFitSettings {
    /// Cells that are drawn from each column over `phi_difference`, at least 1.
    pub per_column: usize,
    /// Steps of each start, on every eighth cell of the sample.
    pub scouting_steps: usize,
    /// Starts that are followed to the end.
    pub followed: usize,
    /// Most steps of a start that is followed.
    pub steps: usize,
    /// Seed of the sample.
    pub seed: u64,
}

impl Default for ModelFitSettings {
    fn default() -> Self {
        ModelFitSettings { per_column: 1, scouting_steps: 15, followed: 2, steps: 80, seed: 1 }
    }
}

/// A fit.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelFit {
    /// The best parameters found.
    pub parameters: Vec<f64>,
    /// Error over all cells that count.
    pub error: TableError,
    /// The main figure as estimated on the sample.
    pub sampled_log_rmse: f64,
    /// Steps of the start that won, after scouting.
    pub steps: usize,
}

/// Cells of a table with weights that sum to 1.
#[derive(Clone, Debug, Default)]
pub struct CellSample {
    /// Angles of each cell.
    pub at: Vec<HalfDifference>,
    /// `ln(raw + 1e-6)` of each cell.
    pub log_raw: Vec<[f64; 3]>,
    /// Share of each cell in the figure.
    pub weight: Vec<f64>,
}

/// Most parameters that are fitted this way: the normal equations are solved densely.
const MOST_PARAMETERS: usize = 256;
/// Points of one part of a sum.
const CHUNK: usize = 512;

impl CellSample {
    /// Draws `per_column` of the cells that count from each column over `phi_difference`.
    pub fn draw(table: &MeasuredBrdf, per_column: usize, seed: u64) -> Self {
        let mut random = SequentialRandom::new(seed);
        let mut sample = CellSample::default();
        let mut column = Vec::with_capacity(PHI_DIFFERENCE_COUNT);
        let mut total = 0.0;
        for first in (0..grid::CELL_COUNT).step_by(PHI_DIFFERENCE_COUNT) {
            column.clear();
            column.extend((first..first + PHI_DIFFERENCE_COUNT).filter(|&cell| table.counts(cell)));
            let drawn = per_column.max(1).min(column.len());
            for part in 0..drawn {
                // One of each of `drawn` equal stretches of the column: uniform, and spread out.
                let (low, high) = (part * column.len() / drawn, (part + 1) * column.len() / drawn);
                let cell = column[low + random.below(high - low)];
                let value = table.value(cell);
                sample.at.push(grid::coordinates_of_cell(cell));
                sample.log_raw.push(std::array::from_fn(|channel| log_raw(value[channel], channel)));
                sample.weight.push((high - low) as f64);
                total += (high - low) as f64;
            }
        }
        sample.weight.iter_mut().for_each(|weight| *weight /= total);
        sample
    }

    /// Every `stride`-th cell, weights scaled to sum to 1 again.
    fn thinned(&self, stride: usize) -> Self {
        let every = |index: &usize| index.is_multiple_of(stride);
        let picks: Vec<usize> = (0..self.at.len()).filter(every).collect();
        let total: f64 = picks.iter().map(|&i| self.weight[i]).sum();
        CellSample {
            at: picks.iter().map(|&i| self.at[i]).collect(),
            log_raw: picks.iter().map(|&i| self.log_raw[i]).collect(),
            weight: picks.iter().map(|&i| self.weight[i] / total).collect(),
        }
    }

    /// The square of the main figure, estimated.
    pub fn objective(&self, model: &dyn ReflectanceModel, parameters: &[f64]) -> f64 {
        let parts: Vec<f64> = self.parts(|at, log_raws, weights| {
            let mut values = vec![[0.0; 3]; at.len()];
            model.evaluate(parameters, at, &mut values);
            let mut sum = 0.0;
            for ((value, truth), weight) in values.iter().zip(log_raws).zip(weights) {
                for channel in 0..3 {
                    sum += weight / 3.0 * (log_raw(value[channel], channel) - truth[channel]).powi(2);
                }
            }
            sum
        });
        parts.iter().sum()
    }

    fn parts<R: Send>(&self, of: impl Fn(&[HalfDifference], &[[f64; 3]], &[f64]) -> R + Sync) -> Vec<R> {
        parallel::map_chunks(&self.at, CHUNK, |chunk, at| {
            let own = chunk * CHUNK..chunk * CHUNK + at.len();
            of(at, &self.log_raw[own.clone()], &self.weight[own])
        })
    }

    /// Objective, gradient halved, and the matrix of Gauss and Newton (row-major, full).
    fn normal_equations(&self, model: &dyn ReflectanceModel, parameters: &[f64]) -> (f64, Vec<f64>, Vec<f64>) {
        let n = parameters.len();
        let parts: Vec<(f64, Vec<f64>, Vec<f64>)> = self.parts(|at, log_raws, weights| {
            let mut values = vec![[0.0; 3]; at.len()];
            model.evaluate(parameters, at, &mut values);
            let (mut sum, mut gradient, mut matrix) = (0.0, vec![0.0; n], vec![0.0; n * n]);
            let mut row = vec![0.0; n];
            for (index, value) in values.iter().enumerate() {
                for channel in 0..3 {
                    let weight = weights[index] / 3.0;
                    let residual = log_raw(value[channel], channel) - log_raws[index][channel];
                    sum += weight * residual * residual;
                    let raw = value[channel].max(0.0) / CHANNEL_SCALE[channel];
                    let mut adjoint = [[0.0; 3]];
                    adjoint[0][channel] = 1.0 / (CHANNEL_SCALE[channel] * (raw + LOG_FLOOR));
                    row.fill(0.0);
                    model.pull_back(parameters, &at[index..=index], &adjoint, &mut row);
                    for i in 0..n {
                        let weighted = weight * row[i];
                        if weighted != 0.0 {
                            gradient[i] += weighted * residual;
                            for j in 0..=i {
                                matrix[i * n + j] += weighted * row[j];
                            }
                        }
                    }
                }
            }
            (sum, gradient, matrix)
        });
        let (mut sum, mut gradient, mut matrix) = (0.0, vec![0.0; n], vec![0.0; n * n]);
        for part in parts {
            sum += part.0;
            gradient.iter_mut().zip(&part.1).for_each(|(total, part)| *total += part);
            matrix.iter_mut().zip(&part.2).for_each(|(total, part)| *total += part);
        }
        (sum, gradient, matrix)
    }
}

/// Fits a model to a table from each of the starts, and from the model's own when there is none.
///
/// Errors: a table of which no cell counts; more than 256 parameters (such a model needs its own method); a start of
/// another length or with a number that is not finite; no start with a finite error.
pub fn fit_model(
    model: &dyn ReflectanceModel,
    starts: &[Vec<f64>],
    table: &MeasuredBrdf,
    settings: &ModelFitSettings,
) -> Result<ModelFit> {
    let count = model.parameter_count();
    if count > MOST_PARAMETERS {
        return Err(Error::new(
            ErrorKind::InvalidSetting,
            format!("{} has {count} parameters, this method takes at most {MOST_PARAMETERS}", model.name()),
        ));
    }
    if let Some(start) = starts.iter().find(|start| start.len() != count) {
        return Err(Error::new(
            ErrorKind::InvalidSetting,
            format!("a start of {} numbers, where {} has {count}", start.len(), model.name()),
        ));
    }
    if starts.iter().flatten().any(|parameter| !parameter.is_finite()) {
        return Err(Error::new(ErrorKind::NonFinite, format!("a start of {} is not finite", model.name())));
    }
    let sample = CellSample::draw(table, settings.per_column, settings.seed);
    if sample.at.is_empty() {
        return Err(Error::new(ErrorKind::NonFinite, "no cell of the table counts: its red is 0 everywhere"));
    }
    let own = [model.start()];
    let starts = if starts.is_empty() { &own[..] } else { starts };
    let coarse = if sample.at.len() > 2000 { sample.thinned(8) } else { sample.clone() };
    let mut scouted: Vec<(f64, Vec<f64>)> = starts
        .iter()
        .map(|start| {
            let (parameters, objective, _) = descend(model, start, &coarse, settings.scouting_steps);
            (objective, parameters)
        })
        .filter(|(objective, _)| objective.is_finite())
        .collect();
    scouted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let best = scouted
        .iter()
        .take(settings.followed.max(1))
        .map(|(_, start)| descend(model, start, &sample, settings.steps))
        .min_by(|a, b| a.1.total_cmp(&b.1));
    let Some((parameters, objective, steps)) = best else {
        return Err(Error::new(ErrorKind::Numerical, format!("no start of {} has a finite error", model.name())));
    };
    let error = model_error(model, &parameters, table)?;
    Ok(ModelFit { parameters, error, sampled_log_rmse: objective.sqrt(), steps })
}

/// Steps down from a start; returns parameters, objective and the number of steps taken.
fn descend(model: &dyn ReflectanceModel, start: &[f64], sample: &CellSample, steps: usize) -> (Vec<f64>, f64, usize) {
    let mut parameters = start.to_vec();
    model.project(&mut parameters);
    let n = parameters.len();
    let mut damping = 1e-2;
    let mut small = 0;
    let mut objective = f64::INFINITY;
    for step in 0..steps {
        let (here, gradient, matrix) = sample.normal_equations(model, &parameters);
        objective = here;
        if !here.is_finite() {
            return (parameters, f64::INFINITY, step);
        }
        let largest = (0..n).map(|i| matrix[i * n + i]).fold(0.0, f64::max);
        let accepted = loop {
            let mut damped = matrix.clone();
            for i in 0..n {
                let own = matrix[i * n + i];
                damped[i * n + i] += damping * own + 1e-9 * largest + 1e-300;
            }
            if let Some(change) = solve(&mut damped, &gradient) {
                let mut moved: Vec<f64> = parameters.iter().zip(&change).map(|(p, d)| p - d).collect();
                model.project(&mut moved);
                let there = sample.objective(model, &moved);
                if there < here {
                    break Some((moved, there));
                }
            }
            damping *= 4.0;
            if damping > 1e9 {
                break None;
            }
        };
        let Some((moved, there)) = accepted else { return (parameters, objective, step) };
        damping = (damping * 0.25).max(1e-9);
        parameters = moved;
        objective = there;
        small = if there > here * (1.0 - 1e-5) { small + 1 } else { 0 };
        if small >= 3 {
            return (parameters, objective, step + 1);
        }
    }
    (parameters, objective, steps)
}

/// Solves `matrix x = right` for a symmetric positive definite matrix of which the lower triangle is given (Cholesky);
/// `None` when it is not positive definite.
fn solve(matrix: &mut [f64], right: &[f64]) -> Option<Vec<f64>> {
    let n = right.len();
    for i in 0..n {
        for j in 0..=i {
            let mut sum = matrix[i * n + j];
            for k in 0..j {
                sum -= matrix[i * n + k] * matrix[j * n + k];
            }
            if i == j {
                if !(sum > 0.0) {
                    return None;
                }
                matrix[i * n + i] = sum.sqrt();
            } else {
                matrix[i * n + j] = sum / matrix[j * n + j];
            }
        }
    }
    let mut x = right.to_vec();
    for i in 0..n {
        for k in 0..i {
            x[i] -= matrix[i * n + k] * x[k];
        }
        x[i] /= matrix[i * n + i];
    }
    for i in (0..n).rev() {
        for k in i + 1..n {
            x[i] -= matrix[k * n + i] * x[k];
        }
        x[i] /= matrix[i * n + i];
    }
    x.iter().all(|value| value.is_finite()).then_some(x)
}

#[cfg(test)]
mod tests;
