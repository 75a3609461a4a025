//! The step on the reflectance while the light is held: quasi-Newton on the parameters of any model.

use super::likelihood::Likelihood;
use super::matrices::NodeMatrix;
use super::nodes::NodeGrid;
use crate::measured::model::ReflectanceModel;
use std::collections::VecDeque;

/// Pairs of steps and slopes that are remembered.
const MEMORY: usize = 12;
/// Halvings of a step before it is given up.
const HALVINGS: usize = 8;

/// A pull on the parameters: the code prior of the paper is `weight * |z|^2` on the codes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ParameterPrior {
    /// One weight a parameter; 0 for those that are free.
    pub weight: Vec<f64>,
    /// Where each is pulled to.
    pub centre: Vec<f64>,
}

impl ParameterPrior {
    /// No pull at all.
    pub fn none(count: usize) -> Self {
        ParameterPrior { weight: vec![0.0; count], centre: vec![0.0; count] }
    }

    /// The penalty.
    pub fn energy(&self, parameters: &[f64]) -> f64 {
        (0..parameters.len()).map(|i| self.weight[i] * (parameters[i] - self.centre[i]).powi(2)).sum()
    }
}

/// The objective at some parameters, term by term.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReflectanceObjective {
    /// The picture's.
    pub data: f64,
    /// The pull's.
    pub prior: f64,
    /// By the parameters.
    pub gradient: Vec<f64>,
    /// Values and slopes that were not finite and were left out.
    pub not_finite: usize,
}

impl ReflectanceObjective {
    /// The sum of the terms.
    pub fn total(&self) -> f64 {
        self.data + self.prior
    }
}

/// Steps and changes of slope that L-BFGS remembers; of use only while the objective stays the same.
#[derive(Clone, Debug, Default)]
pub struct StepMemory {
    pairs: VecDeque<(Vec<f64>, Vec<f64>)>,
}

/// What is held during a step.
pub struct ReflectanceProblem<'a> {
    /// The model.
    pub model: &'a dyn ReflectanceModel,
    /// Where it is tabulated.
    pub grid: &'a NodeGrid,
    /// For each light that is held the picture on the nodes under it, and the loss; the mean over lights counts.
    pub parts: &'a [(NodeMatrix, &'a Likelihood)],
    /// The pull.
    pub prior: &'a ParameterPrior,
}

impl ReflectanceProblem<'_> {
    /// Objective without derivatives.
    pub fn value(&self, parameters: &[f64]) -> f64 {
        let table = self.grid.tabulate(self.model, parameters);
        let losses = self.parts.iter().map(|(matrix, likelihood)| likelihood.loss(&matrix.forward(&table)));
        losses.sum::<f64>() / self.parts.len() as f64 + self.prior.energy(parameters)
    }

    /// Objective with derivatives.
    pub fn slopes(&self, parameters: &[f64]) -> ReflectanceObjective {
        let table = self.grid.tabulate(self.model, parameters);
        let share = 1.0 / self.parts.len() as f64;
        let (mut data, mut not_finite) = (0.0, table.not_finite);
        let mut adjoint = vec![[0.0f64; 3]; self.grid.len()];
        for (matrix, likelihood) in self.parts {
            let state = likelihood.slopes(&matrix.forward(&table));
            data += share * state.loss;
            not_finite += state.not_finite;
            for (sum, own) in adjoint.iter_mut().zip(matrix.adjoint(&state.by_pixel)) {
                (0..3).for_each(|c| sum[c] += share * own[c]);
            }
        }
        let mut gradient = self.grid.pull_back(self.model, parameters, &adjoint);
        for (index, slope) in gradient.iter_mut().enumerate() {
            if !slope.is_finite() {
                *slope = 0.0;
                not_finite += 1;
            }
            *slope += 2.0 * self.prior.weight[index] * (parameters[index] - self.prior.centre[index]);
        }
        ReflectanceObjective { data, prior: self.prior.energy(parameters), gradient, not_finite }
    }

    /// [`ReflectanceProblem::improve_with`] from no memory.
    pub fn improve(&self, parameters: &mut Vec<f64>, steps: usize, patience: f64) -> ReflectanceObjective {
        self.improve_with(&mut StepMemory::default(), parameters, steps, patience)
    }

    /// At most `steps` steps of L-BFGS (Nocedal 1980) with halving; ends when a step gains less than `patience` of the
    /// objective. The model projects its parameters after each step. `memory` is of earlier steps on this very
    /// objective.
    pub fn improve_with(
        &self,
        memory: &mut StepMemory,
        parameters: &mut Vec<f64>,
        steps: usize,
        patience: f64,
    ) -> ReflectanceObjective {
        let mut current = self.slopes(parameters);
        let pairs = &mut memory.pairs;
        for _ in 0..steps {
            let mut direction = descent(&current.gradient, pairs);
            let mut slope = dot(&direction, &current.gradient);
            if !(slope < 0.0) {
                pairs.clear();
                direction = descent(&current.gradient, pairs);
                slope = dot(&direction, &current.gradient);
            }
            // A first step of unknown length moves no parameter by more than this.
            let largest = direction.iter().fold(0.0f64, |a, b| a.max(b.abs()));
            let cap = if pairs.is_empty() { 0.25 } else { 1.0 };
            let mut length = if largest > cap { cap / largest } else { 1.0 };
            let mut found = None;
            for _ in 0..HALVINGS {
                let mut moved: Vec<f64> = parameters.iter().zip(&direction).map(|(p, d)| p + length * d).collect();
                self.model.project(&mut moved);
                if self.value(&moved) < current.total() + 1e-4 * length * slope {
                    found = Some(moved);
                    break;
                }
                length *= 0.4;
            }
            let Some(moved) = found else {
                if pairs.is_empty() {
                    break;
                }
                pairs.clear();
                continue;
            };
            let reached = self.slopes(&moved);
            let step: Vec<f64> = moved.iter().zip(parameters.iter()).map(|(a, b)| a - b).collect();
            let change: Vec<f64> = reached.gradient.iter().zip(&current.gradient).map(|(a, b)| a - b).collect();
            if dot(&step, &change) > 1e-12 * dot(&change, &change) {
                pairs.push_back((step, change));
                if pairs.len() > MEMORY {
                    pairs.pop_front();
                }
            }
            let gain = current.total() - reached.total();
            *parameters = moved;
            current = reached;
            if gain < patience * current.total() {
                break;
            }
        }
        current
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Minus the gradient times the remembered inverse curvature.
fn descent(gradient: &[f64], pairs: &VecDeque<(Vec<f64>, Vec<f64>)>) -> Vec<f64> {
    let mut direction: Vec<f64> = gradient.iter().map(|slope| -slope).collect();
    let mut shares = Vec::with_capacity(pairs.len());
    for (step, change) in pairs.iter().rev() {
        let share = dot(step, &direction) / dot(step, change);
        direction.iter_mut().zip(change).for_each(|(value, change)| *value -= share * change);
        shares.push(share);
    }
    match pairs.back() {
        Some((step, change)) => {
            let scale = dot(step, change) / dot(change, change);
            direction.iter_mut().for_each(|value| *value *= scale);
        }
        // Slopes of a mean loss are small: the first step is scaled to a fifth of a unit.
        None => {
            let largest = direction.iter().fold(0.0f64, |a, b| a.max(b.abs())).max(1e-300);
            direction.iter_mut().for_each(|value| *value *= 0.2 / largest);
        }
    }
    for ((step, change), share) in pairs.iter().zip(shares.into_iter().rev()) {
        let other = dot(change, &direction) / dot(step, change);
        direction.iter_mut().zip(step).for_each(|(value, step)| *value += (share - other) * step);
    }
    direction
}
