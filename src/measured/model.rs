//! What every model of reflectance offers to those who fit or render it.

use super::coordinates::HalfDifference;

/// A model of isotropic reflectance with parameters, evaluated at many points at once.
///
/// Values are in 1/sr without the cosine, linear RGB. The parameters are free numbers: a model maps them to its own
/// ranges, or asks for [`Self::project`] after every step.
pub trait ReflectanceModel: Sync {
    /// Name for tables and plots.
    fn name(&self) -> &str;

    /// How many parameters there are.
    fn parameter_count(&self) -> usize;

    /// Parameters of which a fit can start, `parameter_count` of them.
    fn start(&self) -> Vec<f64>;

    /// Writes the value at each point; `at` and `values` have the same length.
    fn evaluate(&self, parameters: &[f64], at: &[HalfDifference], values: &mut [[f64; 3]]);

    /// Adds to `gradient` the sum over points and channels of `adjoint` times the derivative of the value by each
    /// parameter.
    fn pull_back(&self, parameters: &[f64], at: &[HalfDifference], adjoint: &[[f64; 3]], gradient: &mut [f64]);

    /// Moves the parameters to the nearest allowed ones, after a step. Models with free parameters keep this.
    fn project(&self, parameters: &mut [f64]) {
        let _ = parameters;
    }
}
