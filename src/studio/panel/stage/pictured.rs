//! What pictures of the stage have in common, however they are made: their size, what they are of, two in one.

use crate::image::{Image, RgbImage};
use crate::material::MaterialMaps;
use crate::studio::model::Model;
use crate::studio::model::lights::LightName;
use crate::studio::stage::StageFrame;
use egui::{Ui, Vec2};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;

/// Pixels of such a picture, at most; more are drawn coarser.
const MOST_PIXELS: f32 = 1.0e6;

/// Width and height in pixels of a picture of the stage; a large stage is drawn coarser.
pub(super) fn size_of_picture(ui: &Ui, size: Vec2) -> (usize, usize) {
    let full = size * ui.ctx().pixels_per_point();
    let scale = (MOST_PIXELS / (full.x * full.y).max(1.0)).sqrt().min(1.0);
    ((full.x * scale) as usize, (full.y * scale) as usize)
}

/// A number that changes whenever the picture would.
pub(super) fn key_of(
    model: &Model,
    frame: &StageFrame,
    name: &LightName,
    maps: &Arc<MaterialMaps>,
    size: (usize, usize),
) -> u64 {
    let mut hasher = DefaultHasher::new();
    let camera = frame.eye.as_camera(size.0, size.1);
    let mut numbers: Vec<f32> = vec![model.edits.relight.turn_degrees, model.edits.relight.strength_stops];
    numbers.extend(camera.rotation_camera_from_world.to_cols_array());
    numbers.extend(camera.translation_camera_from_world.to_array());
    numbers.extend(camera.focal_pixels.to_array());
    numbers.extend(camera.centre_pixels.to_array());
    for number in numbers {
        number.to_bits().hash(&mut hasher);
    }
    let light = model.shelf.find(name).map_or(0, |light| Arc::as_ptr(&light.environment) as usize);
    let fitted = model.shelf.find(&LightName::Fitted).map_or(0, |light| Arc::as_ptr(&light.environment) as usize);
    (name, light, fitted, Arc::as_ptr(maps) as usize, size).hash(&mut hasher);
    let relight = &model.edits.relight;
    (relight.matched, relight.as_background, relight.is_background_blurred).hash(&mut hasher);
    (relight.ground, model.edits.fit.bounces).hash(&mut hasher);
    hasher.finish() | 1
}

/// The first picture left of a place in [0, 1] of the width, the second right of it.
pub(super) fn side_by_side(first: &RgbImage, second: &RgbImage, wipe: f32) -> RgbImage {
    let border = (wipe * first.width() as f32) as usize;
    Image::from_fn(first.width(), first.height(), |row, column| {
        if column < border { first[(row, column)] } else { second[(row, column)] }
    })
}
