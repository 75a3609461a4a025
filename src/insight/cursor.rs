//! One cursor over photo, surface and map: from a pixel to a point, from a point to a texel, and back.
//!
//! [`point_of_pixel`] and [`place_in_view`] lead between a photo and the surface, [`UvIndex`] from a place of the map
//! to the surface. [`seen_at`] says whether a view sees a point: inside the picture, from the front, nothing in between.

use crate::render::Surface;
use crate::render::surface::SurfacePoint;
use crate::scene::{Mesh, Scene};
use crate::trace::Hit;
use glam::{Vec2, Vec3};

/// Cells of the index for each triangle, about.
const CELLS_PER_TRIANGLE: f64 = 1.0;
/// Entries of the index for each triangle at most, about; triangles that lie over each other get larger cells.
const ENTRIES_PER_TRIANGLE: f64 = 8.0;
/// Places this far outside a triangle count as inside, in barycentric coordinates: an edge belongs to its triangles
/// whatever the rounding.
const EDGE_TOLERANCE: f32 = 1e-4;

/// Finds the triangle under a place of the map: a grid of cells over the texture, each with its triangles.
#[derive(Clone, Debug)]
pub struct UvIndex {
    /// Cells along each side.
    size: usize,
    /// Where each cell's triangles start in `triangles`; one more at the end.
    starts: Vec<u32>,
    /// Triangles of all cells, rising within each.
    triangles: Vec<u32>,
}

impl UvIndex {
    /// Sorts the triangles of a mesh into cells. A mesh without texture coordinates gives an index that finds nothing.
    pub fn new(mesh: &Mesh) -> Self {
        let boxes: Vec<Option<(Vec2, Vec2)>> =
            (0..mesh.triangles.len()).map(|triangle| uv_box(mesh, triangle)).collect();
        let count = boxes.iter().flatten().count().max(1) as f64;
        let area: f64 = boxes.iter().flatten().map(|(low, high)| f64::from((high.x - low.x) * (high.y - low.y))).sum();
        let by_count = (CELLS_PER_TRIANGLE * count).sqrt();
        let by_area = (ENTRIES_PER_TRIANGLE * count / area.max(1e-12)).sqrt();
        let size = by_count.min(by_area).ceil().clamp(1.0, 4096.0) as usize;
        let cells_of = |(low, high): &(Vec2, Vec2)| {
            let (first, last) = (cell(*low, size), cell(*high, size));
            (first.1..=last.1).flat_map(move |row| (first.0..=last.0).map(move |column| row * size + column))
        };
        let mut starts = vec![0u32; size * size + 1];
        for cell in boxes.iter().flatten().flat_map(cells_of) {
            starts[cell + 1] += 1;
        }
        for cell in 0..size * size {
            starts[cell + 1] += starts[cell];
        }
        let mut next = starts.clone();
        let mut triangles = vec![0u32; starts[size * size] as usize];
        for (triangle, own) in boxes.iter().enumerate() {
            for cell in own.iter().flat_map(cells_of) {
                triangles[next[cell] as usize] = triangle as u32;
                next[cell] += 1;
            }
        }
        UvIndex { size, starts, triangles }
    }

    /// The triangle under a texture coordinate (v up) and the place on it; `t` of the hit is 0. Where charts lie over
    /// each other, the first triangle; on an edge, the triangle it is deepest in. `None` between charts.
    pub fn hit(&self, mesh: &Mesh, uv: Vec2) -> Option<Hit> {
        if !uv.is_finite() {
            return None;
        }
        let (column, row) = cell(uv, self.size);
        let cell = row * self.size + column;
        let range = self.starts[cell] as usize..self.starts[cell + 1] as usize;
        let mut best: Option<(f32, Hit)> = None;
        for &triangle in &self.triangles[range] {
            let [a, b, c] = mesh.triangles[triangle as usize].map(|vertex| mesh.uvs[vertex as usize]);
            let area = (b - a).perp_dot(c - a);
            let (u, v) = ((uv - a).perp_dot(c - a) / area, (b - a).perp_dot(uv - a) / area);
            let inside = u.min(v).min(1.0 - u - v);
            if inside >= 0.0 {
                return Some(Hit { t: 0.0, triangle, u, v });
            }
            // Written so that a triangle without area, of NaN, fails.
            if inside >= -EDGE_TOLERANCE && best.as_ref().is_none_or(|(other, _)| inside > *other) {
                best = Some((inside, Hit { t: 0.0, triangle, u, v }));
            }
        }
        best.map(|(_, hit)| hit)
    }
}

/// Column and row of the cell of a texture coordinate; places outside the map belong to the cells of its border.
fn cell(uv: Vec2, size: usize) -> (usize, usize) {
    let along = |place: f32| ((place * size as f32) as usize).min(size - 1);
    (along(uv.x), along(uv.y))
}

fn uv_box(mesh: &Mesh, triangle: usize) -> Option<(Vec2, Vec2)> {
    let mut corners = [Vec2::ZERO; 3];
    for (corner, &vertex) in corners.iter_mut().zip(&mesh.triangles[triangle]) {
        *corner = *mesh.uvs.get(vertex as usize)?;
    }
    let [a, b, c] = corners;
    (a.is_finite() && b.is_finite() && c.is_finite()).then(|| (a.min(b).min(c), a.max(b).max(c)))
}

/// The surface under a texture coordinate (v up); `None` between charts. `index` is that of the surface's mesh.
pub fn surface_point_of_uv(surface: &Surface, index: &UvIndex, uv: Vec2) -> Option<SurfacePoint> {
    index.hit(surface.mesh(), uv).map(|hit| surface.point(&hit))
}

/// The surface at a place within a triangle; `weights` are the barycentric coordinates of its second and third
/// corner. `None` when there is no such triangle.
pub fn surface_point_of_triangle(surface: &Surface, triangle: usize, weights: Vec2) -> Option<SurfacePoint> {
    let exists = triangle < surface.mesh().triangles.len();
    exists.then(|| surface.point(&Hit { t: 0.0, triangle: triangle as u32, u: weights.x, v: weights.y }))
}

/// Texture coordinate (v up) of the centre of a texel.
pub fn uv_of_texel(row: usize, column: usize, width: usize, height: usize) -> Vec2 {
    Vec2::new((column as f32 + 0.5) / width as f32, 1.0 - (row as f32 + 0.5) / height as f32)
}

/// Where a point of the world falls on a view's picture, in pixels; `None` behind the camera, outside the picture, or
/// without such a view. What stands in between is not asked: see [`seen_at`].
pub fn place_in_view(scene: &Scene, view: usize, point_in_world: Vec3) -> Option<Vec2> {
    scene.views.get(view)?.camera.place_in_picture(point_in_world)
}

/// The surface behind a place of a view's picture, in pixels; `None` where the ray meets nothing, or the back of a
/// triangle, which no map describes.
pub fn point_of_pixel(scene: &Scene, surface: &Surface, view: usize, place: Vec2) -> Option<SurfacePoint> {
    let ray = scene.views.get(view)?.camera.ray_through(place);
    let point = surface.point(&surface.closest(&ray)?);
    (point.geometric_normal.dot(ray.direction) < 0.0).then_some(point)
}

/// Where a view sees a point of the surface, in pixels: inside its picture, from the front, with nothing in between.
pub fn seen_at(scene: &Scene, surface: &Surface, view: usize, point: &SurfacePoint) -> Option<Vec2> {
    let place = place_in_view(scene, view, point.position)?;
    let eye = scene.views[view].camera.position_in_world();
    let is_front = point.geometric_normal.dot(eye - point.position) > 0.0;
    (is_front && !surface.bvh().is_hidden_from(point.position, point.geometric_normal, eye)).then_some(place)
}
