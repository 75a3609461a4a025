//! What is compared.

use crate::fit::FitSettings;
use crate::fit::settings::{Consistency, Steps};

/// A setting of consistency between views, with two steps as in the paper or with one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Case {
    /// No consistency, two steps: what all others are compared with.
    None,
    /// The factor of the released code, two steps.
    Released,
    /// A factor for each texel without a gradient, two steps.
    Constant,
    /// The variance with its true gradient, two steps.
    Exact,
    /// No consistency, one step.
    OneStep,
    /// The variance with its true gradient, one step.
    OneStepExact,
}

impl Case {
    /// Every case.
    pub const ALL: [Case; 6] =
        [Case::None, Case::Released, Case::Constant, Case::Exact, Case::OneStep, Case::OneStepExact];

    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Case::None => "none",
            Case::Released => "released",
            Case::Constant => "constant",
            Case::Exact => "exact",
            Case::OneStep => "one-step, none",
            Case::OneStepExact => "one-step, exact",
        }
    }

    /// What it does by construction.
    pub fn sentence(self) -> &'static str {
        match self {
            Case::None => {
                "`none`: squared error alone, two steps; the plain multi-view fit that the others are compared with."
            }
            Case::Released => {
                "`released`: as in the authors' code, one number multiplies the whole gradient of a step. Its logarithm \
                 is the column `exponent`. Adam divides a gradient by its own running size, so a factor that hardly \
                 varies from step to step leaves the steps as they were up to rounding."
            }
            Case::Constant => {
                "`constant`: each texel's gradient is multiplied by the exponential of its own variance over views, a \
                 number without a gradient. It does not point a step elsewhere; Adam divides by each texel's own \
                 running size, so only the change of the factor from step to step is left."
            }
            Case::Exact => {
                "`exact`: the variance is part of the loss and its gradient is followed, with a second pass over each \
                 view of the step. The loss multiplies it, so a step whose views show the sun behind the object weighs \
                 it more. This is the only setting that changes the direction of a texel's gradient."
            }
            Case::OneStep => "`one-step, none`: all maps and the light from the start, with as many steps in all.",
            Case::OneStepExact => "`one-step, exact`: the same with the exact variance.",
        }
    }

    /// The settings of a fit of this case.
    pub fn settings(self, base: &FitSettings, seed: u64) -> FitSettings {
        let consistency = match self {
            Case::None | Case::OneStep => Consistency::None,
            Case::Released => Consistency::Released,
            Case::Constant => Consistency::Constant,
            Case::Exact | Case::OneStepExact => Consistency::Exact,
        };
        let steps = match self {
            Case::OneStep | Case::OneStepExact => Steps::OneStep,
            _ => Steps::TwoStep,
        };
        FitSettings { seed, consistency, steps, ..base.clone() }
    }
}
