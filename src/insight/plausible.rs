//! Are the maps those of a material that exists? What photos leave open, the scale of reflectance against light, shows in
//! numbers that no surface has.
//!
//! Ranges: specular reflectance of dielectrics is 0.02 to 0.08, 0.04 as a rule, and of metals 0.5 and more (Lagarde 2011,
//! "Feeding a physically based shading model"; gems between them are few); diffuse albedo goes from 0.02 (charcoal) to 0.9
//! (fresh snow) (same source; Coakley 2003, "Reflectance and albedo, surface").

use crate::image::GreyImage;
use crate::material::MaterialMaps;
use crate::math::luminance;
use crate::math::statistics::quantile;

/// Texels that are looked at, at most.
const MOST_TEXELS: usize = 8192;
/// Specular reflectance of dielectrics as a rule, and the most that is plausible.
const TYPICAL_SPECULAR: f64 = 0.04;
const MOST_OF_DIELECTRICS: f64 = 0.08;
/// The least of metals.
const LEAST_OF_METALS: f64 = 0.45;
/// Below this there is no highlight worth a name: nothing is said.
const LEAST_SPECULAR: f64 = 0.005;
/// Diffuse albedo of the darkest and the brightest surfaces.
const DIFFUSE: (f64, f64) = (0.02, 0.9);

/// What the maps look like beside materials that exist.
#[derive(Clone, Debug, PartialEq)]
pub struct Plausibility {
    /// Luminance of the diffuse reflectance that 5, 50 and 95 in a hundred seen texels stay below.
    pub diffuse: [f64; 3],
    /// The same of the specular reflectance F0.
    pub specular: [f64; 3],
    /// What is not plausible, a sentence each; none where all is.
    pub doubts: Vec<String>,
    /// The factor of reflectance (the environment is divided by it) that would make it plausible, where one does.
    pub factor: Option<f64>,
}

/// Judges the texels that photos show; `has_lobe` tells whether specular reflectance was fitted. `None` without any.
pub fn plausibility(maps: &MaterialMaps, times_seen: Option<&GreyImage>, has_lobe: bool) -> Option<Plausibility> {
    let (width, height) = (maps.diffuse.width(), maps.diffuse.height());
    let every = (width * height).div_ceil(MOST_TEXELS).max(1);
    let is_seen = |index: &usize| {
        // Counts may be of another size than the maps.
        times_seen.is_none_or(|seen| {
            let (row, column) = (index / width * seen.height() / height, index % width * seen.width() / width);
            seen[(row, column)] > 0.0
        })
    };
    let texels: Vec<usize> = (0..width * height).step_by(every).filter(is_seen).collect();
    let spread = |map: &crate::image::RgbImage| -> Option<[f64; 3]> {
        let values: Vec<f64> = texels
            .iter()
            .map(|&index| f64::from(luminance(map.pixels()[index])))
            .filter(|value| value.is_finite() && *value > 0.0)
            .collect();
        (!values.is_empty()).then(|| [0.05, 0.5, 0.95].map(|share| quantile(&values, share)))
    };
    let diffuse = spread(&maps.diffuse)?;
    let specular = spread(&maps.specular).filter(|_| has_lobe).unwrap_or([0.0; 3]);
    let (doubts, factor) = doubts(diffuse, specular);
    Some(Plausibility { diffuse, specular, doubts, factor })
}

fn doubts(diffuse: [f64; 3], specular: [f64; 3]) -> (Vec<String>, Option<f64>) {
    let mut said = Vec::new();
    let mut wanted = None;
    let middle = specular[1];
    if middle > MOST_OF_DIELECTRICS && middle < LEAST_OF_METALS {
        said.push(format!(
            "specular reflectance F0 is {middle:.3} in the middle: stone, wood, paint and plastic have about \
             {TYPICAL_SPECULAR}, metals more than 0.5"
        ));
        wanted = Some(TYPICAL_SPECULAR / middle);
    } else if middle > LEAST_SPECULAR && middle < 0.5 * TYPICAL_SPECULAR {
        said.push(format!(
            "specular reflectance F0 is {middle:.3} in the middle: surfaces that shine at all have about {TYPICAL_SPECULAR}"
        ));
        wanted = Some(TYPICAL_SPECULAR / middle);
    }
    if diffuse[2] > DIFFUSE.1 {
        said.push(format!("diffuse reflectance goes up to {:.2}: fresh snow has {}", diffuse[2], DIFFUSE.1));
        wanted = Some(DIFFUSE.1 / diffuse[2]).into_iter().chain(wanted).reduce(f64::min);
    }
    if diffuse[2] < DIFFUSE.0 {
        said.push(format!("diffuse reflectance stays below {:.3}: charcoal has {}", diffuse[2], DIFFUSE.0));
        wanted = wanted.or(Some(DIFFUSE.0 / diffuse[2]));
    }
    // A factor that mends one and spoils the other is none.
    let keeps = |factor: &f64| {
        let diffuse = diffuse.map(|value| value * factor);
        diffuse[2] <= DIFFUSE.1 + 1e-9 && diffuse[2] >= DIFFUSE.0 - 1e-9
    };
    (said, wanted.filter(keeps))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;
    use glam::Vec3;

    fn maps(diffuse: f32, specular: f32) -> MaterialMaps {
        MaterialMaps {
            diffuse: Image::filled(8, 8, Vec3::splat(diffuse)),
            specular: Image::filled(8, 8, Vec3::splat(specular)),
            roughness: Image::filled(8, 8, 0.1),
        }
    }

    fn of(diffuse: f32, specular: f32) -> Plausibility {
        plausibility(&maps(diffuse, specular), None, true).unwrap()
    }

    #[test]
    fn granite_with_too_much_shine_is_doubted_and_a_factor_offered() {
        let doubted = of(0.5, 0.136);
        assert!(doubted.doubts[0].contains("0.136"), "{doubted:?}");
        assert!((doubted.factor.unwrap() - 0.04 / 0.136).abs() < 1e-6);
        assert_eq!(of(0.3, 0.04).doubts, Vec::<String>::new());
        assert_eq!(of(0.05, 0.9).doubts, Vec::<String>::new(), "metal");
        assert_eq!(of(0.3, 0.0).doubts, Vec::<String>::new(), "no highlight, nothing to say");
    }

    #[test]
    fn no_factor_is_offered_that_spoils_what_is_plausible() {
        // Brought to 0.04 the diffuse albedo would be 2.
        let doubted = of(0.5, 0.01);
        assert!(doubted.doubts.len() == 1 && doubted.factor.is_none(), "{doubted:?}");
        let bright = of(1.2, 0.04);
        assert!((bright.factor.unwrap() - 0.75).abs() < 1e-6, "{bright:?}");
        assert!(of(0.01, 0.04).factor.unwrap() > 1.9);
    }

    #[test]
    fn texels_that_no_photo_shows_do_not_count() {
        let mut own = maps(0.3, 0.04);
        let mut seen = Image::filled(8, 8, 1.0);
        for column in 0..8 {
            for row in 0..6 {
                own.specular[(row, column)] = Vec3::splat(0.2);
                seen[(row, column)] = 0.0;
            }
        }
        assert!(!plausibility(&own, None, true).unwrap().doubts.is_empty());
        assert!(plausibility(&own, Some(&seen), true).unwrap().doubts.is_empty());
        assert!(plausibility(&own, None, false).unwrap().doubts.is_empty(), "no lobe was fitted");
        assert_eq!(plausibility(&own, Some(&Image::filled(8, 8, 0.0)), true), None);
    }
}
