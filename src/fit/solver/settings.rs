//! What can be chosen in the solver.

use super::lobe_prior::SurfaceKinds;
use super::lobe_tree::LobeSharing;
use crate::fit::settings::{BackgroundEvidence, Choosing, FitSettings};

/// [`SolverSettings::light_variation`] of photographs: between what each of two captures would have.
const PHOTOGRAPHED_LIGHT_VARIATION: f64 = 0.5;

/// How many suns are looked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Suns {
    /// Wherever the light is bright: lamps are suns as well.
    #[default]
    Any,
    /// One at most, where the light is brightest, as daylight has it. Of photographs, whose mesh and cameras are not quite
    /// right, many small suns explain some of what is wrong.
    One,
}

/// Settings of the solver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolverSettings {
    /// Width and height of the maps in texels; a power of two.
    pub map_size: usize,
    /// Width and height of the light in texels.
    pub light_size: (usize, usize),
    /// Width and height of the grid on which visibility is kept; at most the maps'.
    pub grid: usize,
    /// Rays from each point of the grid to other surface.
    pub bounce_rays: usize,
    /// Number of surface hits on the longest path; 1 is direct light only.
    pub max_bounces: usize,
    /// Rounds with the light on wide hats alone.
    pub coarse_rounds: usize,
    /// Rounds with narrow hats where the light is bright.
    pub fine_rounds: usize,
    /// Blocks of surface in one round.
    pub blocks: usize,
    /// Most observations of a block in one round.
    pub observations: usize,
    /// Most narrow hats.
    pub narrow_hats: usize,
    /// By how much neighbouring wide hats are believed to differ, relative to their radiance (one standard deviation).
    pub light_variation: f64,
    /// How many suns are looked for.
    pub suns: Suns,
    /// Which kinds of surface there may be.
    pub surface_kinds: SurfaceKinds,
    /// Which share of the observations counts as independent when they are weighed against priors. Errors of neighbouring
    /// pixels go together: a twentieth gives a better light and better roughness than three tenths, and hardly worse F0.
    /// Lobes take less where a tile's residuals say that errors go together more (`tile_independence`).
    pub independence: f64,
    /// By how much the mean light on the surface may differ from the one that is held, relative, where no background
    /// pixel fixes the scale.
    pub gauge_slack: f64,
    /// Follow edges finer than pixels and texels of the light: what a pixel at an edge shows is traced at many places, and
    /// so is which part of a texel of the light a point sees. Photographs do not need it, whose mesh and cameras are not
    /// right to a fraction of a pixel: with one place a pixel and a ray a texel of the light their held-out views are no
    /// further off, in less time.
    pub fine_edges: bool,
    /// Look at four places of each pixel, so that texels are told apart that one place would pass over.
    pub whole_pixels: bool,
    /// Which ways of sharing lobes are looked at. Where maps are polished the quick ones do: held-out views are as near.
    pub lobe_sharing: LobeSharing,
    /// Fit a gain for each view, with mean logarithm zero.
    pub exposure: bool,
    /// Take pixels that show the background as evidence for the light.
    pub use_background: bool,
    /// Keep the light as it is.
    pub fixed_light: bool,
    /// Let views that took no part judge what lobes, light between surfaces and the light's resolution bought, when maps
    /// are made.
    pub check_choices: bool,
    /// Let the maps take over what those views chose.
    pub apply_choices: bool,
    /// Seed of all random choices.
    pub seed: u64,
}

impl SolverSettings {
    /// The solver's settings in those of a fit.
    pub fn of(settings: &FitSettings) -> Self {
        // Whole pixels or polishing follow where photos are photographs: daylight, on a mesh and by cameras that are not quite right.
        let is_photographed = settings.is_refined();
        let any = SolverSettings::default();
        SolverSettings {
            map_size: settings.map_size,
            light_size: (2 * settings.environment_height, settings.environment_height),
            grid: settings.solver_grid,
            max_bounces: settings.bounces,
            coarse_rounds: settings.solver_rounds / 2,
            fine_rounds: settings.solver_rounds - settings.solver_rounds / 2,
            light_variation: if is_photographed { PHOTOGRAPHED_LIGHT_VARIATION } else { any.light_variation },
            suns: if is_photographed { Suns::One } else { Suns::Any },
            surface_kinds: if is_photographed { SurfaceKinds::Outdoors } else { SurfaceKinds::Any },
            fine_edges: !is_photographed,
            lobe_sharing: if is_photographed { LobeSharing::QUICK } else { LobeSharing::THOROUGH },
            exposure: settings.exposure,
            use_background: settings.background == BackgroundEvidence::Use,
            fixed_light: settings.fixed_light,
            check_choices: settings.solver_choices != Choosing::Off,
            apply_choices: settings.solver_choices == Choosing::Apply,
            seed: settings.seed,
            ..any
        }
    }
}

impl Default for SolverSettings {
    fn default() -> Self {
        SolverSettings {
            map_size: 512,
            light_size: (64, 32),
            grid: 256,
            bounce_rays: 64,
            max_bounces: 3,
            coarse_rounds: 4,
            fine_rounds: 4,
            blocks: 800,
            observations: 40,
            narrow_hats: 256,
            light_variation: 0.7,
            suns: Suns::Any,
            surface_kinds: SurfaceKinds::Any,
            independence: 0.05,
            gauge_slack: 0.02,
            fine_edges: true,
            whole_pixels: false,
            lobe_sharing: LobeSharing::THOROUGH,
            exposure: false,
            use_background: true,
            fixed_light: false,
            check_choices: false,
            apply_choices: false,
            seed: 1,
        }
    }
}
