//! The rivals of learned models, fitted to tables by one method and held against them by one figure.

use crate::error::{Error, ErrorKind, Result};
use crate::math::statistics::quantile;
use crate::measured::baseline::Baseline;
use crate::measured::category::Category;
use crate::measured::coordinates::HalfDifference;
use crate::measured::fit_model::ModelFitSettings;
use crate::measured::metrics::TableError;
use crate::measured::sphere_error::{SphereError, sphere_error};
use crate::measured::table::MeasuredBrdf;
use std::sync::atomic::{AtomicBool, Ordering};

/// One model's error on one material.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct RivalRow {
    /// Name of the material.
    pub material: String,
    /// Its kind.
    pub category: Category,
    /// Name of the model.
    pub model: String,
    /// Parameters of the model.
    pub parameters: usize,
    /// Error over all cells that count.
    pub error: TableError,
    /// Error of the picture of a sphere, where it was asked for.
    #[serde(default)]
    pub sphere: Option<SphereError>,
}

/// Fits one model to a table.
pub type Fitter<'a> = dyn Fn(&MeasuredBrdf) -> Result<EntrantFit> + 'a;

/// A model under its name in tables, and how it is fitted: a rival, or a learned model, of which this layer knows nothing.
pub struct Entrant<'a> {
    /// The name.
    pub name: &'a str,
    /// Fits it to a table.
    pub fit: Box<Fitter<'a>>,
}

/// What came of a fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EntrantFit {
    /// Numbers that were fitted.
    pub parameters: usize,
    /// Error over all cells that count.
    pub error: TableError,
    /// Error of the picture of a sphere.
    pub sphere: SphereError,
}

impl<'a> Entrant<'a> {
    /// A rival as an entrant.
    pub fn of(rival: Baseline, settings: &'a ModelFitSettings) -> Self {
        let fit = move |table: &MeasuredBrdf| -> Result<EntrantFit> {
            let found = rival.fit(table, settings)?;
            let value = |at: HalfDifference| {
                let mut values = [[0.0; 3]];
                found.model.evaluate(&found.parameters, &[at], &mut values);
                values[0]
            };
            let (parameters, sphere) = (found.model.parameter_count(), sphere_error(&value, table)?);
            Ok(EntrantFit { parameters, error: found.error, sphere })
        };
        Entrant { name: rival.name(), fit: Box::new(fit) }
    }
}

/// Fits every model to every material: a row for each pair, material by material. `table_of` makes the table of a
/// material when its turn comes, so that one table is held at a time; `tell` hears each new row. Pairs in `known` are
/// taken over: a study that was stopped goes on there. Stops, with an error, when `stop` is set.
pub fn rival_table(
    materials: &[&str],
    models: &[Entrant],
    known: &[RivalRow],
    table_of: &dyn Fn(&str) -> Result<MeasuredBrdf>,
    stop: &AtomicBool,
    tell: &mut dyn FnMut(&RivalRow) -> Result<()>,
) -> Result<Vec<RivalRow>> {
    let mut rows = Vec::with_capacity(materials.len() * models.len());
    for material in materials {
        let mut table = None;
        for entrant in models {
            if stop.load(Ordering::Relaxed) {
                return Err(Error::new(ErrorKind::Stopped, "stopped").remedy("ask again for the same folder to go on"));
            }
            if let Some(row) = known.iter().find(|row| row.material == *material && row.model == entrant.name) {
                rows.push(row.clone());
                continue;
            }
            let table = match &mut table {
                Some(table) => table,
                empty => empty.insert(table_of(material)?),
            };
            let fit = (entrant.fit)(table)?;
            let row = RivalRow {
                material: (*material).into(),
                category: Category::of(material),
                model: entrant.name.into(),
                parameters: fit.parameters,
                error: fit.error,
                sphere: Some(fit.sphere),
            };
            tell(&row)?;
            rows.push(row);
        }
    }
    Ok(rows)
}

/// The figures of one model over some materials.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct ModelSummary {
    /// Name of the model.
    pub model: String,
    /// Kind of material; `None` for all.
    pub category: Option<Category>,
    /// Number of materials.
    pub materials: usize,
    /// Mean of the main figure.
    pub mean: f64,
    /// Median of the main figure.
    pub median: f64,
    /// Quartiles of the main figure.
    pub quartiles: (f64, f64),
    /// Largest of the main figure.
    pub largest: f64,
}

/// The figures of each model over all materials, then over each kind that occurs; models in the order of the rows.
pub fn summarise(rows: &[RivalRow]) -> Vec<ModelSummary> {
    let mut models: Vec<&str> = Vec::new();
    for row in rows {
        if !models.contains(&row.model.as_str()) {
            models.push(&row.model);
        }
    }
    let mut summaries = Vec::new();
    for category in std::iter::once(None).chain(Category::ALL.into_iter().map(Some)) {
        for model in &models {
            let of_both = |row: &&RivalRow| row.model == *model && category.is_none_or(|c| c == row.category);
            let values: Vec<f64> = rows.iter().filter(of_both).map(|row| row.error.log_rmse).collect();
            if !values.is_empty() {
                summaries.push(ModelSummary {
                    model: (*model).into(),
                    category,
                    materials: values.len(),
                    mean: values.iter().sum::<f64>() / values.len() as f64,
                    median: quantile(&values, 0.5),
                    quartiles: (quantile(&values, 0.25), quantile(&values, 0.75)),
                    largest: values.iter().copied().fold(0.0, f64::max),
                });
            }
        }
    }
    summaries
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_of_rivals_has_a_row_a_pair_and_can_be_stopped() {
        let table_of = |name: &str| {
            let strength = if name == "steel" { 5.0 } else { 0.1 };
            Ok(MeasuredBrdf::from_fn(|at| [0.1 + strength * (-(at.theta_half / 0.2).powi(2)).exp(); 3]))
        };
        // Few steps: what is asked is which rows there are.
        let settings = ModelFitSettings { followed: 1, scouting_steps: 2, steps: 4, ..Default::default() };
        let models = [Baseline::Bivariate, Baseline::Ward].map(|rival| Entrant::of(rival, &settings));
        let stop = AtomicBool::new(false);
        let mut told = 0;
        let mut study = |known: &[RivalRow], stop: &AtomicBool| {
            rival_table(&["steel", "red-fabric"], &models, known, &table_of, stop, &mut |_| {
                told += 1;
                Ok(())
            })
        };
        let rows = study(&[], &stop).unwrap();
        assert_eq!(rows.len(), 4);
        // What is known is not fitted again, and comes in its place.
        assert_eq!(study(&rows[1..3], &stop).unwrap(), rows);
        assert!(rows.iter().filter(|row| row.model == "bivariate table").all(|row| row.error.log_rmse < 1e-9));
        assert!(rows.iter().all(|row| row.sphere.is_some_and(|sphere| sphere.log_rmse < 2.0)));
        let summary = summarise(&rows);
        assert_eq!(summary.len(), 2 + 4);
        assert_eq!((summary[1].model.as_str(), summary[1].materials), ("Ward", 2));
        stop.store(true, Ordering::Relaxed);
        assert_eq!(study(&[], &stop).unwrap_err().kind(), ErrorKind::Stopped);
        assert_eq!(told, 4 + 2);
    }
}
