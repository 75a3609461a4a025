//! Parts that the mesh lacks: places in front of it at which most views find their photo unlike the model.
//!
//! Space around what the views see is cut into cells. A cell that holds something hides what the model shows behind it, in
//! every view that sees the cell: the cells that are unlike from everywhere are the hull of what is missing (visual hull,
//! Laurentini 1994). A patch of surface whose colour is wrong is unlike from everywhere as well, but lies on the surface:
//! cells near it are not asked.

use super::pictures::{Comparison, NO_SURFACE};
use super::points::{Point, pixel_of};
use crate::image::Image;
use crate::math::clusters::clusters;
use crate::math::parallel;
use crate::math::statistics::quantile;
use glam::Vec3;

/// Cells along the longest side.
const CELLS: usize = 40;
/// Views that must see a cell before it is judged.
const FEWEST_VIEWS: usize = 5;
/// Share of them that must find it unlike.
const MOST_OF_THEM: f64 = 0.75;
/// How far a cell must be in front of the surface in every view, in cells.
const CLEARANCE: f32 = 1.5;
/// Cells of a part, at least.
const FEWEST_CELLS: usize = 8;

/// A part that the mesh lacks.
#[derive(Clone, Debug, PartialEq)]
pub struct MissingPart {
    /// Its middle, in the world.
    pub centre: Vec3,
    /// Number of cells.
    pub cells: usize,
    /// Length of a cell, in world units.
    pub cell_length: f32,
    /// By view of the comparison: share of its pixels that show the part, in [0, 1].
    pub share_of_view: Vec<f64>,
}

/// The largest part that the mesh lacks, if there is one. `points` are points of the surface that views see, `unlike` the
/// pixels of each view that the model does not explain.
pub fn missing_part(comparison: &Comparison, points: &[Point], unlike: &[Image<bool>]) -> Option<MissingPart> {
    let (low, high) = bounds(points)?;
    let cell_length = (high - low).max_element() / CELLS as f32;
    if !(cell_length > 0.0 && cell_length.is_finite()) {
        return None;
    }
    let counts = ((high - low) / cell_length).ceil().max(Vec3::ONE).min(Vec3::splat(CELLS as f32));
    let [nx, ny, nz] = counts.to_array().map(|count| count as usize);
    let place = |cell: usize| {
        let index = Vec3::new((cell % nx) as f32, (cell / nx % ny) as f32, (cell / (nx * ny)) as f32);
        low + (index + 0.5) * cell_length
    };
    let is_missing = |cell: usize| is_unlike_from_everywhere(comparison, unlike, place(cell), cell_length);
    let is_missing = parallel::map_small(nx * ny * nz, is_missing);
    // Of clusters of one size the first.
    let cells = clusters(&is_missing, [nx, ny, nz]).into_iter().rev().max_by_key(Vec::len)?;
    if cells.len() < FEWEST_CELLS {
        return None;
    }
    let centre = cells.iter().map(|&cell| place(cell)).sum::<Vec3>() / cells.len() as f32;
    let share_of_view = comparison.views.iter().zip(unlike).map(|(own, unlike)| {
        let mut shown: Vec<(usize, usize)> = cells.iter().filter_map(|&cell| pixel_of(own, place(cell))).collect();
        shown.retain(|&pixel| unlike[pixel]);
        shown.sort_unstable();
        shown.dedup();
        shown.len() as f64 / (own.camera.width * own.camera.height) as f64
    });
    Some(MissingPart { centre, cells: cells.len(), cell_length, share_of_view: share_of_view.collect() })
}

/// A box around what the views see, without its outermost hundredths, enlarged by a fifth.
fn bounds(points: &[Point]) -> Option<(Vec3, Vec3)> {
    if points.is_empty() {
        return None;
    }
    let of_axis = |axis: usize, fraction: f64| {
        let values: Vec<f64> = points.iter().map(|point| f64::from(point.position[axis])).collect();
        quantile(&values, fraction) as f32
    };
    let low = Vec3::from_array([0, 1, 2].map(|axis| of_axis(axis, 0.01)));
    let high = Vec3::from_array([0, 1, 2].map(|axis| of_axis(axis, 0.99)));
    let margin = 0.1 * (high - low).max_element();
    Some((low - margin, high + margin))
}

fn is_unlike_from_everywhere(comparison: &Comparison, unlike: &[Image<bool>], place: Vec3, cell_length: f32) -> bool {
    let (mut seen, mut unlike_in) = (0usize, 0usize);
    for (own, unlike) in comparison.views.iter().zip(unlike) {
        let Some(pixel) = pixel_of(own, place) else { continue };
        let surface = own.distance[pixel];
        if surface == NO_SURFACE && !comparison.background_known {
            continue;
        }
        let in_front = surface - place.distance(own.camera.position_in_world());
        if in_front.abs() < CLEARANCE * cell_length {
            return false;
        }
        if in_front > 0.0 {
            seen += 1;
            unlike_in += usize::from(unlike[pixel]);
        }
    }
    seen >= FEWEST_VIEWS && unlike_in as f64 >= MOST_OF_THEM * seen as f64
}
