//! A gain for each photo and channel, beside a model of all its pixels.
//!
//! Exposure and white balance differ between photos, and by how much is learned: gains of a renderer's photos differ by no
//! more than what the model's errors in a view have in common, and are shrunk to one; those of a camera on automatic differ
//! by more, and stand.

/// What the model's errors in one view have in common, as a standard deviation of a logarithm.
const IN_COMMON: f64 = 0.02;

/// Weighted sums over the pixels of a view, by channel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GainSums {
    /// Of photo times model.
    pub product: [f64; 3],
    /// Of squares of the model.
    pub power: [f64; 3],
}

impl GainSums {
    /// Adds a pixel.
    #[inline]
    pub fn add(&mut self, weight: f32, photo: [f32; 3], model: [f32; 3]) {
        for c in 0..3 {
            self.product[c] += f64::from(weight * photo[c]) * f64::from(model[c]);
            self.power[c] += f64::from(weight * model[c]) * f64::from(model[c]);
        }
    }

    /// Adds the sums of other pixels.
    pub fn merge(&mut self, other: &GainSums) {
        for c in 0..3 {
            self.product[c] += other.product[c];
            self.power[c] += other.power[c];
        }
    }

    /// Logarithm of the best gain of a channel; `None` where the view shows nothing in it.
    fn log_gain(&self, channel: usize) -> Option<f64> {
        let gain = self.product[channel] / self.power[channel];
        (gain.is_finite() && gain > 0.0).then(|| gain.ln())
    }
}

/// Gains of all views: their logarithms have mean zero in each channel, and are shrunk by as much as they may be errors of
/// the model.
pub fn gains(views: &[GainSums]) -> Vec<[f32; 3]> {
    let mut gains = vec![[1.0f32; 3]; views.len()];
    for channel in 0..3 {
        let known: Vec<f64> = views.iter().filter_map(|view| view.log_gain(channel)).collect();
        let count = known.len().max(1) as f64;
        let mean = known.iter().sum::<f64>() / count;
        let variance = known.iter().map(|log_gain| (log_gain - mean).powi(2)).sum::<f64>() / count;
        let own = (variance - IN_COMMON * IN_COMMON).max(0.0);
        let share = own / (own + IN_COMMON * IN_COMMON);
        for (gain, view) in gains.iter_mut().zip(views) {
            gain[channel] = view.log_gain(channel).map_or(1.0, |log_gain| (share * (log_gain - mean)).exp() as f32);
        }
    }
    gains
}

/// Logarithms of views' gains, which have one for each channel.
pub(in crate::fit) fn log_gains(gains: &[[f32; 3]]) -> Vec<f32> {
    gains.iter().map(|gain| gain.iter().map(|gain| gain.ln()).sum::<f32>() / 3.0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sums(gain: [f32; 3]) -> GainSums {
        let mut sums = GainSums::default();
        for k in 1..50 {
            let model = [0.01 * k as f32, 0.5, 1.0 / k as f32];
            sums.add(2.0, [0, 1, 2].map(|c| gain[c] * model[c]), model);
        }
        sums
    }

    #[test]
    fn gains_that_differ_stand_and_their_mean_belongs_to_the_light() {
        let found = gains(&[sums([2.0, 2.0, 3.0]), sums([1.0, 1.5, 3.0]), sums([0.5, 1.0, 3.0])]);
        // The mean of the logarithms of 2, 1.5 and 1.
        let mean = 3f32.powf(1.0 / 3.0);
        for (found, expected) in
            found.iter().zip([[2.0, 2.0 / mean, 1.0], [1.0, 1.5 / mean, 1.0], [0.5, 1.0 / mean, 1.0]])
        {
            for c in 0..3 {
                assert!((found[c] / expected[c] - 1.0).abs() < 0.05, "{found:?} {expected:?}");
            }
        }
        let product: f32 = found.iter().map(|gain| gain[0]).product();
        assert!((product - 1.0).abs() < 1e-5);
    }

    #[test]
    fn what_may_be_errors_of_the_model_is_no_gain() {
        let found = gains(&[sums([1.01; 3]), sums([0.99; 3]), sums([1.0; 3])]);
        assert!(found.iter().flatten().all(|gain| (gain - 1.0).abs() < 1e-6), "{found:?}");
        assert_eq!(gains(&[GainSums::default(), sums([2.0; 3])])[0], [1.0; 3]);
        assert!(gains(&[]).is_empty());
    }
}
