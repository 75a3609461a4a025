//! The run whose maps a fit keeps: read, and held against the scene.
//!
//! Maps belong to the atlas they lie on, so that a fit which keeps them keeps that atlas: it is the run's mesh with its
//! texture coordinates that is traced. The scene's own mesh has to be the same surface.

use crate::atlas::clean::dissolve_degenerate;
use crate::atlas::{AtlasSettings, KeepUv};
use crate::error::{Error, ErrorKind, Place, Result};
use crate::export::{RunFolder, RunResult};
use crate::scene::Mesh;
use std::path::Path;

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

/// Checks that a scene's mesh, cleaned as for an atlas, is the surface of a run.
pub(super) fn check_surface(scene: &Mesh, run: &Mesh, atlas: &AtlasSettings, place: &Path) -> Result<()> {
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
