//! A scene made ready for the solver: all that follows from photos, geometry and settings and never changes in a fit.

use super::edges::EdgeView;
use super::observations::{Observation, Observations, of_view};
use super::plan::{self, Block};
use super::settings::SolverSettings;
use super::sieve::Sieve;
use crate::error::{Error, ErrorKind, Result};
use crate::fit::targets::Target;
use crate::math::sphere::{BilinearTap, tap_of_direction};
use crate::render::Surface;
use crate::render::cached::{CachedTransport, FootprintSettings, ViewFootprints};
use crate::scene::{Background, Camera, PixelState, Scene};
use glam::Vec2;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Most pixels of the held-out views together: beyond that one in so many is looked at.
const MOST_HELD_OUT: usize = 4 << 20;
/// Most background pixels that are used.
const MOST_BACKGROUND: usize = 20_000;
/// Sweeps in search of the light that explains all background pixels.
const SCATTER_SWEEPS: usize = 60;
/// Mean reflectance that fixes the scale between surface and light: nothing in the photos of a diffuse surface does, see
/// [`crate::fit::gauge`]. That of the measured start.
const HELD_REFLECTANCE: f64 = 0.5;
/// Most texels along a block's side in the rounds that look for the light; its cells are a quarter of that.
const ROUND_BLOCK: usize = 8;
/// What blocks at most are cut into, so that there are enough of them on small maps.
const LEAST_ROUND_BLOCK: usize = 2;
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
    /// Deviation of the radiance, mean over channels, of what looks at the same texels of the light from the light that
    /// explains all best: large where the background is not far away, so that views disagree.
    pub scatter: f32,
}

/// The cache, the photographs' evidence, and what holds the scale.
pub struct SolverScene {
    /// What was chosen.
    pub settings: SolverSettings,
    /// Indices in the scene of the views that are fitted to.
    pub views: Vec<usize>,
    /// Logarithm of each view's gain that its exposure foretells, with mean zero; 0 where nothing is known of it.
    pub foretold_gains: Vec<f32>,
    /// Their cameras, of the size they are fitted at.
    pub cameras: Vec<Camera>,
    /// The cache.
    pub transport: Arc<CachedTransport>,
    /// Footprints of the views: those of the observations, no others.
    pub footprints: Vec<ViewFootprints>,
    /// How they were traced.
    pub first_hits: FootprintSettings,
    /// Pixels that one piece of surface fills.
    pub observations: Observations,
    /// Pixels with edges, view by view.
    pub edges: Vec<EdgeView>,
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
    /// The pixels of the views that judge, where [`SolverSettings::check_choices`] asks for them.
    pub held_out_pixels: Vec<Vec<Observation>>,
}

impl SolverScene {
    /// Traces the cache and gathers the evidence of these photographs; `held_out` judge. `None` when `stop` was raised.
    /// `traced` is a cache of the same surface that serves if it is the one that would be traced; `watch` sees the pixels of
    /// each photo as they come.
    ///
    /// # Errors
    /// `InvalidScene` when no pixel of any view is evidence.
    pub fn build(
        scene: &Scene,
        surface: &Surface,
        (targets, held_out): (Vec<Target>, &[Target]),
        settings: SolverSettings,
        traced: Option<Arc<CachedTransport>>,
        stop: &AtomicBool,
        watch: &mut dyn FnMut(&[Observation]),
    ) -> Result<Option<Self>> {
        let cached = settings.cached();
        let build = || CachedTransport::build(surface, cached, settings.light_size, stop).map(Arc::new);
        let Some(transport) = traced.filter(|own| own.is_of(&cached, settings.light_size)).or_else(build) else {
            return Ok(None);
        };
        let first_hits = FootprintSettings { map_size: settings.map_size, ..FootprintSettings::default() };
        let traced = |target: &Target, sieve: Option<&Sieve>| {
            let grid = &transport.grid;
            let wants = sieve.map(|sieve| move |pixel: u32, uv: Vec2| sieve.wants(pixel, uv));
            let wants = wants.as_ref().map(|wants| wants as &(dyn Fn(u32, Vec2) -> bool + Sync));
            (!stop.load(Ordering::Relaxed))
                .then(|| ViewFootprints::trace_where(surface, grid, &target.camera, &first_hits, wants))
        };
        let mut sieve = Sieve::new(settings.map_size);
        let mut escaped = Vec::with_capacity(targets.len());
        let mut edges = Vec::with_capacity(targets.len());
        for (index, target) in targets.iter().enumerate() {
            let Some(footprints) = traced(target, sieve.has_dropped().then_some(&sieve)) else { return Ok(None) };
            escaped.push(wholly_escaped(&footprints));
            edges.push(EdgeView::of(scene, target, index as u32, targets.len(), &footprints));
            let pixels = of_view(scene, target, index as u32, &footprints);
            watch(&pixels);
            sieve.add(footprints, pixels);
        }
        let (footprints, pixels) = sieve.finish();
        let observations = Observations::of_views(pixels, settings.map_size);
        // Those that judge need not see more of a view than its share of these.
        let pixels_of_held_out: usize = held_out.iter().map(Target::pixel_count).sum();
        let step = pixels_of_held_out.div_ceil(MOST_HELD_OUT);
        let mut judged = Vec::with_capacity(held_out.len());
        for target in held_out {
            let Some(mut footprints) = traced(target, None) else { return Ok(None) };
            if step > 1 {
                footprints.keep_one_in(step);
            }
            judged.push(footprints);
        }
        if observations.list.is_empty() {
            return Err(Error::new(ErrorKind::InvalidScene, "no pixel of any view is evidence for the surface")
                .remedy("check that the masks are not inverted or black, and that the cameras see the mesh"));
        }
        let background = if scene.background == Background::Environment && settings.use_background {
            background_pixels(scene, &targets, &escaped, settings.light_size)
        } else {
            Vec::new()
        };
        let held_out: Vec<(Target, ViewFootprints)> = held_out.iter().cloned().zip(judged).collect();
        let held_out_pixels = if settings.check_choices {
            let pixels = |(index, (target, footprints)): (usize, &(Target, ViewFootprints))| {
                of_view(scene, target, index as u32, footprints)
            };
            held_out.iter().enumerate().map(pixels).collect()
        } else {
            Vec::new()
        };
        let gauge = gauge(&transport, &footprints, &observations);
        let blocks = |(side, cell)| plan::blocks(&observations, &transport.grid, settings.map_size, side, cell);
        Ok(Some(SolverScene {
            round_blocks: blocks(round_block(&settings)),
            map_blocks: blocks(MAP_BLOCK),
            settings,
            views: targets.iter().map(|target| target.view).collect(),
            foretold_gains: foretold_gains(targets.iter().map(|target| scene.views[target.view].exposure_prior_stops)),
            cameras: targets.iter().map(|target| target.camera).collect(),
            transport,
            footprints,
            first_hits,
            observations,
            edges,
            background,
            gauge,
            held_out,
            held_out_pixels,
        }))
    }
}

impl SolverScene {
    /// Number of pixels that show surface, as far as they are kept.
    pub fn surface_pixels(&self) -> usize {
        self.observations.list.len() + self.edges.iter().map(|view| view.pixels.len()).sum::<usize>()
    }
}

/// Texels along a block's side, and along a cell's, in the rounds that look for the light: the largest blocks of which maps
/// have as many as a round asks for.
fn round_block(settings: &SolverSettings) -> (usize, usize) {
    let mut side = ROUND_BLOCK;
    while side > LEAST_ROUND_BLOCK && (settings.map_size / side).pow(2) < settings.blocks {
        side /= 2;
    }
    (side, (side / 4).max(1))
}

/// Logarithms of gains by exposures in stops, less their mean: a common gain belongs to the light.
pub fn foretold_gains(stops: impl Iterator<Item = Option<f32>>) -> Vec<f32> {
    let stops: Vec<Option<f32>> = stops.collect();
    let known: Vec<f32> = stops.iter().flatten().copied().collect();
    let mean = known.iter().sum::<f32>() / known.len().max(1) as f32;
    stops.iter().map(|stops| stops.map_or(0.0, |stops| (stops - mean) * std::f32::consts::LN_2)).collect()
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

/// The pixels of a view that show nothing but background, as ranges: there are few of them.
fn wholly_escaped(footprints: &ViewFootprints) -> Vec<Range<usize>> {
    let mut ranges: Vec<Range<usize>> = Vec::new();
    for (pixel, _) in footprints.escaped.iter().enumerate().filter(|(_, share)| **share >= 1.0) {
        match ranges.last_mut() {
            Some(last) if last.end == pixel => last.end += 1,
            _ => ranges.push(pixel..pixel + 1),
        }
    }
    ranges
}

/// Pixels that show nothing but background, thinned out evenly.
fn background_pixels(
    scene: &Scene,
    targets: &[Target],
    escaped: &[Vec<Range<usize>>],
    (width, height): (usize, usize),
) -> Vec<BackgroundPixel> {
    let total: usize = escaped.iter().flatten().map(Range::len).sum();
    let stride = total.div_ceil(MOST_BACKGROUND).max(1);
    let mut found = Vec::new();
    let mut seen = 0usize;
    for (index, (target, escaped)) in targets.iter().zip(escaped).enumerate() {
        for pixel in escaped.iter().cloned().flatten() {
            seen += 1;
            let (row, column) = (pixel / target.camera.width, pixel % target.camera.width);
            let (radiance, state) = target.at(scene, pixel);
            // Without a mask every pixel is said to be surface, and rays decide.
            let is_missed_surface = target.has_mask && state.is_surface();
            let says_nothing = state == PixelState::Ignored || state.is_clipped() || is_missed_surface;
            if !seen.is_multiple_of(stride) || says_nothing {
                continue;
            }
            let ray = target.camera.ray_through(Vec2::new(column as f32 + 0.5, row as f32 + 0.5));
            let tap = tap_of_direction(ray.direction, width, height);
            found.push(BackgroundPixel { view: index, tap, radiance: radiance.to_array(), scatter: 0.0 });
        }
    }
    set_scatter(&mut found, width * height);
    found
}

/// Sets by how much pixels that look at one texel disagree with the light that explains them all best.
///
/// Not by how much they differ: beside a sun they do, and would say nothing of the texels around it, although all agree; the
/// sun would leak into its neighbours.
fn set_scatter(pixels: &mut [BackgroundPixel], texels: usize) {
    let mut of_texel: Vec<Vec<(usize, f64)>> = vec![Vec::new(); texels];
    for (index, pixel) in pixels.iter().enumerate() {
        for (texel, weight) in pixel.tap.index.into_iter().zip(pixel.tap.weight) {
            of_texel[texel as usize].push((index, f64::from(weight)));
        }
    }
    // Gauss and Seidel over the texels; `left` is what they leave of the pixels.
    let mut left: Vec<f64> = pixels.iter().map(|pixel| f64::from(pixel.radiance.iter().sum::<f32>()) / 3.0).collect();
    let powers: Vec<f64> = of_texel.iter().map(|taps| taps.iter().map(|(_, weight)| weight * weight).sum()).collect();
    for _ in 0..SCATTER_SWEEPS {
        for (taps, &power) in of_texel.iter().zip(&powers) {
            let side: f64 = taps.iter().map(|&(pixel, weight)| weight * left[pixel]).sum();
            let step = if power > 0.0 { side / power } else { 0.0 };
            for &(pixel, weight) in taps {
                left[pixel] -= step * weight;
            }
        }
    }
    let deviation = |taps: &Vec<(usize, f64)>| {
        let (square, weight) = taps.iter().fold((0.0, 0.0), |(square, sum), &(pixel, weight)| {
            (square + weight * left[pixel] * left[pixel], sum + weight)
        });
        if weight > 0.0 { (square / weight).sqrt() } else { 0.0 }
    };
    let deviations: Vec<f64> = of_texel.iter().map(deviation).collect();
    for pixel in pixels {
        let taps = pixel.tap.index.into_iter().zip(pixel.tap.weight);
        pixel.scatter = taps.map(|(texel, weight)| deviations[texel as usize] as f32 * weight).sum();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn views_that_agree_on_a_sun_do_not_scatter() {
        let sky = crate::image::Image::from_fn(16, 8, |row, column| if (row, column) == (3, 5) { 1e4f32 } else { 1.0 });
        let mut pixels = Vec::new();
        for index in 0..4000usize {
            let y = 1.0 - 2.0 * (index as f32 + 0.5) / 4000.0;
            let (sine, cosine) = (index as f32 * 2.399_963).sin_cos();
            let across = (1.0 - y * y).sqrt();
            let tap = tap_of_direction(Vec3::new(across * cosine, y, across * sine), 16, 8);
            let radiance: f32 = tap.index.iter().zip(tap.weight).map(|(&k, w)| w * sky.pixels()[k as usize]).sum();
            pixels.push(BackgroundPixel { view: 0, tap, radiance: [radiance; 3], scatter: 0.0 });
        }
        set_scatter(&mut pixels, 128);
        let worst = pixels.iter().map(|pixel| pixel.scatter).fold(0.0, f32::max);
        assert!(worst < 0.1, "{worst}");
    }

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
        assert!((pixels[0].scatter - 1.0).abs() < 1e-5 && pixels[0].scatter == pixels[1].scatter);
        assert!(pixels[2].scatter < 1e-5 && pixels[3].scatter < 1e-5);
    }
}
