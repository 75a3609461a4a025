//! A picture that refines: what all its passes share. The passes themselves are in [`passes`](super::passes).

use super::accumulate::{PassKey, estimate_pixel};
use super::first_hits::CameraRays;
use super::ground::Ground;
use super::path::{PathArena, PathSettings, PathTracer};
use super::picture_settings::PictureSettings;
use super::sums::Parameters;
use super::surface::Surface;
use crate::light::{Environment, EnvironmentSampler};
use crate::scene::Camera;
use glam::{Vec2, Vec3};

/// What all passes over a surface under one light share.
pub struct PictureTracer<'a> {
    surface: &'a Surface,
    parameters: &'a Parameters<f32>,
    sampler: EnvironmentSampler,
    /// The environment where a ground lies in it.
    environment: Option<Environment>,
    /// What shows behind the surface in place of the environment, where that is blurred there.
    out_of_focus: Option<Environment>,
    settings: PictureSettings,
}

impl<'a> PictureTracer<'a> {
    /// Prepares the light for sampling. `samples` and `groups` of the settings are not read: each call names its own.
    pub fn new(surface: &'a Surface, parameters: &'a Parameters<f32>, settings: PictureSettings) -> Self {
        let environment = parameters.environment();
        let sampler = EnvironmentSampler::new(&environment);
        let out_of_focus = settings.out_of_focus(&environment);
        let environment = settings.ground.is_some().then_some(environment);
        PictureTracer { surface, parameters, sampler, environment, out_of_focus, settings }
    }

    /// The path tracer behind it, for sums of one's own.
    pub fn paths(&self) -> PathTracer<'_> {
        PathTracer {
            surface: self.surface,
            proposal: &self.parameters.texels,
            light: &self.sampler,
            environment_size: self.parameters.environment_size,
            settings: PathSettings {
                max_bounces: self.settings.max_bounces,
                lobe_strength: self.settings.lobe_strength,
                background_visible: self.settings.background_visible && self.out_of_focus.is_none(),
                two_sided: self.settings.two_sided,
                camera_cone_radians: 0.0,
                bounce_cone_radians: 0.0,
            },
        }
    }

    /// The surface.
    pub fn surface(&self) -> &'a Surface {
        self.surface
    }

    /// Maps and light.
    pub fn parameters(&self) -> &'a Parameters<f32> {
        self.parameters
    }

    /// How pictures are made.
    pub fn settings(&self) -> &PictureSettings {
        &self.settings
    }

    /// Mean radiance of a pixel (row-major index) over `samples` paths, and the share of the pixel that the surface covers or
    /// its shadow on the ground darkens, in [0, 1]. Sets of different numbers are independent.
    pub fn pixel(
        &self,
        camera: &Camera,
        view: u32,
        pixel: usize,
        samples: usize,
        set: u32,
        arena: &mut PathArena,
    ) -> (Vec3, f32) {
        self.pixel_by(camera, PassKey::whole(self.settings.seed, set, view, 0), pixel, samples, arena)
    }

    pub(super) fn pixel_by(
        &self,
        camera: &Camera,
        key: PassKey,
        pixel: usize,
        samples: usize,
        arena: &mut PathArena,
    ) -> (Vec3, f32) {
        let rays = CameraRays::fresh(self.surface, camera, self.settings.filter, samples);
        let estimate = estimate_pixel(&self.paths(), &rays, pixel, key, self.parameters, arena);
        let mean = estimate.mean(rays.samples());
        if estimate.escaped <= 0.0 {
            return (mean, 1.0 - estimate.escaped);
        }
        let (lit_share, direction) = match (self.settings.ground, &self.environment) {
            (Some(height), Some(environment)) => {
                let lit = self.lit_ground(environment, height, camera, key, pixel, samples);
                (lit.share, lit.direction)
            }
            _ => (1.0, camera.ray_through(centre_of(pixel, camera)).direction),
        };
        let behind = match (&self.out_of_focus, &self.environment) {
            (Some(shown), _) => lit_share * shown.radiance_towards(direction),
            // The paths have brought it already, and what is in the shadow is taken off.
            (None, Some(shown)) if self.settings.background_visible => {
                (lit_share - 1.0) * shown.radiance_towards(direction)
            }
            _ => Vec3::ZERO,
        };
        // Never below nothing: within a pixel the environment may be brighter than where it is looked up.
        ((mean + estimate.escaped * behind).max(Vec3::ZERO), 1.0 - estimate.escaped * lit_share)
    }

    /// The share of light on the ground that a ray of this pixel meets.
    fn lit_ground(
        &self,
        environment: &Environment,
        height: f32,
        camera: &Camera,
        key: PassKey,
        pixel: usize,
        samples: usize,
    ) -> LitGround {
        let ground = Ground::new(self.surface, &self.sampler, environment, height);
        // A sequence of its own: the paths of the picture stay the same.
        let mut stream = key.beside(pixel);
        let [across, down] = stream.next_pair();
        let place = Vec2::new((pixel % camera.width) as f32 + across, (pixel / camera.width) as f32 + down);
        let ray = camera.ray_through(place);
        LitGround {
            share: ground.lit_share(&ray, samples.max(LEAST_SHADOW_RAYS), &mut stream),
            direction: ray.direction,
        }
    }
}

/// What a pixel sees of the ground.
struct LitGround {
    share: f32,
    direction: Vec3,
}

/// The middle of a pixel, in pixels.
fn centre_of(pixel: usize, camera: &Camera) -> Vec2 {
    Vec2::new((pixel % camera.width) as f32 + 0.5, (pixel / camera.width) as f32 + 0.5)
}

/// Directions towards the light for a look at the ground: a ratio of sums of fewer is biased.
const LEAST_SHADOW_RAYS: usize = 8;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::texels::{PyramidWeights, TexelPyramid, texels_from_maps};
    use crate::scene::demo::{DemoSettings, build};
    use std::sync::atomic::AtomicBool;

    #[test]
    fn a_background_out_of_focus_changes_nothing_on_the_surface() {
        let settings =
            DemoSettings { views: 1, held_out: 0, width: 40, height: 30, map_size: 64, seed: 1, ..Default::default() };
        let scene = build(&settings).unwrap().scene;
        let surface = Surface::new(scene.mesh.clone()).unwrap();
        let truth = scene.truth.as_ref().unwrap();
        let texels = TexelPyramid::from_base(texels_from_maps(&truth.maps), &PyramidWeights::flat(64, 64))
            .with_model(truth.lobe);
        let parameters = Parameters::new(texels, &truth.environment);
        let camera = scene.views[0].camera;
        let render = |background_blur_degrees: f32| {
            let settings = PictureSettings { samples: 4, background_blur_degrees, ..Default::default() };
            crate::render::picture::render(&surface, &camera, &parameters, 0, &settings, &AtomicBool::new(false))
        };
        let [sharp, blurred] = [0.0, 20.0].map(render);
        let shown = truth.environment.out_of_focus(20.0);
        let mut seen = [0; 2];
        for pixel in 0..camera.width * camera.height {
            let [sharp_radiance, radiance] = [&sharp, &blurred].map(|picture| picture.radiance.pixels()[pixel]);
            match blurred.coverage.pixels()[pixel] {
                1.0 => assert_eq!(radiance, sharp_radiance),
                0.0 => {
                    let towards = camera.ray_through(centre_of(pixel, &camera)).direction;
                    assert!((radiance - shown.radiance_towards(towards)).abs().max_element() < 1e-4);
                }
                _ => continue,
            }
            seen[usize::from(blurred.coverage.pixels()[pixel] > 0.0)] += 1;
        }
        assert!(seen.iter().all(|&count| count > 50), "{seen:?}");
    }
}
