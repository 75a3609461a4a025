//! Stub.
use crate::scene::{Scene, settings::PixelCentre};
/// Stub.
pub fn settle(_scene: &mut Scene, _assumed: PixelCentre, _shrink: usize) {}
