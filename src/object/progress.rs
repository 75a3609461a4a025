//! What an estimation tells while it runs: the objective term by term, and states to look at.

use super::nodes::NodeTable;
use super::prior::LogLight;
use crate::error::{Error, ErrorKind, Place, Result};
use std::path::Path;

/// Which unknown a step was on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum StepKind {
    /// A start tried at low resolution.
    Start,
    /// The light.
    Light,
    /// The reflectance.
    Reflectance,
}

impl StepKind {
    /// The word in `loss.csv`.
    pub fn label(self) -> &'static str {
        match self {
            StepKind::Start => "start",
            StepKind::Light => "light",
            StepKind::Reflectance => "reflectance",
        }
    }
}

/// The objective after a step, term by term.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ObjectiveRow {
    /// Number of the step, from 1.
    pub step: usize,
    /// Round of light and reflectance, from 1; 0 before the first.
    pub round: usize,
    /// What was moved.
    pub kind: StepKind,
    /// Mean loss on logarithms.
    pub data: f64,
    /// Priors of the light.
    pub light_prior: f64,
    /// Prior of the codes.
    pub code_prior: f64,
    /// Seconds since the beginning.
    pub seconds: f64,
    /// Numbers that were not finite in this step and were left out.
    pub not_finite: usize,
}

impl ObjectiveRow {
    /// The sum of the terms.
    pub fn total(&self) -> f64 {
        self.data + self.light_prior + self.code_prior
    }
}

/// What a watcher is told.
pub enum ObjectEvent<'a> {
    /// In words, what is done now.
    Stage(&'a str),
    /// A step was done.
    Row(ObjectiveRow),
    /// The state after a round.
    State {
        /// The light.
        light: &'a LogLight,
        /// Those of the further photos, where each has its own.
        further_lights: &'a [LogLight],
        /// The reflectance at its nodes.
        table: &'a NodeTable,
        /// Parameters of the model.
        parameters: &'a [f64],
    },
}

/// Writes rows as `loss.csv`.
pub fn write_rows(path: &Path, rows: &[ObjectiveRow]) -> Result<()> {
    let mut text = String::from("step,round,kind,total,data,light_prior,code_prior,seconds,not_finite\n");
    for row in rows {
        text += &format!(
            "{},{},{},{:.9},{:.9},{:.9},{:.9},{:.3},{}\n",
            row.step,
            row.round,
            row.kind.label(),
            row.total(),
            row.data,
            row.light_prior,
            row.code_prior,
            row.seconds,
            row.not_finite
        );
    }
    crate::files::write_bytes(path, text.as_bytes())
}

/// Reads the rows of a `loss.csv`.
///
/// # Errors
/// `Missing` without the file, `Malformed` with the line that cannot be read.
pub fn read_rows(path: &Path) -> Result<Vec<ObjectiveRow>> {
    let text = std::fs::read_to_string(path).map_err(|source| Error::reading(path, source))?;
    let rows = text.lines().enumerate().skip(1).filter(|(_, line)| !line.trim().is_empty());
    rows.map(|(index, line)| {
        row_of(line).ok_or_else(|| {
            Error::new(ErrorKind::Malformed, "this is no row of the objective")
                .at(Place::Line(path.into(), index + 1))
                .remedy("delete the line, or copy the folder anew")
        })
    })
    .collect()
}

fn row_of(line: &str) -> Option<ObjectiveRow> {
    let [step, round, kind, _, data, light_prior, code_prior, seconds, not_finite] =
        <[&str; 9]>::try_from(line.split(',').map(str::trim).collect::<Vec<_>>()).ok()?;
    let kinds = [StepKind::Start, StepKind::Light, StepKind::Reflectance];
    Some(ObjectiveRow {
        step: step.parse().ok()?,
        round: round.parse().ok()?,
        kind: kinds.into_iter().find(|own| own.label() == kind)?,
        data: data.parse().ok()?,
        light_prior: light_prior.parse().ok()?,
        code_prior: code_prior.parse().ok()?,
        seconds: seconds.parse().ok()?,
        not_finite: not_finite.parse().ok()?,
    })
}
