//! Maps of an earlier run that a fit keeps: read, held against the scene, and put into the run folder of the fit.
//!
//! Maps belong to the atlas they lie on, so that a fit which keeps them keeps that atlas: it is the run's mesh with its
//! texture coordinates that is traced. The scene's own mesh has to be the same surface.

use super::prepare::{Prepared, RunSettings, timed};
use super::stages::{OpenStage, Tell, told};
use crate::atlas::clean::dissolve_degenerate;
use crate::atlas::{AtlasSettings, KeepUv};
use crate::error::{Error, ErrorKind, Finding, Place, Result};
use crate::export::{RunFolder, RunResult};
use crate::fit::KnownMaps;
use crate::fit::known_maps::none_given;
use crate::insight::report::data::StageTime;
use crate::render::Surface;
use crate::scene::{Mesh, Scene};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Settles what a run with maps to keep decides, before a scene is read for it: that maps are kept, their size and their lobe,
/// which then count as `chosen`. Does nothing where no run is named.
///
/// # Errors
/// As of [`read`]; `InvalidSetting` for another size or lobe that was chosen.
pub fn settle(settings: &mut RunSettings, chosen: &mut Vec<String>) -> Result<()> {
    if settings.known_maps.as_os_str().is_empty() {
        return Ok(());
    }
    let run = read(&settings.known_maps)?;
    let size = run.maps.diffuse.width();
    let is_chosen = |own: &str| chosen.iter().any(|name| name == own);
    if is_chosen("lobe") {
        same_lobe(settings, &run)?;
    }
    if is_chosen("map-size") && settings.fit.map_size != size {
        let message = format!("the maps that are kept are {size} x {size}, not {0} x {0}", settings.fit.map_size);
        return Err(Error::new(ErrorKind::InvalidSetting, message)
            .at(Place::Setting("map-size".into()))
            .remedy("leave out --map-size: the maps keep their size"));
    }
    settings.fit.map_size = size;
    settings.fit.lobe = run.lobe;
    settings.fit.fixed_maps = true;
    chosen.extend(["map-size".into(), "lobe".into()]);
    Ok(())
}

/// Fails where the maps of a run are of other lobes than those that are fitted.
fn same_lobe(settings: &RunSettings, run: &RunResult) -> Result<()> {
    if settings.fit.lobe == run.lobe {
        return Ok(());
    }
    let message = format!("the maps that are kept are of {} lobes", run.lobe.label());
    Err(Error::new(ErrorKind::InvalidSetting, message)
        .at(Place::Setting("lobe".into()))
        .remedy("leave out --lobe: the maps keep theirs"))
}

/// Reads the run whose maps are kept; its light may be missing.
///
/// # Errors
/// What is missing or damaged in the folder; `Unsupported` for maps that the solver cannot keep.
pub fn read(run: &Path) -> Result<RunResult> {
    let (result, _) = RunFolder::open(run)?.read_result_with_or_without_light()?;
    let unsupported = |message: String, remedy: &str| {
        Err(Error::new(ErrorKind::Unsupported, message).at(Place::File(run.into())).remedy(remedy))
    };
    let (width, height) = (result.maps.diffuse.width(), result.maps.diffuse.height());
    if width != height || !width.is_power_of_two() || width < 16 {
        let message = format!("its maps are {width} x {height}; kept are squares of a power of two from 16 on");
        return unsupported(message, "name a run that `patina fit` has made");
    }
    Ok(result)
}

/// Prepares a scene for a fit that keeps maps: with the run's own mesh and atlas.
///
/// # Errors
/// As of [`read`]; `InvalidScene` when the run is of another surface, `InvalidSetting` when the scene's own texture
/// coordinates are asked for and differ.
pub(super) fn prepare(
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

/// The maps that settings name, for a fit on this surface; `None` where they name none.
///
/// # Errors
/// As of [`read`]; `InvalidScene` when the surface has another atlas than the maps, `InvalidSetting` when they have another
/// lobe, or maps are to be kept and none are named.
pub(super) fn of_settings(settings: &RunSettings, surface: &Surface) -> Result<Option<Arc<KnownMaps>>> {
    let run = &settings.known_maps;
    if run.as_os_str().is_empty() {
        return match settings.fit.fixed_maps {
            false => Ok(None),
            true => Err(none_given()),
        };
    }
    let result = read(run)?;
    same_lobe(settings, &result)?;
    let RunResult { maps, times_seen, mesh, .. } = result;
    let own = surface.mesh();
    if own.triangles != mesh.triangles || own.positions != mesh.positions || own.uvs != mesh.uvs {
        return Err(Error::new(ErrorKind::InvalidScene, "the maps to keep lie on another atlas than that of this fit")
            .at(Place::File(run.join("mesh.obj")))
            .remedy("begin the fit anew with `patina fit SCENE --maps RUN`, which takes the atlas of the run"));
    }
    Ok(Some(Arc::new(KnownMaps { maps, times_seen })))
}

/// Checks that a scene's mesh, cleaned as for an atlas, is the surface of a run.
fn check_surface(scene: &Mesh, run: &Mesh, atlas: &AtlasSettings, place: &Path) -> Result<()> {
    let cleaned = dissolve_degenerate(scene, atlas.dissolve_distance)?.mesh;
    let (own, others) = (cleaned.triangles.len(), run.triangles.len());
    let differs = |what: String| {
        Err(Error::new(ErrorKind::InvalidScene, format!("the maps to keep are of another surface: {what}"))
            .at(Place::File(place.join("mesh.obj")))
            .remedy("give the photos the mesh that the run was made with, in the same place: --mesh FILE, --up AXIS"))
    };
    if own != others {
        return differs(format!("its mesh has {others} triangles, the scene's {own}"));
    }
    if let Some(triangle) = (0..own).find(|&triangle| cleaned.corners(triangle) != run.corners(triangle)) {
        return differs(format!("triangle {triangle} lies elsewhere"));
    }
    let wrong_uv = |message: &str| {
        Err(Error::new(ErrorKind::InvalidSetting, message)
            .at(Place::Setting("uv".into()))
            .remedy("leave out --uv: the fit takes the atlas of the run whose maps it keeps"))
    };
    let uvs =
        |mesh: &Mesh, triangle: usize| mesh.triangles[triangle].map(|vertex| mesh.uvs.get(vertex as usize).copied());
    match atlas.keep_uv {
        KeepUv::Auto => Ok(()),
        KeepUv::Rebuild => wrong_uv("maps that are kept lie on the atlas they were made for, and need it"),
        KeepUv::Keep if (0..own).all(|triangle| uvs(&cleaned, triangle) == uvs(run, triangle)) => Ok(()),
        KeepUv::Keep => wrong_uv("the scene's texture coordinates are not those that the maps to keep lie on"),
    }
}
