//! What a case asks: of which figure it is, of what photo, how it is estimated; and its name.

use crate::object::prior::LightPriorKind;
use crate::object::settings::ObjectSettings;
use crate::object::starts::ModelKind;

/// A figure of the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Figure {
    /// Figure 3: reflectance under a known light.
    Reflectance,
    /// Figure 4: light with known reflectance.
    Light,
    /// Figure 5: both.
    Both,
    /// An object that shadows itself: light with known reflectance.
    Shadows,
    /// Both, by other schedules and with other epsilons.
    Schedules,
}

impl Figure {
    /// All, with their keys and titles.
    pub const NAMED: [(Figure, &str, &str); 5] = [
        (Figure::Reflectance, "fig3", "Figure 3: reflectance from one photo under a known light"),
        (Figure::Light, "fig4", "Figure 4: light from one photo with known reflectance"),
        (Figure::Both, "fig5", "Figure 5: light and reflectance from one photo"),
        (Figure::Shadows, "shadows", "An object that shadows itself: shadows traced or left out"),
        (
            Figure::Schedules,
            "schedules",
            "Light and reflectance by the schedule released with the paper, and with other epsilons",
        ),
    ];

    /// Its word in names of cases.
    pub fn key(self) -> &'static str {
        Self::NAMED.iter().find(|(figure, _, _)| *figure == self).map_or("", |(_, key, _)| key)
    }
}

/// How an estimation goes about it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Way {
    /// As the program does.
    Own,
    /// The schedule that was released with the paper, on a light, pixels and a net of the same sizes.
    Released,
    /// The program's own with three times the rounds.
    Longer,
    /// The program's own with another [`ObjectSettings::epsilon_share`].
    Epsilon(f64),
}

impl Way {
    /// All that are compared.
    pub(super) const COMPARED: [Way; 5] =
        [Way::Own, Way::Longer, Way::Epsilon(1e-4), Way::Epsilon(1e-2), Way::Released];

    /// `own` changed to this way.
    pub fn settings(self, own: &ObjectSettings) -> ObjectSettings {
        match self {
            Way::Own => own.clone(),
            Way::Longer => ObjectSettings { outer_loops: 3 * own.outer_loops, ..own.clone() },
            Way::Epsilon(epsilon_share) => ObjectSettings { epsilon_share, ..own.clone() },
            Way::Released => ObjectSettings {
                light_height: own.light_height,
                pixels: own.pixels,
                nodes: own.nodes,
                net_channels: own.net_channels,
                seed: own.seed,
                ..ObjectSettings::released()
            },
        }
    }

    fn words(self) -> String {
        match self {
            Way::Own => "own schedule".into(),
            Way::Longer => "three times the rounds".into(),
            Way::Released => "released schedule".into(),
            Way::Epsilon(share) => format!("epsilon share {share}"),
        }
    }
}

/// What was done to a photo before it was given away.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Spoilt {
    /// Nothing.
    Clean,
    /// Noise of a hundredth of each value and a thousandth of the exposure.
    Noise,
    /// Eight bits, with the brightest 2 % saturated.
    Bytes,
}

impl Spoilt {
    fn key(self) -> &'static str {
        match self {
            Spoilt::Clean => "clean",
            Spoilt::Noise => "noise",
            Spoilt::Bytes => "8bit",
        }
    }
}

/// One estimation.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// Where it belongs.
    pub figure: Figure,
    /// Name of the material.
    pub material: String,
    /// Name of the light.
    pub light: String,
    /// Model of the reflectance; `None` when it is known.
    pub model: Option<ModelKind>,
    /// Prior of the light.
    pub prior: LightPriorKind,
    /// What was done to the photo.
    pub spoilt: Spoilt,
    /// Whether shadows are traced.
    pub shadows: bool,
    /// How it is done.
    pub way: Way,
    /// Whether the weights of the neural model were trained on the material. Said of rivals too, so that rows of a
    /// table speak of the same materials.
    pub seen: bool,
    /// Seed of pixels, noise and net.
    pub seed: u64,
    /// Whether constants may be chosen on it.
    pub half: Half,
}

impl Case {
    /// Its name in the results file; `quick` is for small photos and lights.
    pub fn key(&self, quick: bool) -> String {
        let part = format!("{}{}", self.figure.key(), if quick { " quick" } else { "" });
        let (material, light, half) = (&self.material, &self.light, self.half.word());
        format!("{part}/{half}/{material}/{light}/{}/seed {}", self.variant(), self.seed)
    }

    /// What is photographed: cases of one such block are rivals.
    pub fn block(&self) -> String {
        format!("{}/{}/{}", self.figure.key(), self.material, self.light)
    }

    /// What tells it from other cases of the same photo.
    pub fn variant(&self) -> String {
        let model = match self.model {
            Some(ModelKind::Ibrdf) => "ibrdf",
            Some(ModelKind::CookTorrance) => "cook-torrance",
            Some(ModelKind::Ggx) => "ggx",
            Some(ModelKind::Ward) => "ward",
            None => "known",
        };
        let prior = match (self.figure, self.prior) {
            (Figure::Reflectance, _) => "",
            (_, LightPriorKind::Deep) => " + deep",
            (_, LightPriorKind::Gradient) => " + gradient",
            (_, LightPriorKind::None) => " + no prior",
        };
        let shadows = match (self.figure, self.shadows) {
            (Figure::Shadows, true) => " + shadows",
            (Figure::Shadows, false) => " without shadows",
            _ => "",
        };
        let way = if self.figure == Figure::Schedules { format!(" + {}", self.way.words()) } else { String::new() };
        let seen = if self.seen && self.model.is_some() { " of seen materials" } else { "" };
        format!("{model}{prior}{shadows}{way} ({}){seen}", self.spoilt.key())
    }
}

/// Constants of the method are chosen on one half of the materials and lights and judged on the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Half {
    /// Material and light are of the half on which constants are chosen.
    Development,
    /// Material and light are of the half that judges.
    Judging,
    /// One of each: good for neither.
    Mixed,
}

impl Half {
    /// Of the places of material and light in their lists: every other one is for development.
    pub(super) fn of(material: usize, light: usize) -> Self {
        match (material % 2, light % 2) {
            (0, 0) => Half::Development,
            (1, 1) => Half::Judging,
            _ => Half::Mixed,
        }
    }

    /// Its word in names of cases.
    pub fn word(self) -> &'static str {
        match self {
            Half::Development => "development",
            Half::Judging => "judging",
            Half::Mixed => "mixed",
        }
    }
}
