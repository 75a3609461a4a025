//! Data and reference pictures that lie beside the project, and whether a test may do without them.
//!
//! `PATINA_DATA` and `PATINA_PEERS` name other folders. With `PATINA_REQUIRE=data` a test that finds nothing fails.

use std::path::{Path, PathBuf};

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
