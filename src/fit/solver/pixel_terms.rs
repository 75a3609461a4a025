//! What a block of surface is solved from: light at its pixels, and what is believed before looking.

use super::lobe_widths::MOST_NODES;

/// Light at one pixel: what multiplies the unknowns.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PixelTerms {
    /// Arriving light: times diffuse reflectance.
    pub arriving: [f32; 3],
    /// The lobe at each width: times F0.
    pub base: [[f32; 3]; MOST_NODES],
    /// The lobe at each width: what is there whatever F0.
    pub grazing: [[f32; 3]; MOST_NODES],
    /// Radiance of the photo.
    pub radiance: [f32; 3],
    /// Cell of the block.
    pub cell: u16,
    /// Weight; 0 leaves it out.
    pub weight: f32,
}

/// What is believed before looking.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlockPrior {
    /// Mean of F0 per channel, and its standard deviation.
    pub specular: ([f64; 3], f64),
    /// Mean of the logarithm of the width, and its standard deviation.
    pub log_width: (f64, f64),
    /// Standard deviation of the noise, in radiance.
    pub noise: f64,
    /// Standard deviation of the cells' deviations in diffuse reflectance; 0 makes all cells one.
    pub spread: f64,
}
