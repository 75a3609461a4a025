//! Pictures and layers of a view.

use super::first_hits::{CameraRays, PixelFilter};
use super::path::PathArena;
pub use super::picture_settings::PictureSettings;
use super::progressive::PictureTracer;
use super::sums::Parameters;
use super::surface::Surface;
use crate::image::{GreyImage, Image, RgbImage};
use crate::math::parallel;
use crate::math::random::{SampleStream, StreamKey};
use crate::scene::Camera;
use glam::Vec3;
use std::sync::atomic::{AtomicBool, Ordering};

/// A picture in linear radiance.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Linear RGB.
    pub radiance: RgbImage,
    /// Variance of each pixel's mean, from independent groups of samples; `None` for one group.
    pub variance: Option<RgbImage>,
    /// Share of each pixel that the surface covers, in [0, 1].
    pub coverage: GreyImage,
    /// Pixels that were not finite and are black instead.
    pub non_finite_pixels: usize,
}

impl Picture {
    /// Pixels that surface covers wholly.
    pub fn fully_covered(&self) -> Image<bool> {
        self.coverage.map(|&coverage| coverage >= 0.999)
    }
}

/// Renders a view by path tracing. Stops early, with black pixels, when `stop` is set.
pub fn render(
    surface: &Surface,
    camera: &Camera,
    parameters: &Parameters<f32>,
    view: u32,
    settings: &PictureSettings,
    stop: &AtomicBool,
) -> Picture {
    let tracer = PictureTracer::new(surface, parameters, *settings);
    picture_of_groups(camera, settings.groups, stop, PathArena::default, |arena, pixel, group| {
        let (mean, coverage) = tracer.pixel(camera, view, pixel, settings.samples, group, arena);
        (mean, 1.0 - coverage)
    })
}

/// A picture whose pixels are means over independent groups of samples; 0 groups count as one. `of_group` has what
/// `scratch` makes for some pixels in turn, the row-major index of the pixel and the number of the group, and returns the group's
/// mean radiance and the share of its camera rays that met nothing. A pixel that is not finite becomes black and is
/// counted. Pixels that are begun after `stop` is set are black.
pub(super) fn picture_of_groups<Scratch>(
    camera: &Camera,
    groups: usize,
    stop: &AtomicBool,
    scratch: impl Fn() -> Scratch + Sync + Send,
    of_group: impl Fn(&mut Scratch, usize, u32) -> (Vec3, f32) + Sync + Send,
) -> Picture {
    let groups = groups.max(1);
    let of_pixel = |scratch: &mut Scratch, pixel: usize| {
        if stop.load(Ordering::Relaxed) {
            return (Vec3::ZERO, Vec3::ZERO, 0.0, true);
        }
        let (mut mean, mut squared_deviations, mut escaped) = (Vec3::ZERO, Vec3::ZERO, 0.0);
        for group in 0..groups {
            let (value, escaped_of_group) = of_group(scratch, pixel, group as u32);
            let delta = value - mean;
            mean += delta / (group + 1) as f32;
            squared_deviations += delta * (value - mean);
            escaped += escaped_of_group;
        }
        let variance = squared_deviations / ((groups - 1).max(1) * groups) as f32;
        let coverage = 1.0 - escaped / groups as f32;
        if mean.is_finite() { (mean, variance, coverage, true) } else { (Vec3::ZERO, Vec3::ZERO, coverage, false) }
    };
    let pixels = parallel::map_with(camera.width * camera.height, scratch, of_pixel);
    let (width, height) = (camera.width, camera.height);
    let image = |pixel: fn(&(Vec3, Vec3, f32, bool)) -> Vec3| {
        Image::from_pixels(width, height, pixels.iter().map(pixel).collect())
    };
    Picture {
        radiance: image(|pixel| pixel.0),
        variance: (groups > 1).then(|| image(|pixel| pixel.1)),
        coverage: Image::from_pixels(width, height, pixels.iter().map(|pixel| pixel.2).collect()),
        non_finite_pixels: pixels.iter().filter(|pixel| !pixel.3).count(),
    }
}

/// Layers of a view without light: what the camera sees of the maps.
#[derive(Clone, Debug, PartialEq)]
pub struct Layers {
    /// Diffuse reflectance, linear RGB, averaged over the covered part of each pixel.
    pub diffuse: RgbImage,
    /// Specular reflectance F0.
    pub specular: RgbImage,
    /// Roughness `r = a^2`.
    pub roughness: GreyImage,
    /// Unit shading normal in the world; zero where nothing is seen.
    pub normal: RgbImage,
    /// Share of each pixel that the surface covers, in [0, 1].
    pub coverage: GreyImage,
}

/// Renders the layers of a view with `samples` rays a pixel.
pub fn layers(surface: &Surface, camera: &Camera, parameters: &Parameters<f32>, samples: usize) -> Layers {
    #[derive(Clone, Copy, Default)]
    struct Pixel {
        diffuse: Vec3,
        specular: Vec3,
        roughness: f32,
        normal: Vec3,
        coverage: f32,
    }
    let samples = samples.max(1);
    let rays = CameraRays::fresh(surface, camera, PixelFilter::Box, samples);
    let pixels = parallel::map_small(camera.width * camera.height, |pixel| {
        let mut sum = Pixel::default();
        for sample in 0..samples {
            let mut stream = SampleStream::new(StreamKey::new(0, 0, 0, pixel as u32), sample as u32);
            let (ray, Some(hit)) = rays.at(pixel, sample, stream.next_pair()) else { continue };
            let point = surface.point(&hit);
            if point.geometric_normal.dot(ray.direction) >= 0.0 {
                continue;
            }
            let material = parameters.texels.fetch(&parameters.texels.tap(point.uv, 0));
            sum.diffuse += Vec3::from_array(material.diffuse);
            sum.specular += Vec3::from_array(material.specular);
            sum.roughness += (2.0 * material.log_width).exp();
            sum.normal += point.shading_normal;
            sum.coverage += 1.0;
        }
        let share = if sum.coverage > 0.0 { 1.0 / sum.coverage } else { 0.0 };
        Pixel {
            diffuse: sum.diffuse * share,
            specular: sum.specular * share,
            roughness: sum.roughness * share,
            normal: sum.normal.normalize_or_zero(),
            coverage: sum.coverage / samples as f32,
        }
    });
    let (width, height) = (camera.width, camera.height);
    let rgb = |pick: fn(&Pixel) -> Vec3| Image::from_pixels(width, height, pixels.iter().map(pick).collect());
    let grey = |pick: fn(&Pixel) -> f32| Image::from_pixels(width, height, pixels.iter().map(pick).collect());
    Layers {
        diffuse: rgb(|pixel| pixel.diffuse),
        specular: rgb(|pixel| pixel.specular),
        roughness: grey(|pixel| pixel.roughness),
        normal: rgb(|pixel| pixel.normal),
        coverage: grey(|pixel| pixel.coverage),
    }
}
