//! The arithmetic of wide lobes: one walk over the hats of the light for several widths, several hats at a time.
//!
//! Written once over [`Vector`]; [`super::lobe_sum`] chooses the version at run time.

use super::light_basis::LightBasis;
use super::lobe_place::{LobePlace, LobeSums};
use crate::math::vector::Vector;
use std::f32::consts::{LN_2, PI};

/// Widths summed in one walk over the light.
pub(super) const MOST_AT_ONCE: usize = 8;

/// What the next hats have in common for all widths.
struct Hats<V> {
    /// `n.i`, at least 0.
    cos_in: V,
    /// Logarithm to base 2 of `(n.h)^2`.
    log_cos_squared: V,
    /// `(1 - h.o)^5`.
    schlick: V,
    /// Solid angle times `n.i`.
    weight: V,
}

#[inline(always)]
fn hats<V: Vector>(basis: &LightBasis, normal: [V; 3], viewer: [V; 3], cos_out: V, at: usize) -> Option<Hats<V>> {
    // Array by array: `map` is not compiled for the processor's vectors, and passes them through memory.
    let [x, y, z] = &basis.direction;
    let (x, y, z) = (V::load(&x[at..]), V::load(&y[at..]), V::load(&z[at..]));
    let dot = |a: [V; 3]| a[2].mul_add(z, a[1].mul_add(y, a[0].mul(x)));
    let cos_in = dot(normal);
    if !cos_in.any_positive() {
        return None;
    }
    let cos_in = cos_in.max(V::splat(0.0));
    // |i + o|^2 = 2 + 2 i.o, n.h = (n.i + n.o) / |i + o|, h.o = |i + o| / 2.
    let length_squared = dot(viewer).mul_add(V::splat(2.0), V::splat(2.0)).max(V::splat(1e-6));
    let sum = cos_in.add(cos_out);
    let cos_squared = sum.mul(sum).div(length_squared).min(V::splat(1.0));
    let rest = V::splat(1.0).sub(length_squared.sqrt().mul(V::splat(0.5))).max(V::splat(0.0));
    let squared = rest.mul(rest);
    Some(Hats {
        cos_in,
        log_cos_squared: cos_squared.max(V::splat(1e-30)).log2(),
        schlick: squared.mul(squared).mul(rest),
        weight: cos_in.mul(V::load(&basis.solid_angle[at..at + V::LANES])),
    })
}

/// Numbers of a lobe that hats do not change.
#[derive(Clone, Copy, Default)]
struct Lobe {
    /// Half the exponent: of `(n.h)^2`.
    half_exponent: f32,
    /// `k` of the shadowing term.
    k: f32,
    /// What all hats are multiplied by.
    scale: f32,
    /// The part of the derivative that hats do not change.
    slope: f32,
    /// Factor of `log2 (n.h)^2` in the derivative.
    slope_of_log: f32,
}

impl Lobe {
    #[inline(always)]
    fn new(width: f32, cos_out: f32) -> Self {
        let inverse = 1.0 / (width * width);
        let k = 0.5 * width;
        let q_out = cos_out * (1.0 - k) + k;
        Lobe {
            half_exponent: inverse - 1.0,
            k,
            scale: inverse * 0.25 / (PI * q_out),
            slope: -2.0 - k * (1.0 - cos_out) / q_out,
            slope_of_log: -2.0 * LN_2 * inverse,
        }
    }
}

/// [`lobe_sums`](super::lobe_sum::lobe_sums) of at most [`MOST_AT_ONCE`] wide lobes, with vectors of any kind.
#[inline(always)]
pub(super) fn sums_in<V: Vector, const DERIVATIVE: bool>(
    basis: &LightBasis,
    place: &LobePlace,
    widths: &[f32],
    sums: &mut [LobeSums],
) {
    let count = widths.len().min(MOST_AT_ONCE).min(sums.len());
    let cos_out = place.normal.dot(place.to_viewer);
    let mut lobes = [Lobe::default(); MOST_AT_ONCE];
    for (lobe, &width) in lobes.iter_mut().zip(widths) {
        *lobe = Lobe::new(width, cos_out);
    }
    let zero = V::splat(0.0);
    // Per width: three channels whole, three weighted with Schlick's factor.
    let mut totals = [[zero; 6]; MOST_AT_ONCE];
    let mut slopes = [[zero; 6]; MOST_AT_ONCE];
    let normal = place.normal.to_array().map(V::splat);
    let viewer = place.to_viewer.to_array().map(V::splat);
    let cos_out_all = V::splat(cos_out);
    let seen = &place.seen.channels;
    for at in (0..basis.padded()).step_by(V::LANES) {
        let Some(hats) = hats(basis, normal, viewer, cos_out_all, at) else { continue };
        let mut arriving = [zero; 3];
        for (value, seen) in arriving.iter_mut().zip(seen) {
            *value = V::load(&seen[at..at + V::LANES]).mul(hats.weight);
        }
        let mut grazing = arriving;
        for value in &mut grazing {
            *value = value.mul(hats.schlick);
        }
        for which in 0..count {
            let lobe = &lobes[which];
            let power = hats.log_cos_squared.mul(V::splat(lobe.half_exponent)).exp2();
            let q_in = hats.cos_in.mul_add(V::splat(1.0 - lobe.k), V::splat(lobe.k));
            let value = power.div(q_in);
            let total = &mut totals[which];
            for k in 0..3 {
                total[k] = value.mul_add(arriving[k], total[k]);
                total[3 + k] = value.mul_add(grazing[k], total[3 + k]);
            }
            if DERIVATIVE {
                let shadowing = V::splat(1.0).sub(hats.cos_in).mul(V::splat(lobe.k)).div(q_in);
                let slope = hats.log_cos_squared.mul_add(V::splat(lobe.slope_of_log), V::splat(lobe.slope));
                let slope = slope.sub(shadowing).mul(value);
                let total = &mut slopes[which];
                for k in 0..3 {
                    total[k] = slope.mul_add(arriving[k], total[k]);
                    total[3 + k] = slope.mul_add(grazing[k], total[3 + k]);
                }
            }
        }
    }
    for which in 0..count {
        let scale = lobes[which].scale;
        let whole = totals[which].map(|value| value.sum() * scale);
        let moved = if DERIVATIVE { slopes[which].map(|value| value.sum() * scale) } else { [0.0; 6] };
        sums[which] = LobeSums {
            base: [0, 1, 2].map(|c| whole[c] - whole[3 + c]),
            grazing: [whole[3], whole[4], whole[5]],
            d_base: [0, 1, 2].map(|c| moved[c] - moved[3 + c]),
            d_grazing: [moved[3], moved[4], moved[5]],
        };
    }
}

/// [`add_lobe_row`](super::lobe_sum::add_lobe_row) of a wide lobe, with vectors of any kind.
#[inline(always)]
pub(super) fn row_in<V: Vector>(basis: &LightBasis, place: &LobePlace, width: f32, scales: [f32; 2], row: &mut [f32]) {
    let cos_out = place.normal.dot(place.to_viewer);
    let lobe = Lobe::new(width, cos_out);
    let normal = place.normal.to_array().map(V::splat);
    let viewer = place.to_viewer.to_array().map(V::splat);
    let cos_out_all = V::splat(cos_out);
    let scale = lobe.scale / 255.0;
    let (base, change) = (V::splat(scales[0] * scale), V::splat((scales[1] - scales[0]) * scale));
    for at in (0..basis.padded()).step_by(V::LANES) {
        let Some(hats) = hats(basis, normal, viewer, cos_out_all, at) else { continue };
        let power = hats.log_cos_squared.mul(V::splat(lobe.half_exponent)).exp2();
        let q_in = hats.cos_in.mul_add(V::splat(1.0 - lobe.k), V::splat(lobe.k));
        let value = power.div(q_in).mul(hats.weight).mul(V::load_bytes(&place.shares[at..at + V::LANES]));
        // base (1 - s) + grazing s.
        let factor = hats.schlick.mul_add(change, base);
        let place = &mut row[at..at + V::LANES];
        value.mul_add(factor, V::load(place)).store(place);
    }
}
