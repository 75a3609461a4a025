//! The page of a run: as a file of an export, and inside a report.

use super::super::pictures::{light_of, matched};
use super::super::shown::exposure_of;
use super::format::WEB_SHOWS;
use super::sheets::{WEB_FILES, write_sheet};
use super::{ExportEvent, Format};
use crate::error::{Finding, Result, Severity};
use crate::export::asset::Asset;
use crate::export::sheet::Losses;
use crate::export::web::PagePhoto;
use crate::export::{RunResult, web};
use crate::files::write_bytes;
use crate::image::area::area_mean;
use crate::image::file;
use crate::image::resize::shrink;
use crate::light::Environment;
use crate::material::MaterialMaps;
use crate::scene::Scene;
use std::path::Path;

/// Photos of an exported page, at most.
const MOST_PHOTOS: usize = 4;
/// Width of the maps of a page in a report, in texels, at most.
const MOST_TEXELS_OF_REPORT: usize = 512;
/// Triangles of a page in a report, at most: more would outgrow its pictures.
const MOST_TRIANGLES_OF_REPORT: usize = 120_000;
/// Photos in a report's page, at most.
const MOST_PHOTOS_OF_REPORT: usize = 2;

/// Writes the page: the run's light and built-in skies of its brightness, and some photos when the scene is at hand.
pub(super) fn write_page(
    asset: &Asset,
    scene: Option<&Scene>,
    folder: &Path,
    findings: &mut Vec<Finding>,
    tell: &dyn Fn(ExportEvent),
) -> Result<Losses> {
    let lights = lights_of(asset, &["noon", "evening", "overcast"])?;
    let photos = scene.map(|scene| page_photos(scene, MOST_PHOTOS)).transpose()?.unwrap_or_default();
    let page = web::page(asset, &lights, &photos)?;
    if page.beyond_maps > web::LARGEST_BEYOND_MAPS {
        let message = format!("the page holds {:.1} MB beyond its maps", page.beyond_maps as f64 / 1e6);
        let finding = Finding::new(Severity::Warning, "export-page-large", message)
            .remedy("simplify the mesh and carry the maps over with --onto");
        tell(ExportEvent::Finding(finding.clone()));
        findings.push(finding);
    }
    write_bytes(&folder.join("index.html"), page.html.as_bytes())?;
    let losses = Losses::default().and(WEB_SHOWS);
    write_sheet(Format::Web, ("Page", WEB_FILES), &losses, asset, folder)?;
    Ok(losses)
}

/// Photos of a page, spread over the views; those of a scene that was built anew are black and left out.
fn page_photos(scene: &Scene, most: usize) -> Result<Vec<PagePhoto>> {
    const MOST_PIXELS: usize = 400_000;
    const QUALITY: u8 = 85;
    let exposure = exposure_of(scene);
    let mut photos = Vec::new();
    for view in scene.views.iter().step_by(scene.views.len().div_ceil(most).max(1)) {
        let factor = 1 << view.camera.level_within(MOST_PIXELS);
        let picture = shrink(&view.photo.to_linear(), factor);
        if picture.pixels().iter().all(|rgb| rgb.max_element() <= 0.0) {
            continue;
        }
        let jpeg = file::encode_jpeg(&file::srgb8_from_linear(&picture, exposure), QUALITY)?;
        photos.push(PagePhoto { name: view.name.clone(), camera: view.camera.shrunk(factor), jpeg });
    }
    Ok(photos)
}

/// The light of the run, and built-in skies of its brightness.
fn lights_of(asset: &Asset, skies: &[&str]) -> Result<Vec<(String, Environment)>> {
    let own = asset.light.as_ref().map(|light| &light.whole);
    let mut lights: Vec<_> =
        own.map(|light| ("Estimated environment".to_string(), light.clone())).into_iter().collect();
    for name in skies {
        let sky = light_of(name, 64)?.environment;
        lights.push((format!("Built-in sky: {name}"), own.map_or_else(|| sky.clone(), |own| matched(&sky, own).0)));
    }
    Ok(lights)
}

/// The page for a report, with small maps; `None` for a mesh too large to be looked at inside one.
///
/// # Errors
/// A mesh that rays cannot be traced in; pictures that cannot be encoded.
pub(crate) fn page_of_report(result: &RunResult, scene: &Scene, has_lobe: bool, name: &str) -> Result<Option<String>> {
    if result.mesh.triangles.len() > MOST_TRIANGLES_OF_REPORT {
        return Ok(None);
    }
    let (width, height) = (result.maps.diffuse.width(), result.maps.diffuse.height());
    let factor = width.max(height).div_ceil(MOST_TEXELS_OF_REPORT);
    let size = ((width / factor).max(1), (height / factor).max(1));
    let maps = MaterialMaps {
        diffuse: area_mean(&result.maps.diffuse, size.0, size.1),
        specular: area_mean(&result.maps.specular, size.0, size.1),
        roughness: area_mean(&result.maps.roughness, size.0, size.1),
    };
    let small = RunResult {
        maps,
        environment: result.environment.clone(),
        mesh: result.mesh.clone(),
        times_seen: area_mean(&result.times_seen, size.0, size.1),
        lobe: result.lobe,
    };
    let asset = Asset::new(name, small, true, has_lobe, None);
    let page =
        web::page(&asset, &lights_of(&asset, &["noon", "overcast"])?, &page_photos(scene, MOST_PHOTOS_OF_REPORT)?)?;
    Ok(Some(page.html))
}
