//! From a path to something to look at or to go on with: a scene, a new fit, a fit to take up, a run to view.
//!
//! [`kind_of`] says what lies at a path. Then [`open_scene`] and [`start_new`] begin a fit, [`resume`] takes one up, and
//! [`view_run`] shows one, finished or not. Each tells how far it is and honours a stop flag between its stages. What it
//! refuses to do: to begin on a scene that cannot work, and to show a run without its own maps; a scene that moved away
//! is only a finding there.

use super::kept::Kept;
use super::known_maps;
pub use super::opened_scene::{
    OpenedScene, check, open_demo, open_demo_with, open_scene, open_scene_of, read_scene, read_unchecked,
};
use super::prepare::{Prepared, RunSettings, prepare_with, surface_of};
use super::stages::told;
pub use super::stages::{OpenStage, Tell};
pub use super::view::{OpenedRun, view_run, view_run_with};
use crate::error::{Error, ErrorKind, Place, Result};
use crate::export::RunFolder;
use crate::files::folder_of;
use crate::fit::{Fitter, KnownMaps, Method, checkpoint};
use crate::light::Environment;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// What lies at a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PathKind {
    /// A run folder: [`view_run`] or [`resume`].
    Run,
    /// A scene: [`open_scene`].
    Scene,
}

/// Whether a path is a run or a scene, by the names of files.
///
/// # Errors
/// `Missing` or `Unsupported` when it is neither; the remedy says what a scene folder must hold, or which folder to open
/// for a file that lies in one.
pub fn kind_of(path: &Path) -> Result<PathKind> {
    let is_run = |path: &Path| path.is_dir() && RunFolder::open(path).is_ok_and(|folder| folder.is_run());
    if is_run(path) {
        return Ok(PathKind::Run);
    }
    // Of a run folder, settings.toml is no manifest.
    let in_run = path.is_file() && is_run(folder_of(path));
    if !in_run {
        let missing = match crate::scene::read::locate(path) {
            Ok(_) => return Ok(PathKind::Scene),
            Err(error) => error,
        };
        let in_scene = path.is_file() && crate::scene::read::locate(folder_of(path)).is_ok();
        if !in_scene {
            return Err(missing);
        }
    }
    let folder = folder_of(path);
    Err(Error::new(ErrorKind::Unsupported, "this is a single file of a run or a scene")
        .at(Place::File(path.into()))
        .remedy(format!("open its folder: {}", folder.display())))
}

/// Prepares a new fit of a scene: atlas, tracer, start values. [`super::start`] then runs it. The settings that come back
/// are those that are run: what was left to the scene is resolved, by [`OpenedScene::resolve`] if nobody did so before.
///
/// # Errors
/// A fatal finding, a setting out of range, a known light that cannot be read; `Stopped` when the flag is raised.
pub fn start_new(
    opened: OpenedScene,
    mut settings: RunSettings,
    stop: &AtomicBool,
    tell: Tell,
) -> Result<(Prepared, Fitter, RunSettings)> {
    opened.refuse_fatal()?;
    if settings.fit.method == Method::Automatic {
        let chosen = settings.fit.chosen();
        opened.resolve(&mut settings.fit, &chosen);
    }
    settings.fit.validate()?;
    let OpenedScene { scene, report, timings } = opened;
    let prepared = prepare_with(Arc::new(scene), report.findings, &settings, timings, &Kept::nowhere(), stop, tell)?;
    begin(prepared, settings, stop, tell)
}

/// Begins a fit on a scene that is prepared already: reads the known light, if any, and chooses the start values.
///
/// # Errors
/// A setting out of range, a known light or maps that cannot be read or are not of this surface; `Stopped` when the flag is
/// raised.
pub fn begin(
    mut prepared: Prepared,
    settings: RunSettings,
    stop: &AtomicBool,
    tell: Tell,
) -> Result<(Prepared, Fitter, RunSettings)> {
    settings.fit.validate()?;
    let mut known_light = None;
    if !settings.known_light.as_os_str().is_empty() {
        let (light, findings) = Environment::read(&settings.known_light)?;
        // A light whose sun is clipped gives other maps: who gave it hears of it.
        prepared.findings.extend(findings);
        known_light = Some(light);
    }
    let (scene, surface) = (Arc::clone(&prepared.scene), Arc::clone(&prepared.surface));
    // What a manifest gives goes with the run, whose exports are scaled by it.
    let unit_in_metres = settings.read.unit_in_metres.or(scene.world_from_source.unit_in_metres);
    let known_maps = known_maps::of_settings(&settings, &surface)?;
    let fitter = told(OpenStage::Start, stop, tell, || {
        let mut fitter = Fitter::new(scene, surface, settings.fit.clone(), known_light.as_ref())?;
        known_maps.map_or(Ok(()), |known| fitter.take_maps(known))?;
        Ok(fitter)
    })?;
    let mut settings = RunSettings { fit: fitter.settings().clone(), ..settings };
    settings.read.unit_in_metres = unit_in_metres;
    prepared.findings.retain(|finding| !settings.fit.do_what_is_asked(finding));
    Ok((prepared, fitter, settings))
}

/// Takes up a run from its checkpoint. `moved_scene` is where the scene is now, when it moved; the settings that come
/// back name it.
///
/// # Errors
/// What is missing or damaged in the run folder or the scene; a checkpoint of another scene; `Stopped` when the flag is
/// raised.
pub fn resume(
    folder: &RunFolder,
    moved_scene: Option<&Path>,
    stop: &AtomicBool,
    tell: Tell,
) -> Result<(Prepared, Fitter, RunSettings)> {
    resume_with(folder, moved_scene, &Kept::nowhere(), stop, tell)
}

/// [`resume`] with what was kept of the scene's opening.
///
/// # Errors
/// As of [`resume`].
pub fn resume_with(
    folder: &RunFolder,
    moved_scene: Option<&Path>,
    kept: &Kept,
    stop: &AtomicBool,
    tell: Tell,
) -> Result<(Prepared, Fitter, RunSettings)> {
    let mut settings: RunSettings = folder.read_settings()?;
    if let Some(path) = moved_scene {
        settings.scene = std::path::absolute(path).unwrap_or_else(|_| path.into());
    }
    let state = told(OpenStage::Maps, stop, tell, || checkpoint::read(&folder.checkpoint_path()))?;
    let opened = open_scene_of(&settings, kept, stop, tell)?;
    opened.refuse_fatal()?;
    let surface = told(OpenStage::Tracer, stop, tell, || surface_of(folder))?;
    let OpenedScene { scene, report, timings } = opened;
    let (scene, surface) = (Arc::new(scene), Arc::new(surface));
    let fitter = told(OpenStage::Start, stop, tell, || {
        let mut fitter = Fitter::resume(Arc::clone(&scene), Arc::clone(&surface), settings.fit.clone(), state)?;
        if settings.fit.fixed_maps {
            // Put there when the fit began: the run that they are of may have changed since.
            let (maps, times_seen) = folder.read_maps()?;
            fitter.take_maps(Arc::new(KnownMaps { maps, times_seen }))?;
        }
        Ok(fitter)
    })?;
    let prepared = Prepared { scene, surface, quality: None, findings: report.findings, timings };
    settings.fit = fitter.settings().clone();
    Ok((prepared, fitter, settings))
}
