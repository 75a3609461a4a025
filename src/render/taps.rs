//! Where several directions read the environment.

use crate::math::sphere::BilinearTap;
use crate::math::vector::elementary::angle;
use crate::math::vector::{Vector, WIDEST};
use std::f32::consts::{PI, TAU};

/// 2^23: added to a whole number below it, it leaves the number in the low bits.
const WHOLE: f32 = 8_388_608.0;

/// Where several directions read a light bilinearly.
#[derive(Clone, Debug)]
pub(super) struct Taps {
    /// The four texels around each: the number of a texel is in the low 23 bits.
    texels: [[f32; WIDEST]; 4],
    /// Their weights, which sum to 1.
    pub weights: [[f32; WIDEST]; 4],
}

impl Taps {
    /// No directions.
    pub const NONE: Taps = Taps { texels: [[WHOLE; WIDEST]; 4], weights: [[0.0; WIDEST]; 4] };

    /// Number of the `k`-th texel of a direction.
    #[inline(always)]
    pub fn texel(&self, k: usize, lane: usize) -> usize {
        (self.texels[k][lane].to_bits() & 0x007f_ffff) as usize
    }

    /// The tap of one direction.
    #[inline(always)]
    pub fn tap(&self, lane: usize) -> BilinearTap {
        BilinearTap {
            index: [0, 1, 2, 3].map(|k| self.texel(k, lane) as u32),
            weight: [0, 1, 2, 3].map(|k| self.weights[k][lane]),
        }
    }

    /// Where unit directions read a light of this size, written from place `at` on:
    /// [`crate::math::sphere::tap_of_direction`] of several.
    #[inline(always)]
    pub fn find<V: Vector>(&mut self, direction: [V; 3], size: (usize, usize), at: usize) {
        let zero = V::splat(0.0);
        let [x, y, z] = direction;
        let level = z.mul_add(z, x.mul(x)).sqrt();
        self.find_at_angles(angle(x, zero.sub(z)), angle(level, y), size, at);
    }

    /// [`Taps::find`] of directions by their angles: phi from -pi to 2 pi, theta from 0 to pi.
    #[inline(always)]
    pub fn find_at_angles<V: Vector>(&mut self, phi: V, theta: V, (width, height): (usize, usize), at: usize) {
        let (zero, one, half) = (V::splat(0.0), V::splat(1.0), V::splat(0.5));
        let columns = V::splat(width as f32);
        let column = phi.mul_add(V::splat(width as f32 / TAU), zero.sub(half));
        let row = theta.mul_add(V::splat(height as f32 / PI), zero.sub(half));
        // The whole number below, or at whole numbers either neighbour: the fraction is then 0 or 1, which reads the same.
        let (column_below, row_below) = (column.sub(half).round(), row.sub(half).round());
        let (right_share, lower_share) = (column.sub(column_below), row.sub(row_below));
        let left = zero.sub(column_below).where_positive(column_below.add(columns), column_below).max(zero);
        let next = left.add(one);
        let right = columns.sub(next).where_positive(next, zero);
        let upper = row_below.max(zero).mul_add(columns, V::splat(WHOLE));
        let lower = row_below.add(one).min(V::splat(height as f32 - 1.0)).mul_add(columns, V::splat(WHOLE));
        let (left_share, upper_share) = (one.sub(right_share), one.sub(lower_share));
        upper.add(left).store(&mut self.texels[0][at..]);
        upper.add(right).store(&mut self.texels[1][at..]);
        lower.add(left).store(&mut self.texels[2][at..]);
        lower.add(right).store(&mut self.texels[3][at..]);
        left_share.mul(upper_share).store(&mut self.weights[0][at..]);
        right_share.mul(upper_share).store(&mut self.weights[1][at..]);
        left_share.mul(lower_share).store(&mut self.weights[2][at..]);
        right_share.mul(lower_share).store(&mut self.weights[3][at..]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::SequentialRandom;
    use crate::math::sphere::tap_of_direction;
    use crate::math::vector::Plain;
    use glam::Vec3;

    #[test]
    fn taps_of_several_directions_read_what_exact_ones_do() {
        let mut random = SequentialRandom::new(5);
        for (width, height) in [(64usize, 32usize), (1, 1), (2, 1), (5, 3)] {
            let values: Vec<f32> = (0..width * height).map(|_| random.next_number()).collect();
            let mut directions: Vec<Vec3> = (0..20_000)
                .map(|_| Vec3::from_array([(); 3].map(|()| 2.0 * random.next_number() - 1.0)).normalize_or(Vec3::Y))
                .collect();
            directions.extend([Vec3::Y, Vec3::NEG_Y, Vec3::X, Vec3::NEG_X, Vec3::Z, Vec3::NEG_Z, Vec3::Y, Vec3::Y]);
            for eight in directions.chunks_exact(Plain::LANES) {
                let axis = |k: usize| Plain::load(&eight.iter().map(|direction| direction[k]).collect::<Vec<_>>());
                let mut taps = Taps::NONE;
                taps.find([axis(0), axis(1), axis(2)], (width, height), 0);
                for (lane, &direction) in eight.iter().enumerate() {
                    let tap = tap_of_direction(direction, width, height);
                    let exact: f32 = (0..4).map(|k| values[tap.index[k] as usize] * tap.weight[k]).sum();
                    let found: f32 = (0..4).map(|k| values[taps.texel(k, lane)] * taps.weights[k][lane]).sum();
                    // At a pole any azimuth is as good.
                    if direction.y.abs() < 1.0 {
                        assert!((found - exact).abs() < 3e-5, "{width} {direction}: {found} {exact}");
                    }
                }
            }
        }
    }
}
