//! How well a picture explains what was measured: Laplace on log radiance, rounded at the bottom.
//!
//! Chen, Nobuhara and Nishino 2020, eq. 2, with the two mends of its dangers: a number tied to the exposure is added
//! before the logarithm, so that black pixels do not rule; and `|r|` becomes `sqrt(r^2 + d^2) - d` (pseudo-Huber), so
//! that a Newton step has a curvature. Saturated and black channels pull to one side only.

use super::observations::Observations;
use super::photo::Evidence;

/// The loss over the pixels of a fit.
#[derive(Clone, Debug)]
pub struct Likelihood {
    /// Added to radiance before the logarithm.
    pub epsilon: f64,
    /// Where the loss turns from square to absolute, in natural logarithms.
    pub width: f64,
    logs: Vec<[f64; 3]>,
    evidence: Vec<[Evidence; 3]>,
}

/// Loss, slope and curvature at a picture.
#[derive(Clone, Debug, Default)]
pub struct Slopes {
    /// Mean loss over pixels and channels.
    pub loss: f64,
    /// Derivative of the mean loss by each channel of the picture.
    pub by_pixel: Vec<[f32; 3]>,
    /// Weight of the squared change of each channel in the quadratic that touches and bounds the loss.
    pub curvature: Vec<[f32; 3]>,
    /// Channels of the picture that are not finite; they are left out.
    pub not_finite: usize,
}

impl Likelihood {
    /// `epsilon_share` is taken of the exposure of the photos; `width` in natural logarithms.
    pub fn new(observations: &Observations, epsilon_share: f64, width: f64) -> Self {
        let epsilon = (epsilon_share * observations.exposure).max(1e-30);
        let logs = observations.measured.iter().map(|pixel| pixel.map(|channel| (f64::from(channel) + epsilon).ln()));
        Likelihood { epsilon, width, logs: logs.collect(), evidence: observations.evidence.clone() }
    }

    /// Number of pixels.
    pub fn len(&self) -> usize {
        self.logs.len()
    }

    /// Natural logarithm of picture over measurement; 0 where a bound is kept.
    fn residual(&self, pixel: usize, channel: usize, value: f32) -> f64 {
        let residual = (f64::from(value).max(0.0) + self.epsilon).ln() - self.logs[pixel][channel];
        match self.evidence[pixel][channel] {
            Evidence::Equal => residual,
            Evidence::AtLeast => residual.min(0.0),
            Evidence::AtMost => residual.max(0.0),
        }
    }

    /// Whether a measurement is a bound that this value keeps: then it says nothing of how far.
    pub fn is_kept_bound(&self, pixel: usize, channel: usize, value: f32) -> bool {
        self.is_bound_kept_by(pixel, channel, self.residual(pixel, channel, value))
    }

    fn is_bound_kept_by(&self, pixel: usize, channel: usize, residual: f64) -> bool {
        residual == 0.0 && self.evidence[pixel][channel] != Evidence::Equal
    }

    /// Natural logarithms of picture over measurement, pixel by pixel; 0 where a bound is kept.
    pub fn residuals<'a>(&'a self, picture: &'a [[f32; 3]]) -> impl Iterator<Item = [f64; 3]> + 'a {
        let of = |(pixel, values): (usize, &[f32; 3])| [0, 1, 2].map(|c| self.residual(pixel, c, values[c]));
        picture.iter().enumerate().map(of)
    }

    /// Mean loss over pixels and channels.
    pub fn loss(&self, picture: &[[f32; 3]]) -> f64 {
        let mut sum = 0.0;
        for (pixel, values) in picture.iter().enumerate() {
            for (channel, &value) in values.iter().enumerate() {
                let residual = self.residual(pixel, channel, value);
                if residual.is_finite() {
                    sum += residual.hypot(self.width) - self.width;
                }
            }
        }
        sum / (3 * picture.len().max(1)) as f64
    }

    /// Loss with its derivatives.
    pub fn slopes(&self, picture: &[[f32; 3]]) -> Slopes {
        let scale = 1.0 / (3 * picture.len().max(1)) as f64;
        let mut slopes = Slopes {
            by_pixel: vec![[0.0; 3]; picture.len()],
            curvature: vec![[0.0; 3]; picture.len()],
            ..Slopes::default()
        };
        for (pixel, values) in picture.iter().enumerate() {
            for (channel, &value) in values.iter().enumerate() {
                let residual = self.residual(pixel, channel, value);
                if !residual.is_finite() || !value.is_finite() {
                    slopes.not_finite += 1;
                    continue;
                }
                let root = residual.hypot(self.width);
                slopes.loss += scale * (root - self.width);
                if self.is_bound_kept_by(pixel, channel, residual) {
                    continue;
                }
                let by_log = (f64::from(value).max(0.0) + self.epsilon).recip();
                slopes.by_pixel[pixel][channel] = (scale * residual / root * by_log) as f32;
                slopes.curvature[pixel][channel] = (scale / root * by_log * by_log) as f32;
            }
        }
        slopes
    }

    /// Root of the mean squared logarithm of picture over measurement.
    pub fn log_rmse(&self, picture: &[[f32; 3]]) -> f64 {
        let squares = picture.iter().enumerate().flat_map(|(pixel, values)| {
            values.iter().enumerate().map(move |(channel, &value)| self.residual(pixel, channel, value).powi(2))
        });
        (squares.sum::<f64>() / (3 * picture.len().max(1)) as f64).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn likelihood(measured: Vec<[f32; 3]>, evidence: Vec<[Evidence; 3]>) -> Likelihood {
        let observations = Observations { pixels: Vec::new(), measured, evidence, visibility: None, exposure: 1.0 };
        Likelihood::new(&observations, 1e-3, 0.05)
    }

    #[test]
    fn slopes_are_those_of_differences() {
        let own = likelihood(vec![[0.5, 2.0, 0.0], [1.0, 0.2, 3.0]], vec![[Evidence::Equal; 3]; 2]);
        let picture = [[0.7f32, 1.9, 0.01], [1.001, 0.05, 3.5]];
        let slopes = own.slopes(&picture);
        assert!((slopes.loss - own.loss(&picture)).abs() < 1e-12);
        for (pixel, channel) in [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2)] {
            let step = 1e-3 * picture[pixel][channel];
            let at = |sign: f32| {
                let mut moved = picture;
                moved[pixel][channel] += sign * step;
                own.loss(&moved)
            };
            let difference = (at(1.0) - at(-1.0)) / (2.0 * f64::from(step));
            let slope = f64::from(slopes.by_pixel[pixel][channel]);
            assert!((slope - difference).abs() < 2e-3 * difference.abs() + 1e-5, "{slope} {difference}");
        }
    }

    #[test]
    fn bounds_pull_to_one_side_only() {
        let evidence = [Evidence::AtLeast, Evidence::AtMost, Evidence::Equal];
        let own = likelihood(vec![[1.0, 0.1, 1.0]], vec![evidence]);
        assert_eq!(own.loss(&[[5.0, 0.01, 1.0]]), 0.0);
        let slopes = own.slopes(&[[0.5, 0.5, 1.0]]);
        assert!(slopes.by_pixel[0][0] < 0.0 && slopes.by_pixel[0][1] > 0.0);
        assert_eq!(own.slopes(&[[f32::NAN, 0.5, 1.0]]).not_finite, 1);
    }
}
