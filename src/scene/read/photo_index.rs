//! The photos that lie under a scene's folder, found by the names that cameras know them by.
//!
//! Projects are moved: paths in them lead to other machines. A photo is the file whose path agrees best from its end:
//! first the whole listed path, then as many folders as possible, then the name without its extension. Of folders with the
//! same photos made smaller, `images_2` beside `images_4`, the one with the largest is meant.

use super::mask_names::{EXTENSIONS_NOT_READ, Masks, PHOTO_EXTENSIONS, names_of_masks};
use super::source::{SourceCamera, SourceView};
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::files::{composed, name_of, stem_of};
use crate::image::file;
use crate::scene::lens::Lens;
use std::collections::{BTreeSet, HashMap, HashSet};
use std::path::{Component, Path, PathBuf};

/// Folders that hold pictures of other kinds, by the beginnings of their names.
const NOT_PHOTOS: [&str; 9] =
    ["__macosx", "mask", "depth", "normal", "stereo", "texture", "thumb", "rendered_depth", "segmentation"];
/// How deep folders are searched, and how many files are looked at.
const DEEPEST: usize = 6;
const MOST_FILES: usize = 200_000;

/// The photos under one or more folders.
pub struct PhotoIndex {
    roots: Vec<PathBuf>,
    by_name: HashMap<String, Vec<PathBuf>>,
    by_stem: HashMap<String, Vec<PathBuf>>,
    /// A file of each stem that is a photo of a kind that is not read.
    not_read: HashMap<String, PathBuf>,
}

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

fn lower(path: &Path) -> String {
    name_of(path).to_lowercase()
}

fn lower_stem(path: &Path) -> String {
    stem_of(path).to_lowercase()
}

/// The number of a folder of photos: 2 of `images_2`.
fn number_of(folder: &str) -> Option<usize> {
    const NAMES: [&str; 5] = ["images", "image", "photos", "rgb", "input"];
    let (name, number) = folder.rsplit_once('_')?;
    let is_of_photos = NAMES.iter().any(|own| own.eq_ignore_ascii_case(name));
    number.parse().ok().filter(|_| is_of_photos)
}

/// By how much the photos of a folder are made smaller, as its name says: 2 of `images_2`.
pub fn reduction_of(folder: &str) -> Option<usize> {
    number_of(folder).filter(|factor| *factor > 1)
}

/// The innermost folder of a photo that is numbered, and that number.
fn numbered(photo: &Path) -> Option<(&Path, usize)> {
    let mut folders = photo.ancestors().skip(1);
    folders.find_map(|folder| Some((folder, number_of(&folder.file_name()?.to_string_lossy())?)))
}

/// The innermost folder of a photo that is named after how much its photos are made smaller, and that number.
fn reduced(photo: &Path) -> Option<(&Path, usize)> {
    numbered(photo).filter(|(_, factor)| *factor > 1)
}

impl PhotoIndex {
    /// Looks under folders; what lies under the first of them is preferred.
    ///
    /// # Errors
    /// A folder that cannot be read.
    pub fn of_folders(roots: &[PathBuf]) -> Result<Self> {
        let mut found = Found::default();
        for root in roots.iter().filter(|root| root.is_dir()) {
            collect(root, 0, &mut found)?;
        }
        let (mut by_name, mut by_stem) = (HashMap::new(), HashMap::new());
        for path in found.files {
            by_name.entry(lower(&path)).or_insert_with(Vec::new).push(path.clone());
            by_stem.entry(lower_stem(&path)).or_insert_with(Vec::new).push(path);
        }
        Ok(PhotoIndex { roots: roots.to_vec(), by_name, by_stem, not_read: found.not_read })
    }

    /// The photo of a listed path; `None` when none or several fit equally well.
    pub fn find(&self, listed: &str) -> Option<PathBuf> {
        let listed = listed.replace('\\', "/");
        let relative = Path::new(listed.trim_start_matches("./"));
        if relative.is_relative() {
            let exact = self.roots.iter().map(|root| root.join(relative)).find(|path| path.is_file());
            if exact.is_some() {
                return exact;
            }
        }
        let best = |candidates: Option<&Vec<PathBuf>>| {
            let agreement = |path: &Path| {
                let part = |part: Component| composed(&part.as_os_str().to_string_lossy()).to_lowercase();
                let (own, theirs) = (path.components().rev().map(part), relative.components().rev().map(part));
                own.zip(theirs).skip(1).take_while(|(a, b)| a == b).count()
            };
            let candidates = candidates?;
            let most = candidates.iter().map(|path| agreement(path)).max()?;
            let fitting: Vec<&PathBuf> = candidates.iter().filter(|path| agreement(path) == most).collect();
            // Of two that fit alike, the one under an earlier root is meant, then the larger: images, images_2, images_4.
            // Folders that are numbered from nought or one are those of several cameras or times.
            let is_of_several =
                |path: &&PathBuf| numbered(self.below_root(path)).is_some_and(|(_, number)| number <= 1);
            if fitting.len() > 1 && fitting.iter().any(is_of_several) {
                return None;
            }
            let root_of = |path: &Path| self.roots.iter().position(|root| path.starts_with(root));
            let rank = |path: &Path| (root_of(path), reduced(self.below_root(path)).map_or(1, |(_, factor)| factor));
            let best = fitting.iter().map(|path| rank(path)).min()?;
            let mut first = fitting.into_iter().filter(|path| rank(path) == best);
            first.next().filter(|_| first.next().is_none()).cloned()
        };
        best(self.by_name.get(&lower(relative)))
            .or_else(|| best(self.by_stem.get(&lower_stem(relative))))
            .or_else(|| best(self.by_stem.get(&lower(relative))))
    }

    /// A photo's path below the root it lies under.
    fn below_root<'a>(&self, photo: &'a Path) -> &'a Path {
        self.roots.iter().find_map(|root| photo.strip_prefix(root).ok()).unwrap_or(photo)
    }

    /// A file beside a photo whose name says that it masks it, or one of its own name in a folder whose name says so:
    /// `train_mask/0001.png` of `train/0001.exr`.
    fn mask_beside(&self, photo: &Path) -> Option<PathBuf> {
        let candidates = names_of_masks(&lower_stem(photo));
        let mut files = candidates.iter().filter_map(|name| self.by_stem.get(name)).flatten();
        let beside = files.find(|mask| mask.parent() == photo.parent()).cloned();
        beside.or_else(|| {
            let folder = photo.parent()?;
            let folders = names_of_masks(&lower(folder));
            let of_its_name = self.by_stem.get(&lower_stem(photo))?;
            let is_masks = |own: &Path| own.parent() == folder.parent() && folders.contains(&lower(own));
            of_its_name.iter().find(|mask| mask.parent().is_some_and(is_masks)).cloned()
        })
    }

    /// How many of some listed paths have a photo here.
    pub fn count<'a>(&self, listed: impl Iterator<Item = &'a str>) -> usize {
        listed.filter(|listed| self.find(listed).is_some()).count()
    }
}

/// What is found under folders.
#[derive(Default)]
struct Found {
    /// Photos in the order they are found in; a folder may lie under two roots.
    files: Vec<PathBuf>,
    seen: HashSet<PathBuf>,
    not_read: HashMap<String, PathBuf>,
}

fn collect(folder: &Path, depth: usize, found: &mut Found) -> Result<()> {
    let entries = std::fs::read_dir(folder).map_err(|source| Error::reading(folder, source))?;
    let mut paths: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    paths.sort();
    for path in paths {
        let name = lower(&path);
        if name.starts_with('.') || found.files.len() >= MOST_FILES {
            continue;
        }
        if path.is_dir() {
            if depth < DEEPEST && !NOT_PHOTOS.iter().any(|start| name.starts_with(start)) {
                collect(&path, depth + 1, found)?;
            }
            continue;
        }
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
        if EXTENSIONS_NOT_READ.contains(&extension.as_str()) {
            found.not_read.entry(lower_stem(&path)).or_insert(path);
        } else if PHOTO_EXTENSIONS.contains(&extension.as_str()) && found.seen.insert(path.clone()) {
            found.files.push(path);
        }
    }
    Ok(())
}

/// The views of listed cameras whose photos are here; the others are told in one finding.
///
/// # Errors
/// `Missing` when no photo is here.
pub fn views_of(
    posed: Vec<Posed>,
    photos: &PhotoIndex,
    masks: &[PathBuf],
    findings: &mut Vec<Finding>,
) -> Result<Vec<SourceView>> {
    let masks_folder = masks.iter().find(|folder| folder.is_dir());
    let mut masks = masks_folder.map(|folder| Masks::of_folder(folder)).transpose()?.unwrap_or_default();
    let listed = posed.len();
    let (mut views, mut missing) = (Vec::new(), Vec::new());
    for own in posed {
        if !own.lens.is_finite() {
            return Err(Error::new(ErrorKind::NonFinite, "a number of the lens is not finite")
                .at(own.place)
                .remedy("calibrate or export the camera again"));
        }
        let Some(photo) = photos.find(&own.listed) else {
            missing.push(own.listed);
            continue;
        };
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
        return Err(Error::new(ErrorKind::Missing, "no camera has a pose: no photo was aligned")
            .at(Place::File(folder))
            .remedy("align the photos in the program that made the cameras, and export them again"));
    }
    // A photo of a kind that is not read is here all the same: its error names the kind and the way out.
    let not_read = |listed: &String| {
        let listed = listed.replace('\\', "/");
        let listed = Path::new(&listed);
        photos.not_read.get(&lower_stem(listed)).or_else(|| photos.not_read.get(&lower(listed)))
    };
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
            "raw files and HEIC are not read: convert them to TIFF, PNG or JPEG, all alike"
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
    if let Some(folder) = masks_folder {
        // Those of photos that take no part were meant for somebody too.
        photos.by_name.values().flatten().for_each(|photo| drop(masks.of_photo(photos.below_root(photo))));
        masks.tell_unused(folder, false, findings)?;
    }
    name_views(&mut views);
    Ok(views)
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

/// The first names of a list, and how many more there are.
pub fn some_of(names: &[String]) -> String {
    const SHOWN: usize = 5;
    let shown = names.iter().take(SHOWN).map(String::as_str).collect::<Vec<_>>().join(", ");
    if names.len() > SHOWN { format!("{shown} and {} more", names.len() - SHOWN) } else { shown }
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
#[path = "photo_index_tests.rs"]
mod tests;
