//! The mip chain of a map in which only some texels mean something, and its exact transpose.
//!
//! A texel of level `l + 1` is the mean of the texels of level `l` under it, each by its area times its weight. A
//! texel of weight 0 (outside every chart, or seen by nobody) does not contribute; a coarse texel over nothing but
//! such texels is 0 with weight 0. For a fixed weight the chain is linear in the map, so that a gradient by any level
//! can be pulled down to the base exactly: that is what coarse-to-fine needs.
//!
//! Sides are halved and rounded down, to 1 at least. Under an odd side each coarse texel takes the fraction of the
//! texels that it covers, so that texture coordinates mean the same place on every level.

use super::linear::Linear;
use super::raster::{GreyImage, Image};
use rayon::prelude::*;

/// Up to four neighbours along an axis, and how much of each.
#[derive(Clone, Copy, Debug, Default)]
struct Taps {
    first: usize,
    count: usize,
    weight: [f32; 4],
}

impl Taps {
    fn add(&mut self, index: usize, weight: f64) {
        if self.count == 0 {
            self.first = index;
        }
        // Taps of one place are neighbours; a fifth cannot occur for a factor of at most 3.
        self.weight[self.count.min(3)] = weight as f32;
        self.count = (self.count + 1).min(4);
    }

    fn pairs(&self) -> impl Iterator<Item = (usize, f32)> {
        (0..self.count).map(|tap| (self.first + tap, self.weight[tap]))
    }
}

/// The areas shared by fine and coarse texels along one axis.
#[derive(Clone, Debug)]
struct Axis {
    /// For each coarse texel, its fine texels; the weights sum to 1.
    fine_of_coarse: Vec<Taps>,
    /// For each fine texel, its coarse texels with the same weights.
    coarse_of_fine: Vec<Taps>,
}

impl Axis {
    fn new(fine: usize, coarse: usize) -> Self {
        let mut axis =
            Axis { fine_of_coarse: vec![Taps::default(); coarse], coarse_of_fine: vec![Taps::default(); fine] };
        // In units of 1/(fine * coarse) of the side, edges are whole numbers: a fine texel is `coarse` long.
        for target in 0..coarse {
            let (start, end) = (target * fine, (target + 1) * fine);
            for source in start / coarse..end.div_ceil(coarse) {
                let shared = end.min((source + 1) * coarse) - start.max(source * coarse);
                let weight = shared as f64 / fine as f64;
                axis.fine_of_coarse[target].add(source, weight);
                axis.coarse_of_fine[source].add(target, weight);
            }
        }
        axis
    }
}

/// One step from a level to the next coarser one.
#[derive(Clone, Debug)]
struct Step {
    rows: Axis,
    columns: Axis,
}

/// The mip chain of one weight map: what is needed to build levels and to pull gradients down.
#[derive(Clone, Debug)]
pub struct MipChain {
    /// Weight of each texel of each level, level 0 first.
    weights: Vec<GreyImage>,
    steps: Vec<Step>,
}

impl MipChain {
    /// The chain over a base of this weight (finite, at least 0; what is not counts as 0), down to 1 x 1 or to
    /// `most_levels` levels with the base.
    pub fn new(weight: &GreyImage, most_levels: usize) -> Self {
        let clean = weight.map(|&value| if value.is_finite() && value > 0.0 { value } else { 0.0 });
        let mut chain = MipChain { weights: vec![clean], steps: Vec::new() };
        while let Some(fine) = chain.weights.last() {
            let (width, height) = (fine.width(), fine.height());
            if chain.weights.len() >= most_levels.max(1) || width.max(height) <= 1 || width.min(height) == 0 {
                break;
            }
            let (coarse_width, coarse_height) = ((width / 2).max(1), (height / 2).max(1));
            let step = Step { rows: Axis::new(height, coarse_height), columns: Axis::new(width, coarse_width) };
            let coarse = step.gather(coarse_width, coarse_height, |index, area| fine.pixels()[index] * area, width);
            chain.weights.push(coarse);
            chain.steps.push(step);
        }
        chain
    }

    /// Number of levels, the base included; at least 1.
    pub fn level_count(&self) -> usize {
        self.weights.len()
    }

    /// Weight of each texel of a level: the mean weight of the base under it.
    pub fn weight(&self, level: usize) -> &GreyImage {
        &self.weights[level]
    }

    /// All levels of a map, level 0 (the map itself) first.
    ///
    /// # Panics
    /// When the map is not of the size of the chain's base.
    pub fn build<T: Linear>(&self, base: &Image<T>) -> Vec<Image<T>> {
        let mut levels = vec![base.clone()];
        for level in 0..self.steps.len() {
            let next = self.coarser(level, &levels[level]);
            levels.push(next);
        }
        levels
    }

    /// Level `level + 1` of a map given its level `level`.
    ///
    /// # Panics
    /// When `fine` is not of the size of that level.
    pub fn coarser<T: Linear>(&self, level: usize, fine: &Image<T>) -> Image<T> {
        let (fine_weight, coarse_weight) = (&self.weights[level], &self.weights[level + 1]);
        assert_same_size(fine, fine_weight);
        let (step, width) = (&self.steps[level], coarse_weight.width());
        let mut coarse = Image::filled(width, coarse_weight.height(), T::ZERO);
        coarse.pixels_mut().par_chunks_mut(width).enumerate().for_each(|(row, pixels)| {
            for (column, pixel) in pixels.iter_mut().enumerate() {
                let sum = coarse_weight[(row, column)];
                if sum <= 0.0 {
                    continue;
                }
                for (fine_row, row_part) in step.rows.fine_of_coarse[row].pairs() {
                    for (fine_column, column_part) in step.columns.fine_of_coarse[column].pairs() {
                        let place = (fine_row, fine_column);
                        let weight = fine_weight[place];
                        // A texel without meaning may hold anything, a NaN as well.
                        if weight > 0.0 {
                            pixel.add_weighted(fine[place], row_part * column_part * weight / sum);
                        }
                    }
                }
            }
        });
        coarse
    }

    /// The derivative by the base from derivatives by each level: the exact transpose of [`MipChain::build`].
    ///
    /// # Panics
    /// When the levels are not those of the chain.
    pub fn pull_down<T: Linear>(&self, d_levels: &[Image<T>]) -> Image<T> {
        assert_eq!(d_levels.len(), self.level_count(), "one derivative per level");
        let mut d_level = d_levels[self.steps.len()].clone();
        for level in (0..self.steps.len()).rev() {
            let mut d_fine = d_levels[level].clone();
            self.add_finer(level, &d_level, &mut d_fine);
            d_level = d_fine;
        }
        d_level
    }

    /// Adds the transpose of [`MipChain::coarser`] applied to `d_coarse` (level `level + 1`) to `d_fine`.
    ///
    /// # Panics
    /// When an image is not of the size of its level.
    pub fn add_finer<T: Linear>(&self, level: usize, d_coarse: &Image<T>, d_fine: &mut Image<T>) {
        let (fine_weight, coarse_weight) = (&self.weights[level], &self.weights[level + 1]);
        assert_same_size(d_coarse, coarse_weight);
        assert_same_size(d_fine, fine_weight);
        let (step, width) = (&self.steps[level], fine_weight.width());
        d_fine.pixels_mut().par_chunks_mut(width).enumerate().for_each(|(row, pixels)| {
            for (column, pixel) in pixels.iter_mut().enumerate() {
                let weight = fine_weight[(row, column)];
                if weight <= 0.0 {
                    continue;
                }
                for (coarse_row, row_part) in step.rows.coarse_of_fine[row].pairs() {
                    for (coarse_column, column_part) in step.columns.coarse_of_fine[column].pairs() {
                        let place = (coarse_row, coarse_column);
                        let part = row_part * column_part * weight / coarse_weight[place];
                        pixel.add_weighted(d_coarse[place], part);
                    }
                }
            }
        });
    }
}

impl Step {
    /// The area-weighted sum of `value(index, area)` under each coarse texel.
    fn gather(&self, width: usize, height: usize, value: impl Fn(usize, f32) -> f32, fine_width: usize) -> Image<f32> {
        Image::from_fn(width, height, |row, column| {
            let mut sum = 0.0;
            for (fine_row, row_part) in self.rows.fine_of_coarse[row].pairs() {
                for (fine_column, column_part) in self.columns.fine_of_coarse[column].pairs() {
                    sum += value(fine_row * fine_width + fine_column, row_part * column_part);
                }
            }
            sum
        })
    }
}

fn assert_same_size<T, U>(image: &Image<T>, other: &Image<U>) {
    assert_eq!((image.width(), image.height()), (other.width(), other.height()), "an image of another level");
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::SequentialRandom;

    fn random_image<const N: usize>(width: usize, height: usize, random: &mut SequentialRandom) -> Image<[f32; N]> {
        Image::from_fn(width, height, |_, _| std::array::from_fn(|_| random.next_number() - 0.5))
    }

    fn dot<const N: usize>(left: &Image<[f32; N]>, right: &Image<[f32; N]>) -> f64 {
        let pairs = left.pixels().as_flattened().iter().zip(right.pixels().as_flattened());
        pairs.map(|(&a, &b)| f64::from(a) * f64::from(b)).sum()
    }

    #[test]
    fn pulling_down_is_the_exact_transpose_for_even_and_odd_sizes() {
        let mut random = SequentialRandom::new(1);
        for (width, height) in [(64, 32), (37, 51), (3, 7), (1, 9), (1, 1)] {
            let mut holes = random;
            let weight =
                Image::from_fn(width, height, |_, _| if holes.next_number() < 0.4 { 0.0 } else { holes.next_number() });
            let chain = MipChain::new(&weight, usize::MAX);
            let base = random_image::<7>(width, height, &mut random);
            let levels = chain.build(&base);
            let d_levels: Vec<_> =
                levels.iter().map(|level| random_image(level.width(), level.height(), &mut random)).collect();
            let forward: f64 = levels.iter().zip(&d_levels).map(|(level, d_level)| dot(level, d_level)).sum();
            let backward = dot(&base, &chain.pull_down(&d_levels));
            let scale: f64 = dot(&base, &base).sqrt();
            assert!((forward - backward).abs() < 1e-6 * scale.max(1.0), "{width}x{height}: {forward} {backward}");
        }
    }

    #[test]
    fn texels_without_weight_do_not_contribute_whatever_they_hold() {
        let weight = Image::from_pixels(4, 2, vec![1.0, 0.0, 0.0, 0.0, 3.0, 0.0, 0.0, f32::NAN]);
        let mut base = Image::filled(4, 2, [f32::NAN]);
        base[(0, 0)] = [2.0];
        base[(1, 0)] = [6.0];
        let chain = MipChain::new(&weight, 2);
        let levels = chain.build(&base);
        assert_eq!(chain.level_count(), 2);
        assert_eq!(levels[1].pixels(), [[5.0], [0.0]]);
        assert_eq!(chain.weight(1).pixels(), [1.0, 0.0]);
    }

    #[test]
    fn every_level_of_a_constant_is_that_constant_and_the_weighted_mean_is_kept() {
        let mut random = SequentialRandom::new(3);
        let weight = Image::from_fn(45, 27, |_, _| random.next_number());
        let base = random_image::<2>(45, 27, &mut random);
        let chain = MipChain::new(&weight, usize::MAX);
        for level in chain.build(&Image::filled(45, 27, [0.7])) {
            assert!(level.pixels().iter().all(|[value]| (value - 0.7).abs() < 1e-5));
        }
        let mean = |level: usize, image: &Image<[f32; 2]>| {
            let pairs = image.pixels().iter().zip(chain.weight(level).pixels());
            let sum: f64 = pairs.map(|(value, &weight)| f64::from(value[1]) * f64::from(weight)).sum();
            sum / chain.weight(level).pixels().iter().map(|&weight| f64::from(weight)).sum::<f64>()
        };
        let levels = chain.build(&base);
        assert_eq!((levels.last().unwrap().width(), levels.last().unwrap().height()), (1, 1));
        for (level, image) in levels.iter().enumerate() {
            assert!((mean(level, image) - mean(0, &base)).abs() < 1e-6, "level {level}");
        }
    }
}
