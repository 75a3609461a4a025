//! What a surface does with light: texture maps and the reflection lobe.
//!
//! Read [`maps`] for what files hold, [`texels`] for what the tracer fetches ([`texel_gradient`]: where derivatives by
//! it go), then [`lobe`] for the reflection model:
//! value, sample, density and derivative stand next to each other there, for Blinn-Phong and for GGX.
//! What is not here: refraction, subsurface light, anisotropy. A scene that needs them is outside what Patina models.

pub mod lobe;
pub mod maps;
pub mod texel_gradient;
pub mod texels;

pub use lobe::{LobeGeometry, LobeModel, LobeSampler, Material};
pub use maps::MaterialMaps;
pub use texel_gradient::{GradientPyramid, TexelGradient};
pub use texels::{TexelPyramid, TextureTap};
