//! What figure 2 holds against each other: the neural model in its ways, and its rivals.

use crate::error::Result;
use crate::lab::neural::own_net::{self, OwnNetSettings, fit_own_net};
use crate::measured::baseline::Baseline;
use crate::measured::fit_model::ModelFitSettings;
use crate::measured::metrics::TableError;
use crate::measured::model::ReflectanceModel;
use crate::measured::table::MeasuredBrdf;
use crate::neural::fit::{FlowFitSettings, fit_table};
use crate::neural::{FlowModel, Trained};
use std::sync::Arc;

/// Name of the neural model that was trained on all materials.
pub(super) const SEEN: &str = "iBRDF";
/// Name of the neural model on materials it has not seen.
pub(super) const LEFT_OUT: &str = "iBRDF, left out";

/// Name of the shaped weights that were trained on all materials.
pub(super) const SHAPED: &str = "iBRDF, shaped";
/// Name of shaped weights on materials they have not seen.
pub(super) const SHAPED_LEFT_OUT: &str = "iBRDF, shaped, left out";

/// Name of further weights on materials they have not seen: their size and what they were trained on.
pub(super) fn name_of_left_out(trained: &Trained) -> String {
    let account = &trained.account;
    let (size, materials) = (&account.architecture.name, account.materials.len());
    format!("{LEFT_OUT}, {size}, {materials} materials, {} steps", account.step)
}

/// What is fitted.
#[derive(Clone)]
pub(super) enum Contender {
    /// Codes and colours, the weights held.
    Flow(String, Arc<Trained>),
    /// All weights.
    OwnNet(Arc<Trained>),
    Baseline(Baseline),
}

impl Contender {
    /// Its name in the table.
    pub fn name(&self) -> &str {
        match self {
            Contender::Flow(name, _) => name,
            Contender::OwnNet(_) => own_net::NAME,
            Contender::Baseline(rival) => rival.name(),
        }
    }

    /// Parameters and error. A quick study fits the neural model by fewer points and steps.
    pub fn fit(&self, table: &MeasuredBrdf, quick: bool) -> Result<(usize, TableError)> {
        match self {
            Contender::Flow(_, trained) => {
                let model = FlowModel::new(Arc::clone(trained), trained.account.architecture.usual_lobes());
                let settings = match quick {
                    true => FlowFitSettings { columns: 120, steps: 120, ..FlowFitSettings::default() },
                    false => FlowFitSettings::of(&trained.account.architecture),
                };
                let found = fit_table(&model, table, &settings)?;
                Ok((model.parameter_count(), found.error))
            }
            Contender::OwnNet(trained) => {
                let settings = match quick {
                    true => OwnNetSettings { steps: 300, rounds: 1, ..OwnNetSettings::default() },
                    false => OwnNetSettings::default(),
                };
                let found = fit_own_net(trained, table, &settings)?;
                Ok((found.parameter_count(), found.error))
            }
            Contender::Baseline(rival) => {
                let found = rival.fit(table, &ModelFitSettings::default())?;
                Ok((found.model.parameter_count(), found.error))
            }
        }
    }
}
