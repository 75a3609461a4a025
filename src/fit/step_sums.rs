//! What a step adds up beside its gradient.

/// Sums of one step over its views.
#[derive(Clone, Debug, Default)]
pub(super) struct StepSums {
    /// The loss that is minimised.
    pub loss: f64,
    /// Its part from the pictures.
    pub image_loss: f64,
    /// Disagreement of the views in [0, 1].
    pub consistency: f64,
    /// View and derivative of the loss by its gain.
    pub gain_derivatives: Vec<(usize, f32)>,
    /// Names and numbers of pixels that were not finite; counted when the step is kept, so that a step that is dropped
    /// and done again counts once.
    pub non_finite: Vec<(String, u64)>,
    /// View and root mean squared error of the unclipped surface pixels of it that were looked at.
    pub view_errors: Vec<(usize, f32)>,
    /// Disagreement at each base texel, where it was measured.
    pub agreement: Option<Vec<f32>>,
}

impl StepSums {
    /// Root mean squared error over the surface of the views that were looked at; each view counts alike.
    pub fn surface_rmse(&self) -> Option<f64> {
        let squares = self.view_errors.iter().map(|(_, rmse)| f64::from(*rmse).powi(2));
        let count = self.view_errors.len();
        (count > 0).then(|| (squares.sum::<f64>() / count as f64).sqrt())
    }
}
