//! The run folder and the files in it.
//!
//! Read [`run_folder`] first: which file holds what, who writes it, and what is said when one is missing. [`obj`] is
//! the mesh with its atlas coordinates, [`loss_log`] the loss of every step, [`convention`] the sheet of text that lies
//! beside the maps, so that nobody has to guess what roughness means. [`exchange`]
//! writes a scene and its truth for other renderers.
//!
//! What this folder refuses to do: it deletes nothing but an earlier result once a newer one is whole, and it writes into
//! no folder that holds other things. Every file is written whole or not at all.

pub mod convention;
pub mod exchange;
pub mod loss_log;
pub mod obj;
pub mod run_folder;

pub use loss_log::LossRow;
pub use run_folder::{RunFolder, RunResult};
