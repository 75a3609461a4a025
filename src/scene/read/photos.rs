//! Photos and masks: decoded in parallel, kept compact, each pixel told what it is evidence for.

use super::source::SourceView;
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::image::{GreyImage, Image, RgbImage, file};
use crate::scene::lens::{Undistorted, undistort};
use crate::scene::settings::{ColourEncoding, MaskUse, ReadSettings};
use crate::scene::{Photo, PixelState};
use glam::Vec3;
use half::f16;
use rayon::prelude::*;
use std::path::Path;

/// 8-bit values from here on are clipped: cameras and JPEG move a saturated 255 by one.
pub const CLIPPED_BYTE: u8 = 254;
/// Float photos of one scene that would need more than this are kept in half precision.
const MOST_FLOAT_BYTES: usize = 1 << 30;
/// A masked twin is black where it is masked; JPEG leaves a little.
const BLACK_BYTE: u8 = 16;

/// A decoded view, at the size after shrinking.
pub struct LoadedPhoto {
    /// The photo.
    pub photo: Photo,
    /// What each pixel is evidence for.
    pub states: Image<PixelState>,
    /// Width and height of the file, before shrinking.
    pub file_size: (usize, usize),
    /// What undoing the distortion of its lens did; `None` for a pinhole.
    pub undistorted: Option<Undistorted>,
    /// What was noticed.
    pub findings: Vec<Finding>,
}

/// Decodes all views; the first error in the order of `views` is returned.
pub fn load_all(views: &[SourceView], encoding: ColourEncoding, settings: &ReadSettings) -> Result<Vec<LoadedPhoto>> {
    let sizes: Vec<_> = views.par_iter().map(check_size).collect::<Vec<_>>().into_iter().collect::<Result<_>>()?;
    let pixels: usize = sizes.iter().map(|(width, height)| width * height).sum();
    let shrink = settings.shrink;
    let as_half = pixels / (shrink * shrink) * std::mem::size_of::<Vec3>() > MOST_FLOAT_BYTES;
    let loaded: Vec<Result<LoadedPhoto>> =
        views.par_iter().map(|view| load(view, encoding, settings, as_half)).collect();
    loaded.into_iter().collect()
}

/// What undoing the distortion of lenses did, over all photos.
pub fn told_of_lenses(loaded: &[LoadedPhoto]) -> Option<Finding> {
    let done: Vec<Undistorted> = loaded.iter().filter_map(|photo| photo.undistorted).collect();
    let shift = done.iter().map(|own| own.largest_shift_pixels).fold(0.0, f64::max);
    let outside = done.iter().map(|own| own.share_outside).fold(0.0, f64::max);
    let message = format!(
        "the distortion of the lens is undone in {} of {} photos: pixels move by up to {shift:.1}, and up to {:.1} % of a photo \
         lies outside what was taken and is not seen",
        done.len(),
        loaded.len(),
        100.0 * outside
    );
    (!done.is_empty()).then(|| Finding::new(Severity::Note, "lens-undone", message))
}

fn check_size(view: &SourceView) -> Result<(usize, usize)> {
    let size = file::read_size(&view.photo)?;
    if let Some(claimed) = view.size.filter(|claimed| *claimed != size) {
        return Err(Error::new(
            ErrorKind::InvalidScene,
            format!("the photo is {} x {} but its camera is for {} x {}", size.0, size.1, claimed.0, claimed.1),
        )
        .at(Place::File(view.photo.clone()))
        .remedy("use the photos the cameras were made for, or scale the intrinsics with them"));
    }
    Ok(size)
}

fn load(view: &SourceView, encoding: ColourEncoding, settings: &ReadSettings, as_half: bool) -> Result<LoadedPhoto> {
    let mut findings = Vec::new();
    let (photo, mut states) = match file::read_srgb8(&view.photo) {
        Ok(bytes) => from_bytes(bytes, encoding),
        Err(error) if error.kind() == ErrorKind::Unsupported => {
            from_floats(file::read_rgb(&view.photo)?, encoding, as_half, view, &mut findings)
        }
        Err(error) => return Err(error),
    };
    let file_size = (photo.width(), photo.height());
    if let (Some(mask), true) = (&view.mask, settings.masks == MaskUse::Use) {
        apply_mask(mask, view, &photo, &mut states, &mut findings)?;
    }
    // Before anything is averaged: a pixel is resampled once.
    let mut undistorted = None;
    let (photo, states) = match &view.lens {
        None => (photo, states),
        Some(lens) => {
            let (photo, states, done) = undistort(&photo, &states, lens, &view.camera.pinhole());
            undistorted = Some(done);
            (photo, states)
        }
    };
    let (photo, states) = match settings.shrink {
        1 => (photo, states),
        factor => shrink(&photo, &states, factor),
    };
    Ok(LoadedPhoto { photo, states, file_size, undistorted, findings })
}

fn from_bytes(bytes: Image<[u8; 3]>, encoding: ColourEncoding) -> (Photo, Image<PixelState>) {
    let clipped = |pixel: &[u8; 3]| pixel.iter().any(|&channel| channel >= CLIPPED_BYTE);
    let states = bytes.map(|pixel| if clipped(pixel) { PixelState::SurfaceClipped } else { PixelState::Surface });
    let photo = match encoding {
        ColourEncoding::Linear => {
            Photo::Linear16(bytes.map(|pixel| pixel.map(|byte| f16::from_f32(f32::from(byte) / 255.0))))
        }
        _ => Photo::Srgb8(bytes),
    };
    (photo, states)
}

fn from_floats(
    mut image: RgbImage,
    encoding: ColourEncoding,
    as_half: bool,
    view: &SourceView,
    findings: &mut Vec<Finding>,
) -> (Photo, Image<PixelState>) {
    let mut states = Image::filled(image.width(), image.height(), PixelState::Surface);
    let width = image.width();
    let (mut not_finite, mut negative) = (0usize, 0usize);
    let mut first_bad = 0;
    for (index, (pixel, state)) in image.pixels_mut().iter_mut().zip(states.pixels_mut()).enumerate() {
        if !pixel.is_finite() {
            if not_finite == 0 {
                first_bad = index;
            }
            not_finite += 1;
            *pixel = Vec3::ZERO;
            *state = PixelState::Ignored;
        } else if pixel.min_element() < 0.0 {
            negative += 1;
            *pixel = pixel.max(Vec3::ZERO);
        }
        if encoding == ColourEncoding::Srgb {
            *pixel = pixel.map(crate::image::transfer::linear_from_srgb);
        }
    }
    if not_finite > 0 {
        findings.push(
            Finding::new(
                Severity::Warning,
                "photo-not-finite",
                format!("{not_finite} pixels are not finite, this is the first: they are ignored"),
            )
            .at(Place::Pixel {
                view: view.name.clone(),
                row: first_bad / width.max(1),
                column: first_bad % width.max(1),
            })
            .remedy("render or export the photo again if they matter"),
        );
    }
    if negative > 0 {
        findings.push(
            Finding::new(
                Severity::Note,
                "photo-negative",
                format!("{negative} pixels are negative: they are taken as 0"),
            )
            .at(Place::View(view.name.clone())),
        );
    }
    let survives_half = |value: f32| f16::from_f32(value).to_f32() == value;
    if as_half || image.pixels().iter().all(|pixel| pixel.to_array().into_iter().all(survives_half)) {
        for (pixel, state) in image.pixels().iter().zip(states.pixels_mut()) {
            if pixel.max_element() > f16::MAX.to_f32() && *state == PixelState::Surface {
                *state = PixelState::SurfaceClipped;
            }
        }
        return (Photo::Linear16(image.map(|pixel| to_half(*pixel))), states);
    }
    (Photo::Linear32(image), states)
}

fn to_half(pixel: Vec3) -> [f16; 3] {
    pixel.min(Vec3::splat(f16::MAX.to_f32())).to_array().map(f16::from_f32)
}

/// Turns the states of masked pixels to background.
fn apply_mask(
    path: &Path,
    view: &SourceView,
    photo: &Photo,
    states: &mut Image<PixelState>,
    findings: &mut Vec<Finding>,
) -> Result<()> {
    let is_twin = path.file_stem().is_some_and(|stem| stem.to_string_lossy().ends_with("_masked"));
    let mask = file::read_grey(path)?;
    let size = (photo.width(), photo.height());
    if (mask.width(), mask.height()) != size {
        return Err(Error::new(
            ErrorKind::InvalidScene,
            format!("the mask is {} x {} but the photo is {} x {}", mask.width(), mask.height(), size.0, size.1),
        )
        .at(Place::File(path.into()))
        .remedy("make the mask in the size of the photo, or ignore all with --masks ignore"));
    }
    let is_object: Image<bool> = if is_twin { object_of_twin(&mask, photo) } else { mask.map(|value| *value >= 0.5) };
    let mut object_pixels = 0usize;
    for (state, &object) in states.pixels_mut().iter_mut().zip(is_object.pixels()) {
        object_pixels += usize::from(object);
        *state = match (*state, object) {
            (PixelState::Surface, false) => PixelState::Background,
            (PixelState::SurfaceClipped, false) => PixelState::BackgroundClipped,
            (state, _) => state,
        };
    }
    if object_pixels == 0 {
        findings.push(
            Finding::new(
                Severity::Warning,
                "mask-empty",
                "the mask marks no pixel as object: the view says nothing of the surface",
            )
            .at(Place::View(view.name.clone()))
            .remedy("255 is object; make the mask again or remove the view"),
        );
    }
    Ok(())
}

/// The object of a `_masked` twin: what is not black, and what is as dark in the photo itself.
fn object_of_twin(twin: &GreyImage, photo: &Photo) -> Image<bool> {
    let black = f32::from(BLACK_BYTE) / 255.0;
    Image::from_fn(twin.width(), twin.height(), |row, column| {
        let in_photo = match photo {
            Photo::Srgb8(bytes) => f32::from(bytes[(row, column)].into_iter().max().unwrap_or(0)) / 255.0,
            _ => photo.radiance(row, column).max_element(),
        };
        twin[(row, column)] > black || in_photo <= 2.0 * black
    })
}

/// Averages squares of `factor` pixels in linear radiance; a rest of fewer pixels at the right and lower edge is cut.
fn shrink(photo: &Photo, states: &Image<PixelState>, factor: usize) -> (Photo, Image<PixelState>) {
    let (width, height) = ((photo.width() / factor).max(1), (photo.height() / factor).max(1));
    let cells = |row: usize, column: usize| {
        let rows = row * factor..((row + 1) * factor).min(photo.height());
        rows.flat_map(move |r| (column * factor..((column + 1) * factor).min(photo.width())).map(move |c| (r, c)))
    };
    let small = Image::from_fn(width, height, |row, column| {
        let (sum, count) = cells(row, column)
            .fold((Vec3::ZERO, 0.0), |(sum, count), (r, c)| (sum + photo.radiance(r, c), count + 1.0));
        sum / count
    });
    let small_states = Image::from_fn(width, height, |row, column| {
        let (mut surface, mut clipped, mut ignored, mut count) = (0, false, false, 0);
        for place in cells(row, column) {
            let state = states[place];
            count += 1;
            surface += usize::from(state.is_surface());
            clipped |= state.is_clipped();
            ignored |= state == PixelState::Ignored;
        }
        match (ignored || (surface != 0 && surface != count), surface > 0, clipped) {
            // A square across the silhouette is a mixture: evidence for neither side.
            (true, _, _) => PixelState::Ignored,
            (false, true, false) => PixelState::Surface,
            (false, true, true) => PixelState::SurfaceClipped,
            (false, false, false) => PixelState::Background,
            (false, false, true) => PixelState::BackgroundClipped,
        }
    });
    let halves = || small.map(|pixel| to_half(*pixel));
    let photo = match photo {
        Photo::Linear32(_) => Photo::Linear32(small),
        Photo::Linear16(_) => Photo::Linear16(halves()),
        Photo::Srgb8(_) | Photo::MeanOfSrgb8(_) => Photo::MeanOfSrgb8(halves()),
    };
    (photo, small_states)
}

/// A linear picture averaged over squares of `factor` pixels.
pub fn shrink_linear(image: RgbImage, factor: usize) -> RgbImage {
    if factor == 1 {
        return image;
    }
    let states = Image::filled(image.width(), image.height(), PixelState::Surface);
    shrink(&Photo::Linear32(image), &states, factor).0.to_linear()
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
    use super::*;

    #[test]
    fn shrinking_averages_radiance_and_sets_mixtures_aside() {
        let bytes = Image::from_fn(5, 4, |row, column| [if row < 2 && column == 0 { 255 } else { 0 }, 0, 0]);
        let mut states = Image::filled(5, 4, PixelState::Surface);
        states[(0, 0)] = PixelState::SurfaceClipped;
        states[(0, 2)] = PixelState::Background;
        let (photo, small) = shrink(&Photo::Srgb8(bytes.clone()), &states, 2);
        assert_eq!((photo.width(), photo.height()), (2, 2));
        let expected = crate::scene::photo::linear_from_srgb8([255, 0, 0]).x / 2.0;
        assert!((photo.radiance(0, 0).x - expected).abs() < 1e-3);
        assert!(!photo.is_linear(), "it is a photograph of eight bits still, and is fitted as one");
        assert_eq!(
            small.pixels(),
            [PixelState::SurfaceClipped, PixelState::Ignored, PixelState::Surface, PixelState::Surface]
        );
    }
}
