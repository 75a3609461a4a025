//! What a run is written for, and what each cannot hold.

use crate::material::LobeModel;
use serde::{Deserialize, Serialize};

/// What an export is made for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
#[cfg_attr(feature = "cli", value(rename_all = "lower"))]
pub enum Format {
    /// One file for viewers, engines and Blender.
    Glb,
    /// A USD stage and package.
    Usd,
    /// A scene of Mitsuba 3, with a plugin of the exact lobe.
    Mitsuba,
    /// A script for Blender.
    Blender,
    /// An OpenPBR material in MaterialX.
    Materialx,
    /// Maps alone, named as artists name them.
    Textures,
    /// One page to look at in any browser.
    Web,
}

impl Format {
    /// All of them.
    pub const ALL: [Format; 7] =
        [Format::Glb, Format::Usd, Format::Mitsuba, Format::Blender, Format::Materialx, Format::Textures, Format::Web];

    /// Name of its folder, and of the format on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Format::Glb => "glb",
            Format::Usd => "usd",
            Format::Mitsuba => "mitsuba",
            Format::Blender => "blender",
            Format::Materialx => "materialx",
            Format::Textures => "textures",
            Format::Web => "web",
        }
    }

    /// What the format cannot hold of a surface with this lobe, one sentence each, without a full stop.
    pub fn loses(self, lobe: LobeModel) -> impl Iterator<Item = &'static str> {
        self.cannot_hold().iter().copied().filter(move |&sentence| lobe == LobeModel::BlinnPhong || sentence != GGX)
    }

    /// What the format cannot hold of a surface with a lobe of Blinn-Phong, one sentence each, without a full stop.
    pub fn cannot_hold(self) -> &'static [&'static str] {
        const LAYER: &str =
            "its renderers weigh the diffuse part by what the lobe leaves; the base colour is raised to make up for it";
        match self {
            Format::Glb => &[GGX, LAYER, "the environment lies beside the file, not in it"],
            Format::Usd => &[GGX, OF_METALNESS],
            Format::Mitsuba => &[
                GGX,
                "its lobe hides itself a little more where it is wide; scene_exact.xml with its plugin loses nothing",
            ],
            Format::Blender => &[GGX],
            Format::Materialx => &[GGX, LAYER],
            Format::Textures => &[
                GGX,
                "BaseColor, Metallic and Specular stand for two reflectances; colour of F0 below 0.08 is lost \
                in them, not in Diffuse and SpecularF0",
            ],
            Format::Web => &[WEB_SHOWS],
        }
    }
}

const GGX: &str = "the Blinn-Phong lobe becomes the nearest GGX lobe";
pub(super) const OF_METALNESS: &str = "the variant that is chosen at first says F0 as a colour over that of an index of refraction of 1.3, and metalness where there \
    are metals; readers that pass over this colour show 0.017 for all that is no metal; the variant `specular` holds the maps \
    as fitted, for importers that know that workflow";
pub(super) const WEB_SHOWS: &str = "the page shows the fitted lobe by maps blurred beforehand: no sharp shadows but those of the sun, soft ones and light \
     between surfaces by what each vertex gets of the light in nine spherical harmonics";
