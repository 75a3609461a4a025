//! The run folder and the files in it.
//!
//! Read [`run_folder`] first: which file holds what, who writes it, and what is said when one is missing. [`obj`] is
//! the mesh with its atlas coordinates, [`loss_log`] the loss of every step, [`convention`] the sheet of text that lies
//! beside the maps, so that nobody has to guess what roughness means. [`exchange`]
//! writes a scene and its truth for other renderers.
//!
//! For other programs, [`asset`] makes a result ready: maps filled past their charts and converted
//! ([`nearest`](crate::material::lobe::nearest) from Blinn-Phong to GGX). From it write [`gltf`], [`usd`], [`materialx`], [`mitsuba`], [`blender`], [`texture_set`] and [`web`], a page to send;
//! [`transfer`] carries a
//! result over to another mesh first. [`sheet`] says beside each what its numbers mean and what was lost, and [`whole_folder`] sees to it that nothing half
//! is left behind. `crate::job::export` drives them.
//!
//! What this folder refuses to do: it deletes nothing but an earlier result once a newer one is whole, and it writes into
//! no folder that holds other things. Every file is written whole or not at all.

pub mod asset;
pub mod between_facets;
pub mod blender;
pub mod convention;
pub mod environment_file;
pub mod exchange;
pub mod gltf;
pub mod loss_log;
pub mod materialx;
pub mod mitsuba;
pub mod obj;
pub mod ply;
pub mod run_folder;
pub mod sheet;
pub mod sun;
pub mod texture;
pub mod texture_set;
pub mod transfer;
pub mod usd;
pub mod web;
pub mod whole_folder;
#[cfg(test)]
mod xml;

pub use loss_log::LossRow;
pub use run_folder::{RunFolder, RunResult};
