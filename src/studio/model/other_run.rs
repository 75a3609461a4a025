//! Another run of the same scene, held against the one that is open.

use super::tasks::TaskKind;
use super::{Done, Model};
use crate::error::{Error, ErrorKind, Place, Result};
use crate::export::RunFolder;
use crate::insight::report::ReportData;
use crate::job::pictures::surface_of;
use crate::job::prepare::RunSettings;
use crate::render::{Parameters, Surface};
use crate::scene::Scene;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A run that is only looked at.
pub struct OtherRun {
    /// Name of its folder.
    pub name: String,
    /// Its surface.
    pub surface: Arc<Surface>,
    /// Its maps and light.
    pub parameters: Arc<Parameters<f32>>,
    /// Factor of each photo of the scene that is open, as that run found it; 1 for photos that it does not know.
    pub gains: Vec<f32>,
}

impl OtherRun {
    fn read(path: &Path, own_scene: &Path, scene: &Scene) -> Result<Self> {
        let folder = RunFolder::open(path)?;
        let settings: RunSettings = folder.read_settings()?;
        if !own_scene.as_os_str().is_empty() && settings.scene != own_scene {
            let message = format!("this run is of another scene: {}", settings.scene.display());
            return Err(Error::new(ErrorKind::InvalidSetting, message)
                .at(Place::File(path.into()))
                .remedy("choose a run of the scene that is open"));
        }
        let (surface, parameters) = surface_of(&folder.read_result()?)?;
        let report = folder.read_report_json::<ReportData>().ok();
        let gain = |name: &str| {
            let line = report.as_ref().and_then(|report| report.views.iter().find(|line| line.name == name));
            let gain = line.map_or(1.0, |line| line.exposure_gain as f32);
            if gain.is_finite() && gain > 0.0 { gain } else { 1.0 }
        };
        Ok(OtherRun {
            name: path.file_name().map_or_else(|| "Other run".into(), |name| name.to_string_lossy().into_owned()),
            surface: Arc::new(surface),
            parameters: Arc::new(parameters),
            gains: scene.views.iter().map(|view| gain(&view.name)).collect(),
        })
    }
}

impl Model {
    /// Reads a run of the scene that is open, to hold it against the one that is open.
    pub fn compare_with(&mut self, path: PathBuf) {
        let Some(project) = &self.project else { return };
        let Some(scene) = project.scene.clone() else { return };
        let own_scene = project.settings.scene.clone();
        self.tasks.spawn(TaskKind::OpeningOther, move |_| {
            Ok(Done::OtherRun(Box::new(OtherRun::read(&path, &own_scene, &scene)?)))
        });
    }

    pub(super) fn other_was_read(&mut self, other: OtherRun) {
        self.log.note(format!("{} can be compared in the Photo panel", other.name));
        self.other_run = Some(Arc::new(other));
        self.activate = Some(crate::studio::workspace::Panel::Photo);
    }
}
