//! The deterministic solver: bundle adjustment for appearance.
//!
//! Geometry and cameras stay, so light reaches pixels through a cache without noise ([`crate::render::cached`]). Then:
//! 1. [`scene`]: all that never changes. [`observations`]: pixels, sorted by the texel they show, of many
//!    photographs no more than are asked (`sieve`). [`plan`]: the surface as
//!    blocks of texels. [`estimate`]: what does change.
//! 2. [`block`] (with `cell_sums`): under a known light, the reflectances of a block in closed form and its lobe's width by
//!    looking at all.
//! 3. [`round`] solves a block, `light_rows` are its rows over the light; [`eliminate`] takes the block's own unknowns out of them, so that what is
//!    left is the Schur complement of the joint Gauss-Newton system; [`coupling`] takes out the reflectances of all blocks
//!    together, with what neighbours are believed to have in common. `light_reach` is what light sends to a pixel,
//!    `given_maps` does all of this for reflectances that are given.
//! 4. [`light_step`]: the light from those rows, added up ([`normal_equations`]), at least zero ([`non_negative`]), in
//!    wide and narrow hats ([`light_shape`]), with a weak wish for smoothness but for suns ([`light_suns`]).
//!    [`light_round`] is the round as a whole, [`light_evidence`] says what each texel of the light is known by,
//!    `light_holes` fills what lies between texels that photos show; `gains` of photos whose exposures differ; `first_maps`
//!    of texels that no block was solved for, [`first_look`] at photos while a finer level is made ready.
//! 5. [`maps`]: block by block, then in tiles ([`tile`], `tile_lobes`) with the footprints of pixels, where the evidence,
//!    as far as it is independent (`tile_independence`), decides which texels share a lobe ([`lobe_tree`],
//!    [`lobe_evidence`], [`lobe_prior`], [`lobe_sums`], [`lobe_widths`], [`lobe_families`]).
//!    Then `refine`: [`descent`], step by step ([`way`]), of the one [`objective`] over all texels (`conjugate_gradients`), by what whole [`pixels`], [`edges`] among them, see
//!    (`sight`, `pixel_system`), with what `neighbours` have in common and the `texture_scale` that predicts photos that took
//!    no part best; from the lobes that were found, or those of one dielectric where that explains pixels as well (`second_start`, `agreement`), under
//!    the light that these maps say (`light_again`).
//! 6. [`choice`]: views that took no part say what lobes, light between surfaces and the light's resolution bought;
//!    `lobe_tails` says whether highlights reach further than the model's lobes.
//! 7. [`solver`]: the steps in their order. A fit does them one by one, as [`crate::fit::Fitter`] does those of Adam: on
//!    photos and maps of half size first, whose light and maps the full size begins from ([`crate::fit::schedule`]).
//! 8. [`transport_check`]: how far its model is from the path tracer's, once it is done.
//!
//! What it refuses to do: it does not score itself. Its model is the cache; pictures and scores are made by the path
//! tracer. It knows nothing of threads that watch it, nor of files.

mod agreement;
pub mod block;
mod cell_sums;
pub mod choice;
mod conjugate_gradients;
pub mod coupling;
pub mod descent;
pub mod edges;
pub mod eliminate;
pub mod estimate;
pub mod first_look;
mod first_maps;
mod gains;
mod given_maps;
mod light_again;
mod light_colour;
pub mod light_evidence;
mod light_holes;
mod light_reach;
pub mod light_round;
mod light_rows;
mod light_scale;
pub mod light_shape;
pub mod light_step;
pub mod light_suns;
pub mod lobe_evidence;
pub mod lobe_families;
mod lobe_kind;
pub mod lobe_prior;
pub mod lobe_sums;
mod lobe_tails;
pub mod lobe_tree;
pub mod lobe_widths;
pub mod maps;
mod neighbours;
pub mod non_negative;
pub mod normal_equations;
pub mod objective;
pub mod observations;
pub mod photo_gains;
pub mod pixel_noise;
mod pixel_system;
pub mod pixel_terms;
pub mod pixels;
pub mod plan;
pub(in crate::fit) mod refine;
pub mod report;
pub mod round;
pub mod scene;
mod second_start;
pub mod settings;
mod sieve;
mod sight;
#[allow(clippy::module_inception)]
pub mod solver;
mod texture_scale;
pub mod tile;
mod tile_independence;
mod tile_lobes;
pub mod transport_check;
pub mod way;

#[cfg(test)]
mod tests;

pub use choice::Choices;
pub use estimate::{Estimate, TexelVariance};
pub use lobe_tails::LobeTails;
pub use objective::Objective;
pub use report::StepReport;
pub use scene::SolverScene;
pub use settings::SolverSettings;
pub use solver::SolverStep;
pub use transport_check::TransportError;
