//! Pictures of a surface of which regions have measured reflectance.
//!
//! The walk is that of [`super::path`], with the same random numbers for the same decisions: one direction from the
//! light and one from the material at each vertex, joined by the balance heuristic. A region draws its directions from
//! its table ([`super::regions`]). Where no region is met the picture is that of [`super::picture`] up to rounding.
//! Nothing is fitted to such pictures, so radiance is added up on the way and no record is kept.

use super::accumulate::PassKey;
use super::first_hits::CameraRays;
use super::packet::LEAST_DENSITY;
use super::path::{MAX_BOUNCES, balance_heuristic};
use super::picture::{Picture, PictureSettings, picture_of_groups};
use super::regions::{MeasuredMaterial, Regions};
use super::sums::Parameters;
use super::surface::{Surface, SurfacePoint};
use crate::light::{Environment, EnvironmentSampler, LightSample};
use crate::material::{LobeGeometry, LobeSampler, Material};
use crate::math::frame::Frame;
use crate::math::random::SampleStream;
use crate::math::sphere::tap_of_direction;
use crate::scene::Camera;
use crate::trace::{Hit, Ray};
use glam::Vec3;
use std::sync::atomic::AtomicBool;

/// What reflects at a vertex.
enum Reflector<'a> {
    /// The lobe of the maps.
    Maps(Material<f32>, LobeSampler),
    /// A measured material.
    Measured(&'a MeasuredMaterial),
}

/// A vertex: what reflects, and about which normals.
struct Vertex<'a> {
    reflector: Reflector<'a>,
    point: SurfacePoint,
    frame: Frame,
    towards_viewer: Vec3,
    strength: f32,
}

impl Vertex<'_> {
    /// `f cos` and the density of [`Vertex::sample`] towards a unit direction; `None` below a horizon.
    fn towards(&self, direction: Vec3) -> Option<(Vec3, f32)> {
        if self.point.geometric_normal.dot(direction) <= 0.0 {
            return None;
        }
        let geometry = LobeGeometry::new(self.point.shading_normal, direction, self.towards_viewer)?;
        Some(match &self.reflector {
            Reflector::Maps(material, sampler) => {
                (Vec3::from(material.reflect_by(sampler.model, &geometry, self.strength)), sampler.density(&geometry))
            }
            Reflector::Measured(material) => (
                Vec3::from(material.reflect(&self.frame, direction, self.towards_viewer)),
                material.density(&self.frame, direction, self.towards_viewer),
            ),
        })
    }

    fn sample(&self, stream: &mut SampleStream) -> Option<Vec3> {
        let numbers = stream.next_pair();
        match &self.reflector {
            Reflector::Maps(_, sampler) => sampler.sample(&self.frame, self.towards_viewer, numbers),
            Reflector::Measured(material) => {
                let choice = stream.next_number();
                material.sample(&self.frame, self.towards_viewer, [choice, numbers[0], numbers[1]])
            }
        }
    }
}

/// What a picture is made of.
struct RegionTracer<'a> {
    surface: &'a Surface,
    parameters: &'a Parameters<f32>,
    regions: &'a Regions,
    light: &'a EnvironmentSampler,
    /// What shows behind the surface, where that is not the light as it is.
    out_of_focus: Option<Environment>,
    settings: &'a PictureSettings,
}

impl RegionTracer<'_> {
    fn radiance_of_light(&self, direction: Vec3) -> Vec3 {
        let (width, height) = self.parameters.environment_size;
        Vec3::from(self.parameters.light_at(&tap_of_direction(direction, width, height)))
    }

    fn vertex(&self, ray: &Ray, hit: &Hit) -> Option<Vertex<'_>> {
        let towards_viewer = -ray.direction;
        let point = match self.settings.two_sided {
            true => self.surface.point_facing(hit, towards_viewer),
            false => self.surface.point(hit),
        };
        if point.geometric_normal.dot(towards_viewer) <= 0.0 || point.shading_normal.dot(towards_viewer) <= 0.0 {
            return None;
        }
        let reflector = match self.regions.at(point.uv) {
            Some(measured) => Reflector::Measured(measured),
            None => {
                let texels = &self.parameters.texels;
                let material = texels.fetch(&texels.tap(point.uv, 0));
                let cos_out = point.shading_normal.dot(towards_viewer);
                Reflector::Maps(material, material.sampler(texels.model, cos_out, self.settings.lobe_strength))
            }
        };
        let frame = Frame::around(point.shading_normal);
        Some(Vertex { reflector, point, frame, towards_viewer, strength: self.settings.lobe_strength })
    }

    /// Radiance along a camera ray whose first hit is known.
    fn radiance(&self, camera_ray: &Ray, first_hit: Option<Hit>, stream: &mut SampleStream) -> Vec3 {
        let Some(mut hit) = first_hit else {
            return match &self.out_of_focus {
                Some(shown) => shown.radiance_towards(camera_ray.direction),
                None if !self.settings.background_visible => Vec3::ZERO,
                None => self.radiance_of_light(camera_ray.direction),
            };
        };
        let (mut sum, mut throughput, mut ray) = (Vec3::ZERO, Vec3::ONE, *camera_ray);
        for _ in 0..self.settings.max_bounces.min(MAX_BOUNCES) {
            let Some(vertex) = self.vertex(&ray, &hit) else { break };
            let drawn = self.light.sample(stream.next_pair());
            if let Some(LightSample { direction, density }) = drawn
                && let Some((reflected, other)) = vertex.towards(direction)
                && !self.surface.is_shadowed(&vertex.point, direction)
            {
                let weight = balance_heuristic(density, other) / density;
                sum += throughput * reflected * self.radiance_of_light(direction) * weight;
            }
            let Some(direction) = vertex.sample(stream) else { break };
            let Some((reflected, density)) = vertex.towards(direction) else { break };
            if !(density > LEAST_DENSITY) {
                break;
            }
            throughput *= reflected / density;
            let next = self.surface.ray_from(&vertex.point, direction);
            match self.surface.closest(&next) {
                Some(met) => (ray, hit) = (next, met),
                None => {
                    let weight = balance_heuristic(density, self.light.pdf(direction));
                    sum += throughput * self.radiance_of_light(direction) * weight;
                    break;
                }
            }
        }
        sum
    }
}

/// Renders a view by path tracing, with measured materials in regions. Stops early, with black pixels, when `stop` is
/// set. The variance of [`Picture`] is filled as by [`super::picture::render`].
pub fn render_regions(
    surface: &Surface,
    camera: &Camera,
    parameters: &Parameters<f32>,
    regions: &Regions,
    view: u32,
    settings: &PictureSettings,
    stop: &AtomicBool,
) -> Picture {
    let environment = parameters.environment();
    let light = EnvironmentSampler::new(&environment);
    let out_of_focus = settings.out_of_focus(&environment);
    let tracer = RegionTracer { surface, parameters, regions, light: &light, out_of_focus, settings };
    let rays = CameraRays::fresh(surface, camera, settings.filter, settings.samples);
    picture_of_groups(
        camera,
        settings.groups,
        stop,
        || (),
        |(), pixel, group| {
            let key = PassKey::whole(settings.seed, group, view, 0);
            let (mut sum, mut escaped) = (Vec3::ZERO, 0usize);
            for sample in 0..rays.samples() {
                let mut stream = key.stream(pixel, sample, rays.samples());
                let (ray, hit) = rays.at(pixel, sample, stream.next_pair());
                escaped += usize::from(hit.is_none());
                sum += tracer.radiance(&ray, hit, &mut stream);
            }
            let count = rays.samples() as f32;
            (sum / count, escaped as f32 / count)
        },
    )
}
