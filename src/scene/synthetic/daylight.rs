//! A simple day: a sun, a clear sky and a ground, as a latitude-longitude map.

use crate::image::Image;
use crate::light::Environment;
use crate::math::sphere::direction_of_angles;
use glam::Vec3;
use std::f32::consts::{PI, TAU};

/// A sun, a sky and a ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Daylight {
    /// Direction towards the sun, unit length.
    pub towards_sun: Vec3,
    /// Irradiance of the sun on a plane that faces it.
    pub sun_irradiance: Vec3,
    /// Angle within which half of the sun's light comes, in radians; a few degrees, as through haze.
    pub sun_radius_radians: f32,
    /// Radiance of the sky overhead.
    pub zenith: Vec3,
    /// Radiance of the sky at the horizon.
    pub horizon: Vec3,
    /// Radiance of the ground.
    pub ground: Vec3,
}

impl Daylight {
    /// A clear morning: the sun 38 degrees high.
    pub fn morning() -> Self {
        Daylight {
            towards_sun: direction_of_angles(0.9, 52f32.to_radians()),
            sun_irradiance: Vec3::new(3.4, 3.1, 2.6),
            sun_radius_radians: 3.5f32.to_radians(),
            zenith: Vec3::new(0.16, 0.29, 0.62),
            horizon: Vec3::new(0.62, 0.72, 0.85),
            ground: Vec3::new(0.15, 0.13, 0.11),
        }
    }

    /// A red evening: the sun 14 degrees high and on another side than in the morning.
    pub fn evening() -> Self {
        Daylight {
            towards_sun: direction_of_angles(4.3, 76f32.to_radians()),
            sun_irradiance: Vec3::new(4.2, 2.2, 0.9),
            sun_radius_radians: 4f32.to_radians(),
            zenith: Vec3::new(0.09, 0.13, 0.3),
            horizon: Vec3::new(0.75, 0.42, 0.25),
            ground: Vec3::new(0.09, 0.07, 0.06),
        }
    }

    /// Radiance along a unit direction.
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        // Blend the horizon over a degree or so, so that a coarse map holds it.
        let above = (direction.y / 0.03 * 0.5 + 0.5).clamp(0.0, 1.0);
        let sky = self.horizon.lerp(self.zenith, direction.y.max(0.0).sqrt());
        // A von Mises-Fisher lobe: density k / (2 pi) exp(k (cos - 1)); half of it lies within cos = 1 - ln 2 / k.
        let sharpness = std::f32::consts::LN_2 / (1.0 - self.sun_radius_radians.cos()).max(1e-6);
        let cosine = direction.dot(self.towards_sun);
        let sun = self.sun_irradiance * (sharpness / TAU * (sharpness * (cosine - 1.0)).exp());
        // A wide glow around the sun.
        let glow = self.sun_irradiance * 0.05 * (8.0 * (cosine - 1.0)).exp();
        self.ground.lerp(sky + sun + glow, above)
    }

    /// The map of `width x height` texels; each is the mean of 8 x 8 places.
    pub fn environment(&self, width: usize, height: usize) -> Environment {
        let samples = 8;
        let radiance = Image::from_fn(width, height, |row, column| {
            let mut sum = Vec3::ZERO;
            for sample in 0..samples * samples {
                let place = |cell: usize, sub: usize| cell as f32 + (sub as f32 + 0.5) / samples as f32;
                let phi = TAU * place(column, sample % samples) / width as f32;
                let theta = PI * place(row, sample / samples) / height as f32;
                sum += self.radiance(direction_of_angles(phi, theta));
            }
            sum / (samples * samples) as f32
        });
        Environment { radiance }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sphere::{direction_of_texel, solid_angle_of_texel};

    #[test]
    fn the_map_keeps_the_irradiance_of_the_sun() {
        let bright = Daylight::morning();
        let dark = Daylight { sun_irradiance: Vec3::ZERO, ..bright };
        let irradiance = |light: &Environment| {
            let mut sum = 0.0;
            for row in 0..32 {
                for column in 0..64 {
                    let cosine = direction_of_texel(row, column, 64, 32).dot(bright.towards_sun).max(0.0);
                    let energy = f64::from(light.radiance[(row, column)].y) * f64::from(cosine);
                    sum += energy * solid_angle_of_texel(row, 64, 32);
                }
            }
            sum
        };
        let difference = irradiance(&bright.environment(64, 32)) - irradiance(&dark.environment(64, 32));
        // The glow adds 0.05 * pi / 4 or so.
        assert!((difference / f64::from(bright.sun_irradiance.y) - 1.04).abs() < 0.05, "{difference}");
    }
}
