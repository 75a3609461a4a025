//! How far the cache's pictures are from the path tracer's, with what was found: the solver's own error of model.
//!
//! Two independent estimates of the path tracer are held against one picture of the cache. The product of the two
//! differences has the squared error as its mean whatever the noise, so few paths a pixel are enough.

use super::estimate::Estimate;
use super::scene::SolverScene;
use crate::material::texels::{PyramidWeights, TexelPyramid, texels_from_maps};
use crate::math::parallel;
use crate::render::cached::ViewFootprints;
use crate::render::path::PathArena;
use crate::render::picture::PictureSettings;
use crate::render::progressive::PictureTracer;
use crate::render::{Parameters, Surface};
use std::borrow::Cow;
use std::sync::atomic::{AtomicBool, Ordering};

/// Most views that are looked at.
const VIEWS: usize = 3;
/// Most pixels of a view.
const PIXELS_OF_VIEW: usize = 1500;
/// Paths a pixel of one estimate.
const SAMPLES: usize = 64;
/// A stream of random numbers that no step of a fit uses.
const SEED_OF_CHECK: u64 = 0x5eed_0c4e;

/// The error of cached transport in pictures of surface, over pixels that surface covers wholly.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TransportError {
    /// Root mean square difference to the path tracer over the root mean square of its pictures; at least 0.
    pub relative_rmse: f64,
    /// Mean difference over the mean of the pictures.
    pub bias: f64,
    /// Pixels that were compared.
    pub pixels: usize,
    /// Paths a pixel, both estimates together.
    pub samples: usize,
}

/// Sums of one pixel or of many: product of differences, product of estimates, difference, mean.
type Sums = [f64; 4];

impl SolverScene {
    /// Compares cache and path tracer with these maps and this light, in held-out views if there are any. `None` when
    /// `stop` was raised or no pixel is covered wholly.
    pub fn transport_error(&self, surface: &Surface, estimate: &Estimate, stop: &AtomicBool) -> Option<TransportError> {
        let planes = self.transport.basis.planes(&estimate.light);
        let at = self.point_light(&estimate.texels, &planes);
        let size = self.settings.map_size;
        let texels = texels_from_maps(&estimate.maps(size));
        let parameters = Parameters::new(
            TexelPyramid::from_base(texels, &PyramidWeights::flat(size, size)).with_model(self.settings.lobe),
            &estimate.environment(self.settings.light_size),
        );
        let settings = PictureSettings {
            max_bounces: self.settings.max_bounces,
            background_visible: false,
            seed: SEED_OF_CHECK ^ self.settings.seed,
            ..PictureSettings::default()
        };
        let tracer = PictureTracer::new(surface, &parameters, settings);
        let held_out = self.held_out.iter().map(|(target, footprints)| (target.view, &target.camera, Some(footprints)));
        // Of views that are fitted to only the observations' footprints were kept.
        let training = self.views.iter().zip(&self.cameras).map(|(&view, camera)| (view, camera, None));
        let all: Vec<_> = if self.held_out.is_empty() { training.collect() } else { held_out.collect() };
        let (mut sums, mut compared): (Sums, usize) = ([0.0; 4], 0);
        for &(view, camera, footprints) in all.iter().step_by(all.len().div_ceil(VIEWS).max(1)) {
            let footprints = match footprints {
                Some(footprints) => Cow::Borrowed(footprints),
                None => Cow::Owned(ViewFootprints::trace(surface, &self.transport.grid, camera, &self.first_hits)),
            };
            let footprints = footprints.as_ref();
            let picture = self.transport.picture(footprints, &estimate.texels, &planes, &at);
            let whole: Vec<usize> = (0..picture.len()).filter(|&pixel| footprints.escaped[pixel] == 0.0).collect();
            let chosen: Vec<usize> =
                whole.iter().step_by(whole.len().div_ceil(PIXELS_OF_VIEW).max(1)).copied().collect();
            let of_pixels = parallel::map_with(chosen.len(), PathArena::default, |arena, place| {
                if stop.load(Ordering::Relaxed) {
                    return [0.0; 4];
                }
                let pixel = chosen[place];
                let [first, second] =
                    [0, 1].map(|pass| tracer.pixel(camera, view as u32, pixel, SAMPLES, pass, arena).0.as_dvec3());
                let own = glam::Vec3::from_array(picture[pixel]).as_dvec3();
                let mean = 0.5 * (first + second);
                [(own - first).dot(own - second), first.dot(second), (own - mean).element_sum(), mean.element_sum()]
            });
            // In order, so that the sum has the same bits whatever the number of threads.
            for pixel in of_pixels.iter().filter(|pixel| pixel.iter().all(|value| value.is_finite())) {
                for (sum, value) in sums.iter_mut().zip(pixel) {
                    *sum += value;
                }
                compared += 1;
            }
        }
        let [squared, power, difference, mean] = sums;
        if stop.load(Ordering::Relaxed) || compared == 0 || power <= 0.0 {
            return None;
        }
        Some(TransportError {
            relative_rmse: (squared / power).max(0.0).sqrt(),
            bias: difference / mean.max(f64::MIN_POSITIVE),
            pixels: compared,
            samples: 2 * SAMPLES,
        })
    }
}
