//! From a summed gradient to moved numbers, and away from a start that has none.

use super::adam::TexelRates;
use super::event::FitEvent;
use super::fitter::Fitter;
use super::light_prior;
use super::schedule::{Stage, StageKind};
use super::settings::Start;
use super::step_sums::StepSums;
use crate::math::sphere::solid_angle_of_texel;

/// Step size of the logarithm of a view's gain.
const RATE_GAIN: f32 = 0.01;
/// Steps of the light are relative to its mean radiance, and to at least this share of the photos' mean.
const LEAST_LIGHT: f32 = 0.5;

impl Fitter {
    /// Detects the paper's start, diffuse 0 under light 0, and leaves it. `true` when it did.
    ///
    /// There the gradient by the maps is exactly zero, and so is that by the light but for pixels that show the
    /// background and for the grazing part of a lobe that is already on. Those few would raise the light first and the
    /// maps after it, but from far behind: it is left in every case.
    pub(super) fn leave_saddle(&mut self) -> bool {
        if self.settings.start != Start::Paper {
            return false;
        }
        let Some(work) = &self.work else { return false };
        let norm =
            |numbers: &mut dyn Iterator<Item = f32>| numbers.map(|d| f64::from(d) * f64::from(d)).sum::<f64>().sqrt();
        let maps =
            norm(&mut work.gradient.texels.levels[0].texels.iter().flat_map(|texel| texel.d_material.to_array()));
        let light = norm(&mut work.gradient.light.iter().flatten().copied());
        let black = self.state.light.iter().all(|radiance| *radiance == [0.0; 3]);
        if !black || maps > 0.0 || self.state.events.iter().any(FitEvent::is_of_saddle) {
            return false;
        }
        self.state.events.push(FitEvent::saddle_left(maps, light));
        let values = self.measured_start();
        self.begin_from(values, None);
        true
    }

    /// Moves texels, light and gains along the summed gradient.
    pub(super) fn move_parameters(&mut self, stage: &Stage, sums: &StepSums) {
        let Some(work) = &mut self.work else { return };
        let rate = stage.rate(self.state.step_in_stage, self.settings.final_rate);
        let free = if stage.kind == StageKind::Diffuse { 0.0 } else { rate };
        let rates = TexelRates {
            diffuse: rate * self.settings.rate_diffuse,
            specular: free * self.settings.rate_specular,
            log_width: free * self.settings.rate_roughness,
        };
        let base = &mut work.gradient.texels.levels[0].texels;
        let texels = self.state.moments.step_texels(&mut self.state.texels, base, rates);
        let mut light = 0;
        if self.settings.fixed_light {
            work.gradient.light.fill([0.0; 3]);
        } else {
            // Off a black light as well: there a step relative to the light's own mean would be none.
            let mean = mean_radiance(&self.state.light, work.parameters.environment_size)
                .max(LEAST_LIGHT * work.mean_of_photos);
            let rate = rate * self.settings.rate_light;
            let (weight, d_light) = (self.settings.light_smoothness, &mut work.gradient.light);
            let size = work.parameters.environment_size;
            light_prior::add_gradient(&self.state.light, size, mean, weight, d_light);
            light = self.state.light_moments.step_light(&mut self.state.light, &mut work.gradient.light, mean, rate);
        }
        work.parameters.texels.levels[0].texels.clone_from(&self.state.texels);
        work.parameters.texels.rebuild(&work.weights);
        work.parameters.light.clone_from(&self.state.light);
        if self.settings.exposure {
            for &(view, d_gain) in &sums.gain_derivatives {
                let gain = self.state.log_gains[view].exp();
                let direction = self.state.gain_moments.direction_of(view, d_gain * gain);
                self.state.log_gains[view] -= rate * RATE_GAIN * direction;
            }
            // The mean logarithm stays zero: a common gain belongs to the light.
            let mean =
                self.training.iter().map(|&view| self.state.log_gains[view]).sum::<f32>() / self.training.len() as f32;
            for &view in &self.training {
                self.state.log_gains[view] -= mean;
            }
        }
        for (name, count) in &sums.non_finite {
            self.state.count_non_finite(name.clone(), *count);
        }
        for (name, count) in [("gradient of a texel", texels), ("gradient of the light", light)] {
            if count > 0 {
                self.state.count_non_finite(name.into(), count as u64);
            }
        }
    }
}

/// Mean over the sphere of directions and the channels.
fn mean_radiance(light: &[[f32; 3]], (width, height): (usize, usize)) -> f32 {
    let sum: f64 = light
        .iter()
        .enumerate()
        .map(|(index, radiance)| {
            solid_angle_of_texel(index / width, width, height) * f64::from(radiance.iter().sum::<f32>())
        })
        .sum();
    (sum / 3.0 / (4.0 * std::f64::consts::PI)) as f32
}
