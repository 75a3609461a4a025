//! "This is 18 % grey": the scale that photos leave open between reflectance and light, set by a patch that is known.

use super::tasks::TaskKind;
use super::{Done, Model};
use crate::error::Finding;
use crate::export::run_folder::new_run_folder;
use crate::insight::plausible::{Plausibility, plausibility};
use crate::job::gauge::{Move, move_run};
use glam::{Vec2, Vec3};
use std::path::PathBuf;

/// Radius in texels of the patch around a pinned texel.
const PATCH_RADIUS: usize = 2;

/// A run that was written anew at another scale.
pub struct Rescaled {
    folder: PathBuf,
    factor: Vec3,
    findings: Vec<Finding>,
}

impl Model {
    /// Writes the finished run anew so that the diffuse reflectance around a place of the atlas (v up) is this grey in
    /// (0, 1], and opens what was written. The run itself stays as it is.
    pub fn rescale(&mut self, uv: Vec2, reflectance: f32) {
        self.rescale_by(Move::Patch { uv, radius_texels: PATCH_RADIUS, target: Vec3::splat(reflectance) });
    }

    /// The same with reflectance times a factor, and the light divided by it.
    pub fn rescale_by_factor(&mut self, factor: f32) {
        self.rescale_by(Move::Factor(Vec3::splat(factor)));
    }

    fn rescale_by(&mut self, by: Move) {
        let Some(folder) = self.fit.folder.clone().filter(|_| self.can_rescale()) else { return };
        let name = folder.path().file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let output = new_run_folder(&self.runs_folder(), &format!("{name}-rescaled"));
        self.tasks.spawn(TaskKind::Rescaling, move |_| {
            let moved = move_run(folder.path(), &by, &output)?;
            Ok(Done::Rescaled(Box::new(Rescaled { folder: output, factor: moved.factor, findings: moved.findings })))
        });
    }

    /// How the maps look beside materials that exist; `None` without maps.
    pub fn plausibility(&self) -> Option<Plausibility> {
        let project = self.project.as_ref()?;
        plausibility(project.maps.as_ref()?, project.times_seen.as_deref(), self.edits.fit.has_lobe())
    }

    /// Whether there is a finished run whose scale can be set.
    pub fn can_rescale(&self) -> bool {
        let is_free = !self.fit.status.is_live() && !self.tasks.is_running(&TaskKind::Rescaling);
        is_free && self.fit.folder.as_ref().is_some_and(|folder| folder.has_result())
    }

    pub(super) fn run_was_rescaled(&mut self, rescaled: Rescaled) {
        let Rescaled { folder, factor, findings } = rescaled;
        self.note_findings(&findings);
        let [red, green, blue] = factor.to_array();
        self.log.note(format!(
            "Reflectance times {red:.3} {green:.3} {blue:.3}, the environment over it: written to {}",
            folder.display()
        ));
        self.open(folder);
    }
}
