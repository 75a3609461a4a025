//! Which cases a study has.

use super::inputs::Inputs;
use super::{Part, StudyOptions};
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

    /// The part of the study it belongs to.
    pub fn part(self) -> Part {
        match self {
            Figure::Reflectance => Part::Fig3,
            Figure::Light => Part::Fig4,
            Figure::Both => Part::Fig5,
            Figure::Shadows => Part::Shadows,
            Figure::Schedules => Part::Schedules,
        }
    }

    /// The key in `results.csv`.
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
    const COMPARED: [Way; 5] = [Way::Own, Way::Longer, Way::Epsilon(1e-4), Way::Epsilon(1e-2), Way::Released];

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
}

impl Case {
    /// The first columns of its line, with a comma behind them.
    pub fn key(&self) -> String {
        format!("{},{},{},{},", self.figure.key(), self.material, self.light, self.variant())
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
            (_, LightPriorKind::Entropy) => " + entropy",
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

    /// What is photographed.
    pub fn subject(&self) -> String {
        match self.figure {
            Figure::Shadows => format!("{} on the mesh", self.material),
            _ => format!("{} on a sphere", self.material),
        }
    }
}

/// Materials of the studies that take some: from matt to mirror, by the names that MERL's neural fits have.
const MATERIALS: [&str; 20] = [
    "gold-metallic-paint",
    "blue-rubber",
    "alum-bronze",
    "red-plastic",
    "white-fabric",
    "cherry-235",
    "nickel",
    "green-acrylic",
    "pink-felt",
    "aluminium",
    "violet-acrylic",
    "black-oxidized-steel",
    "yellow-matte-plastic",
    "brass",
    "light-brown-fabric",
    "silver-metallic-paint",
    "pvc",
    "tungsten-carbide",
    "black-fabric",
    "dark-blue-paint",
];

/// All cases, grouped by what is photographed. Materials that the neural model has not seen come first: where a figure
/// takes only some, it takes them.
pub fn plan(inputs: &Inputs, options: &StudyOptions) -> Vec<Case> {
    let mut known: Vec<String> = inputs.fits.materials.iter().map(|fit| fit.name.clone()).collect();
    let mut some: Vec<String> =
        MATERIALS.iter().map(|name| name.to_string()).filter(|name| known.contains(name)).collect();
    if some.is_empty() {
        some = known.clone();
    }
    known.sort_by_key(|name| inputs.has_seen(name));
    some.sort_by_key(|name| inputs.has_seen(name));
    let quick = options.quick;
    let lights: Vec<String> = inputs.lights.iter().map(|(name, _)| name.clone()).collect();
    let take = |from: &[String], count: usize| from.iter().take(count).cloned().collect::<Vec<_>>();
    // How many of each a figure takes, when quick and in full.
    let materials = |few: usize, full: usize| options.materials.unwrap_or(if quick { few } else { full });
    let lit = |few: usize, full: usize| options.lights.unwrap_or(if quick { few } else { full });
    let base = Case {
        figure: Figure::Both,
        material: String::new(),
        light: String::new(),
        model: None,
        prior: LightPriorKind::Deep,
        spoilt: Spoilt::Clean,
        shadows: false,
        way: Way::Own,
        seen: false,
    };
    let mut cases = Vec::new();
    let all = take(if quick { &some } else { &known }, materials(2, usize::MAX));
    for material in &all {
        for light in take(&lights, lit(2, 5)) {
            for &model in &options.models {
                let (material, light) = (material.clone(), light.clone());
                cases.push(Case { figure: Figure::Reflectance, material, light, model: Some(model), ..base.clone() });
            }
        }
    }
    let priors = [LightPriorKind::None, LightPriorKind::Gradient, LightPriorKind::Entropy, LightPriorKind::Deep];
    for material in take(&some, materials(1, 5)) {
        for light in take(&lights, lit(2, 10)) {
            for prior in priors {
                let (material, light) = (material.clone(), light.clone());
                cases.push(Case { figure: Figure::Light, material, light, prior, ..base.clone() });
            }
        }
    }
    for (index, material) in take(&some, materials(2, 20)).into_iter().enumerate() {
        for light in take(&lights, lit(1, 5)) {
            for &model in &options.models {
                let mut spoils = vec![Spoilt::Clean];
                // Noise and bytes on a quarter of the materials.
                if index % 4 == 0 {
                    spoils.extend([Spoilt::Noise, Spoilt::Bytes]);
                }
                for spoilt in spoils {
                    let (material, light) = (material.clone(), light.clone());
                    cases.push(Case { material, light, model: Some(model), spoilt, ..base.clone() });
                }
            }
        }
    }
    if inputs.mesh.is_some() {
        for material in take(&some, materials(1, 4)) {
            for light in take(&lights, lit(1, 3)) {
                for shadows in [true, false] {
                    let (material, light, figure) = (material.clone(), light.clone(), Figure::Shadows);
                    cases.push(Case { figure, material, light, shadows, ..base.clone() });
                }
            }
        }
    }
    for material in take(&some, materials(2, 4)) {
        for light in take(&lights, lit(1, 3)) {
            for (&model, way) in options.models.iter().flat_map(|model| Way::COMPARED.map(|way| (model, way))) {
                let (material, light, figure) = (material.clone(), light.clone(), Figure::Schedules);
                cases.push(Case { figure, material, light, way, model: Some(model), ..base.clone() });
            }
        }
    }
    cases.retain(|case| options.wants(case.figure.part()));
    cases.iter_mut().for_each(|case| case.seen = inputs.has_seen(&case.material));
    // A stable order by subject: photos are taken once.
    let subjects: Vec<String> = cases.iter().map(Case::subject).collect();
    let first = |case: &Case| subjects.iter().position(|subject| *subject == case.subject());
    cases.sort_by_key(first);
    cases
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_library_has_every_material_of_the_studies() {
        let trained = crate::neural::shipped().unwrap();
        let unknown: Vec<&str> =
            MATERIALS.into_iter().filter(|name| !trained.account.materials.iter().any(|own| own == name)).collect();
        assert_eq!(unknown, [""; 0]);
    }
}
