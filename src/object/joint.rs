//! Light and reflectance together: maximum a posteriori by alternating steps.
//!
//! Chen, Nobuhara and Nishino 2020, eq. 1 and 8, in the order of what they released: the light while the reflectance is
//! held, then the reflectance while the light is held, the light grey in the first rounds so that colour goes to the
//! reflectance. What is new here: starts from a whole library, tried at low resolution; the light by Newton; matrices
//! that make each step a walk through memory.

use super::bands::LightBands;
use super::light_holder::LightHolder;
use super::matrices::LightMatrix;
use super::nodes::NodeTable;
use super::observations::ObjectView;
use super::prior::LogLight;
use super::problem::ObjectProblem;
use super::progress::{ObjectEvent, ObjectiveRow, StepKind};
use super::reflectance_step::StepMemory;
use super::run::{REFLECTANCE_PATIENCE, Run};
use super::screen::{Candidate, screen};
use super::seen::LightSeen;
use super::settings::{LightsOf, ObjectSettings};
use super::starts::StartedModel;
use crate::error::{Error, ErrorKind, Finding, Result, Severity};
use crate::light::Environment;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// [`REFLECTANCE_PATIENCE`] under a known light: there is no other unknown that could move instead, and the last tenth of a percent of
/// the objective is what tells a narrow lobe's width.
const KNOWN_LIGHT_PATIENCE: f64 = 1e-5;

/// What is known beforehand.
#[derive(Clone, Debug, Default)]
pub struct Known {
    /// The light of all photos.
    pub light: Option<Environment>,
    /// The lights of the first photos, where each has its own: those of the others are estimated.
    pub probes: Vec<Environment>,
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
    /// The light; that of the first photo where each has its own.
    pub light: LogLight,
    /// Those of the further photos, in their order; empty where all have one.
    pub further_lights: Vec<LogLight>,
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
    // Under a light that is known for all there is but one.
    let lights = if known.light.is_some() { LightsOf::One } else { settings.lights };
    let settings = &ObjectSettings { lights, ..settings.clone() };
    if !known.probes.is_empty() && (settings.lights == LightsOf::One || known.probes.len() >= views.len()) {
        let message = format!("{} known lights for {} photos", known.probes.len(), views.len());
        return Err(Error::new(ErrorKind::InvalidSetting, message)
            .remedy("give --lights each and fewer probes than photos, or --env where one light is known for all"));
    }
    watch(ObjectEvent::Stage("tracing what each pixel sees"));
    let (problems, mut findings) = ObjectProblem::by_light(views, settings)?;
    let of_lights = vec![[0.0; 2]; problems.len()];
    let mut run = Run { problems, model, settings, rows: Vec::new(), began, stop, watch, of_lights, code_prior: 0.0 };
    let (width, height) = settings.light_size();
    let given = known.light.as_ref().map(|light| LogLight::of(&light.resampled(width, height), 1e-12));

    let mut candidates = Vec::new();
    if known.reflectance.is_none() {
        watch(ObjectEvent::Stage("trying starts"));
        let coarse = ObjectProblem::coarse(views, settings)?;
        let coarse_size = coarse.first().map(|own| own.transport.directions());
        let of_probe = |light: &Environment| {
            coarse_size.map(|size| LogLight::of(&light.resampled(size.width, size.height), 1e-12))
        };
        let probes: Vec<LogLight> = known.probes.iter().filter_map(of_probe).collect();
        candidates = screen(&coarse, model, known.light.as_ref(), &probes, settings, stop)?;
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
    let grid = std::sync::Arc::clone(run.problems[0].transport.grid());
    let mut table = grid.tabulate(model.model.as_ref(), &parameters);
    let probes = known.probes.len();
    let begun = |index: usize| match (&given, known.probes.get(index), candidates.first()) {
        (Some(light), ..) => light.clone(),
        (None, Some(probe), _) => LogLight::of(&probe.resampled(width, height), 1e-12),
        // The light found at low resolution is where the fine one begins.
        (None, None, Some(Candidate { lights, .. })) if index < lights.len() => {
            LogLight::of(&lights[index].environment().resampled(width, height), 1e-12)
        }
        (None, None, _) => {
            let problem = &run.problems[index];
            let matrix = LightMatrix::new(&problem.transport, &table);
            LightHolder::first_light(problem, &matrix, settings)
        }
    };
    let mut lights: Vec<LogLight> = (0..run.problems.len()).map(begun).collect();

    watch(ObjectEvent::Stage("estimating"));
    let rounds = if known.reflectance.is_some() { settings.outer_loops.div_ceil(2) } else { settings.outer_loops };
    // A light that is given does not move: no prior asks anything of it, nor of its size.
    let holder_of = |(index, light): (usize, &LogLight)| match given.is_some() || index < probes {
        false => LightHolder::new(settings, known.reflectance.is_some(), light),
        true => Ok(LightHolder::default()),
    };
    let mut holders = lights.iter().enumerate().map(holder_of).collect::<Result<Vec<LightHolder>>>()?;
    // While the light is held the objective is one from round to round, and what was learned of it stays true.
    let mut memory = StepMemory::default();
    for round in 1..=rounds {
        let grey = given.is_none() && probes == 0 && known.reflectance.is_none() && round <= settings.grey_loops;
        if given.is_none() {
            run.step_lights((round, grey), &table, &mut holders, &mut lights, probes)?;
        }
        if known.reflectance.is_none() {
            if given.is_none() {
                memory = StepMemory::default();
            }
            let patience = if given.is_some() { KNOWN_LIGHT_PATIENCE } else { REFLECTANCE_PATIENCE };
            if probes > 0 {
                run.follow_probes(&grid, &mut lights, &mut parameters, probes)?;
            }
            run.step_reflectance(round, &grid, &lights, &mut parameters, &mut memory, patience)?;
            table = grid.tabulate(model.model.as_ref(), &parameters);
        }
        let (light, further_lights) = (&lights[0], &lights[1..]);
        watch(ObjectEvent::State { light, further_lights, table: &table, parameters: &parameters });
    }
    if given.is_none() && known.reflectance.is_none() {
        // The reflectance had the last word; the light answers once more.
        run.step_lights((rounds, false), &table, &mut holders, &mut lights, probes)?;
    }

    let squares = run.problems.iter().zip(&lights).map(|(problem, light)| {
        let matrix = LightMatrix::new(&problem.transport, &table);
        problem.likelihood.log_rmse(&matrix.forward(&light.radiance())).powi(2)
    });
    let picture_log_rmse = (squares.sum::<f64>() / run.problems.len() as f64).sqrt();
    let not_finite: usize = run.rows.iter().map(|row| row.not_finite).sum();
    if not_finite > 0 {
        let message = format!("{not_finite} numbers were not finite and were left out");
        findings
            .push(Finding::new(Severity::Warning, "object-not-finite", message).remedy("try another start or model"));
    }
    let further_lights = lights.split_off(1);
    let light = lights.remove(0);
    let light_seen = Some(LightSeen::of(&run.problems[0].transport, &table, &light));
    let mut light_bands = None;
    if given.is_none() && probes == 0 {
        watch(ObjectEvent::Stage("asking which details of the light the photos tell"));
        let of_light = if settings.lights == LightsOf::Each { &views[..1] } else { views };
        let small = ObjectProblem::for_bands(of_light, settings)?;
        let directions = small.transport.directions();
        let resampled = light.environment().resampled(directions.width, directions.height);
        let table = small.transport.grid().tabulate(model.model.as_ref(), &parameters);
        light_bands = LightBands::of(&small, &table, &LogLight::of(&resampled, 1e-12));
    }
    Ok(Estimate {
        parameters,
        table,
        light,
        further_lights,
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
