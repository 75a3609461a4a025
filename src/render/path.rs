//! A path is traced once into a record of what it reads.
//!
//! Directions are drawn from a *proposal*: the maps and the light as they were at the start of a step. Nothing that
//! depends on the proposal is differentiated (detached sampling, as in Zeltner, Speierer, Georgiev and Jakob 2021), so
//! for a seed the estimate is a smooth function of maps and light, and central differences check it exactly.
//!
//! At each vertex one direction is drawn from the light (next-event estimation) and one from the lobe; the two are
//! joined by multiple importance sampling with the power heuristic (Veach 1997, eq. 9.13 with beta = 2).
//!
//! Shading normals: the lobe is zero unless light and viewer are above both the shading and the geometric horizon, so
//! no light leaks through a surface at the terminator.

use super::surface::{Surface, SurfacePoint};
use crate::light::EnvironmentSampler;
use crate::material::{LobeGeometry, TexelPyramid, TextureTap};
use crate::math::frame::Frame;
use crate::math::random::SampleStream;
use crate::math::sphere::{BilinearTap, angles_of_direction, tap_of_angles, tap_of_direction};
use crate::trace::{Hit, Ray};
use glam::Vec3;

/// Longest path that is ever traced, in surface hits.
pub const MAX_BOUNCES: usize = 16;

/// How paths are traced.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathSettings {
    /// Number of surface hits on the longest path: 1 is direct light only.
    pub max_bounces: usize,
    /// Strength of the specular lobe as a whole, in [0, 1]; 0 leaves Lambert alone.
    pub lobe_strength: f32,
    /// Whether a camera ray that meets nothing sees the environment.
    pub background_visible: bool,
    /// Whether the back of a triangle reflects like its front; otherwise it is black. Scans have holes through which
    /// their inside shows: pictures are better with both sides, but only fronts are evidence for a fit.
    pub two_sided: bool,
    /// Angle a camera ray stands for, in radians: sets the mip level of first hits. 0 always reads the finest level.
    pub camera_cone_radians: f32,
    /// Angle a bounced ray stands for, in radians: sets the mip level of later hits. 0 always reads the finest level.
    pub bounce_cone_radians: f32,
}

/// The direction drawn from the light at a vertex, when it is not blocked.
#[derive(Clone, Copy, Debug)]
pub struct Connection {
    /// The two directions about the shading normal.
    pub geometry: LobeGeometry,
    /// The texels of the environment it sees.
    pub light: BilinearTap,
    /// Weight of multiple importance sampling over the density of the direction, in sr.
    pub weight: f32,
}

/// The direction drawn from the lobe at a vertex.
#[derive(Clone, Copy, Debug)]
pub struct Bounce {
    /// The two directions about the shading normal.
    pub geometry: LobeGeometry,
    /// One over the density of the direction, in sr.
    pub inverse_density: f32,
    /// The texels of the environment and the weight of multiple importance sampling, when the ray meets nothing;
    /// otherwise the path goes on with the next vertex, if there is one.
    pub escape: Option<(BilinearTap, f32)>,
}

/// One surface hit of a path.
#[derive(Clone, Copy, Debug)]
pub struct PathVertex {
    /// The texels of the material.
    pub texture: TextureTap,
    /// Light from a direction drawn from the light.
    pub connection: Option<Connection>,
    /// Light from a direction drawn from the lobe.
    pub bounce: Option<Bounce>,
}

/// One path: a run of vertices in the arena, or a piece of background.
#[derive(Clone, Copy, Debug)]
pub struct PathHead {
    /// First vertex in the arena.
    pub first: u32,
    /// Number of vertices; 0 when the camera ray met nothing or a back face.
    pub count: u32,
    /// The environment, where the camera ray met nothing and the background is visible.
    pub background: Option<BilinearTap>,
    /// Whether the camera ray met nothing.
    pub escaped: bool,
}

/// Records of the paths of one pixel; its memory is used again and again.
#[derive(Clone, Debug, Default)]
pub struct PathArena {
    /// Vertices of all paths, path after path.
    pub vertices: Vec<PathVertex>,
    /// The paths.
    pub paths: Vec<PathHead>,
}

impl PathArena {
    /// Forgets all paths and keeps the memory.
    pub fn clear(&mut self) {
        self.vertices.clear();
        self.paths.clear();
    }

    /// The vertices of a path.
    pub fn vertices_of(&self, path: &PathHead) -> &[PathVertex] {
        &self.vertices[path.first as usize..(path.first + path.count) as usize]
    }
}

/// Traces paths over a surface with a frozen proposal.
pub struct PathTracer<'a> {
    /// The surface.
    pub surface: &'a Surface,
    /// The maps that directions are drawn from.
    pub proposal: &'a TexelPyramid<f32>,
    /// The light that directions are drawn from; a black one yields none.
    pub light: &'a EnvironmentSampler,
    /// Width and height of the environment in texels.
    pub environment_size: (usize, usize),
    /// How paths are traced.
    pub settings: PathSettings,
}

impl PathTracer<'_> {
    /// Traces the path behind a camera ray whose first hit is known, and adds its record to the arena.
    pub fn trace(&self, ray: &Ray, first_hit: Option<Hit>, stream: &mut SampleStream, arena: &mut PathArena) {
        let first = arena.vertices.len() as u32;
        let mut head = PathHead { first, count: 0, background: None, escaped: first_hit.is_none() };
        match first_hit {
            None if self.settings.background_visible => head.background = Some(self.light_tap(ray.direction)),
            None => {}
            Some(hit) => self.trace_from(ray, hit, stream, arena),
        }
        head.count = arena.vertices.len() as u32 - first;
        arena.paths.push(head);
    }

    fn trace_from(&self, camera_ray: &Ray, first_hit: Hit, stream: &mut SampleStream, arena: &mut PathArena) {
        let max_bounces = self.settings.max_bounces.min(MAX_BOUNCES);
        let mut ray = *camera_ray;
        let mut hit = first_hit;
        for bounce_index in 0..max_bounces {
            let towards_viewer = -ray.direction;
            let point = if self.settings.two_sided {
                self.surface.point_facing(&hit, towards_viewer)
            } else {
                self.surface.point(&hit)
            };
            if point.geometric_normal.dot(towards_viewer) <= 0.0 || point.shading_normal.dot(towards_viewer) <= 0.0 {
                return;
            }
            let texture = self.proposal.tap(point.uv, self.mip_level(bounce_index, &point, &ray, hit.t));
            let material = self.proposal.fetch(&texture);
            let sampler = material.sampler(point.shading_normal.dot(towards_viewer), self.settings.lobe_strength);

            // Draw a direction from the light and keep it if nothing is in the way.
            let light_numbers = stream.next_pair();
            let connection = self.light.sample(light_numbers).and_then(|(direction, density)| {
                let geometry = self.geometry_above(&point, direction, towards_viewer)?;
                if self.surface.is_shadowed(&point, direction) {
                    return None;
                }
                let other = sampler.density(&geometry);
                let weight = power_heuristic(density, other) / density;
                Some(Connection { geometry, light: self.light_tap(direction), weight })
            });

            // Draw a direction from the lobe and follow it.
            let choice = stream.next_number();
            let lobe_numbers = stream.next_pair();
            let frame = Frame::around(point.shading_normal);
            let sampled = sampler
                .sample(&frame, towards_viewer, choice, lobe_numbers)
                .and_then(|direction| Some((direction, self.geometry_above(&point, direction, towards_viewer)?)));
            let Some((direction, geometry)) = sampled else {
                arena.vertices.push(PathVertex { texture, connection, bounce: None });
                return;
            };
            let density = sampler.density(&geometry);
            if !(density > 1e-9) {
                arena.vertices.push(PathVertex { texture, connection, bounce: None });
                return;
            }
            let next_ray = self.surface.ray_from(&point, direction);
            let next_hit = self.surface.closest(&next_ray);
            let escape = next_hit.is_none().then(|| {
                let (phi, theta) = angles_of_direction(direction);
                let (width, height) = self.environment_size;
                let other = self.light.pdf_at_angles(phi, theta);
                (tap_of_angles(phi, theta, width, height), power_heuristic(density, other))
            });
            let bounce = Bounce { geometry, inverse_density: 1.0 / density, escape };
            arena.vertices.push(PathVertex { texture, connection, bounce: Some(bounce) });
            let Some(next_hit) = next_hit else { return };
            ray = next_ray;
            hit = next_hit;
        }
    }

    /// Geometry of the lobe, above both horizons.
    fn geometry_above(&self, point: &SurfacePoint, direction: Vec3, towards_viewer: Vec3) -> Option<LobeGeometry> {
        if point.geometric_normal.dot(direction) <= 0.0 {
            return None;
        }
        LobeGeometry::new(point.shading_normal, direction, towards_viewer)
    }

    fn light_tap(&self, direction: Vec3) -> BilinearTap {
        tap_of_direction(direction, self.environment_size.0, self.environment_size.1)
    }

    /// The level whose texels are about as large as the footprint of the ray's cone, by area (isotropic).
    fn mip_level(&self, bounce_index: usize, point: &SurfacePoint, ray: &Ray, distance: f32) -> u32 {
        let cone =
            if bounce_index == 0 { self.settings.camera_cone_radians } else { self.settings.bounce_cone_radians };
        if cone <= 0.0 || self.proposal.levels.len() == 1 {
            return 0;
        }
        // A cone of width w meets the surface in an ellipse of axes w and w / cos; its area sets the level.
        let cosine = point.geometric_normal.dot(-ray.direction).max(0.05);
        let width_in_world = cone * distance / cosine.sqrt();
        let base = &self.proposal.levels[0];
        let texels = width_in_world * point.uv_per_length * ((base.width * base.height) as f32).sqrt();
        (texels.log2() + 0.5).clamp(0.0, 31.0) as u32
    }
}

/// Weight of a direction drawn with density `own` when another technique could draw it with density `other`.
pub(super) fn power_heuristic(own: f32, other: f32) -> f32 {
    // Divided first, so that a density of 1e30 does not overflow when squared.
    let ratio = other / own;
    1.0 / (1.0 + ratio * ratio)
}
