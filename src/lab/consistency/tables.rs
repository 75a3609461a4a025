//! Scores side by side, with the figures of the paper.

use super::case::Case;
use super::measure::{COLUMNS, DIFFUSE, EXPONENT, IMAGE, LIGHT_ALIGNED, RELIT, RISE};
use crate::error::Result;
use crate::insight::report::number::short;
use crate::lab::study_table::StudyTable;
use crate::math::statistics::quantile;
use crate::scene::Scene;
use std::path::Path;

/// Change of the image error in percent that the paper gives for scenes of these names (Joy and Poullis 2023, fig. 3).
const PAPER_CHANGES: [(&str, f64); 3] = [("cow", -32.0), ("vase", -9.0), ("teddy", -5.0)];

/// Scores that are compared with those without consistency: name and column.
const COMPARED: [(&str, usize); 6] = [
    ("image RMSE", IMAGE),
    ("diffuse RMSE", DIFFUSE),
    ("diffuse aligned", DIFFUSE + 1),
    ("light aligned", LIGHT_ALIGNED),
    ("relit RMSE", RELIT),
    ("relit aligned", RELIT + 1),
];

/// The scores of a scene.
pub struct SceneTable {
    /// Name of the scene.
    pub name: String,
    table: StudyTable,
    cases: Vec<Case>,
}

impl SceneTable {
    /// An empty table of a scene; `described` says what is run.
    pub fn new(name: String, described: String, scene: &Scene) -> Self {
        let title = format!("Consistency between views: {name}");
        let mut table = StudyTable::new(&title, "setting", &COLUMNS);
        table.notes.push(described);
        table.notes.push(
            "Image and relit errors: linear, over surface pixels of held-out views, with the noise of our own pictures \
             taken off; `aligned` after the best factor per channel. Maps over texels that the views see. `rise when \
             relit` is relit RMSE over image RMSE, minus 1; at equal brightness both are first divided by the root mean \
             square of the true pictures. `exponent` is the mean over the steps of the logarithm of the factor on the \
             loss."
                .into(),
        );
        if let Some(truth) = &scene.truth
            && truth.maps.specular.pixels().iter().all(|specular| *specular == glam::Vec3::ZERO)
        {
            table.notes.push(
                "The truth has no specular reflectance, but every setting frees a lobe, and F0 = 0 keeps the grazing part \
                 of Schlick's formula; roughness says nothing here. With --steps-all 0 the two-step settings fit no \
                 lobe."
                    .into(),
            );
        }
        SceneTable { name, table, cases: Vec::new() }
    }

    /// Adds the scores of a fit.
    pub fn add(&mut self, case: Case, values: &[f64]) {
        if !self.cases.contains(&case) {
            self.cases.push(case);
        }
        self.table.add(case.name(), values);
    }

    /// The table, with a note of how many seeds it holds: fewer than asked for when the study was stopped.
    fn with_seeds(&self) -> StudyTable {
        let mut table = self.table.clone();
        table.notes.push(format!("Seeds 1 to {}.", table.values(0, IMAGE).len()));
        table
    }

    /// Change of a score against no consistency in percent, one a seed.
    fn changes(&self, case: Case, column: usize) -> Vec<f64> {
        let values = |case: Case| {
            let row = self.cases.iter().position(|other| *other == case).unwrap_or(usize::MAX);
            self.table.values(row, column)
        };
        values(case).iter().zip(values(Case::None)).map(|(value, base)| 100.0 * (value / base - 1.0)).collect()
    }

    /// Half the distance between the quartiles of a score without consistency, in percent of its median: what a change
    /// of seed alone does.
    fn spread(&self, column: usize) -> f64 {
        let row = self.cases.iter().position(|case| *case == Case::None).unwrap_or(usize::MAX);
        let summary = self.table.summary(row, column);
        50.0 * (summary.upper_quartile - summary.lower_quartile) / summary.median
    }

    /// A sentence that puts our change of the image error beside the paper's.
    fn beside_the_paper(&self) -> String {
        let mut words = Vec::new();
        for &case in self.cases.iter().filter(|case| **case != Case::None) {
            words.push(format!("`{}` {}", case.name(), percent(quantile(&self.changes(case, IMAGE), 0.5))));
        }
        let paper = PAPER_CHANGES.iter().find(|(name, _)| *name == self.name);
        let paper = paper.map_or("none".to_string(), |(_, change)| percent(*change));
        format!(
            "{}: image RMSE against `none`, median over seeds: {}; the paper's figure for a scene of this name: {paper}. \
             A change of seed alone moves `none` by {:.1} % in the image and {:.1} % in the diffuse map (half the \
             distance of the quartiles).",
            self.name,
            words.join(", "),
            self.spread(IMAGE),
            self.spread(DIFFUSE)
        )
    }
}

/// The tables of all scenes and that of the changes, written into a folder.
pub fn write(scenes: &[SceneTable], cases: &[Case], folder: &Path) -> Result<Vec<StudyTable>> {
    let mut tables: Vec<StudyTable> = scenes.iter().map(SceneTable::with_seeds).collect();
    tables.push(changes(scenes, cases));
    let names = scenes.iter().map(|scene| scene.name.as_str()).chain(["change"]);
    for (table, name) in tables.iter().zip(names) {
        let plain: String = name.chars().map(|c| if c.is_alphanumeric() { c } else { '-' }).collect();
        table.write(folder, &format!("mvcl-{plain}"))?;
    }
    let all: Vec<String> = tables.iter().map(StudyTable::to_markdown).collect();
    crate::files::write_bytes(&folder.join("mvcl.md"), all.join("\n").as_bytes())?;
    Ok(tables)
}

/// Changes against no consistency, in percent: one row a scene and case.
fn changes(scenes: &[SceneTable], cases: &[Case]) -> StudyTable {
    let mut columns: Vec<(&str, &str)> = COMPARED.iter().map(|(name, _)| (*name, "%")).collect();
    columns.push(("rise when relit", "%"));
    let mut table = StudyTable::new("Change against `none`, same seed", "scene: setting", &columns);
    for scene in scenes {
        for &case in cases.iter().filter(|case| scene.cases.contains(case)) {
            let compared: Vec<Vec<f64>> = COMPARED.iter().map(|&(_, column)| scene.changes(case, column)).collect();
            let row = scene.cases.iter().position(|other| *other == case).unwrap_or(usize::MAX);
            let rises = scene.table.values(row, RISE);
            for seed in 0..compared[0].len() {
                let mut values: Vec<f64> = compared.iter().map(|changes| changes[seed]).collect();
                values.push(rises.get(seed).copied().unwrap_or(f64::NAN));
                table.add(&format!("{}: {}", scene.name, case.name()), &values);
            }
        }
    }
    table.notes.push(
        "The last column is no change but the rise itself: relit RMSE over image RMSE, minus 1. The paper (Joy and \
         Poullis 2023, fig. 3 and 5) gives a change of the image RMSE of −32 % for a diffuse cow, −9 % for a highly \
         specular vase and −5 % for a teddy with both, on its own models and training views; and a rise of 230 % \
         without consistency, 80 to 100 % with it."
            .into(),
    );
    table.notes.extend(scenes.iter().map(SceneTable::beside_the_paper));
    for &case in cases {
        let mut sentence = case.sentence().to_string();
        let exponents = scenes.iter().filter_map(|scene| {
            let row = scene.cases.iter().position(|other| *other == case)?;
            Some(format!("{} {}", scene.name, short(scene.table.summary(row, EXPONENT).median)))
        });
        if !matches!(case, Case::None | Case::OneStep) {
            sentence += &format!(" Exponent here: {}.", exponents.collect::<Vec<_>>().join(", "));
        }
        table.notes.push(sentence);
    }
    table
}

/// A change with its sign.
fn percent(change: f64) -> String {
    format!("{change:+.1} %").replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene() -> SceneTable {
        let mut scene =
            SceneTable { name: "cow".into(), table: StudyTable::new("cow", "setting", &COLUMNS), cases: Vec::new() };
        for (image, changed) in [(1.0, 0.5), (2.0, 1.8), (4.0, 4.4)] {
            scene.add(Case::None, &[image; COLUMNS.len()]);
            scene.add(Case::Exact, &[changed; COLUMNS.len()]);
        }
        scene
    }

    #[test]
    fn changes_are_taken_seed_by_seed() {
        let changes = scene().changes(Case::Exact, IMAGE);
        for (change, expected) in changes.iter().zip([-50.0, -10.0, 10.0]) {
            assert!((change - expected).abs() < 1e-9);
        }
        assert!(scene().changes(Case::Released, IMAGE).is_empty(), "a case that was not run");
        // Quartiles of 1, 2, 4 are 1.5 and 3.
        assert!((scene().spread(IMAGE) - 50.0 * 1.5 / 2.0).abs() < 1e-9);
        let sentence = scene().beside_the_paper();
        assert!(sentence.contains("`exact` −10.0 %") && sentence.contains("−32.0 %"), "{sentence}");
    }

    #[test]
    fn tables_and_plots_are_written() {
        let folder = tempfile::tempdir().unwrap();
        let tables = write(&[scene()], &[Case::None, Case::Exact], folder.path()).unwrap();
        assert_eq!(tables.len(), 2);
        for file in ["mvcl-cow.csv", "mvcl-cow.svg", "mvcl-change.md", "mvcl.md"] {
            assert!(folder.path().join(file).is_file(), "{file}");
        }
        let text = std::fs::read_to_string(folder.path().join("mvcl.md")).unwrap();
        assert!(text.contains("cow: exact") && text.contains("230 %"), "{text}");
    }
}
