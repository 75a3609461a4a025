//! Where a step of the solver is that takes long, for who watches; the steps of a [descent](super::descent), what they leave
//! behind, and how far a descent is by its seconds.

use super::light_scale::LightScale;
use super::objective::Objective;
use super::scene::SolverScene;
use super::sight::Slopes;
use crate::material::Material;
use rayon::prelude::*;
use std::borrow::Cow;
use std::time::{Duration, Instant};

/// Something is shown as often as this, at most, of what is between two steps.
const SHOWN_EVERY: Duration = Duration::from_millis(900);

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

/// Where a step of the solver is that takes long: a descent, or maps that are made tile by tile.
pub struct OnTheWay<'a> {
    /// Makes what there is to see, which takes a while: only who looks at it asks for it.
    pub look: &'a dyn Fn() -> Look<'a>,
    /// Gain of each view and channel; empty where they do not move.
    pub gains: &'a [[f32; 3]],
    /// Share of the whole way by its seconds, in (0, 1]; what comes after it is short.
    pub share: f64,
    /// Whether one may end here: the objective is less than before. Else it is only to be seen.
    pub is_reached: bool,
}

/// Maps and light on the way.
pub struct Look<'a> {
    /// The texels, diffuse reflectances at most 1.
    pub texels: Cow<'a, [Material<f32>]>,
    /// Radiance of the light's texels.
    pub light: Cow<'a, [[f32; 3]]>,
}

/// Hears of each step of a descent that is gone on from, now and then of what is between, and of tiles as maps are made.
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
    /// When something was shown last.
    shown: Instant,
    /// Whether it may not be gone on from where the way leads now: steps are only to be seen.
    is_trial: bool,
}

/// What texels on the way are shown by.
pub(super) struct Showing<'a> {
    pub(super) scene: &'a SolverScene,
    pub(super) light: &'a [[f32; 3]],
    /// Largest diffuse reflectance of a texel.
    pub(super) most_diffuse: f32,
    /// Texels that pixels show.
    pub(super) shown: &'a [bool],
    /// Gain of each view and channel.
    pub(super) gains: &'a [[f32; 3]],
}

impl<'a> Trace<'a> {
    /// Of a way that somebody may hear of.
    pub(super) fn of(watch: Option<&'a mut Watch<'a>>) -> Self {
        let part = Part { from: 0.0, to: 1.0, weight: 1.0, done: 0.0 };
        Trace { steps: Vec::new(), watch, part, shown: Instant::now(), is_trial: false }
    }

    /// Goes a way that may not be gone on from, whose steps are seen and not kept.
    pub(super) fn trial<T>(&mut self, go: impl FnOnce(&mut Self) -> T) -> T {
        self.is_trial = true;
        let gone = go(self);
        self.is_trial = false;
        gone
    }

    /// Begins a part whose steps have this weight in all.
    pub(super) fn begin(&mut self, (from, to): (f64, f64), weight: f64) {
        self.part = Part { from, to, weight, done: 0.0 };
    }

    /// A step of such a weight is done, and left these texels.
    pub(super) fn step(
        &mut self,
        objective: [Objective; 2],
        weight: f64,
        (showing, texels): (&Showing, &[Material<f32>]),
    ) {
        self.part.done += weight;
        if !self.is_trial {
            self.steps.push(objective);
        }
        self.show(showing, &|| Cow::Borrowed(texels), self.part.share(0.0), !self.is_trial);
    }

    /// Within a step, of whose weight so much is done: shows what `texels` makes, unless something was shown just before.
    pub(super) fn within_step(&mut self, weight: f64, showing: &Showing, texels: &dyn Fn() -> Vec<Material<f32>>) {
        if self.shown.elapsed() > SHOWN_EVERY {
            self.show(showing, &|| Cow::Owned(texels()), self.part.share(weight), false);
        }
    }

    /// While reflectances may go beyond 1, who watches sees them as they would be if the way ended here: under a light that
    /// is raised.
    fn show<'b>(
        &mut self,
        showing: &'b Showing,
        texels: &'b dyn Fn() -> Cow<'b, [Material<f32>]>,
        share: f64,
        is_reached: bool,
    ) {
        let Some(watch) = &mut self.watch else { return };
        self.shown = Instant::now();
        let look = || {
            let (texels, light) = (texels(), showing.light);
            if showing.most_diffuse <= 1.0 {
                return Look { texels, light: Cow::Borrowed(light) };
            }
            let scale = LightScale::told_by(&texels, showing.shown);
            let light = scale.of_light(light, &showing.scene.told_by_background());
            Look { texels: texels.par_iter().map(|texel| scale.under(texel)).collect(), light: Cow::Owned(light) }
        };
        watch(OnTheWay { look: &look, gains: showing.gains, share, is_reached });
    }
}

impl Part {
    /// Share of the whole way once so much more weight is done.
    fn share(&self, more: f64) -> f64 {
        self.from + (self.to - self.from) * ((self.done + more) / self.weight).min(1.0)
    }
}
