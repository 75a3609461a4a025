//! How fine the cache is.

use super::bounce::strata_along_a_side;
use super::light_basis::LightBasis;
use crate::material::LobeModel;

/// How fine the cache is. Its error against the path tracer falls as these rise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CachedSettings {
    /// Width and height in texels of the grid over the atlas on which visibility is kept.
    pub grid: usize,
    /// Rays from each of its points to other surface.
    pub bounce_rays: usize,
    /// Cells of the light from pole to pole, at most: in each of them lobes see one point of other surface.
    pub surface_rows: usize,
    /// Number of surface hits on the longest path: 1 is direct light only.
    pub max_bounces: usize,
    /// Whether four rays look at a texel of the light that an edge of a shadow crosses, and not one.
    pub fine_shadows: bool,
    /// Strength of the specular lobe as a whole, in [0, 1].
    pub lobe_strength: f32,
    /// The microfacets of the lobe.
    pub lobe: LobeModel,
    /// Seed of the rays to other surface.
    pub seed: u64,
}

impl Default for CachedSettings {
    fn default() -> Self {
        CachedSettings {
            grid: 256,
            bounce_rays: 64,
            surface_rows: 16,
            max_bounces: 3,
            fine_shadows: true,
            lobe_strength: 1.0,
            lobe: LobeModel::BlinnPhong,
            seed: 1,
        }
    }
}

impl CachedSettings {
    /// Whether lobes see other surface.
    pub fn has_surroundings(&self) -> bool {
        self.max_bounces > 1 && self.lobe_strength > 0.0
    }

    /// Hats along the side of a cell in which lobes see one point of other surface.
    pub fn surface_side(&self, basis: &LightBasis) -> usize {
        basis.height.div_ceil(self.surface_rows.max(1))
    }

    /// Rays from each point to other surface: the next square number.
    pub fn rays_traced(&self) -> usize {
        strata_along_a_side(self.bounce_rays).pow(2)
    }
}
