//! Narrow lobes: a frozen quadrature over half vectors.
//!
//! Half vectors of the density `D(h) (n.h)` lie at `ln cos = a^2/2 ln(1 - u)`, those of GGX at `tan^2 = a^2 u / (1 - u)`. The places `u` are fixed and of equal
//! probability, their azimuths follow the golden angle, and the frame turns with the viewer: the sum is a smooth
//! function of normal, viewer and width, without noise. The light and its visibility are read bilinearly, as the hats are.
//!
//! What a place weighs and where it reads is found for several places at a time (`half_vector_kernel.rs`); the
//! light is read one by one.

use super::half_vector_kernel::{Part, row_in, sums_in};
use super::light_basis::LightBasis;
use super::lobe_place::{LobePlace, LobeSums};
use crate::math::vector::versions;

versions! {
    /// The sums of a lobe over so many places, without derivatives. Sums that are subtracted from each other need the
    /// same number of places, see [`place_count`](super::half_vector_places::place_count).
    pub fn lobe_sums(basis: &LightBasis, place: &LobePlace, width: f32, count: usize, part: Part) -> LobeSums = sums_in;
    /// Adds the rows of `S0 - S5` and `S5`, times `scales`, to a row over the texels of the light.
    pub fn add_lobe_row(basis: &LightBasis, place: &LobePlace, width: f32, scales: [f32; 2], row: &mut [f32]) = row_in;
}
