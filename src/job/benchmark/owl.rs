//! Objects with Lighting: `gt_image_*.png` beside `inputs`, each with a camera, a mask and an environment of its own.
//!
//! `gt_env_512_rotated_*.hdr` stands in the axes of the world already: +z is the upper border, +x the middle column, +y the
//! column at a quarter, -y at three quarters.

use super::{Drawing, Question, Score, Scored, absent, environment_of};
use crate::error::{Error, ErrorKind, Place, Result};
use crate::image::file;
use crate::insight::protocols::owl;
use crate::light::Environment;
use crate::scene::WorldFromSource;
use crate::scene::read::objects_with_lighting::{camera_files, inputs_of, read_camera};
use glam::Vec3;
use std::f32::consts::{PI, TAU};
use std::path::Path;

/// Where a direction of the data set's world lies on its environments, as shares of width and height.
pub fn place_on_environment(direction: Vec3) -> (f32, f32) {
    let direction = direction.normalize_or(Vec3::Z);
    (0.5 - direction.y.atan2(direction.x) / TAU, direction.z.clamp(-1.0, 1.0).acos() / PI)
}

/// Renders and scores all pictures of an object; `tell` hears of each.
///
/// # Errors
/// A folder without ground truth, a file that is missing or damaged.
pub fn score(
    folder: &Path,
    world: &WorldFromSource,
    drawing: &Drawing,
    tell: &mut dyn FnMut(&Scored),
) -> Result<Vec<Scored>> {
    let inputs = inputs_of(folder).ok_or_else(|| absent(folder, "test/inputs with its photos"))?;
    let test = inputs.parent().unwrap_or(folder);
    let cameras = camera_files(test, "gt_");
    if cameras.is_empty() {
        return Err(absent(test, "gt_camera_*.txt"));
    }
    let source_from_world = world.rotation.transpose().as_mat3();
    let mut all = Vec::new();
    for (number, path) in cameras {
        let beside = |name: &str, extension: &str| test.join(format!("gt_{name}_{number}.{extension}"));
        let (camera, size, _) = read_camera(&path)?;
        let environment = beside("env_512_rotated", "hdr");
        if !environment.is_file() {
            return Err(absent(&environment, "the environment of a picture"));
        }
        let (environment, _) = Environment::read(&environment)?;
        let light =
            environment_of(&environment.radiance, |direction| place_on_environment(source_from_world * direction));
        let truth =
            file::read_srgb8(&beside("image", "png"))?.map(|bytes| Vec3::from_array(bytes.map(f32::from)) / 255.0);
        if (truth.width(), truth.height()) != size {
            let message = format!(
                "the camera is of {} x {} pixels, its picture of {} x {}",
                size.0,
                size.1,
                truth.width(),
                truth.height()
            );
            return Err(Error::new(ErrorKind::InvalidScene, message)
                .at(Place::File(path))
                .remedy("download the data set again"));
        }
        let mask = file::read_grey(&beside("mask", "png"))?;
        let picture = drawing.picture(&camera.in_world(world, size, 0.0), Some(&light), all.len());
        let score = owl::score(&picture, &truth, &mask).map_err(|error| error.at(Place::File(path)))?;
        let scored =
            Scored { name: format!("gt_image_{number}"), question: Question::Relighting, score: Score::Owl(score) };
        tell(&scored);
        all.push(scored);
    }
    Ok(all)
}
