//! A mesh as a file has it, before it is turned into the program's world.

use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::scene::{Mesh, WorldFromSource};
use glam::{DVec3, Vec2, Vec3};
use std::path::Path;

/// A mesh in the coordinates of its source, in `f64` because survey coordinates are large.
#[derive(Clone, Debug, Default)]
pub struct SourceMesh {
    /// Vertices in the source's world.
    pub positions: Vec<DVec3>,
    /// Normals as the file has them; empty when it has none.
    pub normals: Vec<Vec3>,
    /// Texture coordinates; empty when the file has none.
    pub uvs: Vec<Vec2>,
    /// Corners of each triangle.
    pub triangles: Vec<[u32; 3]>,
    /// What the reader noticed.
    pub findings: Vec<Finding>,
}

/// Coordinates beyond this are no place of a scene.
const LARGEST_COORDINATE: f64 = 1e30;

/// Whether a vertex is somewhere: finite, and not so far out that it can only be a mistake.
pub(super) fn is_a_place(point: DVec3) -> bool {
    point.is_finite() && point.abs().max_element() <= LARGEST_COORDINATE
}

/// A vertex count as an index, or an error when a mesh outgrows 32-bit indices.
pub fn vertex_index(count: usize, path: &Path) -> Result<u32> {
    u32::try_from(count).map_err(|_| {
        Error::new(ErrorKind::TooLarge, format!("the mesh has {count} vertices"))
            .at(Place::File(path.into()))
            .remedy("simplify the mesh to fewer than 4 billion vertices")
    })
}

/// That the texture coordinates of a file are not kept, and why.
pub(super) fn uvs_dropped(path: &Path, message: impl Into<String>) -> Finding {
    Finding::new(Severity::Note, "mesh-uvs-dropped", message)
        .at(Place::File(path.into()))
        .remedy("nothing is lost: the fit makes its own atlas")
}

impl SourceMesh {
    /// Lower and upper corner of the referenced vertices; `None` without triangles.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let mut points = self.triangles.iter().flatten().map(|&corner| self.positions[corner as usize]);
        let first = points.next()?;
        Some(points.fold((first, first), |(low, high), point| (low.min(point), high.max(point))))
    }

    /// The mesh in the program's world; normals are unit length and complete, with a finding when the file's were not.
    pub fn into_world(self, world: &WorldFromSource) -> (Mesh, Vec<Finding>) {
        let SourceMesh { positions, normals, uvs, triangles, mut findings } = self;
        let rotation = world.rotation.as_mat3();
        let positions =
            positions.into_iter().map(|point| (world.rotation * (point - world.origin_in_source)).as_vec3()).collect();
        let mut mesh = Mesh { positions, normals: Vec::new(), uvs, triangles };
        let had_normals = !normals.is_empty();
        mesh.compute_normals();
        if !had_normals {
            findings.push(Finding::new(
                Severity::Note,
                "mesh-normals-computed",
                "the mesh has no normals: they are computed from its triangles",
            ));
            return (mesh, findings);
        }
        let mut recomputed = 0usize;
        for (own, computed) in normals.iter().zip(&mut mesh.normals) {
            match own.try_normalize() {
                Some(unit) => *computed = rotation * unit,
                None => recomputed += 1,
            }
        }
        if recomputed > 0 {
            findings.push(
                Finding::new(
                    Severity::Warning,
                    "mesh-normals-repaired",
                    format!("{recomputed} normals are zero or not finite: they are computed from the triangles"),
                )
                .remedy("export the mesh with normals, or without any"),
            );
        }
        (mesh, findings)
    }
}
