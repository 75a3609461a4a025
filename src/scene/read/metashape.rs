//! Metashape and PhotoScan: exported `cameras.xml`, and the project `NAME.psx` with its `NAME.files/`.
//!
//! ```text
//! NAME.files/project.zip            doc.xml: chunks        NAME.files/C/chunk.zip        doc.xml: sensors, cameras
//! NAME.files/C/F/frame.zip          doc.xml: paths of photos  NAME.files/C/F/masks/masks.zip    masks by camera
//! NAME.files/C/F/model/model.zip    its mesh, read where no other is here
//! ```
//! A project of one archive, `NAME.psz`, has all of this in its `doc.xml`.
//! Camera to chunk, OpenCV axes. PhotoScan up to 1.2 writes `fx fy cx cy` in pixels and p1 p2 in OpenCV's order (measured on
//! tie points); later versions write `f`, offsets from the middle, an affinity b1 b2, and P1 P2 the other way round
//! (Metashape manual, appendix D). Cameras without a transform are not aligned: they are told.

use super::mesh_choice;
use super::metashape_cameras::{self, Cameras};
use super::metashape_project::{self, Chunk, parse};
use super::photo_index::{PhotoIndex, some_of};
use super::posed::views_of;
use super::source::{MeshFrame, SourceScene};
use super::{blended_mvs::files_of, camera_file::read_text};
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::files::{folder_of, name_of};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The project of a folder, if it holds one.
pub fn project_of(folder: &Path) -> Option<PathBuf> {
    let files = files_of(folder, &["psx", "psz"]).ok()?;
    let photos_of_chunks = |path: &PathBuf| -> Vec<Vec<String>> {
        let chunks = metashape_project::chunks(path).unwrap_or_default();
        chunks.into_iter().map(|chunk| chunk.photos.into_values().collect()).collect()
    };
    with_most_photos(folder, files, photos_of_chunks)
}

/// Of several files the one with a chunk of which most photos are here; the first of equals.
fn with_most_photos(
    folder: &Path,
    mut files: Vec<PathBuf>,
    photos_of_chunks: impl Fn(&PathBuf) -> Vec<Vec<String>>,
) -> Option<PathBuf> {
    if files.len() < 2 {
        return files.pop();
    }
    let here = photos_of(folder).ok()?;
    let count = |path: &PathBuf| {
        let chunks = photos_of_chunks(path);
        let here = chunks.iter().map(|photos| here.count(photos.iter().map(String::as_str))).max();
        (here, chunks.iter().any(|photos| !photos.is_empty()))
    };
    // The last of equals is taken.
    files.into_iter().rev().max_by_key(count)
}

/// That other files of the kind lie beside the one that is read.
fn told_of_others(file: &Path, others: Vec<PathBuf>) -> Option<Finding> {
    let others: Vec<String> =
        others.iter().filter(|other| other.as_path() != file).map(|other| name_of(other)).collect();
    let message = format!("{} is read, not {}", name_of(file), some_of(&others));
    (!others.is_empty()).then(|| {
        Finding::new(Severity::Note, "project-chosen", message)
            .at(Place::File(file.into()))
            .remedy("give the file in place of the folder to read another")
    })
}

/// The exported cameras of a folder, if it holds any: the first XML file with poses whose root is a document, or else the
/// first such document, which may be one of markers.
pub fn export_of(folder: &Path) -> Option<PathBuf> {
    let files = exports_in(folder);
    with_most_photos(folder, files, |path| {
        let Ok(text) = read_text(path) else { return Vec::new() };
        let Ok(document) = parse(&text, path) else { return Vec::new() };
        let chunks = document.descendants().filter(|node| node.has_tag_name("chunk"));
        chunks.map(metashape_cameras::aligned_labels).collect()
    })
}

/// Files of exported cameras in a folder.
fn exports_in(folder: &Path) -> Vec<PathBuf> {
    let mut files = files_of(folder, &["xml"]).unwrap_or_default();
    files.retain(|path| {
        let Ok(text) = read_text(path) else { return false };
        let start: String = text.chars().take(2000).collect();
        start.contains("<document") && start.contains("<chunk")
    });
    files
}

/// Whether exported cameras have poses.
pub fn holds_poses(path: &Path) -> bool {
    let Ok(text) = read_text(path) else { return false };
    let Ok(document) = parse(&text, path) else { return false };
    let mut chunks = document.descendants().filter(|node| node.has_tag_name("chunk"));
    chunks.any(|chunk| !metashape_cameras::aligned_labels(chunk).is_empty())
}

fn photos_of(folder: &Path) -> Result<PhotoIndex> {
    PhotoIndex::of_folders(&[folder.join("images"), folder.into()].map(|path: PathBuf| path))
}

fn finish(
    folder: &Path,
    cameras: Cameras,
    photos: &PhotoIndex,
    own_model: Option<PathBuf>,
    mut findings: Vec<Finding>,
) -> Result<SourceScene> {
    let views = views_of(cameras.posed, photos, &[folder.into()], &mut findings)?;
    let mut mesh = mesh_choice::find(&[folder.into()], &mut findings);
    if let Some(own) = own_model.filter(|_| mesh.is_empty()) {
        let message = "the model of the project is read: there is no other mesh here";
        findings.push(Finding::new(Severity::Note, "mesh-of-project", message).at(Place::File(own.clone())));
        mesh.push(own);
    }
    let mut scene = SourceScene::of_photographs(folder, mesh, views);
    if let Some(world_from_chunk) = cameras.transform {
        // A mesh may be exported in the chunk's frame or in the world's.
        let source_from_mesh = world_from_chunk.inverse();
        scene.mesh_frames.push(MeshFrame { name: "the transform of the chunk", source_from_mesh });
    }
    scene.findings = findings;
    Ok(scene)
}

/// What a chunk is chosen by.
struct Candidate {
    id: String,
    label: String,
    /// Paths or labels of its photos.
    photos: Vec<String>,
}

/// Reads exported cameras of one chunk: the one asked for by label or number, counted from 0, or else the one with the most
/// photos here.
///
/// # Errors
/// `InvalidSetting` for a chunk that is not there, `Malformed` for a file without one, and those of [`metashape_cameras`].
pub fn read_export(file: &Path, chunk: Option<&str>) -> Result<SourceScene> {
    let text = read_text(file)?;
    let document = parse(&text, file)?;
    let folder = folder_of(file);
    let photos = photos_of(folder)?;
    let chunks: Vec<_> = document.descendants().filter(|node| node.has_tag_name("chunk")).collect();
    if chunks.is_empty() {
        return Err(Error::new(ErrorKind::Malformed, "the file holds no chunk with cameras")
            .at(Place::File(file.into()))
            .remedy("export cameras with File > Export > Export Cameras"));
    }
    let candidates: Vec<Candidate> = chunks
        .iter()
        .enumerate()
        .map(|(index, node)| Candidate {
            id: index.to_string(),
            label: node.attribute("label").unwrap_or_default().to_owned(),
            photos: metashape_cameras::aligned_labels(*node),
        })
        .collect();
    let (index, told) = choose(&candidates, chunk, &photos, file)?;
    let mut findings: Vec<Finding> = told_of_others(file, exports_in(folder)).into_iter().chain(told).collect();
    let cameras = metashape_cameras::read(chunks[index], &BTreeMap::new(), &BTreeMap::new(), file, &mut findings)?;
    finish(folder, cameras, &photos, None, findings)
}

/// Reads a project; `asked` is the label or the number of the chunk, otherwise the one most of whose photos are here.
///
/// # Errors
/// `InvalidSetting` for a chunk that is not there, those of the archives and of [`metashape_cameras`].
pub fn read_project(file: &Path, asked: Option<&str>) -> Result<SourceScene> {
    let folder = folder_of(file);
    let photos = photos_of(folder)?;
    let chunks = metashape_project::chunks(file)?;
    let candidate = |chunk: &Chunk| Candidate {
        id: chunk.id.clone(),
        label: chunk.label.clone(),
        photos: chunk.photos.values().cloned().collect(),
    };
    let (index, told) = choose(&chunks.iter().map(candidate).collect::<Vec<_>>(), asked, &photos, file)?;
    let others = files_of(folder, &["psx", "psz"])?;
    let mut findings: Vec<Finding> = told.into_iter().chain(told_of_others(file, others)).collect();
    let chunk = &chunks[index];
    let document = parse(&chunk.text, &chunk.file)?;
    let cameras =
        metashape_cameras::read(document.root_element(), &chunk.photos, &chunk.masks, &chunk.file, &mut findings)?;
    if let Some(absent) = &chunk.absent_masks {
        let message = "the project has masks of its own, but their archive is not there";
        let remedy = "copy it along with the project, or put masks named after the photos into a folder masks/";
        findings
            .push(Finding::new(Severity::Note, "masks-absent", message).at(Place::File(absent.clone())).remedy(remedy));
    }
    finish(folder, cameras, &photos, chunk.model.clone(), findings)
}

/// The place of the chunk that is read among `chunks`, and what is told of the choice where there was one.
fn choose(
    chunks: &[Candidate],
    asked: Option<&str>,
    photos: &PhotoIndex,
    file: &Path,
) -> Result<(usize, Option<Finding>)> {
    let labels: Vec<String> = chunks.iter().map(|chunk| format!("{} ({})", chunk.label, chunk.id)).collect();
    let remedy = format!("choose one with --chunk: {}", labels.join(", "));
    let failed =
        |kind, message: String| Err(Error::new(kind, message).at(Place::File(file.into())).remedy(remedy.clone()));
    let told = |message: String| Finding::new(Severity::Note, "chunk-chosen", message);
    if let Some(asked) = asked {
        // A label is what the user sees: it comes before a number.
        let named = chunks.iter().position(|chunk| chunk.label == asked);
        return match named.or_else(|| chunks.iter().position(|chunk| chunk.id == asked)) {
            Some(index) => Ok((index, Some(told(format!("the chunk {} was asked for", chunks[index].label))))),
            None => failed(ErrorKind::InvalidSetting, format!("there is no chunk '{asked}'")),
        };
    }
    // Of chunks with the same photos here the one with the fewest others: a merged chunk holds them all.
    let here: Vec<usize> = chunks.iter().map(|chunk| photos.count(chunk.photos.iter().map(String::as_str))).collect();
    let rank = |index: usize| (here[index], std::cmp::Reverse(chunks[index].photos.len()), std::cmp::Reverse(index));
    let Some(best) = (0..chunks.len()).max_by_key(|&index| rank(index)) else {
        return failed(ErrorKind::InvalidScene, "the project has no chunks".into());
    };
    let message = format!(
        "of {} chunks the one labelled {} is read: {} of its {} photos are here, no other has more",
        chunks.len(),
        chunks[best].label,
        here[best],
        chunks[best].photos.len()
    );
    Ok((best, (chunks.len() > 1).then(|| told(message).remedy(remedy))))
}

#[cfg(test)]
#[path = "metashape_tests.rs"]
mod tests;
