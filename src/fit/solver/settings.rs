//! What can be chosen in the solver.

use crate::fit::schedule::{Stage, stages};
use crate::fit::settings::{BackgroundEvidence, Choosing, FitSettings};
use crate::material::LobeModel;
use crate::render::cached::CachedSettings;

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
    /// Which share of the observations counts as independent when they are weighed against what is believed of lobes and
    /// gains. Errors of neighbouring pixels go together.
    /// Lobes take less where a tile's residuals say that errors go together more (`tile_independence`).
    pub independence: f64,
    /// By how much the mean light on the surface may differ from the one that is held, relative, where no background
    /// pixel fixes the scale.
    pub gauge_slack: f64,
    /// Fit a gain for each view, with mean logarithm zero.
    pub exposure: bool,
    /// Take pixels that show the background as evidence for the light.
    pub use_background: bool,
    /// Keep the light as it is.
    pub fixed_light: bool,
    /// Keep the maps as they are.
    pub fixed_maps: bool,
    /// Let views that took no part judge what lobes, light between surfaces and the light's resolution bought, when maps
    /// are made.
    pub check_choices: bool,
    /// The microfacets of the lobe.
    pub lobe: LobeModel,
    /// Seed of all random choices.
    pub seed: u64,
}

impl SolverSettings {
    /// The solver's settings in those of a fit.
    pub fn of(settings: &FitSettings) -> Self {
        let any = SolverSettings::default();
        SolverSettings {
            map_size: settings.map_size,
            light_size: (2 * settings.environment_height, settings.environment_height),
            grid: settings.solver_grid,
            max_bounces: settings.bounces,
            coarse_rounds: settings.solver_rounds / 2,
            fine_rounds: settings.solver_rounds - settings.solver_rounds / 2,
            exposure: settings.exposure,
            use_background: settings.background == BackgroundEvidence::Use,
            fixed_light: settings.fixed_light,
            fixed_maps: settings.fixed_maps,
            check_choices: settings.solver_choices != Choosing::Off,
            lobe: settings.lobe,
            seed: settings.seed,
            ..any
        }
    }

    /// Width and height of the maps of a stage. Maps that are kept stay whole in the state; the solver looks at them by the
    /// size of its photos.
    pub fn map_size_of(&self, stage: &Stage) -> usize {
        if self.fixed_maps { stage.map_size >> stage.photo_level } else { stage.map_size }
    }

    /// How fine the cache is, and how far it reaches.
    pub fn cached(&self) -> CachedSettings {
        CachedSettings {
            grid: self.grid.min(self.map_size),
            bounce_rays: self.bounce_rays,
            max_bounces: self.max_bounces,
            fine_shadows: true,
            lobe_strength: 1.0,
            lobe: self.lobe,
            seed: self.seed,
            ..CachedSettings::default()
        }
    }

    /// The cache that a fit begins with, and the size of its lights: before all else it is traced.
    pub fn first_cache(settings: &FitSettings) -> (CachedSettings, (usize, usize)) {
        let solver = SolverSettings::of(settings);
        let map_size = stages(settings).first().map_or(settings.map_size, |stage| solver.map_size_of(stage));
        let solver = SolverSettings { map_size, ..solver };
        (solver.cached(), solver.light_size)
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
            independence: 0.05,
            gauge_slack: 0.009,
            exposure: false,
            use_background: true,
            fixed_light: false,
            fixed_maps: false,
            check_choices: false,
            lobe: LobeModel::BlinnPhong,
            seed: 1,
        }
    }
}
