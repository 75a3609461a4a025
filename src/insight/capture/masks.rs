//! Pixels whose mask is doubtful: the mesh says the contrary, well away from its outline.

use super::patches::patches;
use super::pictures::Compared;
use crate::image::{Image, RgbImage};
use crate::scene::PixelState;

/// Pixels of a patch, at least.
const FEWEST_PIXELS: usize = 5;
/// Radiance below which a pixel is black, and above which it is not, compressed to [0, 1).
const BLACK: f32 = 0.01;
const NOT_BLACK: f32 = 0.2;

/// What is doubtful in the mask of a view.
pub struct MaskDoubt {
    /// Pixels of patches where mask and mesh contradict each other, or the mask says surface and the photo is black where
    /// the model is bright.
    pub doubtful: Image<bool>,
    /// Pixels that could be judged.
    pub judged: usize,
}

/// Compares mask and mesh of a view. `photo` and `model` are compressed. `None` for a view without a mask.
///
/// A pixel is judged where it and all its neighbours are covered wholly or not at all: a mask may be a pixel off at the
/// outline. Where the mask says surface and the mesh is not there, `unlike` tells a mesh that lacks a part, whose photo
/// does not look like the background, from a wrong mask.
pub fn doubt(own: &Compared, photo: &RgbImage, model: &RgbImage, unlike: &Image<bool>) -> Option<MaskDoubt> {
    if !own.has_mask {
        return None;
    }
    let (width, height) = own.size();
    let mut judged = 0;
    let flagged = Image::from_fn(width, height, |row, column| {
        let place = (row, column);
        let state = own.states[place];
        let (on_mesh, off_mesh) = (own.is_inside(row, column, true), own.is_inside(row, column, false));
        if state == PixelState::Ignored || !(on_mesh || off_mesh) {
            return false;
        }
        judged += 1;
        if on_mesh {
            let is_black = photo[place].max_element() < BLACK && model[place].min_element() > NOT_BLACK;
            !state.is_surface() || is_black
        } else {
            state.is_surface() && !unlike[place]
        }
    });
    Some(MaskDoubt { doubtful: patches(&flagged, FEWEST_PIXELS), judged })
}

#[cfg(test)]
mod tests {
    use super::super::patches::count;
    use super::*;
    use crate::scene::Camera;
    use glam::Vec3;

    /// A view of 40 x 30 pixels whose left half is surface, with a mask that says so.
    fn view() -> Compared {
        let camera = Camera::looking_at(Vec3::Z, Vec3::ZERO, 40, 30, 1.0);
        let picture = Image::from_fn(40, 30, |_, column| Vec3::splat(if column < 20 { 0.6 } else { 0.3 }));
        Compared {
            view: 0,
            camera,
            photo_pixels: 1.0,
            photo: picture.clone(),
            halves: [picture.clone(), picture.clone()],
            states: Image::from_fn(
                40,
                30,
                |_, column| {
                    if column < 20 { PixelState::Surface } else { PixelState::Background }
                },
            ),
            coverage: Image::from_fn(40, 30, |_, column| if column < 20 { 1.0 } else { 0.0 }),
            distance: Image::filled(40, 30, 1.0),
            has_mask: true,
        }
    }

    fn doubtful(own: &Compared, unlike: &Image<bool>) -> usize {
        count(&doubt(own, &own.photo, &own.model(), unlike).unwrap().doubtful)
    }

    #[test]
    fn patches_against_the_mesh_are_doubtful_and_a_ragged_outline_is_not() {
        let none = Image::filled(40, 30, false);
        let mut own = view();
        assert_eq!(doubtful(&own, &none), 0);
        for row in 0..30 {
            own.states[(row, 19 + row % 3)] = if row % 2 == 0 { PixelState::Surface } else { PixelState::Background };
        }
        assert_eq!(doubtful(&own, &none), 0, "a pixel at the outline");
        for (row, column) in (0..9).map(|index| (5 + index / 3, 8 + index % 3)) {
            own.states[(row, column)] = PixelState::Background;
            own.states[(row + 10, column + 20)] = PixelState::Surface;
        }
        assert_eq!(doubtful(&own, &none), 18);
        // What looks like nothing behind the mesh is a part that it lacks, and no fault of the mask.
        assert_eq!(doubtful(&own, &Image::from_fn(40, 30, |_, column| column >= 20)), 9);
        own.has_mask = false;
        assert!(doubt(&own, &own.photo, &own.model(), &none).is_none());
    }

    #[test]
    fn black_within_the_mask_where_the_model_is_bright_is_doubtful() {
        let own = view();
        let mut photo = own.photo.clone();
        (0..16).for_each(|index| photo[(6 + index / 4, 6 + index % 4)] = Vec3::ZERO);
        let none = Image::filled(40, 30, false);
        assert_eq!(count(&doubt(&own, &photo, &own.model(), &none).unwrap().doubtful), 16);
    }
}
