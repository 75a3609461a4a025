//! The photos that lie under a scene's folder, found by the names that cameras know them by.
//!
//! Projects are moved: paths in them lead to other machines. A photo is the file whose path agrees best from its end:
//! first the whole listed path, then as many folders as possible, then the name without its extension. Of folders with the
//! same photos made smaller, `images_2` beside `images_4`, the one with the largest is meant.

use super::mask_names::{EXTENSIONS_NOT_READ, PHOTO_EXTENSIONS, PHOTO_FOLDERS, may_hold_masks, names_of_masks};
use crate::error::{Error, Result};
use crate::files::{composed, name_of, stem_of, without_dots};
use std::collections::{HashMap, HashSet};
use std::path::{Component, Path, PathBuf};

/// Folders that hold pictures of other kinds, by the beginnings of their names.
const NOT_PHOTOS: [&str; 10] = [
    "__macosx",
    "mask",
    "depth",
    "normal",
    "stereo",
    "texture",
    "thumb",
    "rendered_depth",
    "segmentation",
    "silhouette",
];
/// How deep folders are searched, and how many files are looked at.
pub(super) const DEEPEST: usize = 6;
const MOST_FILES: usize = 200_000;

/// The photos under one or more folders.
pub struct PhotoIndex {
    pub(super) roots: Vec<PathBuf>,
    pub(super) by_name: HashMap<String, Vec<PathBuf>>,
    by_stem: HashMap<String, Vec<PathBuf>>,
    /// A file of each stem that is a photo of a kind that is not read.
    not_read: HashMap<String, PathBuf>,
}

fn lower(path: &Path) -> String {
    name_of(path).to_lowercase()
}

fn lower_stem(path: &Path) -> String {
    stem_of(path).to_lowercase()
}

/// The number of a folder of photos: 2 of `images_2`.
fn number_of(folder: &str) -> Option<usize> {
    let (name, number) = folder.rsplit_once('_')?;
    let is_of_photos = PHOTO_FOLDERS.iter().any(|own| own.eq_ignore_ascii_case(name));
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
pub(super) fn reduced(photo: &Path) -> Option<(&Path, usize)> {
    numbered(photo).filter(|(_, factor)| *factor > 1)
}

/// How many folders of a photo's path agree with those of a listed one, from the end.
pub(super) fn agreement(photo: &Path, listed: &Path) -> usize {
    let part = |part: Component| composed(&part.as_os_str().to_string_lossy()).to_lowercase();
    let (own, theirs) = (photo.components().rev().map(part), listed.components().rev().map(part));
    own.zip(theirs).skip(1).take_while(|(a, b)| a == b).count()
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
        let mut fitting = self.fitting(listed);
        if fitting.len() == 1 { fitting.pop() } else { None }
    }

    /// The photos that fit a listed path best: one, none, or several that nothing tells apart.
    pub fn fitting(&self, listed: &str) -> Vec<PathBuf> {
        let listed = listed.replace('\\', "/");
        let relative = Path::new(listed.trim_start_matches("./"));
        if relative.is_relative() {
            // What leads out of a root lies elsewhere, and is told to.
            let exact = self.roots.iter().map(|root| without_dots(&root.join(relative))).find(|path| path.is_file());
            if let Some(exact) = exact {
                return vec![exact];
            }
        }
        // What stands behind a point is an extension only if it is one of photos: `IMG.1` is a whole name.
        let extension = relative.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
        let is_of_photos = [&PHOTO_EXTENSIONS[..], &EXTENSIONS_NOT_READ].concat().contains(&extension.as_str());
        let (name, stem) = (lower(relative), lower_stem(relative));
        let stems = if is_of_photos { [stem, name.clone()] } else { [name.clone(), stem] };
        let lists = [self.by_name.get(&name)].into_iter().chain(stems.iter().map(|stem| self.by_stem.get(stem)));
        let mut several = Vec::new();
        for candidates in lists.flatten() {
            let mut best = self.best_of(candidates, relative);
            match best.len() {
                1 => return best,
                _ if several.is_empty() => several.append(&mut best),
                _ => {}
            }
        }
        // Where it was on the machine that the file was written on; this may be the one.
        if relative.is_absolute() && is_of_photos && relative.is_file() {
            return vec![relative.to_path_buf()];
        }
        several
    }

    /// Those of candidates whose path agrees best with a listed one.
    fn best_of(&self, candidates: &[PathBuf], listed: &Path) -> Vec<PathBuf> {
        // A mask has the name of its photo: it is one only where nothing else is.
        let is_mask =
            |path: &&PathBuf| self.below_root(path).ancestors().skip(1).any(|folder| may_hold_masks(&lower(folder)));
        let (masks, photos): (Vec<&PathBuf>, Vec<&PathBuf>) = candidates.iter().partition(is_mask);
        let candidates = if photos.is_empty() { masks } else { photos };
        let most = candidates.iter().map(|path| agreement(path, listed)).max().unwrap_or_default();
        let fitting: Vec<&PathBuf> = candidates.into_iter().filter(|path| agreement(path, listed) == most).collect();
        // Of two that fit alike, the one under an earlier root is meant, then the larger: images, images_2, images_4.
        // Folders that are numbered from nought or one are those of several cameras or times.
        let is_of_several = |path: &&PathBuf| numbered(self.below_root(path)).is_some_and(|(_, number)| number <= 1);
        if fitting.len() > 1 && fitting.iter().any(is_of_several) {
            return fitting.into_iter().cloned().collect();
        }
        let root_of = |path: &Path| self.roots.iter().position(|root| path.starts_with(root));
        let rank = |path: &Path| (root_of(path), reduced(self.below_root(path)).map_or(1, |(_, factor)| factor));
        let best = fitting.iter().map(|path| rank(path)).min();
        fitting.into_iter().filter(|path| Some(rank(path)) == best).cloned().collect()
    }

    /// The photo of a listed path that is here in a kind that is not read.
    pub(super) fn not_read(&self, listed: &str) -> Option<&PathBuf> {
        let listed = listed.replace('\\', "/");
        let listed = Path::new(&listed);
        self.not_read.get(&lower_stem(listed)).or_else(|| self.not_read.get(&lower(listed)))
    }

    /// A photo's path below the root it lies under.
    pub(super) fn below_root<'a>(&self, photo: &'a Path) -> &'a Path {
        self.roots.iter().find_map(|root| photo.strip_prefix(root).ok()).unwrap_or(photo)
    }

    /// A file beside a photo whose name says that it masks it, or one of its own name in a folder whose name says so:
    /// `train_mask/0001.png` of `train/0001.exr`. RealityScan puts `0001.jpg.mask.png` beside `0001.jpg`.
    pub(super) fn mask_beside(&self, photo: &Path) -> Option<PathBuf> {
        let candidates = [lower_stem(photo), lower(photo)].map(|name| names_of_masks(&name)).concat();
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

/// The first names of a list, and how many more there are.
pub fn some_of(names: &[String]) -> String {
    const SHOWN: usize = 5;
    let shown = names.iter().take(SHOWN).map(String::as_str).collect::<Vec<_>>().join(", ");
    if names.len() > SHOWN { format!("{shown} and {} more", names.len() - SHOWN) } else { shown }
}

#[cfg(test)]
#[path = "photo_index_tests.rs"]
mod tests;
