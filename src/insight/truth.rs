//! How far maps and light are from a known truth.

use crate::error::{Error, ErrorKind, Result};
use crate::image::{Image, RgbImage};
use crate::light::Environment;
use crate::light::environment::brightest_direction;
use crate::material::MaterialMaps;
use crate::math::sphere;
use glam::Vec3;

/// An error and its scale-aligned twin.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ErrorPair {
    /// As it is.
    #[serde(deserialize_with = "crate::export::loss_log::number_or_nan")]
    pub raw: f64,
    /// After the best factor per channel.
    #[serde(deserialize_with = "crate::export::loss_log::number_or_nan")]
    pub aligned: f64,
    /// The factor per channel of `aligned`.
    pub scale: [f64; 3],
}

/// Errors of the three maps: RMSE over the texels that count, and channels.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct MapErrors {
    /// Texels that count.
    pub texels: u64,
    /// Of the diffuse reflectance.
    pub diffuse: ErrorPair,
    /// Of the specular reflectance.
    pub specular: ErrorPair,
    /// Of the roughness `r`; the scale of the light does not touch it, the twin only shows a common factor.
    pub roughness: ErrorPair,
    /// Texels left out because a fitted value is not finite.
    pub non_finite_texels: u64,
}

/// Errors of the light.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct EnvironmentErrors {
    /// `sqrt(sum w (x - y)^2 / sum w y^2)` with solid angles `w`, over channels: dominated by the sun.
    pub relative_l2: ErrorPair,
    /// `sqrt(mean (ln(x + e) - ln(y + e))^2)`, solid-angle weighted, `e` a thousandth of the truth's mean radiance:
    /// the dim parts count as much as the sun. Its twin takes the best factor in the logarithm.
    pub log_rmse: ErrorPair,
    /// Angle in degrees between the brightest texels; `None` when one of the maps is black.
    pub brightest_angle_degrees: Option<f64>,
}

/// Compares maps on the same atlas over the texels of `seen`.
///
/// # Errors
/// `InvalidScene` when the sizes differ: maps on different atlases are compared through pictures.
pub fn map_errors(fitted: &MaterialMaps, truth: &MaterialMaps, seen: &Image<bool>) -> Result<MapErrors> {
    let size = (seen.width(), seen.height());
    let roughness_size = |maps: &MaterialMaps| (maps.roughness.width(), maps.roughness.height());
    let sizes = [
        ("fitted diffuse", (fitted.diffuse.width(), fitted.diffuse.height())),
        ("fitted specular", (fitted.specular.width(), fitted.specular.height())),
        ("fitted roughness", roughness_size(fitted)),
        ("true diffuse", (truth.diffuse.width(), truth.diffuse.height())),
        ("true specular", (truth.specular.width(), truth.specular.height())),
        ("true roughness", roughness_size(truth)),
    ];
    for (name, (width, height)) in sizes {
        if (width, height) != size {
            let message =
                format!("the {name} map is {width} x {height}, the texels to compare {} x {}", size.0, size.1);
            return Err(Error::new(ErrorKind::InvalidScene, message)
                .remedy("fit with --uv keep at the truth's map size, or compare layers with `patina render --aov`"));
        }
    }
    let splat = |maps: &MaterialMaps| maps.roughness.map(|&r| Vec3::splat(r));
    let (fitted_roughness, true_roughness) = (splat(fitted), splat(truth));
    let finite = |index: usize| {
        let maps = [&fitted.diffuse, &fitted.specular, &fitted_roughness];
        maps.iter().all(|map| map.pixels()[index].is_finite())
    };
    let counted: Vec<usize> = (0..size.0 * size.1).filter(|&i| seen.pixels()[i]).collect();
    let (counted, broken): (Vec<usize>, Vec<usize>) = counted.into_iter().partition(|&index| finite(index));
    let weights: Vec<(usize, f64)> = counted.iter().map(|&index| (index, 1.0)).collect();
    let rmse = |fitted: &RgbImage, truth: &RgbImage| weighted_error(fitted, truth, &weights, Norm::PerTexel);
    Ok(MapErrors {
        texels: counted.len() as u64,
        diffuse: rmse(&fitted.diffuse, &truth.diffuse),
        specular: rmse(&fitted.specular, &truth.specular),
        roughness: rmse(&fitted_roughness, &true_roughness),
        non_finite_texels: broken.len() as u64,
    })
}

/// Compares two lights of the same size.
///
/// # Errors
/// `InvalidScene` when the sizes differ: resample one of them first.
pub fn environment_errors(fitted: &Environment, truth: &Environment) -> Result<EnvironmentErrors> {
    let (fitted, truth) = (&fitted.radiance, &truth.radiance);
    let (width, height) = (truth.width(), truth.height());
    if (fitted.width(), fitted.height()) != (width, height) {
        let message =
            format!("the fitted light is {} x {}, the true one {width} x {height}", fitted.width(), fitted.height());
        return Err(Error::new(ErrorKind::InvalidScene, message).remedy("resample the truth to the fitted size"));
    }
    let weights: Vec<(usize, f64)> = (0..width * height)
        .filter(|&index| fitted.pixels()[index].is_finite() && truth.pixels()[index].is_finite())
        .map(|index| (index, sphere::solid_angle_of_texel(index / width, width, height)))
        .collect();
    let total: f64 = weights.iter().map(|(_, weight)| weight).sum();
    let mean: f64 = weights.iter().map(|&(i, w)| w * f64::from(truth.pixels()[i].element_sum()) / 3.0).sum::<f64>();
    let epsilon = (1e-3 * mean / total).max(f64::MIN_POSITIVE);

    let brightest = |of: &RgbImage| brightest_direction(of.pixels().iter().copied(), width, height);
    Ok(EnvironmentErrors {
        relative_l2: weighted_error(fitted, truth, &weights, Norm::RelativeToTruth),
        log_rmse: log_error(fitted, truth, &weights, epsilon),
        brightest_angle_degrees: brightest(fitted)
            .zip(brightest(truth))
            .map(|(a, b)| f64::from(a.angle_between(b)).to_degrees()),
    })
}

enum Norm {
    PerTexel,
    RelativeToTruth,
}

/// Root of the weighted squared difference, raw and after the best factor per channel.
fn weighted_error(fitted: &RgbImage, truth: &RgbImage, weights: &[(usize, f64)], norm: Norm) -> ErrorPair {
    let values = |&(index, weight): &(usize, f64), channel: usize| {
        (weight, f64::from(fitted.pixels()[index][channel]), f64::from(truth.pixels()[index][channel]))
    };
    let scale: [f64; 3] = std::array::from_fn(|channel| {
        let (mut product, mut squared) = (0.0, 0.0);
        for texel in weights {
            let (weight, x, y) = values(texel, channel);
            product += weight * x * y;
            squared += weight * x * x;
        }
        let scale = product / squared;
        if scale.is_finite() && scale > 0.0 { scale } else { 1.0 }
    });
    let (mut raw, mut aligned, mut truth_squared, mut total) = (0.0, 0.0, 0.0, 0.0);
    for texel in weights {
        for (channel, factor) in scale.iter().enumerate() {
            let (weight, x, y) = values(texel, channel);
            raw += weight * (x - y) * (x - y);
            aligned += weight * (factor * x - y) * (factor * x - y);
            truth_squared += weight * y * y;
            total += weight;
        }
    }
    let divisor = match norm {
        Norm::PerTexel => total,
        Norm::RelativeToTruth => truth_squared,
    };
    ErrorPair { raw: (raw / divisor).sqrt(), aligned: (aligned / divisor).sqrt(), scale }
}

/// Root of the weighted mean squared difference of natural logarithms, raw and after its own best factor per channel:
/// the aligned error is the standard deviation of the difference.
fn log_error(fitted: &RgbImage, truth: &RgbImage, weights: &[(usize, f64)], epsilon: f64) -> ErrorPair {
    let mut scale = [1.0; 3];
    let (mut raw, mut aligned) = (0.0, 0.0);
    let total: f64 = weights.iter().map(|(_, weight)| weight).sum();
    for (channel, factor) in scale.iter_mut().enumerate() {
        let (mut first, mut second) = (0.0, 0.0);
        for &(index, weight) in weights {
            let log = |image: &RgbImage| (f64::from(image.pixels()[index][channel]).max(0.0) + epsilon).ln();
            let difference = log(fitted) - log(truth);
            first += weight * difference;
            second += weight * difference * difference;
        }
        let mean = first / total;
        let best = (-mean).exp();
        *factor = if best.is_finite() { best } else { 1.0 };
        raw += second / total / 3.0;
        aligned += (second / total - mean * mean).max(0.0) / 3.0;
    }
    ErrorPair { raw: raw.sqrt(), aligned: aligned.sqrt(), scale }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn maps(diffuse: f32, specular: f32, roughness: f32) -> MaterialMaps {
        MaterialMaps {
            diffuse: Image::filled(2, 2, Vec3::splat(diffuse)),
            specular: Image::filled(2, 2, Vec3::splat(specular)),
            roughness: Image::filled(2, 2, roughness),
        }
    }

    #[test]
    fn map_errors_count_seen_texels_only() {
        let truth = maps(0.4, 0.04, 0.3);
        let mut fitted = maps(0.2, 0.05, 0.5);
        fitted.diffuse[(0, 0)] = Vec3::splat(100.0);
        fitted.specular[(1, 1)] = Vec3::NAN;
        let seen = Image::from_pixels(2, 2, vec![false, true, true, true]);
        let errors = map_errors(&fitted, &truth, &seen).unwrap();
        assert_eq!((errors.texels, errors.non_finite_texels), (2, 1));
        assert!((errors.diffuse.raw - 0.2).abs() < 1e-6 && errors.diffuse.aligned < 1e-7);
        assert!((errors.diffuse.scale[1] - 2.0).abs() < 1e-6);
        assert!((errors.specular.raw - 0.01).abs() < 1e-6);
        assert!((errors.roughness.raw - 0.2).abs() < 1e-6);
        let nothing = map_errors(&fitted, &truth, &Image::filled(2, 2, false)).unwrap();
        assert!(nothing.diffuse.raw.is_nan() && nothing.texels == 0);
        assert!(map_errors(&fitted, &truth, &Image::filled(3, 2, true)).is_err());
    }

    #[test]
    fn light_errors_match_a_hand_calculation() {
        // Two rows: both bands have the solid angle 2 pi, so weights are equal.
        let light = |top: f32, bottom: f32| Environment {
            radiance: Image::from_fn(4, 2, |row, _| Vec3::splat(if row == 0 { top } else { bottom })),
        };
        let errors = environment_errors(&light(2.0, 1.0), &light(1.0, 1.0)).unwrap();
        assert!((errors.relative_l2.raw - 0.5f64.sqrt()).abs() < 1e-6);
        // Best factor (2 + 1) / (4 + 1) = 0.6: errors 0.2 and -0.4.
        assert!((errors.relative_l2.aligned - (0.2f64 / 2.0).sqrt()).abs() < 1e-6);
        let log_ratio = (2.001f64 / 1.001).ln();
        assert!((errors.log_rmse.raw - log_ratio / 2f64.sqrt()).abs() < 1e-6);
        assert!((errors.log_rmse.aligned - log_ratio / 2.0).abs() < 1e-6);

        let twice = environment_errors(&light(2.0, 6.0), &light(1.0, 3.0)).unwrap();
        assert!(twice.relative_l2.aligned < 1e-7 && (twice.relative_l2.raw - 1.0).abs() < 1e-6);
        // The logarithm's epsilon leaves a trace of the scale.
        assert!(twice.log_rmse.aligned < 1e-3);
    }

    #[test]
    fn the_brightest_texels_are_compared_by_angle_and_black_lights_do_not_panic() {
        let sun = |row: usize, column: usize| {
            let mut radiance = Image::filled(64, 32, Vec3::ONE);
            radiance[(row, column)] = Vec3::splat(1e6);
            Environment { radiance }
        };
        // The row above the equator's lower neighbour: 16 columns are a quarter of the circle, at height 2.8 degrees.
        let errors = environment_errors(&sun(15, 0), &sun(15, 16)).unwrap();
        assert!((errors.brightest_angle_degrees.unwrap() - 90.0).abs() < 0.2, "{errors:?}");
        let black = Environment { radiance: Image::filled(64, 32, Vec3::ZERO) };
        let errors = environment_errors(&black, &black).unwrap();
        assert_eq!(errors.brightest_angle_degrees, None);
        assert!(errors.log_rmse.raw == 0.0);
        let empty = Environment { radiance: Image::filled(0, 0, Vec3::ZERO) };
        assert!(environment_errors(&empty, &empty).unwrap().relative_l2.raw.is_nan());
    }
}
