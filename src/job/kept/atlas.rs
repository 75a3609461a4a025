//! Charts of a mesh.

use super::Kept;
use super::content::{add_fields, add_mesh};
use super::findings::{of_kept, to_keep};
use crate::atlas::{self, Atlas, AtlasSettings};
use crate::error::Result;
use crate::files::digest::Digest;
use crate::files::packed::{Packer, Unpacker};
use crate::scene::Mesh;

pub(super) const KIND: &str = "atlas";

/// The atlas of a mesh, as [`atlas::build`] makes it, from disk where it was made before.
///
/// # Errors
/// As of [`atlas::build`].
pub fn atlas(mesh: &Mesh, settings: &AtlasSettings, kept: &Kept, progress: &(dyn Fn(f32) + Sync)) -> Result<Atlas> {
    let key = key_of(mesh, settings, kept);
    if let Some(atlas) = key.and_then(|key| unpacked(&kept.read(KIND, key)?)) {
        progress(1.0);
        return Ok(atlas);
    }
    let atlas = atlas::build(mesh, settings, progress)?;
    if let Some((key, bytes)) = key.zip(packed(&atlas)) {
        kept.write(KIND, key, &bytes);
    }
    Ok(atlas)
}

fn key_of(mesh: &Mesh, settings: &AtlasSettings, kept: &Kept) -> Option<Digest> {
    let mut key = kept.key(KIND)?;
    add_fields(&mut key, settings);
    add_mesh(&mut key, mesh);
    Some(key.finish())
}

pub(super) fn packed(atlas: &Atlas) -> Option<Vec<u8>> {
    let Atlas { mesh, chart_of_triangle, source_triangle, quality, findings } = atlas;
    let Mesh { positions, normals, uvs, triangles } = mesh;
    let mut packer = Packer::default();
    packer.put(positions).put(normals).put(uvs).put(triangles).put(chart_of_triangle).put(source_triangle);
    packer.put_table(quality)?.put_table(&to_keep(findings, &[])?)?;
    Some(packer.finish())
}

/// `None` where the bytes are no atlas.
pub(super) fn unpacked(bytes: &[u8]) -> Option<Atlas> {
    let mut parts = Unpacker::new(bytes);
    let (positions, normals, uvs) = (parts.take()?, parts.take()?, parts.take()?);
    let mesh = Mesh { positions, normals, uvs, triangles: parts.take()? };
    let (chart_of_triangle, source_triangle): (Vec<u32>, Vec<u32>) = (parts.take()?, parts.take()?);
    let (quality, findings) = (parts.take_table()?, of_kept(parts.take_table()?, &[])?);
    parts.end()?;
    let is_whole =
        mesh.validate().is_ok() && [chart_of_triangle.len(), source_triangle.len()] == [mesh.triangles.len(); 2];
    is_whole.then_some(Atlas { mesh, chart_of_triangle, source_triangle, quality, findings })
}
