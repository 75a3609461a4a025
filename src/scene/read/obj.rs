//! Wavefront OBJ: what the file means is decided here, vertices are joined by `tobj`.
//!
//! `tobj` takes lines (`l`) and points (`p`) for faces, knows neither `\` nor comments behind data, refuses vertices of
//! four colours and `usemtl` without a name, and rounds to `f32` at once. So the file is read statement by statement
//! ([`super::text`]), in `f64`: what no face uses is not looked at, polygons are cut ([`super::polygon`]), and `tobj` is
//! given plain triangles near the origin, whose corners it joins. Their number is compared with that of the file.

use super::obj_elements::{Elements, NONE};
use super::source_mesh::{SourceMesh, uvs_dropped};
use super::{text, udim};
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use glam::{DVec3, Vec2, Vec3};
use std::fmt::Write;
use std::path::Path;

/// Reads all groups of an OBJ file as one mesh.
///
/// # Errors
/// `Missing`, `Unreadable`, `Malformed` or `NonFinite`, with the line.
pub fn read(path: &Path) -> Result<SourceMesh> {
    let bytes = std::fs::read(path).map_err(|source| Error::reading(path, source))?;
    let mut elements = Elements::read(&text::decode(bytes, path)?, path)?;
    let triangles = elements.triangles(path)?;
    let mut findings = elements.findings(path);
    let with_uvs = keep(&triangles, 1, &elements.uvs, "texture coordinates", &mut findings, path);
    let with_normals = keep(&triangles, 2, &elements.normals, "normals", &mut findings, path);
    // A texture each is no matter where each has a tile of its own.
    let uv_of =
        |corner: [u32; 3]| elements.uvs.get(corner[1] as usize).copied().flatten().map_or(Vec2::NAN, Vec2::from_array);
    let has_one_texture = elements.materials.len() < 2
        || (with_uvs && udim::are_tiles(triangles.iter().map(|corners| corners.map(uv_of))));
    let with_uvs = with_uvs && has_one_texture;
    if !has_one_texture && !elements.uvs.is_empty() {
        let message =
            format!("the texture coordinates refer to {} textures and are not kept", elements.materials.len());
        findings.push(uvs_dropped(path, message).extent(elements.materials.len() as f64));
    }
    let origin = elements.origin(&triangles);
    let plain = plain_text(&elements, &triangles, origin, with_uvs, with_normals);
    let mut mesh = join(&plain, path)?;
    if mesh.triangles.len() != triangles.len() {
        let message = format!("{} triangles were read of {} in the file", mesh.triangles.len(), triangles.len());
        return Err(Error::new(ErrorKind::Internal, message).at(Place::File(path.into())));
    }
    mesh.positions.iter_mut().for_each(|position| *position += origin);
    mesh.findings = findings;
    Ok(mesh)
}

/// Whether every corner has a good attribute of a kind (1 texture coordinate, 2 normal), so that the mesh can keep them.
/// Where some have one, what is dropped is told.
fn keep<T>(
    triangles: &[[[u32; 3]; 3]],
    kind: usize,
    values: &[Option<T>],
    what: &str,
    findings: &mut Vec<Finding>,
    path: &Path,
) -> bool {
    let is_good = |index: u32| values.get(index as usize).is_some_and(Option::is_some);
    let corners = || triangles.iter().flatten().map(|corner| corner[kind]);
    let (named, good) = (corners().filter(|&index| index != NONE).count(), corners().filter(|&i| is_good(i)).count());
    let all = 3 * triangles.len();
    if named > 0 && good < all {
        let message = format!("{} of {all} corners have no {what} that can be used: none are kept", all - good);
        findings.push(if kind == 1 {
            uvs_dropped(path, message)
        } else {
            Finding::new(Severity::Note, "mesh-normals-dropped", message)
                .at(Place::File(path.into()))
                .remedy("normals are computed from the triangles; export the mesh again for its own")
        });
    }
    good == all
}

/// The triangles as a text that every reader of OBJ reads alike.
fn plain_text(
    elements: &Elements,
    triangles: &[[[u32; 3]; 3]],
    origin: DVec3,
    with_uvs: bool,
    with_normals: bool,
) -> String {
    let mut plain = String::with_capacity(40 * elements.positions.len() + 30 * triangles.len());
    // Writing to a string cannot fail.
    for position in &elements.positions {
        // No triangle uses what is not finite; its place is kept, since corners count.
        let DVec3 { x, y, z } = if position.is_finite() { *position - origin } else { DVec3::ZERO };
        let _ = writeln!(plain, "v {x} {y} {z}");
    }
    for uv in elements.uvs.iter().filter(|_| with_uvs) {
        let [u, v] = uv.unwrap_or_default();
        let _ = writeln!(plain, "vt {u} {v}");
    }
    for normal in elements.normals.iter().filter(|_| with_normals) {
        let [x, y, z] = normal.unwrap_or_default();
        let _ = writeln!(plain, "vn {x} {y} {z}");
    }
    for triangle in triangles {
        plain.push('f');
        for corner in triangle {
            let [vertex, uv, normal] = corner.map(|index| u64::from(index) + 1);
            let _ = match (with_uvs, with_normals) {
                (false, false) => write!(plain, " {vertex}"),
                (true, false) => write!(plain, " {vertex}/{uv}"),
                (false, true) => write!(plain, " {vertex}//{normal}"),
                (true, true) => write!(plain, " {vertex}/{uv}/{normal}"),
            };
        }
        plain.push('\n');
    }
    plain
}

/// One vertex for each corner that differs, by `tobj`.
fn join(plain: &str, path: &Path) -> Result<SourceMesh> {
    let options = tobj::LoadOptions { triangulate: true, single_index: true, ..Default::default() };
    let (models, _) =
        tobj::load_obj_buf(&mut plain.as_bytes(), &options, |_| Ok(Default::default())).map_err(|error| {
            Error::new(ErrorKind::Internal, format!("the triangles cannot be joined: {error}"))
                .at(Place::File(path.into()))
        })?;
    let mut result = SourceMesh::default();
    for tobj::Model { mesh, .. } in &models {
        let first = super::source_mesh::vertex_index(result.positions.len(), path)?;
        let points = mesh.positions.chunks_exact(3).map(|p| Vec3::from_slice(p).as_dvec3());
        result.positions.extend(points);
        result.normals.extend(mesh.normals.chunks_exact(3).map(Vec3::from_slice));
        result.uvs.extend(mesh.texcoords.chunks_exact(2).map(Vec2::from_slice));
        result.triangles.extend(mesh.indices.chunks_exact(3).map(|t| [first + t[0], first + t[1], first + t[2]]));
    }
    Ok(result)
}
