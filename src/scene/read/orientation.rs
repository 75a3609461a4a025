//! How a photo lies: as stored, or turned by its EXIF orientation. The camera decides.
//!
//! Programs that calibrate cameras disagree: some turn photos upright first, some take them as stored. A camera that is for
//! the stored width and height wants the photo as stored; one for the exchanged sides wants it turned; another is for another
//! photo. Where a source gives no size, the principal point tells: it lies near the middle of the picture. A turn that leaves
//! the sides as they are is not for the camera to say: the pixels do, in `orientation_trial`.

use super::source::SourceView;
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::image::file::{PhotoFile, swaps_sides};
use std::collections::BTreeMap;

/// Photos that are to be turned by their EXIF orientation though their cameras do not say so, by the names of their views.
pub type Turns = BTreeMap<String, Turn>;

/// What is to be turned of a view.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Turn {
    /// The mask, which may lie as the photo's file does or as its camera sees it.
    pub mask: bool,
}

/// The photo as its camera sees it, what was done as a finding without a place, and the orientation where the camera does not
/// say whether it applies: such a photo is turned only when it `must` be.
///
/// # Errors
/// `InvalidScene` when the camera is for neither size, with all of them.
pub fn as_the_camera_sees(
    photo: PhotoFile,
    view: &SourceView,
    must: bool,
    shared: &mut Vec<Finding>,
) -> Result<(PhotoFile, Option<u8>)> {
    let (stored, tag) = (photo.size(), photo.orientation);
    let swapped = (stored.1, stored.0);
    let can_turn = swaps_sides(tag) && stored != swapped;
    let turns = match view.size {
        Some(size) if size == stored => false,
        Some(size) if size == swapped && can_turn => true,
        Some(size) if size == swapped => {
            let message = format!(
                "the photo is {} x {} but its camera is for {} x {}: it was turned by 90 degrees, and no EXIF orientation says so",
                stored.0, stored.1, size.0, size.1
            );
            return Err(Error::new(ErrorKind::InvalidScene, message)
                .at(Place::File(view.photo.clone()))
                .remedy("turn the photo by 90 degrees, to lie as it did when its camera was calibrated"));
        }
        Some(size) => {
            let turned = if can_turn {
                format!(" ({} x {} when turned by its EXIF orientation {tag})", swapped.0, swapped.1)
            } else {
                String::new()
            };
            return Err(Error::new(
                ErrorKind::InvalidScene,
                format!(
                    "the photo is {} x {}{turned} but its camera is for {} x {}",
                    stored.0, stored.1, size.0, size.1
                ),
            )
            .at(Place::File(view.photo.clone()))
            .remedy("use the photos the cameras were made for, or scale the intrinsics with them"));
        }
        None => can_turn && distance_to_middle(view, swapped) < distance_to_middle(view, stored),
    };
    if tag == 1 {
        return Ok((photo, None));
    }
    if !swaps_sides(tag) || stored == swapped {
        return Ok((if must { photo.turned() } else { photo }, Some(tag)));
    }
    shared.push(if turns {
        let message = format!("turned by the EXIF orientation {tag}: the cameras are for the upright picture");
        Finding::new(Severity::Note, "photo-turned", message)
    } else {
        let message = format!("the EXIF orientation {tag} is not applied: the cameras are for the picture as stored");
        Finding::new(Severity::Note, "photo-as-stored", message)
            .remedy("if photos lie on their side, turn them in an editor")
    });
    Ok((if turns { photo.turned() } else { photo }, None))
}

/// How far the principal point is from the middle of a picture, in widths and heights of it.
fn distance_to_middle(view: &SourceView, size: (usize, usize)) -> f64 {
    let along = |row: usize, length: usize| (view.camera.intrinsics.row(row).z / length.max(1) as f64 - 0.5).abs();
    along(0, size.0) + along(1, size.1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;
    use crate::image::file::PhotoPixels;
    use crate::scene::read::source::SourceCamera;
    use glam::{DMat3, DVec3};

    fn view(size: Option<(usize, usize)>, principal_point: (f64, f64)) -> SourceView {
        let camera = SourceCamera {
            intrinsics: DMat3::from_cols(
                DVec3::new(9.0, 0.0, 0.0),
                DVec3::new(0.0, 9.0, 0.0),
                DVec3::new(principal_point.0, principal_point.1, 1.0),
            ),
            rotation: DMat3::IDENTITY,
            translation: DVec3::ZERO,
        };
        let place = Place::Nowhere;
        SourceView { name: "a".into(), photo: "a.jpg".into(), mask: None, camera, lens: None, size, place }
    }

    fn photo(width: usize, height: usize, orientation: u8) -> PhotoFile {
        let pixels = PhotoPixels::Srgb8(Image::filled(width, height, [0; 3]));
        PhotoFile { pixels, orientation, ..PhotoFile::default() }
    }

    #[test]
    fn the_camera_decides_by_its_size_or_its_principal_point() {
        let seen = |tag, view: &SourceView| {
            let mut told = Vec::new();
            let (photo, open) = as_the_camera_sees(photo(6, 4, tag), view, false, &mut told).unwrap();
            (photo.size(), told.first().map(|finding| finding.code).or(open.map(|_| "open")))
        };
        let stored = view(Some((6, 4)), (3.0, 2.0));
        let upright = view(Some((4, 6)), (2.0, 3.0));
        assert_eq!(seen(1, &stored), ((6, 4), None));
        assert_eq!(seen(6, &stored), ((6, 4), Some("photo-as-stored")));
        assert_eq!(seen(8, &upright), ((4, 6), Some("photo-turned")));
        assert_eq!(seen(3, &stored), ((6, 4), Some("open")));
        assert_eq!(seen(6, &view(None, (1.5, 2.5))), ((4, 6), Some("photo-turned")));
        assert_eq!(seen(6, &view(None, (2.6, 1.9))), ((6, 4), Some("photo-as-stored")));
    }

    #[test]
    fn a_camera_for_another_photo_is_an_error_with_all_numbers() {
        let error =
            as_the_camera_sees(photo(6, 4, 6), &view(Some((12, 8)), (6.0, 4.0)), false, &mut Vec::new()).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::InvalidScene);
        assert!(error.message().contains("6 x 4 (4 x 6") && error.message().contains("12 x 8"), "{error}");
        let error =
            as_the_camera_sees(photo(6, 4, 1), &view(Some((4, 6)), (2.0, 3.0)), false, &mut Vec::new()).unwrap_err();
        assert!(
            error.message().contains("is 6 x 4 but") && error.message().contains("turned by 90 degrees"),
            "{error}"
        );
    }
}
