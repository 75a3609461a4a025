//! Maps of an earlier run that a fit keeps: what they decide of the settings, and what the fit is given of them.

use super::prepare::RunSettings;
use super::run_with_maps::read;
use crate::error::{Error, ErrorKind, Place, Result};
use crate::export::RunResult;
use crate::fit::KnownMaps;
use crate::fit::known_maps::none_given;
use crate::render::Surface;
use std::sync::Arc;

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
