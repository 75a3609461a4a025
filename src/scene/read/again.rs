//! Photos that are decoded once more: those that turned out to lie otherwise than their files, and a few in full size.

use super::orientation::Turns;
use super::source::SourceView;
use super::{join, matte, photo_size, photos};
use crate::error::{Finding, Result};
use crate::image::file::MaskWay;
use crate::scene::doctor::pixel_centre;
use crate::scene::settings::{ColourEncoding, PixelCentre, ReadSettings};
use crate::scene::{Scene, View};

/// How photos are decoded once more.
pub struct Loading<'a> {
    pub encoding: ColourEncoding,
    pub way_of_masks: MaskWay,
    pub matte: Option<matte::Matte>,
    pub turns: &'a Turns,
    pub settings: &'a ReadSettings,
}

/// Decodes the photos once more that are to be turned, in the place of what they were: a lens is undone on the picture as its
/// camera sees it.
pub fn turn(joined: &mut [View], views: &[SourceView], loading: &Loading) -> Result<()> {
    let Loading { encoding, way_of_masks, matte, turns, settings } = *loading;
    let turned: Vec<usize> = (0..views.len()).filter(|&view| turns.contains_key(&views[view].name)).collect();
    let few: Vec<SourceView> = turned.iter().map(|&view| views[view].clone()).collect();
    let sizes = photo_size::of_files(&few)?;
    let mut loaded = photos::load_all(&few, &sizes, encoding, (Some(way_of_masks), turns), settings)?;
    if let Some(matte) = matte {
        matte::set_aside(&mut loaded, matte);
    }
    for (view, photo) in turned.into_iter().zip(loaded) {
        let own = &mut joined[view];
        (own.photo, own.states) = (photo.photo, photo.states);
    }
    Ok(())
}

/// Half a pixel is measured on photos as they are: a few are decoded once more, in full size.
pub fn decide_centre_unshrunk(
    scene: &Scene,
    views: &[SourceView],
    loading: &Loading,
    assumed: PixelCentre,
    scaled: f64,
) -> Result<(PixelCentre, Finding)> {
    let Loading { encoding, way_of_masks, turns, settings, .. } = *loading;
    let few: Vec<SourceView> = views.iter().step_by(views.len().div_ceil(6)).cloned().collect();
    let loaded = photos::load_all(
        &few,
        &photo_size::of_files(&few)?,
        encoding,
        (Some(way_of_masks), turns),
        &ReadSettings { shrink: 1, ..settings.clone() },
    )?;
    let joined = few
        .iter()
        .zip(loaded)
        .map(|(view, photo)| join(view, photo, &scene.world_from_source, assumed, 1, &mut Vec::new()))
        .collect();
    let full_size = Scene {
        name: scene.name.clone(),
        folder: None,
        mesh: scene.mesh.clone(),
        views: joined,
        world_from_source: scene.world_from_source,
        background: scene.background,
        truth: None,
        findings: Vec::new(),
    };
    Ok(pixel_centre::decide(&full_size, assumed, scaled))
}
