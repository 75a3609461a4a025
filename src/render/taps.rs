//! Where several directions read the environment.

use crate::math::sphere::BilinearTap;
use crate::math::vector::elementary::angle;
use crate::math::vector::{Vector, WIDEST};
use std::f32::consts::{PI, TAU};

/// 2^23: added to a whole number below it, it leaves the number in the low bits.
const WHOLE: f32 = 8_388_608.0;

/// Where several directions read a light bilinearly.
#[derive(Clone, Debug, Default)]
pub(super) struct Taps {
    /// The two rows and then the two columns around each: their number is in the low 23 bits.
    rows_and_columns: [[f32; WIDEST]; 4],
    /// Texels in a row.
    width: usize,
    /// Their weights, which sum to 1.
    pub weights: [[f32; WIDEST]; 4],
}

impl Taps {
    /// Number of the `k`-th texel of a direction.
    #[inline(always)]
    pub fn texel(&self, k: usize, lane: usize) -> usize {
        // Not as one float: a large light has more texels than a float has digits.
        let number = |list: usize| (self.rows_and_columns[list][lane].to_bits() & 0x007f_ffff) as usize;
        number(k / 2) * self.width + number(2 + k % 2)
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
        let (upper, lower) = (row_below.max(zero), row_below.add(one).min(V::splat(height as f32 - 1.0)));
        let (left_share, upper_share) = (one.sub(right_share), one.sub(lower_share));
        let whole = V::splat(WHOLE);
        self.width = width;
        upper.add(whole).store(&mut self.rows_and_columns[0][at..]);
        lower.add(whole).store(&mut self.rows_and_columns[1][at..]);
        left.add(whole).store(&mut self.rows_and_columns[2][at..]);
        right.add(whole).store(&mut self.rows_and_columns[3][at..]);
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
                let mut taps = Taps::default();
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

    #[test]
    fn taps_of_angles_read_large_small_and_odd_lights_up_to_a_whole_turn() {
        use crate::math::sphere::tap_of_angles;
        for (width, height) in [(7usize, 5usize), (1, 1), (16_384, 8192)] {
            let value = |texel: usize| ((texel / width) as f32 * 0.37).sin() + ((texel % width) as f32 * 0.11).cos();
            let mut taps = Taps::default();
            for step in 0..=600 {
                let phi = -PI + 3.0 * PI * step as f32 / 600.0;
                let theta = PI * ((step * 37) % 601) as f32 / 600.0;
                taps.find_at_angles(Plain::splat(phi), Plain::splat(theta), (width, height), 0);
                let exact = tap_of_angles(phi.rem_euclid(TAU), theta, width, height);
                let exact: f32 = (0..4).map(|k| value(exact.index[k] as usize) * exact.weight[k]).sum();
                let found: f32 = (0..4).map(|k| value(taps.texel(k, 3)) * taps.weights[k][3]).sum();
                // An angle is rounded to a few thousandths of the smallest texel.
                assert!((found - exact).abs() < 5e-3, "{width} at {phi}, {theta}: {found} {exact}");
            }
        }
    }
}
