//! Means over areas for showing a picture small: any size, texels without a value left out.
//!
//! A texel without a value is NaN. It takes no part in a mean, and a mean of nothing is NaN again: a small picture
//! invents nothing. [`Pyramid`] keeps halves of halves, so that zooming out reads few texels.

use super::linear::Linear;
use super::raster::{Image, RgbImage};
use crate::math::parallel;
use glam::Vec3;
use std::sync::OnceLock;

/// A texel that may be without a value.
pub trait Texel: Linear + PartialEq + std::fmt::Debug {
    /// The texel without a value.
    const UNSEEN: Self;
    /// Whether some channel is NaN.
    fn is_unseen(self) -> bool;
    /// The texel times a number.
    fn scaled(self, factor: f32) -> Self;
}

impl Texel for f32 {
    const UNSEEN: Self = f32::NAN;
    #[inline(always)]
    fn is_unseen(self) -> bool {
        self.is_nan()
    }
    #[inline(always)]
    fn scaled(self, factor: f32) -> Self {
        self * factor
    }
}

impl Texel for Vec3 {
    const UNSEEN: Self = Vec3::NAN;
    #[inline(always)]
    fn is_unseen(self) -> bool {
        self.is_nan()
    }
    #[inline(always)]
    fn scaled(self, factor: f32) -> Self {
        self * factor
    }
}

/// The texels along one axis that lie in an interval, and how much of each.
#[derive(Clone, Debug, PartialEq)]
pub struct Footprint {
    /// Index of the first texel.
    pub first: usize,
    /// Length shared with each texel, in texels.
    pub weights: Vec<f32>,
}

impl Footprint {
    /// The texels of an axis of `count` texels under `start..end`, in texels; cut at the border. It is never empty: an
    /// interval beside the axis, or without length, takes the nearest texel whole. `count` is at least 1.
    pub fn new(start: f64, end: f64, count: usize) -> Self {
        let (start, end) = (start.clamp(0.0, count as f64), end.clamp(0.0, count as f64));
        let first = (start as usize).min(count - 1);
        let last = (end.ceil() as usize).clamp(first + 1, count);
        let shared = |index: usize| (end.min((index + 1) as f64) - start.max(index as f64)) as f32;
        let weights: Vec<f32> = (first..last).map(shared).collect();
        // A sliver of a texel is rounding.
        let sliver = |weight: f32| !(weight > 1e-5 * (end - start) as f32);
        let keep_from = weights.iter().take_while(|&&weight| sliver(weight)).count();
        let keep_to = weights.len() - weights.iter().rev().take_while(|&&weight| sliver(weight)).count();
        if keep_from >= keep_to {
            return Footprint { first, weights: vec![1.0] };
        }
        Footprint { first: first + keep_from, weights: weights[keep_from..keep_to].to_vec() }
    }

    /// The footprints of `target` equal parts of an axis of `count` texels.
    pub fn parts(count: usize, target: usize) -> Vec<Self> {
        let edge = |part: usize| part as f64 * count as f64 / target as f64;
        (0..target).map(|part| Footprint::new(edge(part), edge(part + 1), count)).collect()
    }
}

/// The mean of the texels with a value under a footprint.
#[inline]
pub fn mean_under<T: Texel>(row: &Footprint, column: &Footprint, texel: impl Fn(usize, usize) -> T) -> T {
    if let ([_], [_]) = (&row.weights[..], &column.weights[..]) {
        return texel(row.first, column.first);
    }
    let (mut sum, mut total) = (T::ZERO, 0.0);
    for (row_step, row_weight) in row.weights.iter().enumerate() {
        for (column_step, column_weight) in column.weights.iter().enumerate() {
            let value = texel(row.first + row_step, column.first + column_step);
            if !value.is_unseen() {
                let weight = row_weight * column_weight;
                sum.add_weighted(value, weight);
                total += weight;
            }
        }
    }
    if total > 0.0 { sum.scaled(1.0 / total) } else { T::UNSEEN }
}

/// A picture of `width x height` of which each pixel is the mean over the area it covers in the source, given by its
/// size and a function of (row, column). A source without texels gives texels without a value.
pub fn area_mean_of<T: Texel>(
    source_size: (usize, usize),
    texel: impl Fn(usize, usize) -> T + Sync,
    width: usize,
    height: usize,
) -> Image<T> {
    let mut small = Image::filled(width, height, T::UNSEEN);
    if source_size.0 == 0 || source_size.1 == 0 || width == 0 || height == 0 {
        return small;
    }
    let (columns, rows) = (Footprint::parts(source_size.0, width), Footprint::parts(source_size.1, height));
    parallel::each_chunk(small.pixels_mut(), width, &|row, pixels| {
        for (pixel, column) in pixels.iter_mut().zip(&columns) {
            *pixel = mean_under(&rows[row], column, &texel);
        }
    });
    small
}

/// [`area_mean_of`] a picture.
pub fn area_mean<T: Texel>(image: &Image<T>, width: usize, height: usize) -> Image<T> {
    area_mean_of((image.width(), image.height()), |row, column| image[(row, column)], width, height)
}

/// The size of a thumbnail: the longer side at most `most_side`, never enlarged, at least 1 x 1 of what has texels.
pub fn thumbnail_size(width: usize, height: usize, most_side: usize) -> (usize, usize) {
    let longer = width.max(height);
    if longer <= most_side || longer == 0 {
        return (width, height);
    }
    let side = |side: usize| ((side * most_side + longer / 2) / longer).max(side.min(1));
    (side(width), side(height))
}

/// A picture made small in linear radiance: the longer side at most `most_side`.
pub fn thumbnail(image: &RgbImage, most_side: usize) -> RgbImage {
    thumbnail_of((image.width(), image.height()), |row, column| image[(row, column)], most_side)
}

/// [`thumbnail`] of anything with a size and a radiance at (row, column), such as an 8-bit photograph, without making
/// the linear picture first.
pub fn thumbnail_of(
    source_size: (usize, usize),
    texel: impl Fn(usize, usize) -> Vec3 + Sync,
    most_side: usize,
) -> RgbImage {
    let (width, height) = thumbnail_size(source_size.0, source_size.1, most_side);
    area_mean_of(source_size, texel, width, height)
}

/// Halves of halves of a picture, each made when it is first asked for.
#[derive(Debug)]
pub struct Pyramid<T> {
    coarser: Vec<OnceLock<Image<T>>>,
}

impl<T: Texel> Pyramid<T> {
    /// The pyramid of a picture of this size; nothing is computed yet.
    pub fn new(width: usize, height: usize) -> Self {
        let levels = width.max(height).max(1).ilog2() as usize;
        Pyramid { coarser: (0..levels).map(|_| OnceLock::new()).collect() }
    }

    /// The coarsest level of which a texel is at most `texels` texels of the picture wide; 0 is the picture.
    pub fn level_for(&self, texels: f64) -> usize {
        if texels >= 2.0 { (texels.log2() as usize).min(self.coarser.len()) } else { 0 }
    }

    /// A level, by halving as often as it was not done before; `base` is level 0 and always the same picture. Beyond
    /// the last level it is the last.
    pub fn level<'a>(&'a self, base: &'a Image<T>, level: usize) -> &'a Image<T> {
        let mut image = base;
        for slot in self.coarser.iter().take(level) {
            let fine = image;
            let half = |side: usize| if side == 0 { 0 } else { (side / 2).max(1) };
            image = slot.get_or_init(|| area_mean(fine, half(fine.width()), half(fine.height())));
        }
        image
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_exact_at_any_size_and_leave_out_what_was_not_seen() {
        let ramp = Image::from_fn(7, 5, |row, column| (row * 7 + column) as f32);
        assert_eq!(area_mean(&ramp, 7, 5), ramp);
        assert!((area_mean(&ramp, 1, 1)[(0, 0)] - 17.0).abs() < 1e-5);
        // Three parts of seven columns: the first covers 0, 1 and a third of 2.
        let expected = (0.0 + 1.0 + 2.0 / 3.0) / (7.0 / 3.0) + 14.0;
        assert!((area_mean(&ramp, 3, 1)[(0, 0)] - expected).abs() < 1e-4);
        let mut holes = ramp.clone();
        holes.pixels_mut().iter_mut().skip(1).for_each(|value| *value = f32::NAN);
        let small = area_mean(&holes, 2, 2);
        assert_eq!(small[(0, 0)], 0.0);
        assert!(small[(1, 1)].is_nan() && small[(0, 1)].is_nan());
    }

    #[test]
    fn thumbnails_keep_the_shape_and_bear_any_size() {
        for (width, height, expected) in
            [(4000, 3000, (64, 48)), (8192, 16, (64, 1)), (3, 2, (3, 2)), (0, 0, (0, 0)), (0, 9, (0, 9))]
        {
            assert_eq!(thumbnail_size(width, height, 64), expected);
        }
        assert_eq!(thumbnail(&RgbImage::default(), 8).pixels().len(), 0);
        let constant = thumbnail(&Image::filled(97, 31, Vec3::new(0.25, 1.0, 9.0)), 10);
        assert!(constant.pixels().iter().all(|pixel| pixel.abs_diff_eq(Vec3::new(0.25, 1.0, 9.0), 1e-5)));
    }

    #[test]
    fn a_pyramid_keeps_the_mean_and_ends_at_one_texel() {
        let base = Image::from_fn(64, 32, |row, column| ((row * 31 + column * 17) % 13) as f32);
        let pyramid = Pyramid::new(64, 32);
        let mean = |image: &Image<f32>| image.pixels().iter().sum::<f32>() / image.pixels().len() as f32;
        for level in 0..9 {
            assert!((mean(pyramid.level(&base, level)) - mean(&base)).abs() < 1e-4, "level {level}");
        }
        assert_eq!(pyramid.level(&base, 99).pixels().len(), 1);
        assert_eq!([0.1, 1.0, 1.9, 2.0, 7.9, 8.0, 1e9].map(|texels| pyramid.level_for(texels)), [0, 0, 0, 1, 2, 3, 6]);
    }
}
