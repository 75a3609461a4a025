//! Patches of a photo that the model's picture does not explain.

use super::patches::patches;
use super::pictures::mean_of;
use super::smooth::smoothed;
use crate::image::{Image, RgbImage};
use crate::math::statistics::deviation_of_triples;
use glam::Vec3;

/// Smoothing in pixels.
const SIGMA: f32 = 0.7;
/// How far a pixel must be off, in standard deviations of what is usual in its view, slope and noise counted in.
const DEVIATIONS: f32 = 4.0;
/// How far it must be off at least, in compressed radiance (0 to 1).
const LEAST: f32 = 0.06;
/// How many pixels an edge may be off without being unlike.
const EDGE_PIXELS: f32 = 0.7;
/// Pixels of a patch, at least.
const FEWEST_PIXELS: usize = 6;

/// The pixels of patches in which photo and model differ by more than is usual in this view, and by more than an edge
/// explains that is off by seven tenths of a pixel. Values are compressed to [0, 1); `judged` are the pixels that count.
/// What is usual is told apart for surface and background, which `is_surface` names.
pub fn unlike_patches(
    photo: &RgbImage,
    halves: [&RgbImage; 2],
    judged: &Image<bool>,
    is_surface: &Image<bool>,
) -> Image<bool> {
    let (width, height) = (photo.width(), photo.height());
    let photo = smoothed(photo, judged, SIGMA);
    let halves = halves.map(|half| smoothed(half, judged, SIGMA));
    let model = mean_of(&halves);
    let size = |value: Vec3| value.length() / 3f32.sqrt();
    let rest = Image::from_fn(width, height, |row, column| size(photo[(row, column)] - model[(row, column)]));
    let usual = [true, false].map(|surface| {
        let own = (0..width * height).filter(|&pixel| judged.pixels()[pixel] && is_surface.pixels()[pixel] == surface);
        let sizes: Vec<f64> = own.map(|pixel| f64::from(rest.pixels()[pixel])).collect();
        if sizes.is_empty() { 0.0 } else { deviation_of_triples(&sizes) as f32 }
    });
    let flagged = Image::from_fn(width, height, |row, column| {
        if !judged[(row, column)] {
            return false;
        }
        let (left, right) = (column.saturating_sub(1), (column + 1).min(width - 1));
        let (above, below) = (row.saturating_sub(1), (row + 1).min(height - 1));
        let across = size(model[(row, right)] - model[(row, left)]) / (right - left).max(1) as f32;
        let down = size(model[(below, column)] - model[(above, column)]) / (below - above).max(1) as f32;
        let noise = 0.5 * size(halves[0][(row, column)] - halves[1][(row, column)]);
        let usual = if is_surface[(row, column)] { usual[0] } else { usual[1] };
        let edge = EDGE_PIXELS * across.hypot(down);
        let rest = rest[(row, column)];
        rest > LEAST + edge && rest > DEVIATIONS * usual.hypot(noise) + edge
    });
    patches(&flagged, FEWEST_PIXELS)
}

#[cfg(test)]
mod tests {
    use super::super::patches::count;
    use super::*;
    use crate::math::random::SequentialRandom;

    #[test]
    fn a_patch_is_found_and_noise_and_edges_are_not() {
        let mut random = SequentialRandom::new(1);
        let mut noisy = |shift: usize, patch: bool| {
            Image::from_fn(40, 30, |row, column| {
                let base = if column >= 20 + shift { 0.7 } else { 0.3 };
                let own = if patch && (5..11).contains(&row) && (4..10).contains(&column) { 0.3 } else { 0.0 };
                Vec3::splat(base + own + 0.04 * (random.next_number() - 0.5))
            })
        };
        let (first, second) = (noisy(0, false), noisy(0, false));
        let all = Image::filled(40, 30, true);
        let of = |photo: &RgbImage| unlike_patches(photo, [&first, &second], &all, &all);
        assert_eq!(count(&of(&noisy(0, false))), 0);
        assert_eq!(count(&of(&noisy(1, false))), 0, "an edge one pixel off is no patch");
        let found = of(&noisy(0, true));
        assert!((25..60).contains(&count(&found)) && found[(8, 7)], "{}", count(&found));
    }
}
