//! The invertible neural model of reflectance, trained and evaluated on the CPU.
//!
//! Source: Chen, Nobuhara and Nishino 2020, "Invertible Neural BRDF for Object Inverse Rendering". A normalising flow
//! carries a density over the three angles of isotropic reflectance to the uniform one; a code of sixteen numbers bends
//! it from material to material.
//!
//! Read [`warp`] first (what the unit cube stands for), then [`architecture`] (what a flow is made of) and [`flow`] (what
//! it does). Below them are [`spline`], the transform of one coordinate, and [`dense`], the nets that choose it, on
//! matrix products of [`product`], scaled and shifted by codes ([`modulation`]). [`columns`] is the fast path that training
//! and fitting take, [`pass`] chooses it.
//! * Training: [`library`] and [`target`] (what is learned), [`batch`] (the gradient of one step), [`train`], [`adam`],
//!   [`weights`] (the file).
//! * Use: [`model`] (reflectance from codes and colours, through [`code_rows`] and [`lobes`], read between [`nodes`]),
//!   [`fit`] (to a table), [`sampler`] (for a path tracer), [`embedding`] (the map of codes), [`between`] (materials
//!   between those of the library), [`source`] (reflectance by name).
//!
//! What is not claimed: a flow is reciprocal by the folded `phi_difference`, and the compact one has no seam there;
//! neither keeps energy by construction, so albedo is measured ([`sampler::HalfVectorSampler::albedos`]), not promised:
//! far from any material a code of shaped weights can have a peak between all cells of a sum.
//!
//! Two kinds of weights ship: compact ones with a code a channel, which joint estimation stands on, and shaped ones with a
//! shape a material, which stand for given tables far more closely. What ships was learned from "MERL via neural fits", not
//! from MERL.

pub mod activation;
pub mod adam;
pub mod architecture;
pub mod batch;
pub mod between;
pub mod cells;
pub mod code_rows;
pub mod columns;
pub mod dense;
pub mod embedding;
pub mod fit;
pub mod flow;
pub mod library;
pub mod lobes;
pub mod model;
pub mod modulation;
pub mod nodes;
pub mod pass;
pub mod product;
pub mod sampler;
pub mod source;
pub mod spline;
pub mod target;
pub mod train;
pub mod warp;
pub mod weights;

pub use model::FlowModel;
pub use weights::Trained;

/// The weights that ship: the compact flow, trained on all 88 materials of "MERL via neural fits".
const SHIPPED: &[u8] = include_bytes!("../../assets/ibrdf_compact.safetensors");

/// Reads the weights that ship.
///
/// Errors: none unless the program was built with a damaged file.
pub fn shipped() -> crate::error::Result<Trained> {
    Trained::parse(SHIPPED)
}

/// The weights for studies of what a flow does on materials it never saw: trained on 62 of the 88, 80 % of those left
/// when ten are kept out together ([`weights::Account::left_out`] names them). The paper leaves materials out one by
/// one, with a training for each: ten at once is harder on the flow, and one training instead of ten.
const SHIPPED_LEAVE_OUT: &[u8] = include_bytes!("../../assets/ibrdf_compact_80.safetensors");

/// Reads the weights that ship for studies of materials left out.
///
/// Errors: none unless the program was built with a damaged file.
pub fn shipped_leave_out() -> crate::error::Result<Trained> {
    Trained::parse(SHIPPED_LEAVE_OUT)
}

/// The shaped weights that ship, trained on all 88 materials: [`architecture::Architecture::shaped`].
const SHAPED: &[u8] = include_bytes!("../../assets/ibrdf_shaped.safetensors");

/// Reads the shaped weights that ship: those by which tables are represented.
///
/// Errors: none unless the program was built with a damaged file.
pub fn shaped() -> crate::error::Result<Trained> {
    Trained::parse(SHAPED)
}

/// Shaped weights trained on the 62 materials of [`shipped_leave_out`], from which they began: they saw neither the ten
/// that it left out on purpose nor the other 16.
const SHAPED_LEAVE_OUT: &[u8] = include_bytes!("../../assets/ibrdf_shaped_62.safetensors");

/// Reads the shaped weights that ship for studies of materials left out.
///
/// Errors: none unless the program was built with a damaged file.
pub fn shaped_leave_out() -> crate::error::Result<Trained> {
    Trained::parse(SHAPED_LEAVE_OUT)
}
