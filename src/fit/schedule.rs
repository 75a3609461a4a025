//! From settings to stages: which parameters move, at which resolution, for how many steps.

use super::settings::{FitSettings, Method, Steps};
use crate::error::{Error, ErrorKind, Place, Result};
use of_solver::{SolverShare, positions_of_solver};
use serde::{Deserialize, Serialize};

/// Which maps move in a stage. The light moves in all of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StageKind {
    /// Diffuse alone; the specular lobe is absent (first step of the paper).
    Diffuse,
    /// Diffuse, specular and roughness (second step).
    All,
    /// Rounds of the solver on the light in wide hats.
    WideLight,
    /// Rounds of the solver on the light with narrow hats where it is bright.
    NarrowLight,
    /// The solver makes all maps under the light that was found.
    Maps,
    /// The solver makes diffuse maps of full size from whole pixels.
    Refine,
}

impl StageKind {
    /// Whether its steps are the solver's own, each as long as many of the optimiser.
    pub fn is_of_solver(self) -> bool {
        matches!(self, StageKind::WideLight | StageKind::NarrowLight | StageKind::Maps | StageKind::Refine)
    }
}

/// A run of steps at one resolution.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stage {
    /// Which maps move.
    pub kind: StageKind,
    /// Photographs are shrunk by `2^photo_level`.
    pub photo_level: usize,
    /// Width and height of the maps in this stage.
    pub map_size: usize,
    /// Stages of the same kind and size before this one.
    #[serde(default)]
    pub visit: usize,
    /// Number of optimiser steps.
    pub steps: usize,
    /// Steps of stages of the same kind before this one.
    pub steps_before: usize,
    /// Steps of all stages of this kind.
    pub steps_of_kind: usize,
}

impl Stage {
    /// Whether another stage works on photos and maps of the same sizes.
    pub fn is_of_level_of(&self, other: &Stage) -> bool {
        (self.photo_level, self.map_size) == (other.photo_level, other.map_size)
    }

    /// Name for logs: `diffuse 1/4`, `all 1/1`, `maps 1/2` or `maps`.
    pub fn name(&self) -> String {
        let kind = match self.kind {
            StageKind::Diffuse => "diffuse",
            StageKind::All => "all",
            StageKind::WideLight => "wide light",
            StageKind::NarrowLight => "narrow light",
            StageKind::Maps => "maps",
            StageKind::Refine => "refine",
        };
        if self.photo_level == 0 && !matches!(self.kind, StageKind::Diffuse | StageKind::All) {
            return kind.into();
        }
        format!("{kind} 1/{}", 1usize << self.photo_level)
    }

    /// Factor of the step sizes at a step of this stage: a half cosine over all steps of the kind, from 1 to
    /// `final_rate`.
    pub fn rate(&self, step: usize, final_rate: f32) -> f32 {
        let progress = (self.steps_before + step) as f32 / self.steps_of_kind.max(1) as f32;
        final_rate + (1.0 - final_rate) * 0.5 * (1.0 + (std::f32::consts::PI * progress).cos())
    }

    /// Strength of the specular lobe at a step of this stage: rises linearly over the first `ramp` steps of its kind.
    pub fn lobe_strength(&self, step: usize, ramp: usize) -> f32 {
        match self.kind {
            StageKind::Diffuse => 0.0,
            StageKind::All if ramp == 0 => 1.0,
            StageKind::WideLight | StageKind::NarrowLight | StageKind::Maps | StageKind::Refine => 1.0,
            StageKind::All => ((self.steps_before + step + 1) as f32 / ramp as f32).min(1.0),
        }
    }
}

/// A place in the order of stages, whether or not steps fall to it.
struct Position {
    kind: StageKind,
    photo_level: usize,
    map_size: usize,
    /// Which of the positions of its kind and size it is.
    visit: usize,
    /// Steps of all positions of the kind.
    total: usize,
    /// Which of the positions of its kind it is, and how many there are.
    place: usize,
    places: usize,
}

/// All positions of a fit, in order. The first step goes from coarse to fine with maps that grow along; the second works
/// on maps of full size, on halved photographs first.
fn positions(settings: &FitSettings, share: SolverShare) -> Vec<Position> {
    match settings.method {
        Method::Solver | Method::Automatic => return positions_of_solver(settings, share),
        Method::Adam => {}
    }
    let mut positions = Vec::new();
    let mut add = |kind: StageKind, total: usize, places: usize, maps_grow: bool| {
        let places = if total > 0 { places } else { 0 };
        for (place, photo_level) in (0..places).rev().enumerate() {
            let map_size = if maps_grow { settings.map_size >> photo_level } else { settings.map_size };
            positions.push(Position { kind, photo_level, map_size, visit: 0, total, place, places });
        }
    };
    let levels = settings.levels;
    match settings.steps {
        Steps::TwoStep => {
            add(StageKind::Diffuse, settings.steps_diffuse, levels, true);
            let levels_of_all = if settings.steps_diffuse > 0 { levels.min(2) } else { levels };
            add(StageKind::All, settings.steps_all, levels_of_all, settings.steps_diffuse == 0);
        }
        Steps::OneStep => add(StageKind::All, settings.steps_diffuse + settings.steps_all, levels, true),
    }
    positions
}

/// The stages of a fit that begins: the steps of a kind are shared evenly over its levels; a level without any is left
/// out.
pub fn stages(settings: &FitSettings) -> Vec<Stage> {
    let mut stages = Vec::new();
    let mut before = 0;
    for position in positions(settings, SolverShare::of(settings)) {
        before = if position.place == 0 { 0 } else { before };
        let end = position.total * (position.place + 1) / position.places;
        add_stage(&mut stages, &position, before, end);
        before = end;
    }
    stages
}

fn add_stage(stages: &mut Vec<Stage>, position: &Position, before: usize, end: usize) {
    if end > before {
        stages.push(Stage {
            kind: position.kind,
            photo_level: position.photo_level,
            map_size: position.map_size,
            visit: position.visit,
            steps: end - before,
            steps_before: before,
            steps_of_kind: position.total,
        });
    }
}

/// The stages of a fit that is under way, for settings that may ask for other numbers of steps than `plan` was made for.
///
/// Stages before number `stage` keep their steps; that one has done `step_in_stage`. What is left of a kind falls to its
/// levels as if it had been asked for from the start, as far as steps that are done allow. For the settings of `plan`
/// the result is `plan`.
///
/// # Errors
/// `InvalidSetting` at `steps-diffuse`, `steps-all` or `solver-rounds` when fewer steps are asked for than are done, or
/// when the step they belong to is over; without a place when `plan` is not one of these settings at all.
pub fn revised(settings: &FitSettings, plan: &[Stage], stage: usize, step_in_stage: usize) -> Result<Vec<Stage>> {
    let foreign = || {
        Error::new(ErrorKind::InvalidSetting, "the stages that are done are not those of these settings")
            .remedy("go on with the settings the run was started with")
    };
    // At the end the last stage counts as the one in progress, so that it can be made longer.
    let (stage, step_in_stage) = match (plan.get(stage), plan.last()) {
        (Some(_), _) => (stage, step_in_stage),
        (None, Some(last)) => (plan.len() - 1, last.steps),
        (None, None) => return Err(foreign()),
    };
    let share = SolverShare::of(settings).as_begun(&plan[..=stage]);
    let positions = positions(settings, share);
    let is_at = |stage: &Stage, position: &Position| {
        (stage.kind, stage.photo_level, stage.map_size, stage.visit)
            == (position.kind, position.photo_level, position.map_size, position.visit)
    };
    if !plan[..stage].iter().all(|done| positions.iter().any(|position| is_at(done, position))) {
        return Err(over_or(foreign(), settings, plan));
    }
    let Some(current) = positions.iter().position(|position| is_at(&plan[stage], position)) else {
        return Err(over_or(foreign(), settings, plan));
    };
    let mut stages = Vec::new();
    let mut before = 0;
    for (number, position) in positions.iter().enumerate() {
        before = if position.place == 0 { 0 } else { before };
        let is_last = position.place + 1 == position.places;
        let ideal = position.total * (position.place + 1) / position.places;
        let end = match number.cmp(&current) {
            std::cmp::Ordering::Less => {
                let done = plan[..stage].iter().find(|stage| is_at(stage, position));
                before + done.map_or(0, |stage| stage.steps)
            }
            std::cmp::Ordering::Equal => {
                let done = before + step_in_stage;
                // The finest level must come to its turn: maps reach their full size there.
                let least = if is_last { done } else { done + 1 };
                if position.total < least {
                    let message = format!("{done} steps are done already; {least} is the least");
                    return Err(of_steps(settings, position.kind, message));
                }
                ideal.max(done)
            }
            std::cmp::Ordering::Greater => ideal.max(before),
        };
        // A plan may be of a time when sizes were not visited again.
        let is_left_out = position.visit > 0 && number < current && end == before;
        if is_last && end != position.total && !is_left_out {
            let message = format!("these steps are over: {end} were done");
            return Err(of_steps(settings, position.kind, message));
        }
        add_stage(&mut stages, position, before, end);
        before = end;
    }
    Ok(stages)
}

/// A plan has no place in these settings since a kind was taken away or added whole: then that setting is named.
fn over_or(otherwise: Error, settings: &FitSettings, plan: &[Stage]) -> Error {
    let (own, other) = (plan.iter().map(|stage| stage.kind), positions(settings, SolverShare::of(settings)));
    for kind in own {
        if !other.iter().any(|position| position.kind == kind) {
            return of_steps(settings, kind, "these steps have begun".into());
        }
    }
    let asked = other.iter().any(|position| position.kind == StageKind::Diffuse);
    if asked && plan.iter().all(|stage| stage.kind != StageKind::Diffuse) {
        return of_steps(settings, StageKind::Diffuse, "these steps are over: none was done".into());
    }
    otherwise
}

fn of_steps(settings: &FitSettings, kind: StageKind, message: String) -> Error {
    let name = match (kind, settings.steps) {
        (StageKind::Diffuse, _) => "steps-diffuse",
        (StageKind::All, _) => "steps-all",
        (StageKind::Refine, _) => "solver-refine",
        _ => "solver-rounds",
    };
    Error::new(ErrorKind::InvalidSetting, message)
        .at(Place::Setting(name.into()))
        .remedy("steps that are done stay done: ask for at least as many, or start a new run")
}

mod of_solver;
#[cfg(test)]
mod tests;
