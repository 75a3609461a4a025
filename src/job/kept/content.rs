//! What results are made of, as a digest.

use crate::files::digest::{Digest, Digester};
use crate::math::parallel;
use crate::scene::{Mesh, Photo, Scene, View};
use std::fmt::Debug;

/// Adds a mesh.
pub(super) fn add_mesh(digester: &mut Digester, mesh: &Mesh) {
    let Mesh { positions, normals, uvs, triangles } = mesh;
    digester.add_list(bytemuck::cast_slice(positions));
    digester.add_list(bytemuck::cast_slice(normals));
    digester.add_list(bytemuck::cast_slice(uvs));
    digester.add_list(bytemuck::cast_slice(triangles));
}

/// Adds settings and the like, by all their fields: a number's shortest text is that of no other number.
pub(super) fn add_fields(digester: &mut Digester, table: &impl Debug) {
    digester.add_list(format!("{table:?}").as_bytes());
}

/// Adds all that the check of a scene looks at: not its truth, nor where it lies but for the places that findings name.
pub(super) fn add_scene(digester: &mut Digester, scene: &Scene) {
    let Scene { name, folder: _, mesh, views, world_from_source, background, truth: _, findings } = scene;
    // Remedies name the manifest where there is one.
    add_fields(digester, &(name, scene.has_manifest(), world_from_source, background, findings, views.len()));
    add_mesh(digester, mesh);
    for digest in parallel::map_items(views, of_view) {
        digester.add(&digest.to_bytes());
    }
}

fn of_view(view: &View) -> Digest {
    let View { name, camera, photo, states, held_out, exposure_prior_stops } = view;
    let mut digester = Digester::default();
    let (kind, bytes): (&str, &[u8]) = match photo {
        Photo::Srgb8(image) => ("sRGB", bytemuck::cast_slice(image.pixels())),
        Photo::MeanOfSrgb8(image) => ("means", bytemuck::cast_slice(image.pixels())),
        Photo::Linear16(image) => ("halves", bytemuck::cast_slice(image.pixels())),
        Photo::Linear32(image) => ("floats", bytemuck::cast_slice(image.pixels())),
    };
    add_fields(&mut digester, &(name, camera, held_out, exposure_prior_stops, kind, photo.width(), photo.height()));
    digester.add_list(bytes);
    digester.add_list(bytemuck::cast_slice(states.pixels()));
    digester.finish()
}
