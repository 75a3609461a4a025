//! What can be averaged: the pixel types of filters.

use glam::Vec3;

/// A pixel that can be weighted and summed.
pub trait Linear: Copy + Send + Sync {
    /// Nothing at all.
    const ZERO: Self;
    /// Adds `weight * other`.
    fn add_weighted(&mut self, other: Self, weight: f32);
}

impl Linear for f32 {
    const ZERO: Self = 0.0;
    #[inline(always)]
    fn add_weighted(&mut self, other: Self, weight: f32) {
        *self += other * weight;
    }
}

impl Linear for Vec3 {
    const ZERO: Self = Vec3::ZERO;
    #[inline(always)]
    fn add_weighted(&mut self, other: Self, weight: f32) {
        *self += other * weight;
    }
}

impl<const N: usize> Linear for [f32; N] {
    const ZERO: Self = [0.0; N];
    #[inline(always)]
    fn add_weighted(&mut self, other: Self, weight: f32) {
        for (sum, value) in self.iter_mut().zip(other) {
            *sum += value * weight;
        }
    }
}
