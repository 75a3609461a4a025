//! The faces of a PLY file, and the texture coordinates that they have for their corners.

use super::source_mesh::{SourceMesh, uvs_dropped, vertex_index};
use crate::error::Result;
use glam::Vec2;
use ply_rs_bw::ply::{BeginList, Property, PropertyAccess, PropertyAccessResult};
use std::collections::{HashMap, HashSet};
use std::path::Path;

/// A polygon.
#[derive(Default)]
pub(super) struct Face {
    /// Its corners. Negative or overlong indices become `u32::MAX`, which no mesh has.
    pub corners: Vec<u32>,
    /// Two texture coordinates for each corner, where it has any.
    pub uvs: Vec<f64>,
    /// The number of its texture.
    pub texture: f64,
}

fn is_corner_list(name: &str) -> bool {
    name == "vertex_indices" || name == "vertex_index"
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Face::default()
    }
    fn begin_list_uint(&mut self, name: &str, _length: usize) -> BeginList<'_, u32> {
        if is_corner_list(name) { BeginList::Fill(&mut self.corners) } else { BeginList::UseSetter }
    }
    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        match name {
            "texcoord" => {
                self.uvs = match property {
                    Property::ListFloat(list) => list.into_iter().map(f64::from).collect(),
                    Property::ListDouble(list) => list,
                    _ => return PropertyAccessResult::Ignored,
                };
                return PropertyAccessResult::Set;
            }
            "texnumber" => {
                self.texture = match property {
                    Property::Char(value) => value.into(),
                    Property::UChar(value) => value.into(),
                    Property::Short(value) => value.into(),
                    Property::UShort(value) => value.into(),
                    Property::Int(value) => value.into(),
                    Property::UInt(value) => value.into(),
                    Property::Double(value) => value,
                    _ => return PropertyAccessResult::Ignored,
                };
                return PropertyAccessResult::Set;
            }
            name if !is_corner_list(name) => return PropertyAccessResult::Ignored,
            _ => {}
        }
        let index = |value: i64| u32::try_from(value).unwrap_or(u32::MAX);
        self.corners = match property {
            Property::ListChar(list) => list.into_iter().map(|value| index(value.into())).collect(),
            Property::ListUChar(list) => list.into_iter().map(u32::from).collect(),
            Property::ListShort(list) => list.into_iter().map(|value| index(value.into())).collect(),
            Property::ListUShort(list) => list.into_iter().map(u32::from).collect(),
            Property::ListInt(list) => list.into_iter().map(|value| index(value.into())).collect(),
            Property::ListUInt(list) => list,
            _ => return PropertyAccessResult::UnsupportedType,
        };
        PropertyAccessResult::Set
    }
}

/// Gives vertices the texture coordinates that faces have for their corners (`texcoord`, as MeshLab, OpenMVS and COLMAP write
/// it): a vertex that faces see at several places of the texture becomes several. Those of several textures are not kept.
pub(super) fn split_at_seams(mesh: &mut SourceMesh, faces: &mut [Face], path: &Path) -> Result<()> {
    let are_given = |face: &Face| face.uvs.len() == 2 * face.corners.len();
    let given = faces.iter().filter(|face| !face.uvs.is_empty() && are_given(face)).count();
    if given == 0 {
        return Ok(());
    }
    let lacking = faces.iter().filter(|face| face.corners.len() > 2).count().saturating_sub(given);
    let textures: HashSet<u64> = faces.iter().map(|face| face.texture.to_bits()).collect();
    if lacking > 0 || textures.len() > 1 {
        let message = match lacking {
            0 => format!("the texture coordinates refer to {} textures and are not kept", textures.len()),
            lacking => format!("{lacking} faces have no texture coordinates: none are kept"),
        };
        mesh.findings.push(uvs_dropped(path, message));
        mesh.uvs.clear();
        return Ok(());
    }
    let count = mesh.positions.len();
    // The first place of each vertex is its own.
    let mut uvs: Vec<Option<[f32; 2]>> = vec![None; count];
    let mut copy_of: HashMap<(u32, [u32; 2]), u32> = HashMap::new();
    for face in faces.iter_mut().filter(|face| are_given(face)) {
        for (corner, uv) in face.corners.iter_mut().zip(face.uvs.chunks_exact(2)) {
            let (uv, vertex) = ([uv[0] as f32, uv[1] as f32], *corner as usize);
            // A corner that is none is refused by name later on.
            if vertex >= count {
                continue;
            }
            match uvs[vertex] {
                None => uvs[vertex] = Some(uv),
                Some(own) if own == uv => {}
                Some(_) => {
                    let next = vertex_index(mesh.positions.len(), path)?;
                    *corner = *copy_of.entry((*corner, uv.map(f32::to_bits))).or_insert(next);
                    if *corner == next {
                        mesh.positions.push(mesh.positions[vertex]);
                        uvs.push(Some(uv));
                        if let Some(normal) = mesh.normals.get(vertex).copied() {
                            mesh.normals.push(normal);
                        }
                    }
                }
            }
        }
    }
    mesh.uvs = uvs.into_iter().map(|uv| Vec2::from_array(uv.unwrap_or_default())).collect();
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::mesh_file::read_pieces;
    use super::*;

    /// Two triangles that share an edge, with six texture coordinates for each face, and the number of a texture.
    fn read(faces: &str) -> SourceMesh {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.ply");
        let header = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
            element face 2\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\n\
            property int texnumber\nend_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n";
        std::fs::write(&path, format!("{header}{faces}")).unwrap();
        read_pieces(&[path]).unwrap()
    }

    #[test]
    fn texture_coordinates_of_faces_are_kept_and_vertices_at_seams_split() {
        let joined = read("3 0 1 2 6 0 0 .5 0 .5 1 0\n3 0 2 3 6 0 0 .5 1 0 1 0\n");
        assert_eq!((joined.positions.len(), joined.uvs[2]), (4, Vec2::new(0.5, 1.0)));
        let seam = read("3 0 1 2 6 0 0 .5 0 .5 1 0\n3 0 2 3 6 .6 0 .9 1 .6 1 0\n");
        assert_eq!((seam.positions.len(), seam.uvs.len()), (6, 6));
        let corner = |triangle: usize, corner: usize| seam.triangles[triangle][corner] as usize;
        assert_eq!(seam.uvs[corner(1, 1)], Vec2::new(0.9, 1.0));
        assert_eq!(seam.uvs[corner(0, 2)], Vec2::new(0.5, 1.0));
        assert_eq!(seam.positions[corner(1, 1)], seam.positions[corner(0, 2)]);
    }

    #[test]
    fn what_is_not_of_one_texture_or_not_of_all_faces_is_told() {
        for faces in
            ["3 0 1 2 6 0 0 .5 0 .5 1 0\n3 0 2 3 6 0 0 .5 1 0 1 1\n", "3 0 1 2 6 0 0 .5 0 .5 1 0\n3 0 2 3 0 0\n"]
        {
            let mesh = read(faces);
            assert!(mesh.uvs.is_empty() && mesh.triangles.len() == 2);
            assert!(mesh.findings.iter().any(|own| own.code == "mesh-uvs-dropped"), "{:?}", mesh.findings);
        }
    }
}
