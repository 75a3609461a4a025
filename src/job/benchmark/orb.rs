//! Stanford-ORB, in the representation of NeRF's synthetic scenes with high dynamic range.
//!
//! ```text
//! blender_HDR/NAME/transforms_test.json     other cameras under the same light        NAME/test/0001.exr, NAME/test_mask/0001.png
//! blender_HDR/NAME/transforms_novel.json    other captures, their cameras in this frame    ../SCENE_NAME/test/...
//! ground_truth/SCENE_NAME/env_map/0001.exr  the light of a test picture, in the axes of its camera (OpenGL's)
//! ```
//! On an environment +y is up and the left border is +z; the middle is -z, a quarter from the left -x.

use super::{Drawing, Question, Score, Scored, absent, environment_of};
use crate::error::{Error, ErrorKind, Place, Result};
use crate::image::{file, resize};
use crate::insight::protocols::orb::{self, RESOLUTION};
use crate::light::Environment;
use crate::scene::WorldFromSource;
use crate::scene::read::colmap_lens::matrix;
use crate::scene::read::source::SourceCamera;
use crate::scene::read::text;
use glam::{DMat3, DMat4, DVec3, Vec3};
use serde::Deserialize;
use std::f32::consts::{PI, TAU};
use std::path::{Path, PathBuf};

/// Where a direction in the axes of a camera (OpenGL's) lies on its environment, as shares of width and height.
pub fn place_on_environment(direction: Vec3) -> (f32, f32) {
    let direction = direction.normalize_or(Vec3::Y);
    ((direction.x.atan2(-direction.z) + PI) / TAU, direction.y.clamp(-1.0, 1.0).acos() / PI)
}

#[derive(Deserialize)]
struct Transforms {
    camera_angle_x: Option<f64>,
    frames: Vec<Frame>,
}

#[derive(Deserialize)]
struct Frame {
    file_path: String,
    scene_name: Option<String>,
    camera_angle_x: Option<f64>,
    transform_matrix: [[f64; 4]; 4],
}

fn transforms(path: &Path) -> Result<Transforms> {
    if !path.is_file() {
        return Err(absent(path, "the list of pictures"));
    }
    serde_json::from_str(&text::read(path)?).map_err(|error| {
        Error::new(ErrorKind::Malformed, format!("not a list of frames: {error}"))
            .at(Place::Line(path.into(), error.line().max(1)))
            .remedy("download the data set again")
    })
}

/// Renders and scores all pictures that a scene asks for; `tell` hears of each.
///
/// # Errors
/// A folder without ground truth, a file that is missing or damaged.
pub fn score(
    folder: &Path,
    world: &WorldFromSource,
    drawing: &Drawing,
    tell: &mut dyn FnMut(&Scored),
) -> Result<Vec<Scored>> {
    let whole = std::path::absolute(folder).map_err(|source| Error::reading(folder, source))?;
    let own_name = whole.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let scenes = whole.parent().unwrap_or(&whole).to_path_buf();
    let truths = scenes.parent().unwrap_or(&scenes).join("ground_truth");
    let mut all = Vec::new();
    for (file, question) in
        [("transforms_test.json", Question::NovelView), ("transforms_novel.json", Question::Relighting)]
    {
        let path = whole.join(file);
        let list = transforms(&path)?;
        for (index, frame) in list.frames.iter().enumerate() {
            let scene = frame.scene_name.clone().unwrap_or_else(|| own_name.clone());
            let target = scenes.join(&scene).join(format!("{}.exr", frame.file_path.trim_start_matches("./")));
            let name = target.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            let place = Place::View(format!("frame {index} of {}", path.display()));
            let angle = frame.camera_angle_x.or(list.camera_angle_x).filter(|angle| *angle > 0.0 && *angle < 3.1);
            let angle = angle.ok_or_else(|| {
                Error::new(ErrorKind::Malformed, "the frame has no camera_angle_x")
                    .at(place.clone())
                    .remedy("download the data set again")
            })?;
            let (camera, camera_from_source) = camera_of(frame, angle, &place)?;
            let camera = camera.in_world(world, (RESOLUTION, RESOLUTION), 0.0);
            let light = match question {
                Question::NovelView => None,
                Question::Relighting => {
                    let path = truths.join(&scene).join("env_map").join(format!("{name}.exr"));
                    if !path.is_file() {
                        return Err(absent(&path, "the environment of a picture"));
                    }
                    let (environment, _) = Environment::read(&path)?;
                    let camera_from_world = (camera_from_source * world.rotation.transpose()).as_mat3();
                    Some(environment_of(&environment.radiance, |own| place_on_environment(camera_from_world * own)))
                }
            };
            let (truth, alpha) = target_of(&target)?;
            let picture = drawing.picture(&camera, light.as_ref(), all.len());
            let score = orb::score(&picture, &truth, &alpha, question == Question::Relighting)
                .map_err(|error| error.at(Place::File(target.clone())))?;
            let scored = Scored { name: format!("{scene}/{name}"), question, score: Score::Orb(score) };
            tell(&scored);
            all.push(scored);
        }
    }
    Ok(all)
}

/// The camera of a frame at the size that is scored, and the rotation of its axes (OpenGL's) from the source's world.
fn camera_of(frame: &Frame, angle: f64, place: &Place) -> Result<(SourceCamera, DMat3)> {
    let rows = frame.transform_matrix.as_flattened();
    let mut values = [0.0; 16];
    values.copy_from_slice(rows);
    let source_from_camera = DMat4::from_cols_array(&values).transpose();
    let opengl = DMat3::from_mat4(source_from_camera).transpose();
    let rotation = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0)) * opengl;
    let side = RESOLUTION as f64;
    let focal = 0.5 * side / (0.5 * angle).tan();
    let translation = -(rotation * source_from_camera.w_axis.truncate());
    let (camera, _) = SourceCamera::new(matrix([focal; 2], [0.5 * side; 2]), rotation, translation, place)?;
    Ok((camera, opengl))
}

/// The ground truth of a picture and its mask, at the size that is scored.
fn target_of(target: &Path) -> Result<(crate::image::RgbImage, crate::image::GreyImage)> {
    let mask = mask_of(target);
    if let Some(path) = [target, mask.as_path()].into_iter().find(|path| !path.is_file()) {
        return Err(absent(path, "a picture of the ground truth"));
    }
    let (truth, alpha) = (file::read_rgb(target)?, file::read_grey(&mask)?);
    let factor = truth.width() / RESOLUTION;
    let size = (truth.width(), truth.height());
    if factor == 0 || size != (factor * RESOLUTION, factor * RESOLUTION) || (alpha.width(), alpha.height()) != size {
        let message = format!("the picture is {} x {}, not {RESOLUTION} x {RESOLUTION} or a multiple", size.0, size.1);
        return Err(Error::new(ErrorKind::InvalidScene, message)
            .at(Place::File(target.into()))
            .remedy("the benchmark's pictures are 2048 x 2048, their masks too"));
    }
    Ok((resize::shrink(&truth, factor), resize::shrink(&alpha, factor)))
}

/// `NAME/test_mask/0001.png` of `NAME/test/0001.exr`.
fn mask_of(target: &Path) -> PathBuf {
    let folder = target.parent().unwrap_or(Path::new(""));
    let masks = format!("{}_mask", folder.file_name().unwrap_or_default().to_string_lossy());
    folder.with_file_name(masks).join(target.with_extension("png").file_name().unwrap_or_default())
}
