//! Which mask belongs to which photo, by name.
//!
//! Programs name masks in their own ways: `a.png`, `a.jpg.png` (COLMAP), `a_mask.png`, `mask_a.png`, in `mask/` or `masks/`,
//! in sub-folders as the photos or all in one, with numbers of another count of digits. The first rule that one mask alone
//! fulfils decides. What belongs to no photo is told, since it was meant for one.

use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::files::{composed, name_of, stem_of};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Extensions of photos and masks that are read.
pub const PHOTO_EXTENSIONS: [&str; 8] = ["jpg", "jpeg", "png", "tif", "tiff", "exr", "hdr", "pfm"];
/// Extensions of raw files, of phones' photos and of others that are not read.
pub const EXTENSIONS_NOT_READ: [&str; 22] = [
    "dng", "nef", "cr2", "cr3", "arw", "raf", "orf", "rw2", "pef", "srw", "heic", "heif", "avif", "webp", "bmp", "gif",
    "jp2", "j2k", "jxl", "pgm", "ppm", "tga",
];
/// Names of folders of masks, in any case, the likelier first.
const FOLDER_NAMES: [&str; 4] = ["masks", "mask", "silhouettes", "silhouette"];
/// Names of folders of photos, in which masks may have a folder of theirs.
pub const PHOTO_FOLDERS: [&str; 6] = ["images", "image", "photos", "rgb", "input", "blended_images"];
/// What is added to a photo's name.
const SUFFIXES: [&str; 8] = ["_mask", "-mask", ".mask", "_masks", "_seg", "_segmentation", "_silhouette", "_matte"];
const PREFIXES: [&str; 5] = ["mask_", "mask-", "mask.", "masks_", "seg_"];
/// Folders in folders that are looked into.
const DEEPEST: usize = 6;

/// The folders in a folder, in the order of their names.
fn folders_in(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten();
    let mut folders: Vec<PathBuf> =
        entries.filter_map(|entry| Some(entry.ok()?.path())).filter(|path| path.is_dir()).collect();
    folders.sort();
    folders
}

/// The first folder of those with one of these names, in any case.
fn named<'a>(folders: &'a [PathBuf], names: &[&str]) -> Option<&'a PathBuf> {
    let has_name =
        |path: &PathBuf, wanted: &str| path.file_name().is_some_and(|name| name.eq_ignore_ascii_case(wanted));
    names.iter().find_map(|wanted| folders.iter().find(|path| has_name(path, wanted)))
}

/// The folder of masks in a scene's folder, or in its folder of photos.
pub fn folder_of_masks(scene: &Path) -> Option<PathBuf> {
    let folders = folders_in(scene);
    named(&folders, &FOLDER_NAMES).cloned().or_else(|| {
        let among_photos = folders_in(named(&folders, &PHOTO_FOLDERS)?);
        named(&among_photos, &FOLDER_NAMES).cloned()
    })
}

/// Words in the name of a folder that may hold masks and no photos.
const WORDS_OF_MASKS: [&str; 10] = [
    "mask",
    "masks",
    "masked",
    "silhouette",
    "silhouettes",
    "matte",
    "mattes",
    "segmentation",
    "segmentations",
    "foreground",
];
/// And of one that may hold either.
const WORDS_OF_SOME_MASKS: [&str; 2] = ["seg", "alpha"];

/// Whether a folder by its name, in lower case, may hold masks and no photos.
pub fn may_hold_masks(folder: &str) -> bool {
    let is_of_masks = |word: &str| WORDS_OF_MASKS.contains(&word);
    folder.split(|letter: char| !letter.is_alphabetic()).any(is_of_masks)
}

/// Tells of a folder in one of these that by its name may hold masks, but is none of those that are read.
pub fn told_of_unread<'a>(homes: impl IntoIterator<Item = &'a Path>) -> Option<Finding> {
    let is_unread = |folder: &PathBuf| {
        let name = name_of(folder).to_lowercase();
        let may = may_hold_masks(&name) || WORDS_OF_SOME_MASKS.contains(&name.as_str());
        may && !FOLDER_NAMES.contains(&name.as_str())
    };
    let unread = homes.into_iter().find_map(|home| folders_in(home).into_iter().find(is_unread))?;
    let message = "the folder may hold masks, but by its name it is none that is looked into";
    let remedy = "name it masks/, and each mask after its photo, to use them";
    Some(Finding::new(Severity::Note, "masks-unread", message).at(Place::File(unread)).remedy(remedy))
}

/// A mask and the names it may go by.
#[derive(Clone, Debug)]
struct Entry {
    path: PathBuf,
    /// Folder below that of the masks, with `/`.
    folder: String,
    /// Name without extensions and without what marks a mask.
    name: String,
    used: bool,
}

/// The masks of a folder, to be matched with photos.
#[derive(Clone, Debug, Default)]
pub struct Masks {
    entries: Vec<Entry>,
}

impl Masks {
    /// The masks of a folder and the folders in it; `__MACOSX` and hidden files are passed over. A missing folder has none.
    pub fn of_folder(folder: &Path) -> Result<Self> {
        let mut entries = Vec::new();
        collect(folder, String::new(), 0, &mut entries)?;
        entries.sort_by(|a, b| a.path.cmp(&b.path));
        Ok(Masks { entries })
    }

    /// The mask of a photo, by its path below the folder of photos.
    pub fn of_photo(&mut self, photo: &Path) -> Option<PathBuf> {
        let folder = photo.parent().unwrap_or(Path::new("")).components().fold(String::new(), |text, part| {
            let part = composed(&part.as_os_str().to_string_lossy());
            if text.is_empty() { part } else { format!("{text}/{part}") }
        });
        let name = stem_of(photo);
        let lower = name.to_lowercase();
        let number = last_number(&lower);
        let rules: [&dyn Fn(&Entry) -> bool; 5] = [
            &|mask| mask.folder == folder && mask.name == name,
            &|mask| mask.name == name,
            &|mask| mask.name.to_lowercase() == lower,
            &|mask| number.is_some() && mask.folder == folder && last_number(&mask.name.to_lowercase()) == number,
            &|mask| number.is_some() && last_number(&mask.name.to_lowercase()) == number,
        ];
        for rule in rules {
            let mut fit = self.entries.iter().enumerate().filter(|(_, mask)| rule(mask)).map(|(index, _)| index);
            match (fit.next(), fit.next()) {
                (Some(index), None) => {
                    self.entries[index].used = true;
                    return Some(self.entries[index].path.clone());
                }
                (Some(_), Some(_)) => return None,
                _ => {}
            }
        }
        None
    }

    /// Marks a mask that its photo names itself.
    pub fn mark_used(&mut self, path: &Path) {
        self.entries.iter_mut().filter(|mask| mask.path == path).for_each(|mask| mask.used = true);
    }

    /// Tells of masks that belong to no photo. Those that a manifest names are an error.
    ///
    /// # Errors
    /// `InvalidScene` where `are_named` and a mask was not asked for by any photo.
    pub fn tell_unused(&self, folder: &Path, are_named: bool, findings: &mut Vec<Finding>) -> Result<()> {
        let unused: Vec<&Entry> = self.entries.iter().filter(|mask| !mask.used).collect();
        let Some(first) = unused.first() else { return Ok(()) };
        let name = first.path.file_name().unwrap_or_default().to_string_lossy();
        let message = match unused.len() {
            1 => format!("the mask '{name}' belongs to no photo"),
            count => format!("{count} of {} masks belong to no photo, such as '{name}'", self.entries.len()),
        };
        let remedy = "name masks after photos: 0001.png, 0001.jpg.png or 0001_mask.png for 0001.jpg";
        if are_named {
            return Err(Error::new(ErrorKind::InvalidScene, message).at(Place::File(folder.into())).remedy(remedy));
        }
        findings.push(
            Finding::new(Severity::Warning, "mask-without-photo", message)
                .at(Place::File(folder.into()))
                .remedy(remedy),
        );
        Ok(())
    }
}

fn collect(folder: &Path, below: String, depth: usize, entries: &mut Vec<Entry>) -> Result<()> {
    if !folder.is_dir() {
        return Ok(());
    }
    for entry in std::fs::read_dir(folder).map_err(|source| Error::reading(folder, source))? {
        let path = entry.map_err(|source| Error::reading(folder, source))?.path();
        let file_name = name_of(&path);
        if file_name.starts_with('.') || file_name == "__MACOSX" {
            continue;
        }
        if path.is_dir() {
            let below = if below.is_empty() { file_name } else { format!("{below}/{file_name}") };
            if depth < DEEPEST {
                collect(&path, below, depth + 1, entries)?;
            }
        } else if let Some(stem) = without_extension(&file_name) {
            let name = without_marks(without_extension(stem).unwrap_or(stem)).to_owned();
            entries.push(Entry { path, folder: below.clone(), name, used: false });
        }
    }
    Ok(())
}

/// A file's name without an extension of a photo; `None` where it has none.
fn without_extension(name: &str) -> Option<&str> {
    let (stem, extension) = name.rsplit_once('.')?;
    PHOTO_EXTENSIONS.iter().any(|own| own.eq_ignore_ascii_case(extension)).then_some(stem)
}

/// A name without what marks it as a mask's; it stays whole where nothing would be left.
fn without_marks(name: &str) -> &str {
    let lower = name.to_ascii_lowercase();
    let suffix = SUFFIXES.iter().find(|suffix| lower.ends_with(**suffix)).map_or(0, |suffix| suffix.len());
    let prefix = if suffix > 0 { 0 } else { PREFIXES.iter().find(|p| lower.starts_with(**p)).map_or(0, |p| p.len()) };
    let bare = name.get(prefix..name.len() - suffix).unwrap_or(name);
    // `a_mask.jpg.png` has its mark before the extension, `a.jpg_mask.png` behind it.
    let bare = without_extension(bare).unwrap_or(bare);
    if bare.is_empty() { name } else { bare }
}

/// The stems that a mask beside a photo may have, in lower case.
pub fn names_of_masks(stem: &str) -> Vec<String> {
    let behind = SUFFIXES.iter().map(|suffix| format!("{stem}{suffix}"));
    behind.chain(PREFIXES.iter().map(|prefix| format!("{prefix}{stem}"))).collect()
}

/// The photo that a file among the photos masks, if its name marks it so: `a` of `a_mask` or `mask_a`.
pub fn masked_photo(stem: &str) -> Option<&str> {
    let bare = without_marks(stem);
    (bare != stem).then_some(bare)
}

/// The last number of a name without leading zeros, and what stands before and behind it.
fn last_number(name: &str) -> Option<(String, String, String)> {
    let end = name.rfind(|letter: char| letter.is_ascii_digit())? + 1;
    let start = name[..end]
        .rfind(|letter: char| !letter.is_ascii_digit())
        .map_or(0, |place| place + name[place..].chars().next().map_or(1, char::len_utf8));
    let digits = name[start..end].trim_start_matches('0');
    Some((name[..start].to_owned(), digits.to_owned(), name[end..].to_owned()))
}

/// Parts masks from photos that lie in one folder: of each file that is named as the mask of another, the photo's name.
pub fn beside_photos(photos: &BTreeMap<String, PathBuf>) -> Vec<(String, String)> {
    let names = photos.keys();
    names
        .filter_map(|stem| masked_photo(stem).filter(|bare| photos.contains_key(*bare)).map(|bare| (stem, bare)))
        .map(|(stem, bare)| (stem.clone(), bare.to_owned()))
        .collect()
}

#[cfg(test)]
#[allow(clippy::disallowed_methods)]
mod tests {
    use super::*;

    fn masks(names: &[&str]) -> (tempfile::TempDir, Masks) {
        let folder = tempfile::tempdir().unwrap();
        for name in names {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, b"").unwrap();
        }
        let masks = Masks::of_folder(folder.path()).unwrap();
        (folder, masks)
    }

    fn found(masks: &mut Masks, photo: &str) -> Option<String> {
        let path = masks.of_photo(Path::new(photo))?;
        Some(path.file_name().unwrap().to_string_lossy().into_owned())
    }

    #[test]
    fn folders_are_of_masks_by_a_word_of_their_name() {
        assert!(["masks", "photo_masks", "mask2", "scan-silhouettes"].into_iter().all(may_hold_masks));
        assert!(!["formatted", "unmasked", "images"].into_iter().any(may_hold_masks));
    }

    #[test]
    fn every_common_scheme_is_matched() {
        let schemes = [
            "a1.png",
            "a1.jpg.png",
            "a1.png.png",
            "a1_mask.png",
            "mask_a1.png",
            "a1.mask.png",
            "A1.PNG",
            "a001.png",
            "a1_mask.jpg.png",
            "a1.jpg_mask.png",
            "deep/a1.png",
            "a1.tif",
        ];
        for scheme in schemes {
            let (_folder, mut masks) = masks(&[scheme, "b7.png"]);
            let expected = scheme.rsplit('/').next().unwrap().to_owned();
            assert_eq!(found(&mut masks, "a1.jpg"), Some(expected), "{scheme}");
        }
        let (_folder, mut none) = masks(&["b1.png", "a12.png", "a1x.png"]);
        assert_eq!(found(&mut none, "a1.jpg"), None);
    }

    #[test]
    fn names_are_matched_in_either_form_of_unicode() {
        let [apart, whole] = ["cafe\u{301}", "caf\u{e9}"];
        for (stored, asked) in [(apart, whole), (whole, apart)] {
            let (_folder, mut own) = masks(&[&format!("{stored}/{stored}_mask.png"), "cafe.png"]);
            assert_eq!(found(&mut own, &format!("{asked}/{asked}.jpg")), Some(format!("{stored}_mask.png")));
        }
    }

    #[test]
    fn folders_and_numbers_decide_only_where_one_mask_fits() {
        let (_folder, mut both) = masks(&["left/1.png", "right/1.png", "__MACOSX/1.png", "left/._1.png"]);
        assert_eq!(both.of_photo(Path::new("right/1.jpg")).unwrap(), _folder.path().join("right/1.png"));
        assert_eq!(found(&mut both, "1.jpg"), None, "two masks have this name");
        let (_folder, mut numbers) = masks(&["img_0010.png", "img_10.png", "img_7_2.png"]);
        assert_eq!(found(&mut numbers, "img_010.jpg"), None);
        assert_eq!(found(&mut numbers, "img_7_02.jpg").unwrap(), "img_7_2.png");
        assert_eq!(last_number("füür007ä"), Some(("füür".into(), "7".into(), "ä".into())));
    }

    #[test]
    fn what_belongs_to_no_photo_is_told_or_refused() {
        let (folder, mut some) = masks(&["a.png", "z.png"]);
        assert!(found(&mut some, "a.jpg").is_some());
        let mut findings = Vec::new();
        some.tell_unused(folder.path(), false, &mut findings).unwrap();
        assert_eq!((findings[0].code, findings[0].severity), ("mask-without-photo", Severity::Warning));
        assert!(findings[0].message.contains("'z.png'"));
        let error = some.tell_unused(folder.path(), true, &mut findings).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::InvalidScene);
    }

    #[test]
    fn masks_among_the_photos_are_parted_from_them() {
        let names = ["a", "a_mask", "mask_b", "b", "mask_of_plaster"];
        let photos = names.iter().map(|name| ((*name).to_owned(), PathBuf::from(name))).collect();
        let pairs = beside_photos(&photos);
        assert_eq!(pairs, [("a_mask".to_owned(), "a".to_owned()), ("mask_b".to_owned(), "b".to_owned())]);
    }

    #[test]
    fn folders_that_may_hold_masks_are_told_and_others_are_not() {
        let home = tempfile::tempdir().unwrap();
        for name in ["masks", "images", "alpha7", "cams"] {
            std::fs::create_dir(home.path().join(name)).unwrap();
        }
        assert_eq!(told_of_unread([home.path()]), None);
        std::fs::create_dir(home.path().join("Object_Mask")).unwrap();
        let told = told_of_unread([home.path()]).unwrap();
        assert!(told.code == "masks-unread" && format!("{told}").contains("Object_Mask"), "{told}");
    }
}
