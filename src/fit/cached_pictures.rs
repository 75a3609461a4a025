//! Pictures of views through the solver's cache: without noise, and in a second where paths take a minute.

use super::fitter::Fitter;
use super::solver::SolverScene;
use super::solver::descent::Descended;
use super::targets::Target;
use crate::image::{Image, RgbImage};
use crate::math::sphere::tap_of_direction;
use crate::render::cached::{FootprintSettings, LightPlanes, PointLight, ViewFootprints};
use crate::scene::Background;
use glam::{Vec2, Vec3};
use std::sync::atomic::AtomicBool;

/// A view as maps and light have it.
#[derive(Clone, Debug)]
pub struct CachedPicture {
    /// Linear radiance, without the photo's gain.
    pub radiance: RgbImage,
    /// The same by the texture without a light, where one was given; black where no surface is.
    pub texture: Option<RgbImage>,
    /// Pixels that surface covers wholly.
    pub covered: Image<bool>,
}

/// Draws views with what a fit has found.
pub struct CachedView<'a> {
    fitter: &'a Fitter,
    solver: &'a SolverScene,
    planes: LightPlanes,
    at_points: PointLight,
}

impl Fitter {
    /// What draws views through the cache. `None` under Adam and unless the solver was at work on maps of this size since
    /// the fit was started or taken up.
    pub fn cached_view(&self) -> Option<CachedView<'_>> {
        let solver = self.solver.as_ref().filter(|solver| solver.settings.map_size == self.state.map_size)?;
        let planes = solver.transport.basis.planes(&self.state.light);
        let reflectance = solver.transport.reflectance_of_points(&self.state.texels, self.state.map_size);
        let at_points = solver.transport.point_light(&planes, &reflectance);
        Some(CachedView { fitter: self, solver, planes, at_points })
    }

    /// The best texture without a light, from whole photos: what a picture can be that knows nothing of light. `None` as
    /// for [`Fitter::cached_view`], where the last photos were halved ones, when `stop` was raised, and for a fit that was cut
    /// short: it takes as long as the descent.
    pub fn bake(&self, stop: &AtomicBool) -> Option<Descended> {
        let solver = self.solver.as_ref().filter(|solver| solver.settings.map_size == self.state.map_size)?;
        (self.solver_photo_level == 0 && !self.is_cut_short).then(|| solver.bake(stop)).flatten()
    }
}

impl CachedView<'_> {
    /// The picture of a view, and with `texture`, of all texels, that by it.
    pub fn picture(&self, target: &Target, texture: Option<&[[f32; 3]]>) -> CachedPicture {
        let CachedView { fitter, solver, planes, at_points } = self;
        let camera = &target.camera;
        let settings = FootprintSettings { map_size: solver.settings.map_size, ..FootprintSettings::default() };
        let footprints = ViewFootprints::trace(fitter.surface(), &solver.transport.grid, camera, &settings);
        let mut pixels = solver.transport.picture(&footprints, &fitter.state.texels, planes, at_points);
        let mut shares = vec![0.0f32; pixels.len()];
        for point in &footprints.points {
            shares[point.pixel as usize] += point.share;
        }
        if fitter.scene.background == Background::Environment {
            self.add_background(target, &footprints.escaped, &mut pixels);
        }
        let image = |pixels: Vec<[f32; 3]>| {
            Image::from_pixels(camera.width, camera.height, pixels.into_iter().map(Vec3::from_array).collect())
        };
        CachedPicture {
            radiance: image(pixels),
            texture: texture.map(|texture| image(textured(&footprints, texture))),
            covered: Image::from_pixels(
                camera.width,
                camera.height,
                shares.iter().map(|&share| share > 0.999).collect(),
            ),
        }
    }

    /// Adds the light itself where rays pass the surface.
    fn add_background(&self, target: &Target, escaped: &[f32], pixels: &mut [[f32; 3]]) {
        let (width, height) = self.solver.settings.light_size;
        for (index, (pixel, &share)) in
            pixels.iter_mut().zip(escaped).enumerate().filter(|(_, (_, share))| **share > 0.0)
        {
            let place =
                Vec2::new((index % target.camera.width) as f32 + 0.5, (index / target.camera.width) as f32 + 0.5);
            let tap = tap_of_direction(target.camera.ray_through(place).direction, width, height);
            for (texel, weight) in tap.index.into_iter().zip(tap.weight) {
                let radiance = self.fitter.state.light[texel as usize];
                (0..3).for_each(|c| pixel[c] += share * weight * radiance[c]);
            }
        }
    }
}

/// Mean colour under each pixel, as far as surface covers it.
fn textured(footprints: &ViewFootprints, texture: &[[f32; 3]]) -> Vec<[f32; 3]> {
    let mut picture = vec![[0.0f32; 3]; footprints.width * footprints.height];
    for point in &footprints.points {
        let pixel = &mut picture[point.pixel as usize];
        for &(texel, weight) in footprints.texels_of(point) {
            (0..3).for_each(|c| pixel[c] += point.share * weight * texture[texel as usize][c]);
        }
    }
    picture
}
