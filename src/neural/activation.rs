//! What stands behind the layers of a net.

/// What stands behind every layer but the last.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Activation {
    /// `max(x, 0)`, as in the paper.
    Rectifier,
    /// `(x + sqrt(x^2 + 1/4)) / 2` (Barron 2021, "Squareplus"): a rectifier with a derivative everywhere.
    Squareplus,
}

/// Squareplus bends over about this width, squared.
const BEND: f32 = 0.25;

impl Activation {
    /// Applies it to each number.
    pub fn apply(self, values: &mut [f32]) {
        match self {
            Activation::Rectifier => values.iter_mut().for_each(|x| *x = x.max(0.0)),
            Activation::Squareplus => values.iter_mut().for_each(|x| *x = 0.5 * (*x + (*x * *x + BEND).sqrt())),
        }
    }

    /// Multiplies an adjoint by the derivative, given the output.
    pub fn pull_back(self, outputs: &[f32], adjoint: &mut [f32]) {
        match self {
            Activation::Rectifier => {
                for (adjoint, &y) in adjoint.iter_mut().zip(outputs) {
                    *adjoint = if y > 0.0 { *adjoint } else { 0.0 };
                }
            }
            // y (y - x) = BEND / 4, so dy/dx = y / (2 y - x) = y^2 / (y^2 + BEND / 4).
            Activation::Squareplus => {
                for (adjoint, &y) in adjoint.iter_mut().zip(outputs) {
                    *adjoint *= y * y / (y * y + 0.25 * BEND);
                }
            }
        }
    }
}
