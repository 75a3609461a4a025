//! The arithmetic of narrow lobes: weights of the places of a quadrature, and the texels of the light they read, several
//! places at a time.
//!
//! Written once over [`Vector`]; [`super::half_vector`] chooses the version at run time.

use super::half_vector_places::{Places, place_count, places};
use super::light_basis::LightBasis;
use super::lobe_place::{LobePlace, LobeSums};
use crate::math::frame::Frame;
use crate::math::vector::elementary::exp_minus_one;
use crate::math::vector::{Vector, WIDEST, dot};
use crate::render::taps::Taps;
use glam::Vec4;

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
#[derive(Default)]
struct Next {
    taps: Taps,
    /// Weights of `S0 - S5` and of `S5`; zero below a horizon.
    base: [f32; WIDEST],
    grazing: [f32; WIDEST],
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
        let half_dot_out = dot(half, self.to_viewer);
        let twice = half_dot_out.add(half_dot_out);
        let mut direction = [zero; 3];
        for (k, value) in direction.iter_mut().enumerate() {
            *value = half[k].mul_add(twice, zero.sub(self.to_viewer[k]));
        }
        let cos_in = dot(direction, self.normal);
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
        next.taps.find(direction, (basis.width, basis.height), 0);
        true
    }
}

/// [`lobe_sums`](super::half_vector::lobe_sums) with vectors of any kind.
#[inline(always)]
pub(super) fn sums_in<V: Vector>(basis: &LightBasis, place: &LobePlace, width: f32, count: usize) -> LobeSums {
    let places = places(count);
    let count = places.log_rest.len();
    let lobe = Lobe::<V>::new(place, width, count);
    let mut next = Next::default();
    let seen = &place.seen.texels[..basis.count()];
    let (mut base, mut grazing) = (Vec4::ZERO, Vec4::ZERO);
    for at in (0..count).step_by(V::LANES) {
        if !lobe.find(basis, places, at, &mut next) {
            continue;
        }
        for lane in 0..V::LANES {
            let (own_base, own_grazing) = (next.base[lane], next.grazing[lane]);
            let mut arriving = Vec4::ZERO;
            for k in 0..4 {
                arriving += seen[next.taps.texel(k, lane)] * next.taps.weights[k][lane];
            }
            base += arriving * own_base;
            grazing += arriving * own_grazing;
        }
    }
    LobeSums { base: base.truncate().to_array(), grazing: grazing.truncate().to_array(), ..LobeSums::default() }
}

/// [`add_lobe_row`](super::half_vector::add_lobe_row) with vectors of any kind.
#[inline(always)]
pub(super) fn row_in<V: Vector>(basis: &LightBasis, place: &LobePlace, width: f32, scales: [f32; 2], row: &mut [f32]) {
    let places = places(place_count(basis, width));
    let count = places.log_rest.len();
    let lobe = Lobe::<V>::new(place, width, count);
    let mut next = Next::default();
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
