//! Where visibility is kept: one point of the surface for each texel of a square grid over the atlas.

use crate::math::frame::Frame;
use crate::render::Surface;
use crate::render::surface::SurfacePoint;
use crate::trace::Hit;
use glam::{DVec2, Vec2, Vec3};

/// A point of the surface on the grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VisibilityPoint {
    /// Row-major texel of the grid.
    pub texel: u32,
    /// Position in the world.
    pub position: Vec3,
    /// Unit normal of the triangle.
    pub geometric_normal: Vec3,
    /// Interpolated unit normal.
    pub shading_normal: Vec3,
    /// Texture coordinate.
    pub uv: Vec2,
}

impl VisibilityPoint {
    /// A frame around the shading normal.
    pub fn frame(&self) -> Frame {
        Frame::around(self.shading_normal)
    }
}

/// Least cosine between the normal of a point and that of the surface it serves.
const FACING: f32 = 0.2;
/// How far in texels a bilinear neighbour may lie from a place: points are moved onto their triangle, and charts stretch.
const NEIGHBOUR_TEXELS: f32 = 4.0;
/// How far in texels a point is looked for where no neighbour serves.
const SEARCH_TEXELS: f32 = 6.0;

/// Marks texels without a point.
pub const NO_POINT: u32 = u32::MAX;

/// The points of a surface and where they lie on the grid.
#[derive(Clone, Debug)]
pub struct VisibilityGrid {
    /// Width and height of the grid in texels.
    pub size: usize,
    /// The points, in the order of their texels.
    pub points: Vec<VisibilityPoint>,
    /// Index of each texel's point, or [`NO_POINT`].
    pub point_of_texel: Vec<u32>,
}

/// Four points and their weights, which sum to 1 unless there is none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PointTap {
    /// Indices of points.
    pub index: [u32; 4],
    /// Weights.
    pub weight: [f32; 4],
}

impl VisibilityGrid {
    /// A point for every texel that a triangle touches: at the texel's centre where that is inside, otherwise at the
    /// nearest place of the triangle.
    pub fn new(surface: &Surface, size: usize) -> Self {
        let mesh = surface.mesh();
        // Squared distance in texels from the centre to the triangle, and the place on it.
        let mut best: Vec<Option<(f64, Hit)>> = vec![None; size * size];
        for (index, triangle) in mesh.triangles.iter().enumerate() {
            let corners = triangle.map(|vertex| {
                let uv = mesh.uvs[vertex as usize].as_dvec2();
                DVec2::new(uv.x, 1.0 - uv.y) * size as f64
            });
            let low = corners[0].min(corners[1]).min(corners[2]) - 1.0;
            let high = corners[0].max(corners[1]).max(corners[2]) + 1.0;
            let clamp = |value: f64| value.floor().clamp(0.0, size as f64 - 1.0) as usize;
            for row in clamp(low.y)..=clamp(high.y) {
                for column in clamp(low.x)..=clamp(high.x) {
                    let centre = DVec2::new(column as f64 + 0.5, row as f64 + 0.5);
                    let Some((u, v, distance)) = nearest_on_triangle(corners, centre) else { continue };
                    // Bilinear lookups reach one texel beyond the border of a chart.
                    if distance > 1.5 * 1.5 {
                        continue;
                    }
                    let place = &mut best[row * size + column];
                    if place.is_none_or(|(known, _)| distance < known) {
                        *place = Some((distance, Hit { t: 0.0, triangle: index as u32, u: u as f32, v: v as f32 }));
                    }
                }
            }
        }
        let mut points = Vec::new();
        let mut point_of_texel = vec![NO_POINT; size * size];
        for (texel, place) in best.iter().enumerate() {
            let Some((_, hit)) = place else { continue };
            let point = surface.point(hit);
            if point.geometric_normal == Vec3::ZERO {
                continue;
            }
            point_of_texel[texel] = points.len() as u32;
            points.push(VisibilityPoint {
                texel: texel as u32,
                position: point.position,
                geometric_normal: point.geometric_normal,
                shading_normal: point.shading_normal,
                uv: point.uv,
            });
        }
        VisibilityGrid { size, points, point_of_texel }
    }

    /// The points around a place of the surface with bilinear weights. Those that face away from it, or lie farther away
    /// than neighbours on the grid do, belong to another chart beyond the gutter and are left out. Where nothing is left,
    /// as on charts so small that others have taken the texels around, the nearest point in the world of some texels
    /// around. `None` when there is none.
    pub fn tap(&self, place: &SurfacePoint) -> Option<PointTap> {
        let tap = crate::material::TextureTap::at(place.uv, 0, self.size, self.size);
        let reach = NEIGHBOUR_TEXELS / (place.uv_per_length * self.size as f32);
        let mut made = PointTap::default();
        let mut total = 0.0;
        for k in 0..4 {
            let index = self.point_of_texel[tap.index[k] as usize];
            if index == NO_POINT {
                continue;
            }
            let point = &self.points[index as usize];
            let facing = point.shading_normal.dot(place.shading_normal) >= FACING;
            if !facing || point.position.distance_squared(place.position) > reach * reach {
                continue;
            }
            made.index[k] = index;
            made.weight[k] = tap.weight[k];
            total += tap.weight[k];
        }
        if total <= 1e-4 {
            return self.nearest(place);
        }
        made.weight = made.weight.map(|weight| weight / total);
        // A weight of zero names the heaviest point, so that every index is valid.
        let heaviest = made.heaviest();
        for k in 0..4 {
            if made.weight[k] == 0.0 {
                made.index[k] = heaviest;
            }
        }
        Some(made)
    }

    /// Of the points within some texels that face the same way, the one nearest in the world.
    fn nearest(&self, place: &SurfacePoint) -> Option<PointTap> {
        let size = self.size as f32;
        let around = |at: f32| {
            let [low, high] = [at - SEARCH_TEXELS, at + SEARCH_TEXELS];
            low.clamp(0.0, size - 1.0) as usize..=high.clamp(0.0, size - 1.0) as usize
        };
        let mut best = (f32::INFINITY, NO_POINT);
        for row in around((1.0 - place.uv.y) * size) {
            for column in around(place.uv.x * size) {
                let index = self.point_of_texel[row * self.size + column];
                if index == NO_POINT {
                    continue;
                }
                let point = &self.points[index as usize];
                let distance = point.position.distance_squared(place.position);
                if point.shading_normal.dot(place.shading_normal) >= FACING && distance < best.0 {
                    best = (distance, index);
                }
            }
        }
        (best.1 != NO_POINT).then_some(PointTap { index: [best.1; 4], weight: [1.0, 0.0, 0.0, 0.0] })
    }
}

impl PointTap {
    /// The point with the largest weight.
    pub fn heaviest(&self) -> u32 {
        let mut best = 0;
        for k in 1..4 {
            if self.weight[k] > self.weight[best] {
                best = k;
            }
        }
        self.index[best]
    }
}

/// Lists one after another: `offsets` says where each begins, and where the last ends. Whether there is one for each of so
/// many points and all that they hold are points.
pub(super) fn are_lists(offsets: &[u32], of_points: impl ExactSizeIterator<Item = u32>, points: usize) -> bool {
    offsets.len() == points + 1
        && offsets[0] == 0
        && offsets.is_sorted()
        && offsets[points] as usize == of_points.len()
        && of_points.into_iter().all(|point| (point as usize) < points)
}

/// Barycentric coordinates (u, v) of the place of a triangle nearest to a point, and the squared distance.
fn nearest_on_triangle([a, b, c]: [DVec2; 3], point: DVec2) -> Option<(f64, f64, f64)> {
    let area = (b - a).perp_dot(c - a);
    if area.abs() < 1e-12 {
        return None;
    }
    let u = (point - a).perp_dot(c - a) / area;
    let v = (b - a).perp_dot(point - a) / area;
    if u >= 0.0 && v >= 0.0 && u + v <= 1.0 {
        return Some((u, v, 0.0));
    }
    let on_edge = |from: DVec2, to: DVec2| {
        let along = to - from;
        let t = ((point - from).dot(along) / along.length_squared().max(1e-30)).clamp(0.0, 1.0);
        ((from + along * t - point).length_squared(), t)
    };
    let (ab, t_ab) = on_edge(a, b);
    let (bc, t_bc) = on_edge(b, c);
    let (ca, t_ca) = on_edge(c, a);
    Some(if ab <= bc && ab <= ca {
        (t_ab, 0.0, ab)
    } else if bc <= ca {
        (1.0 - t_bc, t_bc, bc)
    } else {
        (0.0, 1.0 - t_ca, ca)
    })
}
