//! Connected patches of pixels: what a defect leaves, and noise does not.

use crate::image::Image;
use crate::math::clusters::clusters;

/// The pixels of patches of at least `fewest` pixels that hold together along edges and are three pixels thick somewhere.
pub fn patches(flagged: &Image<bool>, fewest: usize) -> Image<bool> {
    let (width, height) = (flagged.width(), flagged.height());
    let mut kept = Image::filled(width, height, false);
    let is_thick = |pixel: usize| {
        let (row, column) = (pixel / width, pixel % width);
        let inside = row > 0 && column > 0 && row + 1 < height && column + 1 < width;
        inside && [pixel - 1, pixel + 1, pixel - width, pixel + width].iter().all(|&other| flagged.pixels()[other])
    };
    for patch in clusters(flagged.pixels(), [width, height, 1]) {
        if patch.len() >= fewest && patch.iter().any(|&pixel| is_thick(pixel)) {
            patch.iter().for_each(|&pixel| kept.pixels_mut()[pixel] = true);
        }
    }
    kept
}

/// Number of pixels that are set.
pub fn count(flagged: &Image<bool>) -> usize {
    flagged.pixels().iter().filter(|flagged| **flagged).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_stay_and_lines_and_specks_go() {
        let flagged = Image::from_fn(20, 12, |row, column| {
            let is_square = (2..5).contains(&row) && (2..5).contains(&column);
            let is_line = row == 8;
            let is_speck = (row, column) == (3, 12);
            is_square || is_line || is_speck
        });
        let kept = patches(&flagged, 5);
        assert_eq!(count(&kept), 9);
        assert!(kept[(3, 3)] && !kept[(8, 3)] && !kept[(3, 12)]);
        assert_eq!(count(&patches(&flagged, 10)), 0);
        assert_eq!(count(&patches(&Image::filled(1, 1, true), 1)), 0);
    }
}
