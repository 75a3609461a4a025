//! The lobe of Patina's maps as a model: by it a table is projected onto diffuse, specular and roughness.
//!
//! See [`crate::material::lobe`] for the lobe itself. Parameters: logits of the diffuse reflectance (3) and of the
//! reflectance at normal incidence (3), each in (0, 1), and a number whose logistic curve runs from the smallest to the
//! largest logarithm of the microfacet width.

use super::{AnalyticModel, Levels, logistic};
use crate::material::lobe::{LobeGeometry, MIN_WIDTH, Material};
use crate::measured::coordinates::HalfDifference;
use crate::measured::model::ReflectanceModel;
use crate::measured::table::MeasuredBrdf;
use glam::Vec3;
use std::f64::consts::PI;

/// Range of logits: reflectances from 6e-6 to 1 less that.
const LOGIT: f64 = 12.0;

/// Patina's own lobe.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct OwnLobe;

/// What a texel of the maps holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct MapValues {
    /// Diffuse reflectance, linear RGB in [0, 1].
    pub diffuse: [f64; 3],
    /// Reflectance at normal incidence, linear RGB in [0, 1].
    pub specular: [f64; 3],
    /// Roughness r = a^2.
    pub roughness: f64,
}

impl OwnLobe {
    /// The values of the maps that parameters stand for.
    pub fn map_values(parameters: &[f64]) -> MapValues {
        let material = material_of(parameters);
        MapValues {
            diffuse: material.diffuse,
            specular: material.specular,
            roughness: (2.0 * material.log_width).exp(),
        }
    }

    /// Parameters of values of the maps, which are held off the ends of their ranges.
    pub fn parameters_of(values: &MapValues) -> Vec<f64> {
        let logit = |value: f64| (value / (1.0 - value)).clamp(1e-6, 1e6).ln().clamp(-LOGIT, LOGIT);
        let mut parameters: Vec<f64> = values.diffuse.iter().chain(&values.specular).map(|v| logit(*v)).collect();
        let log_width = 0.5 * values.roughness.max(1e-9).ln();
        parameters.push(logit(1.0 - (log_width / smallest_log_width()).clamp(1e-5, 1.0 - 1e-5)));
        parameters
    }
}

fn smallest_log_width() -> f64 {
    f64::from(MIN_WIDTH).ln()
}

fn material_of(parameters: &[f64]) -> Material<f64> {
    Material {
        diffuse: std::array::from_fn(|channel| logistic(parameters[channel])),
        specular: std::array::from_fn(|channel| logistic(parameters[3 + channel])),
        log_width: smallest_log_width() * (1.0 - logistic(parameters[6])),
    }
}

fn geometry_of(at: &HalfDifference) -> Option<LobeGeometry> {
    let (to_light, to_eye) = at.directions();
    LobeGeometry::new(Vec3::Z, to_light.as_vec3(), to_eye.as_vec3())
}

impl ReflectanceModel for OwnLobe {
    fn name(&self) -> &str {
        "Patina's maps"
    }

    fn parameter_count(&self) -> usize {
        7
    }

    fn start(&self) -> Vec<f64> {
        Self::parameters_of(&MapValues { diffuse: [0.2; 3], specular: [0.04; 3], roughness: 0.1 })
    }

    fn evaluate(&self, parameters: &[f64], at: &[HalfDifference], values: &mut [[f64; 3]]) {
        let material = material_of(parameters);
        for (value, at) in values.iter_mut().zip(at) {
            *value = match geometry_of(at) {
                Some(geometry) => material.reflect(&geometry, 1.0).map(|v| v / f64::from(geometry.cos_in)),
                None => [0.0; 3],
            };
        }
    }

    fn pull_back(&self, parameters: &[f64], at: &[HalfDifference], adjoint: &[[f64; 3]], gradient: &mut [f64]) {
        let material = material_of(parameters);
        for (at, adjoint) in at.iter().zip(adjoint) {
            let Some(geometry) = geometry_of(at) else { continue };
            let adjoint = adjoint.map(|a| a / f64::from(geometry.cos_in));
            let by_material = material.reflect_backward(&geometry, 1.0, adjoint);
            for channel in 0..3 {
                let (diffuse, specular) = (material.diffuse[channel], material.specular[channel]);
                gradient[channel] += by_material.diffuse[channel] * diffuse * (1.0 - diffuse);
                gradient[3 + channel] += by_material.specular[channel] * specular * (1.0 - specular);
            }
            let share = logistic(parameters[6]);
            gradient[6] += by_material.log_width * -smallest_log_width() * share * (1.0 - share);
        }
    }

    fn project(&self, parameters: &mut [f64]) {
        parameters.iter_mut().for_each(|parameter| *parameter = parameter.clamp(-LOGIT, LOGIT));
    }
}

impl AnalyticModel for OwnLobe {
    fn starts(&self, table: &MeasuredBrdf) -> Vec<Vec<f64>> {
        let levels = Levels::of(table);
        let diffuse = levels.diffuse.map(|f| (f * PI).min(0.95));
        [0.02, 0.07, 0.2, 0.5]
            .iter()
            .map(|&width: &f64| {
                // At normal incidence the peak is F0 / (4 pi a^2).
                let specular = levels.peak.map(|f| (f * 4.0 * PI * width * width).clamp(0.005, 0.95));
                Self::parameters_of(&MapValues { diffuse, specular, roughness: width * width })
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measured::analytic::tests::check_pull_back;

    #[test]
    fn derivatives_are_those_of_the_values() {
        check_pull_back(&OwnLobe, &OwnLobe.start(), 1.0);
    }

    #[test]
    fn map_values_survive_the_way_there_and_back() {
        let values = MapValues { diffuse: [0.1, 0.5, 0.9], specular: [0.04, 0.2, 0.99], roughness: 0.03 };
        let back = OwnLobe::map_values(&OwnLobe::parameters_of(&values));
        assert!((back.roughness - 0.03).abs() < 1e-9);
        assert!((0..3).all(|c| (back.diffuse[c] - values.diffuse[c]).abs() < 1e-9));
        for values in [MapValues::default(), MapValues { diffuse: [1.0; 3], specular: [1.0; 3], roughness: 1.0 }] {
            assert!(OwnLobe::parameters_of(&values).iter().all(|p| p.is_finite()));
        }
    }
}
