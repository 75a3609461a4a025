//! How a scene is read.

use crate::error::{Error, ErrorKind, Place, Result};
use glam::DVec3;
use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

/// How a scene is read. The defaults suit a folder as downloaded.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "snake_case")]
pub struct ReadSettings {
    /// The direction of the source that points to the sky; `auto` estimates it from the cameras.
    pub up: Up,
    /// Where the source's intrinsics put the centre of the upper left pixel; `auto` measures it.
    pub pixel_centre: PixelCentre,
    /// Views 0, n, 2n, ... of the views used are kept out of the fit, to judge it; 0 keeps none.
    pub hold_out_every: usize,
    /// At most this many views are read, spread evenly over the list; 0 reads all.
    pub max_views: usize,
    /// Whether masks are used.
    pub masks: MaskUse,
    /// What background pixels show; `auto` goes by the kind of the scene.
    pub background: BackgroundChoice,
    /// How the numbers of the photos are encoded; `auto` goes by the file: its profile, else integers are
    /// sRGB and floats are linear.
    pub encoding: ColourEncoding,
    /// The layer of OpenEXR photos by its name, or the last part of it; none takes the layer of radiance.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub layer: Option<String>,
    /// How many metres a unit of the source is; none leaves it open. Lengths are told in metres and exports are scaled by it,
    /// a fit does not depend on it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit_in_metres: Option<f64>,
    /// The mesh, where the source names none or another is meant; several files are pieces of one.
    #[serde(skip_serializing_if = "Vec::is_empty", deserialize_with = "one_or_more")]
    pub mesh: Vec<PathBuf>,
    /// The chunk of a Metashape project or export, by label or number; none takes the one whose photos are here.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub chunk: Option<String>,
    /// Photos are averaged over squares of this many pixels, in linear radiance; 1 keeps them. Older settings files name
    /// it `shrink`.
    #[serde(rename = "downsample", alias = "shrink")]
    pub shrink: usize,
}

impl Default for ReadSettings {
    fn default() -> Self {
        ReadSettings {
            up: Up::Auto,
            pixel_centre: PixelCentre::Auto,
            hold_out_every: 8,
            max_views: 0,
            masks: MaskUse::Use,
            background: BackgroundChoice::Auto,
            encoding: ColourEncoding::Auto,
            layer: None,
            unit_in_metres: None,
            mesh: Vec::new(),
            chunk: None,
            shrink: 1,
        }
    }
}

impl ReadSettings {
    /// Checks the ranges.
    pub fn validate(&self) -> Result<()> {
        if self.shrink == 0 || self.shrink > 64 {
            return Err(Error::new(ErrorKind::InvalidSetting, format!("the factor is {}", self.shrink))
                .at(Place::Setting("downsample".into()))
                .remedy("give a whole number from 1 to 64"));
        }
        if let Some(metres) = self.unit_in_metres.filter(|&metres| !is_length(metres)) {
            return Err(Error::new(ErrorKind::InvalidSetting, format!("a unit is {metres} metres"))
                .at(Place::Setting("unit-in-metres".into()))
                .remedy("give metres above 0, such as 0.001 for millimetres"));
        }
        Ok(())
    }
}

/// Whether metres are a length that a unit can have.
pub fn is_length(metres: f64) -> bool {
    metres.is_finite() && metres > 0.0
}

/// A path, or a list of them, as settings and manifests name them.
///
/// # Errors
/// What is neither.
pub fn one_or_more<'de, D: serde::Deserializer<'de>>(deserializer: D) -> std::result::Result<Vec<PathBuf>, D::Error> {
    #[derive(serde::Deserialize)]
    #[serde(untagged)]
    enum OneOrMore {
        One(PathBuf),
        More(Vec<PathBuf>),
    }
    Ok(match <OneOrMore as serde::Deserialize>::deserialize(deserializer)? {
        OneOrMore::One(path) => vec![path],
        OneOrMore::More(paths) => paths,
    })
}

/// The direction of the source that points to the sky.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Up {
    /// Estimated from the cameras, snapped to an axis when one is near.
    #[default]
    #[serde(rename = "auto")]
    Auto,
    /// +x.
    X,
    /// +y.
    Y,
    /// +z.
    Z,
    /// -x.
    #[serde(rename = "-X")]
    NegX,
    /// -y.
    #[serde(rename = "-Y")]
    NegY,
    /// -z.
    #[serde(rename = "-Z")]
    NegZ,
}

impl Up {
    /// The six directions that can be named.
    pub const NAMED: [Up; 6] = [Up::X, Up::Y, Up::Z, Up::NegX, Up::NegY, Up::NegZ];

    /// The direction in the source; `None` for `auto`.
    pub fn direction_in_source(self) -> Option<DVec3> {
        match self {
            Up::Auto => None,
            Up::X => Some(DVec3::X),
            Up::Y => Some(DVec3::Y),
            Up::Z => Some(DVec3::Z),
            Up::NegX => Some(DVec3::NEG_X),
            Up::NegY => Some(DVec3::NEG_Y),
            Up::NegZ => Some(DVec3::NEG_Z),
        }
    }
}

impl fmt::Display for Up {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Up::Auto => "auto",
            Up::X => "X",
            Up::Y => "Y",
            Up::Z => "Z",
            Up::NegX => "-X",
            Up::NegY => "-Y",
            Up::NegZ => "-Z",
        })
    }
}

impl FromStr for Up {
    type Err = Error;
    fn from_str(text: &str) -> Result<Self> {
        let bare = text.trim().trim_start_matches('+').to_ascii_uppercase();
        if bare == "AUTO" {
            return Ok(Up::Auto);
        }
        Up::NAMED.into_iter().find(|up| up.to_string() == bare).ok_or_else(|| {
            Error::new(ErrorKind::InvalidSetting, format!("'{text}' is not an axis"))
                .at(Place::Setting("up".into()))
                .remedy("give auto, X, Y, Z, -X, -Y or -Z")
        })
    }
}

/// Where the source's intrinsics put the centre of the upper left pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PixelCentre {
    /// Measured where the evidence is clear, else by the kind of the scene.
    #[default]
    Auto,
    /// At (0, 0): half a pixel is added to the principal point on reading.
    Integer,
    /// At (0.5, 0.5), as in this program.
    Half,
}

impl PixelCentre {
    /// What is added to the source's principal point, in pixels. `Auto` counts as `Half`.
    pub fn shift_pixels(self) -> f64 {
        if self == PixelCentre::Integer { 0.5 } else { 0.0 }
    }
}

impl fmt::Display for PixelCentre {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            PixelCentre::Auto => "auto",
            PixelCentre::Integer => "integer",
            PixelCentre::Half => "half",
        })
    }
}

impl FromStr for PixelCentre {
    type Err = Error;
    fn from_str(text: &str) -> Result<Self> {
        match text.trim() {
            "auto" => Ok(PixelCentre::Auto),
            "integer" => Ok(PixelCentre::Integer),
            "half" => Ok(PixelCentre::Half),
            _ => Err(Error::new(ErrorKind::InvalidSetting, format!("'{text}' is not a pixel-centre convention"))
                .at(Place::Setting("pixel-centre".into()))
                .remedy("give auto, integer or half")),
        }
    }
}

/// Whether masks are used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "snake_case")]
pub enum MaskUse {
    /// Where there are any.
    #[default]
    Use,
    /// Not at all: rays decide what is surface.
    Ignore,
}

/// What background pixels show.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "snake_case")]
pub enum BackgroundChoice {
    /// The environment for photographs, what the folder says for synthetic scenes.
    #[default]
    Auto,
    /// The environment.
    Environment,
    /// Black.
    Black,
}

/// How the numbers of a photo are encoded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "snake_case")]
pub enum ColourEncoding {
    /// By the file: its profile or gamma; without one integers are sRGB, floats are linear.
    #[default]
    Auto,
    /// sRGB (IEC 61966-2-1), with the primaries of the file.
    Srgb,
    /// Linear radiance, integers too, with the primaries of the file.
    Linear,
    /// A power of 2.2 for integers, as some data sets write it, with the primaries of the file.
    Gamma22,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_survive_a_file_and_unknown_keys_are_refused() {
        let settings = ReadSettings {
            up: Up::NegZ,
            pixel_centre: PixelCentre::Half,
            shrink: 2,
            layer: Some("Combined".into()),
            unit_in_metres: Some(0.001),
            mesh: vec!["a.obj".into(), "b.obj".into()],
            ..Default::default()
        };
        let text = toml::to_string(&settings).unwrap();
        assert_eq!(toml::from_str::<ReadSettings>(&text).unwrap(), settings);
        let older: ReadSettings = toml::from_str("mesh = \"a.obj\"").unwrap();
        assert_eq!(older.mesh, [PathBuf::from("a.obj")]);
        for metres in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let error = ReadSettings { unit_in_metres: Some(metres), ..settings.clone() }.validate().unwrap_err();
            assert_eq!(error.place(), &Place::Setting("unit-in-metres".into()), "{metres}");
        }
        assert!(toml::from_str::<ReadSettings>("shrinkage = 2").is_err());
    }

    #[test]
    fn axes_are_read_in_any_case_and_sign() {
        assert_eq!("+z".parse::<Up>().unwrap(), Up::Z);
        assert_eq!("-y".parse::<Up>().unwrap(), Up::NegY);
        assert_eq!("w".parse::<Up>().unwrap_err().kind(), ErrorKind::InvalidSetting);
    }
}
