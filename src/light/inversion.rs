//! Sampling a table of weights by inversion, which keeps neighbours neighbours.
//!
//! An alias table is a little faster, but it scatters evenly spread numbers over the table. Measured on 64 x 32 skies
//! with 16 scrambled Sobol samples, the error of an irradiance was 1.9 to 2.8 times as large with alias tables, as if a
//! quarter of the samples had been taken; a sample took as long.

/// A table of positive weights, sampled by inversion of their running sum.
#[derive(Clone, Debug)]
pub struct InversionTable {
    /// Running sums over the total: one more than entries, from 0 to 1.
    cumulative: Vec<f64>,
    /// For each of as many equal parts of [0, 1], the entry in which it begins (Chen and Asau 1974).
    guide: Vec<u32>,
}

impl InversionTable {
    /// A table in proportion to `weights`, which are finite, at least 0 and not all 0; otherwise nothing.
    pub fn new(weights: &[f64]) -> Option<Self> {
        let total: f64 = weights.iter().sum();
        let valid = weights.iter().all(|&weight| weight >= 0.0) && total > 0.0 && total.is_finite();
        if !valid || weights.len() > u32::MAX as usize {
            return None;
        }
        let mut cumulative = Vec::with_capacity(weights.len() + 1);
        let mut sum = 0.0;
        cumulative.push(0.0);
        for weight in weights {
            sum += weight;
            cumulative.push(sum / total);
        }
        let mut entry = 0;
        let guide = (0..weights.len())
            .map(|part| {
                let place = part as f64 / weights.len() as f64;
                while cumulative[entry + 1] <= place && entry + 1 < weights.len() {
                    entry += 1;
                }
                entry as u32
            })
            .collect();
        Some(InversionTable { cumulative, guide })
    }

    /// The entry that a number uniform in [0, 1) falls into, and where in it: uniform in [0, 1) again.
    #[inline]
    pub fn sample(&self, u: f32) -> (usize, f32) {
        let count = self.guide.len();
        let u = f64::from(u.clamp(0.0, 0.999_999_94));
        let mut entry = self.guide[((u * count as f64) as usize).min(count - 1)] as usize;
        while self.cumulative[entry + 1] <= u && entry + 1 < count {
            entry += 1;
        }
        let (start, end) = (self.cumulative[entry], self.cumulative[entry + 1]);
        let rest = if end > start { ((u - start) / (end - start)) as f32 } else { 0.5 };
        (entry, rest.clamp(0.0, 0.999_999_94))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frequencies_are_the_weights_and_order_is_kept() {
        let weights = [1.0, 0.0, 3.0, 1e-9, 6.0, 0.0];
        let table = InversionTable::new(&weights).unwrap();
        let mut counts = [0usize; 6];
        let mut last = (0, 0.0);
        for step in 0..100_000 {
            let sample = table.sample((step as f32 + 0.5) / 100_000.0);
            assert!(sample.0 > last.0 || (sample.0 == last.0 && sample.1 >= last.1));
            counts[sample.0] += 1;
            last = sample;
        }
        for (count, weight) in counts.iter().zip(weights) {
            assert!((*count as f64 / 10_000.0 - weight).abs() < 1e-3, "{counts:?}");
        }
        assert_eq!(table.sample(0.0).0, 0);
        assert_eq!(table.sample(1.0).0, 4, "an entry of weight 0 is never drawn");
        for bad in [&[][..], &[0.0], &[-1.0, 2.0], &[f64::NAN], &[f64::INFINITY]] {
            assert!(InversionTable::new(bad).is_none());
        }
    }
}
