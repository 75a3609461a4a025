//! The fixed places of the quadrature over half vectors: they are the same for all lobes.

use super::light_basis::LightBasis;
use super::lobe_place::wide_from;
use crate::math::vector::WIDEST;
use std::f32::consts::TAU;
use std::sync::OnceLock;

/// Places of the quadrature for the narrowest lobes; it grows with the lobe's solid angle.
const FEWEST_PLACES: usize = 128;
/// Places at the width where sums over hats take over.
const MOST_PLACES: usize = 512;

/// How many places a lobe of this width is given: they about keep their distance in texels once it is wider than two or
/// so. A power of two, so that sums do not jump but at a few widths.
pub fn place_count(basis: &LightBasis, width: f32) -> usize {
    let relative = width / wide_from(basis);
    ((MOST_PLACES as f32 * relative * relative) as usize).next_power_of_two().clamp(FEWEST_PLACES, MOST_PLACES)
}

/// The places of a quadrature: they are the same for all lobes. A whole number of vectors.
pub(super) struct Places {
    /// `1 - u`.
    pub rest: Vec<f32>,
    /// `ln(1 - u)`.
    pub log_rest: Vec<f32>,
    /// Cosine of the azimuth.
    pub cos_phi: Vec<f32>,
    /// Sine of the azimuth.
    pub sin_phi: Vec<f32>,
}

/// At least so many places, a power of two.
pub(super) fn places(count: usize) -> &'static Places {
    const SIZES: usize = 12;
    static TABLES: [OnceLock<Places>; SIZES] = [const { OnceLock::new() }; SIZES];
    let which = (count.max(WIDEST).next_power_of_two().ilog2() as usize).min(SIZES - 1);
    TABLES[which].get_or_init(|| {
        let count = 1usize << which;
        let golden = 0.618_034_f32;
        let angle = |index: usize| TAU * (index as f32 * golden).fract();
        let rest = |index: usize| 1.0 - (index as f32 + 0.5) / count as f32;
        Places {
            rest: (0..count).map(rest).collect(),
            log_rest: (0..count).map(|index| rest(index).ln()).collect(),
            cos_phi: (0..count).map(|index| angle(index).cos()).collect(),
            sin_phi: (0..count).map(|index| angle(index).sin()).collect(),
        }
    })
}
