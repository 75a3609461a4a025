//! Smoothing that leaves out pixels which say nothing.

use crate::image::{Image, RgbImage};
use glam::Vec3;

/// A picture under a Gaussian of standard deviation `sigma` in pixels, over the pixels of `valid` alone; 0 where none is
/// within three standard deviations.
pub fn smoothed(picture: &RgbImage, valid: &Image<bool>, sigma: f32) -> RgbImage {
    let (width, height) = (picture.width(), picture.height());
    let radius = (3.0 * sigma).ceil() as usize;
    let kernel: Vec<f32> = (0..=radius).map(|x| (-0.5 * (x as f32 / sigma).powi(2)).exp()).collect();
    let start = Image::from_fn(width, height, |row, column| match valid[(row, column)] {
        true => picture[(row, column)].extend(1.0),
        false => glam::Vec4::ZERO,
    });
    let around = |centre: usize, size: usize| centre.saturating_sub(radius)..(centre + radius + 1).min(size);
    let across = Image::from_fn(width, height, |row, column| {
        around(column, width).map(|x| start[(row, x)] * kernel[x.abs_diff(column)]).sum::<glam::Vec4>()
    });
    Image::from_fn(width, height, |row, column| {
        let sum = around(row, height).map(|y| across[(y, column)] * kernel[y.abs_diff(row)]).sum::<glam::Vec4>();
        if sum.w > 1e-6 { sum.truncate() / sum.w } else { Vec3::ZERO }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_says_nothing_leaves_no_trace() {
        let mut picture = Image::filled(9, 7, Vec3::splat(0.25));
        let mut valid = Image::filled(9, 7, true);
        picture[(3, 4)] = Vec3::splat(1e9);
        valid[(3, 4)] = false;
        let smooth = smoothed(&picture, &valid, 1.0);
        assert!(smooth.pixels().iter().all(|pixel| (*pixel - Vec3::splat(0.25)).length() < 1e-6));
        let nothing = smoothed(&picture, &Image::filled(9, 7, false), 1.0);
        assert!(nothing.pixels().iter().all(|pixel| *pixel == Vec3::ZERO));
    }
}
