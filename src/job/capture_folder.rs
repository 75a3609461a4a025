//! A folder of photos on its way to a scene: what is in it, what is missing, and the `scene.toml` that names the parts.
//!
//! [`CaptureParts::found_in`] looks by names and endings alone and two folders deep; whoever asks may choose otherwise. The
//! manifest is written beside the photos and never over one that is there.

use crate::error::{Error, ErrorKind, Place, Result};
use crate::files::write_bytes;
use crate::scene::read::manifest::FILE_NAME;
use std::path::{Path, PathBuf};

/// Endings of meshes that a manifest may name, those preferred first.
const MESHES: [&str; 2] = ["ply", "obj"];
/// Endings of photos.
const PHOTOS: [&str; 6] = ["jpg", "jpeg", "png", "tif", "tiff", "exr"];
/// Folders that are looked into below the one that is named.
const DEPTH: usize = 2;
/// Entries that are looked at, at most: a home folder is none of a capture.
const MOST_ENTRIES: usize = 50_000;

/// The axes of the cameras that are read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CaptureAxes {
    /// x right, y down, z forward.
    #[default]
    OpenCv,
    /// x right, y up, z back.
    OpenGl,
}

/// The parts of a scene in a folder, as far as they are known.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CaptureParts {
    /// The folder.
    pub folder: PathBuf,
    /// The mesh.
    pub mesh: Option<PathBuf>,
    /// The folder of photos.
    pub photos: Option<PathBuf>,
    /// Number of photos in it.
    pub photo_count: usize,
    /// A folder of `<photo>_cam.txt`, or a `cameras.json`.
    pub cameras: Option<PathBuf>,
    /// A folder of masks; none are needed.
    pub masks: Option<PathBuf>,
    /// The axes of the cameras.
    pub axes: CaptureAxes,
    /// Whether matrices are from the camera to the world.
    pub world_from_camera: bool,
}

impl CaptureParts {
    /// What lies in a folder.
    ///
    /// # Errors
    /// `Missing` or `Unreadable` for the folder itself.
    pub fn found_in(folder: &Path) -> Result<Self> {
        let folder = std::path::absolute(folder).unwrap_or_else(|_| folder.into());
        if !folder.is_dir() {
            return Err(Error::new(ErrorKind::Missing, "this is no folder")
                .at(Place::File(folder))
                .remedy("name the folder that holds photos, mesh and cameras"));
        }
        let mut files = Vec::new();
        list(&folder, DEPTH, &mut files);
        files.sort();
        let ending = |path: &Path| path.extension().map(|own| own.to_string_lossy().to_lowercase()).unwrap_or_default();
        let stem = |path: &Path| path.file_stem().map(|own| own.to_string_lossy().to_lowercase()).unwrap_or_default();
        let is_of_masks = |path: &Path| {
            let parent = path.parent().and_then(Path::file_name).map(|own| own.to_string_lossy().to_lowercase());
            parent.is_some_and(|parent| parent.contains("mask"))
        };
        let size = |path: &PathBuf| std::fs::metadata(path).map_or(0, |facts| facts.len());
        let mesh = MESHES
            .iter()
            .find_map(|own| files.iter().filter(|path| ending(path) == *own).max_by_key(|path| size(path)));
        let is_photo = |path: &Path| PHOTOS.contains(&ending(path).as_str());
        let (masks, photos): (Vec<&PathBuf>, Vec<&PathBuf>) =
            files.iter().filter(|path| is_photo(path)).partition(|path| is_of_masks(path));
        let fullest = |files: &[&PathBuf]| -> Option<(PathBuf, usize)> {
            let mut counted: Vec<(PathBuf, usize)> = Vec::new();
            for folder in files.iter().filter_map(|path| path.parent()) {
                match counted.iter_mut().find(|(own, _)| own == folder) {
                    Some((_, count)) => *count += 1,
                    None => counted.push((folder.into(), 1)),
                }
            }
            counted.into_iter().rev().max_by_key(|(_, count)| *count)
        };
        let cameras =
            files.iter().find(|path| ending(path) == "json" && stem(path) == "cameras").cloned().or_else(|| {
                files.iter().find(|path| stem(path).ends_with("_cam")).and_then(|path| path.parent()).map(Into::into)
            });
        let photos = fullest(&photos);
        Ok(CaptureParts {
            mesh: mesh.cloned(),
            photo_count: photos.as_ref().map_or(0, |(_, count)| *count),
            photos: photos.map(|(folder, _)| folder),
            cameras,
            masks: fullest(&masks).map(|(folder, _)| folder),
            folder,
            ..CaptureParts::default()
        })
    }

    /// Takes another folder of photos.
    pub fn choose_photos(&mut self, photos: PathBuf) {
        let mut files = Vec::new();
        list(&photos, 0, &mut files);
        let is_photo = |path: &PathBuf| {
            path.extension().is_some_and(|own| PHOTOS.contains(&own.to_string_lossy().to_lowercase().as_str()))
        };
        self.photo_count = files.iter().filter(|path| is_photo(path)).count();
        self.photos = Some(photos);
    }

    /// The names of what a scene cannot do without and is not there.
    pub fn missing(&self) -> Vec<&'static str> {
        let parts = [
            ("photos", self.photos.is_some() && self.photo_count > 0),
            ("mesh", self.mesh.is_some()),
            ("cameras", self.cameras.is_some()),
        ];
        parts.into_iter().filter(|(_, is_there)| !is_there).map(|(name, _)| name).collect()
    }

    /// The manifest as it would be written; paths below the folder are relative to it.
    pub fn manifest(&self) -> String {
        let mut table = toml::Table::new();
        let path = |path: &Path| {
            let inside = path.strip_prefix(&self.folder).unwrap_or(path);
            // A folder itself is named by a dot.
            let text =
                if inside.as_os_str().is_empty() { ".".into() } else { inside.to_string_lossy().replace('\\', "/") };
            toml::Value::String(text)
        };
        let parts =
            [("mesh", &self.mesh), ("images", &self.photos), ("cameras", &self.cameras), ("masks", &self.masks)];
        for (name, part) in parts {
            if let Some(part) = part {
                table.insert(name.into(), path(part));
            }
        }
        let axes = if self.axes == CaptureAxes::OpenGl { "opengl" } else { "opencv" };
        table.insert("camera_axes".into(), axes.into());
        let matrix = if self.world_from_camera { "world_from_camera" } else { "camera_from_world" };
        table.insert("camera_matrix".into(), matrix.into());
        table.to_string()
    }

    /// Writes the manifest into the folder; returns its path.
    ///
    /// # Errors
    /// `InvalidSetting` while a part is missing; `Unwritable` where a manifest is there already, or the folder is read-only.
    pub fn write_manifest(&self) -> Result<PathBuf> {
        let missing = self.missing();
        if !missing.is_empty() {
            return Err(Error::new(ErrorKind::InvalidSetting, format!("missing: {}", missing.join(", ")))
                .at(Place::File(self.folder.clone()))
                .remedy("choose each part, or put it into the folder and look again"));
        }
        let file = self.folder.join(FILE_NAME);
        if file.exists() {
            return Err(Error::new(ErrorKind::Unwritable, "there is a scene.toml already")
                .at(Place::File(file))
                .remedy("open the folder as it is, or move that file away first"));
        }
        write_bytes(&file, self.manifest().as_bytes())?;
        Ok(file)
    }
}

/// Files of a folder and of those below it; what cannot be listed is left out.
fn list(folder: &Path, depth: usize, files: &mut Vec<PathBuf>) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        if files.len() >= MOST_ENTRIES {
            return;
        }
        let path = entry.path();
        let is_hidden = entry.file_name().to_string_lossy().starts_with('.');
        match entry.file_type() {
            Ok(kind) if kind.is_dir() && depth > 0 && !is_hidden => list(&path, depth - 1, files),
            Ok(kind) if kind.is_file() && !is_hidden => files.push(path),
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_tells_its_parts_and_what_is_missing_and_the_manifest_names_them() {
        let place = tempfile::tempdir().unwrap();
        let root = std::path::absolute(place.path()).unwrap();
        let put = |name: &str| {
            let path = root.join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, b"content").unwrap();
        };
        for photo in ["a", "b", "c", "d"] {
            put(&format!("my photos/{photo}.JPG"));
            put(&format!("my masks/{photo}.png"));
        }
        put("notes/plan.png");
        let mut parts = CaptureParts::found_in(&root).unwrap();
        assert_eq!((parts.photo_count, parts.missing()), (4, vec!["mesh", "cameras"]));
        assert_eq!(parts.masks, Some(root.join("my masks")));
        assert_eq!(parts.write_manifest().unwrap_err().kind(), ErrorKind::InvalidSetting);
        put("scan.obj");
        put("cams/a_cam.txt");
        let axes = CaptureAxes::OpenGl;
        parts = CaptureParts { axes, ..CaptureParts::found_in(&root).unwrap() };
        assert!(parts.missing().is_empty(), "{parts:?}");
        let file = parts.write_manifest().unwrap();
        let written: toml::Table = std::fs::read_to_string(&file).unwrap().parse().unwrap();
        assert_eq!(written["images"].as_str(), Some("my photos"));
        assert_eq!(written["mesh"].as_str(), Some("scan.obj"));
        assert_eq!(written["cameras"].as_str(), Some("cams"));
        assert_eq!(written["camera_axes"].as_str(), Some("opengl"));
        // What is there is not overwritten, and the reader takes the keys: it goes on to the cameras.
        assert_eq!(parts.write_manifest().unwrap_err().kind(), ErrorKind::Unwritable);
        let error = crate::scene::read::manifest::read(&file).unwrap_err();
        assert!(!error.to_string().contains("manifest cannot be read"), "{error}");
        assert_eq!(CaptureParts::found_in(&root.join("nowhere")).unwrap_err().kind(), ErrorKind::Missing);
        parts.choose_photos(root.join("notes"));
        assert_eq!(parts.photo_count, 1);
    }
}
