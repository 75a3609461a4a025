//! Figure 2: how closely each model represents a measured material, by the figure of
//! [`crate::measured::metrics`].
//!
//! No photo is taken: each model is fitted to the whole table. A case is one model and one material.
//!
//! The paper's unconditional model has a net for each material and channel. Here it has one for each material, and a code
//! for each of its channels; it begins at the weights that ship ([`crate::lab::neural::own_net`]).
//!
//! What is not here: the paper's leave-one-out (one training a material): ten materials are left out of one training
//! together, which is harder.

use super::StudyOptions;
use super::contender::{Contender, LEFT_OUT, SEEN, SHAPED, SHAPED_LEFT_OUT, name_of_left_out};
use crate::error::Result;
use crate::image::file;
use crate::insight::report::number::fixed;
use crate::lab::bar_picture::{self, PictureBar};
use crate::lab::neural::own_net;
use crate::lab::rivals::rows::{ModelSummary, RivalRow, summarise};
use crate::lab::study::sitting::Figures;
use crate::lab::study::{CaseLine, StudyCase};
use crate::measured::baseline::Baseline;
use crate::measured::category::Category;
use crate::measured::fits::NeuralFits;
use crate::measured::metrics::TableError;
use crate::measured::table::MeasuredBrdf;
use crate::neural::Trained;
use std::path::Path;
use std::sync::Arc;

/// Heading of the part.
pub const TITLE: &str = "Figure 2: how closely models represent measured materials";
/// The part in names of cases.
pub const PART: &str = "fig2";

/// All models and materials that are fitted.
pub struct Representation {
    fits: NeuralFits,
    contenders: Vec<Contender>,
    pairs: Vec<(String, usize)>,
    quick: bool,
    table: Option<(String, MeasuredBrdf)>,
}

impl Representation {
    /// Every model on every material that it may be fitted to.
    ///
    /// # Errors
    /// A library or weights that cannot be read.
    pub fn read(options: &StudyOptions) -> Result<Self> {
        let fits = NeuralFits::read(&options.library)?;
        let left_out_model = Arc::new(options.trained()?);
        let shipped = Arc::new(crate::neural::shipped()?);
        let shaped = Arc::new(crate::neural::shaped()?);
        let shaped_left_out = Arc::new(crate::neural::shaped_leave_out()?);
        let mut contenders = vec![
            (Contender::OwnNet(Arc::clone(&shipped)), None),
            (Contender::Flow(SEEN.into(), shipped), None),
            (Contender::Flow(LEFT_OUT.into(), Arc::clone(&left_out_model)), Some(left_out_model)),
            (Contender::Flow(SHAPED.into(), shaped), None),
            (Contender::Flow(SHAPED_LEFT_OUT.into(), Arc::clone(&shaped_left_out)), Some(shaped_left_out)),
        ];
        for path in &options.leave_out_weights {
            let trained = Arc::new(Trained::read(path)?);
            contenders.push((Contender::Flow(name_of_left_out(&trained), Arc::clone(&trained)), Some(trained)));
        }
        contenders.extend(Baseline::ALL.map(|rival| (Contender::Baseline(rival), None)));
        let mut pairs = Vec::new();
        for fit in &fits.materials {
            for (place, (_, only)) in contenders.iter().enumerate() {
                if only.as_ref().is_none_or(|trained| trained.account.left_out.contains(&fit.name)) {
                    pairs.push((fit.name.clone(), place));
                }
            }
        }
        let contenders = contenders.into_iter().map(|(contender, _)| contender).collect();
        Ok(Representation { fits, contenders, pairs, quick: options.quick, table: None })
    }

    /// Its cases, material by material.
    pub fn cases(&self) -> Vec<StudyCase> {
        let part = if self.quick { format!("{PART} quick") } else { PART.into() };
        let case = |(material, contender): &(String, usize)| {
            let name = self.contenders[*contender].name();
            StudyCase::new(format!("{part}/{material}/{name}"), format!("{PART}/{material}"), 1)
        };
        self.pairs.iter().map(case).collect()
    }

    /// Fits the model of one case.
    ///
    /// # Errors
    /// A fit that fails.
    pub fn fit(&mut self, case: usize) -> Result<Figures> {
        let (material, contender) = &self.pairs[case];
        let table = match self.table.take() {
            Some((name, table)) if name == *material => table,
            _ => self.fits.find(material)?.table(),
        };
        let outcome = self.contenders[*contender].fit(&table, self.quick);
        self.table = Some((material.clone(), table));
        let (parameters, error) = outcome?;
        Ok(vec![
            ("parameters", parameters as f64),
            ("log_rmse", error.log_rmse),
            ("log10_rmse", error.log10_rmse),
            ("cosine_rmse", error.cosine_rmse),
            ("cosine_mean", error.cosine_mean),
            ("cells", error.cells as f64),
        ])
    }
}

/// The row of a line of this part; `None` of a fit that failed.
fn row_of(line: &CaseLine) -> Option<RivalRow> {
    let mut words = line.case.splitn(3, '/').skip(1);
    let (material, model) = (words.next()?, words.next()?);
    let error = TableError {
        log_rmse: line.figure("log_rmse"),
        log10_rmse: line.figure("log10_rmse"),
        cosine_rmse: line.figure("cosine_rmse"),
        cosine_mean: line.figure("cosine_mean"),
        cells: line.figure("cells") as usize,
    };
    let (category, parameters) = (Category::of(material), line.figure("parameters") as usize);
    let row = RivalRow { material: material.into(), category, model: model.into(), parameters, error, sphere: None };
    line.failed.is_none().then_some(row)
}

/// Writes `STEM.md`, `STEM-by-kind.md` and `STEM.png` of the lines of this part and returns them as Markdown.
///
/// # Errors
/// Files that cannot be written.
pub fn write(lines: &[&CaseLine], share: &str, folder: &Path, stem: &str) -> Result<String> {
    let rows: Vec<RivalRow> = lines.iter().filter_map(|line| row_of(line)).collect();
    let of = |name: &str| -> Vec<String> {
        rows.iter().filter(|row| row.model == name).map(|row| row.material.clone()).collect()
    };
    let (left_out, with_dsbrdf) = (of(LEFT_OUT), of(Baseline::Dsbrdf.name()));
    let over = |materials: &[String]| -> Vec<RivalRow> {
        rows.iter().filter(|row| materials.contains(&row.material)).cloned().collect()
    };
    let mut text = format!("## {TITLE}\n\n{share}\n\n{}", summary_markdown(&rows));
    if !left_out.is_empty() {
        text += "\nOver the materials that were left out of the training, for all models:\n\n";
        text += &summary_markdown(&over(&left_out));
    }
    let materials: std::collections::BTreeSet<&String> = rows.iter().map(|row| &row.material).collect();
    if !with_dsbrdf.is_empty() && with_dsbrdf.len() < materials.len() {
        text += "\nOver the materials that DSBRDF was fitted to, for all models:\n\n";
        text += &summary_markdown(&over(&with_dsbrdf));
    }
    text += &format!(
        "\nlog-RMSE in natural logarithms of stored values over all cells that count. \"{}\": all weights of a flow \
         fitted to each material, from those that ship on. \"{SEEN}\": weights trained on all \
         materials of the library, codes and colours of three lobes fitted to each. \"{SHAPED}\": the same of weights \
         with a shape a material, one lobe. \"{LEFT_OUT}\" and \"{SHAPED_LEFT_OUT}\": weights that saw none of {}. {}\n",
        own_net::NAME,
        left_out.join(", "),
        crate::measured::fits::DATA_STATEMENT
    );
    let kinds = by_kind_markdown(&rows);
    let write = |name: &str, text: &str| crate::files::write_bytes(&folder.join(name), text.as_bytes());
    write(&format!("{stem}.md"), &text)?;
    write(&format!("{stem}-by-kind.md"), &kinds)?;
    let overall: Vec<ModelSummary> = summarise(&rows).into_iter().filter(|own| own.category.is_none()).collect();
    let mut bars: Vec<PictureBar> = overall
        .iter()
        .map(|own| PictureBar {
            label: format!("{} N={}", own.model, own.materials),
            value: own.mean,
            mark: Some(own.median),
        })
        .collect();
    bars.sort_by(|a, b| a.value.total_cmp(&b.value));
    let picture = bar_picture::bars("log-RMSE: bar = mean, tick = median, N = materials", &bars);
    file::write_png_srgb8(&folder.join(format!("{stem}.png")), &picture)?;
    Ok(format!("{text}\n{kinds}"))
}

fn summary_markdown(rows: &[RivalRow]) -> String {
    let mut text = String::from(
        "| model | materials | parameters | mean | median | quartiles | largest |\n\
         | --- | ---: | ---: | ---: | ---: | ---: | ---: |\n",
    );
    let mut all: Vec<ModelSummary> = summarise(rows).into_iter().filter(|own| own.category.is_none()).collect();
    all.sort_by(|a, b| a.mean.total_cmp(&b.mean));
    for own in all {
        let parameters = rows.iter().find(|row| row.model == own.model).map_or(0, |row| row.parameters);
        text += &format!(
            "| {} | {} | {parameters} | {} | {} | {} – {} | {} |\n",
            own.model,
            own.materials,
            fixed(own.mean, 3),
            fixed(own.median, 3),
            fixed(own.quartiles.0, 3),
            fixed(own.quartiles.1, 3),
            fixed(own.largest, 3)
        );
    }
    text
}

/// Mean and median of each model over each kind of material.
fn by_kind_markdown(rows: &[RivalRow]) -> String {
    let summaries = summarise(rows);
    let models: Vec<&str> = summaries.iter().filter(|s| s.category.is_none()).map(|s| s.model.as_str()).collect();
    let mut text =
        format!("| kind | materials | {} |\n| --- | ---: |{}\n", models.join(" | "), " ---: |".repeat(models.len()));
    let mut kinds: Vec<Option<Category>> = summaries.iter().map(|summary| summary.category).collect();
    kinds.dedup();
    for kind in kinds {
        let of_kind: Vec<&ModelSummary> = summaries.iter().filter(|summary| summary.category == kind).collect();
        let count = of_kind.iter().map(|summary| summary.materials).max().unwrap_or(0);
        text += &format!("| {} | {count} |", kind.map_or("all", |kind| kind.label()));
        for model in &models {
            text += &match of_kind.iter().find(|summary| summary.model == *model) {
                Some(summary) if summary.materials < count => {
                    format!(" {} / {} ({}) |", fixed(summary.mean, 3), fixed(summary.median, 3), summary.materials)
                }
                Some(summary) => format!(" {} / {} |", fixed(summary.mean, 3), fixed(summary.median, 3)),
                None => " – |".into(),
            };
        }
        text.push('\n');
    }
    text + "\nMean / median log-RMSE; in brackets the number of materials where it is smaller than the row's.\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(material: &str, model: &str, log_rmse: f64) -> CaseLine {
        let figures = [("parameters", 8.0), ("log_rmse", log_rmse)].map(|(name, value)| (name.into(), Some(value)));
        let case = format!("fig2/{material}/{model}");
        let (inputs, figures) = (Default::default(), figures.into());
        CaseLine { case, version: 1, seed: 1, inputs, figures, failed: None, seconds: 1.0 }
    }

    #[test]
    fn lines_become_tables_and_bars() {
        let folder = tempfile::tempdir().unwrap();
        let lines = [line("steel", LEFT_OUT, 0.1), line("steel", "GGX", 0.3), line("pink-felt", "GGX", 0.5)];
        let text = write(&lines.iter().collect::<Vec<_>>(), "3 of 7 cases", folder.path(), "fig2").unwrap();
        assert!(text.contains("| GGX | 2 | 8 | 0.400 |") && text.contains("3 of 7 cases"), "{text}");
        assert!(text.contains("for all models:") && text.contains("none of steel"), "{text}");
        for file in ["fig2.md", "fig2-by-kind.md", "fig2.png"] {
            assert!(folder.path().join(file).is_file(), "{file}");
        }
    }

    #[test]
    fn tables_say_of_how_many_materials_they_speak() {
        let lines = [line("steel", "A", 0.1), line("brass", "A", 0.3), line("steel", "B", 0.4)];
        let rows: Vec<RivalRow> = lines.iter().filter_map(row_of).collect();
        let text = summary_markdown(&rows);
        assert!(text.contains("| A | 2 | 8 | 0.200 | 0.200 |") && text.contains("| B | 1 | 8 | 0.400 |"), "{text}");
        let kinds = by_kind_markdown(&rows);
        assert!(kinds.contains("| metal | 2 | 0.200 / 0.200 | 0.400 / 0.400 (1) |"), "{kinds}");
    }
}
