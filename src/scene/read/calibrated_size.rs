//! Intrinsics that are for photos of another size than the ones that are there.
//!
//! Photos are often calibrated at one size and delivered at another. Where the source says the size its cameras are for,
//! `photo_size` scales them. Where it does not, the principal point tells: it lies in the middle of a picture within a few
//! percent, and for photos twice as large it lies at a quarter, in both directions and in every view. A crop does not move
//! it so in both directions by the same factor.

use super::photos::LoadedPhoto;
use super::source::SourceView;
use crate::error::{Finding, Severity};
use crate::math::statistics::quantile;
use glam::{DMat3, DVec3};

/// A principal point this far from the middle, as a factor, is still that of a photo of this size.
const OWN_FACTOR: f64 = 1.45;
/// How far the factors across and down may differ, and those of the views.
const SPREAD: f64 = 0.06;
/// How far a factor may be off a whole number, or one over it, to be taken for that.
const OFF_WHOLE: f64 = 0.08;

/// Scales the intrinsics of views to the size of their photos, where they are clearly for another one, and tells. Returns by how
/// much.
///
/// `centre_shift` is what is added to the source's principal points to count from the corner of the first pixel.
pub fn fit(views: &mut [SourceView], loaded: &[LoadedPhoto], centre_shift: f64, findings: &mut Vec<Finding>) -> f64 {
    let Some(factor) = common_factor(views, loaded, centre_shift) else { return 1.0 };
    let whole = if factor > 1.0 { factor.round() } else { 1.0 / (1.0 / factor).round() };
    if (factor / whole - 1.0).abs() > OFF_WHOLE {
        findings.push(
            Finding::new(
                Severity::Fatal,
                "photos-of-another-size",
                format!("the photos are some {factor:.2} times the size that the intrinsics are for: no camera can be of them"),
            )
            .remedy("scale the intrinsics with the photos, or use the photos the cameras were made for"),
        );
        return 1.0;
    }
    views.iter_mut().for_each(|view| scale(view, whole, centre_shift));
    findings.push(
        Finding::new(
            Severity::Warning,
            "intrinsics-scaled",
            format!("the photos are {whole} times the size that the intrinsics are for: the intrinsics are scaled with them"),
        )
        .remedy("look at the outlines over the photos (check -o FOLDER); if the photos were cropped, correct the intrinsics"),
    );
    whole
}

/// How much larger the photos are than their principal points say, where all views agree that they are.
fn common_factor(views: &[SourceView], loaded: &[LoadedPhoto], centre_shift: f64) -> Option<f64> {
    let mut factors = Vec::with_capacity(views.len());
    for (view, photo) in views.iter().zip(loaded) {
        if view.size.is_some() {
            return None;
        }
        let (cx, cy) = (view.camera.intrinsics.row(0).z, view.camera.intrinsics.row(1).z);
        let across = photo.file_size.0 as f64 / (2.0 * (cx + centre_shift));
        let down = photo.file_size.1 as f64 / (2.0 * (cy + centre_shift));
        if !(across > 0.0 && down > 0.0) || (across / down - 1.0).abs() > SPREAD {
            return None;
        }
        factors.push((across * down).sqrt());
    }
    let middle = quantile(&factors, 0.5);
    let is_other = !(1.0 / OWN_FACTOR..=OWN_FACTOR).contains(&middle);
    (is_other && factors.iter().all(|factor| (factor / middle - 1.0).abs() < SPREAD)).then_some(middle)
}

/// Scales a picture about the corner of its first pixel.
fn scale(view: &mut SourceView, factor: f64, centre_shift: f64) {
    let intrinsics = &mut view.camera.intrinsics;
    let shift = DVec3::new(centre_shift, centre_shift, 0.0);
    let about_corner = DMat3::from_cols(intrinsics.x_axis, intrinsics.y_axis, intrinsics.z_axis + shift);
    let scaled = DMat3::from_diagonal(DVec3::new(factor, factor, 1.0)) * about_corner;
    *intrinsics = DMat3::from_cols(scaled.x_axis, scaled.y_axis, scaled.z_axis - shift);
    view.size = None;
}
