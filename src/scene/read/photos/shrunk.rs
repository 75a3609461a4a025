//! Photos averaged over squares of pixels.

use super::values::to_half;
use crate::image::{Image, RgbImage};
use crate::scene::{Photo, PixelState};
use glam::Vec3;

/// Averages squares of `factor` pixels in linear radiance; a rest of fewer pixels at the right and lower edge is cut.
pub(super) fn shrink(photo: &Photo, states: &Image<PixelState>, factor: usize) -> (Photo, Image<PixelState>) {
    let (width, height) = ((photo.width() / factor).max(1), (photo.height() / factor).max(1));
    let cells = |row: usize, column: usize| {
        let rows = row * factor..((row + 1) * factor).min(photo.height());
        rows.flat_map(move |r| (column * factor..((column + 1) * factor).min(photo.width())).map(move |c| (r, c)))
    };
    let small = Image::from_fn(width, height, |row, column| {
        let (sum, count) = cells(row, column)
            .fold((Vec3::ZERO, 0.0), |(sum, count), (r, c)| (sum + photo.radiance(r, c), count + 1.0));
        sum / count
    });
    let small_states = Image::from_fn(width, height, |row, column| {
        let (mut surface, mut clipped, mut ignored, mut count) = (0, false, false, 0);
        for place in cells(row, column) {
            let state = states[place];
            count += 1;
            surface += usize::from(state.is_surface());
            clipped |= state.is_clipped();
            ignored |= state == PixelState::Ignored;
        }
        match (ignored || (surface != 0 && surface != count), surface > 0, clipped) {
            // A square across the silhouette is a mixture: evidence for neither side.
            (true, _, _) => PixelState::Ignored,
            (false, true, false) => PixelState::Surface,
            (false, true, true) => PixelState::SurfaceClipped,
            (false, false, false) => PixelState::Background,
            (false, false, true) => PixelState::BackgroundClipped,
        }
    });
    let halves = || small.map(|pixel| to_half(*pixel));
    let photo = match photo {
        Photo::Linear32(_) => Photo::Linear32(small),
        Photo::Linear16(_) => Photo::Linear16(halves()),
        Photo::Srgb8(_) | Photo::MeanOfSrgb8(_) => Photo::MeanOfSrgb8(halves()),
    };
    (photo, small_states)
}

/// A linear picture averaged over squares of `factor` pixels.
pub fn shrink_linear(image: RgbImage, factor: usize) -> RgbImage {
    if factor == 1 {
        return image;
    }
    let states = Image::filled(image.width(), image.height(), PixelState::Surface);
    shrink(&Photo::Linear32(image), &states, factor).0.to_linear()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shrinking_averages_radiance_and_sets_mixtures_aside() {
        let bytes = Image::from_fn(5, 4, |row, column| [if row < 2 && column == 0 { 255 } else { 0 }, 0, 0]);
        let mut states = Image::filled(5, 4, PixelState::Surface);
        states[(0, 0)] = PixelState::SurfaceClipped;
        states[(0, 2)] = PixelState::Background;
        let (photo, small) = shrink(&Photo::Srgb8(bytes.clone()), &states, 2);
        assert_eq!((photo.width(), photo.height()), (2, 2));
        let expected = crate::scene::photo::linear_from_srgb8([255, 0, 0]).x / 2.0;
        assert!((photo.radiance(0, 0).x - expected).abs() < 1e-3);
        assert!(!photo.is_linear(), "it is a photograph of eight bits still, and is fitted as one");
        assert_eq!(
            small.pixels(),
            [PixelState::SurfaceClipped, PixelState::Ignored, PixelState::Surface, PixelState::Surface]
        );
    }
}
