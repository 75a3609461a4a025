//! The numbers of a report; `report.json` is their JSON. A number that is not finite is `null` there, NaN when read.

use crate::error::{Finding, Severity};
use crate::export::LossRow;
use crate::fit::solver::Objective;
use crate::insight::capture::ViewCapture;
use crate::insight::intervals::IntervalCoverage;
use crate::insight::report::choice_table::ChoiceTable;
use crate::insight::scores::{AggregateScore, PictureScore, ViewScores};
use crate::insight::truth::{EnvironmentErrors, MapErrors};
use serde::{Deserialize, Serialize};

/// Everything a report says in words and numbers.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct ReportData {
    /// Title of the page: the scene's name.
    pub title: String,
    /// Name and version of the program.
    pub program: String,
    /// Facts of the scene: triangles, views, picture size, map size.
    pub scene_facts: Vec<Fact>,
    /// All settings of the run.
    pub settings: Vec<SettingLine>,
    /// What was noticed: before, during and after the fit.
    pub findings: Vec<ReportFinding>,
    /// Wall-clock time of each stage, in the order they ran.
    pub timings: Vec<StageTime>,
    /// Peak resident memory in bytes; `None` where the system does not tell.
    pub peak_memory_bytes: Option<u64>,
    /// The loss of every step.
    pub loss_history: Vec<LossRow>,
    /// Scores of every view.
    pub views: Vec<ViewLine>,
    /// What is wrong with the capture, in figures of the views that were looked at.
    pub capture: Vec<ViewCapture>,
    /// Scores of many views together: `held-out views`, `training views`.
    pub aggregates: Vec<NamedAggregate>,
    /// Errors against a known truth; `None` for real photographs.
    pub truth: Option<TruthErrors>,
    /// Which rule fixes the scale between reflectance and light, in one or two sentences.
    pub gauge_statement: String,
    /// Which evidence was used: background pixels or not, censored pixels; in one or two sentences.
    pub evidence_statement: String,
    /// Numbers that were not finite, by name of the quantity. An empty list means none was found.
    pub non_finite: Vec<NonFiniteCount>,
    /// What views that took no part say of the model's freedoms; `None` where none were asked.
    pub choices: Option<ChoiceTable>,
    /// The objective of the last descent, before and after each of its steps; empty where there was none.
    pub objective: Vec<[Objective; 2]>,
    /// Texels of the atlas that some photograph sees, and that none does.
    pub texels: TexelCounts,
}

/// A name and a value as text, with its unit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fact {
    /// What it is.
    pub name: String,
    /// The value with its unit.
    pub value: String,
}

/// A setting of the run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SettingLine {
    /// Its name on the command line, without dashes.
    pub name: String,
    /// Its value as text.
    pub value: String,
    /// Whether nobody changed it.
    pub is_default: bool,
}

/// A [`Finding`] that can be read back.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReportFinding {
    /// How much it matters.
    pub severity: Severity,
    /// A short stable name.
    pub code: String,
    /// One sentence.
    pub message: String,
    /// Where; may be empty.
    pub place: String,
    /// What the user can do; may be empty.
    pub remedy: String,
}

impl From<&Finding> for ReportFinding {
    fn from(finding: &Finding) -> Self {
        ReportFinding {
            severity: finding.severity,
            code: finding.code.into(),
            message: finding.message.clone(),
            place: finding.place.clone(),
            remedy: finding.remedy.clone(),
        }
    }
}

/// Time of a stage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StageTime {
    /// Name of the stage.
    pub stage: String,
    /// Wall-clock seconds.
    #[serde(deserialize_with = "crate::export::loss_log::number_or_nan")]
    pub seconds: f64,
}

/// Scores of one view.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ViewLine {
    /// Name of the view.
    pub name: String,
    /// Kept out of the fit.
    pub held_out: bool,
    /// Left out by the user: neither fitted nor in any mean.
    #[serde(default)]
    pub left_out: bool,
    /// As rendered.
    pub raw: PictureScore,
    /// After the view's own best factor per channel.
    pub aligned: PictureScore,
    /// Exposure gain of the view, 1 when it was not fitted.
    #[serde(deserialize_with = "crate::export::loss_log::number_or_nan")]
    pub exposure_gain: f64,
    /// Share of the surface pixels that are clipped.
    #[serde(deserialize_with = "crate::export::loss_log::number_or_nan")]
    pub clipped_share: f64,
    /// Pixels that count.
    pub pixels: u64,
    /// Pixels left out because they are not finite.
    pub non_finite_pixels: u64,
}

impl ViewLine {
    /// The line of a view from its scores.
    pub fn new(name: &str, held_out: bool, scores: &ViewScores, exposure_gain: f64) -> Self {
        ViewLine {
            name: name.into(),
            held_out,
            left_out: false,
            raw: scores.raw,
            aligned: scores.aligned,
            exposure_gain,
            clipped_share: scores.clipped_share,
            pixels: scores.sums.pixels,
            non_finite_pixels: scores.non_finite_pixels,
        }
    }
}

/// Scores of many views together.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NamedAggregate {
    /// Which views: `held-out views`, `training views`.
    pub name: String,
    /// Their scores.
    pub score: AggregateScore,
}

/// Errors against the truth of a synthetic scene. What is `None` could not be compared.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct TruthErrors {
    /// Of the maps, over the texels some view sees.
    pub maps: Option<MapErrors>,
    /// Whether the stated uncertainties of the maps hold; `None` where none are stated.
    #[serde(default)]
    pub intervals: Option<IntervalCoverage>,
    /// Of the light.
    pub environment: Option<EnvironmentErrors>,
    /// Of pictures under a light that was not in the photographs.
    pub relit: Option<AggregateScore>,
}

/// How often a quantity was not finite.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NonFiniteCount {
    /// Name of the quantity, such as `gradient of roughness`.
    pub name: String,
    /// How often.
    pub count: u64,
}

/// Texels of the atlas.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TexelCounts {
    /// On a chart and seen by at least one photograph.
    pub seen: u64,
    /// On a chart and seen by none: filled in, not measured.
    pub unseen: u64,
}
