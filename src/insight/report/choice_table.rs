//! What the scene needs, as numbers of the report.

use crate::fit::solver::Choices;
use serde::{Deserialize, Serialize};

/// The freedoms of the model and what judging views say of them; [`Choices`] without its map.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct ChoiceTable {
    /// One line a freedom.
    pub lines: Vec<ChoiceRow>,
    /// Views that judged.
    pub views: usize,
    /// Their pixels.
    pub pixels: u64,
    /// Whether they were training views, withheld from this check only.
    pub are_withheld: bool,
    /// Seconds that the check took.
    #[serde(deserialize_with = "crate::export::loss_log::number_or_nan")]
    pub seconds: f64,
}

/// A freedom of the model. What is not known is `None`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct ChoiceRow {
    /// What it is.
    pub name: String,
    /// What it is compared with; empty for the simplest model.
    pub compared_with: String,
    /// Share in [0, 1] of the judged texels for which it is the choice.
    pub share: Option<f64>,
    /// Mean gain in log-likelihood, in nats a pixel.
    pub gain: Option<f64>,
    /// Standard error of the gain, over views.
    pub gain_error: Option<f64>,
    /// Root mean squared error over the judging pixels, in linear radiance.
    pub rmse: Option<f64>,
    /// That less the error of what it is compared with.
    pub rmse_change: Option<f64>,
    /// Seconds that it added to the fit.
    pub seconds: Option<f64>,
}

impl ChoiceTable {
    /// The table of an outcome.
    pub fn of(choices: &Choices) -> Self {
        let finite = |value: Option<f64>| value.filter(|value| value.is_finite());
        let lines = choices.lines.iter().map(|line| ChoiceRow {
            name: line.name.into(),
            compared_with: line.compared_with.into(),
            share: line.share,
            gain: finite(line.gain.map(|gain| gain.0)),
            gain_error: finite(line.gain.map(|gain| gain.1)),
            rmse: finite(Some(line.rmse)),
            rmse_change: finite(line.rmse_change),
            seconds: finite(line.seconds),
        });
        ChoiceTable {
            lines: lines.collect(),
            views: choices.views,
            pixels: choices.pixels,
            are_withheld: choices.are_withheld,
            seconds: choices.seconds,
        }
    }
}
