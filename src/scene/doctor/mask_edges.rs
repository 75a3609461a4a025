//! At which place within the pixel do mesh and mask disagree least, along the edge of a view's mask?

use super::probe::hit_at;
use crate::scene::{PixelState, View};
use crate::trace::Bvh;
use glam::{DVec2, Vec2};

/// Pixels beside the mask's edge that are measured in each view.
const EDGE_PIXELS_PER_VIEW: usize = 600;
/// Places tried along each axis: -0.25, 0, ... 1.75 within and around the pixel. Where intrinsics were doubled, one convention
/// taken for the other is off by a whole pixel.
const COARSE_COUNT: usize = 9;
const COARSE_FIRST: f32 = -0.25;
pub(super) const COARSE_STEP: f32 = 0.25;

/// What the mask's edge of one view says.
pub(super) struct MaskEdges {
    /// Edge pixels.
    pub count: usize,
    /// Where mesh and mask disagree least, within the pixel.
    pub centre: DVec2,
    /// Disagreeing edge pixels with the centre at (0, 0), (0.5, 0.5) and (1, 1).
    pub disagreements: [usize; 3],
}

impl MaskEdges {
    /// Shoots rays near the edge of the mask at many places within the pixel; `None` where there is too little of it, or where
    /// it follows the mesh nowhere.
    pub fn measure(view: &View, bvh: &Bvh) -> Option<Self> {
        let pixels = mask_edge_pixels(view);
        if pixels.len() < 50 {
            return None;
        }
        let step = pixels.len().div_ceil(EDGE_PIXELS_PER_VIEW);
        let pixels: Vec<_> = pixels.into_iter().step_by(step).collect();
        let disagreements_at = |place: Vec2| {
            pixels
                .iter()
                .filter(|(row, column, object)| {
                    let hit = hit_at(&view.camera, bvh, Vec2::new(*column as f32, *row as f32) + place);
                    hit.is_some() != *object
                })
                .count()
        };
        let coarse = |index: usize| COARSE_FIRST + COARSE_STEP * index as f32;
        let mut best = (usize::MAX, Vec2::ZERO);
        let mut disagreements = [0; 3];
        for (row, column) in (0..COARSE_COUNT).flat_map(|row| (0..COARSE_COUNT).map(move |column| (row, column))) {
            let place = Vec2::new(coarse(column), coarse(row));
            let count = disagreements_at(place);
            if count < best.0 {
                best = (count, place);
            }
            if row == column && row % 2 == 1 && row / 2 < disagreements.len() {
                disagreements[row / 2] = count;
            }
        }
        // Refine; of several places that are equally good, the mean is taken.
        let (mut sum, mut ties, mut least) = (DVec2::ZERO, 0usize, usize::MAX);
        for (y, x) in (-3..=3).flat_map(|y| (-3..=3).map(move |x| (y, x))) {
            let place = best.1 + Vec2::new(x as f32, y as f32) * (COARSE_STEP / 4.0);
            let count = disagreements_at(place);
            if count < least {
                (sum, ties, least) = (DVec2::ZERO, 0, count);
            }
            if count == least {
                sum += place.as_dvec2();
                ties += 1;
            }
        }
        // A mask that follows the mesh nowhere says nothing.
        (least * 5 < pixels.len() * 2).then(|| MaskEdges {
            count: pixels.len(),
            centre: sum / ties as f64,
            disagreements,
        })
    }
}

/// Pixels on either side of the mask's edge: (row, column, is object).
fn mask_edge_pixels(view: &View) -> Vec<(usize, usize, bool)> {
    let states = &view.states;
    let mut pixels = Vec::new();
    for row in 1..states.height().saturating_sub(1) {
        for column in 1..states.width().saturating_sub(1) {
            let state = states[(row, column)];
            let neighbours = [(row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1)];
            let differs = neighbours
                .iter()
                .any(|&place| states[place] != PixelState::Ignored && states[place].is_surface() != state.is_surface());
            if state != PixelState::Ignored && differs {
                pixels.push((row, column, state.is_surface()));
            }
        }
    }
    pixels
}
