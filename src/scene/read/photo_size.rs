//! Photos of another size than their cameras were calibrated for: intrinsics follow the size of each file.

use super::source::SourceView;
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::image::file;
use crate::math::parallel;

/// The sides of a photo may be rounded by so many pixels when it is made smaller.
const ROUNDING_PIXELS: f64 = 1.0;

/// Width and height of each view's photo as its file says, before any turning.
///
/// # Errors
/// The first photo, in the order of `views`, that cannot be read.
pub fn of_files(views: &[SourceView]) -> Result<Vec<(usize, usize)>> {
    parallel::map_items(views, |view| file::read_size(&view.photo)).into_iter().collect()
}

/// By how much a size is larger than another of the same shape; `None` for another shape.
fn scale_of(size: (usize, usize), claimed: (usize, usize)) -> Option<f64> {
    // As a damaged calibration claims them, sides have products beyond a whole number's range.
    let area = |(width, height): (usize, usize)| width as f64 * height as f64;
    let mean = (area(size) / area(claimed)).sqrt();
    let off = [(size.0, claimed.0), (size.1, claimed.1)].map(|(own, side)| (own as f64 - side as f64 * mean).abs());
    (off[0].max(off[1]) <= ROUNDING_PIXELS).then_some(mean)
}

/// Scales the intrinsics of views to the true `sizes` of their photos, by each side's own ratio. The first pixel's centre is at
/// (0.5, 0.5), so that the picture's corner stays. A photo on its side, of its camera's size or another, is left to its
/// orientation.
///
/// # Errors
/// A photo whose sides were not scaled alike.
pub fn fit_to_photos(views: &mut [SourceView], sizes: &[(usize, usize)], findings: &mut Vec<Finding>) -> Result<()> {
    let mut scaled = 0usize;
    let (mut least, mut most) = (f64::INFINITY, 0.0f64);
    for (view, &size) in views.iter_mut().zip(sizes) {
        let Some(claimed) = view.size else { continue };
        if size == claimed || size == (claimed.1, claimed.0) || claimed.0 == 0 || claimed.1 == 0 {
            continue;
        }
        let seen = [size, (size.1, size.0)].into_iter().find_map(|seen| Some((seen, scale_of(seen, claimed)?)));
        let Some((seen, mean)) = seen else {
            return Err(Error::new(
                ErrorKind::InvalidScene,
                format!(
                    "the photo is {} x {} but its camera is for {} x {}, another aspect ratio",
                    size.0, size.1, claimed.0, claimed.1
                ),
            )
            .at(Place::File(view.photo.clone()))
            .remedy("use the photos the cameras were calibrated on: a crop needs a calibration of its own"));
        };
        let ratio = [seen.0 as f64 / claimed.0 as f64, seen.1 as f64 / claimed.1 as f64];
        let intrinsics = &mut view.camera.intrinsics;
        intrinsics.x_axis.x *= ratio[0];
        intrinsics.z_axis.x *= ratio[0];
        intrinsics.y_axis.y *= ratio[1];
        intrinsics.z_axis.y *= ratio[1];
        view.size = Some(seen);
        scaled += 1;
        (least, most) = (least.min(mean), most.max(mean));
    }
    if scaled > 0 {
        let by = if most - least < 1e-3 { format!("{most:.4}") } else { format!("{least:.4} to {most:.4}") };
        findings.push(Finding::new(
            Severity::Note,
            "intrinsics-scaled",
            format!(
                "{scaled} of {} photos are {by} times the size they were calibrated at: their intrinsics are scaled to match",
                views.len()
            ),
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::read::colmap_lens::matrix;
    use crate::scene::read::source::SourceCamera;
    use glam::{DMat3, DVec3};

    #[test]
    fn a_photo_that_was_made_smaller_and_lies_on_its_side_is_left_to_its_orientation() {
        let intrinsics = matrix([400.0; 2], [120.0, 200.0]);
        let camera = SourceCamera { intrinsics, rotation: DMat3::IDENTITY, translation: DVec3::ZERO };
        let photo = "a.jpg".into();
        let place = Place::Nowhere;
        let view =
            SourceView { name: "a".into(), photo, mask: None, camera, lens: None, size: Some((240, 400)), place };
        let fitted = |size: (usize, usize)| {
            let mut views = [view.clone()];
            fit_to_photos(&mut views, &[size], &mut Vec::new())?;
            let [view] = views;
            Ok::<_, Error>((view.size, view.camera.intrinsics.row(0).z, view.camera.intrinsics.row(1).z))
        };
        assert_eq!(fitted((120, 200)).unwrap(), (Some((120, 200)), 60.0, 100.0));
        assert_eq!(fitted((200, 120)).unwrap(), (Some((120, 200)), 60.0, 100.0));
        assert_eq!(fitted((400, 240)).unwrap(), (Some((240, 400)), 120.0, 200.0));
        let error = fitted((200, 150)).unwrap_err();
        assert!(error.message().contains("another aspect ratio"), "{error}");
    }
}
