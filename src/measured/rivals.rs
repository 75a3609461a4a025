//! The rivals of learned models, fitted to tables by one method and held against them by one figure.

use super::analytic::{AnalyticModel, Bivariate, Dsbrdf, LambertLobes, LobeKind, OwnLobe};
use super::category::Category;
use super::coordinates::HalfDifference;
use super::fit_model::{ModelFitSettings, fit_model};
use super::metrics::{TableError, model_error};
use super::model::ReflectanceModel;
use super::sphere_error::{SphereError, sphere_error};
use super::table::MeasuredBrdf;
use crate::error::{Error, ErrorKind, Result};
use crate::math::statistics::quantile;
use std::sync::atomic::{AtomicBool, Ordering};

/// A model that is fitted to a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Rival {
    /// Lambert + Cook-Torrance with Beckmann microfacets.
    CookTorrance,
    /// Lambert + two Cook-Torrance lobes.
    CookTorranceTwo,
    /// Lambert + GGX.
    Ggx,
    /// Lambert + Ward.
    Ward,
    /// Directional statistics, three lobes.
    Dsbrdf,
    /// The table over half and difference angle.
    Bivariate,
    /// The lobe of Patina's maps.
    OwnLobe,
}

/// A rival after its fit.
pub struct RivalFit {
    /// The model.
    pub model: Box<dyn ReflectanceModel + Send>,
    /// Its parameters.
    pub parameters: Vec<f64>,
    /// Error over all cells that count.
    pub error: TableError,
}

impl Rival {
    /// All rivals, in the order of tables.
    pub const ALL: [Rival; 7] = [
        Rival::Bivariate,
        Rival::Dsbrdf,
        Rival::CookTorranceTwo,
        Rival::CookTorrance,
        Rival::Ggx,
        Rival::Ward,
        Rival::OwnLobe,
    ];

    /// The name on the command line.
    pub fn key(self) -> &'static str {
        match self {
            Rival::CookTorrance => "cook-torrance",
            Rival::CookTorranceTwo => "cook-torrance-two",
            Rival::Ggx => "ggx",
            Rival::Ward => "ward",
            Rival::Dsbrdf => "dsbrdf",
            Rival::Bivariate => "bivariate",
            Rival::OwnLobe => "maps",
        }
    }

    /// The name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Rival::CookTorrance => "Cook-Torrance",
            Rival::CookTorranceTwo => "Cook-Torrance, 2 lobes",
            Rival::Ggx => "GGX",
            Rival::Ward => "Ward",
            Rival::Dsbrdf => "DSBRDF",
            Rival::Bivariate => "bivariate table",
            Rival::OwnLobe => "Patina's maps",
        }
    }

    /// The rival of a name on the command line. Error: no such name, with all of them.
    pub fn of_key(key: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|rival| rival.key() == key).ok_or_else(|| {
            let all: Vec<&str> = Self::ALL.iter().map(|rival| rival.key()).collect();
            Error::new(ErrorKind::InvalidSetting, format!("no model is called {key}"))
                .remedy(format!("there are {}", all.join(", ")))
        })
    }

    /// Fits the rival to a table. Errors as [`fit_model`].
    pub fn fit(self, table: &MeasuredBrdf, settings: &ModelFitSettings) -> Result<RivalFit> {
        match self {
            Rival::CookTorrance => fit_analytic(LambertLobes::new(LobeKind::CookTorrance, 1), table, settings),
            Rival::CookTorranceTwo => fit_analytic(LambertLobes::new(LobeKind::CookTorrance, 2), table, settings),
            Rival::Ggx => fit_analytic(LambertLobes::new(LobeKind::Ggx, 1), table, settings),
            Rival::Ward => fit_analytic(LambertLobes::new(LobeKind::Ward, 1), table, settings),
            Rival::Dsbrdf => fit_analytic(Dsbrdf::new(3), table, settings),
            Rival::OwnLobe => fit_analytic(OwnLobe, table, settings),
            Rival::Bivariate => {
                let parameters = Bivariate::fit(table);
                let error = model_error(&Bivariate, &parameters, table)?;
                Ok(RivalFit { model: Box::new(Bivariate), parameters, error })
            }
        }
    }
}

fn fit_analytic<M: AnalyticModel + Send + 'static>(
    model: M,
    table: &MeasuredBrdf,
    settings: &ModelFitSettings,
) -> Result<RivalFit> {
    let fit = fit_model(&model, &model.starts(table), table, settings)?;
    Ok(RivalFit { model: Box::new(model), parameters: fit.parameters, error: fit.error })
}

impl RivalFit {
    /// The whole table of the fit.
    pub fn table(&self) -> MeasuredBrdf {
        MeasuredBrdf::from_model(self.model.as_ref(), &self.parameters)
    }
}

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
    pub fn of(rival: Rival, settings: &'a ModelFitSettings) -> Self {
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
        let models = [Rival::Bivariate, Rival::Ward].map(|rival| Entrant::of(rival, &settings));
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

    #[test]
    fn keys_name_models() {
        let table = MeasuredBrdf::from_fn(|_| [0.2; 3]);
        for rival in Rival::ALL {
            assert_eq!(Rival::of_key(rival.key()).unwrap(), rival);
            let settings = ModelFitSettings { followed: 1, scouting_steps: 1, steps: 1, ..Default::default() };
            assert_eq!(rival.fit(&table, &settings).unwrap().model.name(), rival.name());
        }
        assert!(Rival::of_key("phong").unwrap_err().remedy_text().contains("dsbrdf"));
    }
}
