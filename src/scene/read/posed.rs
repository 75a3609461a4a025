//! The views of cameras that a project lists: each with its photo and its mask.

use super::mask_names::{Masks, folder_of_masks, told_of_unread};
use super::photo_index::{DEEPEST, PhotoIndex, agreement, reduced, some_of};
use super::source::{SourceCamera, SourceView};
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::files::{composed, folder_of, stem_of};
use crate::image::file;
use crate::scene::lens::Lens;
use std::cmp::Ordering;
use std::collections::hash_map::Entry;
use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};

/// A camera as a project lists it.
pub struct Posed {
    /// The photo's path or name as written.
    pub listed: String,
    /// Its camera.
    pub camera: SourceCamera,
    /// Its lens; the intrinsics of the camera put pixel centres at (0.5, 0.5).
    pub lens: Lens,
    /// Size the camera is calibrated for.
    pub size: Option<(usize, usize)>,
    /// The mask the project names.
    pub mask: Option<PathBuf>,
    /// Where it is written.
    pub place: Place,
}

impl Posed {
    /// Whether both are the same camera at the same place.
    fn is_same_camera(&self, other: &Posed) -> bool {
        let numbers = |camera: &SourceCamera| (camera.intrinsics, camera.rotation, camera.translation);
        numbers(&self.camera) == numbers(&other.camera) && self.lens == other.lens && self.size == other.size
    }
}

/// The views of listed cameras whose photos are here; the others are told in one finding. Masks lie beside the photos, or in a
/// folder of their own in one of `homes_of_masks`.
///
/// # Errors
/// `Missing` when no photo is here.
pub fn views_of(
    posed: Vec<Posed>,
    photos: &PhotoIndex,
    homes_of_masks: &[PathBuf],
    findings: &mut Vec<Finding>,
) -> Result<Vec<SourceView>> {
    let masks_folder = homes_of_masks.iter().find_map(|home| folder_of_masks(home));
    let mut masks = masks_folder.as_deref().map(Masks::of_folder).transpose()?.unwrap_or_default();
    let listed = posed.len();
    let (mut views, mut missing, mut ambiguous) = (Vec::new(), Vec::new(), Vec::new());
    for own in once_each(posed, photos, findings)? {
        if !own.posed.lens.is_finite() {
            return Err(Error::new(ErrorKind::NonFinite, "a number of the lens is not finite")
                .at(own.posed.place)
                .remedy("calibrate or export the camera again"));
        }
        let Some(photo) = own.photo else {
            let several = photos.fitting(&own.posed.listed);
            match several.len() {
                0 | 1 => missing.push(own.posed.listed),
                _ => ambiguous.push((own.posed.listed, several)),
            }
            continue;
        };
        let own = own.posed;
        own.mask.iter().for_each(|mask| masks.mark_used(mask));
        let mask =
            own.mask.or_else(|| masks.of_photo(photos.below_root(&photo))).or_else(|| photos.mask_beside(&photo));
        views.push(SourceView {
            name: String::new(),
            photo,
            mask,
            camera: own.camera,
            lens: (!own.lens.is_pinhole()).then_some(own.lens),
            size: own.size,
            place: own.place,
        });
    }
    let folder = photos.roots.first().cloned().unwrap_or_default();
    if listed == 0 {
        // Whoever read the file knows its place.
        return Err(Error::new(ErrorKind::Missing, "no camera has a pose: no photo was aligned")
            .remedy("align the photos in the program that made the cameras, and export them again"));
    }
    let not_read = |listed: &String| photos.not_read(listed);
    // A photo of a kind that is not read is here all the same: its error names the kind and the way out.
    if views.is_empty()
        && let Some(photo) = missing.iter().find_map(not_read)
    {
        return Err(match file::read_header(photo) {
            Err(error) if error.kind() == ErrorKind::Unsupported => error,
            _ => Error::new(ErrorKind::Unsupported, "photos of this kind are not read")
                .at(Place::File(photo.clone()))
                .remedy(
                    "develop raw files to linear 16-bit TIFF, convert others to TIFF, PNG or JPEG: all photos alike",
                ),
        });
    }
    if let Some((name, several)) = ambiguous.first() {
        let shown: Vec<String> = several.iter().map(|path| photos.below_root(path).display().to_string()).collect();
        let message = format!(
            "{} of {listed} photos cannot be told apart: {} fit {name} alike",
            ambiguous.len(),
            some_of(&shown)
        );
        let remedy = "keep one file for each photo, or list photos with folder and extension";
        if views.is_empty() {
            return Err(Error::new(ErrorKind::InvalidScene, message).at(Place::File(folder)).remedy(remedy));
        }
        let told = Finding::new(Severity::Warning, "photo-ambiguous", message);
        findings.push(told.at(Place::File(folder.clone())).remedy(remedy));
    }
    if views.is_empty() {
        let example = missing.first().map(|name| format!(", such as {name}")).unwrap_or_default();
        return Err(Error::new(
            ErrorKind::Missing,
            format!("none of the {listed} photos the cameras name is here{example}"),
        )
        .at(Place::File(folder))
        .remedy("copy the photos into a folder images/ of the scene"));
    }
    if !missing.is_empty() {
        let remedy = if missing.iter().any(|listed| not_read(listed).is_some()) {
            "raw files, HEIC and other kinds are not read: convert them to TIFF, PNG or JPEG, all alike"
        } else {
            "copy their photos as well to use them"
        };
        findings.push(
            Finding::new(
                Severity::Warning,
                "camera-without-photo",
                format!(
                    "{} of {listed} cameras have no photo here and are skipped: {}",
                    missing.len(),
                    some_of(&missing)
                ),
            )
            .at(Place::File(folder))
            .remedy(remedy),
        );
    }
    findings.extend(told_of_smaller(&views, photos));
    findings.extend(told_of_elsewhere(&views, photos));
    if views.iter().all(|view| view.mask.is_none()) {
        findings.extend(told_of_unread(homes_of_masks.iter().map(PathBuf::as_path)));
    }
    if let Some(folder) = &masks_folder {
        // Those of photos that take no part were meant for somebody too.
        photos.by_name.values().flatten().for_each(|photo| drop(masks.of_photo(photos.below_root(photo))));
        masks.tell_unused(folder, false, findings)?;
    }
    name_views(&mut views);
    Ok(views)
}

/// A listed camera with its photo, where there is one.
struct Found {
    posed: Posed,
    photo: Option<PathBuf>,
}

/// Each photo with one camera. Of several that lead to it the one whose path agrees best has it; a second that is listed
/// alike is dropped and told, unless its camera is another.
fn once_each(posed: Vec<Posed>, photos: &PhotoIndex, findings: &mut Vec<Finding>) -> Result<Vec<Found>> {
    let mut found: Vec<Found> = Vec::new();
    let mut owner_of: HashMap<PathBuf, usize> = HashMap::new();
    let mut twice = Vec::new();
    for own in posed {
        let photo = photos.find(&own.listed);
        let Some(path) = photo.clone() else {
            found.push(Found { posed: own, photo: None });
            continue;
        };
        let Entry::Occupied(mut owner) = owner_of.entry(path.clone()) else {
            owner_of.insert(path, found.len());
            found.push(Found { posed: own, photo });
            continue;
        };
        let first = &found[*owner.get()].posed;
        let agreement_of = |posed: &Posed| agreement(&path, Path::new(&posed.listed.replace('\\', "/")));
        match agreement_of(&own).cmp(&agreement_of(first)) {
            Ordering::Less => found.push(Found { posed: own, photo: None }),
            Ordering::Greater => {
                found[*owner.get()].photo = None;
                owner.insert(found.len());
                found.push(Found { posed: own, photo });
            }
            Ordering::Equal if own.is_same_camera(first) => twice.push(own.listed),
            Ordering::Equal => {
                let message = if own.listed == first.listed {
                    format!("{} is listed twice, with cameras that differ", own.listed)
                } else {
                    format!("{} and {} lead to one photo, {}", first.listed, own.listed, path.display())
                };
                return Err(Error::new(ErrorKind::InvalidScene, message)
                    .at(own.place)
                    .remedy("keep one of the two in the file of cameras, or copy the photo that is lacking"));
            }
        }
    }
    if !twice.is_empty() {
        let message = format!("{} photos are listed twice with the same camera: {}", twice.len(), some_of(&twice));
        findings.push(Finding::new(Severity::Note, "photo-listed-twice", message));
    }
    Ok(found)
}

/// That photos are read from where their file lists them, which is not under the scene's folder.
fn told_of_elsewhere(views: &[SourceView], photos: &PhotoIndex) -> Option<Finding> {
    let is_elsewhere = |view: &&SourceView| !photos.roots.iter().any(|root| view.photo.starts_with(root));
    let folders: BTreeSet<String> =
        views.iter().filter(is_elsewhere).map(|view| folder_of(&view.photo).display().to_string()).collect();
    let folders: Vec<String> = folders.into_iter().collect();
    let message = format!("photos are read from where the file of cameras lists them: {}", some_of(&folders));
    (!folders.is_empty()).then(|| Finding::new(Severity::Note, "photos-elsewhere", message))
}

/// That photos are taken from folders of smaller ones where those in full size are not there.
fn told_of_smaller(views: &[SourceView], photos: &PhotoIndex) -> Option<Finding> {
    let mut folders = BTreeSet::new();
    for view in views {
        let below = photos.below_root(&view.photo);
        let Some((folder, _)) = reduced(below) else { continue };
        let name = folder.to_string_lossy().into_owned();
        let whole = name.rsplit_once('_').map_or("", |(whole, _)| whole);
        if !photos.roots.iter().any(|root| root.join(whole).is_dir()) {
            folders.insert(name);
        }
    }
    let folders: Vec<String> = folders.into_iter().collect();
    let message = format!("the photos in full size are not here: those of {} are read", some_of(&folders));
    (!folders.is_empty()).then(|| {
        Finding::new(Severity::Note, "photos-smaller", message)
            .remedy("copy the folder of the photos in full size beside it for finer maps")
    })
}

/// Names views by the stems of their photos; where two are alike, with the folders in front that tell them apart.
fn name_views(views: &mut [SourceView]) {
    for depth in 0..DEEPEST {
        let name = |path: &Path| {
            let mut parts: Vec<String> =
                path.iter().rev().skip(1).take(depth).map(|part| composed(&part.to_string_lossy())).collect();
            parts.reverse();
            parts.push(stem_of(path));
            parts.join("_")
        };
        views.iter_mut().for_each(|view| view.name = name(&view.photo));
        let distinct: std::collections::HashSet<&str> = views.iter().map(|view| view.name.as_str()).collect();
        if distinct.len() == views.len() {
            return;
        }
    }
}

#[cfg(test)]
#[path = "posed_tests.rs"]
mod tests;
