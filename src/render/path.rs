//! A path is traced once into a record of what it reads.
//!
//! Directions are drawn from a *proposal*: the maps and the light as they were at the start of a step. Nothing that
//! depends on the proposal is differentiated (detached sampling, as in Zeltner, Speierer, Georgiev and Jakob 2021), so
//! for a seed the estimate is a smooth function of maps and light, and central differences check it exactly.
//!
//! At each vertex one direction is drawn from the light (next-event estimation) and one from the lobe; the two are
//! joined by multiple importance sampling with the balance heuristic (Veach 1997, eq. 9.8). With evenly spread numbers it
//! scatters less than the power heuristic.
//!
//! Shading normals: the lobe is zero unless light and viewer are above both the shading and the geometric horizon, so
//! no light leaks through a surface at the terminator.

use super::packet::Packet;
use super::surface::{Surface, SurfacePoint};
use crate::light::EnvironmentSampler;
use crate::material::{LobeGeometry, TexelPyramid, TextureTap};
use crate::math::sphere::{BilinearTap, tap_of_angles};
use crate::trace::Ray;

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
#[derive(Clone, Copy, Debug, Default)]
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
    /// Room for the vertices of all paths, path after path, each with as many as it may have.
    pub(super) vertices: Vec<PathVertex>,
    /// How much of that room is given away.
    reserved: usize,
    /// The paths.
    pub paths: Vec<PathHead>,
    /// Paths on their way.
    pub(super) packet: Packet,
}

impl PathArena {
    /// Forgets all paths and keeps the memory.
    pub fn clear(&mut self) {
        self.reserved = 0;
        self.paths.clear();
    }

    /// Room for so many vertices; where it begins.
    pub(super) fn reserve(&mut self, count: usize) -> u32 {
        let first = self.reserved;
        self.reserved += count;
        if self.reserved > self.vertices.len() {
            self.vertices.resize(self.reserved, PathVertex::default());
        }
        first as u32
    }

    /// The vertices of a path.
    pub fn vertices_of(&self, path: &PathHead) -> &[PathVertex] {
        &self.vertices[path.first as usize..(path.first + path.count) as usize]
    }
}

/// Traces paths over a surface with a frozen proposal: [`PathTracer::trace`].
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
    /// Where the environment is read in a direction of these angles.
    pub(super) fn light_tap(&self, (phi, theta): (f32, f32)) -> BilinearTap {
        tap_of_angles(phi, theta, self.environment_size.0, self.environment_size.1)
    }

    /// The level whose texels are about as large as the footprint of the ray's cone, by area (isotropic).
    pub(super) fn mip_level(&self, bounce_index: usize, point: &SurfacePoint, ray: &Ray, distance: f32) -> u32 {
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
        // The nearest whole logarithm to base 2 is the exponent of sqrt(2) times as much.
        ((texels * std::f32::consts::SQRT_2).to_bits() >> 23).saturating_sub(127).min(31)
    }
}

/// Weight of a direction drawn with density `own` when another technique could draw it with density `other`.
pub(super) fn balance_heuristic(own: f32, other: f32) -> f32 {
    // Divided first: the sum of two densities could overflow.
    1.0 / (1.0 + other / own)
}
