//! How far a model's picture of a sphere is from that of the table it stands for.
//!
//! The sphere stands under the three lamps of [`sphere::showing_lamps`]: a figure of tables counts every cell alike,
//! this one what is seen.

use super::coordinates::HalfDifference;
use super::sphere;
use super::table::MeasuredBrdf;
use crate::error::Result;

/// Side of the pictures in pixels.
const SIZE: usize = 128;
/// Added to radiance before the logarithm, over the mean of the true picture.
const FLOOR_SHARE: f64 = 1e-3;

/// Errors of a picture of a sphere.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct SphereError {
    /// Root mean square as displayed, see [`sphere::displayed_scores`]: 0 to 1.
    pub displayed_rmse: f64,
    /// Root mean square of the natural logarithm of one picture over the other, over pixels and channels.
    pub log_rmse: f64,
}

/// The errors of a reflectance, in 1/sr without the cosine, against a table.
///
/// # Errors
/// None in practice: the pictures are of one size.
pub fn sphere_error(
    reflectance: &(dyn Fn(HalfDifference) -> [f64; 3] + Sync),
    table: &MeasuredBrdf,
) -> Result<SphereError> {
    let lamps = sphere::showing_lamps();
    let truth = sphere::render_table(SIZE, table, &lamps);
    let own = sphere::render_sphere(SIZE, reflectance, &lamps);
    let mask = sphere::sphere_mask(SIZE);
    let inside = || {
        let pairs = own.pixels().iter().zip(truth.pixels()).zip(mask.pixels());
        pairs.filter(|(_, inside)| **inside).map(|(pair, _)| pair)
    };
    let count = inside().count().max(1) as f64;
    let floor = FLOOR_SHARE * inside().map(|(_, truth)| f64::from(truth.element_sum()) / 3.0).sum::<f64>() / count;
    let floor = floor.max(1e-12);
    let squares: f64 = inside()
        .flat_map(|(own, truth)| {
            [0, 1, 2].map(|c| ((f64::from(own[c]) + floor).ln() - (f64::from(truth[c]) + floor).ln()).powi(2))
        })
        .sum();
    let displayed_rmse = sphere::displayed_scores(&own, &truth)?.rmse;
    Ok(SphereError { displayed_rmse, log_rmse: (squares / (3.0 * count)).sqrt() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_has_no_error_and_half_as_bright_the_logarithm_of_two() {
        let value = |at: HalfDifference| [0.2 + (-(at.theta_half / 0.3).powi(2)).exp(), 0.3, 0.1];
        let table = MeasuredBrdf::from_fn(value);
        let none = sphere_error(&|at| table.lookup(at).unwrap_or_default(), &table).unwrap();
        assert_eq!(none, SphereError::default());
        let half = sphere_error(&|at| table.lookup(at).unwrap_or_default().map(|v| 0.5 * v), &table).unwrap();
        assert!((half.log_rmse - 2f64.ln()).abs() < 0.03 && half.displayed_rmse > 0.05, "{half:?}");
    }
}
