//! A scene with its truth as an exchange folder: plain files any renderer can read.
//!
//! | file | content |
//! |---|---|
//! | `mesh.obj` | `v/vt/vn` under one index |
//! | `diffuse.exr`, `specular.exr`, `roughness.exr` | the truth maps; roughness is `r = a^2` |
//! | `env.exr`, `env_heldout.exr` | the light of the photos and one they never saw |
//! | `texel_covered.exr`, `texel_seen.exr` | 0 or 1: inside a chart, seen by a view of the fit |
//! | `cameras.json`, `scene.json` | OpenCV cameras; what else a renderer must know |
//! | `views/`, `relight/` | linear pictures, where there are any |
//!
//! Numbers are written so that they read back to the same bits. `tests/mitsuba` renders such folders.

use crate::error::{Error, ErrorKind, Result};
use crate::files::write_bytes;
use crate::image::Image;
use crate::image::file::{write_exr_grey, write_exr_rgb};
use crate::material::LobeModel;
use crate::scene::{Background, Camera, Scene, Truth};
use serde::Serialize;
use std::borrow::Cow;
use std::path::Path;

/// What an exchange folder holds beyond scene and truth.
#[derive(Clone, Copy, Debug)]
pub struct ExchangeOptions<'a> {
    /// Texels inside a chart; left out when not known.
    pub covered: Option<&'a Image<bool>>,
    /// Strength of the specular lobe of the whole surface, in [0, 1]: 0 for a surface that has none.
    pub lobe_strength: f32,
    /// Whether the photos are pictures to be written, not placeholders.
    pub with_photos: bool,
}

impl Default for ExchangeOptions<'_> {
    fn default() -> Self {
        ExchangeOptions { covered: None, lobe_strength: 1.0, with_photos: false }
    }
}

#[derive(Serialize)]
struct CameraList {
    convention: &'static str,
    views: Vec<CameraEntry>,
}

#[derive(Serialize)]
struct CameraEntry {
    file: String,
    width: usize,
    height: usize,
    #[serde(rename = "K")]
    intrinsics: [[f64; 3]; 3],
    #[serde(rename = "w2c")]
    camera_from_world: [[f64; 4]; 4],
    held_out: bool,
}

#[derive(Serialize)]
struct SceneFacts<'a> {
    name: &'a str,
    /// As Mitsuba counts: one more than surface hits on the longest path.
    max_depth: usize,
    background: &'static str,
    rough_pow: f32,
    lobe: &'static str,
    g_mode: &'static str,
    lobe_strength: f32,
    vertices: usize,
    triangles: usize,
    texture: usize,
}

/// Writes a scene and its truth as an exchange folder; existing files of the same names are replaced one by one.
///
/// # Errors
/// `InvalidScene` for a mesh without texture coordinates or with indices out of range; `Unwritable`.
pub fn write(scene: &Scene, truth: &Truth, options: &ExchangeOptions<'_>, folder: &Path) -> Result<()> {
    scene.mesh.validate()?;
    if scene.mesh.uvs.is_empty() {
        return Err(Error::new(ErrorKind::InvalidScene, "the mesh has no texture coordinates")
            .remedy("make an atlas first: the maps lie on it"));
    }
    let mut mesh = Cow::Borrowed(&scene.mesh);
    if mesh.normals.is_empty() {
        mesh.to_mut().compute_normals();
    }
    super::obj::write(&folder.join("mesh.obj"), &mesh)?;
    write_exr_rgb(&folder.join("diffuse.exr"), &truth.maps.diffuse)?;
    write_exr_rgb(&folder.join("specular.exr"), &truth.maps.specular)?;
    write_exr_grey(&folder.join("roughness.exr"), &truth.maps.roughness)?;
    write_exr_rgb(&folder.join("env.exr"), &truth.environment.radiance)?;
    if let Some(relight) = &truth.relight {
        write_exr_rgb(&folder.join("env_heldout.exr"), &relight.environment.radiance)?;
        for (view, picture) in &relight.pictures {
            write_exr_rgb(&folder.join(format!("relight/{view:04}.exr")), picture)?;
        }
    }
    let flags = |image: &Image<bool>| image.map(|&flag| if flag { 1.0 } else { 0.0 });
    write_exr_grey(&folder.join("texel_seen.exr"), &flags(&truth.texels_seen))?;
    if let Some(covered) = options.covered {
        write_exr_grey(&folder.join("texel_covered.exr"), &flags(covered))?;
    }
    let entries = scene.views.iter().enumerate();
    let entries = entries.map(|(index, view)| entry_of(file_of_view(index), &view.camera, view.held_out));
    write_json(&CameraList { convention: "opencv", views: entries.collect() }, &folder.join("cameras.json"))?;
    if options.with_photos {
        for (index, view) in scene.views.iter().enumerate() {
            write_exr_rgb(&folder.join(file_of_view(index)), &view.photo.to_linear())?;
        }
    }
    let (lobe, g_mode) = match truth.lobe {
        LobeModel::BlinnPhong => ("modct", "half_alpha"),
        LobeModel::Ggx => ("ggx", "smith_ggx"),
    };
    let facts = SceneFacts {
        name: &scene.name,
        max_depth: truth.max_bounces + 1,
        background: match scene.background {
            Background::Environment => "environment",
            Background::Black => "black",
        },
        rough_pow: 1.0,
        lobe,
        g_mode,
        lobe_strength: options.lobe_strength,
        vertices: scene.mesh.positions.len(),
        triangles: scene.mesh.triangles.len(),
        texture: truth.maps.diffuse.width(),
    };
    // Last, so that a folder with scene.json is complete.
    write_json(&facts, &folder.join("scene.json"))
}

fn file_of_view(index: usize) -> String {
    format!("views/{index:04}.exr")
}

/// Writes the cameras of a scene in the world of the run as `cameras.json` of an exchange folder; views by their names.
///
/// # Errors
/// A file that cannot be written.
pub fn write_cameras(scene: &Scene, path: &Path) -> Result<()> {
    let entries = scene.views.iter().map(|view| entry_of(format!("{}.png", view.name), &view.camera, view.held_out));
    write_json(&CameraList { convention: "opencv", views: entries.collect() }, path)
}

fn entry_of(file: String, camera: &Camera, held_out: bool) -> CameraEntry {
    let (focal, centre) = (camera.focal_pixels.as_dvec2(), camera.centre_pixels.as_dvec2());
    let rotation = camera.rotation_camera_from_world.as_dmat3();
    let translation = camera.translation_camera_from_world.as_dvec3();
    let row = |row: usize| {
        let axis = rotation.row(row);
        [axis.x, axis.y, axis.z, translation[row]]
    };
    CameraEntry {
        file,
        width: camera.width,
        height: camera.height,
        intrinsics: [[focal.x, 0.0, centre.x], [0.0, focal.y, centre.y], [0.0, 0.0, 1.0]],
        camera_from_world: [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]],
        held_out,
    }
}

fn write_json(value: &impl Serialize, path: &Path) -> Result<()> {
    let text = serde_json::to_vec_pretty(value)
        .map_err(|error| Error::new(ErrorKind::Internal, format!("cannot encode {}: {error}", path.display())))?;
    write_bytes(path, &text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::file::{read_grey, read_rgb};
    use crate::scene::demo::{DemoSettings, build};
    use glam::Vec3;

    #[test]
    fn what_is_written_reads_back_to_the_same_bits() {
        let settings =
            DemoSettings { views: 2, held_out: 1, width: 16, height: 12, map_size: 96, ..DemoSettings::default() };
        let demo = build(&settings).unwrap();
        let truth = demo.scene.truth.as_ref().unwrap();
        let folder = tempfile::tempdir().unwrap();
        let options = ExchangeOptions { covered: Some(&demo.covered), ..ExchangeOptions::default() };
        write(&demo.scene, truth, &options, folder.path()).unwrap();
        assert_eq!(crate::export::obj::read(&folder.path().join("mesh.obj")).unwrap(), demo.scene.mesh);
        assert_eq!(read_rgb(&folder.path().join("specular.exr")).unwrap(), truth.maps.specular);
        assert_eq!(read_grey(&folder.path().join("roughness.exr")).unwrap(), truth.maps.roughness);
        assert_eq!(read_rgb(&folder.path().join("env.exr")).unwrap(), truth.environment.radiance);
        // A point projected by the numbers in cameras.json lands where the camera puts it.
        let cameras: serde_json::Value =
            serde_json::from_slice(&std::fs::read(folder.path().join("cameras.json")).unwrap()).unwrap();
        assert_eq!(cameras["views"][2]["held_out"], true);
        let number = |value: &serde_json::Value| value.as_f64().unwrap() as f32;
        let view = &cameras["views"][1];
        let point = Vec3::new(0.3, 0.8, -0.4);
        let inside = Vec3::from_array([0, 1, 2].map(|row| {
            let w = &view["w2c"][row];
            number(&w[0]) * point.x + number(&w[1]) * point.y + number(&w[2]) * point.z + number(&w[3])
        }));
        let column = number(&view["K"][0][0]) * inside.x / inside.z + number(&view["K"][0][2]);
        let (expected, depth) = demo.scene.views[1].camera.project(point).unwrap();
        assert!((column - expected.x).abs() < 1e-4 && (inside.z - depth).abs() < 1e-4);
    }
}
