//! `mesh.obj`: the mesh of a run, one index for position, texture coordinate and normal.
//!
//! The writer gives every number the digits that bring the same `f32` back. The reader takes exactly what the writer
//! makes, so that vertex order and bits survive a round trip; meshes of other programs are read by the scene's readers.

use crate::error::{Error, ErrorKind, Place, Result};
use crate::scene::Mesh;
use glam::{Vec2, Vec3};
use std::io::Write;
use std::path::Path;

/// Head of the line that states how many vertices and triangles follow.
const COUNTS: &str = "# vertices and triangles:";

/// Writes the mesh. Normals and texture coordinates are written when the mesh has them.
pub fn write(path: &Path, mesh: &Mesh) -> Result<()> {
    mesh.validate()?;
    crate::files::write_atomically(path, |writer| {
        writeln!(writer, "# Patina: atlas coordinates, +y up, world units; see convention.txt")?;
        writeln!(writer, "{COUNTS} {} {}", mesh.positions.len(), mesh.triangles.len())?;
        for p in &mesh.positions {
            writeln!(writer, "v {} {} {}", p.x, p.y, p.z)?;
        }
        for uv in &mesh.uvs {
            writeln!(writer, "vt {} {}", uv.x, uv.y)?;
        }
        for n in &mesh.normals {
            writeln!(writer, "vn {} {} {}", n.x, n.y, n.z)?;
        }
        let corner = |vertex: u32| {
            let i = u64::from(vertex) + 1;
            match (mesh.uvs.is_empty(), mesh.normals.is_empty()) {
                (true, true) => format!("{i}"),
                (false, true) => format!("{i}/{i}"),
                (true, false) => format!("{i}//{i}"),
                (false, false) => format!("{i}/{i}/{i}"),
            }
        };
        for &[a, b, c] in &mesh.triangles {
            writeln!(writer, "f {} {} {}", corner(a), corner(b), corner(c))?;
        }
        Ok(())
    })
}

/// Reads a mesh of [`fn@write`]. An error names the line.
pub fn read(path: &Path) -> Result<Mesh> {
    let text = std::fs::read_to_string(path).map_err(|source| Error::reading(path, source))?;
    let mut mesh = Mesh::default();
    for (index, line) in text.lines().enumerate() {
        add_line(&mut mesh, line).map_err(|message| {
            Error::new(ErrorKind::Malformed, message)
                .at(Place::Line(path.into(), index + 1))
                .remedy("the file is cut short or was edited: restore it, or make it again with `patina fit`")
        })?;
    }
    // A file cut between two lines still parses: the counts at its head tell.
    let found = format!("{COUNTS} {} {}", mesh.positions.len(), mesh.triangles.len());
    let stated = text.lines().find(|line| line.starts_with(COUNTS));
    if mesh.triangles.is_empty() || stated.is_some_and(|stated| stated.trim_end() != found) {
        let (vertices, triangles) = (mesh.positions.len(), mesh.triangles.len());
        let message = format!("the mesh has only {vertices} vertices and {triangles} triangles");
        return Err(Error::new(ErrorKind::Malformed, message)
            .at(Place::File(path.into()))
            .remedy("the file is cut short: restore it, or make it again with `patina fit`"));
    }
    mesh.validate().map_err(|error| {
        Error::new(error.kind(), format!("{}: {}", error.place(), error.message()))
            .at(Place::File(path.into()))
            .remedy("the file was edited: restore it, or make it again with `patina fit`")
    })?;
    Ok(mesh)
}

/// Adds what one line says to the mesh; the error is a message without a place.
fn add_line(mesh: &mut Mesh, line: &str) -> std::result::Result<(), String> {
    let mut words = line.split_whitespace();
    match words.next() {
        Some("v") => mesh.positions.push(Vec3::from_array(numbers(words)?)),
        Some("vn") => mesh.normals.push(Vec3::from_array(numbers(words)?)),
        Some("vt") => mesh.uvs.push(Vec2::from_array(numbers(words)?)),
        Some("f") => {
            let corners: Vec<u32> = words.map(corner_index).collect::<std::result::Result<_, _>>()?;
            let triangle = corners.try_into().map_err(|c: Vec<u32>| format!("a face with {} corners", c.len()))?;
            mesh.triangles.push(triangle);
        }
        Some(word) if !word.starts_with('#') => return Err(format!("\"{word}\" is not written by this program")),
        _ => {}
    }
    Ok(())
}

fn numbers<'a, const N: usize>(words: impl Iterator<Item = &'a str>) -> std::result::Result<[f32; N], String> {
    let values: Vec<f32> = words
        .map(|word| word.parse::<f32>().map_err(|_| format!("\"{word}\" is not a number")))
        .collect::<std::result::Result<_, _>>()?;
    values.try_into().map_err(|v: Vec<f32>| format!("{} numbers instead of {N}", v.len()))
}

/// The index of a corner, from 0. All parts of `position/uv/normal` must name the same one.
fn corner_index(word: &str) -> std::result::Result<u32, String> {
    let mut parts = word.split('/').filter(|part| !part.is_empty());
    let first = parts.next().unwrap_or_default();
    if parts.any(|part| part != first) {
        return Err(format!("corner {word} has different indices for position, texture and normal"));
    }
    let from_one: u32 = first.parse().map_err(|_| format!("\"{word}\" is not a corner"))?;
    from_one.checked_sub(1).ok_or_else(|| "index 0: vertices count from 1".to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn awkward_mesh() -> Mesh {
        Mesh {
            positions: vec![Vec3::new(0.1, 1e-30, -7.0 / 3.0), Vec3::new(1e10, 0.0, -0.0), Vec3::Y, Vec3::ONE],
            normals: vec![Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE / 3f32.sqrt()],
            uvs: vec![Vec2::new(1.0 / 3.0, 0.7), Vec2::ZERO, Vec2::ONE, Vec2::new(f32::MIN_POSITIVE, 0.5)],
            triangles: vec![[0, 1, 2], [3, 2, 1]],
        }
    }

    #[test]
    fn every_bit_comes_back_with_and_without_attributes() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mesh.obj");
        let full = awkward_mesh();
        let bare = Mesh { normals: vec![], uvs: vec![], ..full.clone() };
        let with_uvs = Mesh { normals: vec![], ..full.clone() };
        let with_normals = Mesh { uvs: vec![], ..full.clone() };
        for mesh in [full, bare, with_uvs, with_normals] {
            write(&path, &mesh).unwrap();
            let back = read(&path).unwrap();
            assert_eq!(back, mesh);
            assert_eq!(back.positions[1].z.to_bits(), mesh.positions[1].z.to_bits(), "the sign of zero");
        }
    }

    #[test]
    fn a_file_that_is_cut_between_lines_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mesh.obj");
        write(&path, &awkward_mesh()).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        let without_last_line = &text[..=text.trim_end().rfind('\n').unwrap()];
        crate::files::write_bytes(&path, without_last_line.as_bytes()).unwrap();
        assert!(read(&path).unwrap_err().message().contains("only 4 vertices and 1 triangles"));
    }

    #[test]
    fn a_broken_line_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mesh.obj");
        for (broken, line) in [
            ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", Some(4)),
            ("v 0 0 0\nv 1 0\n", Some(2)),
            ("v 0 0 x\n", Some(1)),
            ("v 0 0 0\nvt 0 0\nvn 0 1 0\nf 1/2/1 1 1\n", Some(4)),
            ("v 0 0 0\nf 1 1 1 1\n", Some(2)),
            ("v 0 0 0\nf 1 1 9\n", None),
            ("v 0 0 0\n", None),
            ("v NaN 0 0\nf 1 1 1\n", None),
        ] {
            crate::files::write_bytes(&path, broken.as_bytes()).unwrap();
            let error = read(&path).unwrap_err();
            let expected = line.map_or(Place::File(path.clone()), |line| Place::Line(path.clone(), line));
            assert_eq!(error.place(), &expected, "{broken:?}: {error}");
            assert!(!error.remedy_text().is_empty());
        }
    }
}
