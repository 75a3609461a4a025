//! What masks and opacity say of each pixel of a photo: what is object, what is background, what is evidence for neither.

use super::source::SourceView;
use super::zip::Archive;
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::image::file::{self, MaskFile};
use crate::image::{GreyImage, Image, resize};
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

/// Whether a file is a twin of a photo that is black where it is masked, by its name.
fn is_twin(path: &Path) -> bool {
    path.file_stem().is_some_and(|stem| stem.to_string_lossy().ends_with("_masked"))
}

/// A mask from a file or from an archive.
pub fn read_mask(path: &Path, packed: &BTreeMap<PathBuf, Archive>) -> Result<MaskFile> {
    let file = match path.parent().and_then(|parent| packed.get(parent)) {
        None if !path.exists() => {
            return Err(Error::new(ErrorKind::Missing, "the mask that the scene names is not there")
                .at(Place::File(path.into()))
                .remedy("copy it, take it out of the file that names it, or ignore all masks with --masks ignore"));
        }
        None => MaskFile::open(path)?,
        Some(archive) => {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            MaskFile::of_bytes(path, archive.read(&name)?)?
        }
    };
    Ok(if is_twin(path) { file.of_picture() } else { file })
}

/// A mask of the photo in another size, brought to the size of the photo that is here where that has the same shape: one from
/// an archive was made on the photo that the project knows, a larger one on a photo that was made smaller since, which is
/// told. A smaller one has not the photo's detail: it is refused later on.
pub fn resized(
    mask: GreyImage,
    path: &Path,
    photo: &Photo,
    packed: &BTreeMap<PathBuf, Archive>,
) -> (GreyImage, Option<Finding>) {
    /// What rounding of the sides may make of a shape.
    const SAME_SHAPE: f64 = 0.01;
    let is_packed = path.parent().is_some_and(|parent| packed.contains_key(parent));
    let (width, height) = (photo.width(), photo.height());
    let across = mask.width() as f64 / width as f64;
    let down = mask.height() as f64 / height as f64;
    let is_of_size = (mask.width(), mask.height()) == (width, height);
    if is_of_size || (across / down - 1.0).abs() > SAME_SHAPE || !(is_packed || across.min(down) > 1.0) {
        return (mask, None);
    }
    let message = format!("masks are {across:.3} times the size of their photos: they are made smaller");
    let told = (!is_packed).then(|| Finding::new(Severity::Note, "masks-scaled", message));
    (resize::enlarge(&resize::shrink(&mask, across as usize), width, height), told)
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

/// Turns the states of masked pixels to background. A twin that is a picture is compared with the photo, one whose opacity is
/// the mask is taken by it. `stored` is the size and the orientation of the photo's file: a mask may
/// lie as the file does or as the camera sees it.
pub fn apply_mask(
    path: &Path,
    (mut mask, is_opacity): (GreyImage, bool),
    view: &SourceView,
    photo: &Photo,
    stored: ((usize, usize), u8),
    states: &mut Image<PixelState>,
    findings: &mut Vec<Finding>,
) -> Result<()> {
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
    let is_object: Image<bool> =
        if is_twin(path) && !is_opacity { object_of_twin(&mask, photo) } else { mask.map(|value| *value >= 0.5) };
    let mut object_pixels = 0usize;
    for (state, &object) in states.pixels_mut().iter_mut().zip(is_object.pixels()) {
        object_pixels += usize::from(object);
        *state = match (*state, object) {
            (PixelState::Surface, false) => PixelState::Background,
            (PixelState::SurfaceClipped, false) => PixelState::BackgroundClipped,
            (state, _) => state,
        };
    }
    if object_pixels == size.0 * size.1 && !is_twin(path) {
        findings.push(
            Finding::new(Severity::Note, "mask-full", "the mask marks every pixel as object")
                .at(Place::View(view.name.clone()))
                .remedy("255 is object, 0 is background: make the mask again where the photo shows a background"),
        );
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

#[cfg(test)]
#[allow(clippy::disallowed_methods)]
mod tests {
    use super::super::photos::load_all;
    use super::super::source::SourceCamera;
    use super::*;
    use crate::scene::ReadSettings;
    use glam::{DMat3, DVec3};

    fn view(folder: &Path, name: &str, mask: &str) -> SourceView {
        SourceView {
            name: name.to_owned(),
            photo: folder.join(format!("{name}.png")),
            mask: Some(folder.join(mask)),
            camera: SourceCamera { intrinsics: DMat3::IDENTITY, rotation: DMat3::IDENTITY, translation: DVec3::ZERO },
            lens: None,
            size: None,
            place: Place::Nowhere,
        }
    }

    /// How many of the 12 pixels of each view are object.
    fn objects_of(views: &[SourceView]) -> Vec<usize> {
        let loaded = load_all(
            views,
            &vec![(4, 3); views.len()],
            Default::default(),
            (None, &Default::default()),
            &ReadSettings::default(),
        );
        let count = |states: &Image<PixelState>| states.pixels().iter().filter(|state| state.is_surface()).count();
        loaded.unwrap().iter().map(|photo| count(&photo.states)).collect()
    }

    #[test]
    fn the_opacity_of_a_twin_is_its_mask_and_without_one_what_is_black() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        // The left half is the object, of which a quarter is black in the photo itself, as is much of what is around it.
        let colour = |row: usize, column: usize| if row == 0 || column == 3 { [0u8; 3] } else { [90u8, 80, 70] };
        file::write_png_srgb8(&root.join("a.png"), &Image::from_fn(4, 3, colour)).unwrap();
        let twin = Image::from_fn(4, 3, |row, column| {
            let [r, g, b] = colour(row, column);
            if column < 2 { [r, g, b, 255] } else { [0, 0, 0, 0] }
        });
        file::write_png_srgba8(&root.join("a_masked.png"), &twin).unwrap();
        assert_eq!(objects_of(&[view(root, "a", "a_masked.png")]), [6]);
        let black = twin.map(|&[r, g, b, _]| [r, g, b]);
        file::write_png_srgb8(&root.join("b_masked.png"), &black).unwrap();
        assert_eq!(objects_of(&[view(root, "a", "b_masked.png")]), [4 + 4 + 2], "what is as dark in the photo stays");
    }

    #[test]
    fn masks_of_photos_that_were_made_smaller_are_made_smaller_too() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        file::write_png_srgb8(&root.join("a.png"), &Image::filled(4, 3, [90; 3])).unwrap();
        let halves = |width, height| {
            Image::from_fn(width, height, |_, column| if 2 * column < width { [255u8; 3] } else { [0; 3] })
        };
        for (width, height) in [(8, 6), (12, 9), (6, 5)] {
            file::write_png_srgb8(&root.join("large.png"), &halves(width, height)).unwrap();
            let views = [view(root, "a", "large.png")];
            if width == 6 {
                let loaded = load_all(
                    &views,
                    &[(4, 3)],
                    Default::default(),
                    (None, &Default::default()),
                    &ReadSettings::default(),
                );
                assert!(loaded.err().unwrap().message().contains("6 x 5"), "another shape");
            } else {
                assert_eq!(objects_of(&views), [6]);
            }
        }
        file::write_png_srgb8(&root.join("small.png"), &halves(2, 2)).unwrap();
        let views = [view(root, "a", "small.png")];
        assert!(
            load_all(&views, &[(4, 3)], Default::default(), (None, &Default::default()), &ReadSettings::default())
                .is_err()
        );
    }

    #[test]
    fn a_mask_of_one_value_is_read_as_its_neighbours_are() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        for name in ["a", "b", "c"] {
            file::write_png_srgb8(&root.join(format!("{name}.png")), &Image::filled(4, 3, [90; 3])).unwrap();
        }
        let write = |name: &str, left: u8, right: u8| {
            let value = |_, column| [if column < 2 { left } else { right }; 3];
            file::write_png_srgb8(&root.join(name), &Image::from_fn(4, 3, value)).unwrap();
        };
        write("a_mask.png", 255, 0);
        write("b_mask.png", 1, 1);
        write("c_mask.png", 255, 255);
        let views = ["a", "b", "c"].map(|name| view(root, name, &format!("{name}_mask.png")));
        assert_eq!(objects_of(&views), [6, 0, 12]);
        write("a_mask.png", 1, 0);
        write("c_mask.png", 0, 0);
        assert_eq!(objects_of(&views), [6, 12, 0]);
    }
}
