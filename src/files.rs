//! Files that are written whole or not at all, and settings that are read with the line of what is wrong.
//!
//! [`kept`] is a folder of results that can be computed again, found by what they were computed from; [`digest`] tells
//! contents apart, [`packed`] makes bytes of arrays.

pub mod digest;
pub mod kept;
pub mod packed;

use crate::error::{Error, ErrorKind, Place, Result};
use std::collections::HashSet;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Component, Path, PathBuf};
use unicode_normalization::UnicodeNormalization;

/// The folder that a file lies in: of a bare name the current one, `.`, which can be listed where an empty path cannot.
pub fn folder_of(file: &Path) -> &Path {
    file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// A name as it is compared with others: letters with marks are one character each (Unicode's form C). Some systems store
/// file names with the marks behind the letters (form D), whatever a program wrote into its files.
pub fn composed(name: &str) -> String {
    if name.is_ascii() { name.to_owned() } else { name.nfc().collect() }
}

/// The name of a file, without its folder, [`composed`].
pub fn name_of(path: &Path) -> String {
    composed(&path.file_name().unwrap_or_default().to_string_lossy())
}

/// The name of a file without folder and extension, [`composed`].
pub fn stem_of(path: &Path) -> String {
    composed(&path.file_stem().unwrap_or_default().to_string_lossy())
}

/// A path as it lies on the disk, where names in it may be stored in another form of Unicode than they are written in; the
/// path itself where there is none.
pub fn as_stored(path: PathBuf) -> PathBuf {
    // Plain letters have but one form.
    if path.exists() || path.to_string_lossy().is_ascii() {
        return path;
    }
    let mut stored = PathBuf::new();
    for part in path.components() {
        let same = stored.join(part);
        stored = match part {
            Component::Normal(name) if !same.exists() => {
                let name = composed(&name.to_string_lossy());
                let entries = std::fs::read_dir(folder_of(&same)).into_iter().flatten();
                match entries.filter_map(|entry| Some(entry.ok()?.path())).find(|own| name_of(own) == name) {
                    Some(found) => stored.join(found.file_name().unwrap_or_default()),
                    None => return path,
                }
            }
            _ => same,
        };
    }
    stored
}

/// A path without `.` and `..`, as it is written: links are not followed.
pub fn without_dots(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir if plain.file_name().is_some() => drop(plain.pop()),
            Component::ParentDir if plain.has_root() => {}
            _ => plain.push(part),
        }
    }
    plain
}

/// The name of a folder, also of one that its path does not name: `.`, `..`, an empty path. Empty for a root.
pub fn name_of_folder(folder: &Path) -> String {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let whole = match folder.file_name() {
        Some(_) => folder.to_path_buf(),
        None => std::fs::canonicalize(folder).unwrap_or_default(),
    };
    whole.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Writes a file under a temporary name beside its place, flushes it to the disk and renames it.
///
/// Whatever was at `path` before stays until the new file is complete: a full disk or a killed process loses nothing.
/// `fill` writes the content through a buffer.
pub fn write_atomically(path: &Path, fill: impl FnOnce(&mut BufWriter<File>) -> std::io::Result<()>) -> Result<()> {
    replace(path, true, fill)
}

/// [`write_atomically`], or without waiting for the disk: then a power cut may leave a file that is cut.
fn replace(
    path: &Path,
    is_flushed: bool,
    fill: impl FnOnce(&mut BufWriter<File>) -> std::io::Result<()>,
) -> Result<()> {
    let temporary = temporary_beside(path);
    let outcome = (|| {
        if let Some(parent) = path.parent().filter(|parent| !parent.as_os_str().is_empty()) {
            std::fs::create_dir_all(parent)?;
        }
        let mut writer = BufWriter::new(File::create(&temporary)?);
        fill(&mut writer)?;
        writer.flush()?;
        if is_flushed {
            writer.get_ref().sync_all()?;
        }
        std::fs::rename(&temporary, path)
    })();
    outcome.map_err(|source| {
        let _ = std::fs::remove_file(&temporary);
        Error::writing(path, source)
    })
}

/// Writes bytes with [`write_atomically`].
pub fn write_bytes(path: &Path, bytes: &[u8]) -> Result<()> {
    write_atomically(path, |writer| writer.write_all(bytes))
}

/// Settings from the text of a TOML file at `path`.
///
/// # Errors
/// `InvalidSetting` with the line that is not understood.
pub fn settings_of_toml<T: serde::de::DeserializeOwned>(text: &str, path: &Path) -> Result<T> {
    toml::from_str(text).map_err(|source| {
        let line = source.span().map_or(1, |span| 1 + text[..span.start.min(text.len())].matches('\n').count());
        Error::new(ErrorKind::InvalidSetting, source.message().replace('\n', " "))
            .at(Place::Line(path.into(), line))
            .remedy("mend the line, or delete it to take the default")
    })
}

/// Names that are each other's equal only once: of those that repeat, the second is called `NAME_2`, and so on, past names
/// that are taken. For files that are named after files from several folders.
pub fn unrepeated(names: &[String]) -> Vec<String> {
    let mut taken: HashSet<String> = names.iter().cloned().collect();
    let mut met = HashSet::new();
    names
        .iter()
        .map(|name| {
            if met.insert(name) {
                return name.clone();
            }
            let mut number = 2;
            loop {
                let numbered = format!("{name}_{number}");
                if taken.insert(numbered.clone()) {
                    return numbered;
                }
                number += 1;
            }
        })
        .collect()
}

/// The temporary name of a file that is being written: same folder, so that the rename is atomic.
pub fn temporary_beside(path: &Path) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(format!(".{}.tmp", std::process::id()));
    path.with_file_name(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_repeat_are_numbered_past_those_that_are_taken() {
        let names = ["sky", "sky", "sky_2", "sun", "sky"].map(String::from);
        assert_eq!(unrepeated(&names), ["sky", "sky_3", "sky_2", "sun", "sky_4"]);
        assert!(unrepeated(&[]).is_empty());
    }

    #[test]
    fn a_failed_write_keeps_the_old_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        write_bytes(&path, b"old").unwrap();
        let error = write_atomically(&path, |writer| {
            writer.write_all(b"half")?;
            Err(std::io::Error::other("disk full"))
        });
        assert!(error.is_err());
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "the temporary file is gone");
    }

    #[test]
    fn a_bare_name_lies_in_the_current_folder_which_has_a_name() {
        for (file, folder) in [("a.sfm", "."), ("./a.sfm", "."), ("x/a.sfm", "x"), ("/a.sfm", "/"), ("../a.sfm", "..")]
        {
            assert_eq!(folder_of(Path::new(file)), Path::new(folder), "{file}");
        }
        let current = std::env::current_dir().unwrap();
        let name = |folder: &Path| folder.file_name().unwrap().to_string_lossy().into_owned();
        for path in ["", ".", "./."] {
            assert_eq!(name_of_folder(Path::new(path)), name(&current), "{path}");
        }
        assert_eq!(name_of_folder(Path::new("..")), name(current.parent().unwrap()));
        assert_eq!(name_of_folder(Path::new("far/away")), "away");
        assert!(std::fs::read_dir(folder_of(Path::new("Cargo.toml"))).is_ok());
    }

    #[test]
    fn names_in_either_form_of_unicode_are_one() {
        let [apart, whole] = ["cafe\u{301} 3", "caf\u{e9} 3"];
        assert!(apart != whole && composed(apart) == whole && composed(whole) == whole);
        assert_eq!(stem_of(Path::new("x/cafe\u{301} 3.png")), whole);
        let folder = tempfile::tempdir().unwrap();
        for (stored, written) in [(apart, whole), (whole, apart)] {
            let root = folder.path().join(stored.replace(' ', "_"));
            std::fs::create_dir_all(&root).unwrap();
            std::fs::write(root.join(format!("{stored}.png")), b"").unwrap();
            let path = folder.path().join(written.replace(' ', "_")).join(format!("{written}.png"));
            let found = as_stored(path);
            assert!(found.is_file(), "{found:?}");
            assert!(as_stored(root.join("none\u{e9}.png")).ends_with("none\u{e9}.png"));
            let again = format!("{0}/../{0}/{written}.png", written.replace(' ', "_"));
            assert!(as_stored(folder.path().join(again)).is_file());
            std::fs::remove_dir_all(&root).unwrap();
        }
    }
}
