//! All photos on one picture, small, each with the outline of the mesh: what a person looks at first.

use super::overlay::overlay_of;
use crate::image::Image;
use crate::image::transfer::srgb8_from_linear_value;
use crate::scene::{Photo, Scene, View};
use crate::trace::Bvh;
use glam::Vec3;

/// Photos are made so much smaller that their longer side has at most so many pixels.
const SIDE_PIXELS: usize = 320;
/// Pixels between photos.
const GAP_PIXELS: usize = 6;
/// Of more photos than this some are shown, spread evenly.
const MOST_PHOTOS: usize = 60;
/// What is between photos; held-out ones have a frame.
const PAPER: [u8; 3] = [32, 32, 32];
const HELD_OUT: [u8; 3] = [255, 170, 0];

/// The contact sheet of a scene: photos in the order of their names, row by row; held-out ones in an orange frame. Empty
/// where the scene has no views.
pub fn contact_sheet(scene: &Scene, bvh: &Bvh) -> Image<[u8; 3]> {
    let step = scene.views.len().div_ceil(MOST_PHOTOS).max(1);
    let small: Vec<(Image<[u8; 3]>, bool)> = scene
        .views
        .iter()
        .step_by(step)
        .map(|view| (overlay_of(&scene.mesh, bvh, &smaller(view)), view.held_out))
        .collect();
    let columns = (small.len() as f64 * 1.5).sqrt().ceil().max(1.0) as usize;
    let cell = |length: &dyn Fn(&Image<[u8; 3]>) -> usize| {
        small.iter().map(|(picture, _)| length(picture)).max().unwrap_or(0) + 2 * GAP_PIXELS
    };
    let (width, height) = (cell(&|picture| picture.width()), cell(&|picture| picture.height()));
    let mut sheet = Image::filled(columns.min(small.len()) * width, small.len().div_ceil(columns) * height, PAPER);
    for (index, (picture, held_out)) in small.iter().enumerate() {
        let (top, left) = (index / columns * height + GAP_PIXELS, index % columns * width + GAP_PIXELS);
        if *held_out {
            for row in top - GAP_PIXELS / 2..top + picture.height() + GAP_PIXELS / 2 {
                for column in left - GAP_PIXELS / 2..left + picture.width() + GAP_PIXELS / 2 {
                    sheet[(row, column)] = HELD_OUT;
                }
            }
        }
        for row in 0..picture.height() {
            for column in 0..picture.width() {
                sheet[(top + row, left + column)] = picture[(row, column)];
            }
        }
    }
    sheet
}

/// A view of fewer pixels, so that outlines are as thin on it as on a large one.
fn smaller(view: &View) -> View {
    let factor = view.camera.width.max(view.camera.height).div_ceil(SIDE_PIXELS).max(1);
    let camera = view.camera.shrunk(factor);
    let last = |length: usize, of: usize| (of.saturating_sub(1)).min(length);
    let photo = Image::from_fn(camera.width, camera.height, |row, column| {
        let mut sum = Vec3::ZERO;
        for r in row * factor..(row + 1) * factor {
            for c in column * factor..(column + 1) * factor {
                sum += view.photo.radiance(last(r, view.photo.height()), last(c, view.photo.width()));
            }
        }
        sum / (factor * factor) as f32
    });
    let states = Image::from_fn(camera.width, camera.height, |row, column| {
        let middle = |place: usize, of: usize| last(place * factor + factor / 2, of);
        view.states[(middle(row, view.states.height()), middle(column, view.states.width()))]
    });
    // Bytes stay bytes: they are shown as they are, floats by their brightness.
    let photo = match view.photo {
        Photo::Srgb8(_) => Photo::Srgb8(photo.map(|rgb| rgb.to_array().map(srgb8_from_linear_value))),
        _ => Photo::Linear32(photo),
    };
    View { camera, photo, states, ..view.clone() }
}
