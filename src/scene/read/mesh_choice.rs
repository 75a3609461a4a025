//! Which of the mesh files of a folder is meant, for formats that do not name it.

use crate::error::{Finding, Place, Severity};
use std::io::Read;
use std::path::{Path, PathBuf};

/// Extensions of meshes, the better first.
const EXTENSIONS: [&str; 5] = ["obj", "ply", "glb", "gltf", "stl"];
/// Folders a mesh may lie in, the better first.
const FOLDERS: [&str; 13] = [
    "",
    "mesh",
    "meshes",
    "textured",
    "textured_mesh",
    "model",
    "models",
    "dense",
    "dense/0",
    "mvs",
    "exports",
    "undistorted",
    "texturing",
];
/// Names a mesh may have, whole or as a beginning, the better first.
const NAMES: [&str; 3] = ["mesh", "textured", "model"];
const BEGINNINGS: [&str; 6] = ["textured", "meshed-poisson", "meshed-delaunay", "scene_dense_mesh", "mesh", "model"];

/// The mesh of a scene's folder; empty when there is none. Point clouds are passed over.
pub fn find(folders: &[PathBuf], findings: &mut Vec<Finding>) -> Vec<PathBuf> {
    let mut found: Vec<((usize, usize, usize), PathBuf)> = Vec::new();
    for (depth, folder) in folders.iter().enumerate() {
        for (order, inner) in FOLDERS.iter().enumerate() {
            let Ok(entries) = std::fs::read_dir(folder.join(inner)) else { continue };
            for path in entries.filter_map(|entry| Some(entry.ok()?.path())) {
                let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
                let Some(kind) = EXTENSIONS.iter().position(|known| *known == extension) else { continue };
                let name = path.file_stem().unwrap_or_default().to_string_lossy().to_lowercase();
                if !path.is_file() || name.starts_with('.') || (extension == "ply" && !has_faces(&path)) {
                    continue;
                }
                let whole = NAMES.iter().position(|known| name == *known);
                let begins = || BEGINNINGS.iter().position(|known| name.starts_with(known)).unwrap_or(BEGINNINGS.len());
                let by_name = whole.unwrap_or_else(|| NAMES.len() + begins());
                let rank = (depth * FOLDERS.len() + order, by_name, kind);
                if !found.iter().any(|(_, other)| *other == path) {
                    found.push((rank, path));
                }
            }
        }
    }
    found.sort();
    let Some((_, chosen)) = found.first() else { return Vec::new() };
    if found.len() > 1 {
        let others: Vec<String> = found[1..].iter().map(|(_, path)| path.display().to_string()).collect();
        findings.push(
            Finding::new(
                Severity::Note,
                "mesh-choice",
                format!("there are several meshes here; the others are {}", super::photo_index::some_of(&others)),
            )
            .at(Place::File(chosen.clone()))
            .remedy("choose another with --mesh FILE"),
        );
    }
    vec![chosen.clone()]
}

/// Whether the header of a PLY file announces faces: without them it is a point cloud.
fn has_faces(path: &Path) -> bool {
    let mut start = Vec::new();
    let Ok(file) = std::fs::File::open(path) else { return false };
    if file.take(1 << 14).read_to_end(&mut start).is_err() {
        return false;
    }
    let text = String::from_utf8_lossy(&start);
    let header = text.lines().take_while(|line| line.trim() != "end_header");
    header.filter_map(|line| line.trim().strip_prefix("element face")).any(|count| count.trim() != "0")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn point_clouds_are_passed_over_and_the_choice_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
        write("fused.ply", "ply\nformat ascii 1.0\nelement vertex 0\nend_header\n");
        let mut findings = Vec::new();
        assert!(find(&[folder.path().into()], &mut findings).is_empty());
        write("meshed-delaunay.ply", "ply\nformat ascii 1.0\nelement vertex 0\nelement face 3\nend_header\n");
        write("meshed-poisson.ply", "ply\nformat ascii 1.0\nelement vertex 0\nelement face 3\nend_header\n");
        let chosen = find(&[folder.path().into()], &mut findings);
        assert_eq!(chosen, [folder.path().join("meshed-poisson.ply")]);
        assert_eq!(findings[0].code, "mesh-choice");
    }
}
