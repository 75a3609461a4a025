//! Analytic rivals of learned models: the same interface, few parameters, fitted by the same optimiser.
//!
//! | file | model |
//! |---|---|
//! | [`lobes`] | Lambert plus one or two lobes: Cook-Torrance (Beckmann), GGX, Ward |
//! | [`dsbrdf`] | directional statistics: lobes over the half vector whose shape varies with the difference angle |
//! | [`bivariate`] | a table over half and difference angle, without parameters of shape |
//! | [`own_lobe`] | the lobe of Patina's maps, by which a table is projected onto diffuse, specular and roughness |
//!
//! Their parameters are free numbers behind exponentials and logistic curves. Nothing here conserves energy by
//! construction: these are descriptions of measurements.

pub mod bivariate;
pub mod dsbrdf;
pub mod lobes;
pub mod own_lobe;

pub use bivariate::Bivariate;
pub use dsbrdf::Dsbrdf;
pub use lobes::{LambertLobes, LobeKind};
pub use own_lobe::OwnLobe;

use super::grid::{self, PHI_DIFFERENCE_COUNT};
use super::model::ReflectanceModel;
use super::table::MeasuredBrdf;
use crate::math::statistics::quantile;

/// A model that knows where fits to a table should start.
pub trait AnalyticModel: ReflectanceModel {
    /// Parameters to start from, the more promising ones anywhere: the optimiser tries all.
    fn starts(&self, table: &MeasuredBrdf) -> Vec<Vec<f64>>;
}

/// Two levels of a table, by which models choose their starts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Levels {
    /// Reflectance far from the mirror direction, in 1/sr: the median beyond a half angle of 30 degrees.
    pub diffuse: [f64; 3],
    /// Reflectance in the mirror direction, in 1/sr: the median over difference angles up to 45 degrees.
    pub peak: [f64; 3],
}

impl Levels {
    /// The levels of a table; small and positive where it has no cell there.
    pub fn of(table: &MeasuredBrdf) -> Self {
        let level = |cells: &dyn Fn() -> Vec<usize>| -> [f64; 3] {
            let values: Vec<[f64; 3]> =
                cells().into_iter().filter(|&cell| table.counts(cell)).map(|cell| table.value(cell)).collect();
            std::array::from_fn(|channel| {
                let values: Vec<f64> = values.iter().map(|value| value[channel]).collect();
                let median = quantile(&values, 0.5);
                if median > 1e-5 { median } else { 1e-5 }
            })
        };
        let every = |range: std::ops::Range<usize>, differences: std::ops::Range<usize>| -> Vec<usize> {
            range
                .flat_map(|i| {
                    let differences = differences.clone();
                    differences.step_by(3).flat_map(move |j| {
                        (0..PHI_DIFFERENCE_COUNT).step_by(15).map(move |k| grid::cell_of_indices(i, j, k))
                    })
                })
                .collect()
        };
        Levels { diffuse: level(&|| every(52..80, 0..60)), peak: level(&|| every(0..2, 0..45)) }
    }
}

/// The logistic curve.
pub(crate) fn logistic(x: f64) -> f64 {
    1.0 / (1.0 + (-x).exp())
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::math::random::SequentialRandom;
    use crate::measured::coordinates::HalfDifference;

    /// Compares `pull_back` with central differences at random parameters about `centre`.
    pub(crate) fn check_pull_back(model: &dyn ReflectanceModel, centre: &[f64], spread: f64) {
        let mut random = SequentialRandom::new(11);
        for round in 0..20 {
            let mut number = |low: f64, high: f64| low + (high - low) * f64::from(random.next_number());
            let parameters: Vec<f64> = centre.iter().map(|c| c + number(-spread, spread)).collect();
            let at: Vec<HalfDifference> = (0..40)
                .map(|_| HalfDifference {
                    theta_half: number(0.0, 1.2),
                    theta_difference: number(0.0, 1.3),
                    phi_difference: number(0.0, 3.1),
                })
                .filter(|at| grid::cosines(*at).iter().all(|cosine| *cosine > 0.02))
                .collect();
            // Adjoints of size 1 / value: no point may hide another.
            let mut values = vec![[0.0; 3]; at.len()];
            model.evaluate(&parameters, &at, &mut values);
            let adjoint: Vec<[f64; 3]> = values.iter().map(|v| v.map(|v| number(-1.0, 1.0) / (v + 1e-3))).collect();
            let loss = |parameters: &[f64]| -> f64 {
                let mut values = vec![[0.0; 3]; at.len()];
                model.evaluate(parameters, &at, &mut values);
                values.iter().zip(&adjoint).map(|(v, a)| (0..3).map(|c| v[c] * a[c]).sum::<f64>()).sum()
            };
            let mut gradient = vec![1.0; parameters.len()];
            model.pull_back(&parameters, &at, &adjoint, &mut gradient);
            for index in 0..parameters.len() {
                let step = 1e-5;
                let mut moved = parameters.clone();
                moved[index] += step;
                let up = loss(&moved);
                moved[index] -= 2.0 * step;
                let difference = (up - loss(&moved)) / (2.0 * step);
                let found = gradient[index] - 1.0;
                let scale = 1e-3 + difference.abs().max(found.abs());
                let error = (found - difference).abs() / scale;
                assert!(error < 1e-4, "{} round {round} parameter {index}: {found} {difference}", model.name());
            }
        }
    }
}
