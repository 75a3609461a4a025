//! What an estimation of object mode is asked for.

use crate::error::{Error, ErrorKind, Place, Result};
use crate::object::prior::LightPriorKind;
use crate::object::read::ObjectFiles;
use crate::object::settings::ObjectSettings;
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
        (Effort::Quick, "Quick", "A light of 32 rows, 1024 pixels, 6 rounds: a first look"),
        (Effort::Usual, "Usual", "A light of 64 rows, 2048 pixels, 8 rounds"),
        (Effort::Released, "As released", "The schedule released with the paper; takes long"),
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
    /// Photos of one object under one light.
    pub photos: Vec<PathBuf>,
    /// One mask a photo, or none.
    pub masks: Vec<PathBuf>,
    /// Whether the object is a sphere that fills the photo.
    pub is_sphere: bool,
    /// The mesh otherwise; may be empty.
    pub mesh: String,
    /// Its cameras.
    pub cameras: Vec<PathBuf>,
    /// The light, where it is known; empty where it is estimated.
    pub light: String,
    /// Model of the reflectance.
    pub model: ModelKind,
    /// Lobes of the neural model.
    pub lobes: usize,
    /// Prior of the light.
    pub prior: LightPriorKind,
    /// How much is done.
    pub effort: Effort,
    /// Rows of the estimated light, where it is another number than the effort's: 16, 32, 64 or 128.
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
        if !self.is_sphere && mesh.is_empty() {
            return missing("mesh", "no mesh is named", "name an OBJ or PLY file, or take the object for a sphere");
        }
        Ok(ObjectFiles {
            photos: self.photos.clone(),
            masks: self.masks.clone(),
            mesh: (!self.is_sphere).then(|| mesh.into()),
            cameras: if self.is_sphere { Vec::new() } else { self.cameras.clone() },
            ..ObjectFiles::default()
        })
    }
}

/// Whether a file may be a photo, by its ending.
pub fn is_photo(path: &Path) -> bool {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default();
    ["png", "jpg", "jpeg", "exr", "pfm"].contains(&ending.as_str())
}
