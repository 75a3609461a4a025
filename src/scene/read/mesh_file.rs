//! From mesh files to one clean mesh.

use super::{obj, outliers, ply, stl};
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::scene::Mesh;
use glam::{DVec3, Vec2, Vec3};
use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::path::{Path, PathBuf};

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
            .remedy("simplify the mesh to fewer than four thousand million vertices")
    })
}

/// Reads one mesh file by its extension, in source coordinates.
pub fn read_one(path: &Path) -> Result<SourceMesh> {
    if !path.is_file() {
        return Err(Error::new(ErrorKind::Missing, "there is no mesh file here")
            .at(Place::File(path.into()))
            .remedy("check the path, or name the mesh in scene.toml"));
    }
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    match extension.as_str() {
        "obj" => obj::read(path),
        "ply" => ply::read(path),
        "glb" | "gltf" => super::gltf::read(path),
        "stl" => stl::read(path),
        _ => Err(Error::new(ErrorKind::Unsupported, format!("'.{extension}' is not a mesh that is read here"))
            .at(Place::File(path.into()))
            .remedy("give an OBJ, PLY, glTF or STL file")),
    }
}

/// Reads several files as pieces of one mesh and joins what they share.
///
/// Texture coordinates are kept for a single file with a single texture only: pieces with a texture each would
/// overlap. Vertices that agree in every kept attribute are joined.
pub fn read_pieces(paths: &[PathBuf]) -> Result<SourceMesh> {
    let mut whole = SourceMesh::default();
    let mut all_have_normals = true;
    for path in paths {
        let mut piece = read_one(path)?;
        let first = vertex_index(whole.positions.len(), path)?;
        vertex_index(whole.positions.len() + piece.positions.len(), path)?;
        all_have_normals &= !piece.normals.is_empty();
        whole.positions.append(&mut piece.positions);
        whole.normals.append(&mut piece.normals);
        whole.uvs.append(&mut piece.uvs);
        whole.findings.append(&mut piece.findings);
        whole.triangles.extend(piece.triangles.iter().map(|corners| corners.map(|corner| corner + first)));
    }
    if !all_have_normals {
        whole.normals.clear();
    }
    if paths.len() > 1 {
        whole.findings.push(Finding::new(
            Severity::Note,
            "mesh-pieces",
            format!("{} mesh files are read as one mesh", paths.len()),
        ));
    }
    if paths.len() > 1 || whole.uvs.len() != whole.positions.len() {
        whole.uvs.clear();
    }
    if whole.uvs.iter().any(|uv| !uv.is_finite()) {
        whole.uvs.clear();
        whole.findings.push(
            Finding::new(
                Severity::Warning,
                "mesh-uvs-not-finite",
                "texture coordinates are not finite and are not kept",
            )
            .remedy("nothing is lost: the fit makes its own atlas"),
        );
    }
    join_equal_vertices(&mut whole);
    outliers::leave_out(&mut whole);
    leave_out_copies(&mut whole);
    Ok(whole)
}

/// Leaves out triangles between the same three places as an earlier one, whichever way they are wound.
fn leave_out_copies(mesh: &mut SourceMesh) {
    let mut point_of_bits: HashMap<[u64; 3], u32> = HashMap::with_capacity(mesh.positions.len());
    let points: Vec<u32> = mesh
        .positions
        .iter()
        .map(|position| {
            let next = point_of_bits.len() as u32;
            *point_of_bits.entry((*position + 0.0).to_array().map(f64::to_bits)).or_insert(next)
        })
        .collect();
    let mut first_of: HashMap<[u32; 3], [u32; 3]> = HashMap::with_capacity(mesh.triangles.len());
    let (mut copies, mut reversed) = (0usize, 0usize);
    mesh.triangles.retain(|triangle| {
        let mut corners = triangle.map(|vertex| points[vertex as usize]);
        let least = (0..3).min_by_key(|&corner| corners[corner]).unwrap_or(0);
        corners.rotate_left(least);
        let mut key = corners;
        key.sort_unstable();
        if key[0] == key[1] || key[1] == key[2] {
            // What has no area is told of as such.
            return true;
        }
        match first_of.entry(key) {
            Entry::Vacant(vacant) => {
                vacant.insert(corners);
                true
            }
            Entry::Occupied(first) => {
                copies += 1;
                reversed += usize::from(*first.get() != corners);
                false
            }
        }
    });
    if copies > 0 {
        let severity = if copies * 20 > mesh.triangles.len() { Severity::Warning } else { Severity::Note };
        let message = format!(
            "{copies} triangles lie between the corners of an earlier one, {reversed} of them turned over: they are left out"
        );
        mesh.findings.push(
            Finding::new(severity, "mesh-copies", message)
                .remedy("rays meet the first of each only; export the mesh without double faces"),
        );
    }
}

/// Joins vertices whose position, normal and texture coordinate are the same bits; the first one stays.
fn join_equal_vertices(mesh: &mut SourceMesh) {
    type VertexBits = ([u64; 3], [u32; 3], [u32; 2]);
    let mut first_of: HashMap<VertexBits, u32> = HashMap::with_capacity(mesh.positions.len());
    let mut target = Vec::with_capacity(mesh.positions.len());
    let mut kept = 0usize;
    for index in 0..mesh.positions.len() {
        // Adding zero makes -0 and 0 the same bits.
        let key = (
            (mesh.positions[index] + 0.0).to_array().map(f64::to_bits),
            mesh.normals.get(index).map_or([0; 3], |normal| (*normal + 0.0).to_array().map(f32::to_bits)),
            mesh.uvs.get(index).map_or([0; 2], |uv| (*uv + 0.0).to_array().map(f32::to_bits)),
        );
        let joined = *first_of.entry(key).or_insert(kept as u32);
        if joined as usize == kept {
            mesh.positions[kept] = mesh.positions[index];
            if !mesh.normals.is_empty() {
                mesh.normals[kept] = mesh.normals[index];
            }
            if !mesh.uvs.is_empty() {
                mesh.uvs[kept] = mesh.uvs[index];
            }
            kept += 1;
        }
        target.push(joined);
    }
    mesh.positions.truncate(kept);
    mesh.normals.truncate(kept);
    mesh.uvs.truncate(kept);
    for corner in mesh.triangles.iter_mut().flatten() {
        *corner = target[*corner as usize];
    }
}

impl SourceMesh {
    /// Lower and upper corner of the vertices in use, without those far from the others: `f32` is to fit what is there,
    /// not what one bad vertex adds.
    pub fn bounds_of_most(&self) -> Option<(DVec3, DVec3)> {
        outliers::bounds_of_most(
            self.triangles.iter().flatten().map(|&corner| self.positions[corner as usize]).collect(),
        )
    }

    /// Lower and upper corner of the referenced vertices; `None` without triangles.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let mut points = self.triangles.iter().flatten().map(|&corner| self.positions[corner as usize]);
        let first = points.next()?;
        Some(points.fold((first, first), |(low, high), point| (low.min(point), high.max(point))))
    }

    /// The mesh in the program's world; normals are unit length and complete, with a finding when the file's were not.
    pub fn into_world(self, world: &crate::scene::WorldFromSource) -> (Mesh, Vec<Finding>) {
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

/// Reads a mesh file (OBJ or PLY) as it stands, without turning it; normals are completed.
///
/// # Errors
/// A file that is missing, damaged or of another kind, with line or byte.
pub fn read_mesh(path: &Path) -> Result<(Mesh, Vec<Finding>)> {
    let source = read_pieces(&[path.to_path_buf()])?;
    let origin_in_source =
        source.bounds_of_most().and_then(|(low, high)| super::world::far_origin(low, high)).unwrap_or_default();
    let world = crate::scene::WorldFromSource { origin_in_source, ..Default::default() };
    let (mesh, findings) = source.into_world(&world);
    mesh.validate()?;
    Ok((mesh, findings))
}
