//! The result that a run folder held before another fit began in it: set aside whole, until that fit's own is written.
//!
//! A fit writes its settings and its mesh at once and its maps at the end. Beside maps of an earlier fit these would be
//! another atlas: pictures of such a folder would be wrong without a word, and the earlier result would be lost even where
//! the new fit never ends.

use super::stated::STATED_FILES;
use super::{CAPTURE_FILE, RESULT_FILES, RunFolder};
use crate::error::{Error, Result};
use std::path::Path;

/// Subfolder of what was set aside: a run folder of its own.
pub const EARLIER: &str = "earlier";
/// What belongs to a result beside its maps.
const BESIDE: [&str; 6] = ["settings.toml", "checkpoint", "loss.csv", CAPTURE_FILE, "report.json", "report.html"];

impl RunFolder {
    /// Moves a whole result, if there is one, into the subfolder [`EARLIER`], in place of what was there. That is a run
    /// folder, which can be opened, relit and compared.
    ///
    /// # Errors
    /// `Unwritable` when that subfolder holds other things than a run, or for files that cannot be moved: what was not moved
    /// stays where it was.
    pub fn set_result_aside(&self) -> Result<()> {
        if !self.has_result() {
            return Ok(());
        }
        let earlier = RunFolder::create(&self.file(EARLIER))?;
        // What an older run had and this one has not must not stay among its files.
        earlier.remove_files()?;
        for name in files_of_a_run() {
            let from = self.file(name);
            if from.is_file() {
                std::fs::rename(&from, earlier.file(name)).map_err(|source| Error::writing(&from, source))?;
            }
        }
        Ok(())
    }

    /// Removes what was set aside, once there is a newer result. Files that no run makes stay, with their folder.
    ///
    /// # Errors
    /// Files that cannot be removed.
    pub fn remove_earlier(&self) -> Result<()> {
        let path = self.file(EARLIER);
        if !path.is_dir() || !self.has_result() {
            return Ok(());
        }
        let earlier = RunFolder { path, lock: None };
        earlier.remove_files()?;
        if is_empty_but_for_its_mark(&earlier) {
            std::fs::remove_dir_all(earlier.path()).map_err(|source| Error::writing(earlier.path(), source))?;
        }
        Ok(())
    }

    /// Whether a result was set aside.
    pub fn has_earlier(&self) -> bool {
        RunFolder { path: self.file(EARLIER), lock: None }.has_result()
    }

    fn remove_files(&self) -> Result<()> {
        for name in files_of_a_run() {
            let path = self.file(name);
            if path.is_file() {
                std::fs::remove_file(&path).map_err(|source| Error::writing(&path, source))?;
            }
        }
        Ok(())
    }
}

/// Everything a fit writes but the mark of the folder.
pub(in crate::export) fn files_of_a_run() -> impl Iterator<Item = &'static str> {
    RESULT_FILES.into_iter().chain(STATED_FILES).chain(BESIDE)
}

fn is_empty_but_for_its_mark(folder: &RunFolder) -> bool {
    let is_mark = |path: &Path| path.file_name().is_some_and(|name| name == super::MARK_FILE);
    std::fs::read_dir(folder.path())
        .is_ok_and(|entries| entries.flatten().all(|entry| entry.path().is_file() && is_mark(&entry.path())))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::write_bytes;

    fn run_in(path: &Path, text: &str, names: &[&str]) -> RunFolder {
        let folder = RunFolder::create(path).unwrap();
        names.iter().for_each(|name| write_bytes(&folder.file(name), text.as_bytes()).unwrap());
        folder
    }

    #[test]
    fn a_result_is_kept_whole_until_there_is_a_newer_one() {
        let parent = tempfile::tempdir().unwrap();
        let path = parent.path().join("run");
        let text = |folder: &RunFolder, name: &str| std::fs::read_to_string(folder.file(name)).ok();
        let first: Vec<&str> = RESULT_FILES.into_iter().chain(["settings.toml", "choices.exr"]).collect();
        let folder = run_in(&path, "first", &first);
        write_bytes(&folder.file("notes.txt"), b"the user's own").unwrap();
        folder.set_result_aside().unwrap();
        assert!(folder.is_run() && !folder.has_result() && folder.has_earlier());
        let earlier = RunFolder::open(&folder.file(EARLIER)).unwrap();
        assert!(earlier.is_run() && earlier.has_result() && folder.file("notes.txt").is_file());
        assert_eq!(text(&earlier, "settings.toml").unwrap(), "first");

        // A fit that never ended has no result: what is set aside stays.
        run_in(&path, "second", &["mesh.obj", "settings.toml"]);
        folder.set_result_aside().unwrap();
        folder.remove_earlier().unwrap();
        assert_eq!(text(&earlier, "mesh.obj").unwrap(), "first");

        // The next one ended, and a third begins: no file of the first is among those of the second.
        run_in(&path, "second", &RESULT_FILES);
        folder.set_result_aside().unwrap();
        assert_eq!(text(&earlier, "diffuse.exr").unwrap(), "second");
        assert_eq!(text(&earlier, "choices.exr"), None);

        run_in(&path, "third", &RESULT_FILES);
        folder.remove_earlier().unwrap();
        assert!(!earlier.path().exists() && folder.file("notes.txt").is_file());
        assert_eq!(text(&folder, "diffuse.exr").unwrap(), "third");
    }

    #[test]
    fn what_the_user_put_beside_an_earlier_result_stays() {
        let parent = tempfile::tempdir().unwrap();
        let path = parent.path().join("run");
        let folder = run_in(&path, "first", &RESULT_FILES);
        folder.set_result_aside().unwrap();
        write_bytes(&folder.file(EARLIER).join("relight").join("a.png"), b"picture").unwrap();
        run_in(&path, "second", &RESULT_FILES);
        folder.remove_earlier().unwrap();
        assert!(folder.file(EARLIER).join("relight").join("a.png").is_file());
        assert!(!folder.has_earlier());
    }
}
