//! GGX microfacets: value, derivative, sample and density.
//!
//! * `D(h) = a^2 / (pi ((n.h)^2 (a^2 - 1) + 1)^2)` (Trowbridge and Reitz 1975; Walter, Marschner, Li and Torrance 2007,
//!   eq. 33), written as `1 / (pi a^2 t^2)`, `t = 1 + (1/a^2 - 1) sin^2`: a narrow lobe keeps its digits;
//! * `G / (4 (n.i)(n.o)) = 1 / (2 ((n.i) R(n.o) + (n.o) R(n.i)))`, `R(c) = sqrt(a^2 + (1 - a^2) c^2)`: height-correlated
//!   Smith shadowing (Heitz 2014, eq. 99), as glTF, Cycles and OpenPBR have it.

use super::LobeGeometry;
use crate::math::real::Real;
use std::f32::consts::PI;

/// Largest ratio of cosines that is told from a larger one: beyond it the lobe is zero, and `f32` has digits to spare.
const LARGEST_RATIO: f32 = 1e30;

/// What value and slope share.
struct Terms<R> {
    inverse_width_squared: R,
    sine_squared: R,
    /// `1 + (1/a^2 - 1) sin^2` of the half vector.
    spread: R,
    /// `R(n.o)` and `R(n.i)`.
    roots: [R; 2],
    /// `(n.o) / (n.i)`.
    ratio: R,
    /// `R(n.o) + (n.o)/(n.i) R(n.i)`.
    shadowing: R,
}

impl<R: Real> Terms<R> {
    #[inline(always)]
    fn new(geometry: &LobeGeometry, log_width: R) -> Self {
        let one = R::from_f32(1.0);
        let width_squared = (log_width + log_width).exp();
        let inverse_width_squared = one / width_squared;
        let sine_squared = R::from_f32(sine_squared(geometry.ln_cos_half));
        let root = |cosine: f32| {
            let squared = R::from_f32(cosine * cosine);
            (squared + width_squared * (one - squared)).sqrt()
        };
        let roots = [root(geometry.cos_out), root(geometry.cos_in)];
        // Divided by n.i, so that two cosines near zero do not make 0/0.
        let ratio = R::from_f32((geometry.cos_out / geometry.cos_in).min(LARGEST_RATIO));
        Terms {
            inverse_width_squared,
            sine_squared,
            spread: one + (inverse_width_squared - one) * sine_squared,
            roots,
            ratio,
            shadowing: roots[0] + ratio * roots[1],
        }
    }
}

#[inline(always)]
fn sine_squared(ln_cos_half: f32) -> f32 {
    -(2.0 * ln_cos_half).exp_m1()
}

/// `D G / (4 (n.i)(n.o)) (n.i)`.
#[inline(always)]
pub fn value<R: Real>(geometry: &LobeGeometry, log_width: R) -> R {
    let terms = Terms::new(geometry, log_width);
    terms.inverse_width_squared * R::from_f32(0.5 / PI) / (terms.spread * terms.spread * terms.shadowing)
}

/// Derivative of the logarithm of [`value`] by that of the width.
#[inline(always)]
pub fn slope<R: Real>(geometry: &LobeGeometry, log_width: R) -> R {
    let terms = Terms::new(geometry, log_width);
    // d t / d ln a = -2 sin^2 / a^2;  d R(c) / d ln a = a^2 (1 - c^2) / R(c).
    let (one, width_squared) = (R::from_f32(1.0), R::from_f32(1.0) / terms.inverse_width_squared);
    let d_root = |cosine: f32, root: R| width_squared * (one - R::from_f32(cosine * cosine)) / root;
    let d_shadowing = d_root(geometry.cos_out, terms.roots[0]) + terms.ratio * d_root(geometry.cos_in, terms.roots[1]);
    R::from_f32(-2.0) + R::from_f32(4.0) * terms.sine_squared * terms.inverse_width_squared / terms.spread
        - d_shadowing / terms.shadowing
}

/// Squared sine of a half vector drawn with density `D (n.h)`, from a number uniform in [0, 1).
#[inline]
pub fn sine_squared_of_sample(u: f32, inverse_width_squared: f32) -> f32 {
    // tan^2 = a^2 u / (1 - u): Walter et al. 2007, eq. 35.
    u / (u + (1.0 - u) * inverse_width_squared)
}

/// Density `D (n.h)` of half vectors per steradian.
#[inline]
pub fn density_of_half(ln_cos_half: f32, inverse_width_squared: f32) -> f32 {
    let spread = 1.0 + (inverse_width_squared - 1.0) * sine_squared(ln_cos_half);
    inverse_width_squared * (1.0 / PI) * ln_cos_half.exp() / (spread * spread)
}
