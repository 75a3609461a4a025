//! What a scene gives a fit, looked at once before anything moves: an error here costs nothing, one after an hour does.

use super::settings::{BackgroundEvidence, FitSettings};
use super::targets::is_radiance;
use crate::error::{Error, ErrorKind, Place, Result};
use crate::scene::{Background, PixelState, Scene};

/// How far the rows of a camera's rotation may be from orthonormal.
const ROTATION_TOLERANCE: f32 = 1e-3;

/// Checks that every camera is one, that photos have the size of their cameras, and that some pixel of the views of the
/// fit can be evidence.
pub fn check(scene: &Scene, training: &[usize], settings: &FitSettings) -> Result<()> {
    for view in &scene.views {
        let place = || Place::View(view.name.clone());
        let camera = &view.camera;
        camera.validate(ROTATION_TOLERANCE).map_err(|error| error.at(place()))?;
        let sizes = [(view.photo.width(), view.photo.height()), (view.states.width(), view.states.height())];
        for (name, size) in ["photo", "mask"].into_iter().zip(sizes) {
            if size != (camera.width, camera.height) {
                let message = format!(
                    "the {name} has {} x {} pixels, the camera {} x {}",
                    size.0, size.1, camera.width, camera.height
                );
                return Err(Error::new(ErrorKind::InvalidScene, message)
                    .at(place())
                    .remedy("give each photo the camera of its own size"));
            }
        }
    }
    let use_background = scene.background == Background::Environment && settings.background == BackgroundEvidence::Use;
    let says_something = |state: &PixelState| state.is_surface() || (use_background && *state != PixelState::Ignored);
    if !training.iter().any(|&view| scene.views[view].states.pixels().iter().any(says_something)) {
        return Err(Error::new(ErrorKind::InvalidScene, "no pixel of any view is evidence: the masks leave none")
            .remedy("check that the masks are not inverted or black, or do without them"));
    }
    Ok(())
}

/// Pixels of the photos that are no radiance, by name and number: a fit leaves them out.
pub fn defects_of_photos(scene: &Scene) -> Vec<(String, u64)> {
    let mut defects = Vec::new();
    for view in &scene.views {
        // Eight bits always hold a radiance.
        if !view.photo.is_linear() {
            continue;
        }
        let (mut count, mut first) = (0, (0, 0));
        for row in 0..view.camera.height {
            for column in 0..view.camera.width {
                if view.states[(row, column)] != PixelState::Ignored && !is_radiance(view.photo.radiance(row, column)) {
                    if count == 0 {
                        first = (row, column);
                    }
                    count += 1;
                }
            }
        }
        if count > 0 {
            let (row, column) = first;
            defects.push((format!("pixels of the photo {}, first at row {row} column {column}", view.name), count));
        }
    }
    defects
}
