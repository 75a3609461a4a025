//! Data and reference pictures that lie beside the project, and whether a test may do without them.
//!
//! `PATINA_DATA` and `PATINA_PEERS` name other folders. With `PATINA_REQUIRE=data` a test that finds nothing fails.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

/// Whether `PATINA_REQUIRE`, a list with commas, names this.
pub fn is_required(what: &str) -> bool {
    std::env::var("PATINA_REQUIRE").is_ok_and(|list| list.split(',').any(|word| word.trim() == what))
}

/// A file or folder of the data beside the project; `None`, after a printed word, where it is not there.
pub fn data(relative: &str) -> Option<PathBuf> {
    found("PATINA_DATA", "../shared/data", relative)
}

/// A file or folder of the scenes of other renderers beside the project, as [`data`].
pub fn peers(relative: &str) -> Option<PathBuf> {
    found("PATINA_PEERS", "../shared/peers", relative)
}

fn found(variable: &str, beside: &str, relative: &str) -> Option<PathBuf> {
    let folder =
        std::env::var_os(variable).map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join(beside), PathBuf::from);
    let path = folder.join(relative);
    if path.exists() {
        return Some(path);
    }
    assert!(!is_required("data"), "{} is not present, and PATINA_REQUIRE asks for data", path.display());
    println!("skipped: {} not present", path.display());
    None
}

/// Small inputs that were once read wrongly, unpacked from `../shared/cases/cases.tar.xz` (or the folder that `PATINA_CASES`
/// names); `None`, after a printed word, where they are not there.
pub fn cases() -> Option<PathBuf> {
    static UNPACKED: LazyLock<Option<(Option<tempfile::TempDir>, PathBuf)>> = LazyLock::new(|| {
        if let Some(folder) = std::env::var_os("PATINA_CASES") {
            return Some((None, folder.into()));
        }
        let archive = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/cases/cases.tar.xz");
        if !archive.is_file() {
            return None;
        }
        let folder = tempfile::tempdir().ok()?;
        let status = Command::new("tar").arg("xJf").arg(&archive).arg("-C").arg(folder.path()).status().ok()?;
        let path = folder.path().to_path_buf();
        status.success().then_some((Some(folder), path))
    });
    let folder = UNPACKED.as_ref().map(|(_, folder)| folder.clone());
    if folder.is_none() {
        assert!(!is_required("data"), "the cases are not beside the project, and PATINA_REQUIRE asks for data");
        println!("skipped: the cases are not beside the project");
    }
    folder
}
