//! The light of a scene: an environment infinitely far away.

use crate::image::RgbImage;

/// A latitude-longitude map of radiance, in the conventions of the crate's front page.
#[derive(Clone, Debug, PartialEq)]
pub struct Environment {
    /// Linear RGB radiance, row 0 up; all values finite and at least 0.
    pub radiance: RgbImage,
}
