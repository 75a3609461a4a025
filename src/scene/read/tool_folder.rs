//! Folders in which tools leave photos, masks and a mesh beside their cameras.

use super::mesh_choice;
use super::photo_index::PhotoIndex;
use super::posed::{Posed, views_of};
use super::source::SourceScene;
use crate::error::{Finding, Result};
use std::path::{Path, PathBuf};

/// The scene of a tool's folder: the views of listed cameras with the masks beside them, and the mesh that is chosen from
/// `mesh_folders`.
///
/// # Errors
/// `Missing` when no photo is here.
pub fn scene_of(
    folder: &Path,
    posed: Vec<Posed>,
    photos: &PhotoIndex,
    mesh_folders: &[PathBuf],
    mut findings: Vec<Finding>,
) -> Result<SourceScene> {
    let views = views_of(posed, photos, &[folder.into()], &mut findings)?;
    let mesh = mesh_choice::find(mesh_folders, &mut findings);
    Ok(SourceScene { findings, ..SourceScene::of_photographs(folder, mesh, views) })
}
