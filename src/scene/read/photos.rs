//! Photos and masks: decoded in parallel, kept compact, each pixel told what it is evidence for.

mod shrunk;
mod values;

pub use shrunk::shrink_linear;

use super::orientation::{Turn, Turns};
use super::source::SourceView;
use super::zip::Archive;
use super::{masks, orientation, repeated};
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::image::Image;
use crate::image::file::{self, Encoding, MaskFacts, MaskValues, MaskWay, PhotoFile, PhotoOptions, PhotoPixels};
use crate::math::parallel;
use crate::scene::lens::{Lens, Undistorted, undistort};
use crate::scene::settings::{ColourEncoding, MaskUse, ReadSettings};
use crate::scene::{Photo, PixelState};
use glam::Vec3;
use shrunk::shrink;
use std::collections::BTreeMap;
use std::path::PathBuf;
use values::{checked_floats, kept, mark};

/// 8-bit values from here on are clipped: cameras and JPEG move a saturated 255 by one.
pub const CLIPPED_BYTE: u8 = 254;
/// Float photos of one scene that would need more than this are kept in half precision.
const MOST_FLOAT_BYTES: usize = 1 << 30;
/// Where more of a photo than this is not used, that is a warning.
const MOST_UNUSED: f64 = 0.5;

/// A decoded view, at the size after shrinking.
pub struct LoadedPhoto {
    /// The photo.
    pub photo: Photo,
    /// What each pixel is evidence for.
    pub states: Image<PixelState>,
    /// Width and height of the file as its camera sees it, before shrinking.
    pub file_size: (usize, usize),
    /// By how many stops it is exposed more than the mean of the photos, as EXIF says; `None` where it does not.
    pub exposure_prior_stops: Option<f32>,
    /// What undoing the distortion of its lens did; `None` for a pinhole.
    pub undistorted: Option<Undistorted>,
    /// What its mask says of the way that the masks are written in; `None` without one.
    pub mask_facts: Option<MaskFacts>,
    /// Its EXIF orientation where the camera does not say whether that applies.
    pub open_orientation: Option<u8>,
    /// What was noticed of it alone.
    pub findings: Vec<Finding>,
    /// What was noticed without a place, which other photos may share.
    shared: Vec<Finding>,
}

impl LoadedPhoto {
    /// A photo with nothing noticed.
    pub fn new(photo: Photo, states: Image<PixelState>) -> Self {
        let file_size = (photo.width(), photo.height());
        LoadedPhoto {
            photo,
            states,
            file_size,
            exposure_prior_stops: None,
            undistorted: None,
            mask_facts: None,
            open_orientation: None,
            findings: Vec::new(),
            shared: Vec::new(),
        }
    }
}

/// How the masks of photos are written, as all of them say together.
pub fn way_of_masks(loaded: &[LoadedPhoto]) -> MaskWay {
    MaskWay::of_set(loaded.iter().filter_map(|photo| photo.mask_facts))
}

/// Decodes all views, whose files are of these sizes; the first error in the order of `views` is returned. What several photos
/// have in common is told once, with the first of them. Masks are read in the way of `masks`, or in the one that they say
/// together. Photos are turned where their cameras or `turns` say so.
pub fn load_all(
    views: &[SourceView],
    sizes: &[(usize, usize)],
    encoding: ColourEncoding,
    (masks, turns): (Option<MaskWay>, &Turns),
    settings: &ReadSettings,
) -> Result<Vec<LoadedPhoto>> {
    let pixels: usize = sizes.iter().map(|(width, height)| width * height).sum();
    let shrink = settings.shrink;
    let as_half = pixels / (shrink * shrink) * std::mem::size_of::<Vec3>() > MOST_FLOAT_BYTES;
    let packed = if settings.masks == MaskUse::Use { masks::archives_of_masks(views)? } else { BTreeMap::new() };
    let load = |view: &SourceView, masks| {
        load(view, encoding, settings, as_half, (masks, &packed), turns.get(&view.name).copied())
    };
    let loaded = parallel::map_items(views, |view| load(view, masks));
    let mut loaded = loaded.into_iter().collect::<Result<Vec<_>>>()?;
    if masks.is_none() {
        // The few that alone look otherwise than the others are read once more.
        let way = way_of_masks(&loaded);
        let differs = |photo: &LoadedPhoto| photo.mask_facts.is_some_and(|facts| facts.differs_by(way));
        let again: Vec<usize> = (0..views.len()).filter(|&index| differs(&loaded[index])).collect();
        let read = parallel::map_items(&again, |&index| load(&views[index], Some(way)));
        for (index, photo) in again.into_iter().zip(read) {
            loaded[index] = photo?;
        }
    }
    let mut gathered = gather(views, &loaded);
    gathered.extend(centre_exposures(&mut loaded));
    if let Some(first) = loaded.first_mut() {
        first.findings.splice(0..0, gathered);
    }
    Ok(loaded)
}

/// What undoing the distortion of lenses did, over all photos.
pub fn told_of_lenses(loaded: &[LoadedPhoto]) -> Option<Finding> {
    let done: Vec<Undistorted> = loaded.iter().filter_map(|photo| photo.undistorted).collect();
    let shift = done.iter().map(|own| own.largest_shift_pixels).fold(0.0, f64::max);
    let outside = done.iter().map(|own| own.share_outside).fold(0.0, f64::max);
    let unused = done.iter().map(|own| own.share_unused).fold(0.0, f64::max);
    let message = format!(
        "the distortion of the lens is undone in {} of {} photos: pixels move by up to {shift:.1}, up to {:.1} % of a picture \
         lies outside what was taken and is not seen, and up to {:.1} % of what was taken lies outside the picture and is not used",
        done.len(),
        loaded.len(),
        100.0 * outside,
        100.0 * unused
    );
    if done.is_empty() {
        return None;
    }
    if unused <= MOST_UNUSED {
        return Some(Finding::new(Severity::Note, "lens-undone", message));
    }
    Some(
        Finding::new(Severity::Warning, "lens-undone", message).remedy(
            "resample the photos to wider pinhole pictures with the tool that calibrated them, to use all of them",
        ),
    )
}

/// One finding of those that photos share, with the names of the photos. Where they differ in how much there is of it, the
/// worst is told.
fn gather(views: &[SourceView], loaded: &[LoadedPhoto]) -> Vec<Finding> {
    let is_same = |one: &Finding, other: &Finding| {
        let both_measured = one.extent > 0.0 && other.extent > 0.0;
        let key = |finding: &Finding| (finding.code, finding.severity, finding.remedy.clone());
        one == other || both_measured && key(one) == key(other)
    };
    let mut groups: Vec<(Vec<&Finding>, Vec<&str>)> = Vec::new();
    for (view, photo) in views.iter().zip(loaded) {
        for finding in &photo.shared {
            match groups.iter_mut().find(|(own, _)| is_same(own[0], finding)) {
                Some((own, names)) => {
                    own.push(finding);
                    names.push(&view.name);
                }
                None => groups.push((vec![finding], vec![&view.name])),
            }
        }
    }
    let told = groups.into_iter().filter_map(|(findings, names)| {
        let (worst, varies) = repeated::worst_of(findings.iter().copied())?;
        let finding = findings[worst];
        let Some(which) = repeated::which(&names, views.len()) else {
            return Some(finding.clone().at(Place::View(names[0].to_owned())));
        };
        let which = if varies { format!("view {}, the most of {which}", names[worst]) } else { which };
        Some(Finding { message: format!("{} ({which})", finding.message), ..finding.clone() })
    });
    told.collect()
}

/// Makes exposures relative to their mean; tells how far they differ.
fn centre_exposures(loaded: &mut [LoadedPhoto]) -> Option<Finding> {
    /// Less than the third of a stop that cameras go by.
    const SAME_STOPS: f32 = 0.1;
    let known: Vec<f32> = loaded.iter().filter_map(|photo| photo.exposure_prior_stops).collect();
    if known.len() < 2 {
        loaded.iter_mut().for_each(|photo| photo.exposure_prior_stops = None);
        return None;
    }
    let mean = known.iter().sum::<f32>() / known.len() as f32;
    loaded.iter_mut().filter_map(|photo| photo.exposure_prior_stops.as_mut()).for_each(|stops| *stops -= mean);
    let least = known.iter().copied().fold(f32::INFINITY, f32::min);
    let span = known.iter().copied().fold(f32::NEG_INFINITY, f32::max) - least;
    let message =
        format!("EXIF gives the exposures of {} of {} photos: they span {span:.1} stops", known.len(), loaded.len());
    (span > SAME_STOPS).then(|| Finding::new(Severity::Note, "exposure-by-exif", message))
}

fn load(
    view: &SourceView,
    encoding: ColourEncoding,
    settings: &ReadSettings,
    as_half: bool,
    (way, packed): (Option<MaskWay>, &BTreeMap<PathBuf, Archive>),
    turn: Option<Turn>,
) -> Result<LoadedPhoto> {
    let (mut findings, mut shared) = (Vec::new(), Vec::new());
    let options = PhotoOptions {
        encoding: match encoding {
            ColourEncoding::Auto => Encoding::Auto,
            ColourEncoding::Srgb => Encoding::Srgb,
            ColourEncoding::Linear => Encoding::Linear,
            ColourEncoding::Gamma22 => Encoding::Gamma22,
        },
        layer: settings.layer.as_deref(),
    };
    let mut file = file::read_photo(&view.photo, &options)?;
    shared.append(&mut file.findings);
    let stored = (file.size(), file.orientation);
    let (file, open_orientation) = orientation::as_the_camera_sees(file, view, turn.is_some(), &mut shared)?;
    let PhotoFile { pixels, is_eight_bit, clipped, alpha, is_inside, exposure_stops, .. } = file;
    let is_float = clipped.is_none();
    let (photo, mut states) = match pixels {
        PhotoPixels::Srgb8(bytes) => {
            let states = Image::filled(bytes.width(), bytes.height(), PixelState::Surface);
            (Photo::Srgb8(bytes), states)
        }
        PhotoPixels::Linear(image) => {
            let (image, states) = checked_floats(image, is_float, view, &mut findings, &mut shared);
            kept(image, states, is_eight_bit && encoding != ColourEncoding::Linear, is_eight_bit || as_half)
        }
    };
    mark(&mut states, clipped.as_ref(), PixelState::SurfaceClipped, |clipped| clipped);
    let file_size = (photo.width(), photo.height());
    let mut mask_facts = None;
    if settings.masks == MaskUse::Use {
        match (&view.mask, &alpha) {
            (Some(mask), _) => {
                let read = masks::read_mask(mask, packed)?;
                mask_facts = Some(read.facts());
                let way = way.unwrap_or_else(|| MaskWay::of_set([read.facts()]));
                let MaskValues { mut values, are_opacity, told } = read.into_values(way);
                if turn.is_some_and(|turn| turn.mask) {
                    values = file::turned(values, stored.1);
                }
                shared.extend(told);
                let (values, scaled) = masks::resized(values, mask, &photo, packed);
                shared.extend(scaled);
                let values = (values, are_opacity);
                masks::apply_mask(mask, values, view, &photo, stored, &mut states, &mut findings)?;
            }
            (None, Some(alpha)) => masks::apply_alpha(alpha, is_float, &mut states, &mut shared),
            (None, None) => {}
        }
    }
    mark(&mut states, is_inside.as_ref(), PixelState::Ignored, |is_inside| !is_inside);
    // Before anything is averaged: a pixel is resampled once.
    let mut undistorted = None;
    let (photo, states) = match &view.lens {
        None => (photo, states),
        Some(lens) => {
            refuse_more_than_half_a_sphere(view, lens, file_size)?;
            let (photo, states, done) = undistort(&photo, &states, lens, &view.camera.pinhole());
            undistorted = Some(done);
            (photo, states)
        }
    };
    let (photo, states) = match settings.shrink {
        1 => (photo, states),
        factor => shrink(&photo, &states, factor),
    };
    let exposure_prior_stops = exposure_stops;
    Ok(LoadedPhoto {
        photo,
        states,
        file_size,
        exposure_prior_stops,
        undistorted,
        mask_facts,
        open_orientation,
        findings,
        shared,
    })
}

/// A pinhole sees less than 180 degrees.
fn refuse_more_than_half_a_sphere(view: &SourceView, lens: &Lens, size: (usize, usize)) -> Result<()> {
    /// A whole hemisphere, and what a calibration is off by at the rim.
    const WIDEST_DEGREES: f64 = 182.0;
    let angle = lens.field_of_view_radians(size, &view.camera.pinhole());
    let degrees = [angle.x.to_degrees(), angle.y.to_degrees()];
    if degrees.iter().all(|degrees| *degrees <= WIDEST_DEGREES) {
        return Ok(());
    }
    let named = |degrees: f64| if degrees.is_finite() { format!("{degrees:.0}") } else { "more than 180".to_owned() };
    let message = format!(
        "by its lens the photo is {} degrees wide and {} high: more than 180 are not read",
        named(degrees[0]),
        named(degrees[1])
    );
    Err(Error::new(ErrorKind::Unsupported, message).at(Place::File(view.photo.clone())).remedy(
        "resample it to pinhole pictures with the tool that calibrated it, or crop it to less (a fisheye's circle to a square \
         within) and correct its calibration",
    ))
}

/// Share of pixels of 8-bit photos by byte, over the channels: a histogram of 256 bins.
pub fn histogram(bytes: &Image<[u8; 3]>, states: &Image<PixelState>) -> [u32; 256] {
    let mut counts = [0; 256];
    for (pixel, state) in bytes.pixels().iter().zip(states.pixels()) {
        if *state != PixelState::Ignored {
            pixel.iter().for_each(|&byte| counts[byte as usize] += 1);
        }
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::super::source::SourceCamera;
    use super::*;
    use glam::{DMat3, DVec3};

    #[test]
    fn of_what_photos_share_the_worst_is_told_with_how_many_share_it() {
        let view = |index: usize| SourceView {
            name: format!("{index:02}"),
            photo: PathBuf::new(),
            mask: None,
            camera: SourceCamera { intrinsics: DMat3::IDENTITY, rotation: DMat3::IDENTITY, translation: DVec3::ZERO },
            lens: None,
            size: None,
            place: Place::Nowhere,
        };
        let views: Vec<SourceView> = (0..4).map(view).collect();
        let told = |bytes: &[usize]| {
            let loaded = bytes.iter().map(|&bytes| {
                let states = Image::filled(1, 1, PixelState::Surface);
                let mut photo = LoadedPhoto::new(Photo::Srgb8(Image::filled(1, 1, [0; 3])), states);
                let finding = Finding::new(Severity::Note, "stray", format!("{bytes} bytes"));
                photo.shared.extend((bytes > 0).then(|| finding.extent(bytes as f64)));
                photo
            });
            let told = gather(&views[..bytes.len()], &loaded.collect::<Vec<_>>());
            told.iter().map(Finding::to_string).collect::<Vec<_>>()
        };
        assert_eq!(told(&[2, 0, 900, 3]), ["note [stray]: 900 bytes (view 02, the most of 3 of 4 photos: 00, 02, 03)"]);
        assert_eq!(told(&[2, 5]), ["note [stray]: 5 bytes (view 01, the most of all 2 photos)"]);
        assert_eq!(told(&[5, 5]), ["note [stray]: 5 bytes (all 2 photos)"]);
        assert_eq!(told(&[0, 5]), ["note [stray] view 01: 5 bytes"]);
    }
}
