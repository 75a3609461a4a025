//! How far pixels are from a model: noise learned from the capture itself.
//!
//! A camera's read noise and quantisation do not know how bright a pixel is; what is wrong with mesh, cameras and the model
//! goes with its radiance. So the variance of a channel is `a² + (b m)²` for a model of radiance `m`, and residuals over its
//! root have Student's distribution ([`StudentNoise`]): a few pixels are explained by no model, and must not decide for all
//! others. All three numbers, and how heavy the tails are, come from the residuals.

use super::choice::student::StudentNoise;
use crate::math::statistics::quantile;

/// Classes of brightness with as many pixels each, in which the variance is looked at.
const CLASSES: usize = 12;
/// Pixels that are looked at, at most.
const MOST_LOOKED_AT: usize = 1 << 16;
/// Least standard deviation of a channel, relative to the median radiance: a picture without any noise has a rest of single
/// precision and of the cache's interpolation.
const LEAST: f64 = 1e-3;

/// A residual: the model's radiance, mean over channels, and the square of what is left, summed over channels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Residual {
    /// Radiance of the model, at least 0.
    pub radiance: f32,
    /// Squared residual in squared radiance.
    pub square: f32,
}

/// The noise of a capture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelNoise {
    /// Variance of a channel of a black pixel, in squared radiance.
    pub constant: f64,
    /// Variance of a channel that goes with the squared radiance, relative.
    pub relative: f64,
    /// Distribution of residuals over the deviation.
    student: StudentNoise,
}

impl PixelNoise {
    /// The noise under which these residuals are likeliest, about. Of no residuals, noise of one.
    pub fn learn(residuals: &[Residual]) -> Self {
        let stride = residuals.len().div_ceil(MOST_LOOKED_AT).max(1);
        let mut looked_at: Vec<Residual> = residuals
            .iter()
            .step_by(stride)
            .filter(|own| own.square.is_finite() && own.radiance.is_finite())
            .copied()
            .collect();
        looked_at.sort_by(|a, b| a.radiance.total_cmp(&b.radiance));
        let middle = looked_at.get(looked_at.len() / 2).map_or(1.0, |own| f64::from(own.radiance));
        let least = (LEAST * middle).powi(2).max(1e-24);
        let class = looked_at.len().div_ceil(CLASSES).max(1);
        let classes: Vec<(f64, f64)> = looked_at
            .chunks(class)
            .map(|class| {
                let squares: Vec<f64> = class.iter().map(|own| f64::from(own.square)).collect();
                let radiances: Vec<f64> = class.iter().map(|own| f64::from(own.radiance)).collect();
                (quantile(&radiances, 0.5).powi(2), StudentNoise::fit(&squares, least, 1.0).scale_squared)
            })
            .collect();
        let (constant, relative) = line_through(&classes);
        let mut noise = PixelNoise {
            constant: constant.max(least),
            relative,
            student: StudentNoise { freedom: 4, scale_squared: 1.0 },
        };
        let scaled: Vec<f64> =
            looked_at.iter().map(|own| f64::from(own.square) / noise.variance(own.radiance)).collect();
        noise.student = StudentNoise::fit(&scaled, 1e-6, 1.0);
        noise
    }

    /// Variance of a channel at this radiance of the model, before what Student's scale makes of it.
    fn variance(&self, radiance: f32) -> f64 {
        self.constant + self.relative * f64::from(radiance.max(0.0)).powi(2)
    }

    /// Weight of a pixel's squared residual: half of it times this has the slope of the negative logarithm of its density.
    pub fn weight(&self, own: Residual) -> f32 {
        let (nu, variance) = (self.student.freedom as f64, self.variance(own.radiance) * self.student.scale_squared);
        ((nu + 3.0) / (nu * variance + f64::from(own.square))) as f32
    }

    /// Negative logarithm of the density of a pixel, in nats.
    pub fn nats(&self, own: Residual) -> f64 {
        let variance = self.variance(own.radiance);
        1.5 * variance.ln() - self.student.log_density(f64::from(own.square) / variance)
    }

    /// Standard deviation of a channel at this radiance: of the middle of the distribution, tails left out.
    pub fn deviation(&self, radiance: f32) -> f64 {
        (self.variance(radiance) * self.student.scale_squared).sqrt()
    }
}

/// `constant` and `slope`, at least 0, for which `constant + slope x` is nearest to `y`, relative to it.
fn line_through(points: &[(f64, f64)]) -> (f64, f64) {
    let mut sums = [0.0f64; 5];
    for &(x, y) in points {
        let (one, slope) = (1.0 / y, x / y);
        for (sum, value) in sums.iter_mut().zip([one * one, one * slope, slope * slope, one, slope]) {
            *sum += value;
        }
    }
    let [aa, ab, bb, a, b] = sums;
    let determinant = aa * bb - ab * ab;
    let (constant, slope) = ((a * bb - b * ab) / determinant, (b * aa - a * ab) / determinant);
    match (constant >= 0.0, slope >= 0.0) {
        (true, true) if determinant > 1e-12 * aa * bb => (constant, slope),
        (false, true) if bb > 0.0 => (0.0, b / bb),
        _ if aa > 0.0 => (a / aa, 0.0),
        _ => (1.0, 0.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::SequentialRandom;

    fn residuals(constant: f64, relative: f64, outliers: usize) -> Vec<Residual> {
        let mut random = SequentialRandom::new(3);
        (0..40_000)
            .map(|k| {
                let radiance = 2.0 * random.next_number();
                let deviation = (constant + relative * f64::from(radiance).powi(2)).sqrt();
                let wrong = if outliers > 0 && k % outliers == 0 { 30.0 } else { 1.0 };
                let square: f64 = (0..3).map(|_| (wrong * deviation * f64::from(random.next_normal())).powi(2)).sum();
                Residual { radiance, square: square as f32 }
            })
            .collect()
    }

    #[test]
    fn both_parts_are_found_beside_outliers() {
        for outliers in [0, 50] {
            let noise = PixelNoise::learn(&residuals(1e-4, 4e-4, outliers));
            for (radiance, expected) in [(0.1f32, 1.04e-4f64), (1.0, 5e-4), (1.9, 1.544e-3)] {
                let found = noise.deviation(radiance) / expected.sqrt();
                assert!((found - 1.0).abs() < 0.15, "{outliers} {radiance}: {found} {noise:?}");
            }
        }
        let flat = PixelNoise::learn(&residuals(1e-4, 0.0, 0));
        assert!(
            (flat.deviation(0.0) / 0.01 - 1.0).abs() < 0.1 && (flat.deviation(2.0) / 0.01 - 1.0).abs() < 0.1,
            "{flat:?}"
        );
    }

    #[test]
    fn the_weight_is_the_slope_of_the_nats_and_falls_for_outliers() {
        let noise = PixelNoise::learn(&residuals(1e-4, 4e-4, 50));
        for (radiance, square) in [(0.2f32, 1e-4f32), (1.0, 1e-2), (1.5, 0.3)] {
            let nats = |square: f32| noise.nats(Residual { radiance, square });
            let slope = (nats(1.01 * square) - nats(0.99 * square)) / (0.02 * f64::from(square));
            let weight = f64::from(noise.weight(Residual { radiance, square }));
            assert!((2.0 * slope / weight - 1.0).abs() < 1e-2, "{slope} {weight}");
        }
        let weight = |square: f32| noise.weight(Residual { radiance: 1.0, square });
        assert!(weight(1.0) < 0.02 * weight(1e-4));
    }

    #[test]
    fn nothing_and_nothing_but_zeros_are_no_trouble() {
        for residuals in [
            vec![],
            vec![Residual { radiance: 0.0, square: 0.0 }; 9],
            vec![Residual { radiance: f32::NAN, square: 1.0 }],
        ] {
            let noise = PixelNoise::learn(&residuals);
            let weight = noise.weight(Residual { radiance: 0.5, square: 0.1 });
            assert!(weight.is_finite() && weight > 0.0, "{noise:?}");
            assert!(noise.nats(Residual { radiance: 0.5, square: 0.1 }).is_finite());
        }
    }
}
