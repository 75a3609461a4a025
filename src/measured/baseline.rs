//! The baselines of learned models: reflectance models of few parameters, fitted to tables by one method.

use super::analytic::{AnalyticModel, Bivariate, Dsbrdf, LambertLobes, LobeKind, OwnLobe};
use super::fit_model::{ModelFitSettings, fit_model};
use super::metrics::{TableError, model_error};
use super::model::ReflectanceModel;
use super::table::MeasuredBrdf;
use crate::error::{Error, ErrorKind, Result};

/// A model of few parameters that is fitted to a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Baseline {
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

/// A baseline after its fit.
pub struct BaselineFit {
    /// The model.
    pub model: Box<dyn ReflectanceModel + Send>,
    /// Its parameters.
    pub parameters: Vec<f64>,
    /// Error over all cells that count.
    pub error: TableError,
}

impl Baseline {
    /// All baselines, in the order of tables.
    pub const ALL: [Baseline; 7] = [
        Baseline::Bivariate,
        Baseline::Dsbrdf,
        Baseline::CookTorranceTwo,
        Baseline::CookTorrance,
        Baseline::Ggx,
        Baseline::Ward,
        Baseline::OwnLobe,
    ];

    /// The name on the command line.
    pub fn key(self) -> &'static str {
        match self {
            Baseline::CookTorrance => "cook-torrance",
            Baseline::CookTorranceTwo => "cook-torrance-two",
            Baseline::Ggx => "ggx",
            Baseline::Ward => "ward",
            Baseline::Dsbrdf => "dsbrdf",
            Baseline::Bivariate => "bivariate",
            Baseline::OwnLobe => "maps",
        }
    }

    /// The name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Baseline::CookTorrance => "Cook-Torrance",
            Baseline::CookTorranceTwo => "Cook-Torrance, 2 lobes",
            Baseline::Ggx => "GGX",
            Baseline::Ward => "Ward",
            Baseline::Dsbrdf => "DSBRDF",
            Baseline::Bivariate => "bivariate table",
            Baseline::OwnLobe => "Patina's maps",
        }
    }

    /// The baseline of a name on the command line. Error: no such name, with all of them.
    pub fn of_key(key: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|baseline| baseline.key() == key).ok_or_else(|| {
            let all: Vec<&str> = Self::ALL.iter().map(|baseline| baseline.key()).collect();
            Error::new(ErrorKind::InvalidSetting, format!("no model is called {key}"))
                .remedy(format!("there are {}", all.join(", ")))
        })
    }

    /// Fits the baseline to a table. Errors as [`fit_model`].
    pub fn fit(self, table: &MeasuredBrdf, settings: &ModelFitSettings) -> Result<BaselineFit> {
        match self {
            Baseline::CookTorrance => fit_analytic(LambertLobes::new(LobeKind::CookTorrance, 1), table, settings),
            Baseline::CookTorranceTwo => fit_analytic(LambertLobes::new(LobeKind::CookTorrance, 2), table, settings),
            Baseline::Ggx => fit_analytic(LambertLobes::new(LobeKind::Ggx, 1), table, settings),
            Baseline::Ward => fit_analytic(LambertLobes::new(LobeKind::Ward, 1), table, settings),
            Baseline::Dsbrdf => fit_analytic(Dsbrdf::new(3), table, settings),
            Baseline::OwnLobe => fit_analytic(OwnLobe, table, settings),
            Baseline::Bivariate => {
                let parameters = Bivariate::fit(table);
                let error = model_error(&Bivariate, &parameters, table)?;
                Ok(BaselineFit { model: Box::new(Bivariate), parameters, error })
            }
        }
    }
}

fn fit_analytic<M: AnalyticModel + Send + 'static>(
    model: M,
    table: &MeasuredBrdf,
    settings: &ModelFitSettings,
) -> Result<BaselineFit> {
    let fit = fit_model(&model, &model.starts(table), table, settings)?;
    Ok(BaselineFit { model: Box::new(model), parameters: fit.parameters, error: fit.error })
}

impl BaselineFit {
    /// The whole table of the fit.
    pub fn table(&self) -> MeasuredBrdf {
        MeasuredBrdf::from_model(self.model.as_ref(), &self.parameters)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_name_models() {
        let table = MeasuredBrdf::from_fn(|_| [0.2; 3]);
        for baseline in Baseline::ALL {
            assert_eq!(Baseline::of_key(baseline.key()).unwrap(), baseline);
            let settings = ModelFitSettings { followed: 1, scouting_steps: 1, steps: 1, ..Default::default() };
            assert_eq!(baseline.fit(&table, &settings).unwrap().model.name(), baseline.name());
        }
        assert!(Baseline::of_key("phong").unwrap_err().remedy_text().contains("dsbrdf"));
    }
}
