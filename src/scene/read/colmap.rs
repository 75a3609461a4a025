//! A COLMAP model, text or binary, with its photos; also a dense workspace with its mesh.
//!
//! ```text
//! sparse/0/ or sparse/ or the folder itself:   cameras, images (.bin preferred to .txt); rigs and frames are not needed;
//!                                              of sparse/0/, sparse/1/, ... the one with the most images;
//!                                              of an undistorted workspace and what it was made from, the one whose photos are here
//! images/                                      photos, in subfolders too; masks/ by the names of photos
//! meshed-poisson.ply, textured/mesh.ply, ...   or any other mesh; dense/0/ is looked into
//! ```
//! World to camera, OpenCV axes, quaternions as w x y z, the first pixel's centre at (0.5, 0.5) (COLMAP, `doc/format.rst` and
//! `sensor/models.h`).

use super::colmap_files::{ColmapImage, read_cameras_bin, read_cameras_txt, read_images_bin, read_images_txt};
use super::colmap_lens::lens_of;
use super::mesh_choice;
use super::photo_index::PhotoIndex;
use super::posed::{Posed, views_of};
use super::source::{SourceCamera, SourceScene};
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::files::folder_of;
use glam::{DMat3, DQuat, DVec3};
use std::path::{Path, PathBuf};

/// Folders the model may lie in, or models in folders that are numbers.
const MODEL_FOLDERS: [&str; 6] =
    ["sparse", "", "colmap/sparse", "dense/sparse", "dense/0/sparse", "undistorted/sparse"];

/// Folders of undistorted photos, with cameras of their own.
const WORKSPACES: [&str; 3] = ["dense", "undistorted", "stereo"];

/// The folder of the model under a scene's folder; of several the one with the most images.
pub fn model_folder(folder: &Path) -> Option<PathBuf> {
    models_of(folder).into_iter().next().map(|(model, _)| model)
}

fn holds_model(folder: &Path) -> bool {
    ["bin", "txt"]
        .iter()
        .any(|extension| ["cameras", "images"].iter().all(|name| folder.join(format!("{name}.{extension}")).is_file()))
}

/// The models that lie side by side under a scene's folder, with how many images each has; the largest first. What cannot
/// be connected becomes a model of its own, `sparse/0`, `sparse/1` and so on. An undistorted workspace has cameras of its own:
/// the first place counts whose photos are here.
fn models_of(folder: &Path) -> Vec<(PathBuf, usize)> {
    // In a folder of cameras and images nothing else is looked for.
    let places = MODEL_FOLDERS.iter().map(|inner| models_at(&folder.join(inner), inner.is_empty()));
    let mut places: Vec<Vec<(PathBuf, usize)>> = places.filter(|models| !models.is_empty()).collect();
    let own = if places.len() > 1 { places.iter().position(|models| has_photos(&models[0].0, folder)) } else { None };
    if places.is_empty() { Vec::new() } else { places.swap_remove(own.unwrap_or(0)) }
}

/// The models of one place.
fn models_at(base: &Path, is_itself: bool) -> Vec<(PathBuf, usize)> {
    if is_itself && holds_model(base) {
        return vec![(base.into(), 0)];
    }
    let entries = std::fs::read_dir(base).into_iter().flatten();
    let mut numbered: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    numbered.retain(|path| is_numbered(path) && holds_model(path));
    numbered.sort();
    if numbered.len() > 1 {
        let mut counted: Vec<(PathBuf, usize)> =
            numbered.into_iter().map(|model| (model.clone(), images_of(&model).len())).collect();
        counted.sort_by_key(|(_, images)| std::cmp::Reverse(*images));
        return counted;
    }
    let only = numbered.pop().or_else(|| holds_model(base).then(|| base.to_path_buf()));
    only.map(|model| (model, 0)).into_iter().collect()
}

fn is_numbered(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.to_string_lossy().bytes().all(|byte| byte.is_ascii_digit()))
}

/// Whether something below the scene's folder is of undistorted photos.
fn is_of_workspace(path: &Path, folder: &Path) -> bool {
    let below = path.strip_prefix(folder).unwrap_or(path);
    below.iter().any(|part| WORKSPACES.iter().any(|name| part.eq_ignore_ascii_case(name)))
}

/// Whether photos of a model are where it looks for them: those of an undistorted workspace beside it, others in a folder of the
/// scene that is none of a workspace.
fn has_photos(model: &Path, folder: &Path) -> bool {
    let base = if is_numbered(model) { folder_of(model) } else { model };
    let home = if base.ends_with("sparse") { folder_of(base) } else { base };
    let homes = if is_of_workspace(home, folder) { vec![home] } else { vec![home, folder] };
    let folders_in = |home: &&Path| {
        let entries = std::fs::read_dir(home).into_iter().flatten().filter_map(|entry| Some(entry.ok()?.path()));
        let inner =
            entries.filter(|path| path.is_dir() && (is_of_workspace(home, folder) || !is_of_workspace(path, folder)));
        std::iter::once(home.to_path_buf()).chain(inner).collect::<Vec<_>>()
    };
    let roots: Vec<PathBuf> = homes.iter().flat_map(folders_in).collect();
    images_of(model).iter().any(|image| roots.iter().any(|root| root.join(&image.name).is_file()))
}

/// The images of a model; none of one that cannot be read.
fn images_of(model: &Path) -> Vec<ColmapImage> {
    let binary = model.join("images.bin");
    if model.join("cameras.bin").is_file() && binary.is_file() {
        return read_images_bin(&binary).unwrap_or_default();
    }
    read_images_txt(&model.join("images.txt")).map(|(images, _)| images).unwrap_or_default()
}

/// That one of several models is read.
fn told_of_others(models: &[(PathBuf, usize)], folder: &Path) -> Option<Finding> {
    let ((chosen, count), others) = models.split_first().filter(|(_, others)| !others.is_empty())?;
    let shown = |path: &Path| path.strip_prefix(folder).unwrap_or(path).display().to_string();
    let others: Vec<String> = others.iter().map(|(path, count)| format!("{} has {count}", shown(path))).collect();
    let message = format!(
        "of {} models the largest is read: {} has {count} images, {}",
        others.len() + 1,
        shown(chosen),
        super::photo_index::some_of(&others)
    );
    let remedy = "each model has a frame of its own: to read another, move the larger ones out of the folder";
    Some(Finding::new(Severity::Note, "model-chosen", message).at(Place::File(chosen.clone())).remedy(remedy))
}

/// Lists a COLMAP scene and reads its cameras.
pub fn read(folder: &Path) -> Result<SourceScene> {
    let models = models_of(folder);
    let model = models.first().map_or_else(|| folder.to_path_buf(), |(model, _)| model.clone());
    let is_binary = model.join("cameras.bin").is_file() && model.join("images.bin").is_file();
    let (mut cameras, (images, noticed)) = if is_binary {
        (read_cameras_bin(&model.join("cameras.bin"))?, (read_images_bin(&model.join("images.bin"))?, Vec::new()))
    } else {
        (read_cameras_txt(&model.join("cameras.txt"))?, read_images_txt(&model.join("images.txt"))?)
    };
    let mut findings: Vec<Finding> = told_of_others(&models, folder).into_iter().chain(noticed).collect();
    let mut posed = Vec::new();
    for image in images {
        if cameras.get(&image.camera).is_some_and(Result::is_err) {
            cameras.remove(&image.camera).transpose()?;
        }
        let Some(Ok(camera)) = cameras.get(&image.camera) else {
            return Err(Error::new(
                ErrorKind::Malformed,
                format!("the image {} names camera {}, which is not there", image.name, image.camera),
            )
            .at(image.place)
            .remedy("export the model again: cameras and images do not belong together"));
        };
        let (intrinsics, lens) = lens_of(camera.model, &camera.parameters, &camera.place)?;
        let [w, x, y, z] = image.rotation;
        let rotation = DQuat::from_xyzw(x, y, z, w);
        if !(rotation.length() > 1e-6) {
            return Err(Error::new(ErrorKind::Malformed, format!("the rotation of {} is not one", image.name))
                .at(image.place)
                .remedy("export the model again"));
        }
        let rotation = DMat3::from_quat(rotation.normalize());
        let (camera_in_source, mut noticed) = SourceCamera::new(intrinsics, rotation, image.translation, &image.place)?;
        findings.append(&mut noticed);
        posed.push(Posed {
            listed: image.name,
            camera: camera_in_source,
            lens,
            size: Some(camera.size),
            mask: None,
            place: image.place,
        });
    }
    // The photos of an undistorted workspace lie beside its model, not in the original folder.
    let beside = model.ancestors().skip(1).take(2).filter(|parent| parent.starts_with(folder)).map(Path::to_path_buf);
    let bases: Vec<PathBuf> = beside.chain([folder.to_path_buf()]).collect();
    let named = |names: &[&str]| -> Vec<PathBuf> {
        bases.iter().flat_map(|base| names.iter().map(move |name| base.join(name))).collect()
    };
    let mut roots = named(&["images", "image", "photos", "input"]);
    if !is_of_workspace(&model, folder) {
        // What is undistorted is of other cameras, so that it comes after all other folders.
        let entries = std::fs::read_dir(folder).into_iter().flatten().filter_map(|entry| Some(entry.ok()?.path()));
        let mut others: Vec<PathBuf> = entries.filter(|path| path.is_dir()).collect();
        if others.iter().any(|path| is_of_workspace(path, folder)) {
            others.retain(|path| !is_of_workspace(path, folder));
            others.sort();
            roots.append(&mut others);
        }
    }
    roots.retain(|root| root.is_dir());
    roots.push(folder.into());
    roots.dedup();
    let views = views_of(posed, &PhotoIndex::of_folders(&roots)?, &bases, &mut findings)?;
    let mesh = mesh_choice::find(&[bases, vec![model.clone()]].concat(), &mut findings);
    Ok(SourceScene { findings, ..SourceScene::of_photographs(folder, mesh, views) })
}

#[cfg(test)]
#[path = "colmap_tests.rs"]
mod tests;
