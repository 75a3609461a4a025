//! Which microfacets a lobe is made of.

use super::{LobeGeometry, blinn_phong, ggx};
use crate::math::real::Real;
use serde::{Deserialize, Serialize};

/// The distribution of microfacets and the shadowing that goes with it ([`blinn_phong`], [`ggx`]). `roughness` means
/// `r = a^2` in both, with `a` the width of the distribution, and both weigh by the same Fresnel factor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum LobeModel {
    /// Normalised Blinn-Phong with Schlick's shadowing, as in the paper.
    #[default]
    BlinnPhong,
    /// GGX with height-correlated Smith shadowing, as other renderers have it.
    Ggx,
}

impl LobeModel {
    /// All of them.
    pub const ALL: [LobeModel; 2] = [LobeModel::BlinnPhong, LobeModel::Ggx];

    /// `D G / (4 (n.i)(n.o)) (n.i)`.
    #[inline(always)]
    pub fn value<R: Real>(self, geometry: &LobeGeometry, log_width: R) -> R {
        match self {
            LobeModel::BlinnPhong => blinn_phong::value(geometry, log_width),
            LobeModel::Ggx => ggx::value(geometry, log_width),
        }
    }

    /// Derivative of the logarithm of [`LobeModel::value`] by that of the width.
    #[inline(always)]
    pub fn slope<R: Real>(self, geometry: &LobeGeometry, log_width: R) -> R {
        match self {
            LobeModel::BlinnPhong => blinn_phong::slope(geometry, log_width),
            LobeModel::Ggx => ggx::slope(geometry, log_width),
        }
    }

    /// Squared sine of a half vector drawn with density `D (n.h)`, from a number uniform in [0, 1).
    #[inline]
    pub fn sine_squared_of_sample(self, u: f32, inverse_width_squared: f32) -> f32 {
        match self {
            LobeModel::BlinnPhong => blinn_phong::sine_squared_of_sample(u, inverse_width_squared),
            LobeModel::Ggx => ggx::sine_squared_of_sample(u, inverse_width_squared),
        }
    }

    /// Density `D (n.h)` of half vectors per steradian.
    #[inline]
    pub fn density_of_half(self, ln_cos_half: f32, inverse_width_squared: f32) -> f32 {
        match self {
            LobeModel::BlinnPhong => blinn_phong::density_of_half(ln_cos_half, inverse_width_squared),
            LobeModel::Ggx => ggx::density_of_half(ln_cos_half, inverse_width_squared),
        }
    }

    /// Its name for a reader.
    pub fn label(self) -> &'static str {
        match self {
            LobeModel::BlinnPhong => "Blinn-Phong",
            LobeModel::Ggx => "GGX",
        }
    }

    /// Distribution and shadowing in formulas, one line each, for sheets that lie beside maps.
    pub fn formulas(self) -> [&'static str; 2] {
        match self {
            LobeModel::BlinnPhong => [
                "D  normalised Blinn-Phong,  D(h) = (e + 2) / (2 pi) (n.h)^e,  e = 2 / a^2 - 2",
                "G  Smith with Schlick-GGX,  G1(c) = c / (c (1 - k) + k),  k = a / 2",
            ],
            LobeModel::Ggx => [
                "D  GGX,  D(h) = a^2 / (pi ((n.h)^2 (a^2 - 1) + 1)^2)",
                "G  Smith, height-correlated,  G / (4 i o) = 1 / (2 (i R(o) + o R(i))),  R(c) = sqrt(a^2 + (1 - a^2) c^2)",
            ],
        }
    }
}
