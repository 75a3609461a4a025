//! What can be chosen of a picture.

use super::first_hits::PixelFilter;
use crate::light::Environment;

/// How a picture is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PictureSettings {
    /// Samples a pixel in one group.
    pub samples: usize,
    /// Independent groups; two or more give a variance.
    pub groups: usize,
    /// How samples are spread over a pixel.
    pub filter: PixelFilter,
    /// Number of surface hits on the longest path, at most [`MAX_BOUNCES`](super::path::MAX_BOUNCES).
    pub max_bounces: usize,
    /// Strength of the specular lobe as a whole, in [0, 1].
    pub lobe_strength: f32,
    /// Whether the environment shows behind the surface.
    pub background_visible: bool,
    /// By how many degrees the environment is blurred where it shows behind the surface; what it lights stays sharp.
    pub background_blur_degrees: f32,
    /// Whether the back of a triangle reflects like its front; otherwise it is black.
    pub two_sided: bool,
    /// Height (y of the world) of a level ground that shows the shadow of the surface on the environment behind it; none
    /// with measured regions.
    pub ground: Option<f32>,
    /// Seed of the random numbers.
    pub seed: u64,
}

impl PictureSettings {
    /// What shows behind the surface in place of the environment; `None` where that is the environment itself, or nothing.
    pub fn out_of_focus(&self, environment: &Environment) -> Option<Environment> {
        let is_blurred = self.background_visible && self.background_blur_degrees > 0.0;
        is_blurred.then(|| environment.out_of_focus(self.background_blur_degrees))
    }
}

impl Default for PictureSettings {
    fn default() -> Self {
        PictureSettings {
            samples: 64,
            groups: 1,
            filter: PixelFilter::Box,
            max_bounces: 3,
            lobe_strength: 1.0,
            background_visible: true,
            background_blur_degrees: 0.0,
            two_sided: false,
            ground: None,
            seed: 1,
        }
    }
}
