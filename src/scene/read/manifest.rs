//! `scene.toml`: a scene whose parts are named by hand. Paths are relative to the manifest.
//!
//! ```toml
//! name = "fountain"                  # default: the folder's name
//! mesh = "scan/fountain.ply"         # or a list of pieces; OBJ or PLY
//! images = "photos"                  # folder of photos
//! cameras = "cams"                   # folder of <photo>_cam.txt, or a cameras.json
//! masks = "masks"                    # optional folder: <photo>.png, 255 = object
//! camera_axes = "opencv"             # opencv: x right, y down, z forward (default); opengl: x right, y up, z back
//! camera_matrix = "camera_from_world"# or world_from_camera
//! encoding = "auto"                  # auto (by profile, else integers sRGB, floats linear), srgb, linear
//! up = "auto"                        # auto, X, Y, Z, -X, -Y, -Z
//! pixel_centre = "auto"              # auto, integer, half
//! unit_in_metres = 0.001             # how many metres a unit is, here of millimetres; default: not known
//! background = "environment"         # or black
//! held_out = ["00000003"]            # views kept out of the fit; default: every 8th
//! flip_winding = false               # turn every triangle over
//! ```

use super::blended_mvs;
use super::camera_file::read_cameras_json;
use super::source::{SourceCamera, SourceScene, SourceView};
use super::text;
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::files::{as_stored, folder_of, name_of_folder, stem_of};
use crate::scene::Background;
use crate::scene::settings::{ColourEncoding, PixelCentre, Up, is_length, one_or_more};
use glam::{DMat3, DVec3};
use std::path::{Path, PathBuf};

/// Name of the manifest in its folder.
pub const FILE_NAME: &str = "scene.toml";

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Manifest {
    name: Option<String>,
    #[serde(deserialize_with = "one_or_more")]
    mesh: Vec<PathBuf>,
    images: PathBuf,
    cameras: PathBuf,
    masks: Option<PathBuf>,
    #[serde(default)]
    camera_axes: CameraAxes,
    #[serde(default)]
    camera_matrix: CameraMatrix,
    #[serde(default)]
    encoding: ColourEncoding,
    #[serde(default)]
    up: Up,
    #[serde(default)]
    pixel_centre: PixelCentre,
    unit_in_metres: Option<f64>,
    #[serde(default = "environment")]
    background: Background,
    held_out: Option<Vec<String>>,
    #[serde(default)]
    flip_winding: bool,
}

fn environment() -> Background {
    Background::Environment
}

#[derive(Clone, Copy, Default, PartialEq, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
enum CameraAxes {
    #[default]
    OpenCv,
    OpenGl,
}

#[derive(Clone, Copy, Default, PartialEq, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
enum CameraMatrix {
    #[default]
    CameraFromWorld,
    WorldFromCamera,
}

/// Reads a manifest, lists what it names and reads the cameras.
pub fn read(path: &Path) -> Result<SourceScene> {
    let text = text::read(path)?;
    let manifest: Manifest = toml::from_str(&text).map_err(|error| {
        let line = error.span().map_or(1, |span| text[..span.start.min(text.len())].lines().count().max(1));
        Error::new(ErrorKind::Malformed, format!("the manifest cannot be read: {}", error.message()))
            .at(Place::Line(path.into(), line))
            .remedy("it must name mesh, images and cameras")
    })?;
    let folder = folder_of(path).to_path_buf();
    let mut findings = Vec::new();
    let images = as_stored(folder.join(&manifest.images));
    if !images.is_dir() {
        return Err(missing(&images, "the folder of photos"));
    }
    let masks = manifest.masks.as_ref().map(|masks| as_stored(folder.join(masks)));
    if let Some(masks) = masks.as_ref().filter(|masks| !masks.is_dir()) {
        return Err(missing(masks, "the folder of masks"));
    }
    let cameras = as_stored(folder.join(&manifest.cameras));
    let mut views = if cameras.is_dir() {
        blended_mvs::views(&images, &cameras, masks.as_deref(), true, &mut findings)?
    } else if cameras.is_file() {
        views_of_json(&images, &cameras, masks.as_deref(), &mut findings)?
    } else {
        return Err(missing(&cameras, "the cameras"));
    };
    for view in &mut views {
        view.camera = convert(view.camera, manifest.camera_axes, manifest.camera_matrix);
    }
    if let Some(metres) = manifest.unit_in_metres.filter(|&metres| !is_length(metres)) {
        let line = text.lines().position(|line| line.trim_start().starts_with("unit_in_metres")).map_or(1, |at| at + 1);
        return Err(Error::new(ErrorKind::Malformed, format!("a unit is {metres} metres"))
            .at(Place::Line(path.into(), line))
            .remedy("give metres above 0, such as 0.001 for millimetres"));
    }
    let mesh = manifest.mesh.iter().map(|mesh| as_stored(folder.join(mesh))).collect();
    Ok(SourceScene {
        name: manifest.name.unwrap_or_else(|| name_of_folder(&folder)),
        folder,
        mesh,
        views,
        up: manifest.up,
        pixel_centre: manifest.pixel_centre,
        unit_in_metres: manifest.unit_in_metres,
        default_pixel_centre: PixelCentre::Half,
        background: manifest.background,
        encoding: manifest.encoding,
        held_out: manifest.held_out,
        has_truth: false,
        flip_winding: manifest.flip_winding,
        is_of_a_tool: false,
        sizes_are_of_files: false,
        mesh_frames: Vec::new(),
        findings,
    })
}

fn missing(path: &Path, what: &str) -> Error {
    Error::new(ErrorKind::Missing, format!("{what} named in scene.toml is not there"))
        .at(Place::File(path.into()))
        .remedy("paths in scene.toml are relative to its folder")
}

fn views_of_json(
    images: &Path,
    cameras: &Path,
    masks: Option<&Path>,
    findings: &mut Vec<Finding>,
) -> Result<Vec<SourceView>> {
    let (photos, twins) = blended_mvs::photos_of(images)?;
    let masks = blended_mvs::mask_files(masks, &photos, true, findings)?;
    let (entries, mut noticed) = read_cameras_json(cameras)?;
    findings.append(&mut noticed);
    let mut views: Vec<SourceView> = Vec::new();
    for entry in entries {
        let name = stem_of(&entry.file);
        let Some(photo) = photos.get(&name) else {
            findings.push(
                Finding::new(
                    Severity::Warning,
                    "camera-without-photo",
                    format!("there is no photo '{name}': its camera is skipped"),
                )
                .at(entry.place)
                .remedy("copy the photo, or delete the camera"),
            );
            continue;
        };
        let mask = masks.get(&name).or_else(|| twins.get(&name)).cloned();
        views.push(SourceView {
            photo: photo.clone(),
            mask,
            camera: entry.camera,
            lens: None,
            size: entry.size,
            place: entry.place,
            name,
        });
    }
    for (name, photo) in photos.iter().filter(|(name, _)| !views.iter().any(|view| view.name == **name)) {
        findings.push(
            Finding::new(
                Severity::Warning,
                "photo-without-camera",
                format!("there is no camera for '{name}': the photo is skipped"),
            )
            .at(Place::File(photo.clone()))
            .remedy("add its camera, or delete the photo"),
        );
    }
    Ok(views)
}

/// The same camera as `camera_from_source` with OpenCV axes.
fn convert(mut camera: SourceCamera, axes: CameraAxes, matrix: CameraMatrix) -> SourceCamera {
    if matrix == CameraMatrix::WorldFromCamera {
        camera.rotation = camera.rotation.transpose();
        camera.translation = -(camera.rotation * camera.translation);
    }
    if axes == CameraAxes::OpenGl {
        let turn = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
        camera.rotation = turn * camera.rotation;
        camera.translation = turn * camera.translation;
    }
    camera
}
