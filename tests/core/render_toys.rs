//! Our pictures against Mitsuba's of the same scene, within noise.
//!
//! The scene and its reference pictures lie beside the project (`PATINA_PEERS`, or `../shared/peers`); without them the
//! test says that it was skipped. The references were rendered by Mitsuba 3 with the same reflection model as a plugin,
//! 1024 samples a pixel (256 for direct light only), at one and at three surface hits.
//!
//! One thing differs by design: Mitsuba interpolates roughness `r = a^2` between texels, Patina interpolates `log a`,
//! which is what it fits. Along borders between dull and polished texels Patina is a little sharper. The test resamples
//! the maps to a finer grid the Mitsuba way, which leaves nothing of the difference.

#![allow(clippy::unwrap_used)]

use super::beside::peers;
use glam::{DVec3, Vec3};
use patina::image::{GreyImage, Image, RgbImage};
use patina::material::MaterialMaps;
use patina::material::texels::{PyramidWeights, TexelPyramid, texels_from_maps};
use patina::math::statistics::Moments;
use patina::render::picture::{Picture, PictureSettings, render};
use patina::render::{Parameters, Surface};
use patina::scene::{ReadSettings, Scene, read};
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

/// How many times finer the maps are resampled.
const FINER: usize = 4;

fn toys() -> Option<PathBuf> {
    peers("scenes/toys/cameras.json")?;
    peers("scenes/toys")
}

/// A map resampled to `FINER` times its size by bilinear interpolation of its own numbers.
fn finer<T: Copy + std::ops::Add<Output = T> + std::ops::Mul<f32, Output = T>>(map: &Image<T>) -> Image<T> {
    let place = |index: usize, size: usize| {
        let x = ((index as f32 + 0.5) / FINER as f32 - 0.5).clamp(0.0, (size - 1) as f32);
        let low = x as usize;
        (low, (low + 1).min(size - 1), x - low as f32)
    };
    Image::from_fn(map.width() * FINER, map.height() * FINER, |row, column| {
        let (upper, lower, down) = place(row, map.height());
        let (left, right, across) = place(column, map.width());
        (map[(upper, left)] * (1.0 - across) + map[(upper, right)] * across) * (1.0 - down)
            + (map[(lower, left)] * (1.0 - across) + map[(lower, right)] * across) * down
    })
}

fn parameters(scene: &Scene, resample: bool) -> Parameters<f32> {
    let truth = scene.truth.as_ref().unwrap();
    let maps = if resample {
        MaterialMaps {
            diffuse: finer::<Vec3>(&truth.maps.diffuse),
            specular: finer::<Vec3>(&truth.maps.specular),
            roughness: finer::<f32>(&truth.maps.roughness) as GreyImage,
        }
    } else {
        truth.maps.clone()
    };
    let weights = PyramidWeights::flat(maps.diffuse.width(), maps.diffuse.height());
    Parameters::new(TexelPyramid::from_base(texels_from_maps(&maps), &weights), &truth.environment)
}

/// What a comparison found. Both pictures are noisy, and by how much is told by how their differences scatter inside
/// blocks of pixels.
#[derive(Debug)]
struct Agreement {
    /// Sum of the differences over the sum of the reference.
    relative_bias: f64,
    /// Standard error of the relative bias.
    bias_error: f64,
    /// Mean of z, a block's mean difference over its standard error, over blocks and channels, and of its square.
    mean_z: f64,
    mean_z_squared: f64,
    /// Share of |z| above 4.
    outliers: f64,
    /// Blocks times channels.
    values: usize,
    /// Sum of the squared differences over what the noise of both makes of it: above 1 where pictures differ in what
    /// blocks do not show, by half a pixel for example.
    scatter: f64,
}

/// Standard deviation of a pixel of 16 of the reference's paths over the mean of the picture, by `patina bench tracer`.
const NOISE_OF_REFERENCE: f64 = 0.266;

/// Side of a block in pixels.
const BLOCK: usize = 8;

/// Compares where the reference has light.
fn compare(picture: &Picture, reference: &RgbImage, reference_samples: usize) -> Agreement {
    assert!(reference.width().is_multiple_of(BLOCK) && reference.height().is_multiple_of(BLOCK));
    let (mut z, mut z_squared, mut outliers) = (Moments::default(), Moments::default(), 0usize);
    let (mut difference, mut total, mut variances) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
    for block in 0..(reference.width() / BLOCK) * (reference.height() / BLOCK) {
        let columns = reference.width() / BLOCK;
        let (top, left) = (block / columns * BLOCK, block % columns * BLOCK);
        let mut moments = [Moments::default(); 3];
        for place in (0..BLOCK * BLOCK).map(|pixel| (top + pixel / BLOCK, left + pixel % BLOCK)) {
            let (own, theirs) = (picture.radiance[place].as_dvec3(), reference[place].as_dvec3());
            difference += own - theirs;
            total += theirs;
            (0..3).filter(|&c| theirs[c] > 0.0).for_each(|c| moments[c].add(own[c] - theirs[c]));
        }
        for (channel, moments) in moments.iter().enumerate() {
            let count = moments.count as f64;
            variances[channel] += moments.variance() * count;
            // Blocks that only touch the surface say nothing of how pixels scatter.
            if moments.count as usize > BLOCK * BLOCK / 2 && moments.variance() > 0.0 {
                let value = moments.mean / (moments.variance() / count).sqrt();
                z.add(value);
                z_squared.add(value * value);
                outliers += usize::from(value.abs() > 4.0);
            }
        }
    }
    let own_variance: DVec3 = picture.variance.as_ref().unwrap().pixels().iter().map(|v| v.as_dvec3()).sum();
    let squares: f64 = picture
        .radiance
        .pixels()
        .iter()
        .zip(reference.pixels())
        .map(|(own, theirs)| (own.as_dvec3() - theirs.as_dvec3()).length_squared())
        .sum();
    let values = 3.0 * reference.pixels().len() as f64;
    let noise_of_reference =
        NOISE_OF_REFERENCE * total.element_sum() / values * (16.0 / reference_samples as f64).sqrt();
    let expected = own_variance.element_sum() + values * noise_of_reference * noise_of_reference;
    // Channels move together: their standard deviations are added, not their variances.
    let bias_error = (variances.x.sqrt() + variances.y.sqrt() + variances.z.sqrt()) / total.element_sum();
    Agreement {
        relative_bias: difference.element_sum() / total.element_sum(),
        bias_error,
        mean_z: z.mean,
        mean_z_squared: z_squared.mean,
        outliers: outliers as f64 / z.count.max(1) as f64,
        values: z.count as usize,
        scatter: squares / expected,
    }
}

fn references(folder: &std::path::Path, sub: &str, scene: &Scene, view: usize) -> RgbImage {
    patina::image::file::read_rgb(&folder.join(sub).join(format!("{}.exr", scene.views[view].name))).unwrap()
}

#[test]
fn a_picture_agrees_with_mitsubas_at_one_and_three_surface_hits() {
    agree_with_mitsuba(&[0], 8);
}

#[test]
#[ignore = "slow: two views at four times the samples"]
fn pictures_agree_with_mitsuba_at_one_and_three_surface_hits() {
    agree_with_mitsuba(&[0, 1], 32);
}

/// Paths of a group.
const SAMPLES: usize = 4;

/// Compares views by their numbers, of so many groups a pixel.
fn agree_with_mitsuba(views: &[usize], groups: usize) {
    let Some(folder) = toys() else { return };
    let settings = ReadSettings { hold_out_every: 0, ..ReadSettings::default() };
    let scene = read(&folder, &settings).unwrap();
    let surface = Surface::new(scene.mesh.clone()).unwrap();
    let parameters = parameters(&scene, true);
    let views: Vec<usize> = views
        .iter()
        .filter_map(|name| scene.views.iter().position(|view| view.name.ends_with(&format!("{name:04}"))))
        .collect();
    assert!(!views.is_empty());
    let groups: usize = std::env::var("PATINA_TOYS_GROUPS").map_or(groups, |groups| groups.parse().unwrap());
    for (sub, max_bounces, reference_samples) in [("views_d2", 1, 256), ("views", 3, 1024)] {
        for &view in &views {
            let picture_settings = PictureSettings {
                samples: SAMPLES,
                groups,
                max_bounces,
                background_visible: false,
                seed: 5 + view as u64,
                ..PictureSettings::default()
            };
            let camera = scene.views[view].camera;
            let stop = AtomicBool::new(false);
            let picture = render(&surface, &camera, &parameters, view as u32, &picture_settings, &stop);
            let reference = references(&folder, sub, &scene, view);
            let own = compare(&picture, &reference, reference_samples);
            println!("{sub} view {view}: {own:?}");
            assert_eq!(picture.non_finite_pixels, 0);
            assert!(own.values > 1000, "{sub} view {view}: {own:?}");
            assert!(own.relative_bias.abs() < 2e-3, "{sub} view {view}: {own:?}");
            assert!(own.relative_bias.abs() < 4.0 * own.bias_error, "{sub} view {view}: {own:?}");
            // A wrong renderer leaves shifted means; channels of a block move together.
            assert!(own.mean_z.abs() < 0.1 && own.outliers < 0.002, "{sub} view {view}: {own:?}");
            assert!(own.mean_z_squared < 1.2, "{sub} view {view}: {own:?}");
            assert!(own.scatter < 1.15, "{sub} view {view}: {own:?}");
        }
    }
}

#[test]
fn interpolating_the_logarithm_of_the_width_changes_pictures_by_less_than_a_thousandth() {
    let Some(folder) = toys() else { return };
    let settings = ReadSettings { max_views: 2, hold_out_every: 0, ..ReadSettings::default() };
    let scene = read(&folder, &settings).unwrap();
    let surface = Surface::new(scene.mesh.clone()).unwrap();
    let both = [false, true].map(|resample| parameters(&scene, resample));
    for max_bounces in [1, 3] {
        let picture_settings =
            PictureSettings { samples: 8, max_bounces, background_visible: false, ..PictureSettings::default() };
        let [ours, theirs] = both.each_ref().map(|parameters| {
            let stop = AtomicBool::new(false);
            let camera = scene.views[0].camera;
            let picture = render(&surface, &camera, parameters, 0, &picture_settings, &stop);
            picture.radiance.pixels().iter().map(|pixel| pixel.as_dvec3()).sum::<DVec3>().element_sum()
        });
        // The same random numbers: next to all of the noise cancels.
        let relative = ours / theirs - 1.0;
        println!("{max_bounces} hits: interpolating log width is brighter by {relative:.2e}");
        assert!(relative.abs() < 1e-3, "{relative}");
    }
}
