//! The gradients that one chunk of pixels adds up, in a small table of its own.

use crate::material::{Material, TexelGradient, TextureTap};
use crate::math::real::Real;
use crate::math::sphere::BilinearTap;
use crate::render::sums::{GradientSink, ParameterGradient};

/// Gradients of one chunk: an open-addressing table of texels and a dense light.
pub(super) struct ChunkGradient<R> {
    /// `level << 28 | index`, or `EMPTY`.
    keys: Vec<u32>,
    texels: Vec<TexelGradient<R>>,
    used: usize,
    light: Vec<[R; 3]>,
}

const EMPTY: u32 = u32::MAX;
const LEVEL_SHIFT: u32 = 28;

impl<R: Real> ChunkGradient<R> {
    pub(super) fn new(light_texels: usize) -> Self {
        ChunkGradient {
            keys: vec![EMPTY; 1 << 13],
            texels: vec![TexelGradient::default(); 1 << 13],
            used: 0,
            light: vec![[R::zero(); 3]; light_texels],
        }
    }

    #[inline(always)]
    fn texel(&mut self, key: u32) -> &mut TexelGradient<R> {
        let mask = self.keys.len() - 1;
        let mut slot = (key.wrapping_mul(0x9e37_79b1) >> 7) as usize & mask;
        loop {
            if self.keys[slot] == key {
                return &mut self.texels[slot];
            }
            if self.keys[slot] == EMPTY {
                break;
            }
            slot = (slot + 1) & mask;
        }
        if self.used * 4 >= self.keys.len() * 3 {
            self.grow();
            return self.texel(key);
        }
        self.used += 1;
        self.keys[slot] = key;
        &mut self.texels[slot]
    }

    #[cold]
    fn grow(&mut self) {
        let keys = std::mem::take(&mut self.keys);
        let texels = std::mem::take(&mut self.texels);
        self.keys = vec![EMPTY; keys.len() * 2];
        self.texels = vec![TexelGradient::default(); keys.len() * 2];
        self.used = 0;
        for (key, texel) in keys.into_iter().zip(texels) {
            if key != EMPTY {
                *self.texel(key) = texel;
            }
        }
    }

    pub(super) fn add_to(&self, gradient: &mut ParameterGradient<R>) {
        for (&key, texel) in self.keys.iter().zip(&self.texels) {
            if key != EMPTY {
                let level = &mut gradient.texels.levels[(key >> LEVEL_SHIFT) as usize];
                let total = &mut level.texels[(key & ((1 << LEVEL_SHIFT) - 1)) as usize];
                total.d_material.add(&texel.d_material);
                total.evidence += texel.evidence;
            }
        }
        for (total, light) in gradient.light.iter_mut().zip(&self.light) {
            for channel in 0..3 {
                total[channel] += light[channel];
            }
        }
    }
}

impl<R: Real> GradientSink<R> for ChunkGradient<R> {
    #[inline(always)]
    fn add_material(&mut self, tap: &TextureTap, d_material: &Material<R>) {
        for k in 0..4 {
            self.texel(tap.level << LEVEL_SHIFT | tap.index[k]).add_weighted(d_material, tap.weight[k]);
        }
    }

    #[inline(always)]
    fn add_light(&mut self, tap: &BilinearTap, d_radiance: [R; 3]) {
        for k in 0..4 {
            let weight = R::from_f32(tap.weight[k]);
            let light = &mut self.light[tap.index[k] as usize];
            for channel in 0..3 {
                light[channel] += d_radiance[channel] * weight;
            }
        }
    }
}
