//! The passes of a picture that refines, of a few samples a pixel, and their mean.
//!
//! [`Accumulation`] is the mean so far. The samples of a pixel are one sequence over all passes, so that together they cover
//! their square as evenly as if they had been taken at once: a pass depends on the settings, the view, the number of its
//! samples and the number of those before it, never on threads or on what was stopped, and the same passes make the same bits. A pass that is stopped half-way leaves no trace: the mean is one of
//! whole pictures.

use super::accumulate::PassKey;
use super::path::PathArena;
use super::progressive::PictureTracer;
use crate::image::resize::enlarge;
use crate::image::{GreyImage, Image, RgbImage};
use crate::scene::Camera;
use glam::Vec3;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Side of a tile in pixels: at one sample a pixel a tile takes about a millisecond.
pub const TILE_PIXELS: usize = 16;

impl PictureTracer<'_> {
    /// A picture of one sample a pixel at `1/factor` of the camera's size, enlarged bilinearly to the full size: an
    /// instant answer while the first pass is on its way. `None` when stopped.
    pub fn coarse(
        &self,
        camera: &Camera,
        view: u32,
        factor: usize,
        stop: &AtomicBool,
        after_tile: &(dyn Fn(Duration) + Sync),
    ) -> Option<RgbImage> {
        let factor = factor.max(1);
        let small = Camera {
            width: camera.width.div_ceil(factor),
            height: camera.height.div_ceil(factor),
            focal_pixels: camera.focal_pixels / factor as f32,
            centre_pixels: camera.centre_pixels / factor as f32,
            ..*camera
        };
        let mut accumulation = Accumulation::new(small.width, small.height);
        // Numbers that no pass of the full size uses.
        let key = PassKey::whole(self.settings().seed, u32::MAX - factor as u32, view, 0);
        accumulation.add_by(self, &small, key, 1, stop, after_tile).then_some(())?;
        // The small picture may reach over the border of the full one by less than one of its pixels.
        let large = enlarge(&accumulation.mean, small.width * factor, small.height * factor);
        Some(Image::from_fn(camera.width, camera.height, |row, column| large[(row, column)]))
    }
}

/// The mean of the passes so far.
#[derive(Clone, Debug, PartialEq)]
pub struct Accumulation {
    mean: RgbImage,
    coverage: GreyImage,
    samples: usize,
    passes: u32,
    non_finite: usize,
}

impl Accumulation {
    /// Nothing yet, for a picture of this size.
    pub fn new(width: usize, height: usize) -> Self {
        Accumulation {
            mean: Image::filled(width, height, Vec3::ZERO),
            coverage: Image::filled(width, height, 0.0),
            samples: 0,
            passes: 0,
            non_finite: 0,
        }
    }

    /// Samples a pixel so far.
    pub fn samples(&self) -> usize {
        self.samples
    }

    /// Passes so far.
    pub fn passes(&self) -> u32 {
        self.passes
    }

    /// The mean so far in linear radiance; black before the first pass.
    pub fn picture(&self) -> &RgbImage {
        &self.mean
    }

    /// Share of each pixel that the surface covers or its shadow on the ground darkens, in [0, 1].
    pub fn coverage(&self) -> &GreyImage {
        &self.coverage
    }

    /// Pixels of single passes that were not finite; they counted as black.
    pub fn non_finite(&self) -> usize {
        self.non_finite
    }

    /// Adds the next pass of `samples` samples a pixel, which all pixels of a camera of this picture's size take.
    /// `after_tile` is told how long each tile took, on the thread that made it: it may sleep. Returns whether the pass
    /// was added: one that `stop` ends is dropped.
    ///
    /// # Panics
    /// When the camera has another size: a defect of the caller.
    pub fn add_pass(
        &mut self,
        tracer: &PictureTracer<'_>,
        camera: &Camera,
        view: u32,
        samples: usize,
        stop: &AtomicBool,
        after_tile: &(dyn Fn(Duration) + Sync),
    ) -> bool {
        let key = PassKey::whole(tracer.settings().seed, 0, view, self.samples as u32);
        self.add_by(tracer, camera, key, samples, stop, after_tile)
    }

    fn add_by(
        &mut self,
        tracer: &PictureTracer<'_>,
        camera: &Camera,
        key: PassKey,
        samples: usize,
        stop: &AtomicBool,
        after_tile: &(dyn Fn(Duration) + Sync),
    ) -> bool {
        let (width, height) = (self.mean.width(), self.mean.height());
        assert_eq!((camera.width, camera.height), (width, height), "the camera of an accumulation");
        let samples = samples.max(1);
        let tiles_across = width.div_ceil(TILE_PIXELS);
        let tiles = tiles_across * height.div_ceil(TILE_PIXELS);
        let done = AtomicUsize::new(0);
        let parts: Vec<Vec<(Vec3, f32)>> = (0..tiles)
            .into_par_iter()
            // Each tile is a task of its own: the last one to end is short.
            .with_max_len(1)
            .map_init(PathArena::default, |arena, tile| {
                if stop.load(Ordering::Relaxed) {
                    return Vec::new();
                }
                let began = Instant::now();
                let mut part = Vec::with_capacity(TILE_PIXELS * TILE_PIXELS);
                for pixel in pixels_of_tile(tile, width, height) {
                    if stop.load(Ordering::Relaxed) {
                        return Vec::new();
                    }
                    part.push(tracer.pixel_by(camera, key, pixel, samples, arena));
                }
                done.fetch_add(1, Ordering::Relaxed);
                after_tile(began.elapsed());
                part
            })
            .collect();
        if done.into_inner() < tiles {
            return false;
        }
        self.samples += samples;
        self.passes += 1;
        let share = samples as f32 / self.samples as f32;
        for (tile, part) in parts.into_iter().enumerate() {
            for (pixel, (radiance, coverage)) in pixels_of_tile(tile, width, height).zip(part) {
                let radiance = if radiance.is_finite() {
                    radiance
                } else {
                    self.non_finite += 1;
                    Vec3::ZERO
                };
                let mean = &mut self.mean.pixels_mut()[pixel];
                *mean += (radiance - *mean) * share;
                let covered = &mut self.coverage.pixels_mut()[pixel];
                *covered += (coverage - *covered) * share;
            }
        }
        true
    }
}

/// Samples of the next pass after `done` of `target`: 1, 1, 2, 4, 4, ...: the first pictures come soon, later ones are
/// worth their walk. 0 when the target is reached.
pub fn samples_of_next_pass(done: usize, target: usize) -> usize {
    done.clamp(1, 4).min(target.saturating_sub(done))
}

/// Row-major indices of the pixels of a tile.
fn pixels_of_tile(tile: usize, width: usize, height: usize) -> impl Iterator<Item = usize> {
    let across = width.div_ceil(TILE_PIXELS);
    let (top, left) = (tile / across * TILE_PIXELS, tile % across * TILE_PIXELS);
    let (bottom, right) = ((top + TILE_PIXELS).min(height), (left + TILE_PIXELS).min(width));
    (top..bottom).flat_map(move |row| (left..right).map(move |column| row * width + column))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_cover_each_pixel_once_and_passes_reach_their_target() {
        let (width, height) = (37, 18);
        let mut counts = vec![0; width * height];
        for tile in 0..width.div_ceil(TILE_PIXELS) * height.div_ceil(TILE_PIXELS) {
            pixels_of_tile(tile, width, height).for_each(|pixel| counts[pixel] += 1);
        }
        assert!(counts.iter().all(|&count| count == 1));
        let mut passes = Vec::new();
        let mut done = 0;
        while samples_of_next_pass(done, 11) > 0 {
            passes.push(samples_of_next_pass(done, 11));
            done += passes[passes.len() - 1];
        }
        assert_eq!(passes, [1, 1, 2, 4, 3]);
    }
}
