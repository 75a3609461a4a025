//! A scene that was read and checked, from a path or built in.

use super::kept::{self, Kept};
use super::prepare::{RunSettings, timed};
use super::stages::{OpenStage, Tell, told};
use crate::error::{Error, ErrorKind, Finding, Result, Severity};
use crate::fit::{FitSettings, Suited};
use crate::insight::report::data::StageTime;
use crate::scene::demo::DemoSettings;
use crate::scene::{ReadSettings, Scene, doctor};
use std::path::Path;
use std::sync::atomic::AtomicBool;

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
        let told = suited.told(settings, &resolved).iter().map(ToString::to_string).collect();
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
        Err(Error::new(ErrorKind::InvalidScene, format!("the scene cannot be fitted: {place}{}", fatal.message))
            .remedy(fatal.remedy.clone()))
    }
}

/// Reads and checks a scene. A fatal finding is no error here, so that one can look at what is wrong:
/// [`OpenedScene::refuse_fatal`].
///
/// # Errors
/// Whatever keeps the scene from being read, with place and remedy; `Stopped` when the flag is raised.
pub fn open_scene(path: &Path, settings: &ReadSettings, stop: &AtomicBool, tell: Tell) -> Result<OpenedScene> {
    open_scene_with(path, settings, &Kept::nowhere(), stop, tell)
}

/// [`open_scene`] whose check is taken from disk where it was made before.
fn open_scene_with(
    path: &Path,
    settings: &ReadSettings,
    kept: &Kept,
    stop: &AtomicBool,
    tell: Tell,
) -> Result<OpenedScene> {
    let mut opened = read_unchecked(path, settings, stop, tell)?;
    opened.report = check(&opened.scene, kept, &mut opened.timings, stop, tell)?;
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

/// The check of a scene that was read, from disk where it was checked before.
///
/// # Errors
/// `Stopped` when the flag is raised.
pub fn check(
    scene: &Scene,
    kept: &Kept,
    timings: &mut Vec<StageTime>,
    stop: &AtomicBool,
    tell: Tell,
) -> Result<doctor::Report> {
    told(OpenStage::Check, stop, tell, || timed(timings, "check", || kept::check(scene, kept, stop)))
}

/// Builds and photographs the demo scene.
///
/// # Errors
/// `Stopped` when the flag is raised.
pub fn open_demo(settings: &DemoSettings, stop: &AtomicBool, tell: Tell) -> Result<OpenedScene> {
    open_demo_with(settings, &Kept::nowhere(), stop, tell)
}

/// [`open_demo`] whose photographs are taken from disk where they were rendered before.
///
/// # Errors
/// `Stopped` when the flag is raised.
pub fn open_demo_with(settings: &DemoSettings, kept: &Kept, stop: &AtomicBool, tell: Tell) -> Result<OpenedScene> {
    let mut timings = Vec::new();
    let progress = |share: f32| tell(OpenStage::Photograph, share);
    let scene = super::demo::scene_with(settings, kept, &mut timings, stop, &progress)?;
    Ok(OpenedScene { scene, report: doctor::Report::default(), timings })
}

/// The scene that settings of a run name: a path, or the demo where that is empty.
///
/// # Errors
/// As of [`open_scene`] and [`open_demo`].
pub fn open_scene_of(settings: &RunSettings, kept: &Kept, stop: &AtomicBool, tell: Tell) -> Result<OpenedScene> {
    if settings.scene.as_os_str().is_empty() {
        let FitSettings { seed, lobe, .. } = settings.fit;
        return open_demo_with(&DemoSettings { seed, lobe, ..DemoSettings::default() }, kept, stop, tell);
    }
    open_scene_with(&settings.scene, &settings.read, kept, stop, tell)
}

/// Reads and checks a scene. A finding that is fatal is an error: nothing starts a long fit on a scene that cannot work.
pub fn read_scene(path: &Path, settings: &ReadSettings, timings: &mut Vec<StageTime>) -> Result<(Scene, Vec<Finding>)> {
    let opened = open_scene(path, settings, &AtomicBool::new(false), &|_, _| {})?;
    opened.refuse_fatal()?;
    timings.extend(opened.timings);
    Ok((opened.scene, opened.report.findings))
}
