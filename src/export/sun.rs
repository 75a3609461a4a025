//! The sun of an environment, where it has one.
//!
//! A renderer samples a directional light better than one bright texel of a map. It is offered only where a small
//! cluster of texels clearly dominates; the map without it is written beside the whole one, so that it is not lit twice.

use crate::image::Image;
use crate::light::Environment;
use crate::math::luminance;
use crate::math::sphere::{direction_of_texel, solid_angle_of_texel};
use glam::{DVec3, Vec3};

/// Share of the peak above which a neighbour belongs to the sun.
const SHARE_OF_PEAK: f32 = 0.1;
/// The peak of a sun is at least so many times the mean radiance of the rest.
const LEAST_CONTRAST: f32 = 20.0;
/// A sun is at most so large, in steradians: two texels across of a map of 32 rows, twice over.
const LARGEST_SOLID_ANGLE: f64 = 0.16;
/// A sun gives at least this share of the irradiance that the rest gives on average.
const LEAST_SHARE: f64 = 0.15;

/// A directional light.
#[derive(Clone, Debug, PartialEq)]
pub struct Sun {
    /// Unit direction towards it in the world.
    pub towards: Vec3,
    /// Irradiance on a surface that faces it, linear RGB, in the unit of the environment's radiance times steradian.
    pub irradiance: Vec3,
    /// Solid angle of its texels in steradians.
    pub solid_angle: f64,
    /// The environment without it: its texels hold the mean of their surroundings.
    pub rest: Environment,
}

/// The sun of an environment; `None` where no small cluster of texels clearly dominates.
pub fn sun_of(environment: &Environment) -> Option<Sun> {
    let (width, height) = (environment.width(), environment.height());
    let image = &environment.radiance;
    let brightness = |index: usize| luminance(image.pixels()[index]);
    let peak = (0..width * height).max_by(|&a, &b| brightness(a).total_cmp(&brightness(b)))?;
    if !(brightness(peak) > 0.0) {
        return None;
    }
    // Grow from the peak over neighbours, the map wrapped in longitude.
    let neighbours = |index: usize| {
        let (row, column) = (index / width, index % width);
        let rows = row.saturating_sub(1)..(row + 2).min(height);
        rows.flat_map(move |row| [width - 1, 0, 1].map(|step| row * width + (column + step) % width))
    };
    let mut is_sun = vec![false; width * height];
    is_sun[peak] = true;
    let (mut cluster, mut next) = (vec![peak], 0);
    while next < cluster.len() {
        for near in neighbours(cluster[next]) {
            if !is_sun[near] && brightness(near) >= SHARE_OF_PEAK * brightness(peak) {
                is_sun[near] = true;
                cluster.push(near);
            }
        }
        next += 1;
    }
    let solid_angle_at = |index: usize| solid_angle_of_texel(index / width, width, height);
    let solid_angle: f64 = cluster.iter().map(|&index| solid_angle_at(index)).sum();
    if solid_angle > LARGEST_SOLID_ANGLE {
        return None;
    }
    // What surrounds the sun is not part of it.
    let (mut rim, mut count) = (Vec3::ZERO, 0.0f32);
    for &index in &cluster {
        for near in neighbours(index).filter(|&near| !is_sun[near]) {
            rim += image.pixels()[near];
            count += 1.0;
        }
    }
    let background = if count > 0.0 { rim / count } else { Vec3::ZERO };
    let (mut irradiance, mut towards) = (DVec3::ZERO, DVec3::ZERO);
    for &index in &cluster {
        let excess = (image.pixels()[index] - background).max(Vec3::ZERO);
        let part = excess.as_dvec3() * solid_angle_at(index);
        irradiance += part;
        let direction = direction_of_texel(index / width, index % width, width, height);
        towards += direction.as_dvec3() * f64::from(luminance(part.as_vec3()));
    }
    let mut pixels = image.pixels().to_vec();
    cluster.iter().for_each(|&index| pixels[index] = pixels[index].min(background));
    let rest = Environment { radiance: Image::from_pixels(width, height, pixels) };
    let mean_of_rest = luminance(rest.mean_radiance());
    let strength = f64::from(luminance(irradiance.as_vec3()));
    let dominates = brightness(peak) >= LEAST_CONTRAST * mean_of_rest
        && strength >= LEAST_SHARE * std::f64::consts::PI * f64::from(mean_of_rest);
    let towards = towards.as_vec3().try_normalize()?;
    dominates.then(|| Sun { towards, irradiance: irradiance.as_vec3(), solid_angle, rest })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::sky::{SkySettings, sun_and_sky};

    #[test]
    fn the_sun_of_a_sky_is_found_and_taken_out_and_an_overcast_sky_has_none() {
        let noon = sun_and_sky(64, 32, &SkySettings::noon());
        let sun = sun_of(&noon).unwrap();
        let brightest = (0..64 * 32)
            .max_by(|&a, &b| luminance(noon.radiance.pixels()[a]).total_cmp(&luminance(noon.radiance.pixels()[b])));
        let peak = brightest.map(|index| direction_of_texel(index / 64, index % 64, 64, 32)).unwrap();
        assert!(sun.towards.dot(peak) > 0.99, "{:?} {peak}", sun.towards);
        // Sun and rest together are the whole.
        let whole = noon.power().as_vec3();
        let parts = sun.rest.power().as_vec3() + sun.irradiance;
        assert!((whole - parts).abs().max_element() < 0.02 * whole.max_element(), "{whole} {parts}");
        assert!(sun_of(&sun.rest).is_none());
        assert!(sun_of(&sun_and_sky(64, 32, &SkySettings::overcast())).is_none());
        assert!(sun_of(&Environment::constant(8, 4, Vec3::ZERO)).is_none());
        assert!(sun_of(&Environment::constant(8, 4, Vec3::ONE)).is_none());
    }

    #[test]
    fn one_bright_texel_across_the_seam_is_one_sun() {
        let mut light = Environment::constant(64, 32, Vec3::splat(0.1));
        light.radiance[(12, 0)] = Vec3::splat(400.0);
        light.radiance[(12, 63)] = Vec3::splat(400.0);
        let sun = sun_of(&light).unwrap();
        let expected = crate::math::sphere::direction_of_angles(0.0, std::f32::consts::PI * 12.5 / 32.0);
        assert!(sun.towards.dot(expected) > 0.9999, "{}", sun.towards);
    }
}
