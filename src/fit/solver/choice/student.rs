//! How likely a residual is: Student's distribution in three channels, fitted to the residuals of training pixels.
//!
//! `p(e) = Γ((ν + 3) / 2) / Γ(ν / 2) (π ν σ²)^(-3/2) (1 + |e|² / (ν σ²))^(-(ν + 3) / 2)`. Its maximum-likelihood fits
//! weigh pixels by `1 / (1 + |e|² / (ν σ²))`, the weights by which tiles are solved ([`super::super::tile`]); here both
//! numbers come from the pixels (expectation and maximisation, Lange, Little and Taylor 1989): a normal distribution
//! would let the one pixel in a thousand that no model explains decide for all others.

use std::f64::consts::PI;

/// Channels of a residual.
const CHANNELS: f64 = 3.0;
/// Degrees of freedom that are tried, even ones: from tails as heavy as Cauchy's to nearly normal.
const FREEDOMS: [usize; 6] = [2, 4, 8, 16, 32, 64];
/// Steps of expectation and maximisation; the scale has then settled to a per cent.
const STEPS: usize = 12;
/// Residuals that are looked at, at most.
const MOST_LOOKED_AT: usize = 2048;

/// Noise in three channels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StudentNoise {
    /// Degrees of freedom, at least 2.
    pub freedom: usize,
    /// Square of the scale σ of a channel, in squared radiance.
    pub scale_squared: f64,
}

impl StudentNoise {
    /// The noise under which these squared lengths of residuals (sums over three channels) are likeliest; σ² is at least
    /// `least`. `share_left` in (0, 1] is the share of the residuals' freedom that the model's own unknowns left: σ² is
    /// divided by it, since a fit lies closer to the pixels it was made from than to others.
    pub fn fit(squares: &[f64], least: f64, share_left: f64) -> Self {
        let least = least.max(f64::MIN_POSITIVE);
        let looked_at: Vec<f64> =
            squares.iter().step_by(squares.len().div_ceil(MOST_LOOKED_AT).max(1)).copied().collect();
        let mut best = StudentNoise { freedom: FREEDOMS[1], scale_squared: least };
        if looked_at.is_empty() {
            return best;
        }
        let mut sorted = looked_at.clone();
        let middle = sorted.len() / 2;
        let median = *sorted.select_nth_unstable_by(middle, f64::total_cmp).1;
        let mut scale_squared = (median / CHANNELS).max(least);
        let mut most = f64::NEG_INFINITY;
        for freedom in FREEDOMS {
            let nu = freedom as f64;
            for _ in 0..STEPS {
                let weighed = |&square: &f64| square * (nu + CHANNELS) / (nu + square / scale_squared);
                let mean = looked_at.iter().map(weighed).sum::<f64>() / looked_at.len() as f64;
                scale_squared = (mean / CHANNELS).max(least);
            }
            let noise = StudentNoise { freedom, scale_squared };
            let tails: f64 = looked_at.iter().map(|&square| noise.log_fall(square)).sum();
            let likelihood = looked_at.len() as f64 * noise.log_norm() + tails;
            if likelihood > most {
                (most, best) = (likelihood, noise);
            }
        }
        best.scale_squared /= share_left.clamp(0.1, 1.0);
        best
    }

    /// Logarithm of the density of a residual of this squared length, in nats.
    pub fn log_density(&self, square: f64) -> f64 {
        self.log_norm() + self.log_fall(square)
    }

    /// Logarithm of the density where nothing is left.
    fn log_norm(&self) -> f64 {
        log_gamma_ratio(self.freedom) - 1.5 * (PI * self.freedom as f64 * self.scale_squared).ln()
    }

    /// By how much the logarithm of the density is less at a residual of this squared length.
    fn log_fall(&self, square: f64) -> f64 {
        let nu = self.freedom as f64;
        -0.5 * (nu + CHANNELS) * (square / (nu * self.scale_squared)).ln_1p()
    }
}

/// Logarithm of Γ((ν + 3) / 2) / Γ(ν / 2) for an even ν.
fn log_gamma_ratio(freedom: usize) -> f64 {
    // Γ(k + 3/2) = √π / 2 · 3/2 · 5/2 … (k terms), Γ(k) = (k - 1)!.
    let half = freedom / 2;
    let above: f64 = (0..half).map(|j| (j as f64 + 1.5).ln()).sum();
    let below: f64 = (1..half).map(|j| (j as f64).ln()).sum();
    0.5 * PI.ln() - std::f64::consts::LN_2 + above - below
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::SequentialRandom;

    #[test]
    fn the_density_integrates_to_one() {
        for freedom in FREEDOMS {
            let noise = StudentNoise { freedom, scale_squared: 0.3 };
            // Shells of equal steps in the logarithm of the radius.
            let step = 0.001;
            let total: f64 = (-12_000..12_000)
                .map(|k| {
                    let radius = (step * f64::from(k)).exp();
                    noise.log_density(radius * radius).exp() * 4.0 * PI * radius.powi(3) * step
                })
                .sum();
            assert!((total - 1.0).abs() < 1e-3, "{freedom}: {total}");
        }
    }

    #[test]
    fn scale_and_tails_are_found_and_outliers_do_not_move_them_far() {
        let mut random = SequentialRandom::new(5);
        let draw = |random: &mut SequentialRandom, sigma: f64| -> f64 {
            (0..3).map(|_| (sigma * f64::from(random.next_normal())).powi(2)).sum()
        };
        let plain: Vec<f64> = (0..2000).map(|_| draw(&mut random, 0.1)).collect();
        let noise = StudentNoise::fit(&plain, 1e-9, 1.0);
        assert!(noise.freedom >= 32 && (noise.scale_squared.sqrt() / 0.1 - 1.0).abs() < 0.05, "{noise:?}");
        let mixed: Vec<f64> =
            plain.iter().enumerate().map(|(k, &square)| if k % 20 == 0 { 400.0 * square } else { square }).collect();
        let noise = StudentNoise::fit(&mixed, 1e-9, 1.0);
        assert!(noise.freedom <= 8 && (noise.scale_squared.sqrt() / 0.1 - 1.0).abs() < 0.25, "{noise:?}");
        // Nothing, and nothing but zeros, are no trouble.
        assert!(StudentNoise::fit(&[], 1e-4, 1.0).log_density(1.0).is_finite());
        assert!(StudentNoise::fit(&[0.0; 9], 1e-4, 0.5).log_density(1.0).is_finite());
        assert!((StudentNoise::fit(&plain, 1e-9, 0.5).scale_squared / 0.02 - 1.0).abs() < 0.1);
    }
}
