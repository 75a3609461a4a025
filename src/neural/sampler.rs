//! Importance sampling of the direction of light for a renderer: tables over the half vector.
//!
//! What is exact and what is not. A flow draws whole triples of angles exactly ([`super::flow::Flow::carry_from_uniform`]),
//! with a known density: that of `log(1 + stored value)` over the warped cube. A renderer holds one direction and wants
//! the other with a density near reflectance times cosine, which is another one. So a table is made once for a
//! material: for each of some elevations of the held direction, the mass of reflectance times cosine over cells of the
//! half vector. Drawing from it and its density are exact with respect to each other (what a Monte Carlo estimate
//! needs: tested by chi square); the density is only near reflectance times cosine, as near as the cells are small. A
//! tenth of the draws follow the cosine alone, so that nothing has no chance.

use crate::math::distribution::Discrete;
use crate::math::parallel;
use crate::measured::coordinates::HalfDifference;
use crate::measured::model::ReflectanceModel;
use glam::DVec3;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Elevations of the held direction, even in the angle from the normal.
const ELEVATIONS: usize = 32;
/// Cells along the square root of the half vector's angle from the normal.
const HALVES: usize = 64;
/// Cells around the normal.
const TURNS: usize = 48;
/// Share of draws that follow the cosine.
const COSINE_SHARE: f64 = 0.1;

/// Draws directions for one material.
#[derive(Clone, Debug)]
pub struct HalfVectorSampler {
    elevations: Vec<Elevation>,
}

#[derive(Clone, Debug)]
struct Elevation {
    /// `None` where nothing is reflected.
    cells: Option<Discrete>,
    albedo: [f64; 3],
}

/// A half vector in the middle of a cell, and the solid angle of the cell.
fn middle(half: usize, turn: usize) -> (DVec3, f64) {
    let edge = |index: usize| (index as f64 / HALVES as f64).powi(2) * FRAC_PI_2;
    let solid_angle = (edge(half).cos() - edge(half + 1).cos()) * TAU / TURNS as f64;
    // The height that halves the cell's solid angle.
    let height = 0.5 * (edge(half).cos() + edge(half + 1).cos());
    (at_height(height, (turn as f64 + 0.5) / TURNS as f64 * TAU), solid_angle)
}

fn at_height(height: f64, turn: f64) -> DVec3 {
    let radius = (1.0 - height * height).max(0.0).sqrt();
    DVec3::new(radius * turn.cos(), radius * turn.sin(), height)
}

impl HalfVectorSampler {
    /// Tables for a model with these parameters.
    pub fn new(model: &dyn ReflectanceModel, parameters: &[f64]) -> Self {
        let elevations = parallel::map(ELEVATIONS, |index| {
            let angle = (index as f64 + 0.5) / ELEVATIONS as f64 * FRAC_PI_2;
            let to_eye = DVec3::new(angle.sin(), 0.0, angle.cos());
            let mut at = Vec::with_capacity(HALVES * TURNS);
            let mut share = Vec::with_capacity(HALVES * TURNS);
            for half in 0..HALVES {
                for turn in 0..TURNS {
                    let (normal, solid_angle) = middle(half, turn);
                    let cosine = normal.dot(to_eye);
                    let to_light = 2.0 * cosine * normal - to_eye;
                    // The light's solid angle is four cosines times the half vector's.
                    let above = cosine > 0.0 && to_light.z > 0.0;
                    share.push(if above { to_light.z * 4.0 * cosine * solid_angle } else { 0.0 });
                    at.push(HalfDifference::from_directions(to_light, to_eye));
                }
            }
            let mut values = vec![[0.0; 3]; at.len()];
            model.evaluate(parameters, &at, &mut values);
            let mut albedo = [0.0; 3];
            let weights: Vec<f64> = values
                .iter()
                .zip(&share)
                .map(|(value, share)| {
                    (0..3).for_each(|channel| albedo[channel] += value[channel] * share);
                    value.iter().sum::<f64>() * share
                })
                .collect();
            Elevation { cells: Discrete::new(&weights), albedo }
        });
        HalfVectorSampler { elevations }
    }

    /// The share of light from all directions that goes towards `to_eye` (a white furnace), per channel. Above 1 the
    /// reflectance makes light of nothing: neither measured tables nor flows are kept from that.
    pub fn albedo(&self, to_eye: DVec3) -> [f64; 3] {
        self.elevation(to_eye).albedo
    }

    /// Albedo from the normal to the horizon: angle of the held direction in radians, red, green, blue.
    pub fn albedos(&self) -> Vec<(f64, [f64; 3])> {
        let angle = |index: usize| (index as f64 + 0.5) / ELEVATIONS as f64 * FRAC_PI_2;
        self.elevations.iter().enumerate().map(|(index, own)| (angle(index), own.albedo)).collect()
    }

    fn elevation(&self, to_eye: DVec3) -> &Elevation {
        let angle = to_eye.z.clamp(0.0, 1.0).acos();
        &self.elevations[((angle / FRAC_PI_2 * ELEVATIONS as f64) as usize).min(ELEVATIONS - 1)]
    }

    /// A direction to the light for a unit direction to the eye (z is the normal), with its density per solid angle.
    /// `None` when the draw falls below the surface: it counts, with nothing in it.
    pub fn sample(&self, to_eye: DVec3, numbers: [f32; 3]) -> Option<(DVec3, f64)> {
        let choice = f64::from(numbers[0]);
        let elevation = self.elevation(to_eye);
        let to_light = match &elevation.cells {
            Some(cells) if choice >= COSINE_SHARE => {
                let again = ((choice - COSINE_SHARE) / (1.0 - COSINE_SHARE)) as f32;
                let (cell, rest) = cells.sample(again.min(0.999_999_9));
                let (half, turn) = (cell / TURNS, cell % TURNS);
                let edge = |index: usize| ((index as f64 / HALVES as f64).powi(2) * FRAC_PI_2).cos();
                // The remainder of the first number has few bits left in crowded tables: it only turns the azimuth.
                let around = (f64::from(rest) + f64::from(numbers[1])).fract();
                let height = edge(half) + f64::from(numbers[2]) * (edge(half + 1) - edge(half));
                let local = at_height(height, (turn as f64 + around) / TURNS as f64 * TAU);
                let normal = turned(local, to_eye, 1.0);
                let cosine = normal.dot(to_eye);
                if cosine <= 0.0 {
                    return None;
                }
                2.0 * cosine * normal - to_eye
            }
            _ => {
                let height = (1.0 - f64::from(numbers[1])).sqrt();
                at_height(height, f64::from(numbers[2]) * TAU)
            }
        };
        if to_light.z <= 0.0 {
            return None;
        }
        let density = self.density(to_eye, to_light);
        (density > 0.0).then_some((to_light, density))
    }

    /// The density per solid angle with which [`Self::sample`] draws `to_light`.
    pub fn density(&self, to_eye: DVec3, to_light: DVec3) -> f64 {
        if to_light.z <= 0.0 {
            return 0.0;
        }
        let elevation = self.elevation(to_eye);
        let of_cosine = to_light.z / PI;
        let Some(cells) = &elevation.cells else { return of_cosine };
        let Some(half) = (to_light + to_eye).try_normalize() else { return COSINE_SHARE * of_cosine };
        let cosine = half.dot(to_eye);
        let local = turned(half, to_eye, -1.0);
        let angle = local.z.clamp(-1.0, 1.0).acos();
        let row = (((angle / FRAC_PI_2).sqrt() * HALVES as f64) as usize).min(HALVES - 1);
        let around = local.y.atan2(local.x).rem_euclid(TAU);
        let turn = ((around / TAU * TURNS as f64) as usize).min(TURNS - 1);
        let (_, solid_angle) = middle(row, turn);
        let of_cell = f64::from(cells.probability(row * TURNS + turn)) / solid_angle / (4.0 * cosine).max(1e-12);
        COSINE_SHARE * of_cosine + (1.0 - COSINE_SHARE) * of_cell
    }
}

/// Turns about the normal from the frame in which `to_eye` has no y to the given one, or back.
fn turned(direction: DVec3, to_eye: DVec3, sign: f64) -> DVec3 {
    let radius = to_eye.x.hypot(to_eye.y);
    let (sine, cosine) = if radius > 1e-12 { (sign * to_eye.y / radius, to_eye.x / radius) } else { (0.0, 1.0) };
    DVec3::new(cosine * direction.x - sine * direction.y, sine * direction.x + cosine * direction.y, direction.z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::SequentialRandom;

    /// A glossy lobe on a dull ground.
    struct Glossy;

    impl ReflectanceModel for Glossy {
        fn name(&self) -> &str {
            "glossy"
        }
        fn parameter_count(&self) -> usize {
            0
        }
        fn start(&self) -> Vec<f64> {
            Vec::new()
        }
        fn evaluate(&self, _: &[f64], at: &[HalfDifference], values: &mut [[f64; 3]]) {
            for (at, value) in at.iter().zip(values) {
                let lobe = (-40.0 * at.theta_half.powi(2)).exp();
                *value = [0.1 + lobe, 0.05 + lobe, lobe];
            }
        }
        fn pull_back(&self, _: &[f64], _: &[HalfDifference], _: &[[f64; 3]], _: &mut [f64]) {}
    }

    #[test]
    fn draws_follow_their_density_by_chi_square() {
        let sampler = HalfVectorSampler::new(&Glossy, &[]);
        let mut random = SequentialRandom::new(11);
        for to_eye in [DVec3::new(0.3, 0.5, 0.7).normalize(), DVec3::new(-0.9, 0.1, 0.3).normalize(), DVec3::Z] {
            let (rows, columns, total, fine) = (12, 16, 200_000, 24);
            let mut counts = vec![0.0f64; rows * columns + 1];
            for _ in 0..total {
                let numbers = [0; 3].map(|_| random.next_number());
                match sampler.sample(to_eye, numbers) {
                    Some((to_light, density)) => {
                        assert!((density / sampler.density(to_eye, to_light) - 1.0).abs() < 1e-9);
                        let turn = to_light.y.atan2(to_light.x).rem_euclid(TAU) / TAU;
                        let row = ((to_light.z * rows as f64) as usize).min(rows - 1);
                        counts[row * columns + ((turn * columns as f64) as usize).min(columns - 1)] += 1.0;
                    }
                    None => counts[rows * columns] += 1.0,
                }
            }
            let (mut statistic, mut cells, mut inside) = (0.0, 0usize, 0.0);
            for row in 0..rows {
                for column in 0..columns {
                    let mut mass = 0.0;
                    for i in 0..fine * fine {
                        let height = (row as f64 + ((i / fine) as f64 + 0.5) / fine as f64) / rows as f64;
                        let turn = (column as f64 + ((i % fine) as f64 + 0.5) / fine as f64) / columns as f64;
                        mass += sampler.density(to_eye, at_height(height, turn * TAU));
                    }
                    let expected = mass / (fine * fine) as f64 * TAU / (rows * columns) as f64 * f64::from(total);
                    inside += expected;
                    if expected > 50.0 {
                        // Quadrature of a density with steps is good to about two percent of a cell.
                        let spread = expected + (0.02 * expected).powi(2);
                        statistic += (counts[row * columns + column] - expected).powi(2) / spread;
                        cells += 1;
                    }
                }
            }
            let limit = cells as f64 + 4.0 * (2.0 * cells as f64).sqrt();
            assert!(cells > 60 && statistic < limit, "{to_eye}: {statistic} of {cells} cells");
            // What is not drawn inside falls below the surface.
            let below = f64::from(total) - inside;
            assert!((below - counts[rows * columns]).abs() < 0.02 * f64::from(total), "{below}");
        }
    }

    #[test]
    fn the_estimate_of_the_albedo_has_the_right_mean_and_less_noise_than_that_of_the_cosine() {
        let sampler = HalfVectorSampler::new(&Glossy, &[]);
        let to_eye = DVec3::new(0.5, 0.2, 0.8).normalize();
        let mut random = SequentialRandom::new(3);
        let (mut of_table, mut of_cosine) =
            (crate::math::statistics::Moments::default(), crate::math::statistics::Moments::default());
        let value = |to_light: DVec3| {
            let mut value = [[0.0; 3]];
            Glossy.evaluate(&[], &[HalfDifference::from_directions(to_light, to_eye)], &mut value);
            value[0][0] * to_light.z
        };
        for _ in 0..100_000 {
            let numbers = [0; 3].map(|_| random.next_number());
            let drawn = sampler.sample(to_eye, numbers);
            of_table.add(drawn.map_or(0.0, |(to_light, density)| value(to_light) / density));
            let to_light = at_height((1.0 - f64::from(numbers[1])).sqrt(), f64::from(numbers[2]) * TAU);
            of_cosine.add(value(to_light) / (to_light.z / PI));
        }
        assert!((of_table.mean / of_cosine.mean - 1.0).abs() < 0.02, "{} {}", of_table.mean, of_cosine.mean);
        assert!((of_table.mean / sampler.albedo(to_eye)[0] - 1.0).abs() < 0.05);
        assert!(of_table.variance() < 0.2 * of_cosine.variance());
    }
}
