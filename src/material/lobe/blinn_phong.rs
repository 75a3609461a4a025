//! Normalised Blinn-Phong microfacets: value, derivative, sample and density.
//!
//! * `D(h) = (e+2)/(2 pi) (n.h)^e` (Blinn 1977; normalisation as in Walter, Marschner, Li and Torrance 2007),
//!   `e = 2/a^2 - 2`;
//! * `G = G1(n.i) G1(n.o)`, `G1(c) = c / (c (1-k) + k)`, `k = a/2` (Smith shadowing with Schlick's G1 fitted to GGX,
//!   Schlick 1994 eq. 19, `k` after Karis 2013 without the remapping of roughness).
//!
//! The cosines of the denominator cancel against those of `G`, so nothing is divided by a grazing cosine:
//! `G / (4 (n.i)(n.o)) = 1 / (4 q(n.i) q(n.o))`, `q(c) = c (1-k) + k`.

use super::LobeGeometry;
use crate::math::real::Real;
use std::f32::consts::PI;

/// `D G / (4 (n.i)(n.o)) (n.i)`.
#[inline(always)]
pub fn value<R: Real>(geometry: &LobeGeometry, log_width: R) -> R {
    let one = R::from_f32(1.0);
    let two = R::from_f32(2.0);
    let width = log_width.exp();
    let inverse_width_squared = one / (width * width);
    // D = (e+2)/(2 pi) (n.h)^e with e + 2 = 2/a^2.
    let distribution = inverse_width_squared
        * R::from_f32(1.0 / PI)
        * ((two * inverse_width_squared - two) * R::from_f32(geometry.ln_cos_half)).exp();
    let k = width * R::from_f32(0.5);
    let q_in = R::from_f32(geometry.cos_in) * (one - k) + k;
    let q_out = R::from_f32(geometry.cos_out) * (one - k) + k;
    distribution * R::from_f32(0.25 * geometry.cos_in) / (q_in * q_out)
}

/// Derivative of the logarithm of [`value`] by that of the width.
#[inline(always)]
pub fn slope<R: Real>(geometry: &LobeGeometry, log_width: R) -> R {
    // d ln D / d ln a = -2 - 4 ln(n.h) / a^2;  d ln q(c) / d ln a = k (1 - c) / q(c).
    let one = R::from_f32(1.0);
    let width = log_width.exp();
    let k = width * R::from_f32(0.5);
    let (cos_in, cos_out) = (R::from_f32(geometry.cos_in), R::from_f32(geometry.cos_out));
    let shadowing = (one - cos_in) / (cos_in * (one - k) + k) + (one - cos_out) / (cos_out * (one - k) + k);
    R::from_f32(-2.0) - R::from_f32(4.0 * geometry.ln_cos_half) / (width * width) - k * shadowing
}

/// Squared sine of a half vector drawn with density `D (n.h)`, from a number uniform in [0, 1).
#[inline]
pub fn sine_squared_of_sample(u: f32, inverse_width_squared: f32) -> f32 {
    // Density (e+2)/(2 pi) cos^(e+1): ln cos = a^2/2 ln(1 - u).
    -((-u).ln_1p() / inverse_width_squared).exp_m1()
}

/// Density `D (n.h)` of half vectors per steradian.
#[inline]
pub fn density_of_half(ln_cos_half: f32, inverse_width_squared: f32) -> f32 {
    let exponent = 2.0 * inverse_width_squared - 1.0;
    inverse_width_squared * (1.0 / PI) * (exponent * ln_cos_half).exp()
}
