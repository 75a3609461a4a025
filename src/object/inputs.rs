//! What an estimation is made from, as a result remembers it.

use super::joint::Known;
use super::read::ObjectFiles;
use super::starts::ModelKind;
use crate::error::{Finding, Result};
use crate::light::Environment;
use std::path::PathBuf;

/// What a result was estimated from.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, rename_all = "kebab-case")]
pub struct ObjectInputs {
    /// Photos, masks, shape and cameras.
    pub files: ObjectFiles,
    /// The light of all photos, where it was known.
    pub light: Option<PathBuf>,
    /// Known lights of the first photos, where each has its own.
    pub probes: Vec<PathBuf>,
    /// Model of the reflectance.
    pub model: ModelKind,
    /// Lobes of the neural model.
    pub lobes: usize,
    /// Weights of the neural model; `None` for those that come with the program.
    pub weights: Option<PathBuf>,
}

impl ObjectInputs {
    /// The same with paths that hold from any working folder.
    pub fn absolute(&self) -> Self {
        let whole = |path: &PathBuf| std::path::absolute(path).unwrap_or_else(|_| path.clone());
        let all = |paths: &[PathBuf]| paths.iter().map(whole).collect();
        let files = ObjectFiles {
            photos: all(&self.files.photos),
            masks: all(&self.files.masks),
            mesh: self.files.mesh.as_ref().map(whole),
            normals: all(&self.files.normals),
            cameras: all(&self.files.cameras),
            ..self.files.clone()
        };
        let (light, weights) = (self.light.as_ref().map(whole), self.weights.as_ref().map(whole));
        ObjectInputs { files, light, probes: all(&self.probes), weights, ..self.clone() }
    }

    /// Reads the lights that are known; also what was noticed.
    ///
    /// # Errors
    /// As of [`Environment::read`].
    pub fn known(&self) -> Result<(Known, Vec<Finding>)> {
        let mut findings = Vec::new();
        let mut read = |path: &PathBuf| -> Result<Environment> {
            let (light, noticed) = Environment::read(path)?;
            findings.extend(noticed);
            Ok(light)
        };
        let light = self.light.as_ref().map(&mut read).transpose()?;
        let probes = self.probes.iter().map(&mut read).collect::<Result<_>>()?;
        Ok((Known { light, probes, ..Known::default() }, findings))
    }
}
