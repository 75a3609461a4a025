//! The steps of an estimation: on each light, on the reflectance that they share, and what is told of both.

use super::light_holder::LightHolder;
use super::light_step::{LightOutcome, NewtonBudget, first_order, newton, objective};
use super::likelihood::Likelihood;
use super::matrices::{LightMatrix, NodeMatrix};
use super::nodes::{NodeGrid, NodeTable};
use super::prior::LogLight;
use super::problem::ObjectProblem;
use super::progress::{ObjectEvent, ObjectiveRow, StepKind};
use super::reflectance_step::{ReflectanceProblem, StepMemory};
use super::settings::{LightMethod, ObjectSettings};
use super::starts::StartedModel;
use crate::error::{Error, ErrorKind, Result};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// First-order steps without gain after which a round ends, as released.
const FIRST_ORDER_PATIENCE: usize = 50;
/// A step on the reflectance that gains less than this part of the objective is the last of its round.
pub(super) const REFLECTANCE_PATIENCE: f64 = 1e-3;

/// An estimation in progress.
pub(super) struct Run<'a> {
    /// One for each light.
    pub problems: Vec<ObjectProblem>,
    pub model: &'a StartedModel,
    pub settings: &'a ObjectSettings,
    pub rows: Vec<ObjectiveRow>,
    pub began: Instant,
    pub stop: &'a AtomicBool,
    pub watch: &'a (dyn Fn(ObjectEvent) + Sync),
    /// Loss and prior of each light, as last known.
    pub of_lights: Vec<[f64; 2]>,
    pub code_prior: f64,
}

impl Run<'_> {
    fn check_stop(&self) -> Result<()> {
        match self.stop.load(Ordering::Relaxed) {
            true => Err(Error::new(ErrorKind::Stopped, "the estimation was stopped")),
            false => Ok(()),
        }
    }

    pub fn push(&mut self, round: usize, kind: StepKind, objective: [f64; 3], not_finite: usize) {
        let [data, light_prior, code_prior] = objective;
        let step = self.rows.len() + 1;
        let seconds = self.began.elapsed().as_secs_f64();
        let row = ObjectiveRow { step, round, kind, data, light_prior, code_prior, seconds, not_finite };
        self.rows.push(row);
        (self.watch)(ObjectEvent::Row(row));
    }

    /// A step on every light that is not known.
    pub fn step_lights(
        &mut self,
        (round, grey): (usize, bool),
        table: &NodeTable,
        holders: &mut [LightHolder],
        lights: &mut [LogLight],
        probes: usize,
    ) -> Result<()> {
        let matrix = |problem: &ObjectProblem| LightMatrix::new(&problem.transport, table);
        let matrices: Vec<LightMatrix> = self.problems.iter().map(matrix).collect();
        let mut not_finite = 0;
        for index in probes..lights.len() {
            let seen = (&matrices[index], &self.problems[index].likelihood);
            not_finite += self.step_light((round, grey), seen, &mut holders[index], &mut lights[index])?;
        }
        if grey && self.settings.method == LightMethod::ClosedForm {
            LogLight::level_colours(lights);
        }
        // What is told is a function of light, net and reflectance as they are now. The steps above each lower another
        // one: the net moves under them, and so does what is carried along.
        for (index, (own, holder)) in self.of_lights.iter_mut().zip(holders.iter()).enumerate() {
            let likelihood = &self.problems[index].likelihood;
            let reached = objective(&matrices[index], likelihood, &holder.terms, &lights[index]);
            let deep = holder.deep.as_ref().map_or(0.0, |deep| deep.energy(&lights[index]));
            *own = [reached.data, reached.prior + deep];
        }
        let [data, light_prior] = self.mean_of_lights();
        self.push(round, StepKind::Light, [data, light_prior, self.code_prior], not_finite);
        Ok(())
    }

    fn mean_of_lights(&self) -> [f64; 2] {
        let count = self.of_lights.len() as f64;
        [0, 1].map(|k| self.of_lights.iter().map(|own| own[k]).sum::<f64>() / count)
    }

    fn step_light(
        &self,
        (round, grey): (usize, bool),
        (matrix, likelihood): (&LightMatrix, &Likelihood),
        holder: &mut LightHolder,
        light: &mut LogLight,
    ) -> Result<usize> {
        self.check_stop()?;
        // As released the light itself is grey; our own way takes only its mean colour out.
        holder.terms.grey = grey && self.settings.method == LightMethod::FirstOrder;
        // The first round starts from little: it gets more steps.
        let steps = if round == 1 { 3 * self.settings.light_steps } else { self.settings.light_steps };
        let budget = NewtonBudget { steps: 1, products: self.settings.light_products };
        let mut outcome = LightOutcome::default();
        // In the grey rounds another thing is asked of the light than what is told; and first-order steps are as released.
        let may_rise = grey || self.settings.method == LightMethod::FirstOrder;
        let total = |light: &LogLight, holder: &LightHolder| {
            let reached = objective(matrix, likelihood, &holder.terms, light);
            reached.total() + holder.deep.as_ref().map_or(0.0, |deep| deep.energy(light))
        };
        let before = (!may_rise).then(|| (total(light, holder), light.clone(), holder.deep.clone()));
        match (&mut holder.deep, self.settings.method) {
            (Some(deep), LightMethod::FirstOrder) => {
                let (mut best, mut since) = (f64::INFINITY, 0);
                for _ in 0..self.settings.light_steps {
                    outcome = first_order(matrix, likelihood, &mut deep.prior, grey, deep.rate, light);
                    let total = outcome.objective.total();
                    since = if total < best { 0 } else { since + 1 };
                    best = best.min(total);
                    if since > FIRST_ORDER_PATIENCE || self.stop.load(Ordering::Relaxed) {
                        break;
                    }
                }
                *light = deep.net_light(light.width, light.height);
                if grey {
                    light.make_grey();
                }
            }
            (Some(deep), LightMethod::ClosedForm) => {
                for _ in 0..steps {
                    outcome = deep.round(matrix, likelihood, &holder.terms, light, budget);
                    if self.stop.load(Ordering::Relaxed) {
                        break;
                    }
                }
            }
            (None, _) => {
                let budget = NewtonBudget { steps: 2 * steps, ..budget };
                outcome = newton(matrix, likelihood, &holder.terms, light, budget);
            }
        }
        self.check_stop()?;
        if let Some((least, before, deep)) = before
            && !(total(light, holder) <= least)
        {
            // The net moves under the steps of the light: where both together made it worse the round is taken back, and
            // the net alone comes nearer to the light, unless that is worse, too.
            *light = before;
            holder.deep = deep.clone();
            if let Some(own) = &mut holder.deep {
                own.follow(light);
            }
            if !(total(light, holder) <= least) {
                holder.deep = deep;
            }
        }
        Ok(outcome.not_finite)
    }

    /// Steps on the reflectance by the photos whose lights are known, which fix its level and colour; the other lights take
    /// theirs from it. All photos together would not: by absolute residuals those whose lights are held hold it as fast.
    pub fn follow_probes(
        &self,
        grid: &NodeGrid,
        lights: &mut [LogLight],
        parameters: &mut Vec<f64>,
        probes: usize,
    ) -> Result<()> {
        self.check_stop()?;
        let parts = parts_of(&self.problems[..probes], lights);
        let model = self.model.model.as_ref();
        let problem = ReflectanceProblem { model, grid, parts: &parts, prior: &self.model.prior };
        problem.improve(parameters, self.settings.reflectance_steps, REFLECTANCE_PATIENCE);
        level_to(&self.problems[probes..], &mut lights[probes..], &grid.tabulate(model, parameters));
        Ok(())
    }

    pub fn step_reflectance(
        &mut self,
        round: usize,
        grid: &NodeGrid,
        lights: &[LogLight],
        parameters: &mut Vec<f64>,
        memory: &mut StepMemory,
        patience: f64,
    ) -> Result<()> {
        self.check_stop()?;
        let parts = parts_of(&self.problems, lights);
        let problem =
            ReflectanceProblem { model: self.model.model.as_ref(), grid, parts: &parts, prior: &self.model.prior };
        let reached = problem.improve_with(memory, parameters, self.settings.reflectance_steps, patience);
        self.check_stop()?;
        self.code_prior = reached.prior;
        let [_, light_prior] = self.mean_of_lights();
        self.push(round, StepKind::Reflectance, [reached.data, light_prior, self.code_prior], reached.not_finite);
        Ok(())
    }
}

/// The picture on the nodes under each light, with its loss.
pub(super) fn parts_of<'a>(problems: &'a [ObjectProblem], lights: &[LogLight]) -> Vec<(NodeMatrix, &'a Likelihood)> {
    let of_light = |(problem, light): (&'a ObjectProblem, &LogLight)| {
        (NodeMatrix::new(&problem.transport, &light.texels()), &problem.likelihood)
    };
    problems.iter().zip(lights).map(of_light).collect()
}

/// Brings lights to the level and colour under which a reflectance is as bright as the photos.
pub(super) fn level_to(problems: &[ObjectProblem], lights: &mut [LogLight], table: &NodeTable) {
    for (problem, light) in problems.iter().zip(lights) {
        let picture = NodeMatrix::new(&problem.transport, &light.texels()).forward(table);
        problem.level(light, &picture);
    }
}
