//! A light made ready for quick shading: blurred once for matt surfaces and once for each of some roughnesses.
//!
//! The approximation is the usual one of rasterisers (split sum, Karis 2013): reflected light is the light blurred by
//! the lobe about the mirror direction, times the lobe's own reflectance from a table over angle and width. It knows
//! **no shadows, no light from other surfaces**, and at grazing angles blurs too evenly. What a fit is judged by is the
//! path tracer; this is for turning a scene around.

use crate::image::{Image, RgbImage};
use crate::light::Environment;
use crate::material::lobe::{LobeGeometry, LobeModel, Material};
use crate::math::frame::Frame;
use crate::math::{parallel, sphere};
use glam::Vec3;
use std::sync::LazyLock;

/// Width of the blurred maps in texels.
pub(super) const WIDTH: usize = 64;
/// Height of the blurred maps in texels.
pub(super) const HEIGHT: usize = 32;
/// Widest map that mirrors and the background show, in texels.
const MIRROR_WIDTH: usize = 1024;
/// Number of microfacet widths that a light is blurred for.
pub(super) const WIDTHS: usize = 6;
/// Smallest of these widths: its blur is about one texel. Below, the mirror image is blended in.
pub(super) const FIRST_WIDTH: f32 = 0.07;
/// The layer that a background out of focus shows, blurred by some ten degrees.
pub(super) const OUT_OF_FOCUS: usize = 2;
/// Texels along each side of the table of reflectances.
pub(super) const TABLE_SIZE: usize = 32;

/// A light ready to be uploaded.
#[derive(Clone, Debug)]
pub(super) struct PreparedLight {
    /// The light itself, not wider than needed.
    pub mirror: RgbImage,
    /// Irradiance over pi by normal, then the light blurred for each of [`width_of_layer`] by mirror direction.
    pub layers: Vec<RgbImage>,
    /// [`reflectance_table`] of the lobes that it was blurred by.
    pub reflectances: &'static RgbImage,
}

/// The microfacet width that layer `1 + index` is blurred for: a geometric row from [`FIRST_WIDTH`] to 1.
pub(super) fn width_of_layer(index: usize) -> f32 {
    FIRST_WIDTH.powf(1.0 - index as f32 / (WIDTHS - 1) as f32)
}

/// Blurs a light by lobes of these microfacets; about 20 million products, in parallel.
pub(super) fn prepare(environment: &Environment, lobe: LobeModel) -> PreparedLight {
    let mirror = if environment.width() > MIRROR_WIDTH {
        environment.resampled(MIRROR_WIDTH, (MIRROR_WIDTH / 2).min(environment.height())).radiance
    } else {
        environment.radiance.clone()
    };
    let sharp = Source::new(environment, WIDTH, HEIGHT);
    // A wide blur does not need every texel.
    let soft = Source::new(environment, WIDTH / 2, HEIGHT / 2);
    let mut layers = vec![sharp.blurred(0.0, |cosine| cosine)];
    layers.extend((0..WIDTHS).map(|index| {
        let width = width_of_layer(index);
        let source = if width < 0.3 { &sharp } else { &soft };
        // Light towards i reaches the eye in the direction of the normal with D(h) (n.i), and n.h is cos of half the angle.
        let exponent = 1.0 / (width * width) - 1.0;
        match lobe {
            LobeModel::BlinnPhong => {
                // Below, a texel weighs less than 1e-6.
                let least = (2.0 * (-13.8 / exponent.max(1e-3)).exp() - 1.0).max(0.0);
                source.blurred(least, |cosine| cosine * (0.5 + 0.5 * cosine).powf(exponent))
            }
            LobeModel::Ggx => {
                let spread = |cosine: f32| 1.0 + exponent * (0.5 - 0.5 * cosine);
                source.blurred(0.0, |cosine| cosine / spread(cosine).powi(2))
            }
        }
    }));
    PreparedLight { mirror, layers, reflectances: reflectance_table(lobe) }
}

/// The texels of a light as directions with their share of the sphere.
struct Source {
    texels: Vec<(Vec3, Vec3, f32)>,
}

impl Source {
    fn new(environment: &Environment, width: usize, height: usize) -> Self {
        let small = environment.resampled(width, height);
        let texels = (0..width * height).map(|index| {
            let (row, column) = (index / width, index % width);
            let direction = sphere::direction_of_texel(row, column, width, height);
            (direction, small.radiance.pixels()[index], sphere::solid_angle_of_texel(row, width, height) as f32)
        });
        Source { texels: texels.collect() }
    }

    /// The mean of the light about each direction, weighted by `weight(cosine)` where the cosine is above `least`.
    /// One radiance everywhere stays that radiance exactly.
    fn blurred(&self, least: f32, weight: impl Fn(f32) -> f32 + Sync) -> RgbImage {
        let pixel = |index: usize| {
            let about = sphere::direction_of_texel(index / WIDTH, index % WIDTH, WIDTH, HEIGHT);
            let (mut sum, mut weights) = (Vec3::ZERO, 0.0f32);
            for &(direction, radiance, solid_angle) in &self.texels {
                let cosine = about.dot(direction);
                if cosine > least {
                    let weight = weight(cosine.min(1.0)) * solid_angle;
                    sum += radiance * weight;
                    weights += weight;
                }
            }
            sum / weights.max(1e-30)
        };
        Image::from_pixels(WIDTH, HEIGHT, parallel::map(WIDTH * HEIGHT, pixel))
    }
}

/// What the lobe reflects of an even light: `F0 * table.x + table.y`, over `n.o` in columns and the microfacet width in
/// rows, both in [0, 1] with texel centres at `(index + 0.5) / TABLE_SIZE`. z is 0.
///
/// The integral of the lobe of [`crate::material::lobe`] over the hemisphere, by 256 directions drawn from it.
pub(super) fn reflectance_table(lobe: LobeModel) -> &'static RgbImage {
    static OF_BLINN_PHONG: LazyLock<RgbImage> = LazyLock::new(|| table_of(LobeModel::BlinnPhong));
    static OF_GGX: LazyLock<RgbImage> = LazyLock::new(|| table_of(LobeModel::Ggx));
    match lobe {
        LobeModel::BlinnPhong => &OF_BLINN_PHONG,
        LobeModel::Ggx => &OF_GGX,
    }
}

fn table_of(lobe: LobeModel) -> RgbImage {
    let cell = |index: usize| {
        let at = |place: usize| (place as f32 + 0.5) / TABLE_SIZE as f32;
        reflectance(lobe, at(index % TABLE_SIZE), at(index / TABLE_SIZE))
    };
    Image::from_pixels(TABLE_SIZE, TABLE_SIZE, parallel::map(TABLE_SIZE * TABLE_SIZE, cell))
}

fn reflectance(lobe: LobeModel, cos_out: f32, width: f32) -> Vec3 {
    const SAMPLES: u32 = 256;
    let towards_viewer = Vec3::new((1.0 - cos_out * cos_out).max(0.0).sqrt(), 0.0, cos_out);
    let frame = Frame::around(Vec3::Z);
    // Channel 0 reflects nothing at normal incidence, channel 1 everything: their difference is the part by F0.
    let material = Material { diffuse: [0.0; 3], specular: [0.0, 1.0, 1.0], log_width: width.ln() };
    let sampler = material.sampler(lobe, cos_out, 1.0);
    let mut sum = Vec3::ZERO;
    for sample in 0..SAMPLES {
        let even = (sample as f32 + 0.5) / SAMPLES as f32;
        let u = radical_inverse(sample + 1, 2);
        let Some(light) = sampler.sample(&frame, towards_viewer, [even, u]) else { continue };
        let Some(geometry) = LobeGeometry::new(Vec3::Z, light, towards_viewer) else { continue };
        let [low, high, _] = material.reflect_by(lobe, &geometry, 1.0);
        let density = sampler.density(&geometry);
        if density > 0.0 {
            sum += Vec3::new(high - low, low, 0.0) / density;
        }
    }
    sum / SAMPLES as f32
}

/// The radical inverse of an index in a base (van der Corput 1935), in [0, 1).
fn radical_inverse(mut index: u32, base: u32) -> f32 {
    let (mut place, mut sum) = (1.0 / base as f32, 0.0);
    while index > 0 {
        sum += (index % base) as f32 * place;
        index /= base;
        place /= base as f32;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::sky::{SkySettings, sun_and_sky};
    use std::f32::consts::PI;

    #[test]
    fn an_even_light_stays_even_at_every_blur() {
        let even = Environment::constant(16, 8, Vec3::new(0.5, 1.0, 2.0));
        for light in LobeModel::ALL.map(|lobe| prepare(&even, lobe)) {
            assert_eq!(light.layers.len(), 1 + WIDTHS);
            for pixel in light.layers.iter().flat_map(|layer| layer.pixels()) {
                assert!((*pixel - Vec3::new(0.5, 1.0, 2.0)).abs().max_element() < 2e-3, "{pixel}");
            }
        }
    }

    #[test]
    fn the_matt_layer_is_the_irradiance_and_a_wider_blur_is_flatter() {
        let sky = sun_and_sky(64, 32, &SkySettings::noon());
        let [light, of_ggx] = LobeModel::ALL.map(|lobe| prepare(&sky, lobe));
        let largest = sky.irradiance(Vec3::Y).as_vec3().max_element() / PI;
        for place in [0, 300, 900, 1500, 2047] {
            let normal = sphere::direction_of_texel(place / WIDTH, place % WIDTH, WIDTH, HEIGHT);
            let expected = sky.irradiance(normal).as_vec3() / PI;
            let departure = (light.layers[0].pixels()[place] - expected).abs().max_element();
            assert!(departure < 0.02 * largest, "{place}: {departure} of {largest}");
        }
        let peak = |layer: &RgbImage| layer.pixels().iter().map(|rgb| rgb.y).fold(0.0, f32::max);
        let peaks: Vec<f32> = light.layers[1..].iter().map(peak).collect();
        assert!(peaks.is_sorted_by(|sharper, wider| sharper >= wider), "{peaks:?}");
        // Where the sun is not, its tails are.
        let [median, of_ggx] = [&light, &of_ggx].map(|light| {
            let mut values: Vec<f32> = light.layers[2].pixels().iter().map(|rgb| rgb.y).collect();
            values.sort_by(f32::total_cmp);
            values[values.len() / 2]
        });
        assert!(of_ggx > 1.02 * median, "{of_ggx} {median}");
    }

    #[test]
    fn the_table_reflects_no_more_than_arrives_and_more_at_grazing_angles() {
        LobeModel::ALL.into_iter().for_each(table_is_sound);
    }

    fn table_is_sound(lobe: LobeModel) {
        let table = reflectance_table(lobe);
        for row in 0..TABLE_SIZE {
            for column in 0..TABLE_SIZE {
                let cell = table[(row, column)];
                assert!(cell.min_element() >= 0.0 && cell.x + cell.y < 1.2, "row {row} column {column}: {cell}");
            }
            assert!(table[(row, 2)].y > table[(row, TABLE_SIZE - 1)].y, "row {row}");
        }
        // A near mirror seen straight on reflects F0 and nothing else.
        let mirror = table[(0, TABLE_SIZE - 1)];
        assert!((mirror.x - 1.0).abs() < 0.05 && mirror.y < 0.01, "{mirror}");
    }
}
