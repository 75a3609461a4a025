//! From a ray to a point on the mesh.

use crate::error::{Error, ErrorKind, Result};
use crate::scene::Mesh;
use crate::trace::{Bvh, Hit, Ray};
use glam::{Vec2, Vec3};

/// A mesh with texture coordinates, ready for rays.
pub struct Surface {
    mesh: Mesh,
    bvh: Bvh,
    /// Per triangle: length in texture space per length in the world (geometric mean over directions).
    uv_per_length: Vec<f32>,
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
        let uv_per_length = (0..mesh.triangles.len())
            .map(|triangle| {
                let [a, b, c] = mesh.triangles[triangle].map(|vertex| mesh.uvs[vertex as usize]);
                let area_uv = (b - a).perp_dot(c - a).abs();
                let area_world = mesh.area_vector(triangle).length();
                if area_world > 0.0 { (area_uv / area_world).sqrt() } else { 0.0 }
            })
            .collect();
        Ok(Surface { mesh, bvh, uv_per_length })
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
    pub fn point(&self, hit: &Hit) -> SurfacePoint {
        let triangle = self.mesh.triangles[hit.triangle as usize].map(|vertex| vertex as usize);
        let weights = [1.0 - hit.u - hit.v, hit.u, hit.v];
        let blend = |values: &[Vec3]| {
            values[triangle[0]] * weights[0] + values[triangle[1]] * weights[1] + values[triangle[2]] * weights[2]
        };
        let uv = self.mesh.uvs[triangle[0]] * weights[0]
            + self.mesh.uvs[triangle[1]] * weights[1]
            + self.mesh.uvs[triangle[2]] * weights[2];
        let geometric_normal = self.mesh.area_vector(hit.triangle as usize).normalize_or_zero();
        SurfacePoint {
            position: blend(&self.mesh.positions),
            geometric_normal,
            shading_normal: blend(&self.mesh.normals).try_normalize().unwrap_or(geometric_normal),
            uv,
            uv_per_length: self.uv_per_length[hit.triangle as usize],
            triangle: hit.triangle,
        }
    }

    /// The surface at a hit, with both normals turned to the side of a direction that leaves it.
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
    pub fn ray_from(&self, point: &SurfacePoint, direction: Vec3) -> Ray {
        let origin = self.bvh.offset_origin(point.position, point.geometric_normal, direction);
        Ray { origin, direction, t_max: f32::INFINITY }
    }
}
