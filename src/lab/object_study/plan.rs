//! Which cases a study has.

use super::asked::{Case, Figure, Half, Spoilt, Way};
use super::inputs::Inputs;
use crate::lab::study::CasePattern;
use crate::object::prior::LightPriorKind;
use crate::object::starts::ModelKind;

/// Models of the reflectance that are held against each other.
const MODELS: [ModelKind; 2] = [ModelKind::Ibrdf, ModelKind::CookTorrance];

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

/// Seeds of photos with noise or of 8 bits: what came of one of them alone says little.
const SPOILT_SEEDS: u64 = 3;

/// All cases in full. Materials that the neural model has not seen come first: where a figure takes only some, it takes
/// them. Schedules are no figure of the paper, and the released one is slow: they are there when the pattern names them.
pub fn plan(inputs: &Inputs, pattern: &CasePattern) -> Vec<Case> {
    let all: Vec<String> = inputs.fits.materials.iter().map(|fit| fit.name.clone()).collect();
    let known = |name: &&str| all.iter().any(|own| own == name);
    let mut some: Vec<String> = MATERIALS.iter().filter(|name| known(name)).map(|name| name.to_string()).collect();
    if some.is_empty() {
        some = all.clone();
    }
    for name in all.iter().filter(|name| !inputs.has_seen(name)) {
        if !some.contains(name) {
            some.push(name.clone());
        }
    }
    some.sort_by_key(|name| inputs.has_seen(name));
    let lights: Vec<String> = inputs.lights.iter().map(|(name, _)| name.clone()).collect();
    let take = |from: &[String], count: usize| from.iter().take(count).cloned().collect::<Vec<_>>();
    // Each material under each light, as many of them as a figure has.
    let pairs = |materials: Vec<String>, count: usize| {
        let lights = take(&lights, count);
        materials.into_iter().flat_map(move |material| {
            lights.clone().into_iter().map(move |light| (material.clone(), light)).collect::<Vec<_>>()
        })
    };
    let base = |figure: Figure, (material, light): (String, String)| Case {
        figure,
        material,
        light,
        model: None,
        prior: LightPriorKind::Deep,
        spoilt: Spoilt::Clean,
        shadows: false,
        way: Way::Own,
        seen: false,
        seed: 1,
        half: Half::Mixed,
    };
    let mut cases = Vec::new();
    for pair in pairs(all.clone(), 5) {
        for model in MODELS {
            cases.push(Case { model: Some(model), ..base(Figure::Reflectance, pair.clone()) });
        }
    }
    for pair in pairs(take(&some, 5), 10) {
        for prior in [LightPriorKind::None, LightPriorKind::Gradient, LightPriorKind::Deep] {
            cases.push(Case { prior, ..base(Figure::Light, pair.clone()) });
        }
    }
    for (index, pair) in pairs(take(&some, 20), 5).enumerate() {
        for model in MODELS {
            let clean = Case { model: Some(model), ..base(Figure::Both, pair.clone()) };
            cases.push(clean.clone());
            // Noise and bytes on a quarter of the photos.
            if index % 4 == 0 {
                for (spoilt, seed) in [Spoilt::Noise, Spoilt::Bytes]
                    .into_iter()
                    .flat_map(|spoilt| (1..=SPOILT_SEEDS).map(move |seed| (spoilt, seed)))
                {
                    cases.push(Case { spoilt, seed, ..clean.clone() });
                }
            }
        }
    }
    if inputs.mesh.is_some() {
        for pair in pairs(take(&some, 4), 3) {
            for shadows in [true, false] {
                cases.push(Case { shadows, ..base(Figure::Shadows, pair.clone()) });
            }
        }
    }
    if pattern.names(Figure::Schedules.key()) {
        for pair in pairs(take(&some, 4), 3) {
            for (model, way) in MODELS.into_iter().flat_map(|model| Way::COMPARED.map(|way| (model, way))) {
                cases.push(Case { way, model: Some(model), ..base(Figure::Schedules, pair.clone()) });
            }
        }
    }
    let place = |list: &[String], name: &str| list.iter().position(|own| own == name).unwrap_or(0);
    for case in &mut cases {
        case.seen = inputs.has_seen(&case.material);
        case.half = Half::of(place(&all, &case.material), place(&lights, &case.light));
    }
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
