//! Are the derivatives right? Reverse mode against central differences, under frozen randomness.
//!
//! Paths are traced once ([`mod@bench`]) and kept; over kept paths the loss is a smooth function of the maps and the light,
//! because nothing that depends on the sampling proposal is differentiated. A parameter is moved up and down by a small
//! step in `f64` (`difference`), only the pixels whose paths read it are added up again ([`readers`]), and the difference is compared
//! with what the reverse pass of the fit says, run once in `f64` and once in `f32` ([`mod@gradients`]). The gradient of the
//! views' disagreement, which takes second derivatives of the loss, is checked the same way ([`consistency`]).
//! [`report`] puts it into groups: the four kinds of parameters, and the places where renderers tend to be wrong.
//! [`fn@built_in`] is a small scene to do it on.
//!
//! The error of a derivative `a` against a difference `d` is `|a - d| / max(|d|, 1e-3 g)`, with `g` the root mean square
//! of the differences of its kind (diffuse, specular, roughness, light): a derivative a thousand times below the typical
//! one of its kind moves nothing, and is measured against that.
//!
//! What is not judged here: whether the loss is the right one, and whether paths carry the right light; pictures with
//! known answers do that.

pub mod bench;
pub mod built_in;
pub mod consistency;
mod difference;
pub mod gradients;
pub mod readers;
pub mod report;

pub use built_in::built_in;
pub use gradients::gradients;

/// How derivatives are audited.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct AuditSettings {
    /// Parameters that are moved for the gradient of the picture loss; fewer where fewer are read.
    pub parameters: usize,
    /// Parameters that are moved for the gradient of the views' disagreement; 0 leaves it out.
    pub consistency_parameters: usize,
    /// Views at most, spread evenly over those of the fit.
    pub views: usize,
    /// Pixels of a view at most, spread evenly; their paths are kept in memory.
    pub pixels_per_view: usize,
    /// Paths a pixel.
    pub samples: usize,
    /// Surface hits on the longest path.
    pub bounces: usize,
    /// Strength of the specular lobe as a whole, in (0, 1].
    pub lobe_strength: f32,
    /// Seed of the paths and of the choice of parameters.
    pub seed: u64,
    /// Largest relative error that passes, in `f64`.
    pub largest_error: f64,
    /// Smallest cosine between derivatives and differences that passes, in `f64`.
    pub smallest_cosine: f64,
    /// Rows of the worst that are kept.
    pub worst_rows: usize,
}

impl Default for AuditSettings {
    fn default() -> Self {
        AuditSettings {
            parameters: 12_000,
            consistency_parameters: 400,
            views: 6,
            pixels_per_view: 1200,
            samples: 4,
            bounces: 3,
            lobe_strength: 1.0,
            seed: 1,
            largest_error: 1e-3,
            smallest_cosine: 0.999,
            worst_rows: 20,
        }
    }
}

#[cfg(test)]
mod tests;
