//! The mesh as binary PLY, for readers that take it faster than OBJ.

use crate::error::{Error, ErrorKind, Place, Result};
use crate::scene::Mesh;
use std::io::Write;
use std::path::Path;

/// Writes positions, normals and texture coordinates (`u v`, v up) as binary little-endian PLY.
///
/// # Errors
/// `InvalidScene` for a mesh without normals or texture coordinates; files that cannot be written.
pub fn write(path: &Path, mesh: &Mesh) -> Result<()> {
    if mesh.normals.len() != mesh.positions.len() || mesh.uvs.len() != mesh.positions.len() {
        return Err(Error::new(ErrorKind::InvalidScene, "the mesh has no texture coordinates or no normals")
            .at(Place::File(path.into()))
            .remedy("make the run again with `patina fit SCENE -o RUN`"));
    }
    crate::files::write_atomically(path, |writer| {
        write!(writer, "ply\nformat binary_little_endian 1.0\nelement vertex {}\n", mesh.positions.len())?;
        for property in ["x", "y", "z", "nx", "ny", "nz", "u", "v"] {
            writeln!(writer, "property float {property}")?;
        }
        let faces = mesh.triangles.len();
        write!(writer, "element face {faces}\nproperty list uchar int vertex_indices\nend_header\n")?;
        for vertex in 0..mesh.positions.len() {
            let (position, normal, uv) = (mesh.positions[vertex], mesh.normals[vertex], mesh.uvs[vertex]);
            let numbers = position.to_array().into_iter().chain(normal.to_array()).chain(uv.to_array());
            for number in numbers {
                writer.write_all(&number.to_le_bytes())?;
            }
        }
        for triangle in &mesh.triangles {
            writer.write_all(&[3])?;
            for index in triangle {
                writer.write_all(&index.to_le_bytes())?;
            }
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::super::asset::tests::small_asset;
    use super::*;

    #[test]
    fn the_reader_of_scenes_finds_the_same_mesh() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mesh.ply");
        let mesh = small_asset(true).mesh;
        write(&path, &mesh).unwrap();
        let (read, _) = crate::scene::read::mesh_file::read_mesh(&path).unwrap();
        assert_eq!((read.positions, read.triangles, read.uvs), (mesh.positions, mesh.triangles, mesh.uvs));
        let error = write(&path, &Mesh::default()).err();
        assert!(error.is_none(), "an empty mesh is consistent");
    }
}
