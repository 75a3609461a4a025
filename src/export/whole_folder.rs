//! A folder that is there whole or not at all.

use crate::error::{Error, ErrorKind, Place, Result};
use std::path::{Path, PathBuf};

/// First line of `convention.txt` of an export: marks a folder that an export may replace.
pub const FIRST_LINE: &str = "Patina export, format 1";

/// A folder that is filled under a temporary name and renamed when it is complete. Dropped before, it is removed.
#[derive(Debug)]
pub struct WholeFolder {
    temporary: PathBuf,
    target: PathBuf,
}

impl WholeFolder {
    /// Makes the temporary folder beside the target. What an interrupted export left there is removed first.
    ///
    /// # Errors
    /// `Unwritable` when the target holds anything but an earlier export, or when its parent may not be written.
    pub fn begin(target: &Path) -> Result<Self> {
        if target.exists() && !is_replaceable(target)? {
            return Err(Error::new(ErrorKind::Unwritable, "the folder holds other files and is not an export")
                .at(Place::File(target.into()))
                .remedy("name a new or an empty folder with -o; nothing was changed"));
        }
        let refuse = |source| {
            Error::new(ErrorKind::Unwritable, format!("the folder cannot be made: {source}"))
                .at(Place::File(target.into()))
                .remedy("name a folder that may be written with -o; nothing was changed")
        };
        let mut name = std::ffi::OsString::from(".");
        name.push(target.file_name().ok_or_else(|| {
            Error::new(ErrorKind::InvalidSetting, "the path does not end in a name")
                .at(Place::File(target.into()))
                .remedy("name a folder with -o")
        })?);
        name.push(".unfinished");
        let temporary = target.with_file_name(name);
        if temporary.exists() {
            std::fs::remove_dir_all(&temporary).map_err(refuse)?;
        }
        std::fs::create_dir_all(&temporary).map_err(refuse)?;
        Ok(WholeFolder { temporary, target: target.into() })
    }

    /// Where to write.
    pub fn path(&self) -> &Path {
        &self.temporary
    }

    /// Puts the folder in its place; an earlier export there is removed only once the new one stands.
    ///
    /// # Errors
    /// `Unwritable`; the earlier export is then back in its place.
    pub fn finish(self) -> Result<()> {
        let refuse = |source| Error::writing(&self.target, source);
        let mut aside = self.temporary.clone().into_os_string();
        aside.push(".earlier");
        let aside = PathBuf::from(aside);
        let replaces = self.target.exists();
        if replaces {
            let _ = std::fs::remove_dir_all(&aside);
            std::fs::rename(&self.target, &aside).map_err(refuse)?;
        }
        if let Err(source) = std::fs::rename(&self.temporary, &self.target) {
            if replaces {
                let _ = std::fs::rename(&aside, &self.target);
            }
            return Err(refuse(source));
        }
        if replaces {
            let _ = std::fs::remove_dir_all(&aside);
        }
        Ok(())
    }
}

impl Drop for WholeFolder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.temporary);
    }
}

/// Whether a folder is empty or an earlier export.
fn is_replaceable(folder: &Path) -> Result<bool> {
    if std::fs::read(folder.join("convention.txt")).is_ok_and(|bytes| bytes.starts_with(FIRST_LINE.as_bytes())) {
        return Ok(true);
    }
    let mut entries = std::fs::read_dir(folder)
        .map_err(|source| Error::writing(folder, source).remedy("name a folder that does not exist yet with -o"))?;
    Ok(entries.next().is_none())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fill(folder: &WholeFolder, text: &str) {
        let sheet = format!("{FIRST_LINE}\n{text}");
        crate::files::write_bytes(&folder.path().join("convention.txt"), sheet.as_bytes()).unwrap();
    }

    #[test]
    fn nothing_half_is_left_and_an_earlier_export_stays_until_the_new_one_stands() {
        let parent = tempfile::tempdir().unwrap();
        let target = parent.path().join("out");
        let names = || {
            let mut names: Vec<_> =
                std::fs::read_dir(parent.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
            names.sort();
            names
        };
        let first = WholeFolder::begin(&target).unwrap();
        fill(&first, "one");
        assert!(!target.exists());
        first.finish().unwrap();
        assert_eq!(names(), ["out"]);

        let interrupted = WholeFolder::begin(&target).unwrap();
        fill(&interrupted, "half");
        drop(interrupted);
        assert_eq!(names(), ["out"]);
        assert!(std::fs::read_to_string(target.join("convention.txt")).unwrap().ends_with("one"));

        let second = WholeFolder::begin(&target).unwrap();
        fill(&second, "two");
        second.finish().unwrap();
        assert_eq!(names(), ["out"]);
        assert!(std::fs::read_to_string(target.join("convention.txt")).unwrap().ends_with("two"));
    }

    #[test]
    fn a_folder_of_other_things_is_not_replaced() {
        let parent = tempfile::tempdir().unwrap();
        let target = parent.path().join("photos");
        crate::files::write_bytes(&target.join("a.txt"), b"mine").unwrap();
        let error = WholeFolder::begin(&target).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Unwritable);
        assert_eq!(error.place(), &Place::File(target.clone()));
        assert!(error.remedy_text().contains("-o"));
        assert_eq!(std::fs::read(target.join("a.txt")).unwrap(), b"mine");
    }
}
