//! Light and reflectance together: maximum a posteriori by alternating steps.
//!
//! Chen, Nobuhara and Nishino 2020, eq. 1 and 8, in the order of what they released: the light while the reflectance is
//! held, then the reflectance while the light is held, the light grey in the first rounds so that colour goes to the
//! reflectance. What is new here: starts from a whole library, tried at low resolution; the light by Newton; matrices
//! that make each step a walk through memory.

use super::bands::LightBands;
use super::light_holder::LightHolder;
use super::light_step::{LightOutcome, NewtonBudget, first_order, newton, objective};
use super::matrices::{LightMatrix, NodeMatrix};
use super::nodes::{NodeGrid, NodeTable};
use super::observations::ObjectView;
use super::prior::LogLight;
use super::problem::ObjectProblem;
use super::progress::{ObjectEvent, ObjectiveRow, StepKind};
use super::reflectance_step::{ReflectanceProblem, StepMemory};
use super::screen::{Candidate, screen};
use super::seen::LightSeen;
use super::settings::{LightMethod, ObjectSettings};
use super::starts::StartedModel;
use crate::error::{Error, ErrorKind, Finding, Result, Severity};
use crate::light::Environment;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// A step on the reflectance that gains less than this part of the objective is the last of its round.
const REFLECTANCE_PATIENCE: f64 = 1e-3;
/// The same under a known light: there is no other unknown that could move instead, and the last tenth of a percent of
/// the objective is what tells a narrow lobe's width.
const KNOWN_LIGHT_PATIENCE: f64 = 1e-5;
/// First-order steps without gain after which a round ends, as released.
const FIRST_ORDER_PATIENCE: usize = 50;

/// What is known beforehand.
#[derive(Clone, Debug, Default)]
pub struct Known {
    /// The light.
    pub light: Option<Environment>,
    /// Parameters of the model that are the reflectance.
    pub reflectance: Option<Vec<f64>>,
}

/// What was estimated.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// Parameters of the model.
    pub parameters: Vec<f64>,
    /// The reflectance at the nodes of the fit.
    pub table: NodeTable,
    /// The light.
    pub light: LogLight,
    /// The start that led here.
    pub start: String,
    /// Starts that were followed, the best first.
    pub candidates: Vec<Candidate>,
    /// The objective after every step.
    pub rows: Vec<ObjectiveRow>,
    /// What the photos see of the light; `None` for a result that does not say, or of an estimation that was ended early.
    pub light_seen: Option<LightSeen>,
    /// Which of its details they tell; `None` likewise, and for a light that was given.
    pub light_bands: Option<LightBands>,
    /// Root mean square of the logarithm of picture over photo, over the pixels of the fit.
    pub picture_log_rmse: f64,
    /// What was noticed.
    pub findings: Vec<Finding>,
    /// Seconds.
    pub seconds: f64,
}

/// An estimation in progress.
struct Run<'a> {
    problem: ObjectProblem,
    model: &'a StartedModel,
    settings: &'a ObjectSettings,
    rows: Vec<ObjectiveRow>,
    began: Instant,
    stop: &'a AtomicBool,
    watch: &'a (dyn Fn(ObjectEvent) + Sync),
    light_prior: f64,
    code_prior: f64,
}

/// Estimates what is not known of light and reflectance.
///
/// `watch` is called on the calling thread; `stop` ends the work with an error of kind `Stopped` within a step.
///
/// # Errors
/// Settings out of range, photos of which nothing can be estimated, nothing left to estimate, a stop.
pub fn estimate(
    views: &[ObjectView],
    model: &StartedModel,
    known: &Known,
    settings: &ObjectSettings,
    stop: &AtomicBool,
    watch: &(dyn Fn(ObjectEvent) + Sync),
) -> Result<Estimate> {
    let began = Instant::now();
    if known.light.is_some() && known.reflectance.is_some() {
        return Err(Error::new(ErrorKind::InvalidSetting, "light and reflectance are both given: nothing is unknown")
            .remedy("leave one of them out"));
    }
    settings.validate_for(known.light.is_some())?;
    watch(ObjectEvent::Stage("tracing what each pixel sees"));
    let (problem, mut findings) = ObjectProblem::new(views, settings)?;
    let mut run =
        Run { problem, model, settings, rows: Vec::new(), began, stop, watch, light_prior: 0.0, code_prior: 0.0 };
    let (width, height) = settings.light_size();
    let given = known.light.as_ref().map(|light| LogLight::of(&light.resampled(width, height), 1e-12));

    let mut candidates = Vec::new();
    if known.reflectance.is_none() {
        watch(ObjectEvent::Stage("trying starts"));
        let coarse = ObjectProblem::coarse(views, settings)?;
        candidates = screen(&coarse, model, known.light.as_ref(), settings, stop)?;
        for candidate in &candidates {
            run.push(0, StepKind::Start, candidate.objective, candidate.not_finite);
        }
    }
    let (start, mut parameters) = match (&known.reflectance, candidates.first()) {
        (Some(parameters), _) => ("given".to_string(), parameters.clone()),
        (None, Some(best)) => (best.name.clone(), best.parameters.clone()),
        (None, None) => {
            return Err(Error::new(ErrorKind::Numerical, "no start gave a finite objective")
                .remedy("check the photo, or try another model"));
        }
    };
    let grid = std::sync::Arc::clone(run.problem.transport.grid());
    let mut table = grid.tabulate(model.model.as_ref(), &parameters);
    let mut light = match (&given, candidates.first().and_then(|best| best.light.as_ref())) {
        (Some(light), _) => light.clone(),
        // The light found at low resolution is where the fine one begins.
        (None, Some(coarse)) => LogLight::of(&coarse.environment().resampled(width, height), 1e-12),
        (None, None) => {
            let matrix = LightMatrix::new(&run.problem.transport, &table);
            LightHolder::first_light(&run.problem, &matrix, settings)
        }
    };

    watch(ObjectEvent::Stage("estimating"));
    let rounds = if known.reflectance.is_some() { settings.outer_loops.div_ceil(2) } else { settings.outer_loops };
    // A light that is given does not move: no prior asks anything of it, nor of its size.
    let mut holder = match given {
        None => LightHolder::new(settings, known.reflectance.is_some(), &light)?,
        Some(_) => LightHolder::default(),
    };
    // While the light is held the objective is one from round to round, and what was learned of it stays true.
    let mut memory = StepMemory::default();
    for round in 1..=rounds {
        let grey = given.is_none() && known.reflectance.is_none() && round <= settings.grey_loops;
        if given.is_none() {
            run.step_light(round, grey, &table, &mut holder, &mut light)?;
        }
        if known.reflectance.is_none() {
            if given.is_none() {
                memory = StepMemory::default();
            }
            let patience = if given.is_some() { KNOWN_LIGHT_PATIENCE } else { REFLECTANCE_PATIENCE };
            run.step_reflectance(round, &grid, &light, &mut parameters, &mut memory, patience)?;
            table = grid.tabulate(model.model.as_ref(), &parameters);
        }
        watch(ObjectEvent::State { light: &light, table: &table, parameters: &parameters });
    }
    if given.is_none() && known.reflectance.is_none() {
        // The reflectance had the last word; the light answers once more.
        run.step_light(rounds, false, &table, &mut holder, &mut light)?;
    }

    let matrix = LightMatrix::new(&run.problem.transport, &table);
    let picture_log_rmse = run.problem.likelihood.log_rmse(&matrix.forward(&light.radiance()));
    let not_finite: usize = run.rows.iter().map(|row| row.not_finite).sum();
    if not_finite > 0 {
        let message = format!("{not_finite} numbers were not finite and were left out");
        findings
            .push(Finding::new(Severity::Warning, "object-not-finite", message).remedy("try another start or model"));
    }
    let light_seen = Some(LightSeen::of(&run.problem.transport, &table, &light));
    let mut light_bands = None;
    if given.is_none() {
        watch(ObjectEvent::Stage("asking which details of the light the photos tell"));
        let small = ObjectProblem::for_bands(views, settings)?;
        let directions = small.transport.directions();
        let resampled = light.environment().resampled(directions.width, directions.height);
        let table = small.transport.grid().tabulate(model.model.as_ref(), &parameters);
        light_bands = LightBands::of(&small, &table, &LogLight::of(&resampled, 1e-12));
    }
    Ok(Estimate {
        parameters,
        table,
        light,
        start,
        candidates,
        rows: run.rows,
        light_seen,
        light_bands,
        picture_log_rmse,
        findings,
        seconds: began.elapsed().as_secs_f64(),
    })
}

impl Run<'_> {
    fn check_stop(&self) -> Result<()> {
        match self.stop.load(Ordering::Relaxed) {
            true => Err(Error::new(ErrorKind::Stopped, "the estimation was stopped")),
            false => Ok(()),
        }
    }

    fn push(&mut self, round: usize, kind: StepKind, objective: [f64; 3], not_finite: usize) {
        let [data, light_prior, code_prior] = objective;
        let step = self.rows.len() + 1;
        let seconds = self.began.elapsed().as_secs_f64();
        let row = ObjectiveRow { step, round, kind, data, light_prior, code_prior, seconds, not_finite };
        self.rows.push(row);
        (self.watch)(ObjectEvent::Row(row));
    }

    fn step_light(
        &mut self,
        round: usize,
        grey: bool,
        table: &NodeTable,
        holder: &mut LightHolder,
        light: &mut LogLight,
    ) -> Result<()> {
        self.check_stop()?;
        let matrix = LightMatrix::new(&self.problem.transport, table);
        let likelihood = &self.problem.likelihood;
        // As released the light itself is grey; our own way takes only its mean colour out.
        holder.terms.grey = grey && self.settings.method == LightMethod::FirstOrder;
        // The first round starts from little: it gets more steps.
        let steps = if round == 1 { 3 * self.settings.light_steps } else { self.settings.light_steps };
        let budget = NewtonBudget { steps: 1, products: self.settings.light_products };
        let mut outcome = LightOutcome::default();
        // In the grey rounds another thing is asked of the light than what is told; and first-order steps are as released.
        let may_rise = grey || self.settings.method == LightMethod::FirstOrder;
        let total = |light: &LogLight, holder: &LightHolder| {
            let reached = objective(&matrix, likelihood, &holder.terms, light);
            reached.total() + holder.deep.as_ref().map_or(0.0, |deep| deep.energy(light))
        };
        let before = (!may_rise).then(|| (total(light, holder), light.clone(), holder.deep.clone()));
        match (&mut holder.deep, self.settings.method) {
            (Some(deep), LightMethod::FirstOrder) => {
                let (mut best, mut since) = (f64::INFINITY, 0);
                for _ in 0..self.settings.light_steps {
                    outcome = first_order(&matrix, likelihood, &mut deep.prior, grey, deep.rate, light);
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
                    outcome = deep.round(&matrix, likelihood, &holder.terms, light, budget);
                    if self.stop.load(Ordering::Relaxed) {
                        break;
                    }
                }
            }
            (None, _) => {
                let budget = NewtonBudget { steps: 2 * steps, ..budget };
                outcome = newton(&matrix, likelihood, &holder.terms, light, budget);
            }
        }
        if grey && self.settings.method == LightMethod::ClosedForm {
            light.level_colours();
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
        // What is told is a function of light, net and reflectance as they are now. The steps above each lower another
        // one: the net moves under them, and so does what is carried along.
        let reached = objective(&matrix, likelihood, &holder.terms, light);
        self.light_prior = reached.prior + holder.deep.as_ref().map_or(0.0, |deep| deep.energy(light));
        self.push(round, StepKind::Light, [reached.data, self.light_prior, self.code_prior], outcome.not_finite);
        Ok(())
    }

    fn step_reflectance(
        &mut self,
        round: usize,
        grid: &NodeGrid,
        light: &LogLight,
        parameters: &mut Vec<f64>,
        memory: &mut StepMemory,
        patience: f64,
    ) -> Result<()> {
        self.check_stop()?;
        let matrix = NodeMatrix::new(&self.problem.transport, &light.texels());
        let problem = ReflectanceProblem {
            model: self.model.model.as_ref(),
            grid,
            matrix: &matrix,
            likelihood: &self.problem.likelihood,
            prior: &self.model.prior,
        };
        let reached = problem.improve_with(memory, parameters, self.settings.reflectance_steps, patience);
        self.check_stop()?;
        self.code_prior = reached.prior;
        self.push(round, StepKind::Reflectance, [reached.data, self.light_prior, self.code_prior], reached.not_finite);
        Ok(())
    }
}
