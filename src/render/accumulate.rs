//! Pixels in parallel, gradients reduced in a fixed order.
//!
//! Pixels are cut into chunks of a fixed size; each chunk is worked by one thread into a small table of its own, and
//! tables are added to the gradient in the order of the chunks. The result does not depend on the number of threads.

mod chunk_gradient;

use self::chunk_gradient::ChunkGradient;
use super::first_hits::CameraRays;
use super::packet::{PACKET, PathStart, camera_pairs};
use super::path::{PathArena, PathTracer};
use super::sums::{ParameterGradient, Parameters, radiance, radiance_backward};
use crate::math::parallel;
use crate::math::random::{SampleStream, StreamKey};
use crate::math::real::Real;
use glam::Vec3;
use std::sync::atomic::{AtomicBool, Ordering};

/// Pixels of one chunk.
const CHUNK_PIXELS: usize = 1024;
/// Chunks that are in memory at once.
const CHUNKS_AT_ONCE: usize = 32;

/// Two independent estimates of a pixel, each the mean of half of the samples.
///
/// The product `(a - y)(b - y)` is an unbiased estimate of the squared error, where the square of a single noisy
/// estimate would add its variance; its derivative is exact for the same numbers.
#[derive(Clone, Copy, Debug)]
pub struct PixelEstimate<R> {
    /// Mean of the first half of the samples.
    pub first: [R; 3],
    /// Mean of the second half; equal to the first when there is one sample.
    pub second: [R; 3],
    /// Share of the camera rays that met nothing, in [0, 1].
    pub escaped: f32,
}

impl PixelEstimate<f32> {
    /// Mean over all samples of the pixel, of which there were so many.
    pub fn mean(&self, samples: usize) -> Vec3 {
        let share = if samples > 1 { (samples / 2) as f32 / samples as f32 } else { 1.0 };
        Vec3::from_array(self.first) * share + Vec3::from_array(self.second) * (1.0 - share)
    }
}

/// The derivative of the loss by the two estimates of a pixel.
#[derive(Clone, Copy, Debug)]
pub struct PixelDerivative<R> {
    /// The pixel's part of the loss.
    pub loss: R,
    /// Derivative by [`PixelEstimate::first`].
    pub d_first: [R; 3],
    /// Derivative by [`PixelEstimate::second`].
    pub d_second: [R; 3],
}

impl<R: Real> PixelDerivative<R> {
    fn is_finite(&self) -> bool {
        self.loss.is_finite() && self.d_first.iter().chain(&self.d_second).all(|value| value.is_finite())
    }
}

/// A loss over pixels.
pub trait PixelLoss<R>: Sync {
    /// The loss and its derivative at a pixel (row-major index); `None` where the photo says nothing.
    fn at(&self, pixel: usize, estimate: &PixelEstimate<R>) -> Option<PixelDerivative<R>>;
}

/// How the samples of a pixel go together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sequence {
    /// The two halves are independent of each other, as the product of two estimates asks for.
    Halves,
    /// All cover their square evenly together, as sample `first` and those after it of one sequence: what a mean asks for.
    /// Its variance is then less than that of two independent halves.
    Whole {
        /// Number of samples of the pixel that were taken before.
        first: u32,
    },
}

/// The random numbers of a pass.
#[derive(Clone, Copy, Debug)]
pub struct PassKey {
    /// Seed of the run.
    pub seed: u64,
    /// Step of the fit, or another number that makes passes independent.
    pub step: u32,
    /// Index of the view.
    pub view: u32,
    /// How the samples of a pixel go together.
    pub sequence: Sequence,
}

impl PassKey {
    /// The key of a pass whose halves are independent.
    pub fn halves(seed: u64, step: u32, view: u32) -> Self {
        PassKey { seed, step, view, sequence: Sequence::Halves }
    }

    /// The key of a pass for a mean, whose samples follow `first` others of the same pixel.
    pub fn whole(seed: u64, step: u32, view: u32, first: u32) -> Self {
        PassKey { seed, step, view, sequence: Sequence::Whole { first } }
    }

    /// The stream of sample `sample` of `samples` at a pixel.
    pub fn stream(&self, pixel: usize, sample: usize, samples: usize) -> SampleStream {
        let (second, number) = self.place(sample, samples);
        SampleStream::new(self.key(pixel, second), number)
    }

    /// The streams of samples from `first` on, of `samples` at a pixel; those behind the last one are of no use.
    fn streams(&self, pixel: usize, first: usize, samples: usize) -> [SampleStream; PACKET] {
        let (mut key, mut key_is_second) = (self.key(pixel, false), false);
        std::array::from_fn(|lane| {
            let (second, number) = self.place(first + lane, samples);
            if second != key_is_second {
                (key, key_is_second) = (self.key(pixel, second), second);
            }
            SampleStream::new(key, number)
        })
    }

    /// A stream for something beside the samples of this pass at a pixel; passes after it have others.
    pub fn beside(&self, pixel: usize) -> SampleStream {
        /// Sets these numbers apart from those of the paths.
        const BESIDE: u64 = 0x6265_7369_6465;
        let first = match self.sequence {
            Sequence::Whole { first } => first,
            Sequence::Halves => 0,
        };
        SampleStream::new(StreamKey::new(self.seed ^ BESIDE, self.step, self.view, pixel as u32), first)
    }

    /// Whether a sample is of the second half, and its number in its sequence.
    fn place(&self, sample: usize, samples: usize) -> (bool, u32) {
        let half = (samples / 2).max(1);
        match self.sequence {
            Sequence::Halves if sample >= half && samples > 1 => (true, (sample - half) as u32),
            Sequence::Halves => (false, sample as u32),
            Sequence::Whole { first } => (false, first + sample as u32),
        }
    }

    fn key(&self, pixel: usize, second: bool) -> StreamKey {
        StreamKey::new(self.seed ^ (u64::from(second) << 62), self.step, self.view, pixel as u32)
    }
}

/// What a pass over pixels adds up.
#[derive(Clone, Copy, Debug, Default)]
pub struct PassTotals<R> {
    /// Sum of the loss.
    pub loss: R,
    /// Pixels that said something.
    pub pixels: u64,
    /// Pixels whose estimate or derivative was not finite: left out.
    pub non_finite_pixels: u64,
    /// The first of them, row-major.
    pub first_non_finite: Option<usize>,
}

/// Traces the given pixels of a view and adds the derivatives of `loss` to `gradient`.
///
/// `gradient` is by `parameters`; its coarse mip levels are filled as well: pull them down afterwards.
/// Returns early, with the totals so far, when `stop` is set.
pub fn accumulate<R: Real>(
    tracer: &PathTracer<'_>,
    rays: &CameraRays<'_>,
    pixels: &[u32],
    key: PassKey,
    parameters: &Parameters<R>,
    loss: &impl PixelLoss<R>,
    gradient: &mut ParameterGradient<R>,
    stop: &AtomicBool,
) -> PassTotals<R> {
    let mut totals = PassTotals::default();
    let chunks: Vec<&[u32]> = pixels.chunks(CHUNK_PIXELS).collect();
    for wave in chunks.chunks(CHUNKS_AT_ONCE) {
        if stop.load(Ordering::Relaxed) {
            break;
        }
        let results = parallel::map_items(wave, |chunk| {
            let mut table = ChunkGradient::new(parameters.light.len());
            let totals = work_chunk(tracer, rays, chunk, key, parameters, loss, &mut table, stop);
            (totals, table)
        });
        for (part, table) in results {
            totals.loss += part.loss;
            totals.pixels += part.pixels;
            totals.non_finite_pixels += part.non_finite_pixels;
            totals.first_non_finite = totals.first_non_finite.or(part.first_non_finite);
            table.add_to(gradient);
        }
    }
    totals
}

fn work_chunk<R: Real>(
    tracer: &PathTracer<'_>,
    rays: &CameraRays<'_>,
    pixels: &[u32],
    key: PassKey,
    parameters: &Parameters<R>,
    loss: &impl PixelLoss<R>,
    table: &mut ChunkGradient<R>,
    stop: &AtomicBool,
) -> PassTotals<R> {
    let samples = rays.samples();
    let strength = tracer.settings.lobe_strength;
    let mut arena = PathArena::default();
    let mut totals = PassTotals::default();
    for &pixel in pixels {
        if stop.load(Ordering::Relaxed) {
            break;
        }
        let pixel = pixel as usize;
        let estimate = estimate_pixel(tracer, rays, pixel, key, parameters, &mut arena);
        if !estimate.first.iter().chain(&estimate.second).all(|value| value.is_finite()) {
            totals.non_finite_pixels += 1;
            totals.first_non_finite.get_or_insert(pixel);
            continue;
        }
        let Some(derivative) = loss.at(pixel, &estimate) else { continue };
        if !derivative.is_finite() {
            totals.non_finite_pixels += 1;
            totals.first_non_finite.get_or_insert(pixel);
            continue;
        }
        totals.loss += derivative.loss;
        totals.pixels += 1;
        let half = (samples / 2).max(1);
        for (sample, path) in arena.paths.iter().enumerate() {
            let (d_mean, count) = if samples == 1 {
                (std::array::from_fn(|c| derivative.d_first[c] + derivative.d_second[c]), 1)
            } else if sample < half {
                (derivative.d_first, half)
            } else {
                (derivative.d_second, samples - half)
            };
            let share = R::from_f32(1.0 / count as f32);
            radiance_backward(parameters, &arena, path, strength, d_mean.map(|d| d * share), table);
        }
    }
    totals
}

/// Traces the samples of a pixel into `arena` (cleared first) and adds up its two estimates, which are independent of each
/// other only if the key says so.
pub fn estimate_pixel<R: Real>(
    tracer: &PathTracer<'_>,
    rays: &CameraRays<'_>,
    pixel: usize,
    key: PassKey,
    parameters: &Parameters<R>,
    arena: &mut PathArena,
) -> PixelEstimate<R> {
    trace_pixel(tracer, rays, pixel, key, arena);
    sum_pixel(parameters, arena, tracer.settings.lobe_strength)
}

/// Traces the samples of a pixel into `arena`, cleared first.
pub fn trace_pixel(tracer: &PathTracer<'_>, rays: &CameraRays<'_>, pixel: usize, key: PassKey, arena: &mut PathArena) {
    arena.clear();
    let samples = rays.samples();
    for first in (0..samples).step_by(PACKET) {
        let count = PACKET.min(samples - first);
        let mut streams = key.streams(pixel, first, samples);
        let numbers = camera_pairs(&mut streams, count);
        let starts = (0..count).map(|lane| {
            let (ray, first_hit) = rays.at(pixel, first + lane, [numbers[0][lane], numbers[1][lane]]);
            PathStart { ray, first_hit, stream: streams[lane] }
        });
        tracer.trace(starts, arena);
    }
}

/// The two estimates of a pixel whose paths are in `arena`.
pub fn sum_pixel<R: Real>(parameters: &Parameters<R>, arena: &PathArena, lobe_strength: f32) -> PixelEstimate<R> {
    let samples = arena.paths.len();
    let half = (samples / 2).max(1);
    let mut sums = [[R::zero(); 3]; 2];
    let mut escaped = 0;
    for (sample, path) in arena.paths.iter().enumerate() {
        let value = radiance(parameters, arena, path, lobe_strength);
        let sum = &mut sums[usize::from(sample >= half)];
        for channel in 0..3 {
            sum[channel] += value[channel];
        }
        escaped += usize::from(path.escaped);
    }
    let first = sums[0].map(|sum| sum * R::from_f32(1.0 / half as f32));
    let second = if samples > 1 { sums[1].map(|sum| sum * R::from_f32(1.0 / (samples - half) as f32)) } else { first };
    PixelEstimate { first, second, escaped: escaped as f32 / samples.max(1) as f32 }
}
