//! Where a lobe is integrated, and what its integrals are: the terms that all ways of integrating it share.

use super::light_basis::LightBasis;
use super::seen_light::SeenLight;
use crate::material::LobeModel;
use glam::Vec3;

/// Lobes of at least this microfacet width, for a light of 32 rows, are summed over hats. The standard deviation of
/// reflected directions is then 20 degrees, 3.6 texels: one value a hat errs by 1 % at the peak of the lobe.
const WIDE_AT_32_ROWS: f32 = 0.25;

/// The narrowest lobe that is summed over the hats of this basis.
pub fn wide_from(basis: &LightBasis) -> f32 {
    (WIDE_AT_32_ROWS * 32.0 / basis.height as f32).min(1.0)
}

/// Where a lobe is integrated: unit normal and unit direction towards the viewer, above its horizon.
#[derive(Clone, Copy, Debug)]
pub struct LobePlace<'a> {
    /// Unit shading normal.
    pub normal: Vec3,
    /// Unit direction towards the viewer.
    pub to_viewer: Vec3,
    /// Visible shares of the hats.
    pub shares: &'a [u8],
    /// The light that is seen in the hats, from other surface as well.
    pub seen: &'a SeenLight,
    /// Variance of the normal over the footprint, of both axes together, in squared radians.
    pub normal_variance: f32,
    /// The microfacets.
    pub model: LobeModel,
}

/// The width of a lobe of this microfacet width over normals of this variance.
///
/// Slopes of the normalised Blinn-Phong distribution have a variance of `a^2 / (1 - a^2)` over both axes (with the exponent
/// `2/a^2 - 2`, one over it along each); that of the normals is added. Widths up to 1 stay below it. After Toksvig 2005
/// ("Mipmapping normal maps"), with the variance taken from the geometry in place of a map. Slopes of GGX have no variance;
/// over normals that lie evenly in a disc of radius `R` its peak is that of the width `sqrt(a^2 + R^2)`, and `R^2` is twice
/// their variance.
#[inline(always)]
pub fn width_through(model: LobeModel, width: f32, normal_variance: f32) -> f32 {
    let added = variance_added(model, width, normal_variance);
    ((width * width + added) / (1.0 + added)).sqrt()
}

#[inline(always)]
fn variance_added(model: LobeModel, width: f32, normal_variance: f32) -> f32 {
    let times = match model {
        LobeModel::BlinnPhong => 1.0,
        LobeModel::Ggx => 2.0,
    };
    times * normal_variance * (1.0 - width * width).max(0.0)
}

/// Half vectors of GGX at a tangent of this to the normal are summed over half vectors and over hats in equal parts, nearer
/// ones mostly over half vectors, others over hats, where the lobe is narrow: its tails are smooth beside a hat, and places
/// of equal probability are few in them.
pub(super) const MIDDLE_TANGENT: f32 = 0.2;
/// The shadowing of GGX, which is divided by, is at least this: it is zero where both directions lie in the surface.
pub(super) const LEAST_SHADOWING: f32 = 1e-12;

impl LobePlace<'_> {
    /// The width of the lobe as the footprint sees it, for one of this microfacet width: [`width_through`].
    #[inline(always)]
    pub fn width_seen(&self, width: f32) -> f32 {
        width_through(self.model, width, self.normal_variance)
    }

    /// Derivative of the logarithm of [`LobePlace::width_seen`] by that of the width.
    #[inline(always)]
    pub(super) fn slope_of_width_seen(&self, width: f32) -> f32 {
        let added = variance_added(self.model, width, self.normal_variance);
        width * width / ((width * width + added) * (1.0 + added))
    }
}

/// Integrals of one lobe of one width, and their derivatives by the logarithm of the width.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LobeSums {
    /// `S0 - S5` per channel: times F0.
    pub base: [f32; 3],
    /// `S5` per channel.
    pub grazing: [f32; 3],
    /// Derivative of `base` by the logarithm of the width; zero where it was not asked for.
    pub d_base: [f32; 3],
    /// Derivative of `grazing`.
    pub d_grazing: [f32; 3],
}

impl LobeSums {
    /// The sum of two parts of a lobe.
    #[inline]
    pub(super) fn and(&self, other: &LobeSums) -> LobeSums {
        let of = |own: [f32; 3], other: [f32; 3]| [0, 1, 2].map(|c| own[c] + other[c]);
        LobeSums {
            base: of(self.base, other.base),
            grazing: of(self.grazing, other.grazing),
            d_base: of(self.d_base, other.d_base),
            d_grazing: of(self.d_grazing, other.d_grazing),
        }
    }

    /// What a lobe of this F0 sends, in radiance per channel.
    #[inline]
    pub fn radiance(&self, specular: [f32; 3]) -> [f32; 3] {
        [0, 1, 2].map(|c| specular[c] * self.base[c] + self.grazing[c])
    }
}
