//! One case of a study as a line of text.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Inputs of a case by name: whatever must be the same for two lines to be of the same case.
pub type CaseInputs = BTreeMap<String, String>;

/// The outcome of one case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CaseLine {
    /// Name of the case; what stands before its first `/` is the part of the study it belongs to.
    pub case: String,
    /// Version of the method that made it.
    pub version: u32,
    /// Seed of everything random in it.
    pub seed: u64,
    /// What it was made from.
    pub inputs: CaseInputs,
    /// Measures by name; `None` is a number that was not finite.
    pub figures: BTreeMap<String, Option<f64>>,
    /// Why there are no measures, for a case that failed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failed: Option<String>,
    /// Seconds of the case.
    pub seconds: f64,
}

impl CaseLine {
    /// The part of the study it belongs to.
    pub fn part(&self) -> &str {
        part_of(&self.case)
    }

    /// A measure; NaN where it is missing or was not finite.
    pub fn figure(&self, name: &str) -> f64 {
        self.figures.get(name).copied().flatten().unwrap_or(f64::NAN)
    }
}

/// How many cases a part of a study has, so that tables can say what share of them is done.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PlanLine {
    /// Number of cases by part.
    pub plan: BTreeMap<String, usize>,
}

/// What a line of a results file can be.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Line {
    /// A case.
    Case(CaseLine),
    /// The size of the study; the last one holds, part by part.
    Plan(PlanLine),
}

/// The part of the study that a name of a case begins with.
pub fn part_of(case: &str) -> &str {
    case.split('/').next().unwrap_or(case)
}
