//! Every choice of a fit, once: the command line, the settings file and the window read this structure.

pub use super::method::Method;
use crate::error::{Error, ErrorKind, Result};
use crate::material::LobeModel;
use crate::render::first_hits::PixelFilter;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// How gradients of different views are weighed against each other (multi-view gradient consistency, Joy and Poullis
/// 2023, eq. 2 and 3).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Consistency {
    /// Not at all.
    #[default]
    None,
    /// One factor for the whole step, the exponential of the variance over the normalised stack of gradients; it
    /// carries no gradient and is 1 + 1e-6 or so.
    Released,
    /// A factor for each texel, the exponential of its variance over views; it carries no gradient.
    Constant,
    /// The variance is part of the loss, and its true gradient is followed.
    Exact,
}

/// Where a fit begins.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Start {
    /// From the photographs: light from the background where it is seen, one grey for the surface.
    #[default]
    Measured,
    /// As printed in the paper: diffuse 0, specular 0, roughness 0.5, light 0. An exact saddle: it is detected and left.
    Paper,
}

/// Whether pixels that show the background are evidence for the light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum BackgroundEvidence {
    /// They show the environment itself.
    #[default]
    Use,
    /// They are left out.
    Ignore,
}

/// The order in which maps are freed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum Steps {
    /// First diffuse and light alone, then everything.
    #[default]
    TwoStep,
    /// Everything from the start.
    OneStep,
}

/// What becomes of what views that took no part say of the model's freedoms, see [`super::solver::choice`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Choosing {
    /// Held-out views are not asked.
    Off,
    /// The report says what they choose; maps stay as the evidence of the pixels made them.
    #[default]
    #[serde(rename = "report", alias = "tell", alias = "apply")]
    #[cfg_attr(feature = "cli", value(name = "report", alias = "tell"))]
    Tell,
}

/// Settings of a fit. Defaults are the balanced preset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct FitSettings {
    /// Seed of all random numbers.
    #[cfg_attr(feature = "cli", arg(long, default_value_t = FitSettings::default().seed))]
    pub seed: u64,
    /// How maps and environment are estimated [default: auto, which is the solver unless a setting applies to Adam only].
    #[cfg_attr(feature = "cli", arg(long, value_enum, default_value_t))]
    pub method: Method,
    /// Width and height of the maps in texels: a power of two, 16 to 8192 [default: what the photos resolve, 256 to 2048].
    #[cfg_attr(feature = "cli", arg(long, default_value_t = FitSettings::default().map_size))]
    pub map_size: usize,
    /// Height of the environment in texels, 2 to 1024, at most 64 by the solver; it is twice as wide.
    #[cfg_attr(feature = "cli", arg(long, default_value_t = FitSettings::default().environment_height))]
    pub environment_height: usize,
    /// Order in which Adam frees the maps: in two steps as in the paper, or in one.
    #[cfg_attr(feature = "cli", arg(long, value_enum, default_value_t))]
    pub steps: Steps,
    /// Optimiser steps of the first step: diffuse map and environment.
    #[cfg_attr(feature = "cli", arg(long, default_value_t = FitSettings::default().steps_diffuse))]
    pub steps_diffuse: usize,
    /// Optimiser steps of the second step: all maps and the environment.
    #[cfg_attr(feature = "cli", arg(long, default_value_t = FitSettings::default().steps_all))]
    pub steps_all: usize,
    /// Views in one optimiser step, at least 1.
    #[cfg_attr(feature = "cli", arg(long, default_value_t = FitSettings::default().views_per_step))]
    pub views_per_step: usize,
    /// Pixels in one optimiser step over all its views; 0 takes every pixel, and so does multi-view consistency.
    #[cfg_attr(feature = "cli", arg(long, default_value_t = FitSettings::default().pixels_per_step))]
    pub pixels_per_step: usize,
    /// Samples per pixel in one optimiser step, 1 to 4096; an even number keeps the squared error unbiased.
    #[cfg_attr(feature = "cli", arg(long, default_value_t = FitSettings::default().samples))]
    pub samples: usize,
    /// Max bounces: surface hits on the longest path, 1 to 16; 1 is direct light only.
    #[cfg_attr(feature = "cli", arg(long, default_value_t = FitSettings::default().bounces))]
    pub bounces: usize,
    /// Levels of Adam's coarse-to-fine, 1 to 6: each halves photos and maps once more; 1 works at full size only.
    #[cfg_attr(feature = "cli", arg(long, default_value_t = FitSettings::default().levels))]
    pub levels: usize,
    /// How samples are spread over a pixel.
    #[cfg_attr(feature = "cli", arg(long, value_enum, default_value_t))]
    pub pixel_filter: PixelFilter,
    /// The microfacets of the specular lobe. GGX is what other renderers shade with, so that maps lose nothing on the way to
    /// them, and what most surfaces look like; Blinn-Phong is the paper's [default: auto: what a synthetic scene says, else GGX
    /// for the solver, Blinn-Phong for Adam].
    #[cfg_attr(feature = "cli", arg(long, value_enum, default_value_t))]
    pub lobe: LobeModel,
    /// Multi-view gradient consistency, in the last of Adam's steps.
    #[cfg_attr(feature = "cli", arg(long, value_enum, default_value_t))]
    pub consistency: Consistency,
    /// Background pixels as evidence for the environment.
    #[cfg_attr(feature = "cli", arg(long, value_enum, default_value_t))]
    pub background: BackgroundEvidence,
    /// Per-photo exposure compensation: one gain per photo, with mean logarithm zero; `--exposure=false` leaves it out
    /// [default: auto: for 8-bit photos where the check finds that exposures differ].
    #[cfg_attr(feature = "cli", arg(long, num_args = 0..=1, require_equals = true,
        default_missing_value = "true", default_value_t = false, action = clap::ArgAction::Set))]
    pub exposure: bool,
    /// Where Adam begins.
    #[cfg_attr(feature = "cli", arg(long, value_enum, default_value_t))]
    pub start: Start,
    /// Keep the environment as it is at the start; with `--env` on the command line, one that is known.
    #[cfg_attr(feature = "cli", arg(long))]
    pub fixed_light: bool,
    /// Keep the maps of an earlier run and find the environment alone; `--maps RUN` names the run and turns this on.
    #[cfg_attr(feature = "cli", arg(long))]
    pub fixed_maps: bool,
    /// Step size of diffuse reflectance, 0 to 1.
    #[cfg_attr(feature = "cli", arg(long, default_value_t = FitSettings::default().rate_diffuse))]
    pub rate_diffuse: f32,
    /// Step size of specular reflectance, 0 to 1.
    #[cfg_attr(feature = "cli", arg(long, default_value_t = FitSettings::default().rate_specular))]
    pub rate_specular: f32,
    /// Step size of the logarithm of the microfacet width, 0 to 1.
    #[cfg_attr(feature = "cli", arg(long, default_value_t = FitSettings::default().rate_roughness))]
    pub rate_roughness: f32,
    /// Step size of the environment, relative to its mean plus the texel's own radiance, 0 to 1.
    #[cfg_attr(feature = "cli", arg(long, default_value_t = FitSettings::default().rate_light))]
    pub rate_light: f32,
    /// Weight of the smoothness prior on the environment, for texels that few pixels constrain; 0 leaves it out.
    #[cfg_attr(feature = "cli", arg(long, default_value_t = FitSettings::default().light_smoothness))]
    pub light_smoothness: f32,
    /// Step sizes fall along a cosine to this share of themselves at the end of each of the two steps.
    #[cfg_attr(feature = "cli", arg(long, default_value_t = FitSettings::default().final_rate))]
    pub final_rate: f32,
    /// Optimiser steps over which the specular lobe is switched on.
    #[cfg_attr(feature = "cli", arg(long, default_value_t = FitSettings::default().lobe_ramp))]
    pub lobe_ramp: usize,
    /// Memory for first hits that are traced once, in MiB; 0 draws their positions anew in each step, which takes about as
    /// long and smooths edges better.
    #[cfg_attr(feature = "cli", arg(long, default_value_t = FitSettings::default().first_hits_mib))]
    pub first_hits_mib: usize,
    /// Light iterations of the solver, 2 to 64: half of them on wide basis functions of the environment, half with narrow
    /// ones where it is bright.
    #[cfg_attr(feature = "cli", arg(long, default_value_t = FitSettings::default().solver_rounds))]
    pub solver_rounds: usize,
    /// Width and height of the solver's visibility grid over the atlas, 16 to 4096, at most that of the maps [default: 256,
    /// or 128 for many pixels].
    #[cfg_attr(feature = "cli", arg(long, default_value_t = FitSettings::default().solver_grid))]
    pub solver_grid: usize,
    /// Levels of the solver's coarse-to-fine, 1 to 6, each half the size of the next; the full size counts where refinement
    /// makes its maps, and levels with maps below 128 x 128 texels are left out. With three or more the finest maps are the
    /// refinement's alone [default: 2, or 3 for many pixels].
    #[cfg_attr(feature = "cli", arg(long, default_value_t = FitSettings::default().solver_levels))]
    pub solver_levels: usize,
    /// What becomes of the judgement of held-out views on lobes, interreflection and resolution of the environment.
    #[cfg_attr(feature = "cli", arg(long, value_enum, default_value_t))]
    pub solver_choices: Choosing,
    /// Whole-pixel refinement after the solver: descents over all texels from all pixels of full size, edges included, with a
    /// gain for each photo and channel, and noise and smoothness learned from the photos; 0 leaves it out.
    ///
    /// With three levels or more it makes the finest maps in place of the solver's tiles.
    #[cfg_attr(feature = "cli", arg(long, default_value_t = FitSettings::default().solver_refine))]
    pub solver_refine: usize,
    /// Held-out evaluation interval in optimiser steps; 0 evaluates at the end only.
    #[cfg_attr(feature = "cli", arg(long, default_value_t = FitSettings::default().held_out_interval))]
    pub held_out_interval: usize,
    /// Exclude a photo by its name: it is neither fitted nor used for validation. May be given more than once.
    #[cfg_attr(feature = "cli", arg(long, value_name = "NAME"))]
    pub exclude: Vec<String>,
}

impl Default for FitSettings {
    fn default() -> Self {
        FitSettings {
            seed: 1,
            method: Method::Automatic,
            map_size: 2048,
            environment_height: 32,
            steps: Steps::TwoStep,
            steps_diffuse: 120,
            steps_all: 180,
            views_per_step: 5,
            pixels_per_step: 200_000,
            samples: 4,
            bounces: 2,
            levels: 3,
            pixel_filter: PixelFilter::Box,
            lobe: LobeModel::BlinnPhong,
            consistency: Consistency::None,
            background: BackgroundEvidence::Use,
            exposure: false,
            start: Start::Measured,
            fixed_light: false,
            fixed_maps: false,
            rate_diffuse: 0.03,
            rate_specular: 0.015,
            rate_roughness: 0.04,
            rate_light: 0.1,
            light_smoothness: 0.02,
            final_rate: 0.05,
            lobe_ramp: 20,
            first_hits_mib: 0,
            solver_rounds: 8,
            solver_grid: 256,
            solver_levels: 2,
            solver_choices: Choosing::Tell,
            solver_refine: 1,
            held_out_interval: 10,
            exclude: Vec::new(),
        }
    }
}

impl FitSettings {
    /// Whether some stage frees the specular lobe; without one, pictures are drawn without it too.
    pub fn has_lobe(&self) -> bool {
        self.method != Method::Adam || self.steps == Steps::OneStep || self.steps_all > 0
    }

    /// Whether the finest maps are made by what follows the solver's tiles alone: tiles of full size take most of the time
    /// where photos have many pixels, and find narrower lobes where they have few.
    pub fn is_refined(&self) -> bool {
        self.solver_refine > 0 && self.solver_levels > FitSettings::default().solver_levels
    }

    /// Takes over on which levels and grids the solver works, and what refines its maps.
    pub fn solve_as(&mut self, other: &FitSettings) {
        self.solver_refine = other.solver_refine;
        self.solver_levels = other.solver_levels;
        self.solver_grid = other.solver_grid;
    }

    /// The settings as TOML, only those that differ from the defaults.
    pub fn to_toml(&self) -> String {
        let own = toml::Table::try_from(self).unwrap_or_default();
        let default = toml::Table::try_from(FitSettings::default()).unwrap_or_default();
        let changed: toml::Table = own.into_iter().filter(|(name, value)| default.get(name) != Some(value)).collect();
        toml::to_string_pretty(&changed).unwrap_or_default()
    }

    /// The settings of a TOML text; what it does not name keeps its default.
    pub fn from_toml(text: &str) -> Result<Self> {
        toml::from_str(text).map_err(|source| {
            Error::new(ErrorKind::Malformed, format!("settings are not understood: {}", source.message()))
                .remedy("names are those of `patina fit --help`")
        })
    }

    /// These settings with what the lines of a TOML file change, and the names of what it sets.
    ///
    /// # Errors
    /// A file that cannot be read; a line that is no setting, with its number.
    pub fn changed_by_file(&self, path: &Path) -> Result<(Self, Vec<String>)> {
        let text = std::fs::read_to_string(path).map_err(|source| Error::reading(path, source))?;
        let values: FitSettings = crate::files::settings_of_toml(&text, path)?;
        let table: toml::Table = crate::files::settings_of_toml(&text, path)?;
        let names: Vec<String> = table.keys().cloned().collect();
        Ok((self.with(&names, &values)?, names))
    }

    /// Name, value and whether it is the default, for reports.
    pub fn listed(&self) -> Vec<(String, String, bool)> {
        let own = toml::Table::try_from(self).unwrap_or_default();
        let default = toml::Table::try_from(FitSettings::default()).unwrap_or_default();
        own.into_iter()
            .map(|(name, value)| {
                let text = match &value {
                    // Rates are single precision: printed so, without the digits that widening adds.
                    toml::Value::Float(number) => (*number as f32).to_string(),
                    other => other.to_string(),
                };
                (name.clone(), text, default.get(&name) == Some(&value))
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Place;

    #[test]
    fn a_settings_file_holds_only_the_differences_and_round_trips() {
        let settings = FitSettings {
            map_size: 512,
            consistency: Consistency::Exact,
            rate_light: 0.5,
            exposure: true,
            ..Default::default()
        };
        let text = settings.to_toml();
        assert_eq!(text.lines().count(), 4, "{text}");
        assert_eq!(FitSettings::from_toml(&text).unwrap(), settings);
        assert_eq!(FitSettings::from_toml("").unwrap(), FitSettings::default());
        assert!(FitSettings::from_toml("map-sise = 3").is_err());
    }

    #[test]
    fn a_file_changes_what_it_names_and_an_unknown_line_is_an_error_with_its_number() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("changes.toml");
        let base = FitSettings { map_size: 512, seed: 4, ..Default::default() };
        crate::files::write_bytes(&path, b"seed = 7\nsamples = 8\n").unwrap();
        let (changed, names) = base.changed_by_file(&path).unwrap();
        assert_eq!(changed, FitSettings { map_size: 512, seed: 7, samples: 8, ..Default::default() });
        assert_eq!(names, ["samples", "seed"]);
        crate::files::write_bytes(&path, b"seed = 7\nsampels = 8\n").unwrap();
        let error = base.changed_by_file(&path).unwrap_err();
        assert_eq!(error.place(), &Place::Line(path.clone(), 2), "{error}");
        assert!(base.changed_by_file(&folder.path().join("none.toml")).is_err());
    }
}
