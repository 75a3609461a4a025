//! What a pixel of a view says: its residual, and the gradient of its square by the diffuse map.

use crate::fit::targets::Target;
use crate::material::{Material, TextureTap};
use crate::math::parallel;
use crate::math::sphere::BilinearTap;
use crate::render::accumulate::{PassKey, sum_pixel, trace_pixel};
use crate::render::first_hits::CameraRays;
use crate::render::progressive::PictureTracer;
use crate::render::sums::{GradientSink, radiance_backward};
use crate::render::{Parameters, PathArena, PathTracer, Surface};
use crate::scene::{Camera, PixelState, Scene};
use glam::{Vec2, Vec3};
use std::sync::atomic::{AtomicBool, Ordering};

/// What a pixel says.
#[derive(Clone, Copy)]
pub(super) struct PixelSays {
    /// Linear radiance of the photo.
    pub photo: Vec3,
    /// Linear radiance of the model, times the view's gain.
    pub model: Vec3,
    /// What the photo's pixel is evidence for.
    pub state: PixelState,
    /// Whether all camera rays met the surface.
    pub is_covered: bool,
    /// Where the pixel's centre meets the surface, and the level whose texels are as large as the pixel.
    pub place: Option<(Vec2, u32)>,
    /// Product of the two halves' residuals, mean over channels.
    pub squared: f32,
    /// Gradient of the squared residual by diffuse.
    pub gradient: Vec3,
}

impl PixelSays {
    /// Whether the pixel is evidence of the surface alone: wholly covered, not clipped, finite.
    pub(super) fn is_judged(&self) -> bool {
        self.is_covered
            && self.state.is_surface()
            && !self.state.is_clipped()
            && self.squared.is_finite()
            && self.gradient.is_finite()
    }
}

/// What each pixel of a view says, row-major; holes in it when stopped.
pub(super) fn pixels_of_view(
    scene: &Scene,
    tracer: &PictureTracer<'_>,
    target: &Target,
    gain: f32,
    map_size: usize,
    stop: &AtomicBool,
) -> Vec<PixelSays> {
    let camera = &target.camera;
    let settings = tracer.settings();
    // An even number: the halves weigh the same.
    let samples = settings.samples.max(2).next_multiple_of(2);
    let rays = CameraRays::fresh(tracer.surface(), camera, settings.filter, samples);
    let key = PassKey::halves(settings.seed ^ 0x1a7e, 0, target.view as u32);
    let paths = tracer.paths();
    let says_of = |arena: &mut PathArena, pixel: usize| {
        let (photo, state) = target.at(scene, pixel);
        let mut says = PixelSays {
            photo,
            model: Vec3::ZERO,
            state,
            is_covered: false,
            place: None,
            squared: f32::NAN,
            gradient: Vec3::ZERO,
        };
        if stop.load(Ordering::Relaxed) {
            return says;
        }
        trace_pixel(&paths, &rays, pixel, key, arena);
        let estimate = sum_pixel(tracer.parameters(), arena, settings.lobe_strength);
        let (first, second) = (Vec3::from_array(estimate.first) * gain, Vec3::from_array(estimate.second) * gain);
        says.model = 0.5 * (first + second);
        says.is_covered = estimate.escaped == 0.0;
        says.place = centre_of(tracer.surface(), camera, pixel, map_size);
        if says.place.is_some() && state.is_surface() {
            let (rest, other_rest) = (photo - first, photo - second);
            let derivative = |half: usize| gain * derivative_of_half(&paths, tracer.parameters(), arena, half);
            says.squared = (rest * other_rest).element_sum() / 3.0;
            says.gradient = -(rest * derivative(1) + other_rest * derivative(0));
        }
        says
    };
    parallel::map_with(camera.width * camera.height, PathArena::default, says_of)
}

/// Where the middle of a pixel meets the front of the surface, and the level of maps of `map_size` it reads.
fn centre_of(surface: &Surface, camera: &Camera, pixel: usize, map_size: usize) -> Option<(Vec2, u32)> {
    let place = Vec2::new((pixel % camera.width) as f32 + 0.5, (pixel / camera.width) as f32 + 0.5);
    let ray = camera.ray_through(place);
    let hit = surface.closest(&ray)?;
    let point = surface.point(&hit);
    let cosine = point.geometric_normal.dot(-ray.direction);
    if cosine <= 0.0 {
        return None;
    }
    let pixel_in_world = camera.pixel_angle_radians() * hit.t / cosine.max(0.05).sqrt();
    let across = pixel_in_world * point.uv_per_length * map_size as f32;
    // Only as far as blocks divide the map evenly.
    Some((point.uv, (across.log2() + 0.5).clamp(0.0, map_size.trailing_zeros() as f32) as u32))
}

/// Mean over the first (0) or second (1) half of a pixel's paths of the derivative of radiance by the diffuse
/// reflectance of the first vertex, channel by channel.
fn derivative_of_half(paths: &PathTracer<'_>, parameters: &Parameters<f32>, arena: &PathArena, half: usize) -> Vec3 {
    let middle = arena.paths.len() / 2;
    let own = if half == 0 { &arena.paths[..middle] } else { &arena.paths[middle..] };
    let mut sum = Vec3::ZERO;
    for path in own {
        let mut sink = FirstVertex(None);
        radiance_backward(parameters, arena, path, paths.settings.lobe_strength, [1.0; 3], &mut sink);
        sum += sink.0.unwrap_or(Vec3::ZERO);
    }
    sum / own.len().max(1) as f32
}

/// Keeps the derivative by the diffuse reflectance at the first vertex: the walk forth begins there.
struct FirstVertex(Option<Vec3>);

impl GradientSink<f32> for FirstVertex {
    fn add_material(&mut self, _: &TextureTap, d_material: &Material<f32>) {
        self.0.get_or_insert(Vec3::from_array(d_material.diffuse));
    }

    fn add_light(&mut self, _: &BilinearTap, _: [f32; 3]) {}
}
