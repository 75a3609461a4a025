//! From mesh files to one clean mesh.

use super::source_mesh::{SourceMesh, vertex_index};
use super::{obj, outliers, ply, stl};
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::math::statistics::quantile;
use crate::scene::Mesh;
use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::path::{Path, PathBuf};

/// Reads one mesh file by its extension, in source coordinates; a PLY file may be an entry of an archive.
pub fn read_one(path: &Path) -> Result<SourceMesh> {
    if !path.is_file() && !path.parent().is_some_and(Path::is_file) {
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
    let rounded = told_of_rounding(&whole);
    whole.findings.extend(rounded);
    join_equal_vertices(&mut whole);
    super::udim::lay_out(&mut whole);
    outliers::leave_out(&mut whole);
    leave_out_copies(&mut whole);
    Ok(whole)
}

/// That coordinates so far from the origin were rounded to single precision by more than a part of the edges: then places
/// fall together, and triangles lose their area.
fn told_of_rounding(mesh: &SourceMesh) -> Option<Finding> {
    /// Edges that are looked at.
    const LOOKED_AT: usize = 3000;
    /// Part of the median edge that rounding may take.
    const MOST_PART: f64 = 0.05;
    let step = (mesh.triangles.len() / LOOKED_AT).max(1);
    let corners =
        mesh.triangles.iter().step_by(step).map(|triangle| triangle.map(|corner| mesh.positions[corner as usize]));
    let corners: Vec<_> = corners.filter(|[a, b, _]| a.is_finite() && b.is_finite()).collect();
    let is_single = |value: f64| f64::from(value as f32) == value;
    if corners.is_empty() || !corners.iter().flatten().flat_map(|place| place.to_array()).all(is_single) {
        return None;
    }
    let lengths: Vec<f64> = corners.iter().map(|[a, b, _]| a.distance(*b)).collect();
    let distances: Vec<f64> = corners.iter().map(|[a, ..]| a.abs().max_element()).collect();
    let (edge, distance) = (quantile(&lengths, 0.5), quantile(&distances, 0.5));
    let rounding = distance * f64::from(f32::EPSILON);
    let message = format!(
        "coordinates are some {distance:.3e} from the origin and were rounded to {rounding:.2} by single precision, which is {:.0} % \
         of a usual edge",
        100.0 * rounding / edge.max(f64::MIN_POSITIVE)
    );
    (rounding > MOST_PART * edge).then(|| {
        Finding::new(Severity::Warning, "mesh-rounded", message)
            .remedy("export mesh and cameras in double precision, or both with the same shift towards the origin")
    })
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

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn coordinates_that_were_rounded_are_told() {
        let mesh = |far: f64, is_single: bool| {
            let place = |index: u32| {
                let own = DVec3::new(far + 0.37 * f64::from(index), 0.2 * f64::from(index % 7), 0.1);
                if is_single { own.as_vec3().as_dvec3() } else { own }
            };
            let triangles = (0..30).map(|index| [index, index + 1, index + 2]).collect();
            SourceMesh { positions: (0..40).map(place).collect(), triangles, ..Default::default() }
        };
        let told = told_of_rounding(&mesh(4.5e6, true)).unwrap();
        assert!(told.code == "mesh-rounded" && told.message.contains("0.54"), "{told}");
        assert!(told_of_rounding(&mesh(4.5e6, false)).is_none(), "doubles");
        assert!(told_of_rounding(&mesh(3.0, true)).is_none() && told_of_rounding(&SourceMesh::default()).is_none());
    }
}
