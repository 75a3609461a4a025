//! Which kind of scene a folder is, why, and why it is not another.

use super::source::SourceScene;
use super::{
    alicevision, blended_mvs, bundler, colmap, exchange, manifest, metashape, metashape_project, neural_scenes,
    objects_with_lighting, openmvs, opensfm, realitycapture, realitycapture_csv, transforms,
};
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::files::folder_of;
use crate::scene::settings::ReadSettings;
use std::fmt;
use std::path::{Path, PathBuf};

/// Kinds of scenes, in the order they are looked for: what a user wrote by hand comes first, what a tool derived from another
/// before what it was derived from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Format {
    /// `scene.toml`.
    Manifest,
    /// A synthetic scene with its truth.
    Exchange,
    /// BlendedMVS or MVSNet.
    BlendedMvs,
    /// A Metashape or PhotoScan project.
    MetashapeProject,
    /// `transforms.json` and its splits.
    Transforms,
    /// Cameras exported from Metashape or PhotoScan.
    MetashapeCameras,
    /// A COLMAP model.
    Colmap,
    /// An object of Objects with Lighting.
    ObjectsWithLighting,
    /// An OpenSfM reconstruction.
    OpenSfm,
    /// An AliceVision or Meshroom scene.
    AliceVision,
    /// An interface file of OpenMVS.
    OpenMvs,
    /// Side files of RealityCapture or RealityScan.
    RealityCapture,
    /// A Bundler file with its list.
    Bundler,
    /// Camera matrices of IDR or NeuS.
    Neus,
    /// Poses of LLFF.
    Llff,
}

impl Format {
    /// All of them.
    pub const ALL: [Format; 15] = [
        Format::Manifest,
        Format::Exchange,
        Format::BlendedMvs,
        Format::MetashapeProject,
        Format::Transforms,
        Format::MetashapeCameras,
        Format::Colmap,
        Format::ObjectsWithLighting,
        Format::OpenSfm,
        Format::AliceVision,
        Format::OpenMvs,
        Format::RealityCapture,
        Format::Bundler,
        Format::Neus,
        Format::Llff,
    ];

    /// What a folder of this kind holds.
    pub fn needs(self) -> &'static str {
        match self {
            Format::Manifest => "scene.toml",
            Format::Exchange => "cameras.json",
            Format::BlendedMvs => "blended_images/, cams/ and textured_mesh/",
            Format::MetashapeProject => "a project .psx with its .files/, or .psz",
            Format::Transforms => "transforms.json or transforms_train.json",
            Format::MetashapeCameras => "an XML file of exported cameras",
            Format::Colmap => "cameras and images, .bin or .txt, in sparse/0/, sparse/ or the folder itself",
            Format::ObjectsWithLighting => "image_*.png with camera_*.txt in test/inputs/ or inputs/",
            Format::OpenSfm => "reconstruction.json",
            Format::AliceVision => "sfm.json or a .sfm file",
            Format::OpenMvs => "an interface file .mvs",
            Format::RealityCapture => {
                "an .xmp file beside each photo, or a .csv of internal and external camera parameters"
            }
            Format::Bundler => "bundle.out and list.txt, or NAME.out and NAME.list.txt",
            Format::Neus => "cameras_sphere.npz or cameras.npz",
            Format::Llff => "poses_bounds.npy",
        }
    }

    /// The file or folder that makes a folder one of this kind.
    fn found_in(self, folder: &Path) -> Option<PathBuf> {
        let whole = |is_one: bool| is_one.then(|| folder.to_path_buf());
        match self {
            Format::Manifest => Some(folder.join(manifest::FILE_NAME)).filter(|path| path.is_file()),
            Format::Exchange => whole(exchange::is_folder_of_this_kind(folder)),
            Format::BlendedMvs => whole(blended_mvs::is_folder_of_this_kind(folder)),
            Format::MetashapeProject => metashape::project_of(folder),
            Format::Transforms => transforms::file_of(folder),
            Format::MetashapeCameras => metashape::export_of(folder),
            Format::Colmap => colmap::model_folder(folder),
            Format::ObjectsWithLighting => objects_with_lighting::inputs_of(folder),
            Format::OpenSfm => Some(folder.join(opensfm::FILE_NAME)).filter(|path| path.is_file()),
            Format::AliceVision => alicevision::file_of(folder),
            Format::OpenMvs => openmvs::file_of(folder),
            Format::RealityCapture => realitycapture::folder_of(folder).or_else(|| realitycapture_csv::file_of(folder)),
            Format::Bundler => bundler::file_of(folder),
            Format::Neus => neural_scenes::neus_file(folder),
            Format::Llff => neural_scenes::llff_file(folder),
        }
    }
}

impl Format {
    /// Whether what was found can be read, as far as a look inside tells: other programs use the same names, and parts are
    /// left behind when folders are copied.
    fn is_whole(self, folder: &Path, evidence: &Path) -> bool {
        match self {
            Format::Exchange => exchange::holds_cameras(folder),
            Format::BlendedMvs => blended_mvs::holds_cameras(folder),
            Format::MetashapeProject => metashape_project::has_archive(evidence),
            Format::Transforms => transforms::holds_frames(evidence),
            Format::MetashapeCameras => metashape::holds_poses(evidence),
            Format::AliceVision => alicevision::holds_poses(evidence),
            _ => true,
        }
    }
}

impl fmt::Display for Format {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Format::Manifest => "scene.toml",
            Format::Exchange => "exchange folder",
            Format::BlendedMvs => "BlendedMVS",
            Format::MetashapeProject => "Metashape project",
            Format::Transforms => "transforms.json",
            Format::MetashapeCameras => "Metashape cameras",
            Format::Colmap => "COLMAP",
            Format::ObjectsWithLighting => "Objects with Lighting",
            Format::OpenSfm => "OpenSfM",
            Format::AliceVision => "AliceVision",
            Format::OpenMvs => "OpenMVS",
            Format::RealityCapture => "RealityCapture",
            Format::Bundler => "Bundler",
            Format::Neus => "NeuS",
            Format::Llff => "LLFF",
        })
    }
}

/// A scene that was found, not yet read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Located {
    /// Its kind.
    pub format: Format,
    /// Its folder.
    pub folder: PathBuf,
    /// The file or folder that says so.
    pub evidence: PathBuf,
    /// What else the folder could be read as, with the file that says so.
    pub others: Vec<(Format, PathBuf)>,
}

impl Located {
    /// One sentence: why this kind and no other.
    pub fn why(&self) -> String {
        let shown = |path: &Path| path.strip_prefix(&self.folder).unwrap_or(path).display().to_string();
        let evidence = match shown(&self.evidence) {
            own if own.is_empty() => self.format.needs().to_owned(),
            own => own,
        };
        let mut text = format!("it holds {evidence}");
        for (format, path) in &self.others {
            let name = shown(path);
            text += &format!(
                "; not read as {format}, though it holds {}",
                if name.is_empty() { format.needs() } else { &name }
            );
        }
        text
    }

    /// Lists the scene and reads its cameras.
    ///
    /// # Errors
    /// Those of the reader of its kind.
    pub fn list(&self, settings: &ReadSettings) -> Result<SourceScene> {
        let mut scene = match self.format {
            Format::Manifest => manifest::read(&self.evidence),
            Format::Exchange => exchange::read(&self.folder),
            Format::BlendedMvs => blended_mvs::read(&self.folder),
            Format::MetashapeProject => metashape::read_project(&self.evidence, settings.chunk.as_deref()),
            Format::Transforms => transforms::read(&self.folder),
            Format::MetashapeCameras => metashape::read_export(&self.evidence, settings.chunk.as_deref()),
            Format::Colmap => colmap::read(&self.folder),
            Format::ObjectsWithLighting => objects_with_lighting::read(&self.folder),
            Format::OpenSfm => opensfm::read(&self.folder),
            Format::AliceVision => alicevision::read(&self.evidence),
            Format::OpenMvs => openmvs::read(&self.evidence),
            Format::RealityCapture if self.evidence.is_file() => realitycapture_csv::read(&self.evidence),
            Format::RealityCapture => realitycapture::read(&self.folder),
            Format::Bundler => bundler::read(&self.evidence, &self.folder),
            Format::Neus => neural_scenes::read_neus(&self.evidence),
            Format::Llff => neural_scenes::read_llff(&self.evidence),
        }
        .map_err(|error| error.at(Place::File(self.evidence.clone())))?;
        let has_chunks = matches!(self.format, Format::MetashapeProject | Format::MetashapeCameras);
        if settings.chunk.is_some() && !has_chunks {
            let message = format!("a scene of {} has no chunks: --chunk has no effect", self.format);
            scene
                .findings
                .push(Finding::new(Severity::Warning, "chunk-without-effect", message).remedy("leave it out"));
        }
        Ok(scene)
    }
}

/// Finds out whether a scene is at a path, and of which kind, by the names of files and a look into those whose names other
/// programs use too.
///
/// # Errors
/// `Missing` or `Unsupported`, with what a scene must hold as the remedy.
pub fn locate(path: &Path) -> Result<Located> {
    if path.is_file() {
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
        let folder = folder_of(path).to_path_buf();
        let format = match extension.as_str() {
            "toml" => Format::Manifest,
            "psx" | "psz" => Format::MetashapeProject,
            "xml" => Format::MetashapeCameras,
            "sfm" => Format::AliceVision,
            "mvs" => Format::OpenMvs,
            "csv" => Format::RealityCapture,
            "out" => Format::Bundler,
            _ => {
                return Err(Error::new(
                    ErrorKind::Unsupported,
                    "a scene is a folder, or a file scene.toml, .psx, .psz, .xml, .sfm, .mvs, .csv or .out in it",
                )
                .at(Place::File(path.into()))
                .remedy("give the folder that holds the photos and the mesh"));
            }
        };
        return Ok(Located { format, folder, evidence: path.into(), others: Vec::new() });
    }
    if !path.is_dir() {
        return Err(Error::new(ErrorKind::Missing, "there is no such folder")
            .at(Place::File(path.into()))
            .remedy("check the path"));
    }
    // Downloads nest a project in folders of the same name: walk down while there is nothing but one folder.
    let mut folder = path.to_path_buf();
    for _ in 0..4 {
        let found = Format::ALL.iter().filter_map(|format| Some((*format, format.found_in(&folder)?)));
        let mut found: Vec<(Format, PathBuf)> = found.collect();
        if !found.is_empty() {
            // What is not whole is read where there is nothing else: its error says what it lacks.
            let is_whole = |(format, evidence): &(Format, PathBuf)| format.is_whole(&folder, evidence);
            let whole = if found.len() > 1 { found.iter().position(is_whole) } else { None };
            let (format, evidence) = found.remove(whole.unwrap_or(0));
            return Ok(Located { format, folder, evidence, others: found });
        }
        match only_subfolder(&folder)? {
            Some(inner) => folder = inner,
            None => break,
        }
    }
    let kinds: Vec<String> = Format::ALL.iter().map(|format| format!("{} ({format})", format.needs())).collect();
    Err(Error::new(ErrorKind::Unsupported, "the folder is not a scene of a known kind")
        .at(Place::File(path.into()))
        .remedy(format!("it must hold one of: {}", kinds.join("; "))))
}

fn only_subfolder(folder: &Path) -> Result<Option<PathBuf>> {
    let entries = std::fs::read_dir(folder).map_err(|source| Error::reading(folder, source))?;
    let mut folders: Vec<PathBuf> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.is_dir() && path.file_name().is_some_and(|name| name != "__MACOSX"))
        .collect();
    Ok(if folders.len() == 1 { folders.pop() } else { None })
}

#[cfg(test)]
#[path = "detect_tests.rs"]
mod tests;
