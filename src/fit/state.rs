//! What a fit changes, and its history: all that a checkpoint holds.

use super::adam::Moments;
use super::event::FitEvent;
use super::schedule::{Stage, revised};
use super::settings::FitSettings;
use super::solver::TexelVariance;
use crate::error::Result;
use crate::material::Material;
use serde::{Deserialize, Serialize};

/// One line of the loss history.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LossRow {
    /// Step, counted from 1 over all stages.
    pub step: usize,
    /// Name of the stage.
    pub stage: String,
    /// Seconds of work since the fit began, pauses left out.
    pub seconds: f64,
    /// The loss that was minimised, without the wish for a smooth light.
    pub loss: f64,
    /// Its part from the pictures: mean squared error in linear radiance. Unbiased, hence now and then below zero.
    pub image_loss: f64,
    /// Disagreement of the views in [0, 1]; 0 when it is not measured.
    pub consistency: f64,
    /// Root mean squared error over the unclipped surface pixels of the step's views, as held-out views are judged: the
    /// loss itself counts background and clipped pixels too. `None` where there was none.
    #[serde(default)]
    pub surface_rmse: Option<f64>,
    /// Root mean squared error over held-out views, in the steps that look at them.
    pub held_out_rmse: Option<f64>,
}

/// Everything a fit changes: what a checkpoint holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FitState {
    /// The stages, those that are done and those to come: numbers of steps may change on the way.
    pub plan: Vec<Stage>,
    /// Index of the stage in the plan; its length at the end.
    pub stage: usize,
    /// Steps done in the stage.
    pub step_in_stage: usize,
    /// Steps done in all.
    pub step: usize,
    /// Width and height of the maps.
    pub map_size: usize,
    /// Texels of the maps.
    pub texels: Vec<Material<f32>>,
    /// Moments of the texels under Adam.
    pub moments: Moments,
    /// What the solver knows of each texel, see [`Estimate::variances`](crate::fit::solver::Estimate::variances); empty
    /// before its first step and under Adam.
    pub variances: Vec<TexelVariance>,
    /// Radiance of the light's texels.
    pub light: Vec<[f32; 3]>,
    /// Relative standard deviation of the factor that light and reflectance have in common, as the solver's last step
    /// left it; `f64::MAX` where the photos leave it open. `None` before the first, under a known light and under
    /// Adam.
    pub light_scale_deviation: Option<f64>,
    /// Moments of the light.
    pub light_moments: Moments,
    /// Logarithm of each view's gain.
    pub log_gains: Vec<f32>,
    /// Moments of the gains.
    pub gain_moments: Moments,
    /// The curve so far.
    pub losses: Vec<LossRow>,
    /// Non-finite numbers by name and count.
    pub non_finite: Vec<(String, u64)>,
    /// What happened that the user should know.
    pub events: Vec<FitEvent>,
    /// Seconds of work so far.
    pub seconds: f64,
}

impl FitState {
    /// Takes over the plan of other numbers of steps; the state is as it was when that fails.
    pub(super) fn replan(&mut self, settings: &FitSettings) -> Result<()> {
        let plan = revised(settings, &self.plan, self.stage, self.step_in_stage)?;
        // A fit that had ended goes on in its last stage when that was made longer.
        if let (true, Some(last)) = (self.stage >= self.plan.len(), self.plan.last()) {
            let number = self.plan.len() - 1;
            if plan.get(number).is_some_and(|stage| stage.steps > last.steps) {
                self.stage = number;
                self.step_in_stage = last.steps;
            }
        }
        self.plan = plan;
        Ok(())
    }

    /// Keeps what a round on the light left open of its scale, as a number a checkpoint can hold.
    pub(super) fn keep_light_scale_deviation(&mut self, deviation: f64) {
        self.light_scale_deviation = Some(deviation.min(f64::MAX));
    }

    /// What [`Self::keep_light_scale_deviation`] was given: infinite where the photos leave the scale open.
    pub(super) fn told_light_scale_deviation(&self) -> Option<f64> {
        self.light_scale_deviation.map(|deviation| if deviation < f64::MAX { deviation } else { f64::INFINITY })
    }

    /// Counts numbers that were not finite, under a name that says where and what they were.
    pub(super) fn count_non_finite(&mut self, name: String, count: u64) {
        match self.non_finite.iter_mut().find(|(known, _)| *known == name) {
            Some((_, total)) => *total += count,
            None => self.non_finite.push((name, count)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_open_scale_of_the_light_is_told_as_open() {
        let mut state = FitState::default();
        assert_eq!(state.told_light_scale_deviation(), None);
        for deviation in [0.0, 0.05, f64::INFINITY] {
            state.keep_light_scale_deviation(deviation);
            assert!(state.light_scale_deviation.is_some_and(f64::is_finite), "a checkpoint cannot hold {state:?}");
            assert_eq!(state.told_light_scale_deviation(), Some(deviation));
        }
    }
}
