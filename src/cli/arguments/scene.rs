//! What can be typed to read and fit scenes. The text of each field is its help.

use super::groups;
use crate::atlas::KeepUv;
use crate::fit::{FitSettings, Method, Preset};
use crate::scene::settings::{BackgroundChoice, ColourEncoding, MaskUse, PixelCentre, Up, is_length};
use clap::{Args, FromArgMatches};
use std::path::PathBuf;

/// Options of `patina demo`.
#[derive(Debug, Args)]
pub struct DemoOptions {
    /// The run folder.
    #[arg(short, long, default_value = "patina-demo")]
    pub output: PathBuf,
    /// Seed of the cameras, the photos and the fit.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// A TOML file of fit settings that differ from the demo's, such as `consistency = "exact"`.
    #[arg(long)]
    pub settings: Option<PathBuf>,
    /// How maps and environment are estimated [default: solver].
    #[arg(long, value_enum)]
    pub method: Option<Method>,
    /// End the fit after about so many seconds, as `patina fit --seconds` does.
    #[arg(long, value_name = "N", value_parser = seconds)]
    pub seconds: Option<f64>,
}

/// How a scene is read.
#[derive(Clone, Debug, Default, Args)]
pub struct ReadOptions {
    /// Axis of the data set that points up: auto, or one of +x -x +y -y +z -z [default: auto].
    #[arg(long, help_heading = groups::SCENE, allow_hyphen_values = true)]
    pub up: Option<Up>,
    /// Pixel-centre convention of the data set: auto, integer or half [default: auto].
    #[arg(long, help_heading = groups::SCENE)]
    pub pixel_centre: Option<PixelCentre>,
    /// Hold out every Nth photo for validation; 0 holds out none [default: 8].
    #[arg(long, help_heading = groups::SCENE, value_name = "N")]
    pub hold_out_every: Option<usize>,
    /// Read at most this many photos, spread evenly over the list; 0 reads all [default: 0].
    #[arg(long, help_heading = groups::SCENE, value_name = "N")]
    pub max_views: Option<usize>,
    /// Downsample photos by this whole factor, 1 to 64 [default: 1].
    #[arg(long = "downsample", alias = "shrink", help_heading = groups::SCENE, value_name = "FACTOR")]
    pub shrink: Option<usize>,
    /// What pixels without surface show: auto, environment or black [default: auto].
    #[arg(long, help_heading = groups::SCENE)]
    pub scene_background: Option<BackgroundChoice>,
    /// Masks of the photos: use or ignore [default: use].
    #[arg(long, help_heading = groups::SCENE)]
    pub masks: Option<MaskUse>,
    /// Colour encoding of the photos: auto, srgb, linear or gamma22 [default: auto].
    #[arg(long, help_heading = groups::SCENE)]
    pub encoding: Option<ColourEncoding>,
    /// Which layer of OpenEXR photographs is read, such as ViewLayer.Combined or Combined; the layer of radiance when not
    /// given.
    #[arg(long, help_heading = groups::SCENE, value_name = "NAME")]
    pub layer: Option<String>,
    /// How many metres a unit of the data set is, such as 0.001 for millimetres: lengths are told in metres, and exports to
    /// GLB and USD are scaled.
    #[arg(long, help_heading = groups::SCENE, value_name = "METRES", value_parser = metres)]
    pub unit_in_metres: Option<f64>,
    /// The mesh, where the scene's folder holds none or another is meant; given more than once, its pieces.
    #[arg(long, help_heading = groups::SCENE, value_name = "FILE")]
    pub mesh: Vec<PathBuf>,
    /// The chunk of a Metashape project, by label or number.
    #[arg(long, help_heading = groups::SCENE, value_name = "NAME")]
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
        if self.unit_in_metres.is_some() {
            settings.unit_in_metres = self.unit_in_metres;
        }
        if !self.mesh.is_empty() {
            // A run is resumed from other folders too.
            let whole = |mesh: &PathBuf| std::path::absolute(mesh).unwrap_or_else(|_| mesh.clone());
            settings.mesh = self.mesh.iter().map(whole).collect();
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
    /// The scene: a folder with photos, cameras and a mesh in any format of `patina guide file-formats`, or a `scene.toml`.
    pub scene: PathBuf,
    /// Folder for the photos with mesh outlines; none are drawn without it.
    #[arg(short, long)]
    pub output: Option<PathBuf>,
    /// How the scene is read.
    #[command(flatten)]
    pub read: ReadOptions,
}

/// Options of `patina fit`.
#[derive(Debug, Args)]
pub struct FitOptions {
    /// The scene: a folder with photos, cameras and a mesh in any format of `patina guide file-formats`, or a `scene.toml`.
    pub scene: PathBuf,
    /// How the scene is read.
    #[command(flatten)]
    pub read: ReadOptions,
    /// Texture coordinates that the mesh came with: auto, keep or rebuild [default: auto].
    #[arg(long, help_heading = groups::SCENE)]
    pub uv: Option<KeepUv>,
    /// Start from this environment (HDR, EXR, PFM); with --fixed-light it is taken as known.
    #[arg(long, value_name = "FILE", help_heading = groups::LIGHT)]
    pub env: Option<PathBuf>,
    /// Keep the maps of this run of the same mesh, and find only the environment of these photos (and with --exposure their
    /// gains).
    #[arg(long, value_name = "RUN", help_heading = groups::LIGHT)]
    pub maps: Option<PathBuf>,
    /// A set of settings to begin with; options on the command line take precedence [default: standard].
    #[arg(long, value_enum, conflicts_with = "settings", help_heading = groups::METHOD)]
    pub preset: Option<Preset>,
    /// A settings file as in a run folder; options on the command line take precedence.
    #[arg(long, value_name = "FILE", help_heading = groups::METHOD)]
    pub settings: Option<PathBuf>,
    /// End the fit after about so many seconds, reading included, with the best that was found by then: maps, environment,
    /// scores and report are written as for any fit, and `patina resume` does what was left out. Scores and report come
    /// after that time.
    #[arg(long, value_name = "N", value_parser = seconds, help_heading = groups::METHOD)]
    pub seconds: Option<f64>,
    /// The run folder to write [default: a new one in `runs`, named after the scene]. A result that is there is set aside
    /// in `earlier` until the new one is whole.
    #[arg(short, long, value_name = "RUN", help_heading = groups::OUTPUT)]
    pub output: Option<PathBuf>,
    /// How maps and environment are fitted.
    #[command(flatten)]
    pub fit: TypedSettings,
}

/// The length of a unit.
fn metres(text: &str) -> Result<f64, String> {
    let metres = text.parse().map_err(|_| "give a number of metres".to_string())?;
    if is_length(metres) { Ok(metres) } else { Err("give metres above 0, such as 0.001 for millimetres".into()) }
}

/// A time that can be waited for.
fn seconds(text: &str) -> Result<f64, String> {
    let seconds: f64 = text.parse().map_err(|_| "give a number of seconds".to_string())?;
    if seconds.is_finite() && seconds > 0.0 { Ok(seconds) } else { Err("give more than 0 seconds".into()) }
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
        groups::arrange(FitSettings::augment_args(command))
    }

    fn augment_args_for_update(command: clap::Command) -> clap::Command {
        groups::arrange(FitSettings::augment_args_for_update(command))
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
    /// End the fit after about so many seconds, as `patina fit --seconds` does.
    #[arg(long, value_name = "N", value_parser = seconds)]
    pub seconds: Option<f64>,
}
