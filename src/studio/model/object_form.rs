//! What an estimation of object mode is asked for.

use crate::error::{Error, ErrorKind, Place, Result};
use crate::object::prior::LightPriorKind;
use crate::object::read::ObjectFiles;
use crate::object::settings::{LightsOf, ObjectSettings};
use crate::object::starts::ModelKind;
use std::path::{Path, PathBuf};

/// How much is done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Effort {
    /// A coarse light, few pixels and few rounds.
    Quick,
    /// What the program takes by itself.
    #[default]
    Usual,
    /// The schedule released with the paper.
    Released,
}

impl Effort {
    /// All of them with their names and what they mean.
    pub const NAMED: [(Effort, &str, &str); 3] = [
        (Effort::Quick, "Draft", "Environment of 64 x 32, 1024 pixels, 6 rounds: a first look"),
        (Effort::Usual, "Standard", "Environment of 128 x 64, 2048 pixels, 8 rounds"),
        (Effort::Released, "Published", "The schedule released with the paper; takes long"),
    ];

    /// Its settings.
    pub fn settings(self) -> ObjectSettings {
        match self {
            Effort::Quick => ObjectSettings::quick(),
            Effort::Usual => ObjectSettings::default(),
            Effort::Released => ObjectSettings::released(),
        }
    }
}

/// What an estimation is asked for; undo covers it.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjectForm {
    /// Photos of one object.
    pub photos: Vec<PathBuf>,
    /// One mask a photo, or none.
    pub masks: Vec<PathBuf>,
    /// Whether the object is a sphere that fills the photo.
    pub is_sphere: bool,
    /// The mesh otherwise; may be empty.
    pub mesh: String,
    /// Its cameras.
    pub cameras: Vec<PathBuf>,
    /// One picture of normals a photo in place of a mesh, as in a result that was opened; none otherwise.
    pub normals: Vec<PathBuf>,
    /// Whether all photos are under one light, or each under one of its own.
    pub lights: LightsOf,
    /// The light, where it is known, or that of the first photo where each has its own; empty where it is estimated.
    pub light: String,
    /// Model of the reflectance.
    pub model: ModelKind,
    /// Lobes of the neural model.
    pub lobes: usize,
    /// Prior of the light.
    pub prior: LightPriorKind,
    /// How much is done.
    pub effort: Effort,
    /// Rows of the estimated light, where it is another number than the effort's: 16, 32, 64, 128 or 180.
    pub light_rows: Option<usize>,
    /// Pixels that are used, likewise.
    pub pixels: Option<usize>,
    /// Whether the object shadows itself.
    pub shadows: bool,
    /// Seed of pixels and net.
    pub seed: u64,
}

impl Default for ObjectForm {
    fn default() -> Self {
        ObjectForm {
            photos: Vec::new(),
            masks: Vec::new(),
            is_sphere: true,
            mesh: String::new(),
            cameras: Vec::new(),
            normals: Vec::new(),
            lights: LightsOf::One,
            light: String::new(),
            model: ModelKind::default(),
            lobes: 2,
            prior: LightPriorKind::default(),
            effort: Effort::default(),
            light_rows: None,
            pixels: None,
            shadows: true,
            seed: 1,
        }
    }
}

impl ObjectForm {
    /// The settings that are asked for.
    pub fn settings(&self) -> ObjectSettings {
        let own = self.effort.settings();
        ObjectSettings {
            prior: self.prior,
            shadows: self.shadows,
            seed: self.seed,
            // One photo has one light either way.
            lights: if self.photos.len() > 1 { self.lights } else { LightsOf::One },
            light_height: self.light_rows.unwrap_or(own.light_height),
            pixels: self.pixels.unwrap_or(own.pixels),
            ..own
        }
    }

    /// The files that are asked for.
    ///
    /// # Errors
    /// `Missing` without a photo, or without a mesh where the object is one.
    pub fn files(&self) -> Result<ObjectFiles> {
        let missing = |setting: &str, message: &str, remedy: &str| {
            Err(Error::new(ErrorKind::Missing, message).at(Place::Setting(setting.into())).remedy(remedy))
        };
        if self.photos.is_empty() {
            return missing("photos", "no photo is named", "add a photo, or drop one on the window");
        }
        let mesh = self.mesh.trim();
        let has_mesh = !self.is_sphere && self.normals.is_empty();
        if has_mesh && mesh.is_empty() {
            return missing("mesh", "no mesh is named", "name an OBJ or PLY file, or take the object for a sphere");
        }
        Ok(ObjectFiles {
            photos: self.photos.clone(),
            masks: self.masks.clone(),
            mesh: has_mesh.then(|| mesh.into()),
            normals: self.normals.clone(),
            cameras: if has_mesh { self.cameras.clone() } else { Vec::new() },
            ..ObjectFiles::default()
        })
    }

    /// Takes up the settings of a result. False when the form cannot ask for all of them: then it asks for the rest as
    /// the program takes it by itself.
    pub fn take_settings(&mut self, settings: &ObjectSettings) -> bool {
        let (prior, shadows, seed, lights) = (settings.prior, settings.shadows, settings.seed, settings.lights);
        (self.prior, self.shadows, self.seed, self.lights) = (prior, shadows, seed, lights);
        let asks_for = |effort: &Effort| {
            let (light_height, pixels) = (settings.light_height, settings.pixels);
            *settings == ObjectSettings { prior, shadows, seed, lights, light_height, pixels, ..effort.settings() }
        };
        let found = Effort::NAMED.map(|(effort, ..)| effort).into_iter().find(asks_for);
        self.effort = found.unwrap_or_default();
        let usual = self.effort.settings();
        self.light_rows = Some(settings.light_height).filter(|rows| *rows != usual.light_height);
        self.pixels = Some(settings.pixels).filter(|pixels| *pixels != usual.pixels);
        found.is_some()
    }
}

/// Whether a file may be a photo, by its ending.
pub fn is_photo(path: &Path) -> bool {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default();
    ["png", "jpg", "jpeg", "exr", "pfm"].contains(&ending.as_str())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_settings_of_a_result_are_asked_for_again_as_far_as_the_form_can() {
        let asked = ObjectForm {
            effort: Effort::Quick,
            light_rows: Some(16),
            pixels: Some(300),
            prior: LightPriorKind::Gradient,
            shadows: false,
            lights: LightsOf::Each,
            photos: vec!["a.exr".into(), "b.exr".into()],
            seed: 7,
            ..ObjectForm::default()
        };
        let mut again = ObjectForm {
            effort: Effort::Released,
            pixels: Some(5),
            photos: asked.photos.clone(),
            ..ObjectForm::default()
        };
        assert!(again.take_settings(&asked.settings()));
        assert_eq!(again, asked);
        let other = ObjectSettings { outer_loops: 3, ..ObjectSettings::default() };
        assert!(!again.take_settings(&other), "the form has no field for rounds");
        assert_eq!((again.effort, again.light_rows, again.pixels), (Effort::Usual, None, None));
    }

    #[test]
    fn pictures_of_normals_are_the_shape_until_another_is_named() {
        let normals: Vec<PathBuf> = vec!["normals.exr".into()];
        let form = ObjectForm {
            photos: vec!["photo.exr".into()],
            normals: normals.clone(),
            is_sphere: false,
            ..ObjectForm::default()
        };
        let files = form.files().unwrap();
        assert_eq!((files.mesh, files.normals), (None, normals));
        let form = ObjectForm { normals: Vec::new(), mesh: "ball.obj".into(), ..form };
        assert_eq!(form.files().unwrap().mesh, Some("ball.obj".into()));
    }
}
