//! The mesh's outline over a photo, for the eye.

use super::probe::{centre_of, hit_at, surface_at};
use crate::image::transfer::srgb8_from_linear_value;
use crate::image::{Image, RgbImage};
use crate::math::parallel;
use crate::scene::{Mesh, Photo, Scene, View};
use crate::trace::Bvh;
use glam::Vec3;

/// The mesh against the background.
pub const SILHOUETTE_COLOUR: [u8; 3] = [255, 0, 200];
/// A nearer part of the mesh against a farther one.
pub const DEPTH_COLOUR: [u8; 3] = [255, 220, 0];
/// A sharp edge of the mesh.
pub const CREASE_COLOUR: [u8; 3] = [0, 200, 90];
/// The edge of the mask.
pub const MASK_COLOUR: [u8; 3] = [0, 190, 255];

/// Faces that meet at a larger angle form a crease: cosine of 50 degrees.
const CREASE_COSINE: f32 = 0.64;

/// What the ray of a pixel meets, as far as outlines care.
#[derive(Clone, Copy)]
struct Sight {
    depth: f32,
    point: Vec3,
    normal: Vec3,
}

/// Draws the outline of the mesh over the photo of view `view`: silhouette magenta, depth edges yellow, creases green,
/// the edge of the mask blue where it departs from the silhouette.
///
/// The photo is drawn a little paler than it is; float photos are exposed so that their brightest percent is white.
///
/// # Panics
/// When there is no view of this index: a defect of the caller.
pub fn overlay(scene: &Scene, bvh: &Bvh, view: usize) -> Image<[u8; 3]> {
    overlay_of(&scene.mesh, bvh, &scene.views[view])
}

/// [`overlay`] of a view that need not be one of a scene.
pub fn overlay_of(mesh: &Mesh, bvh: &Bvh, view: &View) -> Image<[u8; 3]> {
    let (width, height) = (view.camera.width, view.camera.height);
    let sight_of = |row: usize, column: usize| {
        let hit = hit_at(&view.camera, bvh, centre_of(row, column))?;
        let (point, normal, _) = surface_at(mesh, &hit)?;
        Some(Sight { depth: hit.t, point, normal })
    };
    let sights = parallel::map_small(width * height, |pixel| sight_of(pixel / width, pixel % width));
    let sight = |row: usize, column: usize| sights[row * width + column];
    let mut picture = backdrop(view);
    for row in 0..height {
        for column in 0..width {
            let neighbours = [(row + 1, column), (row, column + 1)];
            for (r, c) in neighbours.into_iter().filter(|(r, c)| *r < height && *c < width) {
                let here = view.states[(row, column)].is_surface();
                if here != view.states[(r, c)].is_surface() {
                    picture[(row, column)] = MASK_COLOUR;
                }
                // The outer silhouette is drawn over all other lines.
                if let Some(colour) = edge_between(sight(row, column), sight(r, c), &view.camera.position_in_world())
                    && picture[(row, column)] != SILHOUETTE_COLOUR
                {
                    picture[(row, column)] = colour;
                }
            }
        }
    }
    picture
}

fn edge_between(a: Option<Sight>, b: Option<Sight>, eye: &Vec3) -> Option<[u8; 3]> {
    match (a, b) {
        (None, None) => None,
        (Some(a), Some(b)) => {
            // Two sights of one smooth surface: each point lies near the tangent plane of the other.
            let gap = b.point - a.point;
            let slack = 0.004 * a.depth.min(b.depth) + 0.25 * gap.length();
            let off_plane = gap.dot(a.normal).abs().max(gap.dot(b.normal).abs());
            let facing = a.normal.dot(*eye - a.point) > 0.0 && b.normal.dot(*eye - b.point) > 0.0;
            if off_plane > slack && (a.depth - b.depth).abs() > 0.01 * a.depth.min(b.depth) {
                Some(DEPTH_COLOUR)
            } else if facing && a.normal.dot(b.normal) < CREASE_COSINE {
                Some(CREASE_COLOUR)
            } else {
                None
            }
        }
        _ => Some(SILHOUETTE_COLOUR),
    }
}

/// The photo as bytes, a fifth of the way to grey so that lines stand out.
fn backdrop(view: &View) -> Image<[u8; 3]> {
    let bytes = match &view.photo {
        Photo::Srgb8(bytes) => bytes.clone(),
        photo => encode(&photo.to_linear()),
    };
    bytes.map(|pixel| pixel.map(|byte| ((u16::from(byte) * 4 + 128) / 5) as u8))
}

fn encode(linear: &RgbImage) -> Image<[u8; 3]> {
    let brightness: Vec<f64> = linear.pixels().iter().step_by(7).map(|pixel| f64::from(pixel.max_element())).collect();
    let white = crate::math::statistics::quantile(&brightness, 0.99).max(1e-6) as f32;
    linear.map(|pixel| (*pixel / white).to_array().map(srgb8_from_linear_value))
}
