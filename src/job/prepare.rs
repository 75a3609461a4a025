//! From a scene folder to something a fit can start on.

use super::kept::{self, Kept};
use super::run_with_maps::{check_surface, read};
use super::stages::{OpenStage, Tell, told};
use crate::atlas::{AtlasQuality, AtlasSettings, covered_texels};
use crate::error::{Finding, Result};
use crate::export::RunFolder;
use crate::fit::FitSettings;
use crate::insight::report::data::StageTime;
use crate::render::Surface;
use crate::scene::{ReadSettings, Scene};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// Everything a run was started with: `settings.toml` of the run folder.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct RunSettings {
    /// The scene's folder or file; empty for a scene made in code.
    pub scene: PathBuf,
    /// A light that is known from the start; empty when none is.
    pub known_light: PathBuf,
    /// A run whose maps are kept; empty when none is.
    #[serde(skip_serializing_if = "is_empty")]
    pub known_maps: PathBuf,
    /// How the scene is read.
    pub read: ReadSettings,
    /// How the atlas is made.
    pub atlas: AtlasSettings,
    /// How the maps are fitted.
    pub fit: FitSettings,
}

/// Settings of runs that keep no maps can be read by versions that know of none.
fn is_empty(path: &Path) -> bool {
    path.as_os_str().is_empty()
}

/// A scene that is ready for a fit.
pub struct Prepared {
    /// The scene; its mesh is as it was read.
    pub scene: Arc<Scene>,
    /// The surface, with the atlas.
    pub surface: Arc<Surface>,
    /// How good the atlas is; `None` for a resumed run.
    pub quality: Option<AtlasQuality>,
    /// What was noticed.
    pub findings: Vec<Finding>,
    /// Time of each stage so far.
    pub timings: Vec<StageTime>,
}

/// Runs a piece of work and notes how long it took.
pub fn timed<T>(timings: &mut Vec<StageTime>, stage: &str, work: impl FnOnce() -> T) -> T {
    let began = Instant::now();
    let result = work();
    timings.push(StageTime { stage: stage.into(), seconds: began.elapsed().as_secs_f64() });
    result
}

/// Makes the atlas and the surface of a checked scene.
pub fn prepare(
    scene: Scene,
    findings: Vec<Finding>,
    settings: &RunSettings,
    timings: Vec<StageTime>,
    progress: &(dyn Fn(f32) + Sync),
) -> Result<Prepared> {
    let tell = |stage, share| {
        if stage == OpenStage::Atlas {
            progress(share);
        }
    };
    prepare_with(Arc::new(scene), findings, settings, timings, &Kept::nowhere(), &AtomicBool::new(false), &tell)
}

/// [`prepare`] that takes the atlas from disk where it was made before, tells of its stages and honours a stop flag between
/// them.
pub fn prepare_with(
    scene: Arc<Scene>,
    mut findings: Vec<Finding>,
    settings: &RunSettings,
    mut timings: Vec<StageTime>,
    kept: &Kept,
    stop: &AtomicBool,
    tell: Tell,
) -> Result<Prepared> {
    if !settings.known_maps.as_os_str().is_empty() {
        return with_atlas_of_run(scene, findings, settings, timings, stop, tell);
    }
    // Charts keep their distance at the size the maps are stored in.
    let atlas_settings = AtlasSettings { resolution_texels: settings.fit.map_size, ..settings.atlas.clone() };
    let progress = |share: f32| tell(OpenStage::Atlas, share);
    let atlas = told(OpenStage::Atlas, stop, tell, || {
        timed(&mut timings, "atlas", || kept::atlas(&scene.mesh, &atlas_settings, kept, &progress))
    })?;
    findings.extend(atlas.findings);
    let mesh = atlas.mesh;
    let surface = told(OpenStage::Tracer, stop, tell, || timed(&mut timings, "tracer", || Surface::new(mesh)))?;
    Ok(Prepared { scene, surface: Arc::new(surface), quality: Some(atlas.quality), findings, timings })
}

/// Prepares a scene for a fit that keeps maps: with the run's own mesh and atlas.
///
/// # Errors
/// What is missing or damaged in the run's folder; `InvalidScene` when the run is of another surface, `InvalidSetting` when
/// the scene's own texture coordinates are asked for and differ.
fn with_atlas_of_run(
    scene: Arc<Scene>,
    findings: Vec<Finding>,
    settings: &RunSettings,
    mut timings: Vec<StageTime>,
    stop: &AtomicBool,
    tell: Tell,
) -> Result<Prepared> {
    let run = &settings.known_maps;
    let mesh = told(OpenStage::Maps, stop, tell, || {
        let mesh = read(run)?.mesh;
        check_surface(&scene.mesh, &mesh, &settings.atlas, run)?;
        Ok(mesh)
    })?;
    let surface = told(OpenStage::Tracer, stop, tell, || timed(&mut timings, "tracer", || Surface::new(mesh)))?;
    Ok(Prepared { scene, surface: Arc::new(surface), quality: None, findings, timings })
}

/// The surface with the atlas of a run.
pub(super) fn surface_of(folder: &RunFolder) -> Result<Surface> {
    Surface::new(crate::export::obj::read(&folder.file("mesh.obj"))?)
}

/// Texels of a chart, at a size.
pub fn covered(surface: &Surface, map_size: usize) -> crate::image::Image<bool> {
    covered_texels(surface.mesh(), map_size, map_size)
}
