//! From a path to something to look at or to go on with: a scene, a new fit, a fit to take up, a run to view.
//!
//! [`kind_of`] says what lies at a path. Then [`open_scene`] and [`start_new`] begin a fit, [`resume`] takes one up, and
//! [`view_run`] shows one, finished or not. Each tells how far it is and honours a stop flag between its stages. What it
//! refuses to do: to begin on a scene that cannot work, and to show a run without its own maps; a scene that moved away
//! is only a finding there.

use super::prepare::{Prepared, RunSettings, prepare_with, timed};
pub use super::view::{OpenedRun, view_run};
use crate::error::{Error, ErrorKind, Place, Result, Severity};
use crate::export::RunFolder;
use crate::fit::{FitSettings, Fitter, Method, Suited, checkpoint};
use crate::insight::report::data::StageTime;
use crate::light::Environment;
use crate::render::Surface;
use crate::scene::demo::DemoSettings;
use crate::scene::{ReadSettings, Scene, doctor};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// What is being done on the way.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum OpenStage {
    /// Reading the scene.
    Read,
    /// The pre-flight check.
    Check,
    /// Rendering the photographs of the demo.
    Photograph,
    /// Making the atlas.
    Atlas,
    /// Building the structure that rays walk.
    Tracer,
    /// Reading maps and light, or a checkpoint.
    Maps,
    /// Choosing where the fit begins.
    Start,
}

impl OpenStage {
    /// In a few words, for a progress bar.
    pub fn label(self) -> &'static str {
        match self {
            OpenStage::Read => "reading the scene",
            OpenStage::Check => "checking the scene",
            OpenStage::Photograph => "photographing the demo scene",
            OpenStage::Atlas => "making the atlas",
            OpenStage::Tracer => "preparing the tracer",
            OpenStage::Maps => "reading the run",
            OpenStage::Start => "choosing a start",
        }
    }
}

/// Hears of each stage, and of the share of it that is done, in [0, 1]; may be called from any thread.
pub type Tell<'a> = &'a (dyn Fn(OpenStage, f32) + Sync);

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
    let in_run = path.is_file() && path.parent().is_some_and(is_run);
    if !in_run {
        let missing = match crate::scene::read::locate(path) {
            Ok(_) => return Ok(PathKind::Scene),
            Err(error) => error,
        };
        let in_scene = path.is_file() && path.parent().is_some_and(|folder| crate::scene::read::locate(folder).is_ok());
        if !in_scene {
            return Err(missing);
        }
    }
    let folder = path.parent().unwrap_or(path);
    Err(Error::new(ErrorKind::Unsupported, "this is a single file of a run or a scene")
        .at(Place::File(path.into()))
        .remedy(format!("open its folder: {}", folder.display())))
}

/// A scene that was read and checked.
pub struct OpenedScene {
    /// The scene.
    pub scene: Scene,
    /// What the check found, with a line of figures for each view; empty for a scene made in code.
    pub report: doctor::Report,
    /// Time of each stage so far.
    pub timings: Vec<StageTime>,
}

impl OpenedScene {
    /// Sets what suits the scene and is not among the `chosen` settings, by their names; returns what to say of that, a
    /// sentence each.
    pub fn resolve(&self, settings: &mut FitSettings, chosen: &[String]) -> Vec<String> {
        let suited = Suited::to(&self.scene, &self.report);
        let resolved = suited.resolve(settings, chosen);
        let told = suited.told(settings, &resolved);
        *settings = resolved;
        told
    }

    /// Refuses a scene with a fatal finding: nothing starts a long fit on a scene that cannot work.
    ///
    /// # Errors
    /// `InvalidScene` with the first fatal finding.
    pub fn refuse_fatal(&self) -> Result<()> {
        let Some(fatal) = self.report.findings.iter().find(|finding| finding.severity == Severity::Fatal) else {
            return Ok(());
        };
        let place = if fatal.place.is_empty() { String::new() } else { format!("{}: ", fatal.place) };
        Err(Error::new(ErrorKind::InvalidScene, format!("the scene cannot work: {place}{}", fatal.message))
            .remedy(fatal.remedy.clone()))
    }
}

/// Reads and checks a scene. A fatal finding is no error here, so that one can look at what is wrong:
/// [`OpenedScene::refuse_fatal`].
///
/// # Errors
/// Whatever keeps the scene from being read, with place and remedy; `Stopped` when the flag is raised.
pub fn open_scene(path: &Path, settings: &ReadSettings, stop: &AtomicBool, tell: Tell) -> Result<OpenedScene> {
    let mut opened = read_unchecked(path, settings, stop, tell)?;
    opened.report = check(&opened.scene, &mut opened.timings, stop, tell)?;
    Ok(opened)
}

/// Reads a scene without checking it, for whoever shows it at once: its report is empty until [`check`] has made one.
///
/// # Errors
/// As of [`open_scene`].
pub fn read_unchecked(path: &Path, settings: &ReadSettings, stop: &AtomicBool, tell: Tell) -> Result<OpenedScene> {
    let mut timings = Vec::new();
    let scene =
        told(OpenStage::Read, stop, tell, || timed(&mut timings, "read", || crate::scene::read(path, settings)))?;
    Ok(OpenedScene { scene, report: doctor::Report::default(), timings })
}

/// The check of a scene that was read.
///
/// # Errors
/// `Stopped` when the flag is raised.
pub fn check(scene: &Scene, timings: &mut Vec<StageTime>, stop: &AtomicBool, tell: Tell) -> Result<doctor::Report> {
    told(OpenStage::Check, stop, tell, || timed(timings, "check", || doctor::check_until(scene, stop)))
}

/// Builds and photographs the demo scene.
///
/// # Errors
/// `Stopped` when the flag is raised.
pub fn open_demo(settings: &DemoSettings, stop: &AtomicBool, tell: Tell) -> Result<OpenedScene> {
    let mut timings = Vec::new();
    let progress = |share: f32| tell(OpenStage::Photograph, share);
    let scene = super::demo::scene(settings, &mut timings, stop, &progress)?;
    Ok(OpenedScene { scene, report: doctor::Report::default(), timings })
}

/// The scene that settings of a run name: a path, or the demo where that is empty.
///
/// # Errors
/// As of [`open_scene`] and [`open_demo`].
pub fn open_scene_of(settings: &RunSettings, stop: &AtomicBool, tell: Tell) -> Result<OpenedScene> {
    if settings.scene.as_os_str().is_empty() {
        open_demo(&DemoSettings { seed: settings.fit.seed, ..DemoSettings::default() }, stop, tell)
    } else {
        open_scene(&settings.scene, &settings.read, stop, tell)
    }
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
    let prepared = prepare_with(Arc::new(scene), report.findings, &settings, timings, stop, tell)?;
    begin(prepared, settings, stop, tell)
}

/// Begins a fit on a scene that is prepared already: reads the known light, if any, and chooses the start values.
///
/// # Errors
/// A setting out of range, a known light that cannot be read; `Stopped` when the flag is raised.
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
    let fitter =
        told(OpenStage::Start, stop, tell, || Fitter::new(scene, surface, settings.fit.clone(), known_light.as_ref()))?;
    let settings = RunSettings { fit: fitter.settings().clone(), ..settings };
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
    let mut settings: RunSettings = folder.read_settings()?;
    if let Some(path) = moved_scene {
        settings.scene = std::path::absolute(path).unwrap_or_else(|_| path.into());
    }
    let state = told(OpenStage::Maps, stop, tell, || checkpoint::read(&folder.checkpoint_path()))?;
    let opened = open_scene_of(&settings, stop, tell)?;
    opened.refuse_fatal()?;
    let surface = told(OpenStage::Tracer, stop, tell, || surface_of(folder))?;
    let OpenedScene { scene, report, timings } = opened;
    let (scene, surface) = (Arc::new(scene), Arc::new(surface));
    let fitter = told(OpenStage::Start, stop, tell, || {
        Fitter::resume(Arc::clone(&scene), Arc::clone(&surface), settings.fit.clone(), state)
    })?;
    let prepared = Prepared { scene, surface, quality: None, findings: report.findings, timings };
    settings.fit = fitter.settings().clone();
    Ok((prepared, fitter, settings))
}

/// The surface with the atlas of a run.
pub(super) fn surface_of(folder: &RunFolder) -> Result<Surface> {
    Surface::new(crate::export::obj::read(&folder.file("mesh.obj"))?)
}

/// Does a stage: told before and after, not begun when the flag is raised.
pub(super) fn told<T>(stage: OpenStage, stop: &AtomicBool, tell: Tell, work: impl FnOnce() -> Result<T>) -> Result<T> {
    if stop.load(Ordering::Relaxed) {
        return Err(Error::new(ErrorKind::Stopped, format!("stopped before {}", stage.label())));
    }
    tell(stage, 0.0);
    let outcome = work()?;
    tell(stage, 1.0);
    Ok(outcome)
}
