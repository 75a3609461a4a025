//! Means, variances and quantiles in a fixed order of summation.

/// Running mean and variance (Welford 1962), in `f64`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moments {
    /// Number of values.
    pub count: u64,
    /// Mean of the values.
    pub mean: f64,
    squared_deviations: f64,
}

impl Moments {
    /// Adds one value.
    pub fn add(&mut self, value: f64) {
        self.count += 1;
        let delta = value - self.mean;
        self.mean += delta / self.count as f64;
        self.squared_deviations += delta * (value - self.mean);
    }

    /// Unbiased variance; 0 for fewer than two values.
    pub fn variance(&self) -> f64 {
        if self.count < 2 { 0.0 } else { self.squared_deviations / (self.count - 1) as f64 }
    }
}

impl FromIterator<f64> for Moments {
    fn from_iter<I: IntoIterator<Item = f64>>(values: I) -> Self {
        let mut moments = Moments::default();
        values.into_iter().for_each(|value| moments.add(value));
        moments
    }
}

/// The quantile `fraction` in [0, 1] by linear interpolation between order statistics. NaN when empty.
pub fn quantile(values: &[f64], fraction: f64) -> f64 {
    if values.is_empty() {
        return f64::NAN;
    }
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let place = fraction.clamp(0.0, 1.0) * (sorted.len() - 1) as f64;
    let low = place.floor() as usize;
    let high = (low + 1).min(sorted.len() - 1);
    sorted[low] + (sorted[high] - sorted[low]) * (place - low as f64)
}

/// Median, or 0 of nothing; the values come out in another order.
pub fn median(values: &mut [f32]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    f64::from(*values.select_nth_unstable_by(middle, f32::total_cmp).1)
}

/// Standard deviation of each of three normal numbers, from root mean squares of such triples, of which most may be
/// believed: their median length is 1.538 standard deviations. NaN when empty.
pub fn deviation_of_triples(root_mean_squares: &[f64]) -> f64 {
    quantile(root_mean_squares, 0.5) * 3f64.sqrt() / 1.538
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_and_quantiles_of_a_known_list() {
        let values = [1.0, 2.0, 3.0, 4.0, 10.0];
        let moments: Moments = values.into_iter().collect();
        assert!((moments.mean - 4.0).abs() < 1e-12 && (moments.variance() - 12.5).abs() < 1e-12);
        assert_eq!(quantile(&values, 0.5), 3.0);
        assert_eq!(quantile(&values, 0.875), 7.0);
        assert!(quantile(&[], 0.5).is_nan());
    }

    #[test]
    fn the_deviation_of_triples_is_found_beside_outliers() {
        let mut random = crate::math::random::SequentialRandom::new(4);
        let mut square = || (0.2 * f64::from(random.next_normal())).powi(2);
        let triple = |_| ((0..3).map(|_| square()).sum::<f64>() / 3.0).sqrt();
        let mut sizes: Vec<f64> = (0..20_000).map(triple).collect();
        assert!((deviation_of_triples(&sizes) / 0.2 - 1.0).abs() < 0.02, "{}", deviation_of_triples(&sizes));
        sizes.iter_mut().take(500).for_each(|size| *size *= 1e6);
        assert!((deviation_of_triples(&sizes) / 0.2 - 1.0).abs() < 0.05);
        assert!(deviation_of_triples(&[]).is_nan());
    }
}
