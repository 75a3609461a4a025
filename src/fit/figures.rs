//! What a fit finds out on the way, for whoever watches it. No step reads it and no checkpoint holds it.

use super::step_sums::StepSums;
use crate::image::{GreyImage, Image};
use std::sync::Arc;

/// Figures of the last steps.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LiveFigures {
    /// Root mean squared error of each view in linear radiance over its unclipped surface pixels, as last known; `None`
    /// before the first look at one and for views that are left out.
    ///
    /// Of a training view: over the pixels of its last step, with its gain. Of a held-out view: over a shrunken photo at
    /// the last look. Both are from unbiased estimates of the squared error, so that the noise of few paths is not
    /// counted; an estimate below zero counts as zero.
    pub view_rmse: Vec<Option<f32>>,
    /// Disagreement `V_p` in [0, 1] of the views at each texel in the last step, of the stage's map size, 0 where fewer
    /// than two views saw it; `None` without consistency.
    pub agreement: Option<Arc<GreyImage>>,
}

impl LiveFigures {
    /// Nothing known of so many views.
    pub(super) fn new(views: usize) -> Self {
        LiveFigures { view_rmse: vec![None; views], agreement: None }
    }

    /// Takes over what a step that was kept found out.
    pub(super) fn keep(&mut self, sums: &mut StepSums, map_size: usize) {
        self.keep_errors(&sums.view_errors);
        self.agreement = sums.agreement.take().map(|values| Arc::new(Image::from_pixels(map_size, map_size, values)));
    }

    /// Takes over errors of views.
    pub(super) fn keep_errors(&mut self, errors: &[(usize, f32)]) {
        for &(view, rmse) in errors {
            self.view_rmse[view] = Some(rmse);
        }
    }
}
