//! Wavefront OBJ, by `tobj`.
//!
//! `tobj` says what is wrong but not where, and takes index 0 for "no index". So the text is scanned first: every
//! number and every index is checked, and the first bad line is named. The scan also sees coordinates too large for
//! `f32` and shifts them before they are rounded.

use super::mesh_file::SourceMesh;
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use glam::{DVec3, Vec2, Vec3};
use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::Path;

/// Reads all groups of an OBJ file as one mesh; polygons become fans of triangles.
pub fn read(path: &Path) -> Result<SourceMesh> {
    let bytes = std::fs::read(path).map_err(|source| Error::reading(path, source))?;
    // Names of groups and materials may be in any encoding; nothing but names is lost here.
    let text = String::from_utf8_lossy(&bytes);
    let scan = scan(&text, path)?;
    let shifted = scan.shift().map(|origin| (origin, shift_vertices(&text, origin)));
    let (origin, text) = match &shifted {
        Some((origin, text)) => (*origin, text.as_str()),
        None => (DVec3::ZERO, text.as_ref()),
    };
    let mut mesh = load(text, path)?;
    for position in &mut mesh.positions {
        *position += origin;
    }
    if scan.materials.len() > 1 && !mesh.uvs.is_empty() {
        mesh.findings.push(
            Finding::new(
                Severity::Note,
                "mesh-uvs-dropped",
                format!("the texture coordinates refer to {} textures and are not kept", scan.materials.len()),
            )
            .at(Place::File(path.into()))
            .remedy("nothing is lost: the fit makes its own atlas"),
        );
        mesh.uvs.clear();
    }
    Ok(mesh)
}

fn load(text: &str, path: &Path) -> Result<SourceMesh> {
    let options = tobj::LoadOptions { triangulate: true, single_index: true, ignore_points: true, ignore_lines: true };
    // Materials are not read: an empty library keeps `tobj` from splitting groups by material.
    let (models, _) =
        tobj::load_obj_buf(&mut text.as_bytes(), &options, |_| Ok(Default::default())).map_err(|error| {
            Error::new(ErrorKind::Malformed, format!("the OBJ file cannot be read: {error}"))
                .at(Place::File(path.into()))
                .remedy("export the mesh again; a group may only use vertices listed before its end")
        })?;
    // Where only some corners of a group have an attribute, `tobj` lists it for those alone: it cannot be assigned.
    let complete = |length: fn(&tobj::Mesh) -> usize| {
        models.iter().all(|model| length(&model.mesh) == model.mesh.positions.len() / 3)
    };
    let with_normals = complete(|mesh| mesh.normals.len() / 3);
    let with_uvs = complete(|mesh| mesh.texcoords.len() / 2);
    let mut result = SourceMesh::default();
    for tobj::Model { mesh, .. } in &models {
        let first = super::mesh_file::vertex_index(result.positions.len(), path)?;
        super::mesh_file::vertex_index(result.positions.len() + mesh.positions.len() / 3, path)?;
        result.positions.extend(
            mesh.positions.chunks_exact(3).map(|p| DVec3::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2]))),
        );
        if with_normals {
            result.normals.extend(mesh.normals.chunks_exact(3).map(Vec3::from_slice));
        }
        if with_uvs {
            result.uvs.extend(mesh.texcoords.chunks_exact(2).map(Vec2::from_slice));
        }
        result.triangles.extend(mesh.indices.chunks_exact(3).map(|t| [first + t[0], first + t[1], first + t[2]]));
    }
    Ok(result)
}

/// What the scan found.
#[derive(Default)]
struct Scan {
    bounds: Option<(DVec3, DVec3)>,
    materials: BTreeSet<String>,
}

impl Scan {
    /// The point to subtract when `f32` would lose the shape: the bounding box is small and far from the origin.
    fn shift(&self) -> Option<DVec3> {
        let (low, high) = self.bounds?;
        super::world::far_origin(low, high)
    }
}

fn scan(text: &str, path: &Path) -> Result<Scan> {
    let mut counts = [0i64; 3];
    for line in text.lines() {
        match line.split_whitespace().next() {
            Some("v") => counts[0] += 1,
            Some("vt") => counts[1] += 1,
            Some("vn") => counts[2] += 1,
            _ => {}
        }
    }
    let mut scan = Scan::default();
    let mut seen = [0i64; 3];
    let mut faces = 0usize;
    for (number, line) in text.lines().enumerate() {
        let malformed = |message: String, remedy: &str| {
            Error::new(ErrorKind::Malformed, message).at(Place::Line(path.into(), number + 1)).remedy(remedy)
        };
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                seen[0] += 1;
                let point = DVec3::from_array(numbers(words, &malformed)?);
                if !point.is_finite() || point.abs().max_element() > 1e30 {
                    return Err(Error::new(ErrorKind::NonFinite, format!("vertex {} is at {point}", seen[0]))
                        .at(Place::Line(path.into(), number + 1))
                        .remedy("remove the vertex or export the mesh again"));
                }
                scan.bounds = Some(scan.bounds.map_or((point, point), |(low, high)| (low.min(point), high.max(point))));
            }
            Some("vt") => {
                seen[1] += 1;
                numbers::<2>(words, &malformed)?;
            }
            Some("vn") => {
                seen[2] += 1;
                numbers::<3>(words, &malformed)?;
            }
            Some("f") => {
                faces += 1;
                let mut corners = 0;
                for corner in words {
                    corners += 1;
                    check_corner(corner, seen, counts).map_err(|message| {
                        malformed(message, "indices count from 1, or backwards from -1: export the mesh again")
                    })?;
                }
                if corners < 3 {
                    return Err(malformed(
                        format!("a face of {corners} corners"),
                        "a face needs three corners or more",
                    ));
                }
            }
            Some("usemtl") => {
                scan.materials.insert(words.collect::<Vec<_>>().join(" "));
            }
            _ => {}
        }
    }
    if faces == 0 {
        return Err(Error::new(ErrorKind::Malformed, "the OBJ file holds no faces")
            .at(Place::File(path.into()))
            .remedy("give a surface mesh; a point cloud must be meshed first"));
    }
    Ok(scan)
}

fn numbers<const COUNT: usize>(
    mut words: std::str::SplitWhitespace<'_>,
    malformed: &impl Fn(String, &str) -> Error,
) -> Result<[f64; COUNT]> {
    let mut values = [0.0; COUNT];
    for value in &mut values {
        let word = words.next().ok_or_else(|| {
            malformed(format!("fewer than {COUNT} numbers"), "the file is cut short or damaged: export it again")
        })?;
        *value = word.parse().map_err(|_| malformed(format!("'{word}' is not a number"), "export the mesh again"))?;
    }
    Ok(values)
}

/// Checks one corner `v/vt/vn` of a face; `seen` counts what came before this line, `counts` the whole file.
fn check_corner(corner: &str, seen: [i64; 3], counts: [i64; 3]) -> std::result::Result<(), String> {
    const NAMES: [&str; 3] = ["vertex", "texture coordinate", "normal"];
    let mut parts = 0;
    for (kind, part) in corner.split('/').enumerate() {
        parts += 1;
        if kind > 2 {
            return Err(format!("'{corner}' has too many slashes"));
        }
        if part.is_empty() && kind > 0 {
            continue;
        }
        let index: i64 = part.parse().map_err(|_| format!("'{corner}' is not an index"))?;
        let absolute = if index < 0 { seen[kind] + index + 1 } else { index };
        if index == 0 {
            return Err(format!("index 0 is not a {}", NAMES[kind]));
        }
        if absolute < 1 || absolute > counts[kind] {
            return Err(format!("{} {index} of {}", NAMES[kind], counts[kind]));
        }
    }
    if parts == 0 { Err("an empty corner".into()) } else { Ok(()) }
}

/// The text with every vertex moved by `-origin` in `f64`; weights are divided out, colours dropped.
fn shift_vertices(text: &str, origin: DVec3) -> String {
    let mut shifted = String::with_capacity(text.len());
    for line in text.lines() {
        let mut words = line.split_whitespace();
        if words.next() == Some("v") {
            let values: Vec<f64> = words.map_while(|word| word.parse().ok()).collect();
            let weight = if values.len() == 4 && values[3] != 0.0 { values[3] } else { 1.0 };
            let point = DVec3::new(values[0], values[1], values[2]) / weight - origin;
            // Writing to a string cannot fail.
            let _ = writeln!(shifted, "v {} {} {}", point.x, point.y, point.z);
        } else {
            shifted.push_str(line);
            shifted.push('\n');
        }
    }
    shifted
}
