//! Whole sets of settings under a name.

use super::settings::FitSettings;

/// How much work a fit may be.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[non_exhaustive]
pub enum Preset {
    /// A first look: maps of 512 x 512 at most, direct light only; with Adam, fewer steps.
    #[cfg_attr(feature = "cli", value(name = "draft", alias = "quick"))]
    Quick,
    /// The defaults.
    #[default]
    #[cfg_attr(feature = "cli", value(name = "standard", alias = "balanced"))]
    Balanced,
    /// For the final run: three bounces and exposure compensation; with Adam, more steps and samples.
    #[cfg_attr(feature = "cli", value(name = "high-quality", alias = "careful"))]
    Careful,
}

impl Preset {
    /// All of them, from little work to much.
    pub const ALL: [Preset; 3] = [Preset::Quick, Preset::Balanced, Preset::Careful];

    /// Its name on screen.
    pub fn label(self) -> &'static str {
        match self {
            Preset::Quick => "Draft",
            Preset::Balanced => "Standard",
            Preset::Careful => "High quality",
        }
    }
}

impl FitSettings {
    /// Names of what these settings have that no preset has: what somebody chose who filled in the structure.
    pub fn chosen(&self) -> Vec<String> {
        let mut names: Vec<String> = Preset::ALL
            .into_iter()
            .map(|preset| self.differences(&FitSettings::preset(preset)))
            .min_by_key(Vec::len)
            .unwrap_or_default()
            .into_iter()
            .map(|(name, _, _)| name)
            .collect();
        names.retain(|name| name != "method");
        names
    }

    /// The settings of a preset.
    pub fn preset(preset: Preset) -> Self {
        let balanced = FitSettings::default();
        match preset {
            Preset::Quick => FitSettings {
                map_size: 512,
                steps_diffuse: 45,
                steps_all: 60,
                views_per_step: 4,
                pixels_per_step: 60_000,
                samples: 2,
                bounces: 1,
                lobe_ramp: 10,
                ..balanced
            },
            Preset::Balanced => balanced,
            Preset::Careful => FitSettings {
                steps_diffuse: 180,
                steps_all: 360,
                views_per_step: 8,
                pixels_per_step: 400_000,
                samples: 8,
                bounces: 3,
                exposure: true,
                lobe_ramp: 40,
                final_rate: 0.02,
                ..balanced
            },
        }
    }
}
