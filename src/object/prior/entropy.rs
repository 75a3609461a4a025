//! The entropy prior: few radiances make up a natural light.
//!
//! After Lombardi and Nishino 2016, who penalise the entropy of the distribution of radiance. Here the distribution is
//! that of the logarithm of the mean over channels, by solid angle, estimated with a Gaussian kernel at fixed bins; the
//! entropy is differentiable then.

use super::{LogLight, shares};

/// Bins of the distribution.
const BINS: usize = 48;
/// Range of logarithms around the mean that the bins cover.
const RANGE: f32 = 6.0;

/// The prior of maps of one size.
#[derive(Clone, Debug)]
pub struct EntropyPrior {
    /// Weight of the entropy, which is in natural units.
    pub weight: f64,
    shares: Vec<f32>,
}

impl EntropyPrior {
    /// The prior for maps of `width x height` texels.
    pub fn new(width: usize, height: usize, weight: f64) -> Self {
        EntropyPrior { weight, shares: shares(width, height) }
    }

    /// The penalty, and its derivative by the logarithm of each channel.
    pub fn energy_and_slopes(&self, light: &LogLight) -> (f64, Vec<f32>) {
        let texels = light.channels[0].len();
        let grey: Vec<f32> =
            (0..texels).map(|texel| light.channels.iter().map(|channel| channel[texel]).sum::<f32>() / 3.0).collect();
        let centre: f32 = grey.iter().zip(&self.shares).map(|(log, share)| log * share).sum();
        let step = 2.0 * RANGE / BINS as f32;
        let deviation = 1.5 * step;
        let mut density = vec![0.0f64; BINS];
        // Each texel spreads over the bins around it.
        let spread = |log: f32| {
            let place = ((log - centre).clamp(-RANGE, RANGE) + RANGE) / step - 0.5;
            let near = place.round() as isize;
            (near - 5..=near + 5).filter(|bin| (0..BINS as isize).contains(bin)).map(move |bin| {
                let distance = (bin as f32 - place) * step;
                (bin as usize, distance, (-0.5 * (distance / deviation).powi(2)).exp())
            })
        };
        for (&log, &share) in grey.iter().zip(&self.shares) {
            for (bin, _, kernel) in spread(log) {
                density[bin] += f64::from(share * kernel);
            }
        }
        let total: f64 = density.iter().sum::<f64>().max(1e-30);
        let probability: Vec<f64> = density.iter().map(|value| (value / total).max(1e-12)).collect();
        let entropy: f64 = probability.iter().map(|p| -p * p.ln()).sum();
        let slopes = grey
            .iter()
            .zip(&self.shares)
            .map(|(&log, &share)| {
                let by_log: f64 = spread(log)
                    .map(|(bin, distance, kernel)| {
                        let by_density = -(probability[bin].ln() + entropy) / total;
                        by_density * f64::from(kernel * distance / (deviation * deviation))
                    })
                    .sum();
                (self.weight * f64::from(share) * by_log / 3.0) as f32
            })
            .collect();
        (self.weight * entropy, slopes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_radiances_have_less_entropy_than_many_and_slopes_lead_there() {
        let (width, height) = (32, 16);
        let prior = EntropyPrior::new(width, height, 1.0);
        let of = |log: &dyn Fn(usize) -> f32| {
            let map: Vec<f32> = (0..width * height).map(log).collect();
            LogLight { width, height, channels: [map.clone(), map.clone(), map] }
        };
        let many = of(&|texel| 3.0 * ((texel * 37 % 101) as f32 / 50.0 - 1.0));
        let two = of(&|texel| if texel % 3 == 0 { 1.0 } else { -1.0 });
        let (energy, slopes) = prior.energy_and_slopes(&many);
        assert!(prior.energy_and_slopes(&two).0 < energy - 0.5);
        let mut moved = many.clone();
        for channel in &mut moved.channels {
            channel.iter_mut().zip(&slopes).for_each(|(log, slope)| *log -= 20.0 * slope);
        }
        assert!(prior.energy_and_slopes(&moved).0 < energy);
        // One texel against a difference; moving it moves the centre of the bins too, which is small.
        let at = |step: f32| {
            let mut moved = many.clone();
            moved.channels[1][200] += step;
            prior.energy_and_slopes(&moved).0
        };
        let difference = (at(0.02) - at(-0.02)) / 0.04;
        assert!(
            (difference - f64::from(slopes[200])).abs() < 0.1 * difference.abs() + 2e-5,
            "{difference} {}",
            slopes[200]
        );
    }
}
