//! From mesh files to one clean mesh.

use super::source_mesh::{SourceMesh, vertex_index};
use super::{obj, outliers, ply, stl};
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::scene::Mesh;
use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::path::{Path, PathBuf};

/// Reads one mesh file by its extension, in source coordinates.
pub fn read_one(path: &Path) -> Result<SourceMesh> {
    if !path.is_file() {
        return Err(Error::new(ErrorKind::Missing, "there is no mesh file here")
            .at(Place::File(path.into()))
            .remedy("check the path"));
    }
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    match extension.as_str() {
        "obj" => obj::read(path),
        "ply" => ply::read(path),
        "glb" | "gltf" => super::gltf::read(path),
        "stl" => stl::read(path),
        _ => Err(Error::new(ErrorKind::Unsupported, format!("'.{extension}' is not a supported mesh format"))
            .at(Place::File(path.into()))
            .remedy("give an OBJ, PLY, glTF or STL file")),
    }
}

/// Reads several files as pieces of one mesh and joins what they share.
///
/// Texture coordinates are kept for a single file with a single texture, or with a UDIM tile for each: pieces with a
/// texture each would overlap. Vertices that agree in every kept attribute are joined.
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
    super::udim::lay_out(&mut whole);
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
            "{copies} triangles lie between the corners of an earlier one, {reversed} of them flipped: they are ignored"
        );
        mesh.findings.push(
            Finding::new(severity, "mesh-copies", message)
                .remedy("rays hit only the first of each; export the mesh without double faces"),
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
