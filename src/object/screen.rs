//! Many starts tried at low resolution, so that few are followed and one is chosen.
//!
//! Alternating steps end where they begin: a mirror that begins as a matt surface stays one, and the light pays for it.
//! At low resolution a start costs a fraction of a second, so all of a library can be tried. Starts are ranked by
//! [`evidence`](super::evidence): by how well they explain the photo under any light, not under the best one.

use super::evidence::{negative_log_evidence, of_known_light};
use super::light_step::{LightObjective, LightTerms, NewtonBudget, newton};
use super::likelihood::Likelihood;
use super::matrices::{LightMatrix, NodeMatrix};
use super::nodes::NodeTable;
use super::prior::LogLight;
use super::prior::gradient::GradientPrior;
use super::problem::ObjectProblem;
use super::reflectance_step::ReflectanceProblem;
use super::run::{level_to, parts_of};
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
    /// Its lights at low resolution, one a problem; empty when the light is known.
    pub lights: Vec<LogLight>,
    /// Its reflectance at the coarse nodes.
    pub table: NodeTable,
    /// Loss, prior of the light and prior of the codes.
    pub objective: [f64; 3],
    /// Minus the logarithm of the evidence in nats, up to what is the same for all: starts are ranked by it.
    pub evidence: f64,
    /// Numbers that were not finite.
    pub not_finite: usize,
}

/// The loss of a picture after the best factor of each channel, which is the median of the ratios.
fn shape_loss(problem: &ObjectProblem, mut picture: Vec<[f32; 3]>) -> f64 {
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
    problem.likelihood.loss(&picture)
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
    problems: &[ObjectProblem],
    model: &StartedModel,
    known_light: Option<&Environment>,
    probes: &[LogLight],
    settings: &ObjectSettings,
    stop: &AtomicBool,
) -> Result<Vec<Candidate>> {
    let Some(first) = problems.first() else { return Ok(Vec::new()) };
    let directions = first.transport.directions();
    let (width, height) = (directions.width, directions.height);
    let known = known_light.map(|light| LogLight::of(&light.resampled(width, height), 1e-12));
    let gradient = GradientPrior::new(width, height, GRADIENT_WEIGHT, 0.05);
    let terms = LightTerms { gradient: Some(gradient), ..LightTerms::default() };
    let known_parts = known.as_ref().map(|light| parts_of(std::slice::from_ref(first), std::slice::from_ref(light)));
    let try_one = |start: &Start| -> Result<Candidate> {
        check(stop)?;
        let mut candidate = Candidate {
            name: start.name.clone(),
            parameters: start.parameters.clone(),
            lights: Vec::new(),
            table: first.transport.grid().tabulate(model.model.as_ref(), &start.parameters),
            objective: [f64::INFINITY, 0.0, 0.0],
            evidence: f64::INFINITY,
            not_finite: 0,
        };
        match &known_parts {
            Some(parts) => candidate.rank_under(first, &parts[0].0),
            None => {
                let begun = |(index, problem): (usize, &ObjectProblem)| {
                    let matrix = LightMatrix::new(&problem.transport, &candidate.table);
                    let light = probes.get(index).cloned();
                    let light = light.unwrap_or_else(|| problem.even_light(&matrix, width, height));
                    (matrix, light)
                };
                let begun = problems.iter().enumerate().map(begun).collect();
                candidate.light_through(problems, begun, (&terms, TRIED_STEPS), probes.len());
            }
        }
        Ok(candidate)
    };
    let mut tried = parallel::map_items(&model.starts, try_one).into_iter().collect::<Result<Vec<Candidate>>>()?;
    tried.retain(|candidate| candidate.evidence.is_finite());
    tried.sort_by(|a, b| a.evidence.total_cmp(&b.evidence));
    tried.truncate(settings.followed.max(1));
    for candidate in &mut tried {
        match &known_parts {
            Some(parts) => {
                check(stop)?;
                candidate.follow_reflectance(model, parts, first, 4 * ROUNDS);
            }
            None => {
                for _ in 0..ROUNDS {
                    check(stop)?;
                    candidate.follow(problems, model, &terms, probes.len());
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
    /// Ranks a start under a known light by its shape alone. Colours are left to the steps that follow.
    fn rank_under(&mut self, problem: &ObjectProblem, matrix: &NodeMatrix) {
        self.objective[0] = shape_loss(problem, matrix.forward(&self.table));
        let objective = LightObjective { data: self.objective[0], prior: 0.0 };
        self.evidence = of_known_light(objective, problem.likelihood.len());
    }

    /// Steps on the reflectance under lights that are held; all problems have the nodes of `first`.
    fn follow_reflectance(
        &mut self,
        model: &StartedModel,
        parts: &[(NodeMatrix, &Likelihood)],
        first: &ObjectProblem,
        steps: usize,
    ) {
        let grid = first.transport.grid();
        let reflectance = ReflectanceProblem { model: model.model.as_ref(), grid, parts, prior: &model.prior };
        let reached = reflectance.improve(&mut self.parameters, steps, 1e-3);
        self.table = grid.tabulate(model.model.as_ref(), &self.parameters);
        (self.objective[0], self.objective[2]) = (reached.data, reached.prior);
        let objective = LightObjective { data: reached.data, prior: 0.0 };
        let pixels = parts.iter().map(|(_, likelihood)| likelihood.len()).sum();
        self.evidence = of_known_light(objective, pixels);
        self.not_finite += reached.not_finite;
    }

    /// One round: reflectance under the lights so far, then the lights.
    fn follow(&mut self, problems: &[ObjectProblem], model: &StartedModel, terms: &LightTerms, probes: usize) {
        let mut lights = std::mem::take(&mut self.lights);
        let [first, ..] = problems else { return };
        if probes == 0 {
            // The mean colour is the reflectance's until shown otherwise.
            LogLight::level_colours(&mut lights);
        } else {
            self.follow_reflectance(model, &parts_of(&problems[..probes], &lights), first, 4);
            level_to(&problems[probes..], &mut lights[probes..], &self.table);
        }
        self.follow_reflectance(model, &parts_of(problems, &lights), first, 4);
        let begun = problems.iter().map(|problem| LightMatrix::new(&problem.transport, &self.table)).zip(lights);
        self.light_through(problems, begun.collect(), (terms, 2), probes);
    }

    /// The best light of each problem from those that are begun with, and the evidence around them. The lights of the first
    /// `probes` are known.
    fn light_through(
        &mut self,
        problems: &[ObjectProblem],
        begun: Vec<(LightMatrix, LogLight)>,
        (terms, steps): (&LightTerms, usize),
        probes: usize,
    ) {
        let budget = NewtonBudget { steps, products: 10 };
        (self.objective[0], self.objective[1], self.evidence) = (0.0, 0.0, 0.0);
        let share = 1.0 / problems.len() as f64;
        for (index, (problem, (matrix, mut light))) in problems.iter().zip(begun).enumerate() {
            if index < probes {
                // Its level and colour are the reflectance's to follow: starts are ranked by their shape.
                let data = shape_loss(problem, matrix.forward(&light.radiance()));
                self.objective[0] += share * data;
                self.evidence += of_known_light(LightObjective { data, prior: 0.0 }, problem.likelihood.len());
                self.lights.push(light);
                continue;
            }
            let outcome = newton(&matrix, &problem.likelihood, terms, &mut light, budget);
            self.objective[0] += share * outcome.objective.data;
            self.objective[1] += share * outcome.objective.prior;
            self.not_finite += outcome.not_finite;
            self.evidence += negative_log_evidence(&matrix, &problem.likelihood, &light);
            self.lights.push(light);
        }
    }
}
