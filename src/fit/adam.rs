//! Adam (Kingma and Ba 2015) for maps of which a step sees only a part.
//!
//! A texel that no pixel of a step touched keeps value and moments; its bias correction counts its own updates only.
//! So texels that nobody sees never move, and a texel seen rarely is not pushed by stale momentum.

use crate::material::lobe::MIN_WIDTH;
use crate::material::{Material, TexelGradient};
use crate::math::adam::{Decay, LARGEST_GRADIENT};
use rayon::prelude::*;

/// The second moment forgets sooner than in the paper: a fit is a few hundred steps.
const DECAY: Decay = Decay { first: 0.9, second: 0.99 };
/// Added to the root of the second moment, relative to nothing: gradients of a mean over 10^6 pixels are about 1e-8.
const EPSILON: f32 = 1e-16;

/// Moments of groups of up to seven numbers: those of a texel of the maps, a texel of the light, a gain.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Moments {
    /// Mean of the gradient.
    pub first: Vec<[f32; 7]>,
    /// Mean of the squared gradient.
    pub second: Vec<[f32; 7]>,
    /// How often each group was updated: a whole number.
    pub updates: Vec<f32>,
}

/// Step sizes of the seven numbers of a texel; zero keeps a number as it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TexelRates {
    /// Of diffuse reflectance.
    pub diffuse: f32,
    /// Of specular reflectance.
    pub specular: f32,
    /// Of the logarithm of the microfacet width.
    pub log_width: f32,
}

impl Moments {
    /// Moments of `count` groups, all zero.
    pub fn zeros(count: usize) -> Self {
        Moments { first: vec![[0.0; 7]; count], second: vec![[0.0; 7]; count], updates: vec![0.0; count] }
    }

    /// Whether these are moments of `count` groups.
    pub fn is_of(&self, count: usize) -> bool {
        [self.first.len(), self.second.len(), self.updates.len()] == [count; 3]
    }

    /// Moves the texels that a gradient touched, and clears the gradient. Values are projected to their ranges after
    /// the step; the projection does not enter the gradient, so a value leaves its bound as soon as the photos ask.
    /// Returns the number of gradients that were not finite and were left out.
    pub fn step_texels(
        &mut self,
        texels: &mut [Material<f32>],
        gradient: &mut [TexelGradient<f32>],
        rates: TexelRates,
    ) -> usize {
        let rate_of = |number: usize| match number {
            0..3 => rates.diffuse,
            3..6 => rates.specular,
            _ => rates.log_width,
        };
        let log_min = MIN_WIDTH.ln();
        texels
            .par_iter_mut()
            .zip(gradient)
            .zip(&mut self.first)
            .zip(&mut self.second)
            .zip(&mut self.updates)
            .with_min_len(4096)
            .map(|((((texel, gradient), first), second), updates)| {
                if gradient.evidence == 0.0 {
                    return 0;
                }
                let own = std::mem::take(gradient);
                if !is_sound(&own) {
                    return 1;
                }
                let corrections = count_update(updates);
                let (mut numbers, d_numbers) = (texel.to_array(), own.d_material.to_array());
                for number in 0..7 {
                    let moments = (&mut first[number], &mut second[number]);
                    let direction = update(d_numbers[number], moments, corrections);
                    let moved = numbers[number] - rate_of(number) * direction;
                    numbers[number] = if number == 6 { moved.clamp(log_min, 0.0) } else { moved.clamp(0.0, 1.0) };
                }
                *texel = Material::from_array(numbers);
                0
            })
            .sum()
    }

    /// Moves the light along relative steps: `L += rate (mean + L) direction`, so that a sun grows by a share of itself
    /// while a dark texel still moves. The second moment is half the texel's own and half that of all texels together:
    /// a texel of which the step says little moves little, where plain Adam would give its noise a full step. Values
    /// stay at or above zero. Clears the gradient and returns the number of gradients that were not finite.
    pub fn step_light(&mut self, light: &mut [[f32; 3]], gradient: &mut [[f32; 3]], mean: f32, rate: f32) -> usize {
        let mut left_out = 0;
        let mut touched = vec![None; light.len()];
        for (index, gradient) in gradient.iter_mut().enumerate() {
            let own = std::mem::take(gradient);
            // The derivative by a relative change of the texel.
            let relative: [f32; 3] = std::array::from_fn(|channel| own[channel] * (mean + light[index][channel]));
            if relative.iter().all(|value| value.abs() < LARGEST_GRADIENT) {
                let corrections = count_update(&mut self.updates[index]);
                for channel in 0..3 {
                    let (first, second) = (&mut self.first[index], &mut self.second[index]);
                    DECAY.accumulate(relative[channel], &mut first[channel], &mut second[channel]);
                }
                touched[index] = Some(corrections);
            } else {
                left_out += 1;
            }
        }
        let second = self.second.iter().flat_map(|second| &second[..3]).map(|&value| f64::from(value));
        let shared = (second.sum::<f64>() / (3 * light.len().max(1)) as f64) as f32;
        for (index, radiance) in light.iter_mut().enumerate() {
            let Some(corrections) = touched[index] else { continue };
            for channel in 0..3 {
                let second = 0.5 * (self.second[index][channel] + shared);
                let direction =
                    self.first[index][channel] * corrections.0 / ((second * corrections.1).sqrt() + EPSILON);
                radiance[channel] = (radiance[channel] - rate * (mean + radiance[channel]) * direction).max(0.0);
            }
        }
        left_out
    }

    /// One plain number, the first of a group: returns its step before the rate.
    pub fn direction_of(&mut self, group: usize, gradient: f32) -> f32 {
        let corrections = count_update(&mut self.updates[group]);
        update(gradient, (&mut self.first[group][0], &mut self.second[group][0]), corrections)
    }
}

/// Whether a gradient is finite and of a size that moments can hold.
fn is_sound(own: &TexelGradient<f32>) -> bool {
    let mut numbers = own.d_material.to_array().into_iter().chain([own.evidence]);
    numbers.all(|value| value.abs() < LARGEST_GRADIENT)
}

/// Counts an update of a group and returns the corrections of both moments.
fn count_update(updates: &mut f32) -> (f32, f32) {
    *updates += 1.0;
    (1.0 / (1.0 - DECAY.first.powf(*updates)), 1.0 / (1.0 - DECAY.second.powf(*updates)))
}

/// Takes a gradient into both moments and returns the direction of the step.
#[inline(always)]
fn update(gradient: f32, (first, second): (&mut f32, &mut f32), corrections: (f32, f32)) -> f32 {
    DECAY.accumulate(gradient, first, second);
    *first * corrections.0 / ((*second * corrections.1).sqrt() + EPSILON)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn untouched_texels_do_not_move_and_touched_ones_reach_their_goal() {
        let mut texels = vec![Material::from_array([0.5f32; 7]); 2];
        texels[0].log_width = -1.0;
        let start = texels[1];
        let goal = [0.2, 0.9, 0.4, 0.0, 1.0, 0.3, -2.0];
        let mut moments = Moments::zeros(2);
        let rates = TexelRates { diffuse: 0.02, specular: 0.02, log_width: 0.05 };
        for step in 0..600 {
            let mut gradient = vec![TexelGradient::default(); 2];
            let numbers = texels[0].to_array();
            let d_numbers = std::array::from_fn(|number| 1e-7 * (numbers[number] - goal[number]));
            gradient[0] = TexelGradient { d_material: Material::from_array(d_numbers), evidence: 1.0 };
            let fade = 1.0 - step as f32 / 600.0;
            let rates = TexelRates {
                diffuse: rates.diffuse * fade,
                specular: rates.specular * fade,
                log_width: rates.log_width * fade,
            };
            assert_eq!(moments.step_texels(&mut texels, &mut gradient, rates), 0);
            assert_eq!(gradient[0], TexelGradient::default(), "the gradient is cleared");
        }
        assert_eq!(texels[1], start);
        for (number, (value, goal)) in texels[0].to_array().into_iter().zip(goal).enumerate() {
            assert!((value - goal).abs() < 2e-3, "{number}: {value}");
        }
    }

    #[test]
    fn a_gradient_that_is_not_finite_is_counted_and_left_out() {
        let mut texels = vec![Material::from_array([0.5f32; 7])];
        let mut gradient = vec![TexelGradient { d_material: Material::from_array([f32::NAN; 7]), evidence: f32::NAN }];
        let mut moments = Moments::zeros(1);
        let rates = TexelRates { diffuse: 0.1, specular: 0.1, log_width: 0.1 };
        assert_eq!(moments.step_texels(&mut texels, &mut gradient, rates), 1);
        assert_eq!(texels[0], Material::from_array([0.5; 7]));
        assert_eq!(moments, Moments::zeros(1));
        let mut light = vec![[1.0f32; 3]];
        assert_eq!(moments.step_light(&mut light, &mut [[f32::INFINITY; 3]], 1.0, 0.1), 1);
        assert_eq!(light[0], [1.0; 3]);
    }
}
