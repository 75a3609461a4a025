//! Whole pictures of an object under any light: re-renders, relit pictures, and the inputs of studies.
//!
//! Nothing is stored between pixels, so a picture may have any size. [`render`] uses the nodes of a fit; [`render_exact`]
//! asks the reflectance itself at every part of every texel, and is what studies photograph with.

use super::geometry::{ObjectGeometry, ObjectPixel, Visibility};
use super::nodes::{NodeGrid, NodeReader, NodeTable, weights};
use super::transport::TexelDirections;
use crate::image::{GreyImage, Image, RgbImage};
use crate::light::Environment;
use crate::math::{luminance, parallel};
use crate::measured::coordinates::HalfDifference;
use glam::{DVec3, Vec3};

/// Pixels a task.
const CHUNK: usize = 32;

/// Pictures of an object under several lights of the same size; black where the object is not.
pub fn render(
    geometry: &ObjectGeometry,
    visibility: Option<&Visibility>,
    directions: &TexelDirections,
    grid: &NodeGrid,
    table: &NodeTable,
    lights: &[&Environment],
) -> Vec<RgbImage> {
    let table = NodeReader::new(table);
    pictures(geometry, visibility, lights.len(), |pixel, is_visible, results| {
        let mut sums = vec![DVec3::ZERO; lights.len()];
        directions.for_each_batch(pixel, is_visible, |batch| {
            let places = grid.places(batch);
            for part in 0..batch.len() {
                let place = places.of(part);
                let value = table.between(grid.corners(place.cell), weights(place.fraction));
                for (sum, light) in sums.iter_mut().zip(lights) {
                    *sum += (value * light.radiance.pixels()[batch.texel(part)] * batch.weight(part)).as_dvec3();
                }
            }
        });
        results.extend(sums.iter().map(|sum| sum.as_vec3()));
    })
}

/// Writes the reflectance at many places, in 1/sr.
pub type ReflectanceAt<'a> = dyn Fn(&[HalfDifference], &mut [[f64; 3]]) + Sync + 'a;

/// Pictures under several lights of a reflectance that is asked itself at every part of every texel, once for all
/// lights.
pub fn render_exact(
    geometry: &ObjectGeometry,
    visibility: Option<&Visibility>,
    directions: &TexelDirections,
    evaluate: &ReflectanceAt,
    lights: &[&Environment],
) -> Vec<RgbImage> {
    pictures(geometry, visibility, lights.len(), |pixel, is_visible, results| {
        let (mut at, mut places) = (Vec::new(), Vec::new());
        directions.for_each_batch(pixel, is_visible, |batch| {
            for part in 0..batch.len() {
                at.push(HalfDifference {
                    theta_half: f64::from(batch.half[part]),
                    theta_difference: f64::from(batch.difference[part]),
                    phi_difference: f64::from(batch.azimuth[part]),
                });
                places.push((batch.texel(part), f64::from(batch.weight(part))));
            }
        });
        let mut values = vec![[0.0; 3]; at.len()];
        evaluate(&at, &mut values);
        for light in lights {
            let radiance = light.radiance.pixels();
            let sum: DVec3 = values
                .iter()
                .zip(&places)
                .map(|(value, &(texel, weight))| DVec3::from_array(*value) * radiance[texel].as_dvec3() * weight)
                .sum();
            results.push(sum.as_vec3());
        }
    })
}

/// Pictures under so many lights: `shade` is given a pixel and which texels of the light it sees, and pushes its radiance
/// under each of them.
fn pictures(
    geometry: &ObjectGeometry,
    visibility: Option<&Visibility>,
    lights: usize,
    shade: impl Fn(&ObjectPixel, &dyn Fn(usize) -> bool, &mut Vec<Vec3>) + Sync,
) -> Vec<RgbImage> {
    let parts: Vec<Vec<Vec3>> = parallel::map_chunks(&geometry.pixels, CHUNK, |chunk, pixels| {
        let mut results = Vec::with_capacity(pixels.len() * lights);
        for (offset, pixel) in pixels.iter().enumerate() {
            let index = chunk * CHUNK + offset;
            shade(pixel, &|texel| visibility.is_none_or(|bits| bits.is_visible(index, texel)), &mut results);
        }
        results
    });
    let values: Vec<Vec3> = parts.concat();
    (0..lights).map(|light| picture_of(geometry, values.iter().skip(light).step_by(lights.max(1)).copied())).collect()
}

fn picture_of(geometry: &ObjectGeometry, values: impl Iterator<Item = Vec3>) -> RgbImage {
    let mut picture = Image::filled(geometry.width, geometry.height, Vec3::ZERO);
    for (pixel, value) in geometry.pixels.iter().zip(values) {
        picture[(pixel.row as usize, pixel.column as usize)] = value;
    }
    picture
}

/// Root mean square of the logarithm of one picture over another, over the pixels of an object: as they are, and after
/// the best factor per channel. `epsilon` is added to both.
pub fn log_errors(geometry: &ObjectGeometry, picture: &RgbImage, truth: &RgbImage, epsilon: f32) -> (f64, f64) {
    let mut sums = [(0.0f64, 0.0f64); 3];
    for pixel in &geometry.pixels {
        let place = (pixel.row as usize, pixel.column as usize);
        for (channel, sums) in sums.iter_mut().enumerate() {
            let log = |image: &RgbImage| f64::from((image[place][channel].max(0.0) + epsilon).ln());
            let difference = log(picture) - log(truth);
            sums.0 += difference;
            sums.1 += difference * difference;
        }
    }
    let count = geometry.pixels.len().max(1) as f64;
    let raw = sums.iter().map(|sums| sums.1).sum::<f64>() / (3.0 * count);
    let aligned = sums.iter().map(|sums| sums.1 - sums.0 * sums.0 / count).sum::<f64>() / (3.0 * count);
    (raw.sqrt(), aligned.max(0.0).sqrt())
}

/// The logarithm of one picture over another, of their luminance, at each pixel of an object; NaN beside it. `epsilon`
/// is added to both.
pub fn log_error_map(geometry: &ObjectGeometry, picture: &RgbImage, truth: &RgbImage, epsilon: f32) -> GreyImage {
    let mut map = Image::filled(geometry.width, geometry.height, f32::NAN);
    for pixel in &geometry.pixels {
        let place = (pixel.row as usize, pixel.column as usize);
        let log = |image: &RgbImage| (luminance(image[place]).max(0.0) + epsilon).ln();
        map[place] = log(picture) - log(truth);
    }
    map
}
