//! Camera rays, and first hits that are traced once.
//!
//! Geometry and cameras never change, so where camera rays meet the surface need be found only once. With
//! [`FirstHits`] the places of the samples within a pixel are frozen too, as quadrature nodes; without, every step
//! draws them anew.

use super::surface::Surface;
use crate::math::parallel;
use crate::math::random::{SampleStream, StreamKey};
use crate::scene::Camera;
use crate::trace::{Hit, Ray};
use glam::Vec2;

/// How the samples of a pixel are spread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum PixelFilter {
    /// Evenly over the pixel's square.
    #[default]
    Box,
    /// A tent two pixels wide.
    Tent,
}

impl PixelFilter {
    /// Offset from the pixel's upper left corner, in pixels.
    fn offset(self, u: [f32; 2]) -> Vec2 {
        match self {
            PixelFilter::Box => Vec2::from_array(u),
            PixelFilter::Tent => {
                // Inverse of the tent's cumulative distribution on each half.
                let tent = |u: f32| {
                    if u < 0.5 { (2.0 * u).sqrt() - 1.0 } else { 1.0 - (2.0 - 2.0 * u).max(0.0).sqrt() }
                };
                Vec2::new(0.5 + tent(u[0]), 0.5 + tent(u[1]))
            }
        }
    }
}

/// First hits at frozen places within all pixels of a view: 12 bytes a place.
///
/// Both halves of a pixel's samples share their places. With places of their own the product of the two estimates
/// would no longer be a squared error: it could be lowered by driving the halves apart.
#[derive(Clone, Debug)]
pub struct FirstHits {
    samples: usize,
    places: usize,
    seed: u64,
    view: u32,
    hits: Vec<PackedHit>,
}

#[derive(Clone, Copy, Debug)]
struct PackedHit {
    triangle: u32,
    u: f32,
    v: f32,
}

const NO_TRIANGLE: u32 = u32::MAX;

impl FirstHits {
    /// Bytes the first hits of a camera take.
    pub fn bytes(camera: &Camera, samples: usize) -> usize {
        camera.width * camera.height * places_of(samples) * size_of::<PackedHit>()
    }

    /// Traces the camera rays of a view; places within the pixels depend on seed and view alone.
    pub fn trace(
        surface: &Surface,
        camera: &Camera,
        filter: PixelFilter,
        samples: usize,
        seed: u64,
        view: u32,
    ) -> Self {
        let places = places_of(samples);
        let nothing = PackedHit { triangle: NO_TRIANGLE, u: 0.0, v: 0.0 };
        let mut hits = vec![nothing; camera.width * camera.height * places];
        parallel::each_chunk(&mut hits, places, &|pixel, hits| {
            for (place, own) in hits.iter_mut().enumerate() {
                let ray = frozen_ray(camera, filter, seed, view, pixel, place);
                if let Some(hit) = surface.closest(&ray) {
                    *own = PackedHit { triangle: hit.triangle, u: hit.u, v: hit.v };
                }
            }
        });
        FirstHits { samples, places, seed, view, hits }
    }
}

/// Places within a pixel for so many samples: those of one half.
fn places_of(samples: usize) -> usize {
    (samples / 2).max(1)
}

/// The camera ray through a frozen place of a pixel.
fn frozen_ray(camera: &Camera, filter: PixelFilter, seed: u64, view: u32, pixel: usize, place: usize) -> Ray {
    let mut stream = SampleStream::new(StreamKey::new(seed, u32::MAX, view, pixel as u32), place as u32);
    camera.ray_through(corner(camera, pixel) + filter.offset(stream.next_pair()))
}

fn corner(camera: &Camera, pixel: usize) -> Vec2 {
    Vec2::new((pixel % camera.width) as f32, (pixel / camera.width) as f32)
}

/// The camera rays of a view.
pub struct CameraRays<'a> {
    /// The surface.
    pub surface: &'a Surface,
    /// The camera.
    pub camera: &'a Camera,
    /// How samples are spread over a pixel.
    pub filter: PixelFilter,
    samples: usize,
    cached: Option<&'a FirstHits>,
}

impl<'a> CameraRays<'a> {
    /// Rays at places drawn anew for each pass.
    pub fn fresh(surface: &'a Surface, camera: &'a Camera, filter: PixelFilter, samples: usize) -> Self {
        CameraRays { surface, camera, filter, samples: samples.max(1), cached: None }
    }

    /// Rays whose first hits are known.
    pub fn cached(surface: &'a Surface, camera: &'a Camera, filter: PixelFilter, first_hits: &'a FirstHits) -> Self {
        CameraRays { surface, camera, filter, samples: first_hits.samples, cached: Some(first_hits) }
    }

    /// Samples a pixel.
    pub fn samples(&self) -> usize {
        self.samples
    }

    /// The ray of a sample and its first hit. `numbers` is the first pair of the sample's stream, with cached hits as
    /// well, so that the rest of the path is the same.
    #[inline]
    pub fn at(&self, pixel: usize, sample: usize, numbers: [f32; 2]) -> (Ray, Option<Hit>) {
        match self.cached {
            Some(cached) => {
                let place = sample % cached.places;
                let ray = frozen_ray(self.camera, self.filter, cached.seed, cached.view, pixel, place);
                let packed = cached.hits[pixel * cached.places + place];
                let hit = (packed.triangle != NO_TRIANGLE).then(|| {
                    let corners = self.surface.mesh().corners(packed.triangle as usize);
                    let (u, v) = (packed.u, packed.v);
                    let point = corners[0] * (1.0 - u - v) + corners[1] * u + corners[2] * v;
                    Hit { t: (point - ray.origin).length(), triangle: packed.triangle, u, v }
                });
                (ray, hit)
            }
            None => {
                let place = corner(self.camera, pixel) + self.filter.offset(numbers);
                let ray = self.camera.ray_through(place);
                (ray, self.surface.closest(&ray))
            }
        }
    }
}
