//! The three maps of a scene, as files hold them.

use crate::image::{GreyImage, RgbImage};

/// Diffuse, specular and roughness maps of one atlas; all of the same size.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialMaps {
    /// Diffuse reflectance rho_d, linear RGB in [0, 1].
    pub diffuse: RgbImage,
    /// Specular reflectance at normal incidence F0, linear RGB in [0, 1].
    pub specular: RgbImage,
    /// Roughness `r = a^2` in (0, 1], with `a` the microfacet width; the Blinn-Phong exponent is `2/r - 2`.
    pub roughness: GreyImage,
}
