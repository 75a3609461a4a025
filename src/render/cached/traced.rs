//! What rays find out of a surface: all of the cache that takes time, and that could come from disk.

use super::bounce::BounceMatrix;
use super::light_basis::LightBasis;
use super::points::VisibilityGrid;
use super::settings::CachedSettings;
use super::surroundings::Surroundings;
use super::visibility::Visibility;
use crate::render::Surface;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Visibility and light between surfaces.
#[derive(Clone, Debug)]
pub struct Traced {
    /// What each point sees of the light.
    pub visibility: Visibility,
    /// What each point sees of other points; `None` for direct light only.
    pub bounces: Option<BounceMatrix>,
    /// What hides the light from each point; `None` for direct light only and without a lobe.
    pub surroundings: Option<Surroundings>,
    /// Seconds that tracing what points see of other points took; 0 where none was traced.
    pub bounce_seconds: f64,
}

impl Traced {
    /// Traces it for the points of a grid; `None` when `stop` was raised.
    pub fn trace(
        surface: &Surface,
        settings: &CachedSettings,
        (grid, basis): (&VisibilityGrid, &LightBasis),
        stop: &AtomicBool,
    ) -> Option<Self> {
        let visibility = Visibility::trace(surface, grid, basis, settings.fine_shadows, stop)?;
        let began = Instant::now();
        let bounces = (settings.max_bounces > 1)
            .then(|| BounceMatrix::trace(surface, grid, settings.bounce_rays, settings.seed, stop));
        let surroundings = settings
            .has_surroundings()
            .then(|| Surroundings::trace(surface, grid, basis, &visibility, settings.surface_side(basis), stop));
        let traced = Traced { visibility, bounces, surroundings, bounce_seconds: began.elapsed().as_secs_f64() };
        (!stop.load(Ordering::Relaxed)).then_some(traced)
    }
}
