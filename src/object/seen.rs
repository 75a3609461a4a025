//! What the photos see of the light: how much each direction matters to them.
//!
//! Pixels are linear in the light, so how the logarithm of each answers to a texel is known exactly. Where no pixel answers,
//! behind a wall or opposite to a flat object, the light is what the prior made of it, however bright it is.

use super::nodes::NodeTable;
use super::prior::{LogLight, shares};
use super::transport::Transport;
use crate::image::{Image, RgbImage};
use glam::{DVec3, Vec3};
use std::f64::consts::PI;

/// A direction is next to unseen when it matters less than this share of the mean over all directions.
const NEXT_TO_NOTHING: f64 = 0.01;

/// What the photos see of the light.
#[derive(Clone, Debug, PartialEq)]
pub struct LightSeen {
    /// Per texel and channel, in 1/sr: how much the logarithm of the pixels rises, in the mean, when the texel is brighter by
    /// the light's mean radiance, over its solid angle.
    pub sensitivity: RgbImage,
    /// Share of the solid angle of which the photos tell next to nothing.
    pub unseen_share: f64,
}

impl LightSeen {
    /// Of the pixels of a transport with a reflectance under a light. Pixels that are black in a channel do not count there.
    pub fn of(transport: &Transport, table: &NodeTable, light: &LogLight) -> Self {
        let texels = light.texels();
        let mean = light.environment().mean_radiance().as_dvec3();
        let picture = transport.forward(table, &texels);
        let by_pixels: Vec<Vec3> = picture.into_iter().map(|pixel| answer(mean, pixel, transport.pixels())).collect();
        let sums = transport.adjoint_by_light(table, &by_pixels);
        let shares = shares(light.width, light.height);
        let per_steradian = |(sum, share): (&DVec3, &f32)| (*sum / (4.0 * PI * f64::from(*share))).as_vec3();
        let sensitivity = sums.iter().zip(&shares).map(per_steradian).collect();
        Self::new(Image::from_pixels(light.width, light.height, sensitivity))
    }

    /// With a sensitivity that is known.
    pub fn new(sensitivity: RgbImage) -> Self {
        let shares = shares(sensitivity.width(), sensitivity.height());
        let texels = || sensitivity.pixels().iter().map(|texel| f64::from(texel.element_sum()) / 3.0).zip(&shares);
        let mean: f64 = texels().map(|(value, share)| value * f64::from(*share)).sum();
        let unseen = texels().filter(|(value, _)| *value <= NEXT_TO_NOTHING * mean);
        let unseen_share = unseen.map(|(_, share)| f64::from(*share)).sum();
        LightSeen { sensitivity, unseen_share }
    }
}

/// Derivative of the mean logarithm of the pixels by one pixel, times the light's mean.
fn answer(mean: DVec3, picture: Vec3, pixels: usize) -> Vec3 {
    let one = |channel: usize| match picture[channel] > 0.0 {
        true => (mean[channel] / f64::from(picture[channel]) / pixels as f64) as f32,
        false => 0.0,
    };
    Vec3::new(one(0), one(1), one(2))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sphere::direction_of_texel;
    use crate::object::geometry::ObjectPixel;
    use crate::object::nodes::NodeGrid;
    use crate::object::transport::TexelDirections;
    use std::sync::Arc;

    #[test]
    fn a_flat_matte_surface_sees_the_half_above_it_by_the_cosine() {
        let (width, height) = (32, 16);
        let directions = Arc::new(TexelDirections::new(width, height).unwrap());
        let grid = Arc::new(NodeGrid::new([24, 12, 8]));
        let up = Vec3::Z;
        let pixel = ObjectPixel { row: 0, column: 0, normal: up, to_eye: up, origin: Vec3::ZERO, geometric_normal: up };
        let matte = NodeTable::constant(&grid, [0.3; 3]);
        let transport = Transport::new(Arc::clone(&grid), directions, &[pixel; 3], None);
        let light = LogLight::constant(width, height, [0.5, 0.0, -0.5]);
        let seen = LightSeen::of(&transport, &matte, &light);
        // Even light: the logarithm rises by the share of the irradiance, cosine over pi a steradian.
        for (index, texel) in seen.sensitivity.pixels().iter().enumerate() {
            let cosine = direction_of_texel(index / width, index % width, width, height).dot(up);
            let expected = cosine.max(0.0) / std::f32::consts::PI;
            assert!((*texel - Vec3::splat(expected)).abs().max_element() < 0.02, "{index}: {texel} {expected}");
        }
        assert!((seen.unseen_share - 0.5).abs() < 0.07, "{}", seen.unseen_share);
    }
}
