//! The nonparametric bivariate table (Romeiro, Vasilyev and Zickler 2008): a value for every half and difference angle,
//! the azimuth of the difference vector left out.
//!
//! A parameter is `ln(raw + 1e-6)` of a channel at a node of MERL's grid over `theta_half` and `theta_difference`, so
//! that the best fit under the main figure of error is a mean over the azimuth, in closed form. Between nodes the
//! reflectance is bilinear.

use crate::measured::coordinates::HalfDifference;
use crate::measured::grid::{self, PHI_DIFFERENCE_COUNT, THETA_DIFFERENCE_COUNT, THETA_HALF_COUNT};
use crate::measured::metrics::LOG_FLOOR;
use crate::measured::model::ReflectanceModel;
use crate::measured::table::{CHANNEL_SCALE, MeasuredBrdf};

/// Nodes over both angles.
const NODES: usize = THETA_HALF_COUNT * THETA_DIFFERENCE_COUNT;

/// The bivariate table; its parameters are the table.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Bivariate;

impl Bivariate {
    /// The best fit to a table: the mean of `ln(raw + 1e-6)` over the azimuths that count. Nodes without any take the
    /// value of the nearest node before them, over `theta_difference` first.
    pub fn fit(table: &MeasuredBrdf) -> Vec<f64> {
        let mut parameters = vec![f64::NAN; 3 * NODES];
        for i in 0..THETA_HALF_COUNT {
            for j in 0..THETA_DIFFERENCE_COUNT {
                let (mut sum, mut count) = ([0.0; 3], 0);
                for k in 0..PHI_DIFFERENCE_COUNT {
                    let cell = grid::cell_of_indices(i, j, k);
                    if table.counts(cell) {
                        let raw = table.raw_value(cell);
                        (0..3).for_each(|channel| sum[channel] += (raw[channel] + LOG_FLOOR).ln());
                        count += 1;
                    }
                }
                for channel in 0..3 {
                    let place = |i: usize, j: usize| 3 * (j + THETA_DIFFERENCE_COUNT * i) + channel;
                    parameters[place(i, j)] = match (count, i, j) {
                        (0, 0, 0) => f64::NAN,
                        (0, _, 0) => parameters[place(i - 1, 0)],
                        (0, _, _) => parameters[place(i, j - 1)],
                        _ => sum[channel] / f64::from(count),
                    };
                }
            }
        }
        // Nodes before the first that counts: a table of few cells.
        for channel in 0..3 {
            let known = parameters.iter().skip(channel).step_by(3).find(|value| !value.is_nan()).copied();
            let fill = known.unwrap_or(LOG_FLOOR.ln());
            parameters
                .iter_mut()
                .skip(channel)
                .step_by(3)
                .filter(|value| value.is_nan())
                .for_each(|value| *value = fill);
        }
        parameters
    }

    /// Four nodes and weights of a point.
    fn tap(at: &HalfDifference) -> [(usize, f64); 4] {
        // The tap of a table in the plane `phi_difference = 0`, whose upper four corners have weight 0.
        let tap = grid::tap(HalfDifference { phi_difference: 0.0, ..*at });
        std::array::from_fn(|corner| (tap.cell[corner] as usize / PHI_DIFFERENCE_COUNT, tap.weight[corner]))
    }
}

fn raw_of(parameter: f64) -> f64 {
    (parameter.exp() - LOG_FLOOR).max(0.0)
}

impl ReflectanceModel for Bivariate {
    fn name(&self) -> &str {
        "bivariate table"
    }

    fn parameter_count(&self) -> usize {
        3 * NODES
    }

    fn start(&self) -> Vec<f64> {
        vec![100f64.ln(); 3 * NODES]
    }

    fn evaluate(&self, parameters: &[f64], at: &[HalfDifference], values: &mut [[f64; 3]]) {
        for (value, at) in values.iter_mut().zip(at) {
            *value = [0.0; 3];
            for (node, weight) in Self::tap(at).into_iter().filter(|(_, weight)| *weight > 0.0) {
                for channel in 0..3 {
                    value[channel] += weight * raw_of(parameters[3 * node + channel]) * CHANNEL_SCALE[channel];
                }
            }
        }
    }

    fn pull_back(&self, parameters: &[f64], at: &[HalfDifference], adjoint: &[[f64; 3]], gradient: &mut [f64]) {
        for (at, adjoint) in at.iter().zip(adjoint) {
            for (node, weight) in Self::tap(at) {
                for channel in 0..3 {
                    let parameter = parameters[3 * node + channel];
                    if raw_of(parameter) > 0.0 {
                        gradient[3 * node + channel] +=
                            adjoint[channel] * weight * parameter.exp() * CHANNEL_SCALE[channel];
                    }
                }
            }
        }
    }

    fn project(&self, parameters: &mut [f64]) {
        parameters.iter_mut().for_each(|parameter| *parameter = parameter.clamp(LOG_FLOOR.ln(), 30.0));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measured::metrics::model_error;
    use crate::measured::table::INVALID;

    #[test]
    fn the_closed_form_is_the_best_fit() {
        let table =
            MeasuredBrdf::from_fn(|at| [0.1 + at.theta_half * (1.0 + 0.3 * at.phi_difference.cos()), 0.2, 0.05]);
        let best = Bivariate::fit(&table);
        let error = model_error(&Bivariate, &best, &table).unwrap().log_rmse;
        assert!(error > 0.01, "the azimuth must matter here");
        for shift in [-0.01, 0.01] {
            let moved: Vec<f64> = best.iter().map(|p| p + shift).collect();
            assert!(model_error(&Bivariate, &moved, &table).unwrap().log_rmse > error);
        }
        let flat = MeasuredBrdf::from_fn(|at| [0.1 + at.theta_half, 0.2 + at.theta_difference, 0.05]);
        assert!(model_error(&Bivariate, &Bivariate::fit(&flat), &flat).unwrap().log_rmse < 1e-12);
    }

    #[test]
    fn derivatives_are_those_of_the_values() {
        let parameters: Vec<f64> = (0..3 * NODES).map(|i| 3.0 + (i as f64 * 0.7).sin()).collect();
        let at = HalfDifference { theta_half: 0.31, theta_difference: 0.72, phi_difference: 1.0 };
        let value = |parameters: &[f64]| {
            let mut value = [[0.0; 3]];
            Bivariate.evaluate(parameters, &[at], &mut value);
            value[0][1]
        };
        let mut gradient = vec![0.0; parameters.len()];
        Bivariate.pull_back(&parameters, &[at], &[[0.0, 1.0, 0.0]], &mut gradient);
        let touched: Vec<usize> = (0..gradient.len()).filter(|&i| gradient[i] != 0.0).collect();
        assert_eq!(touched.len(), 4);
        for index in touched {
            let mut moved = parameters.clone();
            moved[index] += 1e-5;
            let up = value(&moved);
            moved[index] -= 2e-5;
            let difference = (up - value(&moved)) / 2e-5;
            assert!((gradient[index] - difference).abs() < 1e-6 * difference.abs());
        }
    }

    #[test]
    fn a_table_of_three_cells_gives_a_whole_one() {
        let mut raw = vec![INVALID; 3 * grid::CELL_COUNT];
        for cell in [50_000, 50_001, 90_000] {
            (0..3).for_each(|channel| raw[channel * grid::CELL_COUNT + cell] = 20.0);
        }
        let parameters = Bivariate::fit(&MeasuredBrdf::from_raw(raw).unwrap());
        assert!(parameters.iter().all(|p| (p - 20f64.ln()).abs() < 1e-6));
    }
}
