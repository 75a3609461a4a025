//! Whether stated uncertainties hold: how often the truth lies in the interval that a fit states for it.

use super::truth::MapErrors;
use crate::image::Image;
use crate::material::MaterialMaps;

/// Half of the width of an interval that holds nine tenths of a normal belief, in standard deviations.
const NINE_TENTHS: f32 = 1.645;
/// A diffuse reflectance further off than this is wrong.
pub const WRONG: f32 = 0.1;

/// How often stated 90 % intervals hold the truth, as shares in [0, 1] of the texels that count; NaN of none.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct IntervalCoverage {
    /// Of the diffuse reflectance, after the best factor per channel, over texels and channels.
    #[serde(deserialize_with = "crate::export::loss_log::number_or_nan")]
    pub diffuse: f64,
    /// Of the specular reflectance, over texels and channels.
    #[serde(deserialize_with = "crate::export::loss_log::number_or_nan")]
    pub specular: f64,
    /// Of the roughness.
    #[serde(deserialize_with = "crate::export::loss_log::number_or_nan")]
    pub roughness: f64,
    /// Texels and channels whose diffuse reflectance is wrong by more than [`WRONG`].
    #[serde(deserialize_with = "crate::export::loss_log::number_or_nan")]
    pub wrong: f64,
    /// Share of the wrong ones whose stated interval holds the truth: the uncertainty warned of them.
    #[serde(deserialize_with = "crate::export::loss_log::number_or_nan")]
    pub warned: f64,
}

/// Holds stated standard deviations against a truth over the texels of `seen`; `errors` is the comparison of the same
/// maps, whose factors are applied to the diffuse map and its deviations. `None` when sizes differ.
pub fn interval_coverage(
    fitted: &MaterialMaps,
    deviations: &MaterialMaps,
    truth: &MaterialMaps,
    seen: &Image<bool>,
    errors: &MapErrors,
) -> Option<IntervalCoverage> {
    let size = (seen.width(), seen.height());
    let is_alike = |maps: &MaterialMaps| {
        [(maps.diffuse.width(), maps.diffuse.height()), (maps.roughness.width(), maps.roughness.height())] == [size; 2]
    };
    if ![fitted, deviations, truth].into_iter().all(is_alike) {
        return None;
    }
    let (mut diffuse, mut specular, mut roughness, mut warned) = <(Share, Share, Share, Share)>::default();
    for texel in (0..size.0 * size.1).filter(|&texel| seen.pixels()[texel]) {
        for c in 0..3 {
            let scale = errors.diffuse.scale[c] as f32;
            let error = (scale * fitted.diffuse.pixels()[texel][c] - truth.diffuse.pixels()[texel][c]).abs();
            let holds = error <= NINE_TENTHS * scale * deviations.diffuse.pixels()[texel][c];
            diffuse.add(holds);
            if error > WRONG {
                warned.add(holds);
            }
            let error = (fitted.specular.pixels()[texel][c] - truth.specular.pixels()[texel][c]).abs();
            specular.add(error <= NINE_TENTHS * deviations.specular.pixels()[texel][c]);
        }
        let error = (fitted.roughness.pixels()[texel] - truth.roughness.pixels()[texel]).abs();
        roughness.add(error <= NINE_TENTHS * deviations.roughness.pixels()[texel]);
    }
    Some(IntervalCoverage {
        diffuse: diffuse.value(),
        specular: specular.value(),
        roughness: roughness.value(),
        wrong: warned.all as f64 / diffuse.all as f64,
        warned: warned.value(),
    })
}

#[derive(Default)]
struct Share {
    those: u64,
    all: u64,
}

impl Share {
    fn add(&mut self, is_one: bool) {
        self.those += u64::from(is_one);
        self.all += 1;
    }

    fn value(&self) -> f64 {
        self.those as f64 / self.all as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::insight::truth::map_errors;
    use glam::Vec3;

    #[test]
    fn texels_are_counted_by_whether_their_interval_holds_the_truth() {
        let maps = |diffuse: [f32; 4], specular: f32, roughness: f32| MaterialMaps {
            diffuse: Image::from_pixels(2, 2, diffuse.map(Vec3::splat).to_vec()),
            specular: Image::filled(2, 2, Vec3::splat(specular)),
            roughness: Image::filled(2, 2, roughness),
        };
        let truth = maps([0.4, 0.4, 0.4, 0.4], 0.04, 0.3);
        // Twice the truth: the best factor is about a half. The third is wrong and says so, the fourth is not looked at.
        let fitted = maps([0.8, 0.8, 0.4, 5.0], 0.05, 0.5);
        let stated = maps([0.02, 0.4, 0.4, 0.0], 0.005, 0.2);
        let seen = Image::from_pixels(2, 2, vec![true, true, true, false]);
        let errors = map_errors(&fitted, &truth, &seen).unwrap();
        let held = interval_coverage(&fitted, &stated, &truth, &seen, &errors).unwrap();
        assert!((held.diffuse - 2.0 / 3.0).abs() < 1e-12, "{held:?}");
        assert!((held.specular, held.roughness) == (0.0, 1.0), "{held:?}");
        assert!((held.wrong - 1.0 / 3.0).abs() < 1e-12 && held.warned == 1.0, "{held:?}");
        let nothing = Image::filled(2, 2, false);
        let errors = map_errors(&fitted, &truth, &nothing).unwrap();
        assert!(interval_coverage(&fitted, &stated, &truth, &nothing, &errors).unwrap().diffuse.is_nan());
        let larger = Image::filled(3, 2, true);
        assert!(interval_coverage(&fitted, &stated, &truth, &larger, &errors).is_none());
    }
}
