//! Fits the rivals of learned models to the materials of a library and writes what came of it.
//!
//! Each row is kept in `rivals.jsonl` as soon as it is there: a study that was stopped goes on where it was.

pub mod rows;

use crate::error::{Error, ErrorKind, Place, Result};
use crate::files::write_bytes;
use crate::lab::neural::own_net::{self, OwnNetSettings};
use crate::lab::study_table::StudyTable;
use crate::measured::baseline::Baseline;
use crate::measured::fit_model::ModelFitSettings;
use crate::measured::fits::{DATA_STATEMENT, NeuralFits};
use crate::measured::sphere_error::sphere_error;
use crate::measured::table::MeasuredBrdf;
use rows::{Entrant, EntrantFit, RivalRow, rival_table, summarise};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// What is fitted, and where the rows go.
#[derive(Clone, Debug)]
pub struct RivalOptions {
    /// Folder of the neural fits.
    pub library: PathBuf,
    /// Names of materials; empty for all.
    pub materials: Vec<String>,
    /// Models by their keys, [`Baseline::key`] or [`own_net::KEY`]; empty for all.
    pub models: Vec<String>,
    /// Every eighth material only.
    pub quick: bool,
    /// Folder of the tables.
    pub output: PathBuf,
}

/// Runs the study and writes `rivals.md`, `.csv`, `-samples.csv`, `.svg` and `rivals-by-kind.md`.
///
/// Errors: a library that cannot be read, a material that is not in it, a fit that fails, stopped.
pub fn run(options: &RivalOptions, stop: &AtomicBool, tell: &dyn Fn(&RivalRow)) -> Result<StudyTable> {
    let fits = NeuralFits::read(&options.library)?;
    let stride = if options.quick { 8 } else { 1 };
    let materials: Vec<&str> = if options.materials.is_empty() {
        fits.materials.iter().map(|fit| fit.name.as_str()).step_by(stride).collect()
    } else {
        options.materials.iter().map(|name| fits.find(name).map(|fit| fit.name.as_str())).collect::<Result<_>>()?
    };
    let settings = ModelFitSettings::default();
    let models = entrants(&options.models, &settings)?;

    let path = options.output.join("rivals.jsonl");
    let known = read_rows(&path)?;
    let mut kept = known.clone();
    let table_of = |name: &str| -> Result<MeasuredBrdf> { Ok(fits.find(name)?.table()) };
    let rows = rival_table(&materials, &models, &known, &table_of, stop, &mut |row| {
        kept.push(row.clone());
        write_rows(&path, &kept)?;
        tell(row);
        Ok(())
    })?;

    let table = study_table(&rows);
    table.write(&options.output, "rivals")?;
    write_bytes(&options.output.join("rivals-by-kind.md"), by_kind_markdown(&rows).as_bytes())?;
    Ok(table)
}

/// The models of some keys, all when there is none.
///
/// # Errors
/// A key that is not known.
fn entrants<'a>(keys: &[String], settings: &'a ModelFitSettings) -> Result<Vec<Entrant<'a>>> {
    if keys.is_empty() {
        let rivals = Baseline::ALL.into_iter().map(|rival| Entrant::of(rival, settings));
        return Ok(std::iter::once(own_net()?).chain(rivals).collect());
    }
    let of_key = |key: &String| match key.as_str() {
        own_net::KEY => own_net(),
        key => Baseline::of_key(key).map(|rival| Entrant::of(rival, settings)).map_err(|error| {
            let remedy = format!("{}, {}", error.remedy_text(), own_net::KEY);
            Error::new(ErrorKind::InvalidSetting, error.message()).remedy(remedy)
        }),
    };
    keys.iter().map(of_key).collect()
}

/// The neural model with all its weights fitted to each material.
fn own_net() -> Result<Entrant<'static>> {
    let shipped = crate::neural::shipped()?;
    let fit = move |table: &MeasuredBrdf| -> Result<EntrantFit> {
        let found = own_net::fit_own_net(&shipped, table, &OwnNetSettings::default())?;
        let sphere = sphere_error(&found.model.reader(&found.parameters), table)?;
        Ok(EntrantFit { parameters: found.parameter_count(), error: found.error, sphere })
    };
    Ok(Entrant { name: own_net::NAME, fit: Box::new(fit) })
}

/// The rows as a table of models: one value a material.
pub fn study_table(rows: &[RivalRow]) -> StudyTable {
    let mut table = StudyTable::new(
        "Reflectance models over materials",
        "model",
        &[
            ("log-RMSE", ""),
            ("log10-RMSE", ""),
            ("RMSE of ln(1 + f cos)", ""),
            ("sphere, RMSE of sRGB", ""),
            ("sphere, log-RMSE", ""),
            ("parameters", ""),
        ],
    )
    .with_caption("Median over materials, in brackets the quartiles.");
    for row in rows {
        let error = row.error;
        let [displayed, log] = row.sphere.map_or([f64::NAN; 2], |sphere| [sphere.displayed_rmse, sphere.log_rmse]);
        let parameters = row.parameters as f64;
        table.add(&row.model, &[error.log_rmse, error.log10_rmse, error.cosine_rmse, displayed, log, parameters]);
    }
    for summary in summarise(rows).iter().filter(|summary| summary.category.is_none()) {
        table.notes.push(format!(
            "{}: mean log-RMSE {:.4}, median {:.4}, largest {:.4} over {} materials.",
            summary.model, summary.mean, summary.median, summary.largest, summary.materials
        ));
    }
    table.notes.push(DATA_STATEMENT.into());
    table
}

/// Mean log-RMSE of each model over each kind of material, as Markdown.
pub fn by_kind_markdown(rows: &[RivalRow]) -> String {
    let summaries = summarise(rows);
    let models: Vec<&str> = summaries.iter().filter(|s| s.category.is_none()).map(|s| s.model.as_str()).collect();
    let mut text =
        format!("| kind | materials | {} |\n| --- | ---: |{}\n", models.join(" | "), " ---: |".repeat(models.len()));
    let mut kinds: Vec<_> = summaries.iter().map(|summary| summary.category).collect();
    kinds.dedup();
    for kind in kinds {
        let of_kind: Vec<_> = summaries.iter().filter(|summary| summary.category == kind).collect();
        let count = of_kind.iter().map(|summary| summary.materials).max().unwrap_or(0);
        text += &format!("| {} | {count} |", kind.map_or("all", |kind| kind.label()));
        for model in &models {
            match of_kind.iter().find(|summary| summary.model == *model) {
                Some(summary) => text += &format!(" {:.3} |", summary.mean),
                None => text += " – |",
            }
        }
        text.push('\n');
    }
    text + &format!("\nMean log-RMSE. {DATA_STATEMENT}\n")
}

fn read_rows(path: &Path) -> Result<Vec<RivalRow>> {
    if !path.exists() {
        return Ok(Vec::new());
    }
    let text = std::fs::read_to_string(path).map_err(|source| Error::reading(path, source))?;
    text.lines()
        .enumerate()
        .map(|(index, line)| {
            serde_json::from_str(line).map_err(|source| {
                Error::new(ErrorKind::Malformed, format!("not a row of this study: {source}"))
                    .at(Place::Line(path.into(), index + 1))
                    .remedy("delete the file, or choose another folder")
            })
        })
        .collect()
}

fn write_rows(path: &Path, rows: &[RivalRow]) -> Result<()> {
    let mut text = String::new();
    for row in rows {
        let line = serde_json::to_string(row)
            .map_err(|source| Error::new(ErrorKind::Internal, format!("a row cannot be written: {source}")))?;
        text += &line;
        text.push('\n');
    }
    write_bytes(path, text.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measured::category::Category;
    use crate::measured::metrics::TableError;
    use crate::measured::sphere_error::SphereError;

    #[test]
    fn rows_survive_their_file_and_become_tables() {
        let row = |material: &str, model: &str, log_rmse: f64| RivalRow {
            material: material.into(),
            category: Category::of(material),
            model: model.into(),
            parameters: 8,
            error: TableError { log_rmse, cells: 3, ..Default::default() },
            sphere: Some(SphereError { displayed_rmse: 0.01, log_rmse: 0.1 }),
        };
        let rows = vec![row("steel", "A", 0.1), row("steel", "B", 0.3), row("pink-felt", "A", 0.2)];
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rivals.jsonl");
        assert!(read_rows(&path).unwrap().is_empty());
        write_rows(&path, &rows).unwrap();
        assert_eq!(read_rows(&path).unwrap(), rows);
        write_bytes(&path, b"{}\n").unwrap();
        assert!(read_rows(&path).unwrap_err().to_string().contains("line 1"));
        assert!(study_table(&rows).to_markdown().contains("A: mean log-RMSE 0.1500"));
        let kinds = by_kind_markdown(&rows);
        assert!(kinds.contains("| fabric | 1 | 0.200 | – |") && kinds.contains("neural fits"), "{kinds}");
    }
}
