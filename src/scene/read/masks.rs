//! What masks and opacity say of each pixel of a photo: what is object, what is background, what is evidence for neither.

use super::source::SourceView;
use super::zip::Archive;
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::image::{GreyImage, Image, file, resize};
use crate::scene::{Photo, PixelState};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A masked twin is black where it is masked; JPEG leaves a little.
const BLACK_BYTE: u8 = 16;

/// The archives that hold masks, each opened once: the mask of such a view is the archive's path with the entry's name.
pub fn archives_of_masks(views: &[SourceView]) -> Result<BTreeMap<PathBuf, Archive>> {
    let mut archives = BTreeMap::new();
    for archive in views.iter().filter_map(|view| view.mask.as_ref()?.parent()) {
        if !archives.contains_key(archive) && archive.is_file() {
            archives.insert(archive.to_path_buf(), Archive::open(archive)?);
        }
    }
    Ok(archives)
}

/// A mask from a file or from an archive. One from an archive was made on the photo that the project knows: it is brought to
/// the size of the photo that is here, where that has the same shape.
pub fn read_mask(
    path: &Path,
    photo: &Photo,
    packed: &BTreeMap<PathBuf, Archive>,
) -> Result<(GreyImage, Option<Finding>)> {
    /// What rounding of the sides may make of a shape.
    const SAME_SHAPE: f64 = 0.01;
    let Some(archive) = path.parent().and_then(|parent| packed.get(parent)) else { return file::read_mask(path) };
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let (mask, told) = file::read_mask_from(path, archive.read(&name)?)?;
    let (width, height) = (photo.width(), photo.height());
    let across = mask.width() as f64 / width as f64;
    let down = mask.height() as f64 / height as f64;
    if (mask.width(), mask.height()) == (width, height) || (across / down - 1.0).abs() > SAME_SHAPE {
        return Ok((mask, told));
    }
    Ok((resize::enlarge(&resize::shrink(&mask, across as usize), width, height), told))
}

/// Turns the states of pixels with less than half of their opacity to background.
///
/// Floats were multiplied by their opacity, so that those with some of it are mixtures: evidence for neither side.
pub fn apply_alpha(alpha: &GreyImage, is_float: bool, states: &mut Image<PixelState>, shared: &mut Vec<Finding>) {
    /// What rounding leaves of 0 and 1.
    const ROUNDING: f32 = 0.01;
    let (least, most) = alpha.pixels().iter().fold((1f32, 0f32), |(a, b), &value| (a.min(value), b.max(value)));
    if least >= 1.0 - ROUNDING {
        return;
    }
    if most <= ROUNDING {
        let message = "the alpha channel is 0 everywhere: it is ignored";
        shared.push(Finding::new(Severity::Warning, "alpha-empty", message).remedy("export the photo without alpha"));
        return;
    }
    for (state, &alpha) in states.pixels_mut().iter_mut().zip(alpha.pixels()) {
        let is_mixture = is_float && alpha > ROUNDING && alpha < 1.0 - ROUNDING;
        *state = match *state {
            PixelState::Ignored => PixelState::Ignored,
            _ if is_mixture || alpha.is_nan() => PixelState::Ignored,
            PixelState::Surface if alpha < 0.5 => PixelState::Background,
            PixelState::SurfaceClipped if alpha < 0.5 => PixelState::BackgroundClipped,
            state => state,
        };
    }
    shared.push(
        Finding::new(Severity::Note, "alpha-as-mask", "the alpha channel of the photo is used as its mask")
            .remedy("ignore it with --masks ignore"),
    );
}

/// Turns the states of masked pixels to background. `stored` is the size and the orientation of the photo's file: a mask may
/// lie as the file does or as the camera sees it.
pub fn apply_mask(
    path: &Path,
    mut mask: GreyImage,
    view: &SourceView,
    photo: &Photo,
    stored: ((usize, usize), u8),
    states: &mut Image<PixelState>,
    findings: &mut Vec<Finding>,
) -> Result<()> {
    let is_twin = path.file_stem().is_some_and(|stem| stem.to_string_lossy().ends_with("_masked"));
    let size = (photo.width(), photo.height());
    if (mask.width(), mask.height()) != size && (mask.width(), mask.height()) == stored.0 {
        mask = file::turned(mask, stored.1);
    }
    if (mask.width(), mask.height()) != size {
        return Err(Error::new(
            ErrorKind::InvalidScene,
            format!("the mask is {} x {} but the photo is {} x {}", mask.width(), mask.height(), size.0, size.1),
        )
        .at(Place::File(path.into()))
        .remedy("resize the mask to the photo, or ignore all masks with --masks ignore"));
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
                "the mask marks no pixel as object, so the view contributes nothing",
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
