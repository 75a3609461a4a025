//! What a run is lit by: its own light, one that no photo shows, and one that tells how an environment is turned.

use crate::light::Environment;
use crate::math::sphere::direction_of_texel;
use glam::Vec3;

/// The light of the run.
pub const OWN: &str = "own";
/// A sky with a lamp and a wide light.
pub const SKY: &str = "sky";
/// One bright texel over an even dim light: a light that is turned or mirrored lights other sides.
pub const TEXEL: &str = "texel";

/// A light by its name.
#[derive(Clone, Debug)]
pub struct ProofLight {
    /// One of [`OWN`], [`SKY`] and [`TEXEL`].
    pub name: &'static str,
    /// The light.
    pub environment: Environment,
}

/// The lights of the proof, on the grid of the run's own.
pub fn of(own: &Environment) -> Vec<ProofLight> {
    let (width, height) = (own.width(), own.height());
    let lamp = |d: Vec3, towards: Vec3, spread: f32| ((d.dot(towards.normalize_or(Vec3::Y)) - 1.0) / spread).exp();
    let sky = Environment {
        radiance: crate::image::Image::from_fn(width, height, |row, column| {
            let d = direction_of_texel(row, column, width, height);
            Vec3::new(0.8, 0.9, 1.0) * 0.15 * (0.6 + d.y).max(0.1)
                + Vec3::new(1.0, 0.85, 0.6) * 6.0 * lamp(d, Vec3::new(0.6, 0.64, 0.48), 0.02)
                + Vec3::new(0.5, 0.7, 1.0) * 1.5 * lamp(d, Vec3::new(-0.8, 0.36, -0.48), 0.08)
        }),
    };
    let mut texel = Environment::constant(width, height, Vec3::splat(0.05));
    // As much power whatever the grid: the height of the solver's is 32.
    let texels_per_row = height as f32 / 32.0;
    texel.radiance[(height / 4, width / 5)] = Vec3::splat(120.0 * texels_per_row * texels_per_row);
    vec![
        ProofLight { name: OWN, environment: own.clone() },
        ProofLight { name: SKY, environment: sky },
        ProofLight { name: TEXEL, environment: texel },
    ]
}

/// The ways in which an importer may get an environment wrong: turned by quarters, mirrored, upside down.
pub fn wrong(light: &Environment) -> Vec<Environment> {
    let (width, height) = (light.width(), light.height());
    let moved = |place: &dyn Fn(usize, usize) -> (usize, usize)| Environment {
        radiance: crate::image::Image::from_fn(width, height, |row, column| light.radiance[place(row, column)]),
    };
    let mut all: Vec<Environment> =
        (1..4).map(|quarter| moved(&|row, column| (row, (column + quarter * width / 4) % width))).collect();
    all.push(moved(&|row, column| (row, width - 1 - column)));
    all.push(moved(&|row, column| (height - 1 - row, column)));
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_wrong_turn_is_another_light() {
        let lights = of(&Environment::constant(64, 32, Vec3::ONE));
        let texel = &lights[2].environment;
        for (index, other) in wrong(texel).into_iter().enumerate() {
            assert_ne!(&other, texel, "{index}");
            let (a, b) = (other.power().length(), texel.power().length());
            assert!((a - b).abs() < 1e-3 * b, "{index}: as much light");
        }
    }
}
