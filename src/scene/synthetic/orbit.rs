//! Cameras around an object.

use crate::math::random::SequentialRandom;
use crate::scene::camera::Camera;
use glam::Vec3;
use std::f32::consts::TAU;

/// Where cameras stand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orbit {
    /// What they look at, in the world.
    pub target: Vec3,
    /// Distance from it, in world units.
    pub distance: f32,
    /// Lowest and highest elevation above the horizon, in radians.
    pub elevation_radians: (f32, f32),
    /// Width of a picture in pixels.
    pub width: usize,
    /// Height of a picture in pixels.
    pub height: usize,
    /// Angle over the width of a picture, in radians.
    pub field_of_view_x_radians: f32,
    /// Distance and target vary by up to this part of the distance.
    pub jitter: f32,
}

impl Orbit {
    /// `count` cameras. Any run of them is spread evenly over the band: they follow the R2 sequence (Roberts 2018),
    /// started at a place given by the seed.
    pub fn cameras(&self, count: usize, seed: u64) -> Vec<Camera> {
        let mut random = SequentialRandom::new(seed);
        let start = [f64::from(random.next_number()), f64::from(random.next_number())];
        let sines = (self.elevation_radians.0.sin(), self.elevation_radians.1.sin());
        (0..count)
            .map(|index| {
                // Powers of the inverse of the plastic number, 1.32471795724...
                let around = (start[0] + 0.754_877_666_246_692_8 * index as f64).fract() as f32;
                let above = (start[1] + 0.569_840_290_998_053_3 * index as f64).fract() as f32;
                let mut shake = || self.distance * self.jitter * (2.0 * random.next_number() - 1.0);
                let (target, distance) =
                    (self.target + Vec3::new(shake(), shake(), shake()) * 0.5, self.distance + shake());
                // Even in the sine of the elevation is even over the sphere.
                let sin = sines.0 + (sines.1 - sines.0) * above;
                let cos = (1.0 - sin * sin).max(0.0).sqrt();
                let (sin_azimuth, cos_azimuth) = (TAU * around).sin_cos();
                let eye = self.target + distance * Vec3::new(cos * sin_azimuth, sin, -cos * cos_azimuth);
                Camera::looking_at(eye, target, self.width, self.height, self.field_of_view_x_radians)
            })
            .collect()
    }
}
