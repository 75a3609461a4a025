//! The steps of a [descent](super::descent), what they leave behind, and how far a descent is by its seconds.

use super::objective::Objective;
use super::sight::Slopes;
use crate::material::Material;

/// Shares of the seconds of a way with a light at the ends of its parts, as measured on photographs: the first steps, the
/// choice between the starts, the light once more, the last steps.
pub(super) const ENDS_OF_PARTS: [f64; 4] = [0.16, 0.34, 0.5, 0.92];
/// A step down.
#[derive(Clone, Copy)]
pub(super) struct Step {
    /// Iterations of conjugate gradients.
    pub(super) iterations: usize,
    /// What moves. With widths, lobes are integrated anew after it, and light between surfaces follows; without, pixels are
    /// linear in the texels, and no integral is needed.
    pub(super) slopes: Slopes,
}

impl Step {
    /// How long it takes beside others, about: with widths, lobes are integrated anew before and after.
    pub(super) fn weight(self) -> f64 {
        if self.slopes == Slopes::OfWidths { 4.0 } else { 1.0 }
    }
}

/// The same of several steps together.
pub(super) fn weight_of(steps: &[Step]) -> f64 {
    steps.iter().map(|step| step.weight()).sum()
}

/// Where a descent is after a step.
pub struct OnTheWay<'a> {
    /// The texels, diffuse reflectances at most 1.
    pub texels: &'a [Material<f32>],
    /// Radiance of the light's texels.
    pub light: &'a [[f32; 3]],
    /// Gain of each view and channel.
    pub gains: &'a [[f32; 3]],
    /// Share of the whole way by its seconds, in (0, 1]; what comes after it is short.
    pub share: f64,
}

/// Hears of each step of a descent that is gone on from.
pub type Watch<'a> = dyn FnMut(OnTheWay) + 'a;

/// A part of a way.
struct Part {
    /// Shares of the whole way by its seconds, at its beginning and end.
    from: f64,
    to: f64,
    /// How long its steps are beside each other, in all, and those that are done.
    weight: f64,
    done: f64,
}

/// What a descent leaves on its way.
pub(super) struct Trace<'a> {
    /// The objective before and after each step.
    pub(super) steps: Vec<[Objective; 2]>,
    /// Who hears of it.
    pub(super) watch: Option<&'a mut Watch<'a>>,
    part: Part,
}

impl<'a> Trace<'a> {
    /// Of a way that somebody may hear of.
    pub(super) fn of(watch: Option<&'a mut Watch<'a>>) -> Self {
        Trace { steps: Vec::new(), watch, part: Part { from: 0.0, to: 1.0, weight: 1.0, done: 0.0 } }
    }

    /// Of a way that may not be gone on from: nobody hears of it.
    pub(super) fn unseen() -> Self {
        Trace::of(None)
    }

    /// Begins a part whose steps have this weight in all.
    pub(super) fn begin(&mut self, (from, to): (f64, f64), weight: f64) {
        self.part = Part { from, to, weight, done: 0.0 };
    }

    /// A step of such a weight is done; the share of the way by then.
    pub(super) fn step(&mut self, objective: [Objective; 2], weight: f64) -> f64 {
        self.steps.push(objective);
        let Part { from, to, weight: whole, done } = &mut self.part;
        *done += weight;
        *from + (*to - *from) * (*done / *whole).min(1.0)
    }
}
