//! The arithmetic of narrow lobes: weights of the places of a quadrature, and the texels of the light they read, several
//! places at a time.
//!
//! Written once over [`Vector`]; [`super::half_vector`] chooses the version at run time.

use super::half_vector::{Places, place_count, places};
use super::light_basis::{LightBasis, LightPlanes};
use super::lobe_sum::{LobePlace, LobeSums};
use super::vector::{Vector, WIDEST};
use crate::math::frame::Frame;
use glam::Vec4;
use std::f32::consts::{FRAC_PI_2, PI, TAU};

/// 2^23: added to a whole number below it, it leaves the number in the low bits.
const WHOLE: f32 = 8_388_608.0;

/// Where several directions read a light bilinearly.
struct Taps {
    /// The four texels around each: the number of a texel is in the low 23 bits.
    texels: [[f32; WIDEST]; 4],
    /// Their weights, which sum to 1.
    weights: [[f32; WIDEST]; 4],
}

impl Taps {
    const NONE: Taps = Taps { texels: [[WHOLE; WIDEST]; 4], weights: [[0.0; WIDEST]; 4] };

    /// Number of the `k`-th texel of a direction.
    #[inline(always)]
    fn texel(&self, k: usize, lane: usize) -> usize {
        (self.texels[k][lane].to_bits() & 0x007f_ffff) as usize
    }

    /// Where unit directions read a light of this size: [`crate::math::sphere::tap_of_direction`] of several.
    #[inline(always)]
    fn find<V: Vector>(&mut self, direction: [V; 3], width: usize, height: usize) {
        let (zero, one, half) = (V::splat(0.0), V::splat(1.0), V::splat(0.5));
        let columns = V::splat(width as f32);
        let [x, y, z] = direction;
        let level = z.mul_add(z, x.mul(x)).sqrt();
        let column = angle(x, zero.sub(z)).mul_add(V::splat(width as f32 / TAU), zero.sub(half));
        let row = angle(level, y).mul_add(V::splat(height as f32 / PI), zero.sub(half));
        // The whole number below, or at whole numbers either neighbour: the fraction is then 0 or 1, which reads the same.
        let (column_below, row_below) = (column.sub(half).round(), row.sub(half).round());
        let (right_share, lower_share) = (column.sub(column_below), row.sub(row_below));
        let left = zero.sub(column_below).where_positive(column_below.add(columns), column_below).max(zero);
        let next = left.add(one);
        let right = columns.sub(next).where_positive(next, zero);
        let upper = row_below.max(zero).mul_add(columns, V::splat(WHOLE));
        let lower = row_below.add(one).min(V::splat(height as f32 - 1.0)).mul_add(columns, V::splat(WHOLE));
        let (left_share, upper_share) = (one.sub(right_share), one.sub(lower_share));
        upper.add(left).store(&mut self.texels[0]);
        upper.add(right).store(&mut self.texels[1]);
        lower.add(left).store(&mut self.texels[2]);
        lower.add(right).store(&mut self.texels[3]);
        left_share.mul(upper_share).store(&mut self.weights[0]);
        right_share.mul(upper_share).store(&mut self.weights[1]);
        left_share.mul(lower_share).store(&mut self.weights[2]);
        right_share.mul(lower_share).store(&mut self.weights[3]);
    }
}

/// Angle of (x, y) in (-pi, pi], to 3e-7: Abramowitz and Stegun 1964, 4.4.49.
#[inline(always)]
fn angle<V: Vector>(y: V, x: V) -> V {
    let zero = V::splat(0.0);
    let (x_size, y_size) = (x.max(zero.sub(x)), y.max(zero.sub(y)));
    let t = x_size.min(y_size).div(x_size.max(y_size).max(V::splat(1e-30)));
    let t2 = t.mul(t);
    let series = V::splat(0.002_866_225_7)
        .mul_add(t2, V::splat(-0.016_165_737))
        .mul_add(t2, V::splat(0.042_909_614))
        .mul_add(t2, V::splat(-0.075_289_64))
        .mul_add(t2, V::splat(0.106_562_64))
        .mul_add(t2, V::splat(-0.142_089))
        .mul_add(t2, V::splat(0.199_935_51))
        .mul_add(t2, V::splat(-0.333_331_45));
    let angle = series.mul(t2).mul_add(t, t);
    let angle = y_size.sub(x_size).where_positive(V::splat(FRAC_PI_2).sub(angle), angle);
    let angle = zero.sub(x).where_positive(V::splat(PI).sub(angle), angle);
    zero.sub(y).where_positive(zero.sub(angle), angle)
}

/// `e^x - 1` for `x` in [-4, 0], with relative error below 1e-6.
#[inline(always)]
fn exp_minus_one<V: Vector>(x: V) -> V {
    // e^2x - 1 = (e^x - 1) (e^x - 1 + 2), three times.
    let t = x.mul(V::splat(0.125));
    let series = V::splat(1.0 / 5040.0)
        .mul_add(t, V::splat(1.0 / 720.0))
        .mul_add(t, V::splat(1.0 / 120.0))
        .mul_add(t, V::splat(1.0 / 24.0))
        .mul_add(t, V::splat(1.0 / 6.0))
        .mul_add(t, V::splat(0.5))
        .mul_add(t, V::splat(1.0));
    let eighth = series.mul(t);
    let two = V::splat(2.0);
    let quarter = eighth.mul(eighth.add(two));
    let half = quarter.mul(quarter.add(two));
    half.mul(half.add(two))
}

/// What all places of a lobe have in common.
struct Lobe<V> {
    normal: [V; 3],
    to_viewer: [V; 3],
    tangent: [V; 3],
    bitangent: [V; 3],
    /// `a^2 / 2`.
    exponent: V,
    /// `k` of the shadowing term, and `1 - k`.
    k: V,
    rest_of_k: V,
    /// What all weights are multiplied by.
    scale: V,
}

/// What the next places weigh, and where they read the light.
struct Next {
    taps: Taps,
    /// Weights of `S0 - S5` and of `S5`; zero below a horizon.
    base: [f32; WIDEST],
    grazing: [f32; WIDEST],
}

impl Next {
    const NONE: Next = Next { taps: Taps::NONE, base: [0.0; WIDEST], grazing: [0.0; WIDEST] };
}

impl<V: Vector> Lobe<V> {
    #[inline(always)]
    fn new(place: &LobePlace, width: f32, count: usize) -> Self {
        let LobePlace { normal, to_viewer, .. } = *place;
        let cos_out = normal.dot(to_viewer);
        let fallback = Frame::around(normal);
        let tangent = (to_viewer - normal * cos_out).try_normalize().unwrap_or(fallback.tangent);
        let bitangent = normal.cross(tangent);
        let splat = |v: glam::Vec3| [V::splat(v.x), V::splat(v.y), V::splat(v.z)];
        let k = 0.5 * width;
        let q_out = cos_out * (1.0 - k) + k;
        Lobe {
            normal: splat(normal),
            to_viewer: splat(to_viewer),
            tangent: splat(tangent),
            bitangent: splat(bitangent),
            exponent: V::splat(0.5 * width * width),
            k: V::splat(k),
            rest_of_k: V::splat(1.0 - k),
            scale: V::splat(1.0 / (q_out * count as f32)),
        }
    }

    /// Weights and taps of the places from `at`; false where all lie below a horizon.
    #[inline(always)]
    fn find(&self, basis: &LightBasis, places: &Places, at: usize, next: &mut Next) -> bool {
        let (zero, one) = (V::splat(0.0), V::splat(1.0));
        // cos - 1, exact near 1.
        let below_one = exp_minus_one(self.exponent.mul(V::load(&places.log_rest[at..])));
        let cos = one.add(below_one);
        let sin = zero.sub(below_one).mul(below_one.add(V::splat(2.0))).max(zero).sqrt();
        let along = sin.mul(V::load(&places.cos_phi[at..]));
        let across = sin.mul(V::load(&places.sin_phi[at..]));
        let mut half = [zero; 3];
        for (k, value) in half.iter_mut().enumerate() {
            *value = self.tangent[k].mul_add(along, self.bitangent[k].mul_add(across, self.normal[k].mul(cos)));
        }
        let [x, y, z] = self.to_viewer;
        let half_dot_out = half[0].mul_add(x, half[1].mul_add(y, half[2].mul(z)));
        let twice = half_dot_out.add(half_dot_out);
        let mut direction = [zero; 3];
        for (k, value) in direction.iter_mut().enumerate() {
            *value = half[k].mul_add(twice, zero.sub(self.to_viewer[k]));
        }
        let [x, y, z] = self.normal;
        let cos_in = direction[0].mul_add(x, direction[1].mul_add(y, direction[2].mul(z)));
        let above = cos_in.min(half_dot_out);
        if !above.any_positive() {
            return false;
        }
        let cos_in = cos_in.max(zero);
        let q_in = cos_in.mul_add(self.rest_of_k, self.k);
        let value = cos_in.mul(half_dot_out).mul(self.scale).div(q_in.mul(cos));
        let value = above.where_positive(value, zero);
        let rest = one.sub(half_dot_out).max(zero);
        let squared = rest.mul(rest);
        let grazing = squared.mul(squared).mul(rest).mul(value);
        value.sub(grazing).store(&mut next.base);
        grazing.store(&mut next.grazing);
        next.taps.find(direction, basis.width, basis.height);
        true
    }
}

/// [`lobe_sums`](super::half_vector::lobe_sums) with vectors of any kind.
#[inline(always)]
pub(super) fn sums_in<V: Vector>(
    basis: &LightBasis,
    place: &LobePlace,
    light: &LightPlanes,
    width: f32,
    count: usize,
) -> LobeSums {
    let places = places(count);
    let count = places.log_rest.len();
    let lobe = Lobe::<V>::new(place, width, count);
    let mut next = Next::NONE;
    let shares = &place.shares[..light.texels.len()];
    // Red, green, blue and a white light over what is seen.
    let (mut base, mut grazing) = (Vec4::ZERO, Vec4::ZERO);
    let mut whole = [0.0f32; 2];
    for at in (0..count).step_by(V::LANES) {
        if !lobe.find(basis, places, at, &mut next) {
            continue;
        }
        for lane in 0..V::LANES {
            let (own_base, own_grazing) = (next.base[lane], next.grazing[lane]);
            let mut arriving = Vec4::ZERO;
            for k in 0..4 {
                let texel = next.taps.texel(k, lane);
                arriving += light.texels[texel] * (next.taps.weights[k][lane] * f32::from(shares[texel]));
            }
            base += arriving * own_base;
            grazing += arriving * own_grazing;
            whole[0] += own_base;
            whole[1] += own_grazing;
        }
    }
    let (base, grazing) = (base * (1.0 / 255.0), grazing * (1.0 / 255.0));
    LobeSums {
        base: base.truncate().to_array(),
        grazing: grazing.truncate().to_array(),
        hidden: [(whole[0] - base.w).max(0.0), (whole[1] - grazing.w).max(0.0)],
        ..LobeSums::default()
    }
}

/// [`add_lobe_row`](super::half_vector::add_lobe_row) with vectors of any kind.
#[inline(always)]
pub(super) fn row_in<V: Vector>(basis: &LightBasis, place: &LobePlace, width: f32, scales: [f32; 2], row: &mut [f32]) {
    let places = places(place_count(basis, width));
    let count = places.log_rest.len();
    let lobe = Lobe::<V>::new(place, width, count);
    let mut next = Next::NONE;
    let shares = &place.shares[..row.len()];
    for at in (0..count).step_by(V::LANES) {
        if !lobe.find(basis, places, at, &mut next) {
            continue;
        }
        for lane in 0..V::LANES {
            let value = (scales[0] * next.base[lane] + scales[1] * next.grazing[lane]) * (1.0 / 255.0);
            for k in 0..4 {
                let texel = next.taps.texel(k, lane);
                row[texel] += value * next.taps.weights[k][lane] * f32::from(shares[texel]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::vector::Plain;
    use super::*;
    use crate::math::random::SequentialRandom;
    use crate::math::sphere::tap_of_direction;
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
                taps.find([axis(0), axis(1), axis(2)], width, height);
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
    fn exponentials_near_zero_keep_their_digits() {
        for step in 0..4000 {
            let x = -4.0 * (step as f32 / 4000.0).powi(4) - 1e-9;
            let mut found = [0.0; WIDEST];
            exp_minus_one(Plain::splat(x)).store(&mut found);
            let exact = f64::from(x).exp_m1();
            assert!((f64::from(found[0]) / exact - 1.0).abs() < 1e-6, "{x}: {} {exact}", found[0]);
        }
    }
}
