//! The step on the light while the reflectance is held.
//!
//! The unknown is the logarithm of radiance, so the light stays positive and a sun grows as fast as a sky. Two ways:
//! * [`mod@newton`]: the loss is replaced by the quadratic that touches it (Laplace reweighted, logarithms made linear), the
//!   normal equations are solved by conjugate gradients on the matrix of the picture, and the step is halved until the
//!   loss falls. A few steps do what hundreds of first-order ones do.
//! * [`first_order`]: Adam through the net of the deep prior, as released.
//!
//! The deep prior joins the first way by alternation: the light is pulled to what the net says, the net is fitted to the
//! light. Both lower one objective; to carry their difference along (ADMM) found worse lights in the few steps there are.

mod deep_tie;
mod newton;
mod quadratic;
mod terms;

pub use self::deep_tie::DeepTie;
pub use self::newton::{LightOutcome, NewtonBudget, newton};
use self::quadratic::average;
pub use self::terms::{LightObjective, LightTerms, objective};
use super::likelihood::Likelihood;
use super::matrices::LightMatrix;
use super::prior::LogLight;
use super::prior::deep::DeepPrior;

/// One first-order step through the net, as released; returns the objective before it.
pub fn first_order(
    matrix: &LightMatrix,
    likelihood: &Likelihood,
    prior: &mut DeepPrior,
    grey: bool,
    rate: f32,
    light: &mut LogLight,
) -> LightOutcome {
    let (logs, tape) = prior.log_light_with_tape();
    light.channels = logs;
    if grey {
        light.make_grey();
    }
    let radiance = light.radiance();
    let state = likelihood.slopes(&matrix.forward(&radiance));
    let mut by_log = matrix.adjoint(&state.by_pixel);
    for channel in 0..3 {
        by_log[channel].iter_mut().zip(&radiance[channel]).for_each(|(slope, value)| *slope *= value);
    }
    if grey {
        average(&mut by_log);
    }
    prior.descend(tape, &by_log, rate);
    LightOutcome { objective: LightObjective { data: state.loss, prior: 0.0 }, not_finite: state.not_finite }
}
