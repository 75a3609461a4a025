//! A view relit at once: rays are traced when the eye moves, never when the light does.
//!
//! [`RelitView`] holds what a camera sees of the surface (footprints of [`super::cached`]) with its materials. A light is
//! then a sum: diffuse light comes from the points of the grid, as in the fit; the lobe, which costs most, is integrated at
//! those points and at some shading points alone and interpolated ([`LobePlan`]), before F0 of each pixel is multiplied in.
//!
//! Its picture is that of [`CachedTransport::picture`](super::cached::CachedTransport::picture) but for that interpolation,
//! for direct diffuse light, which follows the normal of each pixel, and for lights finer than the hats of the cache, which
//! are averaged. `patina-lab bench studio --parts relight` prints the error of both against the path tracer. Nothing is
//! random; nothing depends on the number of threads.

mod lobe_plan;

use super::cached::lobe_place::width_through;
use super::cached::{CachedTransport, FootprintSettings, ViewFootprints};
use super::surface::Surface;
use crate::image::{Image, RgbImage};
use crate::light::Environment;
use crate::material::Material;
use crate::material::texels::{PyramidWeights, TexelPyramid};
use crate::math::parallel;
use crate::scene::Camera;
use glam::{Vec2, Vec3};
use lobe_plan::LobePlan;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// What a camera sees, ready for any light.
pub struct RelitView {
    camera: Camera,
    footprints: ViewFootprints,
    /// Where the shading points of each row of pixels begin, and the end of the last.
    row_starts: Vec<usize>,
    /// Diffuse and specular reflectance and log width of each shading point.
    materials: Vec<[f32; 7]>,
    lobes: LobePlan,
}

/// A picture and what made it.
pub struct RelitPicture {
    /// Linear radiance.
    pub radiance: RgbImage,
    /// Lobes that were integrated.
    pub lobe_points: usize,
}

impl RelitView {
    /// Traces what a camera sees of a surface whose maps have these texels, row-major and square; `None` when `stop` was
    /// raised.
    pub fn new(
        surface: &Surface,
        transport: &CachedTransport,
        camera: &Camera,
        texels: &[Material<f32>],
        settings: &FootprintSettings,
        stop: &AtomicBool,
    ) -> Option<Self> {
        let settings = FootprintSettings { levels: levels_of(settings.map_size), ..*settings };
        let goes_on = |_: u32, _: Vec2| !stop.load(Ordering::Relaxed);
        let footprints = ViewFootprints::trace_where(surface, &transport.grid, camera, &settings, Some(&goes_on));
        if stop.load(Ordering::Relaxed) {
            return None;
        }
        let row_starts = (0..=camera.height)
            .map(|row| footprints.points.partition_point(|point| (point.pixel as usize) < row * camera.width))
            .collect();
        let view =
            RelitView { camera: *camera, footprints, row_starts, materials: Vec::new(), lobes: LobePlan::default() };
        Some(view.with_texels(transport, texels))
    }

    /// The same view of other maps of the same size.
    pub fn with_texels(mut self, transport: &CachedTransport, texels: &[Material<f32>]) -> Self {
        let texels = chain(texels);
        let material = |point| CachedTransport::material_of(&self.footprints, point, &texels);
        self.materials = self.footprints.points.par_iter().with_min_len(1024).map(material).collect();
        self.lobes = LobePlan::default();
        if transport.settings.lobe_strength > 0.0 {
            let points = self.footprints.points.iter().zip(&self.materials);
            let lobe = transport.settings.lobe;
            let widths = points.map(|(point, material)| width_through(lobe, material[6].exp(), point.normal_variance));
            let eye = self.camera.position_in_world();
            self.lobes = LobePlan::of(&self.footprints, widths.collect(), transport, eye);
        }
        self
    }

    /// Makes further lights cheap, for a few times the cost of one: a view that stays, lit by what turns. Where `stop` is raised
    /// nothing changes.
    pub fn freeze(&mut self, transport: &CachedTransport, stop: &AtomicBool) {
        self.lobes.freeze(&self.footprints, transport, stop);
    }

    /// Whether further lights are cheap already.
    pub fn is_frozen(&self) -> bool {
        self.lobes.lobes() == 0 || self.lobes.is_frozen()
    }

    /// The camera.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// The view under a light. `reflectance` is that of [`CachedTransport::reflectance_of_points`] for the same maps. The
    /// background shows `behind`, and is black without it; `None` when `stop` was raised.
    pub fn lit(
        &self,
        transport: &CachedTransport,
        environment: &Environment,
        reflectance: &[[f32; 3]],
        behind: Option<&Environment>,
        stop: &AtomicBool,
    ) -> Option<RelitPicture> {
        let basis = &transport.basis;
        let is_of_basis = (environment.width(), environment.height()) == (basis.width, basis.height);
        let averaged = (!is_of_basis).then(|| environment.resampled(basis.width, basis.height));
        let hats = averaged.as_ref().unwrap_or(environment).radiance.pixels();
        let light = basis.planes(&hats.iter().map(|radiance| radiance.to_array()).collect::<Vec<_>>());
        let vectors = transport.vectors(&light);
        let normals = transport.grid.points.iter().map(|point| point.shading_normal);
        let direct = vectors.iter().zip(normals).map(|(vectors, normal)| vectors.map(|vector| vector.dot(normal)));
        let at = transport.with_bounces(direct.collect(), reflectance);
        if stop.load(Ordering::Relaxed) {
            return None;
        }
        let footprints = &self.footprints;
        let lobes = self.lobes.integrals(footprints, transport, (&light, &at));
        if stop.load(Ordering::Relaxed) {
            return None;
        }
        let (width, height) = (self.camera.width, self.camera.height);
        let strength = transport.settings.lobe_strength;
        let mut pixels = vec![Vec3::ZERO; width * height];
        parallel::each_chunk(&mut pixels, width, &|row, pixels| {
            for index in self.row_starts[row]..self.row_starts[row + 1] {
                let (point, material) = (&footprints.points[index], &self.materials[index]);
                let arriving = transport.arriving_at((&at, &vectors), footprints, point);
                let specular = [material[3], material[4], material[5]];
                let reflected = lobes.get(index).map_or([0.0; 3], |lobe| lobe.radiance(specular));
                let radiance = [0, 1, 2].map(|c| material[c] * arriving[c] + strength * reflected[c]);
                pixels[point.pixel as usize - row * width] += Vec3::from_array(radiance) * point.share;
            }
            if let Some(behind) = behind {
                for (column, pixel) in pixels.iter_mut().enumerate() {
                    let escaped = footprints.escaped[row * width + column];
                    if escaped > 0.0 {
                        let ray = self.camera.ray_through(Vec2::new(column as f32 + 0.5, row as f32 + 0.5));
                        *pixel += behind.radiance_towards(ray.direction) * escaped;
                    }
                }
            }
        });
        Some(RelitPicture { radiance: Image::from_pixels(width, height, pixels), lobe_points: self.lobes.lobes() })
    }
}

/// Levels of maps of this size: halved down to 64 texels, or to an odd size.
fn levels_of(map_size: usize) -> usize {
    1 + (0..).take_while(|level| (map_size >> level).is_multiple_of(2) && map_size >> level > 64).count()
}

/// The texels of square maps, and after them those of each coarser level: means of four, wherever charts are.
fn chain(texels: &[Material<f32>]) -> Vec<Material<f32>> {
    let side = texels.len().isqrt();
    let weights = PyramidWeights::new(&Image::filled(side, side, true), levels_of(side));
    TexelPyramid::from_base(texels.to_vec(), &weights).levels.into_iter().flat_map(|level| level.texels).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::texels::texels_from_maps;
    use crate::render::cached::CachedSettings;
    use crate::scene::demo::{DemoSettings, build};

    fn relative_error(own: &RgbImage, truth: &RgbImage) -> f64 {
        let squared = |value: Vec3| f64::from(value.length_squared());
        let difference: f64 = own.pixels().iter().zip(truth.pixels()).map(|(a, b)| squared(*a - *b)).sum();
        let whole: f64 = truth.pixels().iter().map(|pixel| squared(*pixel)).sum();
        (difference / whole).sqrt()
    }

    #[test]
    fn a_view_relit_is_the_picture_of_the_cache_and_is_linear_in_the_light() {
        let settings = DemoSettings {
            views: 2,
            held_out: 0,
            width: 160,
            height: 120,
            map_size: 128,
            seed: 1,
            ..Default::default()
        };
        let scene = build(&settings).unwrap().scene;
        let surface = Surface::new(scene.mesh.clone()).unwrap();
        let truth = scene.truth.as_ref().unwrap();
        let map_size = truth.maps.diffuse.width();
        let texels = texels_from_maps(&truth.maps);
        let stop = AtomicBool::new(false);
        let cached = CachedSettings { grid: 64, bounce_rays: 16, max_bounces: 2, ..CachedSettings::default() };
        let size = (truth.environment.width(), truth.environment.height());
        let transport = CachedTransport::build(&surface, cached, size, &stop).unwrap();
        let reflectance = transport.reflectance_of_points(&texels, map_size);
        let camera = &scene.views[0].camera;
        let footprints = FootprintSettings { map_size, ..FootprintSettings::default() };
        let mut view = RelitView::new(&surface, &transport, camera, &texels, &footprints, &stop).unwrap();
        let own = view.lit(&transport, &truth.environment, &reflectance, None, &stop).unwrap();
        let light: Vec<[f32; 3]> = truth.environment.radiance.pixels().iter().map(|rgb| rgb.to_array()).collect();
        let light = transport.basis.planes(&light);
        let at = transport.point_light(&light, &reflectance);
        let traced = ViewFootprints::trace(&surface, &transport.grid, camera, &footprints);
        let mut whole = transport.picture(&traced, &texels, &light, &at);
        // Direct diffuse light is that of each pixel's own normal.
        let vectors = transport.vectors(&light);
        for point in &traced.points {
            let material = CachedTransport::material_of(&traced, point, &texels);
            let of_grid = CachedTransport::interpolate(&at.arriving, &traced, point);
            let own = transport.arriving_at((&at, &vectors), &traced, point);
            for channel in 0..3 {
                whole[point.pixel as usize][channel] +=
                    point.share * material[channel] * (own[channel] - of_grid[channel]);
            }
        }
        let whole = Image::from_pixels(camera.width, camera.height, whole.into_iter().map(Vec3::from_array).collect());
        let error = relative_error(&own.radiance, &whole);
        println!("{error:.4} off with lobes at {} of {} points", own.lobe_points, traced.points.len());
        assert!(error < 0.015 && own.lobe_points < traced.points.len(), "{error} {}", own.lobe_points);
        // Kept as rows, lobes give the same picture but for their digits.
        view.freeze(&transport, &AtomicBool::new(true));
        assert!(!view.is_frozen(), "stopped");
        view.freeze(&transport, &stop);
        let frozen = view.lit(&transport, &truth.environment, &reflectance, None, &stop).unwrap();
        let apart = relative_error(&frozen.radiance, &own.radiance);
        println!("{apart:.5} apart from rows");
        assert!(view.is_frozen() && apart > 0.0 && apart < 0.002, "{apart}");
        // Twice the light is twice the picture.
        let twice = Environment { radiance: truth.environment.radiance.map(|radiance| *radiance * 2.0) };
        let twice = view.lit(&transport, &twice, &reflectance, Some(&twice), &stop).unwrap().radiance;
        let once =
            view.lit(&transport, &truth.environment, &reflectance, Some(&truth.environment), &stop).unwrap().radiance;
        let doubled = once.map(|pixel| *pixel * 2.0);
        assert!(relative_error(&twice, &doubled) < 1e-5);
        // The environment is seen behind, as the path tracer shows it.
        assert!(
            once.pixels().iter().zip(own.radiance.pixels()).any(|(with, without)| with.length() > without.length())
        );
        assert!(
            view.lit(&transport, &truth.environment, &reflectance, Some(&truth.environment), &AtomicBool::new(true))
                .is_none()
        );
    }

    #[test]
    fn maps_seen_from_afar_are_averaged_over_a_pixel() {
        let settings = DemoSettings {
            views: 1,
            held_out: 0,
            width: 160,
            height: 120,
            map_size: 512,
            seed: 1,
            ..Default::default()
        };
        let scene = build(&settings).unwrap().scene;
        let surface = Surface::new(scene.mesh.clone()).unwrap();
        let grid = crate::render::cached::VisibilityGrid::new(&surface, 64);
        let camera = scene.views[0].camera.shrunk(4);
        // No two texels are alike.
        let mut random = crate::math::random::SequentialRandom::new(3);
        let texels: Vec<Material<f32>> = (0..512 * 512)
            .map(|_| Material { diffuse: [random.next_number(); 3], specular: [0.04; 3], log_width: -1.0 })
            .collect();
        let seen = |settings: FootprintSettings, texels: &[Material<f32>]| -> Vec<f32> {
            let traced = ViewFootprints::trace(&surface, &grid, &camera, &settings);
            let mut picture = vec![0.0; traced.width * traced.height];
            for point in &traced.points {
                picture[point.pixel as usize] += point.share * CachedTransport::material_of(&traced, point, texels)[0];
            }
            picture
        };
        let whole = FootprintSettings { map_size: 512, coarse_side: 32, fine_side: 32, levels: 1 };
        let truth = seen(whole, &texels);
        let error = |own: Vec<f32>| own.iter().zip(&truth).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>();
        let few = FootprintSettings { map_size: 512, ..FootprintSettings::default() };
        let levels = levels_of(512);
        let with_levels = error(seen(FootprintSettings { levels, ..few }, &chain(&texels)));
        let without = error(seen(few, &texels));
        println!("{with_levels} with levels, {without} without");
        assert_eq!(levels, 4);
        assert!(with_levels < 0.5 * without, "{with_levels} {without}");
    }
}
