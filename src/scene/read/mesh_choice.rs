//! Which of the mesh files of a folder is meant, for formats that do not name it.

use crate::error::{Error, ErrorKind, Finding, Place, Severity};
use crate::files::{name_of, stem_of};
use std::io::Read;
use std::path::{Path, PathBuf};

/// Extensions of meshes, the better first.
const EXTENSIONS: [&str; 5] = ["obj", "ply", "glb", "gltf", "stl"];
/// Extensions of meshes and scenes that are not read.
const NOT_READ: [&str; 14] =
    ["fbx", "off", "dae", "3ds", "usd", "usda", "usdc", "usdz", "x3d", "wrl", "3mf", "blend", "abc", "ctm"];
/// Folder of a mesh with a texture, as COLMAP writes it beside the mesh without one.
const TEXTURED: &str = "textured";
/// Folders a mesh may lie in, the better first.
const FOLDERS: [&str; 13] = [
    "",
    "mesh",
    "meshes",
    TEXTURED,
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
                // What was textured is meant before what it was made from, unless that has a name of its own.
                let order = match (*inner, whole) {
                    ("", Some(_)) => 0,
                    (TEXTURED, Some(_)) => 1,
                    _ => order + 2,
                };
                let rank = (depth * (FOLDERS.len() + 2) + order, by_name, kind);
                if !found.iter().any(|(_, other)| *other == path) {
                    found.push((rank, path));
                }
            }
        }
    }
    found.sort();
    let Some((_, chosen)) = found.first() else { return Vec::new() };
    let pieces = pieces_of(chosen, found.iter().map(|(_, path)| path));
    let others: Vec<String> = found
        .iter()
        .filter(|(_, path)| path != chosen && !pieces.contains(path))
        .map(|(_, path)| path.display().to_string())
        .collect();
    if !others.is_empty() {
        findings.push(
            Finding::new(
                Severity::Note,
                "mesh-choice",
                format!("there are several meshes here; the others are {}", super::photo_index::some_of(&others)),
            )
            .at(Place::File(chosen.clone()))
            .remedy("choose another with --mesh FILE, which may be given for each piece of a mesh"),
        );
    }
    pieces
}

/// A mesh that was exported in pieces: files of one name and kind whose numbers go on from nought, `model_0.obj`,
/// `model_1.obj` or `model_000.obj`, `model_001.obj`. Other files stand alone: numbers from elsewhere are those of versions
/// or of sizes.
fn pieces_of<'a>(chosen: &Path, found: impl Iterator<Item = &'a PathBuf>) -> Vec<PathBuf> {
    let split = |path: &Path| {
        let stem = stem_of(path);
        let (name, digits) = stem.rsplit_once('_')?;
        let number: usize = digits.parse().ok().filter(|_| digits.bytes().all(|byte| byte.is_ascii_digit()))?;
        Some((path.with_file_name(name), path.extension()?.to_ascii_lowercase(), number))
    };
    let alone = vec![chosen.to_path_buf()];
    let Some((name, kind, _)) = split(chosen) else { return alone };
    let same = found.filter_map(|path| {
        let (own_name, own_kind, number) = split(path)?;
        (own_name == name && own_kind == kind).then(|| (number, path.clone()))
    });
    let mut pieces: Vec<(usize, PathBuf)> = same.collect();
    pieces.sort();
    let go_on = pieces.iter().enumerate().all(|(place, (number, _))| place == *number);
    if go_on { pieces.into_iter().map(|(_, path)| path).collect() } else { alone }
}

/// That a scene has no mesh, naming one of a kind that is not read.
pub fn none_found(folder: &Path) -> Error {
    let files = || FOLDERS.iter().flat_map(|inner| std::fs::read_dir(folder.join(inner)).into_iter().flatten());
    let is_not_read = |path: &PathBuf| {
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
        NOT_READ.contains(&extension.as_str()) && path.is_file()
    };
    let unread = files().filter_map(|entry| Some(entry.ok()?.path())).filter(is_not_read).min();
    if let Some(unread) = unread {
        let message = format!("no mesh was found but {}, which is of a kind that is not read", name_of(&unread));
        return Error::new(ErrorKind::Missing, message)
            .at(Place::File(unread))
            .remedy("convert it to OBJ, PLY, glTF or STL, in the coordinate system of the cameras");
    }
    let remedy = if folder.join("blended_images").is_dir() {
        "BlendedMVS offers its meshes as a separate download: put it into textured_mesh/, or name it with --mesh FILE"
    } else {
        "put one into the folder, in the coordinate system of the cameras, or name it with --mesh FILE"
    };
    Error::new(ErrorKind::Missing, "no mesh was found with the photos and cameras")
        .at(Place::File(folder.into()))
        .remedy(remedy)
}

/// Whether the header of a PLY file announces faces or strips of them: without them it is a point cloud.
fn has_faces(path: &Path) -> bool {
    let mut start = Vec::new();
    let Ok(file) = std::fs::File::open(path) else { return false };
    if file.take(1 << 14).read_to_end(&mut start).is_err() {
        return false;
    }
    let text = String::from_utf8_lossy(&start);
    // Line ends are those of any system, also where numbers follow the header that are no text.
    let header = text.split(['\n', '\r']).map(str::trim).take_while(|line| *line != "end_header");
    let announced = |line: &str| {
        ["element face", "element tristrips"].iter().find_map(|start| line.strip_prefix(start)).map(str::to_owned)
    };
    header.filter_map(announced).any(|count| count.trim() != "0")
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

    #[test]
    fn headers_are_read_with_any_line_end_and_strips_are_surfaces() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.ply");
        for (header, has) in [
            ("ply\rformat ascii 1.0\relement vertex 3\relement face 1\rend_header\r", true),
            ("ply\r\nelement face 1\r\nend_header\r\n", true),
            ("ply\nelement tristrips 1\nend_header\n", true),
            ("ply\relement face 0\rend_header\r", false),
        ] {
            std::fs::write(&path, header).unwrap();
            assert_eq!(has_faces(&path), has, "{header:?}");
        }
    }

    #[test]
    fn pieces_are_one_mesh_where_their_numbers_go_on_from_nought() {
        let folder = tempfile::tempdir().unwrap();
        let chosen = |names: &[&str]| {
            for entry in std::fs::read_dir(folder.path()).unwrap() {
                std::fs::remove_file(entry.unwrap().path()).unwrap();
            }
            names.iter().for_each(|name| std::fs::write(folder.path().join(name), b"").unwrap());
            let mut findings = Vec::new();
            let chosen = find(&[folder.path().into()], &mut findings);
            let names: Vec<String> = chosen.iter().map(|path| name_of(path)).collect();
            (names.join(" "), findings.len())
        };
        assert_eq!(
            chosen(&["model_1.obj", "model_0.obj", "model_2.obj"]),
            ("model_0.obj model_1.obj model_2.obj".into(), 0)
        );
        assert_eq!(chosen(&["a_000.obj", "a_001.obj", "b.obj"]), ("a_000.obj a_001.obj".into(), 1));
        assert_eq!(chosen(&["mesh_1.obj", "mesh_2.obj"]), ("mesh_1.obj".into(), 1), "versions");
        assert_eq!(chosen(&["mesh_0.obj", "mesh_2.obj"]), ("mesh_0.obj".into(), 1));
        assert_eq!(chosen(&["mesh_0.obj", "mesh_1.stl"]), ("mesh_0.obj".into(), 1));
        assert_eq!(chosen(&["mesh.obj"]), ("mesh.obj".into(), 0));
    }

    #[test]
    fn a_mesh_of_a_kind_that_is_not_read_is_named() {
        let folder = tempfile::tempdir().unwrap();
        assert!(none_found(folder.path()).remedy_text().contains("--mesh"));
        std::fs::write(folder.path().join("Scan.FBX"), b"").unwrap();
        let error = none_found(folder.path());
        assert!(error.to_string().contains("Scan.FBX") && error.remedy_text().contains("OBJ"), "{error}");
    }
}
