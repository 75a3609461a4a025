//! From the source's world to the program's: +y up, and near the origin where `f32` needs it.

use crate::error::{Error, ErrorKind, Finding, Result, Severity};
use crate::scene::settings::Up;
use crate::scene::{WorldFromSource, read::source::SourceCamera};
use glam::{DMat3, DQuat, DVec3};

/// Coordinates further from the origin than this many diagonals of the bounding box are recentred: there a step of
/// `f32` is about a 100,000th of the scene, a hundredth of a pixel.
const FAR_DIAGONALS: f64 = 100.0;
/// An estimated up direction this close to an axis of the source is taken to be that axis.
const SNAP_DEGREES: f64 = 20.0;

/// The point to take as origin when the box is so far out that `f32` would lose its shape; whole units.
pub fn far_origin(low: DVec3, high: DVec3) -> Option<DVec3> {
    let centre = 0.5 * (low + high);
    let diagonal = (high - low).length();
    (centre.length() > FAR_DIAGONALS * diagonal && diagonal > 0.0).then(|| centre.round())
}

/// The up direction of the source: as asked, or estimated from the cameras.
///
/// People hold cameras level: the x axes of the cameras lie in the horizontal plane and their -y axes lean upwards.
/// So up is the direction that is most orthogonal to all x axes, on the side of the mean -y axis; where the x axes do
/// not span a plane (one view, a straight dolly), the mean -y axis decides alone.
pub fn up_in_source(asked: Up, cameras: &[SourceCamera]) -> Result<(DVec3, Vec<Finding>)> {
    if let Some(direction) = asked.direction_in_source() {
        return Ok((direction, Vec::new()));
    }
    let mut findings = Vec::new();
    let mut minus_y = DVec3::ZERO;
    let mut minus_z = DVec3::ZERO;
    let mut gram_of_x = DMat3::ZERO;
    for camera in cameras {
        let rows = camera.rotation.transpose();
        let right = rows.x_axis;
        minus_y -= rows.y_axis;
        minus_z -= rows.z_axis;
        gram_of_x += DMat3::from_cols(right * right.x, right * right.y, right * right.z);
    }
    let count = cameras.len().max(1) as f64;
    let uncertain = |findings: &mut Vec<Finding>, message: &str| {
        findings.push(
            Finding::new(Severity::Warning, "up-uncertain", message)
                .remedy("look at a preview and give --up X, Y, Z, -X, -Y or -Z if the scene lies on its side"),
        );
    };
    let mean = if minus_y.length() > 0.3 * count {
        minus_y / count
    } else if minus_z.length() > 0.7 * count {
        uncertain(&mut findings, "the cameras look straight down: up is taken against their view direction");
        minus_z / count
    } else {
        uncertain(&mut findings, "the cameras do not agree on an up direction");
        if minus_y.length() > 1e-6 { minus_y } else { DVec3::Y }
    };
    let mut up = mean.normalize_or(DVec3::Y);
    // Inverse iteration with a shift: min over u of Σ (x·u)² + λ |u - u₀|², from u₀ = up, keeps to up where the x axes
    // say nothing and goes to their common normal where they do.
    let shift = 0.02 * count;
    for _ in 0..8 {
        let solved = (gram_of_x + DMat3::from_diagonal(DVec3::splat(shift))).inverse() * up;
        up = solved.normalize_or(up);
    }
    if up.dot(mean) < 0.5 * mean.length() {
        up = mean.normalize_or(DVec3::Y);
        uncertain(&mut findings, "the horizons of the cameras contradict their up directions: some photos are rotated");
    }
    let snapped = Up::NAMED
        .into_iter()
        .filter_map(|named| Some((named, named.direction_in_source()?)))
        .map(|(named, axis)| (named, axis, up.dot(axis).clamp(-1.0, 1.0).acos().to_degrees()))
        .min_by(|a, b| a.2.total_cmp(&b.2));
    if let Some((named, axis, degrees)) = snapped.filter(|(_, _, degrees)| *degrees <= SNAP_DEGREES) {
        findings.push(Finding::new(
            Severity::Note,
            "up-estimated",
            format!("up is {named} of the source: the cameras say {degrees:.1} degrees from it"),
        ));
        return Ok((axis, findings));
    }
    if !up.is_finite() {
        return Err(Error::new(ErrorKind::Numerical, "no up direction can be estimated").remedy("give --up"));
    }
    findings.push(Finding::new(
        Severity::Note,
        "up-estimated",
        format!("up is ({:.3}, {:.3}, {:.3}) of the source, by the cameras: no axis is near", up.x, up.y, up.z),
    ));
    Ok((up, findings))
}

/// The world whose +y is `up` of the source. For an axis the rotation is exact.
pub fn world_from_source(up: DVec3, bounds: Option<(DVec3, DVec3)>) -> WorldFromSource {
    // Columns are the images of the source's axes.
    let rotation = if up == DVec3::Y {
        DMat3::IDENTITY
    } else if up == DVec3::NEG_Y {
        DMat3::from_cols(DVec3::X, DVec3::NEG_Y, DVec3::NEG_Z)
    } else if up == DVec3::Z {
        DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y)
    } else if up == DVec3::NEG_Z {
        DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y)
    } else if up == DVec3::X {
        DMat3::from_cols(DVec3::Y, DVec3::NEG_X, DVec3::Z)
    } else if up == DVec3::NEG_X {
        DMat3::from_cols(DVec3::NEG_Y, DVec3::X, DVec3::Z)
    } else {
        DMat3::from_quat(DQuat::from_rotation_arc(up, DVec3::Y))
    };
    let origin_in_source = bounds.and_then(|(low, high)| far_origin(low, high)).unwrap_or_default();
    WorldFromSource { rotation, origin_in_source, unit_in_metres: None }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn level_camera(azimuth: f64, pitch: f64, up_from_y: DMat3) -> SourceCamera {
        let forward = DVec3::new(azimuth.sin() * pitch.cos(), pitch.sin(), azimuth.cos() * pitch.cos());
        let right = forward.cross(DVec3::Y).normalize();
        let down = forward.cross(right);
        SourceCamera {
            intrinsics: DMat3::IDENTITY,
            rotation: DMat3::from_cols(right, down, forward).transpose() * up_from_y.transpose(),
            translation: DVec3::ZERO,
        }
    }

    #[test]
    fn each_axis_turns_to_plus_y_by_a_proper_rotation() {
        let tilted = DVec3::new(1.0, 2.0, -0.5).normalize();
        for up in Up::NAMED.into_iter().filter_map(Up::direction_in_source).chain([tilted]) {
            let rotation = world_from_source(up, None).rotation;
            assert!((rotation * up - DVec3::Y).length() < 1e-12, "{up}");
            assert!((rotation.determinant() - 1.0).abs() < 1e-12, "{up}");
        }
    }

    #[test]
    fn level_cameras_that_all_look_down_still_give_the_exact_up() {
        for axis in Up::NAMED {
            let Some(direction) = axis.direction_in_source() else { continue };
            let up_from_y = world_from_source(direction, None).rotation.transpose();
            let cameras: Vec<_> = (0..5).map(|i| level_camera(0.3 * f64::from(i), -0.9, up_from_y)).collect();
            let (up, findings) = up_in_source(Up::Auto, &cameras).unwrap();
            assert_eq!(up, direction);
            assert_eq!(findings[0].code, "up-estimated");
        }
    }

    #[test]
    fn one_view_and_nadir_views_give_an_answer() {
        let (up, _) = up_in_source(Up::Auto, &[level_camera(0.4, -0.1, DMat3::IDENTITY)]).unwrap();
        assert_eq!(up, DVec3::Y);
        let nadir: Vec<_> = (0..6).map(|i| level_camera(f64::from(i), -1.55, DMat3::IDENTITY)).collect();
        let (up, findings) = up_in_source(Up::Auto, &nadir).unwrap();
        assert_eq!(up, DVec3::Y);
        assert!(findings.iter().any(|finding| finding.code == "up-uncertain"));
    }

    #[test]
    fn survey_coordinates_are_recentred_and_others_left_alone() {
        let far = DVec3::new(500_000.3, 4_000_000.0, 100.0);
        assert_eq!(far_origin(far, far + 10.0).unwrap(), (far + 5.0).round());
        assert!(far_origin(DVec3::ZERO, DVec3::splat(100.0)).is_none());
        assert!(far_origin(DVec3::splat(300.0), DVec3::splat(310.0)).is_none());
    }
}
