//! The arithmetic of wide lobes: one walk over the hats of the light for several widths, several hats at a time.
//!
//! Written once over [`Vector`]; [`super::lobe_sum`] chooses the version at run time.

use super::light_basis::LightBasis;
use super::lobe_place::{LEAST_SHADOWING, LobePlace, LobeSums, MIDDLE_TANGENT, wide_from};
use crate::material::LobeModel;
use crate::math::vector::Vector;
use std::f32::consts::{LN_2, PI};

/// Widths summed in one walk over the light.
pub(super) const MOST_AT_ONCE: usize = 8;

/// What the next hats have in common for all widths.
struct Hats<V> {
    /// `n.i`, at least 0.
    cos_in: V,
    /// `(n.h)^2`.
    cos_squared: V,
    /// Its logarithm to base 2, for Blinn-Phong.
    log_cos_squared: V,
    /// `(1 - h.o)^5`.
    schlick: V,
    /// Solid angle times `n.i`.
    weight: V,
}

#[inline(always)]
fn hats<V: Vector>(
    basis: &LightBasis,
    (normal, viewer, model): ([V; 3], [V; 3], LobeModel),
    cos_out: V,
    at: usize,
) -> Option<Hats<V>> {
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
        cos_squared,
        log_cos_squared: match model {
            LobeModel::BlinnPhong => cos_squared.max(V::splat(1e-30)).log2(),
            LobeModel::Ggx => V::splat(0.0),
        },
        schlick: squared.mul(squared).mul(rest),
        weight: cos_in.mul(V::load(&basis.solid_angle[at..at + V::LANES])),
    })
}

/// Numbers of a lobe that hats do not change.
#[derive(Clone, Copy, Default)]
struct Lobe {
    model: LobeModel,
    /// `1/a^2 - 1`: half the exponent of Blinn-Phong, so of `(n.h)^2`.
    half_exponent: f32,
    /// `k` of Blinn-Phong's shadowing term; `a^2` of GGX.
    k: f32,
    /// `n.o`, and `R(n.o)` of GGX.
    out: [f32; 2],
    /// What all hats are multiplied by.
    scale: f32,
    /// The part of the derivative that hats do not change.
    slope: f32,
    /// Factor of `log2 (n.h)^2` in the derivative of Blinn-Phong; `4 / a^2` of GGX.
    slope_of_log: f32,
    /// One over the square of [`MIDDLE_TANGENT`], where the middle is left out; 0 where it is not.
    middle: f32,
}

impl Lobe {
    /// `is_narrow`: the tails of GGX alone.
    #[inline(always)]
    fn new(model: LobeModel, width: f32, cos_out: f32, is_narrow: bool) -> Self {
        let inverse = 1.0 / (width * width);
        let half_exponent = inverse - 1.0;
        let middle = if is_narrow { MIDDLE_TANGENT.powi(-2) } else { 0.0 };
        match model {
            LobeModel::BlinnPhong => {
                let k = 0.5 * width;
                let q_out = cos_out * (1.0 - k) + k;
                Lobe {
                    model,
                    half_exponent,
                    k,
                    out: [cos_out, 0.0],
                    scale: inverse * 0.25 / (PI * q_out),
                    slope: -2.0 - k * (1.0 - cos_out) / q_out,
                    slope_of_log: -2.0 * LN_2 * inverse,
                    middle,
                }
            }
            LobeModel::Ggx => {
                let squared = width * width;
                let root_out = (squared + (1.0 - squared) * cos_out * cos_out).sqrt();
                Lobe {
                    model,
                    half_exponent,
                    k: squared,
                    out: [cos_out, root_out],
                    scale: inverse * 0.5 / PI,
                    slope: -2.0,
                    slope_of_log: 4.0 * inverse,
                    middle,
                }
            }
        }
    }

    /// The lobe at hats, without [`Lobe::scale`] and `n.i`, and with `DERIVATIVE` that of its logarithm by that of the width.
    #[inline(always)]
    fn value<V: Vector, const DERIVATIVE: bool>(&self, hats: &Hats<V>) -> (V, V) {
        let one = V::splat(1.0);
        match self.model {
            LobeModel::BlinnPhong => {
                let power = hats.log_cos_squared.mul(V::splat(self.half_exponent)).exp2();
                let q_in = hats.cos_in.mul_add(V::splat(1.0 - self.k), V::splat(self.k));
                if !DERIVATIVE {
                    return (power.div(q_in), one);
                }
                let shadowing = one.sub(hats.cos_in).mul(V::splat(self.k)).div(q_in);
                let slope = hats.log_cos_squared.mul_add(V::splat(self.slope_of_log), V::splat(self.slope));
                (power.div(q_in), slope.sub(shadowing))
            }
            LobeModel::Ggx => {
                let sine_squared = one.sub(hats.cos_squared);
                let spread = sine_squared.mul_add(V::splat(self.half_exponent), one);
                let cos_in_squared = hats.cos_in.mul(hats.cos_in);
                let root_in = cos_in_squared.mul_add(V::splat(1.0 - self.k), V::splat(self.k)).sqrt();
                let [cos_out, root_out] = self.out;
                let shadowing = hats.cos_in.mul_add(V::splat(root_out), root_in.mul(V::splat(cos_out)));
                let shadowing = shadowing.max(V::splat(LEAST_SHADOWING));
                let mut value = one.div(spread.mul(spread).mul(shadowing));
                if self.middle > 0.0 {
                    // The share of the tails is x^2 / (1 + x^2), x the tangent squared over that of the middle.
                    let relative = sine_squared.mul(V::splat(self.middle));
                    let (tail, middle) = (relative.mul(relative), hats.cos_squared.mul(hats.cos_squared));
                    value = value.mul(tail).div(tail.add(middle));
                }
                if !DERIVATIVE {
                    return (value, one);
                }
                // d t / d ln a = -2 sin^2 / a^2;  d R(c) / d ln a = a^2 (1 - c^2) / R(c).
                let of_out = self.k * (1.0 - cos_out * cos_out) / root_out.max(f32::MIN_POSITIVE);
                let of_in = one.sub(cos_in_squared).mul(V::splat(self.k * cos_out)).div(root_in);
                let of_shadowing = hats.cos_in.mul_add(V::splat(of_out), of_in).div(shadowing);
                let of_spread = sine_squared.mul(V::splat(self.slope_of_log)).div(spread);
                (value, V::splat(self.slope).add(of_spread).sub(of_shadowing))
            }
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
        *lobe = Lobe::new(place.model, width, cos_out, width < wide_from(basis));
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
        let Some(hats) = hats(basis, (normal, viewer, place.model), cos_out_all, at) else { continue };
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
            let (value, slope) = lobe.value::<V, DERIVATIVE>(&hats);
            let total = &mut totals[which];
            for k in 0..3 {
                total[k] = value.mul_add(arriving[k], total[k]);
                total[3 + k] = value.mul_add(grazing[k], total[3 + k]);
            }
            if DERIVATIVE {
                let slope = slope.mul(value);
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
    let lobe = Lobe::new(place.model, width, cos_out, width < wide_from(basis));
    let normal = place.normal.to_array().map(V::splat);
    let viewer = place.to_viewer.to_array().map(V::splat);
    let cos_out_all = V::splat(cos_out);
    let scale = lobe.scale / 255.0;
    let (base, change) = (V::splat(scales[0] * scale), V::splat((scales[1] - scales[0]) * scale));
    for at in (0..basis.padded()).step_by(V::LANES) {
        let Some(hats) = hats(basis, (normal, viewer, place.model), cos_out_all, at) else { continue };
        let (value, _) = lobe.value::<V, false>(&hats);
        let value = value.mul(hats.weight).mul(V::load_bytes(&place.shares[at..at + V::LANES]));
        // base (1 - s) + grazing s.
        let factor = hats.schlick.mul_add(change, base);
        let place = &mut row[at..at + V::LANES];
        value.mul_add(factor, V::load(place)).store(place);
    }
}
