//! An estimation whose last whole round is not lost, however it ends.

use super::look::Painter;
use crate::error::{Error, Finding, Result, Severity};
use crate::object::ObjectView;
use crate::object::joint::{Estimate, Known, estimate};
use crate::object::nodes::{NodeGrid, NodeTable};
use crate::object::prior::LogLight;
use crate::object::progress::{ObjectEvent, ObjectiveRow};
use crate::object::settings::ObjectSettings;
use crate::object::starts::StartedModel;
use std::sync::atomic::AtomicBool;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// Pixels of the object in a look, at most.
pub(super) const LOOK_PIXELS: usize = 6_000;

/// The state after a round, kept in case it is the last.
#[derive(Clone)]
pub(super) struct Reached {
    pub round: usize,
    pub light: LogLight,
    pub further_lights: Vec<LogLight>,
    pub table: NodeTable,
    pub parameters: Vec<f64>,
}

/// Estimates as [`estimate`] does. Where that is stopped, or ends with an error or a panic, after its first round, what
/// was reached by its last whole round is returned, with the error.
///
/// # Errors
/// Those of [`estimate`] before the end of its first round; `Internal` for a panic.
pub fn estimate_as_far_as_it_goes(
    views: &[ObjectView],
    model: &StartedModel,
    known: &Known,
    settings: &ObjectSettings,
    stop: &AtomicBool,
    watch: &(dyn Fn(ObjectEvent) + Sync),
) -> Result<(Estimate, Option<Error>)> {
    let began = Instant::now();
    let reached: Mutex<Option<Reached>> = Mutex::default();
    let rows: Mutex<Vec<ObjectiveRow>> = Mutex::default();
    let keep = |event: ObjectEvent| {
        match &event {
            ObjectEvent::Stage(_) => {}
            ObjectEvent::Row(row) => rows.lock().unwrap_or_else(PoisonError::into_inner).push(*row),
            ObjectEvent::State { light, further_lights, table, parameters } => {
                let mut slot = reached.lock().unwrap_or_else(PoisonError::into_inner);
                let round = slot.as_ref().map_or(1, |own| own.round + 1);
                *slot = Some(Reached {
                    round,
                    light: (*light).clone(),
                    further_lights: further_lights.to_vec(),
                    table: (*table).clone(),
                    parameters: parameters.to_vec(),
                });
            }
        }
        watch(event);
    };
    let work = || estimate(views, model, known, settings, stop, &keep);
    let outcome = std::panic::catch_unwind(std::panic::AssertUnwindSafe(work))
        .unwrap_or_else(|panic| Err(super::panicked(&*panic)));
    let error = match outcome {
        Ok(found) => return Ok((found, None)),
        Err(error) => error,
    };
    let rows = rows.into_inner().unwrap_or_else(PoisonError::into_inner);
    match (reached.into_inner().unwrap_or_else(PoisonError::into_inner), views.first()) {
        (Some(reached), Some(view)) => {
            let found = partial(reached, view, settings, rows, began.elapsed().as_secs_f64());
            Ok((found, Some(error)))
        }
        _ => Err(error),
    }
}

fn partial(
    reached: Reached,
    view: &ObjectView,
    settings: &ObjectSettings,
    rows: Vec<ObjectiveRow>,
    seconds: f64,
) -> Estimate {
    let rounds = reached.round;
    let message = format!("the estimation ended after {rounds} rounds: this is what it had reached");
    let painter = Painter::new(view, NodeGrid::new(settings.nodes), settings.shadows, LOOK_PIXELS);
    let look = painter.paint(reached.light.environment(), &reached.table);
    Estimate {
        parameters: reached.parameters,
        table: reached.table,
        light: reached.light,
        further_lights: reached.further_lights,
        start: "not followed to the end".into(),
        candidates: Vec::new(),
        rows,
        light_seen: None,
        light_bands: None,
        picture_log_rmse: look.log_rmse,
        findings: vec![
            Finding::new(Severity::Warning, "object-ended-early", message)
                .remedy("start again for a result that has converged"),
        ],
        seconds,
    }
}
