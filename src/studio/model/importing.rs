//! A capture on its way to a scene: which folder is looked at, and what was chosen in it.

use super::{Dialog, Model, PickFor};
use crate::job::capture_folder::CaptureParts;
use crate::job::open::{self, PathKind};
use std::path::{Path, PathBuf};

/// What the dialog asks for.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImportRequest {
    /// The folder, as it was typed.
    pub folder: String,
    /// The parts in it; what was found, or chosen in its place.
    pub chosen: Option<CaptureParts>,
    /// What the folder is where it can be opened without a manifest.
    pub is_readable: Option<&'static str>,
    /// The folder that was looked at last, and why there are no parts.
    looked_at: Option<(String, Option<String>)>,
}

impl ImportRequest {
    /// The parts of the folder, looked for once for the same text; `None` while nothing is typed, and why there are none.
    pub fn parts(&mut self) -> Result<Option<&CaptureParts>, &str> {
        let text = self.folder.trim().to_owned();
        if text.is_empty() {
            (self.chosen, self.is_readable, self.looked_at) = (None, None, None);
            return Ok(None);
        }
        if self.looked_at.as_ref().is_none_or(|(own, _)| *own != text) {
            let found = CaptureParts::found_in(Path::new(&text));
            let why = found.as_ref().err().map(|error| error.message().to_owned());
            self.is_readable = match open::kind_of(Path::new(&text)) {
                Ok(PathKind::Scene) => Some("This is a scene"),
                Ok(PathKind::Run) => Some("This is a run"),
                Err(_) => None,
            };
            self.chosen = found.ok();
            self.looked_at = Some((text, why));
        }
        match &self.looked_at {
            Some((_, Some(why))) => Err(why),
            _ => Ok(self.chosen.as_ref()),
        }
    }

    /// Takes a path that was chosen for a part.
    pub fn take(&mut self, purpose: PickFor, path: PathBuf) {
        if purpose == PickFor::ImportFolder {
            self.folder = path.display().to_string();
            return;
        }
        let Some(parts) = &mut self.chosen else { return };
        match purpose {
            PickFor::ImportPhotos => parts.choose_photos(path),
            PickFor::ImportMesh => parts.mesh = Some(path),
            PickFor::ImportCameras => parts.cameras = Some(path),
            PickFor::ImportMasks => parts.masks = Some(path),
            _ => {}
        }
    }
}

impl Model {
    /// Opens the dialog, on a folder if one is named.
    pub fn ask_to_import(&mut self, folder: Option<&Path>) {
        let folder = folder.map_or_else(String::new, |folder| folder.display().to_string());
        self.dialog = Dialog::Import(Box::new(ImportRequest { folder, ..ImportRequest::default() }));
    }

    /// Writes the manifest and opens the scene; whether it did.
    pub fn import(&mut self, request: &ImportRequest) -> bool {
        let Some(parts) = &request.chosen else { return false };
        match parts.write_manifest() {
            Ok(file) => {
                self.log.note(format!("Written: {}", file.display()));
                self.open(parts.folder.clone());
                true
            }
            Err(error) => {
                self.log.error(&error);
                false
            }
        }
    }
}
