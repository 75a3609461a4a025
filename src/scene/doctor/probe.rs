//! First hits of a view on a coarse grid of pixels, shared by all checks that need rays.

use crate::scene::{Camera, Mesh, View};
use crate::trace::{Bvh, Hit};
use glam::{Vec2, Vec3};

/// About this many pixels of a view are probed.
const PROBES_PER_VIEW: usize = 16_000;
/// A pixel's piece of a surface that is seen edge on counts as if it were seen under this cosine.
const LEAST_COSINE: f32 = 0.05;

/// What the ray through a pixel's centre meets.
#[derive(Clone, Copy, Debug)]
pub struct Probe {
    /// Row of the pixel.
    pub row: usize,
    /// Column of the pixel.
    pub column: usize,
    /// The hit, `None` for the background.
    pub hit: Option<Hit>,
}

/// Probes of a view on every `step`-th row and column.
pub fn probe_view(view: &View, bvh: &Bvh) -> Vec<Probe> {
    probe_about(view, bvh, PROBES_PER_VIEW)
}

/// The same with about `wanted` probes.
pub fn probe_about(view: &View, bvh: &Bvh, wanted: usize) -> Vec<Probe> {
    let (width, height) = (view.camera.width, view.camera.height);
    let step = step_for(width * height, wanted);
    let mut probes = Vec::with_capacity((width / step + 1) * (height / step + 1));
    for row in (step / 2..height).step_by(step) {
        for column in (step / 2..width).step_by(step) {
            probes.push(Probe { row, column, hit: hit_at(&view.camera, bvh, centre_of(row, column)) });
        }
    }
    probes
}

fn step_for(pixels: usize, wanted: usize) -> usize {
    ((pixels as f64 / wanted as f64).sqrt().floor() as usize).max(1)
}

/// Centre of a pixel in the program's convention.
pub fn centre_of(row: usize, column: usize) -> Vec2 {
    Vec2::new(column as f32 + 0.5, row as f32 + 0.5)
}

/// The first hit of the ray through a place on the picture.
pub fn hit_at(camera: &Camera, bvh: &Bvh, place_pixels: Vec2) -> Option<Hit> {
    bvh.closest_hit(&camera.ray_through(place_pixels))
}

/// Position on the surface, geometric normal and shading normal of a hit; `None` for a triangle without area.
pub fn surface_at(mesh: &Mesh, hit: &Hit) -> Option<(Vec3, Vec3, Vec3)> {
    let [a, b, c] = mesh.corners(hit.triangle as usize);
    let weights = Vec3::new(1.0 - hit.u - hit.v, hit.u, hit.v);
    let normal = mesh.area_vector(hit.triangle as usize).try_normalize()?;
    let shading = if mesh.normals.is_empty() {
        normal
    } else {
        let [i, j, k] = mesh.triangles[hit.triangle as usize].map(|vertex| mesh.normals[vertex as usize]);
        (i * weights.x + j * weights.y + k * weights.z).normalize_or(normal)
    };
    Some((a * weights.x + b * weights.y + c * weights.z, normal, shading))
}

/// The piece of surface that a pixel shows around a place with a normal, in squared world units.
pub fn area_in_pixel(camera: &Camera, place_in_world: Vec3, normal_in_world: Vec3) -> f32 {
    let to_camera = camera.position_in_world() - place_in_world;
    let cosine = to_camera.normalize_or_zero().dot(normal_in_world).abs().max(LEAST_COSINE);
    let depth = -to_camera.dot(camera.forward_in_world());
    // The pixel's solid angle, (depth / distance)^3 / focal^2, times distance^2 / cosine.
    depth.powi(3) / (to_camera.length() * camera.focal_pixels.x * camera.focal_pixels.y * cosine)
}
