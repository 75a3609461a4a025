//! The mean over pixels of a difference of two models, with its standard error: views are independent, pixels of one
//! view are not.
//!
//! Neighbouring pixels share what both models lack, so a standard error over pixels is too small by the root of how many
//! go together. Over views it is that of a ratio (Cochran 1977, eq. 6.13): with `d` the sum of a view and `n` its pixels,
//! the mean is `m = Σ d / Σ n` and its variance `V / (V - 1) Σ (d - m n)² / (Σ n)²`. Five sums hold that, however many
//! views there are.

/// Sums over views.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ClusteredMean {
    views: usize,
    sum: f64,
    pixels: f64,
    sum_squared: f64,
    sum_times_pixels: f64,
    pixels_squared: f64,
}

impl ClusteredMean {
    /// Adds a view: the sum over its pixels, and their number. A view without pixels counts for nothing.
    pub fn add_view(&mut self, sum: f64, pixels: f64) {
        if pixels > 0.0 && sum.is_finite() {
            self.views += 1;
            self.sum += sum;
            self.pixels += pixels;
            self.sum_squared += sum * sum;
            self.sum_times_pixels += sum * pixels;
            self.pixels_squared += pixels * pixels;
        }
    }

    /// Number of views with pixels.
    pub fn views(&self) -> usize {
        self.views
    }

    /// Number of pixels.
    pub fn pixels(&self) -> f64 {
        self.pixels
    }

    /// The mean over all pixels; 0 without any.
    pub fn mean(&self) -> f64 {
        if self.pixels > 0.0 { self.sum / self.pixels } else { 0.0 }
    }

    /// The standard deviation of the mean, as views differ; infinite with less than two.
    pub fn deviation(&self) -> f64 {
        if self.views < 2 {
            return f64::INFINITY;
        }
        let (mean, views) = (self.mean(), self.views as f64);
        let deviations = self.sum_squared - 2.0 * mean * self.sum_times_pixels + mean * mean * self.pixels_squared;
        let variance = views / (views - 1.0) * deviations.max(0.0) / (self.pixels * self.pixels);
        variance.sqrt()
    }

    /// The standard error of the mean: the true mean lies within one of it with a probability of 0.68. Infinite with less
    /// than two views.
    ///
    /// With few views the deviation itself is known badly, so it is as much larger as the middle 68 % of Student's
    /// distribution are wider than those of the normal one.
    pub fn standard_error(&self) -> f64 {
        if self.views < 2 { f64::INFINITY } else { self.deviation() * widening(self.views - 1) }
    }
}

/// The 84 % quantile (one standard deviation of the normal distribution) of Student's distribution.
fn widening(freedom: usize) -> f64 {
    match freedom {
        0 => f64::INFINITY,
        1 => 1.837,
        2 => 1.321,
        // Abramowitz and Stegun 1964, eq. 26.7.5 at x = 1.
        _ => 1.0 + 0.5 / freedom as f64 + 0.25 / (freedom as f64).powi(2),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::SequentialRandom;

    /// Share of trials in which the true mean lies within a standard error, by views and by pixels alone.
    fn coverage(views: usize, trials: usize) -> (f64, f64) {
        let mut random = SequentialRandom::new(31 + views as u64);
        let (mut held, mut held_by_pixels) = (0, 0);
        for _ in 0..trials {
            let (mut by_views, mut by_pixels) = (ClusteredMean::default(), ClusteredMean::default());
            for _ in 0..views {
                let pixels = 20 + (30.0 * random.next_number()) as usize;
                let shared = 0.3 + 0.5 * f64::from(random.next_normal());
                let drawn: Vec<f64> = (0..pixels).map(|_| shared + f64::from(random.next_normal())).collect();
                by_views.add_view(drawn.iter().sum(), pixels as f64);
                drawn.iter().for_each(|&value| by_pixels.add_view(value, 1.0));
            }
            let is_held = |sums: &ClusteredMean| (sums.mean() - 0.3).abs() <= sums.standard_error();
            held += usize::from(is_held(&by_views));
            held_by_pixels += usize::from(is_held(&by_pixels));
        }
        (held as f64 / trials as f64, held_by_pixels as f64 / trials as f64)
    }

    #[test]
    fn standard_errors_hold_the_truth_as_often_as_they_say() {
        for views in [2, 4, 6, 20] {
            let (by_views, by_pixels) = coverage(views, 2000);
            println!("{views} views: {by_views:.3}, by pixels {by_pixels:.3}");
            assert!((by_views - 0.683).abs() < 0.05, "{views}: {by_views}");
            assert!(by_pixels < 0.4, "pixels of one view are not independent: {by_pixels}");
        }
    }

    #[test]
    fn nothing_and_one_view_have_no_standard_error() {
        let mut sums = ClusteredMean::default();
        assert!(sums.mean() == 0.0 && sums.standard_error().is_infinite());
        sums.add_view(3.0, 10.0);
        sums.add_view(5.0, 0.0);
        sums.add_view(f64::NAN, 4.0);
        assert!(sums.mean() == 0.3 && sums.views() == 1 && sums.standard_error().is_infinite());
    }
}
