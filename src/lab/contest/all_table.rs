//! The table of `bench fit --all`: scenes by measures, means with their standard errors over scenes, and how the 8-bit
//! versions compare with the linear ones.

use crate::error::Result;
use crate::insight::report::number::short;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// The measures. Errors are those of [`super::judge::COLUMNS`]; `holds` are shares of texels whose 90 % interval holds
/// the truth; lights are compared after their factor; the first maps are the first snapshot whose image error is at most twice
/// that of the end.
pub const COLUMNS: [&str; 19] = [
    "image of the truth",
    "image",
    "held out",
    "diffuse aligned",
    "F0",
    "roughness",
    "light aligned",
    "light blurred by 5 deg",
    "light blurred by 15 deg",
    "sun off, deg",
    "relit",
    "relit aligned",
    "diffuse holds",
    "F0 holds",
    "roughness holds",
    "first maps, s",
    "all, s",
    "processor s",
    "non-finite",
];

/// One fit.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Line {
    /// Name of its folder.
    pub scene: String,
    /// The scene with the same truth whose pictures judge it, where that is another.
    pub twin_of: Option<String>,
    /// Name of the method.
    pub method: String,
    /// Fingerprint of program, inputs and options.
    pub key: String,
    /// What went wrong with its process.
    pub trouble: Option<String>,
    /// One a column of [`COLUMNS`]; `None` where there is no number.
    pub scores: Vec<Option<f64>>,
}

/// All fits.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AllTable {
    /// Of every scene and method, in the order they ran.
    pub lines: Vec<Line>,
    /// What could not be run, and why.
    pub notes: Vec<String>,
}

/// Mean and its standard error over the numbers there are; the latter is NaN of fewer than two.
fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (mean, (squares / (count - 1.0) / count).sqrt())
}

impl AllTable {
    fn methods(&self) -> Vec<&str> {
        let mut methods: Vec<&str> = Vec::new();
        for line in &self.lines {
            if !methods.contains(&line.method.as_str()) {
                methods.push(&line.method);
            }
        }
        methods
    }

    /// The rows below the scenes: name, and mean with standard error a column.
    fn summaries(&self) -> Vec<(String, Vec<(f64, f64)>)> {
        let mut rows = Vec::new();
        for method in self.methods() {
            let own: Vec<&Line> = self.lines.iter().filter(|line| line.method == method).collect();
            for (kind, is_twin) in [("mean", false), ("mean of 8-bit", true)] {
                let some: Vec<&&Line> = own.iter().filter(|line| line.twin_of.is_some() == is_twin).collect();
                if some.is_empty() {
                    continue;
                }
                let of = |column: usize| {
                    mean_and_error(&some.iter().filter_map(|line| line.scores[column]).collect::<Vec<_>>())
                };
                rows.push((format!("{kind}, {method}"), (0..COLUMNS.len()).map(of).collect()));
            }
            let ratio = |column: usize| {
                let pairs = own.iter().filter_map(|twin| {
                    let linear = own.iter().find(|line| twin.twin_of.as_ref() == Some(&line.scene))?;
                    let ratio = twin.scores[column]? / linear.scores[column]?;
                    ratio.is_finite().then_some(ratio)
                });
                mean_and_error(&pairs.collect::<Vec<_>>())
            };
            if own.iter().any(|line| line.twin_of.is_some()) {
                rows.push((format!("8-bit / linear, {method}"), (0..COLUMNS.len()).map(ratio).collect()));
            }
        }
        rows
    }

    /// As Markdown.
    pub fn to_markdown(&self) -> String {
        let mut text = String::from("# All scenes\n\n| scene, method |");
        for name in COLUMNS {
            text += &format!(" {name} |");
        }
        text += "\n|---|";
        text += &"---:|".repeat(COLUMNS.len());
        for line in &self.lines {
            text += &format!("\n| {}, {} |", line.scene, line.method);
            for score in &line.scores {
                text += &format!(" {} |", short(score.unwrap_or(f64::NAN)));
            }
        }
        for (name, values) in self.summaries() {
            text += &format!("\n| **{name}** |");
            for (mean, error) in values {
                text += &if error.is_finite() {
                    format!(" {} ± {} |", short(mean), short(error))
                } else {
                    format!(" {} |", short(mean))
                };
            }
        }
        text += "\n\nMeans are over the scenes that have a number, ± their standard error.\n";
        let failed = self.lines.iter().filter_map(|line| {
            line.trouble.as_ref().map(|trouble| format!("`{}` on {} {trouble}.", line.method, line.scene))
        });
        for note in self.notes.iter().cloned().chain(failed) {
            text += &format!("\n{note}\n");
        }
        text
    }

    /// One line a fit with all digits.
    pub fn to_csv(&self) -> String {
        let mut text = String::from("scene,twin_of,method");
        for name in COLUMNS {
            text += &format!(",{}", name.replace(", ", "_").replace([' ', '-'], "_"));
        }
        text.push('\n');
        for line in &self.lines {
            text += &format!("{},{},{}", line.scene, line.twin_of.as_deref().unwrap_or_default(), line.method);
            for score in &line.scores {
                text += &score.map_or(",".to_string(), |score| format!(",{score}"));
            }
            text.push('\n');
        }
        text
    }

    /// Writes `all.md` and `all.csv`.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<()> {
        crate::files::write_bytes(&folder.join("all.md"), self.to_markdown().as_bytes())?;
        crate::files::write_bytes(&folder.join("all.csv"), self.to_csv().as_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(scene: &str, twin_of: Option<&str>, score: Option<f64>) -> Line {
        Line {
            scene: scene.into(),
            twin_of: twin_of.map(Into::into),
            method: "solver".into(),
            scores: vec![score; COLUMNS.len()],
            ..Default::default()
        }
    }

    #[test]
    fn means_have_their_standard_error_and_twins_are_compared_pair_by_pair() {
        let table = AllTable {
            lines: vec![
                line("a", None, Some(1.0)),
                line("a-8", Some("a"), Some(2.0)),
                line("b", None, Some(3.0)),
                line("b-8", Some("b"), Some(3.0)),
                line("c", None, None),
            ],
            notes: Vec::new(),
        };
        let rows = table.summaries();
        let names: Vec<&str> = rows.iter().map(|row| row.0.as_str()).collect();
        assert_eq!(names, ["mean, solver", "mean of 8-bit, solver", "8-bit / linear, solver"]);
        assert_eq!([rows[0].1[1], rows[1].1[1], rows[2].1[1]], [(2.0, 1.0), (2.5, 0.5), (1.5, 0.5)]);
        assert!(table.to_markdown().contains("| **mean, solver** | 2 ± 1 |"), "{}", table.to_markdown());
        assert!(table.to_csv().lines().nth(5).is_some_and(|line| line.starts_with("c,,solver,,")));
    }
}
