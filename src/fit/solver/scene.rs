//! A scene made ready for the solver: all that follows from photos, geometry and settings and never changes in a fit.

use super::observations::Observations;
use super::plan::{self, Block};
use super::settings::SolverSettings;
use crate::error::{Error, ErrorKind, Result};
use crate::fit::targets::{Target, is_radiance};
use crate::math::sphere::{BilinearTap, tap_of_direction};
use crate::math::statistics::Moments;
use crate::render::Surface;
use crate::render::cached::{CachedSettings, CachedTransport, FootprintSettings, ViewFootprints};
use crate::scene::{Background, PixelState, Scene};
use glam::Vec2;
use std::sync::atomic::{AtomicBool, Ordering};

/// Most background pixels that are used.
const MOST_BACKGROUND: usize = 20_000;
/// Mean reflectance that fixes the scale between surface and light: nothing in the photos of a diffuse surface does, see
/// [`crate::fit::gauge`]. That of the measured start.
const HELD_REFLECTANCE: f64 = 0.5;
/// Texels along a block's side, and along a cell's, in the rounds that look for the light.
const ROUND_BLOCK: (usize, usize) = (8, 2);
/// The same where maps are made.
const MAP_BLOCK: (usize, usize) = (4, 1);

/// A pixel that shows nothing but background.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BackgroundPixel {
    /// The view's place in [`SolverScene::views`].
    pub view: usize,
    /// Where it looks.
    pub tap: BilinearTap,
    /// Its radiance.
    pub radiance: [f32; 3],
    /// Standard deviation of the radiance, mean over channels, of all that look at the same texel of the light: large
    /// where the background is not far away, so that views disagree.
    pub scatter: f32,
}

/// The cache, the photographs' evidence, and what holds the scale.
pub struct SolverScene {
    /// What was chosen.
    pub settings: SolverSettings,
    /// Indices in the scene of the views that are fitted to.
    pub views: Vec<usize>,
    /// The cache.
    pub transport: CachedTransport,
    /// Footprints of the views.
    pub footprints: Vec<ViewFootprints>,
    /// Pixels that show surface.
    pub observations: Observations,
    /// Pixels that show the light itself.
    pub background: Vec<BackgroundPixel>,
    /// The mean light on the observed surface as a row over the light, and what it is held to per channel.
    pub gauge: (Vec<f32>, [f64; 3]),
    /// The surface in blocks for rounds on the light.
    pub round_blocks: Vec<Block>,
    /// The surface in blocks for maps.
    pub map_blocks: Vec<Block>,
    /// Views that judge, with their footprints.
    pub held_out: Vec<(Target, ViewFootprints)>,
}

impl SolverScene {
    /// Traces the cache and gathers the evidence of these views; `held_out` judge. `None` when `stop` was raised.
    ///
    /// # Errors
    /// `InvalidScene` when no pixel of any view is evidence.
    pub fn build(
        scene: &Scene,
        surface: &Surface,
        views: &[usize],
        held_out: &[Target],
        settings: SolverSettings,
        stop: &AtomicBool,
    ) -> Result<Option<Self>> {
        let cached = CachedSettings {
            grid: settings.grid.min(settings.map_size),
            bounce_rays: settings.bounce_rays,
            max_bounces: settings.max_bounces,
            lobe_strength: 1.0,
            seed: settings.seed,
        };
        let Some(transport) = CachedTransport::build(surface, cached, settings.light_size, stop) else {
            return Ok(None);
        };
        let first_hits = FootprintSettings {
            map_size: settings.map_size,
            lobe_rays: settings.max_bounces > 1,
            seed: settings.seed,
            ..FootprintSettings::default()
        };
        let mut footprints = Vec::with_capacity(views.len());
        for &view in views {
            if stop.load(Ordering::Relaxed) {
                return Ok(None);
            }
            let camera = &scene.views[view].camera;
            footprints.push(ViewFootprints::trace(surface, &transport.grid, camera, view as u32, &first_hits));
        }
        let mut judges = Vec::with_capacity(held_out.len());
        for target in held_out {
            if stop.load(Ordering::Relaxed) {
                return Ok(None);
            }
            let traced =
                ViewFootprints::trace(surface, &transport.grid, &target.camera, target.view as u32, &first_hits);
            judges.push((target.clone(), traced));
        }
        let observations = Observations::gather(scene, views, &footprints, settings.map_size);
        if observations.list.is_empty() {
            return Err(Error::new(ErrorKind::InvalidScene, "no pixel of any view is evidence for the surface")
                .remedy("check that the masks are not inverted or black, and that the cameras see the mesh"));
        }
        let background = if scene.background == Background::Environment && settings.use_background {
            background_pixels(scene, views, &footprints, settings.light_size)
        } else {
            Vec::new()
        };
        let gauge = gauge(&transport, &footprints, &observations);
        let blocks = |(side, cell)| plan::blocks(&observations, &transport.grid, settings.map_size, side, cell);
        Ok(Some(SolverScene {
            round_blocks: blocks(ROUND_BLOCK),
            map_blocks: blocks(MAP_BLOCK),
            settings,
            views: views.to_vec(),
            transport,
            footprints,
            observations,
            background,
            gauge,
            held_out: judges,
        }))
    }

    /// Bytes that cache and footprints take.
    pub fn memory_bytes(&self) -> usize {
        let footprints = self.footprints.iter().chain(self.held_out.iter().map(|(_, footprints)| footprints));
        self.transport.memory_bytes()
            + footprints.map(ViewFootprints::memory_bytes).sum::<usize>()
            + self.observations.list.len() * size_of::<super::observations::Observation>()
    }
}

/// The row over the light that gives the mean light on the observed surface, and the mean that explains the photos.
fn gauge(
    transport: &CachedTransport,
    footprints: &[ViewFootprints],
    observations: &Observations,
) -> (Vec<f32>, [f64; 3]) {
    let mut times_used = vec![[0.0f32; 3]; transport.grid.points.len()];
    let mut photo = [0.0f64; 3];
    let count = observations.list.len() as f64;
    for observation in &observations.list {
        let view = &footprints[observation.view as usize];
        for &(index, weight) in view.lit_of(&view.points[observation.point as usize]) {
            times_used[index as usize][0] += weight / count as f32;
        }
        for c in 0..3 {
            photo[c] += f64::from(observation.radiance[c].max(0.0)) / count;
        }
    }
    let [row, ..] = transport.direct_backward(&times_used);
    (row, photo.map(|mean| (mean / HELD_REFLECTANCE).max(1e-9)))
}

/// Pixels that show nothing but background, thinned out evenly.
fn background_pixels(
    scene: &Scene,
    views: &[usize],
    footprints: &[ViewFootprints],
    (width, height): (usize, usize),
) -> Vec<BackgroundPixel> {
    let total: usize = footprints.iter().map(|view| view.escaped.iter().filter(|&&share| share >= 1.0).count()).sum();
    let stride = total.div_ceil(MOST_BACKGROUND).max(1);
    let mut found = Vec::new();
    let mut seen = 0usize;
    for (index, (&view, footprints)) in views.iter().zip(footprints).enumerate() {
        let view = &scene.views[view];
        for (pixel, _) in footprints.escaped.iter().enumerate().filter(|(_, share)| **share >= 1.0) {
            seen += 1;
            let (row, column) = (pixel / footprints.width, pixel % footprints.width);
            let state = view.states[(row, column)];
            let radiance = view.photo.radiance(row, column);
            let says_nothing = state == PixelState::Ignored || state.is_clipped() || state.is_surface();
            if !seen.is_multiple_of(stride) || says_nothing || !is_radiance(radiance) {
                continue;
            }
            let ray = view.camera.ray_through(Vec2::new(column as f32 + 0.5, row as f32 + 0.5));
            let tap = tap_of_direction(ray.direction, width, height);
            found.push(BackgroundPixel { view: index, tap, radiance: radiance.to_array(), scatter: 0.0 });
        }
    }
    set_scatter(&mut found, width * height);
    found
}

/// Sets how much pixels that look at one texel differ.
fn set_scatter(pixels: &mut [BackgroundPixel], texels: usize) {
    let nearest = |tap: &BilinearTap| {
        let best = (0..4).max_by(|&a, &b| tap.weight[a].total_cmp(&tap.weight[b])).unwrap_or(0);
        tap.index[best] as usize
    };
    let mut statistics = vec![Moments::default(); texels];
    for pixel in pixels.iter() {
        statistics[nearest(&pixel.tap)].add(f64::from(pixel.radiance.iter().sum::<f32>() / 3.0));
    }
    for pixel in pixels {
        pixel.scatter = statistics[nearest(&pixel.tap)].variance().sqrt() as f32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn background_that_views_see_differently_scatters() {
        let tap = |direction: Vec3| tap_of_direction(direction, 8, 4);
        let pixel = |direction: Vec3, grey: f32| BackgroundPixel {
            view: 0,
            tap: tap(direction),
            radiance: [grey; 3],
            scatter: 0.0,
        };
        let mut pixels = vec![pixel(Vec3::X, 1.0), pixel(Vec3::X, 3.0), pixel(-Vec3::X, 2.0), pixel(-Vec3::X, 2.0)];
        set_scatter(&mut pixels, 32);
        assert!((pixels[0].scatter - 2f32.sqrt()).abs() < 1e-6 && pixels[0].scatter == pixels[1].scatter);
        assert_eq!((pixels[2].scatter, pixels[3].scatter), (0.0, 0.0));
    }
}
