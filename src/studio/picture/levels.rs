//! Coarser levels of what is shown: a picture that is drawn small is read from one of its own size.

use super::source::Source;
use crate::image::area::Pyramid;
use glam::Vec3;
use std::sync::Arc;

/// Coarser levels of a source.
#[derive(Clone, Debug)]
pub enum Levels {
    /// Of colours.
    Colour(Arc<Pyramid<Vec3>>),
    /// Of numbers.
    Numbers(Arc<Pyramid<f32>>),
}

impl Levels {
    /// The levels of a source; nothing is computed yet.
    pub fn of(source: &Source) -> Self {
        let (width, height) = source.size();
        match source {
            Source::Colour(_) => Levels::Colour(Arc::new(Pyramid::new(width, height))),
            Source::Numbers { .. } => Levels::Numbers(Arc::new(Pyramid::new(width, height))),
        }
    }
}
