//! Where an estimation may begin: parameters of a model, each with a name, and what is believed of them.

use super::reflectance_step::ParameterPrior;
use super::settings::ObjectSettings;
use crate::error::Result;
use crate::measured::analytic::{LambertLobes, LobeKind};
use crate::measured::model::ReflectanceModel;
use crate::neural::model::FlowModel;
use crate::neural::weights::Trained;
use std::path::Path;
use std::sync::Arc;

/// A place to begin.
#[derive(Clone, Debug, PartialEq)]
pub struct Start {
    /// Name, such as that of a material of the library.
    pub name: String,
    /// Parameters of the model.
    pub parameters: Vec<f64>,
}

/// A model with its starts and its prior.
pub struct StartedModel {
    /// The model.
    pub model: Box<dyn ReflectanceModel + Send>,
    /// Where to begin, at least one.
    pub starts: Vec<Start>,
    /// What is believed of the parameters.
    pub prior: ParameterPrior,
}

/// Names of strengths and widths of the starts of `lobes`.
const WIDTHS: [(f64, &str); 5] =
    [(0.02, "mirror"), (0.06, "polished"), (0.15, "glossy"), (0.3, "satin"), (0.6, "rough")];
const BALANCES: [(f64, f64, f64, &str); 4] =
    [(0.5, 0.05, 0.04, "plastic"), (0.5, 1.0, 0.05, "coated"), (0.01, 1.0, 0.7, "metal"), (0.1, 0.4, 0.3, "paint")];

impl StartedModel {
    /// Lambert plus one lobe, begun from mirrors to rough metals and plastics.
    ///
    /// The weak pull keeps widths and strengths that no pixel speaks of from running away.
    pub fn lobes(kind: LobeKind) -> Self {
        let model = LambertLobes::new(kind, 1);
        let centre = model.start();
        let has_fresnel = kind != LobeKind::Ward;
        let mut starts = Vec::new();
        for (diffuse, strength, fresnel, family) in BALANCES {
            for (width, finish) in WIDTHS {
                let mut parameters = vec![f64::ln(diffuse); 3];
                parameters.extend([f64::ln(strength); 3]);
                parameters.push(f64::ln(width));
                if has_fresnel {
                    parameters.push(f64::ln(fresnel / (1.0 - fresnel)));
                }
                debug_assert_eq!(parameters.len(), model.parameter_count());
                starts.push(Start { name: format!("{finish} {family}"), parameters });
            }
        }
        let prior = ParameterPrior { weight: vec![1e-5; centre.len()], centre };
        StartedModel { model: Box::new(model), starts, prior }
    }
}

/// Models that can be named.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum ModelKind {
    /// The invertible neural model, begun from the codes of its library.
    #[default]
    Ibrdf,
    /// Lambert and a Cook-Torrance lobe.
    CookTorrance,
    /// Lambert and a GGX lobe.
    Ggx,
    /// Lambert and Ward's lobe.
    Ward,
}

impl StartedModel {
    /// The model of a kind. `weights` and `lobes` are for the neural one; without weights it takes those that ship.
    ///
    /// # Errors
    /// Weights that are missing or damaged.
    pub fn of(kind: ModelKind, weights: Option<&Path>, lobes: usize, settings: &ObjectSettings) -> Result<Self> {
        let read = || weights.map_or_else(crate::neural::shipped, Trained::read).map(Arc::new);
        Self::without(kind, &read, lobes, settings, &[])
    }

    /// [`StartedModel::of`] without the starts of some materials: for studies that estimate these. `weights` is asked
    /// only for the neural model.
    ///
    /// # Errors
    /// Those of `weights`.
    pub fn without(
        kind: ModelKind,
        weights: &dyn Fn() -> Result<Arc<Trained>>,
        lobes: usize,
        settings: &ObjectSettings,
        without: &[String],
    ) -> Result<Self> {
        match kind {
            ModelKind::CookTorrance => Ok(StartedModel::lobes(LobeKind::CookTorrance)),
            ModelKind::Ggx => Ok(StartedModel::lobes(LobeKind::Ggx)),
            ModelKind::Ward => Ok(StartedModel::lobes(LobeKind::Ward)),
            ModelKind::Ibrdf => Ok(StartedModel::neural(weights()?, lobes, settings.code_weight, without)),
        }
    }

    /// The neural model, begun from every material of its library but those named.
    ///
    /// The prior is that of the paper, a normal distribution of the codes around 0; colours are free.
    pub fn neural(trained: Arc<Trained>, lobes: usize, code_weight: f64, without: &[String]) -> Self {
        let model = FlowModel::new(Arc::clone(&trained), lobes);
        let names = trained.account.materials.iter().filter(|name| !without.contains(name));
        let mut starts: Vec<Start> =
            names.filter_map(|name| Some(Start { name: name.clone(), parameters: model.of_material(name)? })).collect();
        if starts.is_empty() {
            starts.push(Start { name: "middle".into(), parameters: model.start() });
        }
        let count = model.parameter_count();
        let codes = model.code_parameters();
        let weight = (0..count).map(|index| if index < codes { code_weight } else { 0.0 }).collect();
        let prior = ParameterPrior { weight, centre: vec![0.0; count] };
        StartedModel { model: Box::new(model), starts, prior }
    }
}
