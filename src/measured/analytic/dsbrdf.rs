//! Directional statistics (Nishino 2009; Nishino and Lombardi 2011): lobes over the half vector, one distribution for
//! every difference angle.
//!
//! What is implemented: `f_c = unit * sum over lobes r of (exp(kappa_rc(theta_d) cos(theta_h)^gamma_r(theta_d)) - 1)`,
//! the hemispherical exponential power distribution of those papers, not normalised, with one `kappa` a channel and one
//! `gamma` for all channels. There, both vary with the difference angle freely, and are later expressed in a basis that
//! is learned from MERL; here `ln kappa` and `ln gamma` are cubic Bernstein polynomials of `theta_d / 90 degrees`, so
//! that nothing of the materials is in the model itself: 16 parameters a lobe. `unit` is one stored unit of MERL, which
//! only sets where the exponential turns linear. The model does not depend on `phi_difference`.

use super::{AnalyticModel, Levels};
use crate::measured::coordinates::HalfDifference;
use crate::measured::model::ReflectanceModel;
use crate::measured::table::{CHANNEL_SCALE, MeasuredBrdf};
use std::f64::consts::FRAC_PI_2;

/// Coefficients of one polynomial.
const BASIS: usize = 4;
/// Polynomials of one lobe: kappa a channel, gamma.
const CURVES: usize = 4;
const STRIDE: usize = BASIS * CURVES;
/// Range of `ln kappa`; `exp(exp(3.3))` is 6e11 stored units.
const LOG_KAPPA: (f64, f64) = (-25.0, 3.3);
/// Range of `ln gamma`.
const LOG_GAMMA: (f64, f64) = (-9.0, 14.0);

/// The model with a number of lobes.
#[derive(Clone, Debug, PartialEq)]
pub struct Dsbrdf {
    lobes: usize,
    name: String,
}

/// A lobe at one point.
struct LobeAt {
    /// kappa a channel, then gamma.
    curve: [f64; CURVES],
    basis: [f64; BASIS],
    /// `cos^gamma` and `ln cos`.
    power: f64,
    log_cosine: f64,
}

impl Dsbrdf {
    /// A model with this many lobes, at least one; three is what the papers use for MERL.
    pub fn new(lobes: usize) -> Self {
        let lobes = lobes.max(1);
        Dsbrdf { lobes, name: if lobes == 3 { "DSBRDF".into() } else { format!("DSBRDF, {lobes} lobes") } }
    }

    fn lobe(at: &HalfDifference, parameters: &[f64]) -> LobeAt {
        let t = (at.theta_difference / FRAC_PI_2).clamp(0.0, 1.0);
        let s = 1.0 - t;
        let basis = [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t];
        let curve = std::array::from_fn(|curve| {
            let coefficients = &parameters[curve * BASIS..];
            (0..BASIS).map(|b| coefficients[b] * basis[b]).sum::<f64>().exp()
        });
        let log_cosine = at.theta_half.cos().max(1e-9).ln();
        let power = (curve[CURVES - 1] * log_cosine).exp();
        LobeAt { curve, basis, power, log_cosine }
    }
}

impl ReflectanceModel for Dsbrdf {
    fn name(&self) -> &str {
        &self.name
    }

    fn parameter_count(&self) -> usize {
        self.lobes * STRIDE
    }

    fn start(&self) -> Vec<f64> {
        let mut start = Vec::with_capacity(self.parameter_count());
        for lobe in 0..self.lobes {
            start.extend([1.2; 3 * BASIS]);
            start.extend([3.0 * lobe as f64 - 2.0; BASIS]);
        }
        start
    }

    fn evaluate(&self, parameters: &[f64], at: &[HalfDifference], values: &mut [[f64; 3]]) {
        for (value, at) in values.iter_mut().zip(at) {
            *value = [0.0; 3];
            for lobe in parameters.chunks_exact(STRIDE) {
                let lobe = Self::lobe(at, lobe);
                for channel in 0..3 {
                    value[channel] += CHANNEL_SCALE[channel] * (lobe.curve[channel] * lobe.power).exp_m1();
                }
            }
        }
    }

    fn pull_back(&self, parameters: &[f64], at: &[HalfDifference], adjoint: &[[f64; 3]], gradient: &mut [f64]) {
        for (at, adjoint) in at.iter().zip(adjoint) {
            for (parameters, gradient) in parameters.chunks_exact(STRIDE).zip(gradient.chunks_exact_mut(STRIDE)) {
                let lobe = Self::lobe(at, parameters);
                let mut by_log_gamma = 0.0;
                for channel in (0..3).filter(|channel| adjoint[*channel] != 0.0) {
                    let exponent = lobe.curve[channel] * lobe.power;
                    // Derivative by ln kappa.
                    let slope = adjoint[channel] * CHANNEL_SCALE[channel] * exponent.exp() * exponent;
                    for b in 0..BASIS {
                        gradient[channel * BASIS + b] += slope * lobe.basis[b];
                    }
                    by_log_gamma += slope * lobe.log_cosine * lobe.curve[CURVES - 1];
                }
                for b in 0..BASIS {
                    gradient[3 * BASIS + b] += by_log_gamma * lobe.basis[b];
                }
            }
        }
    }

    fn project(&self, parameters: &mut [f64]) {
        for (index, parameter) in parameters.iter_mut().enumerate() {
            let (low, high) = if index % STRIDE < 3 * BASIS { LOG_KAPPA } else { LOG_GAMMA };
            *parameter = parameter.clamp(low, high);
        }
    }
}

impl AnalyticModel for Dsbrdf {
    fn starts(&self, table: &MeasuredBrdf) -> Vec<Vec<f64>> {
        let levels = Levels::of(table);
        let raw = |value: f64, channel: usize| value / CHANNEL_SCALE[channel];
        let starts = [0.015, 0.05, 0.15, 0.4].iter().map(|&width| {
            let mut start = Vec::with_capacity(self.parameter_count());
            for lobe in 0..self.lobes {
                // The first is nearly constant, the others fall to 1/e of their peak at `width`, twice it, ...
                let diffuse = lobe == 0 && self.lobes > 1;
                let share = 0.5f64.powi(lobe as i32 - 1);
                let mut largest: f64 = 0.01;
                for channel in 0..3 {
                    let level = match diffuse {
                        true => raw(levels.diffuse[channel], channel),
                        false => {
                            raw(
                                (levels.peak[channel] - levels.diffuse[channel]).max(0.02 * levels.peak[channel]),
                                channel,
                            ) * share
                        }
                    };
                    let kappa = level.ln_1p();
                    largest = largest.max(kappa);
                    start.extend([kappa.ln(); BASIS]);
                }
                let width = width * 2.5f64.powi(lobe.saturating_sub(1) as i32);
                let gamma: f64 = if diffuse { 0.05 } else { 2.0 / (largest.max(1.0) * width * width) };
                start.extend([gamma.ln(); BASIS]);
            }
            self.project(&mut start);
            start
        });
        starts.collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measured::analytic::tests::check_pull_back;

    #[test]
    fn derivatives_are_those_of_the_values() {
        for lobes in [1, 3] {
            let model = Dsbrdf::new(lobes);
            check_pull_back(&model, &model.start(), 0.7);
        }
    }

    #[test]
    fn extremes_stay_finite() {
        let model = Dsbrdf::new(3);
        for extreme in [-1e9, 0.0, 1e9] {
            let mut parameters = vec![extreme; model.parameter_count()];
            model.project(&mut parameters);
            for theta_half in [0.0, 0.5, FRAC_PI_2] {
                for theta_difference in [0.0, 0.5, FRAC_PI_2, 9.0] {
                    let at = [HalfDifference { theta_half, theta_difference, phi_difference: 0.0 }];
                    let (mut value, mut gradient) = ([[0.0; 3]], vec![0.0; parameters.len()]);
                    model.evaluate(&parameters, &at, &mut value);
                    model.pull_back(&parameters, &at, &[[1.0; 3]], &mut gradient);
                    assert!(value[0].iter().chain(&gradient).all(|v| v.is_finite()), "{extreme} {at:?}");
                }
            }
        }
    }
}
