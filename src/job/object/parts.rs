//! A result in memory: it can be written to any folder, and shown under any light.

use super::look::Painter;
use crate::error::Result;
use crate::image::RgbImage;
use crate::light::Environment;
use crate::measured::coordinates::HalfDifference;
use crate::object::inputs::ObjectInputs;
use crate::object::joint::Estimate;
use crate::object::nodes::NodeGrid;
use crate::object::result_read;
use crate::object::settings::ObjectSettings;
use crate::object::starts::StartedModel;
use crate::object::{ObjectView, result_folder};
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

/// Pixels of the object in a relit picture of the window, at most.
const RELIT_PIXELS: usize = 12_000;

/// Everything that an estimation was made of and came to.
pub struct ObjectParts {
    /// Photos and geometry.
    pub views: Vec<ObjectView>,
    /// The model.
    pub model: StartedModel,
    /// What was estimated.
    pub estimate: Estimate,
    /// The settings it was estimated with.
    pub settings: ObjectSettings,
    /// What it was estimated from.
    pub inputs: ObjectInputs,
    /// The folder it was read from; `None` of an estimation of this session.
    pub read_from: Option<PathBuf>,
    /// Made with the first relit picture.
    painter: OnceLock<Painter>,
}

impl ObjectParts {
    /// The parts of a result.
    pub fn new(
        views: Vec<ObjectView>,
        model: StartedModel,
        estimate: Estimate,
        settings: ObjectSettings,
        inputs: ObjectInputs,
    ) -> Self {
        ObjectParts { views, model, estimate, settings, inputs, read_from: None, painter: OnceLock::new() }
    }

    /// Writes the result folder; that of a result that was read is a copy of the files it was read from.
    ///
    /// # Errors
    /// Those of [`result_folder::prepare`] and [`result_folder::write`].
    pub fn write(&self, folder: &Path, relights: &[(String, Arc<Environment>)]) -> Result<()> {
        result_folder::prepare(folder)?;
        if let Some(own) = &self.read_from {
            return result_read::copy(own, folder);
        }
        let relights: Vec<(String, Environment)> =
            relights.iter().map(|(name, light)| (name.clone(), (**light).clone())).collect();
        result_folder::write(folder, &self.views, &self.model, &self.estimate, &self.settings, &self.inputs, &relights)
    }

    /// The first photo's object under other lights, not at full size; none where its photos are gone.
    pub fn relit(&self, lights: &[&Environment]) -> Vec<RgbImage> {
        let Some(view) = self.views.first() else { return Vec::new() };
        let painter = self.painter.get_or_init(|| {
            Painter::new(view, NodeGrid::new(self.settings.nodes), self.settings.shadows, RELIT_PIXELS)
        });
        painter.relit(&self.estimate.table, lights)
    }

    /// The estimated reflectance between its nodes, in 1/sr.
    pub fn reflectance(&self) -> impl Fn(HalfDifference) -> [f64; 3] + Sync + '_ {
        let grid = NodeGrid::new(self.settings.nodes);
        move |at| grid.value(&self.estimate.table, at)
    }
}
