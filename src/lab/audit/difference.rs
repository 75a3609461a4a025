//! The central difference by one parameter, and how far the parameter is moved for it.

use super::readers::Parameter;
use crate::material::texels::PyramidWeights;
use crate::render::Parameters;

/// Steps of the differences. The loss is a polynomial of low degree in reflectances and light, where rounding alone
/// limits the step; narrow lobes bend sharply in the logarithm of their width, which wants a smaller one.
const STEP_REFLECTANCE: f64 = 1e-4;
const STEP_LOG_WIDTH: f64 = 1e-5;
const STEP_LIGHT_RELATIVE: f64 = 1e-4;
/// Radiance below which the step of the light no longer shrinks.
const LEAST_LIGHT: f64 = 0.1;

/// Half the width of a parameter's central difference.
pub(super) fn step_of(parameter: Parameter, parameters: &Parameters<f64>) -> f64 {
    match parameter {
        Parameter::Texel { number: 6, .. } => STEP_LOG_WIDTH,
        Parameter::Texel { .. } => STEP_REFLECTANCE,
        Parameter::Light { .. } => STEP_LIGHT_RELATIVE * parameter.value(parameters).abs().max(LEAST_LIGHT),
    }
}

/// Calls `evaluate` with a parameter moved up and down by its step; the central difference of what it returns.
pub(super) fn central_difference(
    parameter: Parameter,
    parameters: &mut Parameters<f64>,
    weights: &PyramidWeights,
    mut evaluate: impl FnMut(&Parameters<f64>) -> f64,
) -> f64 {
    let (value, step) = (parameter.value(parameters), step_of(parameter, parameters));
    // What was really moved, after rounding.
    let (above, below) = (value + step, value - step);
    parameter.set(above, parameters, weights);
    let up = evaluate(parameters);
    parameter.set(below, parameters, weights);
    let down = evaluate(parameters);
    parameter.set(value, parameters, weights);
    (up - down) / (above - below)
}
