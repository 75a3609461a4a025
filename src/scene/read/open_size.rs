//! What a source that states no size of its photos leaves open: whether its cameras are for photos as stored or upright, and
//! whether its focal lengths are for photos of this size.
//!
//! Bundler, a `transforms.json` without `w` and `h`, and RealityCapture's files count from the middle of the photo. Nothing in
//! them tells a photo that was turned by its EXIF orientation, or one that was made smaller, from what the cameras were made
//! for: each is tried on the pixels, and taken where photos agree clearly better so.

use super::mesh_frame::is_clearly_better;
use super::mesh_frame_rating::{Rater, Rating};
use super::orientation::Turns;
use super::source::{SourceCamera, SourceView};
use super::source_mesh::SourceMesh;
use super::{join, photo_size, photos};
use crate::error::{Finding, Result, Severity};
use crate::image::file;
use crate::math::{evenly_spread, parallel};
use crate::scene::settings::{ColourEncoding, PixelCentre, ReadSettings};
use crate::scene::{View, WorldFromSource};
use glam::DMat4;

/// Views that are tried.
const TRIED_VIEWS: usize = 16;
/// Photos that agree by this leave nothing open.
const SURE_AGREEMENT: f64 = 0.9;
/// Of photos that agree by this the size is not doubted: gloss and mirrors leave as much.
const SOUND_AGREEMENT: f64 = 0.7;
/// A size is not taken for the agreement of photos that agree by less.
const LEAST_AGREEMENT: f64 = 0.6;
/// Factors that photos are made larger or smaller by.
const FACTORS: [f64; 8] = [0.5, 2.0, 0.25, 4.0, 0.75, 4.0 / 3.0, 2.0 / 3.0, 1.5];

/// Turns the cameras of photos on their side, and scales focal lengths, where photos agree clearly better so; tells. `views` have
/// the sizes of their files.
///
/// # Errors
/// A photo that cannot be read.
pub fn settle(
    views: &mut [SourceView],
    mesh: &SourceMesh,
    encoding: ColourEncoding,
    settings: &ReadSettings,
    findings: &mut Vec<Finding>,
) -> Result<()> {
    if mesh.triangles.is_empty() {
        return Ok(());
    }
    let tried = evenly_spread(&(0..views.len()).collect::<Vec<_>>(), TRIED_VIEWS);
    let few = |views: &[SourceView]| -> Vec<SourceView> { tried.iter().map(|&view| views[view].clone()).collect() };
    let rated = |views: &[SourceView]| rate(&few(views), mesh, encoding, settings);
    let on_side = parallel::map_items(views, |view| file::read_orientation(&view.photo).is_ok_and(file::swaps_sides));
    let mut own = None;
    if on_side.iter().any(|on_side| *on_side) {
        let mut upright = views.to_vec();
        upright.iter_mut().zip(&on_side).filter(|(_, on_side)| **on_side).for_each(|(view, _)| turn(view));
        let [as_stored, turned] = [rated(views)?, rated(&upright)?];
        own = Some(as_stored);
        if is_clearly_better(&turned, &as_stored) {
            views.clone_from_slice(&upright);
            own = Some(turned);
        }
    }
    // Who writes a principal point writes more than the middle: that tells the size.
    if !views.iter().all(is_about_the_middle) {
        return Ok(());
    }
    let own = match own {
        Some(own) => own,
        None => rated(views)?,
    };
    if own.agreement.is_none_or(|agreement| agreement >= SOUND_AGREEMENT) {
        return Ok(());
    }
    let mut best: Option<(Rating, f64)> = None;
    for factor in FACTORS {
        let mut scaled = views.to_vec();
        scaled.iter_mut().for_each(|view| scale(view, factor));
        let rating = rated(&scaled)?;
        let is_better = best.is_none_or(|(best, _)| rating.agreement > best.agreement);
        if is_better && rating.agreement >= Some(LEAST_AGREEMENT) && is_clearly_better(&rating, &own) {
            best = Some((rating, factor));
        }
        if rating.agreement >= Some(SURE_AGREEMENT) {
            break;
        }
    }
    if let Some((rating, factor)) = best {
        views.iter_mut().for_each(|view| scale(view, factor));
        let message = format!(
            "the photos are {factor:.2} times the size that the focal lengths are for: with them as they are {own}, scaled {rating}. \
             They are scaled"
        );
        findings.push(Finding::new(Severity::Warning, "intrinsics-scaled", message).remedy(
            "look at the outlines over the photos (check -o FOLDER), or use the photos the cameras were made for",
        ));
    }
    Ok(())
}

/// How photos agree through the mesh.
fn rate(views: &[SourceView], mesh: &SourceMesh, encoding: ColourEncoding, settings: &ReadSettings) -> Result<Rating> {
    let sizes = photo_size::of_files(views)?;
    let loaded = photos::load_all(views, &sizes, encoding, (None, &Turns::new()), settings)?;
    let (world, centre) = (WorldFromSource::default(), PixelCentre::Half);
    let sizes: Vec<(usize, usize)> = loaded.iter().map(|photo| photo.file_size).collect();
    let joined: Vec<View> = views
        .iter()
        .zip(loaded)
        .map(|(view, photo)| join(view, photo, &world, centre, settings.shrink, &mut Vec::new()))
        .collect();
    let in_pixels = |camera: &SourceCamera, view: usize| {
        let camera = camera.in_world(&world, sizes[view], centre.shift_pixels());
        if settings.shrink == 1 { camera } else { camera.shrunk(settings.shrink) }
    };
    let cameras: Vec<SourceCamera> = views.iter().map(|view| view.camera).collect();
    Ok(Rater::new(mesh, &cameras, joined, &in_pixels).rate(&DMat4::IDENTITY))
}

/// The camera of a photo on its side as one of the upright picture: as far from the middle as it was.
fn turn(view: &mut SourceView) {
    let Some((width, height)) = view.size else { return };
    let half = [0.5 * width as f64, 0.5 * height as f64];
    let centre = &mut view.camera.intrinsics.z_axis;
    (centre.x, centre.y) = (half[1] + centre.x - half[0], half[0] + centre.y - half[1]);
    view.size = Some((height, width));
}

fn is_about_the_middle(view: &SourceView) -> bool {
    let centre = view.camera.intrinsics.z_axis;
    view.size.is_some_and(|(width, height)| {
        (centre.x - 0.5 * width as f64).abs() < 1e-6 && (centre.y - 0.5 * height as f64).abs() < 1e-6
    })
}

/// A camera of the same picture made larger.
fn scale(view: &mut SourceView, factor: f64) {
    view.camera.intrinsics.x_axis *= factor;
    view.camera.intrinsics.y_axis *= factor;
}

#[cfg(test)]
#[path = "open_size_tests.rs"]
mod tests;
