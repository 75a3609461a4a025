//! From a ray to a point on the mesh.

use crate::error::{Error, ErrorKind, Result};
use crate::scene::Mesh;
use crate::trace::{Bvh, Hit, Ray};
use glam::{Vec2, Vec3};

/// A mesh with texture coordinates, ready for rays.
pub struct Surface {
    mesh: Mesh,
    bvh: Bvh,
    corners: Vec<Corner>,
    facets: Vec<Facet>,
}

/// A vertex of the mesh, its numbers side by side: a hit reads three of these and not nine lists.
#[derive(Clone, Copy)]
struct Corner {
    position: Vec3,
    normal: Vec3,
    uv: Vec2,
}

/// A triangle of the mesh.
#[derive(Clone, Copy)]
struct Facet {
    vertices: [u32; 3],
    geometric_normal: Vec3,
    /// Length in texture space per length in the world (geometric mean over directions).
    uv_per_length: f32,
}

/// A point of the surface as seen along a ray.
#[derive(Clone, Copy, Debug)]
pub struct SurfacePoint {
    /// Position in the world.
    pub position: Vec3,
    /// Unit normal of the triangle, on the side it is wound for.
    pub geometric_normal: Vec3,
    /// Interpolated unit normal.
    pub shading_normal: Vec3,
    /// Texture coordinate, v up.
    pub uv: Vec2,
    /// Length in texture space per length in the world.
    pub uv_per_length: f32,
    /// Index of the triangle.
    pub triangle: u32,
}

impl Surface {
    /// Prepares a mesh that has normals and texture coordinates, one of each a vertex.
    pub fn new(mesh: Mesh) -> Result<Self> {
        mesh.validate()?;
        if mesh.uvs.len() != mesh.positions.len() || mesh.normals.len() != mesh.positions.len() {
            return Err(Error::new(ErrorKind::InvalidScene, "the mesh has no texture coordinates or no normals")
                .remedy("build an atlas first"));
        }
        if let Some(vertex) = mesh.uvs.iter().position(|uv| !uv.is_finite()) {
            let message = format!("the texture coordinate of vertex {vertex} is not finite");
            return Err(Error::new(ErrorKind::NonFinite, message).remedy("build an atlas anew: --uv rebuild"));
        }
        let bvh = Bvh::build(&mesh.positions, &mesh.triangles)?;
        let facet = |triangle: usize| {
            let vertices = mesh.triangles[triangle];
            let [a, b, c] = vertices.map(|vertex| mesh.uvs[vertex as usize]);
            let area_uv = (b - a).perp_dot(c - a).abs();
            let area_vector = mesh.area_vector(triangle);
            let area_world = area_vector.length();
            let uv_per_length = if area_world > 0.0 { (area_uv / area_world).sqrt() } else { 0.0 };
            Facet { vertices, geometric_normal: area_vector.normalize_or_zero(), uv_per_length }
        };
        let facets = (0..mesh.triangles.len()).map(facet).collect();
        let corners = (0..mesh.positions.len())
            .map(|vertex| Corner {
                position: mesh.positions[vertex],
                normal: mesh.normals[vertex],
                uv: mesh.uvs[vertex],
            })
            .collect();
        Ok(Surface { mesh, bvh, corners, facets })
    }

    /// The mesh.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// The hierarchy over the mesh.
    pub fn bvh(&self) -> &Bvh {
        &self.bvh
    }

    /// Where a ray meets the surface first.
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        self.bvh.closest_hit(ray)
    }

    /// The surface at a hit.
    #[inline]
    pub fn point(&self, hit: &Hit) -> SurfacePoint {
        let Facet { vertices, geometric_normal, uv_per_length } = self.facets[hit.triangle as usize];
        let [a, b, c] = vertices.map(|vertex| self.corners[vertex as usize]);
        let (u, v) = (hit.u, hit.v);
        let w = 1.0 - u - v;
        SurfacePoint {
            position: a.position * w + b.position * u + c.position * v,
            geometric_normal,
            shading_normal: (a.normal * w + b.normal * u + c.normal * v).try_normalize().unwrap_or(geometric_normal),
            uv: a.uv * w + b.uv * u + c.uv * v,
            uv_per_length,
            triangle: hit.triangle,
        }
    }

    /// The surface at a hit, with both normals turned to the side of a direction that leaves it.
    #[inline]
    pub fn point_facing(&self, hit: &Hit, direction: Vec3) -> SurfacePoint {
        let mut point = self.point(hit);
        if point.geometric_normal.dot(direction) < 0.0 {
            point.geometric_normal = -point.geometric_normal;
            point.shading_normal = -point.shading_normal;
        }
        point
    }

    /// Whether light from infinity along a unit direction is blocked from a point.
    pub fn is_shadowed(&self, point: &SurfacePoint, direction: Vec3) -> bool {
        self.bvh.is_occluded(&self.ray_from(point, direction))
    }

    /// A ray that leaves the surface along a unit direction without meeting it again at its start.
    #[inline]
    pub fn ray_from(&self, point: &SurfacePoint, direction: Vec3) -> Ray {
        let origin = self.bvh.offset_origin(point.position, point.geometric_normal, direction);
        Ray { origin, direction, t_max: f32::INFINITY }
    }
}
