//! The folder of a new run, where none was named.

use std::path::{Path, PathBuf};

/// A folder for a new run of a scene that does not exist yet: `runs/scene-1`, `runs/scene-2`, ...
pub fn new_run_folder(runs: &Path, scene: &str) -> PathBuf {
    let safe: String = scene.chars().map(|c| if c.is_alphanumeric() || "-_. ".contains(c) { c } else { '_' }).collect();
    let safe = safe.trim_matches([' ', '.']);
    let stem = if safe.is_empty() { "scene" } else { safe };
    let numbered = |number: usize| runs.join(format!("{stem}-{number}"));
    (1..).map(numbered).find(|path| !path.exists()).unwrap_or_else(|| numbered(0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn new_runs_never_meet_an_old_folder() {
        let folder = tempfile::tempdir().unwrap();
        let first = new_run_folder(folder.path(), "a/b");
        assert!(first.ends_with("a_b-1"));
        std::fs::create_dir(&first).unwrap();
        assert!(new_run_folder(folder.path(), "a/b").ends_with("a_b-2"));
        assert!(new_run_folder(folder.path(), "..").ends_with("scene-1"));
    }
}
