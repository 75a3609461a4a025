//! An indexed triangle mesh.

use crate::error::{Error, ErrorKind, Place, Result};
use glam::{Vec2, Vec3};

/// An indexed triangle mesh: one index for position, normal and texture coordinate.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Vertex positions in world units.
    pub positions: Vec<Vec3>,
    /// Shading normals, unit length, one a vertex; empty when the source has none.
    pub normals: Vec<Vec3>,
    /// Texture coordinates, v up, one a vertex; empty when the source has none.
    pub uvs: Vec<Vec2>,
    /// Corners of each triangle, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// Positions of a triangle's corners.
    pub fn corners(&self, triangle: usize) -> [Vec3; 3] {
        self.triangles[triangle].map(|vertex| self.positions[vertex as usize])
    }

    /// Twice the area times the unit normal of a triangle; zero for a degenerate one.
    pub fn area_vector(&self, triangle: usize) -> Vec3 {
        let [a, b, c] = self.corners(triangle);
        (b - a).cross(c - a)
    }

    /// Lower and upper corner of the bounding box of the referenced vertices; `None` without triangles.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        let mut corners = self.triangles.iter().flatten().map(|&vertex| self.positions[vertex as usize]);
        let first = corners.next()?;
        Some(corners.fold((first, first), |(low, high), point| (low.min(point), high.max(point))))
    }

    /// Normals by angle-weighted averaging over the triangles around each vertex (Thuermer and Wuethrich 1998).
    /// A vertex without area gets +y.
    pub fn compute_normals(&mut self) {
        let mut normals = vec![Vec3::ZERO; self.positions.len()];
        for triangle in 0..self.triangles.len() {
            let normal = self.area_vector(triangle).normalize_or_zero();
            let corners = self.corners(triangle);
            for corner in 0..3 {
                let to_next = corners[(corner + 1) % 3] - corners[corner];
                let to_previous = corners[(corner + 2) % 3] - corners[corner];
                if to_next.length_squared() > 0.0 && to_previous.length_squared() > 0.0 {
                    normals[self.triangles[triangle][corner] as usize] += normal * to_next.angle_between(to_previous);
                }
            }
        }
        self.normals = normals.into_iter().map(|normal| normal.try_normalize().unwrap_or(Vec3::Y)).collect();
    }

    /// Checks what every later stage relies on: indices in range, finite positions, attributes of the right length.
    pub fn validate(&self) -> Result<()> {
        let invalid = |message: String| Error::new(ErrorKind::InvalidScene, message);
        let count = self.positions.len();
        for (name, length) in [("normals", self.normals.len()), ("texture coordinates", self.uvs.len())] {
            if length != 0 && length != count {
                return Err(invalid(format!("the mesh has {count} vertices but {length} {name}")));
            }
        }
        for (index, triangle) in self.triangles.iter().enumerate() {
            for &vertex in triangle {
                let Some(position) = self.positions.get(vertex as usize) else {
                    return Err(invalid(format!("a triangle names vertex {vertex} of {count}"))
                        .at(Place::Triangle(index))
                        .remedy("the mesh file is damaged: export it again"));
                };
                if !position.is_finite() {
                    return Err(Error::new(ErrorKind::NonFinite, format!("vertex {vertex} is at {position}"))
                        .at(Place::Triangle(index))
                        .remedy("remove the vertex or export the mesh again"));
                }
            }
        }
        Ok(())
    }
}
