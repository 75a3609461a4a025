//! What can be typed to read and fit scenes. The text of each field is its help.

use crate::atlas::KeepUv;
use crate::fit::{FitSettings, Method, Preset};
use crate::scene::settings::{BackgroundChoice, ColourEncoding, MaskUse, PixelCentre, Up};
use clap::{Args, FromArgMatches};
use std::path::PathBuf;

/// Options of `patina demo`.
#[derive(Debug, Args)]
pub struct DemoOptions {
    /// The run folder.
    #[arg(short, long, default_value = "patina-demo")]
    pub output: PathBuf,
    /// Seed of the cameras, the photographs and the fit.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// A TOML file of fit settings that differ from the demo's, such as `consistency = "exact"`.
    #[arg(long)]
    pub settings: Option<PathBuf>,
    /// How maps and light are found.
    #[arg(long, value_enum)]
    pub method: Option<Method>,
}

/// How a scene is read.
#[derive(Clone, Debug, Default, Args)]
pub struct ReadOptions {
    /// Which axis of the data set points up: auto, or one of +x -x +y -y +z -z.
    #[arg(long, allow_hyphen_values = true)]
    pub up: Option<Up>,
    /// Where the data set puts pixel centres: auto, integer or half.
    #[arg(long)]
    pub pixel_centre: Option<PixelCentre>,
    /// Keep every n-th view out of the fit, to judge it; 0 keeps none.
    #[arg(long)]
    pub hold_out_every: Option<usize>,
    /// Read at most so many views.
    #[arg(long)]
    pub max_views: Option<usize>,
    /// Shrink photographs by this whole factor on reading.
    #[arg(long)]
    pub shrink: Option<usize>,
    /// What pixels without surface show: auto, environment or black.
    #[arg(long)]
    pub scene_background: Option<BackgroundChoice>,
    /// Whether masks of the photographs are used: use or ignore.
    #[arg(long)]
    pub masks: Option<MaskUse>,
    /// How the numbers of the photographs are encoded: auto, srgb or linear.
    #[arg(long)]
    pub encoding: Option<ColourEncoding>,
    /// Which layer of OpenEXR photographs is read, such as ViewLayer.Combined or Combined; the layer of radiance when not
    /// given.
    #[arg(long, value_name = "NAME")]
    pub layer: Option<String>,
    /// The mesh, where the scene's folder holds none or another is meant.
    #[arg(long, value_name = "FILE")]
    pub mesh: Option<PathBuf>,
    /// The chunk of a Metashape project, by label or number.
    #[arg(long, value_name = "NAME")]
    pub chunk: Option<String>,
}

impl ReadOptions {
    /// The settings of the reader.
    pub fn settings(&self) -> crate::scene::ReadSettings {
        self.over(crate::scene::ReadSettings::default())
    }

    /// `settings` with everything that was typed.
    pub fn over(&self, mut settings: crate::scene::ReadSettings) -> crate::scene::ReadSettings {
        if let Some(up) = self.up {
            settings.up = up;
        }
        if let Some(centre) = self.pixel_centre {
            settings.pixel_centre = centre;
        }
        if let Some(every) = self.hold_out_every {
            settings.hold_out_every = every;
        }
        if let Some(most) = self.max_views {
            settings.max_views = most;
        }
        if let Some(shrink) = self.shrink {
            settings.shrink = shrink;
        }
        if let Some(background) = self.scene_background {
            settings.background = background;
        }
        if let Some(masks) = self.masks {
            settings.masks = masks;
        }
        if let Some(encoding) = self.encoding {
            settings.encoding = encoding;
        }
        if let Some(layer) = &self.layer {
            settings.layer = Some(layer.clone());
        }
        if let Some(mesh) = &self.mesh {
            // A run is resumed from other folders too.
            settings.mesh = Some(std::path::absolute(mesh).unwrap_or_else(|_| mesh.clone()));
        }
        if let Some(chunk) = &self.chunk {
            settings.chunk = Some(chunk.clone());
        }
        settings
    }
}

/// Options of `patina check`.
#[derive(Debug, Args)]
pub struct CheckOptions {
    /// The scene: a folder with photos, cameras and a mesh (COLMAP, transforms.json, Metashape, BlendedMVS, exchange) or a
    /// `scene.toml`.
    pub scene: PathBuf,
    /// Folder for the pictures with outlines; none are made without it.
    #[arg(short, long)]
    pub output: Option<PathBuf>,
    /// How the scene is read.
    #[command(flatten)]
    pub read: ReadOptions,
}

/// Options of `patina fit`.
#[derive(Debug, Args)]
pub struct FitOptions {
    /// The scene: a folder with photos, cameras and a mesh (COLMAP, transforms.json, Metashape, BlendedMVS, exchange) or a
    /// `scene.toml`.
    pub scene: PathBuf,
    /// The run folder.
    #[arg(short, long)]
    pub output: PathBuf,
    /// A settings file as in a run folder; options on the command line win.
    #[arg(long)]
    pub settings: Option<PathBuf>,
    /// A light that is known: start from this map (HDR, EXR, PFM).
    #[arg(long)]
    pub env: Option<PathBuf>,
    /// Keep texture coordinates the mesh came with: auto, keep or rebuild.
    #[arg(long)]
    pub uv: Option<KeepUv>,
    /// How the scene is read.
    #[command(flatten)]
    pub read: ReadOptions,
    /// A whole set of settings to begin with; options on the command line win.
    #[arg(long, value_enum, conflicts_with = "settings")]
    pub preset: Option<Preset>,
    /// How the maps are fitted.
    #[command(flatten)]
    pub fit: TypedSettings,
}

/// Settings of a fit, and which of them were typed.
#[derive(Clone, Debug, Default)]
pub struct TypedSettings {
    /// The settings; what was not typed has its default.
    pub values: FitSettings,
    /// Names of those that were typed.
    pub typed: Vec<String>,
}

impl TypedSettings {
    /// `base` with everything that was typed.
    pub fn over(&self, base: &FitSettings) -> crate::Result<FitSettings> {
        base.with(&self.typed, &self.values)
    }
}

impl FromArgMatches for TypedSettings {
    fn from_arg_matches(matches: &clap::ArgMatches) -> Result<Self, clap::Error> {
        // Arguments are known by the names of the fields.
        let is_typed = |name: &String| {
            matches.value_source(&name.replace('-', "_")) == Some(clap::parser::ValueSource::CommandLine)
        };
        let names = FitSettings::described().into_iter().map(|setting| setting.name);
        Ok(TypedSettings { values: FitSettings::from_arg_matches(matches)?, typed: names.filter(is_typed).collect() })
    }

    fn update_from_arg_matches(&mut self, matches: &clap::ArgMatches) -> Result<(), clap::Error> {
        *self = TypedSettings::from_arg_matches(matches)?;
        Ok(())
    }
}

impl Args for TypedSettings {
    fn augment_args(command: clap::Command) -> clap::Command {
        FitSettings::augment_args(command)
    }

    fn augment_args_for_update(command: clap::Command) -> clap::Command {
        FitSettings::augment_args_for_update(command)
    }
}

/// Options of `patina resume`.
#[derive(Debug, Args)]
pub struct ResumeOptions {
    /// The run folder.
    pub run: PathBuf,
    /// The scene, when it has moved since.
    #[arg(long)]
    pub scene: Option<PathBuf>,
}
