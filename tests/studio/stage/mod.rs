//! The stage draws what the library computes: radiance, maps, photos, frustums, to the byte where that can be asked.
//!
//! Run with `PATINA_STAGE_PICTURES=FOLDER` to look at pictures of the demo scene.

#![allow(clippy::unwrap_used)]

mod common;
mod frustums;
mod pictures;
mod screen;
mod surface;
