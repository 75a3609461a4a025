//! Experiments with the neural model of reflectance: [`run`] trains in sittings with checkpoints, [`own_net`] fits all
//! weights to one material, [`speed`] times it.

pub mod own_net;
pub mod run;
pub mod speed;
