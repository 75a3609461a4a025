//! Down to which angle the details of an estimated light are the photo's, and below which they are the prior's.
//!
//! A matt object blurs the light: no photo of it tells a sun from a bright cloud. How much a photo tells of the light
//! blurred by an angle is the share of its variance that the photo takes away, both by Laplace's method around the light
//! that was found, as in [`evidence`](super::evidence): `1 - w (J J / s^2 + Q)^-1 w / w Q^-1 w` with `w` the blur at a
//! direction less the mean of the sphere, summed over directions. What is left out: that the reflectance may be wrong.

use super::evidence::posterior;
use super::matrices::LightMatrix;
use super::nodes::NodeTable;
use super::prior::{LogLight, shares};
use super::problem::ObjectProblem;
use crate::light::blur::{BANDS, BlurKernel};
use std::f64::consts::{PI, TAU};

/// Directions at which blurred lights are looked at.
const DIRECTIONS: usize = 24;
/// A light blurred by an angle is the photo's when it takes away at least this share of its variance.
const KNOWN: f64 = 0.5;

/// How much photos tell of a light, from fine to coarse.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct LightBands {
    /// Angles in degrees by which the light is blurred.
    pub degrees: Vec<f64>,
    /// Share of the variance of the light so blurred that the photos take away, 0 to 1.
    pub known: Vec<f64>,
}

impl LightBands {
    /// Of a small problem with its reflectance, around a light of its size. `None` where it cannot be computed.
    pub fn of(problem: &ObjectProblem, table: &NodeTable, light: &LogLight) -> Option<Self> {
        let matrix = LightMatrix::new(&problem.transport, table);
        let posterior = posterior(&matrix, &problem.likelihood, light)?;
        let known = BANDS.map(|degrees| {
            let (mut left, mut all) = (0.0, 0.0);
            for weights in blurs(light.width, light.height, degrees) {
                let (before, after) = posterior.variances(&weights);
                left += after;
                all += before;
            }
            (1.0 - left / all.max(1e-300)).clamp(0.0, 1.0)
        });
        Some(LightBands { degrees: BANDS.to_vec(), known: known.to_vec() })
    }

    /// The smallest angle down to which the light is the photo's.
    pub fn finest_known(&self) -> Option<f64> {
        let known = self.degrees.iter().zip(&self.known).filter(|(_, known)| **known >= KNOWN);
        known.map(|(degrees, _)| *degrees).min_by(f64::total_cmp)
    }

    /// In words, for reports.
    pub fn sentence(&self) -> String {
        match (self.finest_known(), self.degrees.last()) {
            (Some(finest), _) => format!("details below {finest:.0} degrees are the prior's"),
            (None, Some(coarsest)) => format!("even what is wider than {coarsest:.0} degrees is the prior's"),
            (None, None) => "not known".into(),
        }
    }
}

/// Weights of the blurred light at directions spread over the sphere, less those of its mean: no photo tells the level.
fn blurs(width: usize, height: usize, degrees: f64) -> Vec<Vec<f64>> {
    let kernel = BlurKernel::new(width, height, degrees);
    let shares = shares(width, height);
    let of = |direction: usize| {
        // Equal steps of the height and turns by the golden ratio.
        let up = 1.0 - (2.0 * direction as f64 + 1.0) / DIRECTIONS as f64;
        let row = ((up.acos() / PI * height as f64) as usize).min(height - 1);
        let turn = (direction as f64 * 0.618_033_988_75 * TAU) % TAU;
        let column = ((turn / TAU * width as f64) as usize).min(width - 1);
        let mut weights = Vec::with_capacity(width * height);
        for other in 0..height {
            let between = kernel.between(row, other);
            weights.extend((0..width).map(|from| between[column.abs_diff(from)]));
        }
        let total: f64 = weights.iter().sum();
        weights.iter().zip(&shares).map(|(weight, share)| weight / total - f64::from(*share)).collect()
    };
    (0..DIRECTIONS).map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;
    use crate::measured::analytic::{LambertLobes, LobeKind};
    use crate::object::settings::ObjectSettings;
    use crate::object::{ObjectGeometry, ObjectPhoto, ObjectView};
    use glam::Vec3;

    #[test]
    fn a_polished_ball_tells_finer_details_than_a_matt_one() {
        let (photo, _) = ObjectPhoto::new("a", Image::filled(48, 48, Vec3::ONE), 10.0, 0.0).unwrap();
        let view = ObjectView::new(photo, ObjectGeometry::sphere(48, 48, 24.0)).unwrap();
        let settings =
            ObjectSettings { light_height: 16, pixels: 300, nodes: [28, 15, 8], ..ObjectSettings::default() };
        let (problem, _) = ObjectProblem::new(&[view], &settings).unwrap();
        let light = LogLight::constant(32, 16, [0.0; 3]);
        let of = |diffuse: f64, strength: f64| {
            let model = LambertLobes::new(LobeKind::Ggx, 1);
            let parameters = [[diffuse.ln(); 3].as_slice(), &[strength.ln(); 3], &[0.1f64.ln(), 2.0]].concat();
            let table = problem.transport.grid().tabulate(&model, &parameters);
            LightBands::of(&problem, &table, &light).unwrap()
        };
        let (matt, polished) = (of(0.5, 1e-6), of(0.01, 1.0));
        for bands in [&matt, &polished] {
            // The wider the blur, the more is known.
            assert!(bands.known.windows(2).all(|pair| pair[0] <= pair[1] + 0.02), "{bands:?}");
        }
        assert!(polished.known[1] > matt.known[1] + 0.1, "{polished:?} {matt:?}");
        assert!(polished.finest_known().unwrap() <= matt.finest_known().unwrap_or(f64::INFINITY));
        assert!(polished.sentence().contains("degrees are the prior's"), "{}", polished.sentence());
        let none = LightBands { degrees: vec![5.0, 60.0], known: vec![0.1, 0.2] };
        assert!(none.finest_known().is_none() && none.sentence().contains("60 degrees"));
    }
}
