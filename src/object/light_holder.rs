//! What holds the light through all rounds of an estimation: its prior, and the net of the deep one.

use super::light_step::{DeepTie, LightTerms, NewtonBudget, newton};
use super::matrices::LightMatrix;
use super::prior::deep::DeepPrior;
use super::prior::gradient::GradientPrior;
use super::prior::{LightPriorKind, LogLight};
use super::problem::ObjectProblem;
use super::settings::{LightMethod, ObjectSettings};
use crate::error::Result;

/// Width of an edge for the gradient prior, in natural logarithms.
const EDGE_WIDTH: f32 = 0.05;
/// Steps of Newton, at most, on a light that nothing was known of.
const FIRST_STEPS: usize = 25;

/// What holds the light through all rounds.
#[derive(Default)]
pub(super) struct LightHolder {
    pub terms: LightTerms,
    pub deep: Option<DeepTie>,
}

impl LightHolder {
    /// The priors that the settings ask for, for an estimation that begins with `light`; `is_alone` when nothing but
    /// the light is unknown.
    ///
    /// # Errors
    /// A size for which there is no net.
    pub fn new(settings: &ObjectSettings, is_alone: bool, light: &LogLight) -> Result<Self> {
        let (width, height) = (light.width, light.height);
        let mut holder = LightHolder::default();
        match settings.prior {
            LightPriorKind::None => {}
            LightPriorKind::Gradient => holder.terms = gradient_terms(width, height, settings),
            LightPriorKind::Deep => {
                let mut prior = DeepPrior::new(width, height, settings.net_channels, settings.seed)?;
                prior.offset = light.mean().map(|mean| mean as f32);
                let (net_steps, rate) = (settings.net_steps, settings.net_rate);
                let weight = if is_alone { settings.net_weight } else { settings.net_weight_of_both };
                let mut tie = DeepTie { prior, weight, net_steps, rate };
                // Beside a reflectance that is wrong at first, what a light says in detail is wrong, too: a net that knows
                // nothing takes it back, and lights of both together end better by it.
                if is_alone && settings.method == LightMethod::ClosedForm {
                    tie.warm(light);
                }
                holder.deep = Some(tie);
            }
        }
        Ok(holder)
    }

    /// Where an estimation with a known reflectance begins: an even light, and but for the schedule as released the one
    /// that the gradient prior makes of it.
    pub fn first_light(problem: &ObjectProblem, matrix: &LightMatrix, settings: &ObjectSettings) -> LogLight {
        let (width, height) = settings.light_size();
        let mut light = problem.even_light(matrix, width, height);
        if settings.method == LightMethod::ClosedForm && settings.prior == LightPriorKind::Deep {
            let terms = gradient_terms(width, height, settings);
            let budget = NewtonBudget { steps: FIRST_STEPS, products: settings.light_products };
            newton(matrix, &problem.likelihood, &terms, &mut light, budget);
        }
        light
    }
}

fn gradient_terms(width: usize, height: usize, settings: &ObjectSettings) -> LightTerms {
    let weight = settings.gradient_weight;
    let gradient = Some(GradientPrior::new(width, height, weight, EDGE_WIDTH)).filter(|_| weight > 0.0);
    LightTerms { gradient, ..LightTerms::default() }
}
