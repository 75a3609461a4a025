//! Many starts tried at low resolution, so that few are followed and one is chosen.
//!
//! Alternating steps end where they begin: a mirror that begins as a matt surface stays one, and the light pays for it.
//! At low resolution a start costs a fraction of a second, so all of a library can be tried. Starts are ranked by
//! [`evidence`](super::evidence): by how well they explain the photo under any light, not under the best one.

use super::evidence::{negative_log_evidence, of_known_light};
use super::light_step::{LightObjective, LightTerms, NewtonBudget, newton};
use super::matrices::{LightMatrix, NodeMatrix};
use super::nodes::NodeTable;
use super::prior::LogLight;
use super::prior::gradient::GradientPrior;
use super::problem::ObjectProblem;
use super::reflectance_step::ReflectanceProblem;
use super::settings::ObjectSettings;
use super::starts::{Start, StartedModel};
use crate::error::{Error, ErrorKind, Result};
use crate::light::Environment;
use crate::math::parallel;
use std::sync::atomic::{AtomicBool, Ordering};

/// Weight of the gradient prior while starts are tried; the net would be too slow for each.
const GRADIENT_WEIGHT: f64 = 0.02;
/// Steps of Newton on the light of a start that is tried. A sun takes more than ten to rise out of an even light; a start
/// that needs one was ranked below all others before it had it.
const TRIED_STEPS: usize = 15;
/// Rounds of light and reflectance for starts that are followed.
const ROUNDS: usize = 3;

/// A start after it was followed at low resolution.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// Name of the start.
    pub name: String,
    /// Where it came to.
    pub parameters: Vec<f64>,
    /// Its light at low resolution; `None` when the light is known.
    pub light: Option<LogLight>,
    /// Its reflectance at the coarse nodes.
    pub table: NodeTable,
    /// Loss, prior of the light and prior of the codes.
    pub objective: [f64; 3],
    /// Minus the logarithm of the evidence in nats, up to what is the same for all: starts are ranked by it.
    pub evidence: f64,
    /// Numbers that were not finite.
    pub not_finite: usize,
}

impl Candidate {
    /// The sum of the terms.
    pub fn total(&self) -> f64 {
        self.objective.iter().sum()
    }
}

/// Tries all starts of a model, follows the best of them and returns these, the best first.
///
/// # Errors
/// `Stopped`, or a known light of another kind than a full sphere.
pub fn screen(
    problem: &ObjectProblem,
    model: &StartedModel,
    known_light: Option<&Environment>,
    settings: &ObjectSettings,
    stop: &AtomicBool,
) -> Result<Vec<Candidate>> {
    let directions = problem.transport.directions();
    let (width, height) = (directions.width, directions.height);
    let known = known_light.map(|light| LogLight::of(&light.resampled(width, height), 1e-12));
    let gradient = GradientPrior::new(width, height, GRADIENT_WEIGHT, 0.05);
    let terms = LightTerms { gradient: Some(gradient), ..LightTerms::default() };
    let known_matrix = known.as_ref().map(|light| NodeMatrix::new(&problem.transport, &light.texels()));
    let try_one = |start: &Start| -> Result<Candidate> {
        check(stop)?;
        let mut candidate = Candidate {
            name: start.name.clone(),
            parameters: start.parameters.clone(),
            light: None,
            table: problem.transport.grid().tabulate(model.model.as_ref(), &start.parameters),
            objective: [f64::INFINITY, 0.0, 0.0],
            evidence: f64::INFINITY,
            not_finite: 0,
        };
        match &known_matrix {
            Some(matrix) => candidate.rank_under(problem, matrix),
            None => {
                let matrix = LightMatrix::new(&problem.transport, &candidate.table);
                let light = problem.even_light(&matrix, width, height);
                candidate.light_through(problem, &matrix, &terms, light, TRIED_STEPS);
            }
        }
        Ok(candidate)
    };
    let mut tried = parallel::map_items(&model.starts, try_one).into_iter().collect::<Result<Vec<Candidate>>>()?;
    tried.retain(|candidate| candidate.evidence.is_finite());
    tried.sort_by(|a, b| a.evidence.total_cmp(&b.evidence));
    tried.truncate(settings.followed.max(1));
    for candidate in &mut tried {
        match &known_matrix {
            Some(matrix) => {
                check(stop)?;
                candidate.follow_reflectance(problem, model, matrix, 4 * ROUNDS);
            }
            None => {
                for _ in 0..ROUNDS {
                    check(stop)?;
                    candidate.follow(problem, model, &terms);
                }
            }
        }
    }
    tried.retain(|candidate| candidate.evidence.is_finite());
    tried.sort_by(|a, b| a.evidence.total_cmp(&b.evidence));
    Ok(tried)
}

fn check(stop: &AtomicBool) -> Result<()> {
    match stop.load(Ordering::Relaxed) {
        true => Err(Error::new(ErrorKind::Stopped, "the estimation was stopped")),
        false => Ok(()),
    }
}

impl Candidate {
    /// Ranks a start under a known light by its shape alone: each channel first takes its best factor, which is the
    /// median of the ratios. Colours are left to the steps that follow.
    fn rank_under(&mut self, problem: &ObjectProblem, matrix: &NodeMatrix) {
        let mut picture = matrix.forward(&self.table);
        let measured = &problem.observations.measured;
        for channel in 0..3 {
            let mut ratios: Vec<f32> = picture
                .iter()
                .zip(measured)
                .filter(|(own, measured)| own[channel] > 0.0 && measured[channel] > 0.0)
                .map(|(own, measured)| measured[channel] / own[channel])
                .collect();
            ratios.sort_by(f32::total_cmp);
            let factor = ratios.get(ratios.len() / 2).copied().unwrap_or(1.0);
            picture.iter_mut().for_each(|pixel| pixel[channel] *= factor);
        }
        self.objective[0] = problem.likelihood.loss(&picture);
        let objective = LightObjective { data: self.objective[0], prior: 0.0 };
        self.evidence = of_known_light(objective, problem.likelihood.len());
    }

    fn follow_reflectance(&mut self, problem: &ObjectProblem, model: &StartedModel, matrix: &NodeMatrix, steps: usize) {
        let grid = problem.transport.grid();
        let reflectance = ReflectanceProblem {
            model: model.model.as_ref(),
            grid,
            matrix,
            likelihood: &problem.likelihood,
            prior: &model.prior,
        };
        let reached = reflectance.improve(&mut self.parameters, steps, 1e-3);
        self.table = grid.tabulate(model.model.as_ref(), &self.parameters);
        (self.objective[0], self.objective[2]) = (reached.data, reached.prior);
        let objective = LightObjective { data: reached.data, prior: 0.0 };
        self.evidence = of_known_light(objective, problem.likelihood.len());
        self.not_finite += reached.not_finite;
    }

    /// One round: reflectance under the light so far, then the light.
    fn follow(&mut self, problem: &ObjectProblem, model: &StartedModel, terms: &LightTerms) {
        let Some(mut light) = self.light.take() else { return };
        // The mean colour is the reflectance's until shown otherwise.
        light.level_colours();
        let matrix = NodeMatrix::new(&problem.transport, &light.texels());
        self.follow_reflectance(problem, model, &matrix, 4);
        let matrix = LightMatrix::new(&problem.transport, &self.table);
        self.light_through(problem, &matrix, terms, light, 2);
    }

    /// The best light from `light` on, and the evidence around it.
    fn light_through(
        &mut self,
        problem: &ObjectProblem,
        matrix: &LightMatrix,
        terms: &LightTerms,
        mut light: LogLight,
        steps: usize,
    ) {
        let budget = NewtonBudget { steps, products: 10 };
        let outcome = newton(matrix, &problem.likelihood, terms, &mut light, budget);
        (self.objective[0], self.objective[1]) = (outcome.objective.data, outcome.objective.prior);
        self.not_finite += outcome.not_finite;
        self.evidence = negative_log_evidence(matrix, &problem.likelihood, &light);
        self.light = Some(light);
    }
}
