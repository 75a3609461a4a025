//! Damped steps of Newton on the logarithm of the light.

use super::quadratic::Quadratic;
use super::terms::{LightObjective, LightTerms, objective};
use crate::object::likelihood::Likelihood;
use crate::object::matrices::LightMatrix;
use crate::object::prior::LogLight;

/// Largest change of a logarithm in one step of Newton.
const LARGEST_STEP: f32 = 2.0;
/// Halvings of a step before it is given up.
const HALVINGS: usize = 6;

/// How much a call of [`newton`] may do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NewtonBudget {
    /// Steps of Newton.
    pub steps: usize,
    /// Products of the matrix within each.
    pub products: usize,
}

/// What a step on the light did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LightOutcome {
    /// The objective at its end.
    pub objective: LightObjective,
    /// Numbers of pictures and steps that were not finite and were left out.
    pub not_finite: usize,
}

/// Improves the light by damped steps of Newton; ends early when a step gains less than 1e-4 of the objective.
pub fn newton(
    matrix: &LightMatrix,
    likelihood: &Likelihood,
    terms: &LightTerms,
    light: &mut LogLight,
    budget: NewtonBudget,
) -> LightOutcome {
    if terms.grey {
        light.make_grey();
    }
    let mut current = objective(matrix, likelihood, terms, light);
    let mut not_finite = 0;
    for _ in 0..budget.steps {
        let quadratic = Quadratic::new(matrix, likelihood, terms, light);
        not_finite += quadratic.not_finite;
        let step = quadratic.step(budget.products);
        let mut length = 1.0f32;
        let mut found = None;
        for _ in 0..HALVINGS {
            let mut moved = light.clone();
            for (logs, step) in moved.channels.iter_mut().zip(&step) {
                for (log, change) in logs.iter_mut().zip(step) {
                    match change.is_finite() {
                        true => *log += (length * change).clamp(-LARGEST_STEP, LARGEST_STEP),
                        false => not_finite += 1,
                    }
                }
            }
            let reached = objective(matrix, likelihood, terms, &moved);
            if reached.total() < current.total() {
                found = Some((moved, reached));
                break;
            }
            length *= 0.5;
        }
        let Some((moved, reached)) = found else { break };
        *light = moved;
        let gain = current.total() - reached.total();
        current = reached;
        if gain < 1e-4 * current.total() {
            break;
        }
    }
    LightOutcome { objective: current, not_finite }
}
