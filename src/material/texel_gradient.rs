//! Where the derivatives by the maps are gathered: the same chain of levels as the maps have.

use super::lobe::Material;
use super::texels::{Level, PyramidWeights, TexelPyramid};
use crate::math::real::Real;
use rayon::prelude::*;

/// The derivative of the loss by one texel, and how much stands behind it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct TexelGradient<R> {
    /// Derivative by each of the texel's numbers.
    pub d_material: Material<R>,
    /// Sum of the weights with which pixels read the texel; 0 where none did.
    pub evidence: f32,
}

impl<R: Real> TexelGradient<R> {
    /// Adds a derivative with a weight, which counts as evidence.
    #[inline(always)]
    pub fn add_weighted(&mut self, d_material: &Material<R>, weight: f32) {
        self.d_material.add_scaled(d_material, R::from_f32(weight));
        self.evidence += weight;
    }

    /// Whether nothing was added, or nothing that counts.
    fn is_zero(&self) -> bool {
        self.evidence == 0.0 && self.d_material.to_array().iter().all(|value| value.is_zero())
    }
}

/// Derivatives by the texels of all levels; level 0 is the base.
#[derive(Clone, Debug, PartialEq)]
pub struct GradientPyramid<R> {
    /// Levels from fine to coarse.
    pub levels: Vec<Level<TexelGradient<R>>>,
}

impl<R: Real> GradientPyramid<R> {
    /// A chain without derivatives, of the sizes of `weights`.
    pub fn zeros(weights: &PyramidWeights) -> Self {
        GradientPyramid { levels: Level::chain(weights) }
    }

    /// A chain without derivatives, of the sizes of these maps.
    pub fn zeros_by(maps: &TexelPyramid<R>) -> Self {
        let level = |level: &Level<Material<R>>| Level {
            width: level.width,
            height: level.height,
            texels: vec![TexelGradient::default(); level.texels.len()],
        };
        GradientPyramid { levels: maps.levels.iter().map(level).collect() }
    }

    /// The same derivatives in another number type.
    pub fn convert<S: Real>(&self, convert: impl Fn(R) -> S) -> GradientPyramid<S> {
        let texel =
            |own: &TexelGradient<R>| TexelGradient { d_material: own.d_material.map(&convert), evidence: own.evidence };
        let level = |level: &Level<TexelGradient<R>>| Level {
            width: level.width,
            height: level.height,
            texels: level.texels.iter().map(texel).collect(),
        };
        GradientPyramid { levels: self.levels.iter().map(level).collect() }
    }

    /// The exact transpose of [`TexelPyramid::rebuild`]: adds each coarse level to the finer ones and clears it, so
    /// that a gradient gathered on all levels ends on the base. Evidence reaches every child that has a share.
    pub fn pull_down(&mut self, weights: &PyramidWeights) {
        for level in (1..self.levels.len()).rev() {
            let (fine, coarse) = self.levels.split_at_mut(level);
            let (fine, coarse) = (&mut fine[level - 1], &mut coarse[0]);
            let (fine_width, coarse_width) = (fine.width, coarse.width);
            // Two fine rows belong to one coarse row, so rows of parents are independent.
            let rows = fine.texels.par_chunks_mut(2 * fine_width).zip(coarse.texels.par_chunks_mut(coarse_width));
            rows.enumerate().for_each(|(row, (fine, coarse))| {
                for (column, texel) in coarse.iter_mut().enumerate() {
                    if texel.is_zero() {
                        continue;
                    }
                    for (child, share) in weights.shares(level - 1, row * coarse_width + column) {
                        let child = &mut fine[child - 2 * row * fine_width];
                        child.d_material.add_scaled(&texel.d_material, R::from_f32(share));
                        if share != 0.0 {
                            child.evidence += texel.evidence;
                        }
                    }
                    *texel = TexelGradient::default();
                }
            });
        }
    }
}
