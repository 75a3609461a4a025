//! The maps as the tracer fetches them: the seven numbers of a texel side by side, with a mip chain.
//!
//! Coarse levels are coverage-weighted means of their children, so that texels outside every chart never leak into a
//! footprint. The weights are fixed, hence each level is a linear function of the base, and a gradient gathered on any
//! level is pulled down to the base exactly.

use super::lobe::{LobeModel, MIN_WIDTH, Material};
use super::maps::MaterialMaps;
use crate::image::Image;
use crate::math::elementary;
use crate::math::parallel;
use crate::math::real::Real;
use glam::{Vec2, Vec3};

/// One level of a chain.
#[derive(Clone, Debug, PartialEq)]
pub struct Level<T> {
    /// Width in texels.
    pub width: usize,
    /// Height in texels.
    pub height: usize,
    /// Row-major texels.
    pub texels: Vec<T>,
}

/// A mip chain of materials; level 0 is the base.
#[derive(Clone, Debug, PartialEq)]
pub struct TexelPyramid<R> {
    /// Levels from fine to coarse.
    pub levels: Vec<Level<Material<R>>>,
    /// The lobe that specular reflectance and width are meant for.
    pub model: LobeModel,
}

/// The fixed weights of the chain: which share of a parent each child has.
#[derive(Clone, Debug, PartialEq)]
pub struct PyramidWeights {
    /// Coverage of each texel, level by level, in [0, 1].
    coverage: Vec<Vec<f32>>,
    sizes: Vec<(usize, usize)>,
}

/// Four texels of one level and their bilinear weights.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TextureTap {
    /// Level of the chain.
    pub level: u32,
    /// Row-major indices on that level.
    pub index: [u32; 4],
    /// Weights, summing to 1.
    pub weight: [f32; 4],
}

impl TextureTap {
    /// The tap at a texture coordinate (v up) on a level of `width x height`; clamped at the border.
    #[inline]
    pub fn at(uv: Vec2, level: u32, width: usize, height: usize) -> Self {
        // Clamping makes any coordinate a valid texel; the whole part of NaN is 0.
        let x = (uv.x * width as f32 - 0.5).clamp(-1.0, width as f32);
        let y = ((1.0 - uv.y) * height as f32 - 0.5).clamp(-1.0, height as f32);
        let (x_floor, y_floor) = (elementary::floor(x), elementary::floor(y));
        let (x_fraction, y_fraction) = (x - x_floor as f32, y - y_floor as f32);
        let column = |x: i32| x.clamp(0, width as i32 - 1) as u32;
        let row = |y: i32| y.clamp(0, height as i32 - 1) as u32 * width as u32;
        let (left, right) = (column(x_floor), column(x_floor + 1));
        let (upper, lower) = (row(y_floor), row(y_floor + 1));
        TextureTap {
            level,
            index: [upper + left, upper + right, lower + left, lower + right],
            weight: [
                (1.0 - x_fraction) * (1.0 - y_fraction),
                x_fraction * (1.0 - y_fraction),
                (1.0 - x_fraction) * y_fraction,
                x_fraction * y_fraction,
            ],
        }
    }
}

impl PyramidWeights {
    /// Weights for maps of this coverage, with at most `max_levels` levels. The chain ends at an odd size.
    pub fn new(covered: &Image<bool>, max_levels: usize) -> Self {
        let mut sizes = vec![(covered.width(), covered.height())];
        let mut coverage: Vec<Vec<f32>> =
            vec![covered.pixels().iter().map(|&covered| if covered { 1.0 } else { 0.0 }).collect()];
        while sizes.len() < max_levels.max(1) {
            let (width, height) = sizes[sizes.len() - 1];
            if width % 2 == 1 || height % 2 == 1 {
                break;
            }
            let fine = &coverage[coverage.len() - 1];
            let coarse = (0..width * height / 4)
                .map(|index| children(index, width).iter().map(|&child| fine[child]).sum::<f32>() * 0.25)
                .collect();
            coverage.push(coarse);
            sizes.push((width / 2, height / 2));
        }
        PyramidWeights { coverage, sizes }
    }

    /// Weights of a single level of this size.
    pub fn flat(width: usize, height: usize) -> Self {
        PyramidWeights { coverage: vec![vec![1.0; width * height]], sizes: vec![(width, height)] }
    }

    /// Number of levels.
    pub fn level_count(&self) -> usize {
        self.sizes.len()
    }

    /// Width and height of a level in texels.
    pub fn size(&self, level: usize) -> (usize, usize) {
        self.sizes[level]
    }

    /// Whether a texel of the base lies in a chart.
    pub fn is_covered(&self, index: usize) -> bool {
        self.coverage[0][index] > 0.0
    }

    /// (level, index) of a base texel and of the texels of coarser levels that it has a share in, from fine to coarse.
    pub fn ancestors(&self, base_index: usize) -> impl Iterator<Item = (usize, usize)> + '_ {
        let (row, column) = (base_index / self.sizes[0].0, base_index % self.sizes[0].0);
        let index = move |level: usize| (row >> level) * self.sizes[level].0 + (column >> level);
        let has_share = move |level: usize| {
            let own = index(level - 1);
            self.shares(level - 1, index(level)).iter().any(|&(child, share)| child == own && share > 0.0)
        };
        (0..self.sizes.len())
            .take_while(move |&level| level == 0 || has_share(level))
            .map(move |level| (level, index(level)))
    }

    /// The share each of a parent's four children has in it. A parent without coverage averages its children evenly.
    pub(super) fn shares(&self, level: usize, parent: usize) -> [(usize, f32); 4] {
        let own = children(parent, self.sizes[level].0);
        let coverage = own.map(|child| self.coverage[level][child]);
        let sum: f32 = coverage.iter().sum();
        std::array::from_fn(|k| (own[k], if sum > 0.0 { coverage[k] / sum } else { 0.25 }))
    }
}

/// The texel of a coarse level that stands for its four children on `level`.
fn mean_of_children<R: Real>(
    fine: &[Material<R>],
    weights: &PyramidWeights,
    level: usize,
    parent: usize,
) -> Material<R> {
    let mut sum = Material::default();
    for (child, share) in weights.shares(level, parent) {
        sum.add_scaled(&fine[child], R::from_f32(share));
    }
    sum
}

/// Indices of the four children of texel `parent`; `width` is that of the finer level.
fn children(parent: usize, width: usize) -> [usize; 4] {
    let half = width / 2;
    let first = parent / half * 2 * width + parent % half * 2;
    [first, first + 1, first + width, first + width + 1]
}

impl<T: Clone + Default> Level<T> {
    /// A chain of levels with nothing in any texel, of the sizes of `weights`.
    pub(super) fn chain(weights: &PyramidWeights) -> Vec<Self> {
        let level =
            |&(width, height): &(usize, usize)| Level { width, height, texels: vec![T::default(); width * height] };
        weights.sizes.iter().map(level).collect()
    }
}

impl<R: Real> TexelPyramid<R> {
    /// A chain over base texels of the size of `weights`, for [`LobeModel::BlinnPhong`].
    pub fn from_base(texels: Vec<Material<R>>, weights: &PyramidWeights) -> Self {
        let mut pyramid = TexelPyramid { levels: Level::chain(weights), model: LobeModel::BlinnPhong };
        pyramid.levels[0].texels = texels;
        pyramid.rebuild(weights);
        pyramid
    }

    /// The same numbers, meant for another lobe.
    pub fn with_model(self, model: LobeModel) -> Self {
        TexelPyramid { model, ..self }
    }

    /// Recomputes every coarse level from the base.
    pub fn rebuild(&mut self, weights: &PyramidWeights) {
        for level in 1..self.levels.len() {
            let (fine, coarse) = self.levels.split_at_mut(level);
            let fine = &fine[level - 1].texels;
            parallel::each_chunk(&mut coarse[0].texels, 1 << 13, &|chunk, texels| {
                for (texel, parent) in texels.iter_mut().zip(chunk << 13..) {
                    *texel = mean_of_children(fine, weights, level - 1, parent);
                }
            });
        }
    }

    /// Recomputes the texels of the coarse levels that a base texel is a part of: what
    /// [`TexelPyramid::rebuild`] does when that one texel has changed.
    pub fn rebuild_above(&mut self, weights: &PyramidWeights, base_index: usize) {
        for (level, parent) in weights.ancestors(base_index).skip(1) {
            let (fine, coarse) = self.levels.split_at_mut(level);
            coarse[0].texels[parent] = mean_of_children(&fine[level - 1].texels, weights, level - 1, parent);
        }
    }

    /// The material at a tap.
    #[inline(always)]
    pub fn fetch(&self, tap: &TextureTap) -> Material<R> {
        let texels = &self.levels[tap.level as usize].texels;
        let mut sum = Material::default();
        for k in 0..4 {
            sum.add_scaled(&texels[tap.index[k] as usize], R::from_f32(tap.weight[k]));
        }
        sum
    }

    /// The tap at a texture coordinate on a level; the level is clamped to those there are.
    #[inline]
    pub fn tap(&self, uv: Vec2, level: u32) -> TextureTap {
        let level = level.min(self.levels.len() as u32 - 1);
        let Level { width, height, .. } = self.levels[level as usize];
        TextureTap::at(uv, level, width, height)
    }

    /// The chain in another number type, without derivatives.
    pub fn convert<S: Real>(&self, convert: impl Fn(R) -> S) -> TexelPyramid<S> {
        let level = |level: &Level<Material<R>>| Level {
            width: level.width,
            height: level.height,
            texels: level.texels.iter().map(|texel| texel.map(&convert)).collect(),
        };
        TexelPyramid { levels: self.levels.iter().map(level).collect(), model: self.model }
    }
}

/// Row and column of the texel that holds a texture coordinate (v up), on a map of `width x height`.
pub fn texel_of_uv(uv: Vec2, width: usize, height: usize) -> (usize, usize) {
    let along = |place: f32, count: usize| ((place * count as f32) as usize).min(count.saturating_sub(1));
    (along(1.0 - uv.y, height), along(uv.x, width))
}

/// Base texels of maps as files hold them.
pub fn texels_from_maps(maps: &MaterialMaps) -> Vec<Material<f32>> {
    let pixels = maps.diffuse.pixels().iter().zip(maps.specular.pixels()).zip(maps.roughness.pixels());
    pixels.map(|((&diffuse, &specular), &roughness)| Material::from_maps(diffuse, specular, roughness)).collect()
}

/// Maps as files hold them, of base texels.
pub fn maps_from_texels(texels: &[Material<f32>], width: usize, height: usize) -> MaterialMaps {
    let image = |colour: fn(&Material<f32>) -> [f32; 3]| {
        Image::from_pixels(width, height, texels.iter().map(|texel| Vec3::from_array(colour(texel))).collect())
    };
    let roughness = texels.iter().map(|texel| (2.0 * texel.log_width.clamp(MIN_WIDTH.ln(), 0.0)).exp()).collect();
    MaterialMaps {
        diffuse: image(|texel| texel.diffuse),
        specular: image(|texel| texel.specular),
        roughness: Image::from_pixels(width, height, roughness),
    }
}

#[cfg(test)]
mod tests;
