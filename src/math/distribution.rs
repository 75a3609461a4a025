//! Sampling from a table of weights.

/// A discrete distribution over `0..len`, sampled in constant time by an alias table (Vose 1991).
#[derive(Clone, Debug)]
pub struct Discrete {
    /// Probability of each entry; sums to 1.
    probability: Vec<f32>,
    threshold: Vec<f32>,
    alias: Vec<u32>,
}

impl Discrete {
    /// A distribution proportional to `weights`. Weights that are negative or not finite count as zero.
    /// `None` when no weight is positive.
    pub fn new(weights: &[f64]) -> Option<Self> {
        let clean = |weight: f64| if weight.is_finite() && weight > 0.0 { weight } else { 0.0 };
        let sum: f64 = weights.iter().map(|&weight| clean(weight)).sum();
        if sum <= 0.0 || !sum.is_finite() || weights.len() > u32::MAX as usize {
            return None;
        }
        let count = weights.len();
        let mut scaled: Vec<f64> = weights.iter().map(|&weight| clean(weight) / sum * count as f64).collect();
        let probability = scaled.iter().map(|&value| (value / count as f64) as f32).collect();
        // Pair each entry below the mean with one above it.
        let (mut small, mut large): (Vec<usize>, Vec<usize>) = (0..count).partition(|&index| scaled[index] < 1.0);
        let mut threshold = vec![1.0f32; count];
        let mut alias: Vec<u32> = (0..count as u32).collect();
        while let (Some(&low), Some(&high)) = (small.last(), large.last()) {
            small.pop();
            threshold[low] = scaled[low] as f32;
            alias[low] = high as u32;
            scaled[high] -= 1.0 - scaled[low];
            if scaled[high] < 1.0 {
                large.pop();
                small.push(high);
            }
        }
        Some(Discrete { probability, threshold, alias })
    }

    /// An entry from a number uniform in [0, 1), and that number's remainder, uniform in [0, 1) again.
    pub fn sample(&self, u: f32) -> (usize, f32) {
        let scaled = u * self.probability.len() as f32;
        let slot = (scaled as usize).min(self.probability.len() - 1);
        let rest = scaled - slot as f32;
        let threshold = self.threshold[slot];
        if rest < threshold {
            (slot, (rest / threshold).min(0.999_999_9))
        } else {
            (self.alias[slot] as usize, ((rest - threshold) / (1.0 - threshold)).clamp(0.0, 0.999_999_9))
        }
    }

    /// The probability of an entry.
    pub fn probability(&self, index: usize) -> f32 {
        self.probability[index]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frequencies_match_probabilities() {
        let distribution = Discrete::new(&[1.0, 0.0, 3.0, f64::NAN, 6.0]).unwrap();
        let mut counts = [0usize; 5];
        let total = 100_000;
        for step in 0..total {
            let (index, rest) = distribution.sample((step as f32 + 0.5) / total as f32);
            assert!((0.0..1.0).contains(&rest));
            counts[index] += 1;
        }
        assert_eq!((counts[1], counts[3]), (0, 0));
        for (index, expected) in [(0, 0.1), (2, 0.3), (4, 0.6)] {
            assert!((counts[index] as f64 / total as f64 - expected).abs() < 1e-3);
        }
        assert!(Discrete::new(&[0.0, -1.0]).is_none());
    }
}
