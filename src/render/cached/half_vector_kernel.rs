//! The arithmetic of narrow lobes: weights of the places of a quadrature, and the texels of the light they read, several
//! places at a time.
//!
//! Written once over [`Vector`]; [`super::half_vector`] chooses the version at run time.

use super::half_vector_places::{Places, place_count, places};
use super::light_basis::LightBasis;
use super::lobe_place::{LEAST_SHADOWING, LobePlace, LobeSums, MIDDLE_TANGENT};
use crate::material::LobeModel;
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
    /// What all weights are multiplied by.
    scale: V,
    microfacets: Microfacets<V>,
}

/// Terms of a lobe's microfacets.
enum Microfacets<V> {
    /// Half of `a^2`; `k` of the shadowing term, and `1 - k`.
    BlinnPhong { exponent: V, k: V, rest_of_k: V },
    /// `a^2`, `1 - a^2`, `n.o`, `R(n.o)`, and one over the square of [`MIDDLE_TANGENT`], or 0 where tails are wanted too.
    Ggx { width_squared: V, rest: V, cos_out: V, root_out: V, middle: V },
}

/// Which part of a lobe is wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Without the tails of GGX, which are summed over hats.
    Middle,
    /// All of it.
    Whole,
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
    fn new(place: &LobePlace, width: f32, count: usize, part: Part) -> Self {
        let LobePlace { normal, to_viewer, .. } = *place;
        let cos_out = normal.dot(to_viewer);
        let fallback = Frame::around(normal);
        let tangent = (to_viewer - normal * cos_out).try_normalize().unwrap_or(fallback.tangent);
        let bitangent = normal.cross(tangent);
        let splat = |v: glam::Vec3| [V::splat(v.x), V::splat(v.y), V::splat(v.z)];
        let width_squared = width * width;
        let (divisor, microfacets) = match place.model {
            LobeModel::BlinnPhong => {
                let k = 0.5 * width;
                let terms = [0.5 * width_squared, k, 1.0 - k];
                let [exponent, k_of_all, rest_of_k] = terms.map(V::splat);
                let q_out = cos_out * (1.0 - k) + k;
                (q_out, Microfacets::BlinnPhong { exponent, k: k_of_all, rest_of_k })
            }
            LobeModel::Ggx => {
                let root_out = (width_squared + (1.0 - width_squared) * cos_out * cos_out).sqrt();
                let middle = match part {
                    Part::Middle => MIDDLE_TANGENT.powi(-2),
                    Part::Whole => 0.0,
                };
                let terms = [width_squared, 1.0 - width_squared, cos_out, root_out, middle];
                let [width_squared, rest, cos_out, root_out, middle] = terms.map(V::splat);
                (0.5, Microfacets::Ggx { width_squared, rest, cos_out, root_out, middle })
            }
        };
        Lobe {
            normal: splat(normal),
            to_viewer: splat(to_viewer),
            tangent: splat(tangent),
            bitangent: splat(bitangent),
            scale: V::splat(1.0 / (divisor * count as f32)),
            microfacets,
        }
    }

    /// Weights and taps of the places from `at`; false where all lie below a horizon.
    #[inline(always)]
    fn find(&self, basis: &LightBasis, places: &Places, at: usize, next: &mut Next) -> bool {
        let (zero, one) = (V::splat(0.0), V::splat(1.0));
        let (sin, cos, share) = match &self.microfacets {
            Microfacets::BlinnPhong { exponent, .. } => {
                // cos - 1, exact near 1.
                let below_one = exp_minus_one(exponent.mul(V::load(&places.log_rest[at..])));
                let sin = zero.sub(below_one).mul(below_one.add(V::splat(2.0))).max(zero).sqrt();
                (sin, one.add(below_one), one)
            }
            Microfacets::Ggx { width_squared, middle, .. } => {
                // tan^2 = a^2 u / (1 - u).
                let rest = V::load(&places.rest[at..]);
                let tangent_squared = width_squared.mul(one.sub(rest)).div(rest);
                let cos_squared = one.div(one.add(tangent_squared));
                let relative = tangent_squared.mul(*middle);
                let share = one.div(relative.mul_add(relative, one));
                (tangent_squared.mul(cos_squared).sqrt(), cos_squared.sqrt(), share)
            }
        };
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
        let value = match &self.microfacets {
            Microfacets::BlinnPhong { k, rest_of_k, .. } => {
                let q_in = cos_in.mul_add(*rest_of_k, *k);
                cos_in.mul(half_dot_out).mul(self.scale).div(q_in.mul(cos))
            }
            Microfacets::Ggx { width_squared, rest, cos_out, root_out, .. } => {
                let root_in = cos_in.mul(cos_in).mul_add(*rest, *width_squared).sqrt();
                let shadowing = cos_in.mul_add(*root_out, cos_out.mul(root_in)).max(V::splat(LEAST_SHADOWING));
                cos_in.mul(half_dot_out).mul(self.scale).mul(share).div(shadowing.mul(cos))
            }
        };
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
pub(super) fn sums_in<V: Vector>(
    basis: &LightBasis,
    place: &LobePlace,
    width: f32,
    count: usize,
    part: Part,
) -> LobeSums {
    let places = places(count);
    let count = places.log_rest.len();
    let lobe = Lobe::<V>::new(place, width, count, part);
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
    let lobe = Lobe::<V>::new(place, width, count, Part::Middle);
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
