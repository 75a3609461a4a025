//! A run written for other programs: one job, whoever asks for it.
//!
//! [`forecast`] tells before anything is read how much memory and disk an export takes and what its formats cannot hold:
//! a window shows it in its dialog. [`export`] writes; nothing is seen at the place of the export until it is whole.

use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::export::asset::{Asset, MetalSplit};
use crate::export::environment_file::{with_x_in_the_centre, write_both};
use crate::export::sheet::{self, Losses};
use crate::export::texture::TextureFormat;
use crate::export::transfer::transfer;
use crate::export::web::PagePhoto;
use crate::export::whole_folder::WholeFolder;
use crate::export::{RunFolder, blender, exchange, gltf, materialx, mitsuba, texture_set, usd, web};
use crate::files::write_bytes;
use crate::image::file;
use crate::image::resize::shrink;
use crate::scene::{Scene, demo};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use super::pictures::{light_of, matched};
use super::prepare::RunSettings;
use super::shown::exposure_of;

/// What an export is made for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
#[cfg_attr(feature = "cli", value(rename_all = "lower"))]
pub enum Format {
    /// One file for viewers, engines and Blender.
    Glb,
    /// A USD stage and package.
    Usd,
    /// A scene of Mitsuba 3, with a plugin of the exact lobe.
    Mitsuba,
    /// A script for Blender.
    Blender,
    /// An OpenPBR material in MaterialX.
    Materialx,
    /// Maps alone, named as artists name them.
    Textures,
    /// One page to look at in any browser.
    Web,
}

impl Format {
    /// All of them.
    pub const ALL: [Format; 7] =
        [Format::Glb, Format::Usd, Format::Mitsuba, Format::Blender, Format::Materialx, Format::Textures, Format::Web];

    /// Name of its folder, and of the format on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Format::Glb => "glb",
            Format::Usd => "usd",
            Format::Mitsuba => "mitsuba",
            Format::Blender => "blender",
            Format::Materialx => "materialx",
            Format::Textures => "textures",
            Format::Web => "web",
        }
    }

    /// What the format cannot hold of a surface with a lobe, one sentence each, without a full stop.
    pub fn cannot_hold(self) -> &'static [&'static str] {
        const GGX: &str = "the Blinn-Phong lobe becomes the nearest GGX lobe";
        const LAYER: &str =
            "its renderers weigh the diffuse part by what the lobe leaves; the base colour is raised to make up for it";
        match self {
            Format::Glb => &[GGX, LAYER, "the environment lies beside the file, not in it"],
            Format::Usd => {
                &[GGX, "importers without a specular workflow take one index of refraction for the whole surface"]
            }
            Format::Mitsuba => &[
                "scene.xml: the lobe becomes the nearest GGX lobe, and one F0 and metalness stand for the specular map; \
                 scene_exact.xml with its plugin loses nothing",
            ],
            Format::Blender => &[GGX, LAYER],
            Format::Materialx => &[GGX, LAYER],
            Format::Textures => &[
                GGX,
                "BaseColor, Metallic and Specular stand for two reflectances; colour of F0 below 0.08 is lost \
                in them, not in Diffuse and SpecularF0",
            ],
            Format::Web => &[WEB_SHOWS],
        }
    }
}

const WEB_SHOWS: &str =
    "the page shows the fitted lobe by maps blurred beforehand: no shadows of single lamps, no light between surfaces";

/// What to export, and how.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ExportOptions {
    /// The run folder; it is only read.
    pub run: PathBuf,
    /// The folder to make; an earlier export there is replaced.
    pub output: PathBuf,
    /// What for; each gets a folder of its name.
    pub formats: Vec<Format>,
    /// Width of the written maps in texels, 16 to 16384; that of the run when `None`.
    pub size: Option<usize>,
    /// Another mesh of the same place, with texture coordinates, that the maps are carried over to.
    pub onto: Option<PathBuf>,
    /// Whether the cameras of the run's scene are written too, as `cameras.json`: the scene is read for it.
    pub cameras: bool,
    /// Kind of the texture set's files; for GLB and USD `png8` chooses 8 bits and all others 16.
    pub textures: TextureFormat,
}

impl ExportOptions {
    /// All formats, maps as they are.
    pub fn new(run: &Path, output: &Path) -> Self {
        ExportOptions {
            run: run.into(),
            output: output.into(),
            formats: Format::ALL.to_vec(),
            size: None,
            onto: None,
            cameras: false,
            textures: TextureFormat::default(),
        }
    }

    fn validate(&self) -> Result<()> {
        let wrong = |name: &str, message: String, remedy: &str| {
            Err(Error::new(ErrorKind::InvalidSetting, message).at(Place::Setting(name.into())).remedy(remedy))
        };
        if self.formats.is_empty() {
            return wrong(
                "to",
                "no format is named".into(),
                "name one or more of glb, usd, mitsuba, blender, materialx, textures, web",
            );
        }
        match self.size {
            Some(size) if !(16..=16_384).contains(&size) => {
                wrong("size", format!("maps cannot be {size} texels wide"), "give a width from 16 to 16384")
            }
            _ => Ok(()),
        }
    }
}

/// What an export will take and lose.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Forecast {
    /// Width and height of the written maps in texels.
    pub texels: (usize, usize),
    /// Memory at its peak, in bytes, nearly.
    pub peak_bytes: u64,
    /// Largest size on disk, in bytes; compression makes it less.
    pub largest_disk_bytes: u64,
    /// What each format cannot hold.
    pub losses: Vec<(Format, String)>,
    /// What else the user should know.
    pub findings: Vec<Finding>,
}

/// Tells what an export will take and lose, from the headers of the run's files.
///
/// # Errors
/// Settings out of range; a run without maps.
pub fn forecast(options: &ExportOptions) -> Result<Forecast> {
    options.validate()?;
    let folder = RunFolder::open(&options.run)?;
    let has_lobe = has_lobe(&folder)?;
    let header = file::read_header(&folder.file("diffuse.exr")).map_err(|error| {
        Error::new(error.kind(), error.message())
            .at(error.place().clone())
            .remedy("name a run whose fit has ended, or go on with it: `patina resume RUN`")
    })?;
    let width = options.size.unwrap_or(header.width);
    let height = (width * header.height).div_ceil(header.width.max(1)).max(1);
    // Bytes a texel: the result (32), its filled copy (28) and distances (12) while it is read; the asset (28), converted
    // maps (28) and encoded files (42) while it is written. Vertices count little.
    let (read, written) = ((header.width * header.height) as u64, (width * height) as u64);
    let mesh_bytes = std::fs::metadata(folder.file("mesh.obj")).map_or(0, |facts| facts.len());
    let peak_bytes = (72 * read).max(98 * written) + 3 * mesh_bytes;
    let per_channel = options.textures.bytes_per_channel() as u64;
    let packed = if options.textures == TextureFormat::Png8 { 1 } else { 2 };
    let disk_of = |format: &Format| {
        let per_texel = match format {
            Format::Glb => 9 * packed,
            Format::Usd => 2 * 7 * packed,
            Format::Mitsuba => 4 * 13,
            Format::Blender | Format::Materialx => 4 * 7,
            Format::Textures => 12 * per_channel,
            Format::Web => 10,
        };
        per_texel * written + 2 * mesh_bytes
    };
    let mut findings = Vec::new();
    if !folder.file("env.exr").is_file() {
        findings.push(without_light());
    }
    let losses = match has_lobe {
        true => options.formats.iter().flat_map(|&f| f.cannot_hold().iter().map(move |s| (f, s.to_string()))).collect(),
        false => Vec::new(),
    };
    let largest_disk_bytes = options.formats.iter().map(disk_of).sum();
    Ok(Forecast { texels: (width, height), peak_bytes, largest_disk_bytes, losses, findings })
}

fn without_light() -> Finding {
    Finding::new(Severity::Warning, "export-without-light", "the run has no light: no environment is written")
        .remedy("light the export with an environment of your own")
}

/// What an export tells while it works.
#[derive(Clone, Debug)]
pub enum ExportEvent {
    /// What it will take; told before anything is read.
    Forecast(Forecast),
    /// Something is being done: what, and the share done in [0, 1].
    Stage(String, f32),
    /// Something the user should know.
    Finding(Finding),
    /// A format is complete.
    Written(Format),
}

/// What was exported.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Exported {
    /// The folder.
    pub folder: PathBuf,
    /// What each format lost, in numbers.
    pub losses: Vec<(Format, Vec<String>)>,
    /// What the user should know.
    pub findings: Vec<Finding>,
}

/// Whether the surface of a run was fitted with a specular lobe. A folder without settings is taken by its maps.
fn has_lobe(folder: &RunFolder) -> Result<bool> {
    if !folder.file("settings.toml").is_file() {
        return Ok(true);
    }
    let settings: RunSettings = folder.read_settings()?;
    Ok(settings.fit.has_lobe())
}

/// Writes an export. `tell` hears of it; `stop` ends it between files, and then nothing is left behind.
///
/// # Errors
/// `Unwritable` for a folder that may not be written or holds other things, told before the maps are read; `Stopped`;
/// errors of reading the run and of the formats.
pub fn export(options: &ExportOptions, stop: &AtomicBool, tell: &dyn Fn(ExportEvent)) -> Result<Exported> {
    let forecast = forecast(options)?;
    let mut findings = forecast.findings.clone();
    tell(ExportEvent::Forecast(forecast));
    let place = WholeFolder::begin(&options.output)?;
    let go_on = || match stop.load(Ordering::Relaxed) {
        true => Err(Error::new(ErrorKind::Stopped, "the export was stopped; nothing was written")
            .at(Place::File(options.output.clone()))
            .remedy("export again")),
        false => Ok(()),
    };
    let count = options.formats.len() as f32 + 1.0;
    tell(ExportEvent::Stage("reading the run".into(), 0.0));
    let folder = RunFolder::open(&options.run)?;
    let (result, has_light) = folder.read_result_with_or_without_light()?;
    go_on()?;
    let name = options.run.canonicalize().unwrap_or_else(|_| options.run.clone());
    let name = name.file_name().map_or_else(|| "patina".into(), |name| name.to_string_lossy().into_owned());
    let result = match &options.onto {
        None => result,
        Some(path) => {
            tell(ExportEvent::Stage(format!("carrying maps over to {}", path.display()), 0.5 / count));
            let (mesh, noticed) = crate::scene::read::mesh_file::read_mesh(path)?;
            findings.extend(noticed);
            let size = options.size.unwrap_or(result.maps.diffuse.width());
            let moved = transfer(&result, mesh, size).map_err(|error| error.at(Place::File(path.clone())))?;
            findings.extend(moved.findings);
            moved.result
        }
    };
    go_on()?;
    let asset = Asset::new(&name, result, has_light, has_lobe(&folder)?, options.size);
    if asset.light.is_none() && has_light {
        findings.push(without_light());
    }
    findings.iter().cloned().for_each(|finding| tell(ExportEvent::Finding(finding)));
    let mut formats = options.formats.clone();
    formats.sort_unstable();
    formats.dedup();
    let scene = if options.cameras {
        tell(ExportEvent::Stage("reading the cameras".into(), 0.6 / count));
        Some(scene_of(&folder)?)
    } else {
        None
    };
    let mut losses = Vec::new();
    for (index, &format) in formats.iter().enumerate() {
        go_on()?;
        tell(ExportEvent::Stage(format!("writing {}", format.name()), (index + 1) as f32 / count));
        let into = place.path().join(format.name());
        let lost = match format {
            Format::Web => write_page(&asset, scene.as_ref(), &into, &mut findings, tell)?,
            _ => write_format(format, &asset, &into, options.textures)?,
        };
        losses.push((format, lost.sentences));
        tell(ExportEvent::Written(format));
    }
    if let Some(scene) = &scene {
        exchange::write_cameras(scene, &place.path().join("cameras.json"))?;
    }
    let names: Vec<&str> = formats.iter().map(|format| format.name()).collect();
    write_bytes(&place.path().join("convention.txt"), sheet::of_export(&asset, &names).as_bytes())?;
    go_on()?;
    place.finish()?;
    Ok(Exported { folder: options.output.clone(), losses, findings })
}

/// Writes the page: the run's light and built-in skies of its brightness, and some photos when the scene is at hand.
fn write_page(
    asset: &Asset,
    scene: Option<&Scene>,
    folder: &Path,
    findings: &mut Vec<Finding>,
    tell: &dyn Fn(ExportEvent),
) -> Result<Losses> {
    let own = asset.light.as_ref().map(|light| &light.whole);
    let mut lights: Vec<_> =
        own.map(|light| ("Estimated environment".to_string(), light.clone())).into_iter().collect();
    for name in ["noon", "evening", "overcast"] {
        let sky = light_of(name, 64)?.environment;
        lights.push((format!("Built-in sky: {name}"), own.map_or_else(|| sky.clone(), |own| matched(&sky, own).0)));
    }
    let photos = scene.map(page_photos).transpose()?.unwrap_or_default();
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
    write_bytes(&folder.join("convention.txt"), sheet::of_format("Page", WEB_FILES, &losses).as_bytes())?;
    Ok(losses)
}

/// Photos of a page, spread over the views; those of a scene that was built anew are black and left out.
fn page_photos(scene: &Scene) -> Result<Vec<PagePhoto>> {
    const MOST: usize = 4;
    const MOST_PIXELS: usize = 400_000;
    const QUALITY: u8 = 85;
    let exposure = exposure_of(scene);
    let mut photos = Vec::new();
    for view in scene.views.iter().step_by(scene.views.len().div_ceil(MOST).max(1)) {
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

/// The scene of a run, in the world of its mesh; the demo is built anew.
fn scene_of(folder: &RunFolder) -> Result<Scene> {
    let settings: RunSettings = folder.read_settings()?;
    if settings.scene.as_os_str().is_empty() {
        let seed = settings.fit.seed;
        return Ok(demo::build(&demo::DemoSettings { seed, ..Default::default() })?.scene);
    }
    crate::scene::read(&settings.scene, &settings.read)
        .map_err(|error| error.remedy("leave out --cameras, or put the scene back where the fit read it"))
}

fn with_metals(losses: Losses, held_share: f64, metals: Option<&MetalSplit>) -> Losses {
    let losses = losses.and_held(held_share);
    match metals {
        Some(split) => losses.and_split(split),
        None => losses,
    }
}

/// Writes one format into its folder, with its sheet.
fn write_format(format: Format, asset: &Asset, folder: &Path, textures: TextureFormat) -> Result<Losses> {
    let sixteen_bits = textures != TextureFormat::Png8;
    let lobe = Losses::of_lobe(asset);
    let name = &asset.name;
    let (title, files, losses) = match format {
        Format::Glb => {
            let glb = gltf::glb(asset, sixteen_bits)?;
            write_bytes(&folder.join(format!("{name}.glb")), &glb.bytes)?;
            if let Some(light) = &asset.light {
                write_both(&with_x_in_the_centre(&light.whole), folder, "environment")?;
                if let Some(sun) = &light.sun {
                    write_both(&with_x_in_the_centre(&sun.rest), folder, "environment_without_sun")?;
                }
            }
            ("glTF 2.0", GLB_FILES, with_metals(lobe, glb.held_share, glb.metals.as_ref()))
        }
        Format::Usd => {
            usd::write(asset, folder, sixteen_bits)?;
            ("USD", USD_FILES, lobe)
        }
        Format::Mitsuba => {
            let split = mitsuba::write(asset, folder)?;
            let losses = match &split {
                Some(split) => {
                    lobe.and_split(split).and("these hold for scene.xml; scene_exact.xml is the fitted model itself")
                }
                None => lobe,
            };
            ("Mitsuba 3", MITSUBA_FILES, losses)
        }
        Format::Blender => {
            let (held_share, metals) = blender::write(asset, folder)?;
            ("Blender 4.2 to 5", BLENDER_FILES, with_metals(lobe, held_share, metals.as_ref()))
        }
        Format::Materialx => {
            let (held_share, metals) = materialx::write(asset, folder)?;
            ("MaterialX", MATERIALX_FILES, with_metals(lobe, held_share, metals.as_ref()))
        }
        // The page needs more than the asset.
        Format::Web => return Err(Error::new(ErrorKind::Internal, "a page is not written by itself")),
        Format::Textures => {
            ("Texture set", TEXTURE_FILES, lobe.and_split(&texture_set::write(asset, folder, textures)?))
        }
    };
    write_bytes(&folder.join("convention.txt"), sheet::of_format(title, files, &losses).as_bytes())?;
    Ok(losses)
}

const GLB_FILES: &str = "\
*.glb            mesh (+y up), material, textures, the sun as a directional light where the environment has one
  base colour    sRGB; diffuse reflectance over 1 - mean F, since glTF weighs diffuse light by 1 - max F
  metalness      blue of the second texture, no curve; used where the surface has metals (F0 above 0.16), else 0:
                 base colour is then F0 of what is metal
  roughness      square root of the GGX width; green of the second texture, no curve
  F0             ((ior - 1) / (ior + 1))^2 times the specular colour (sRGB): KHR_materials_ior, KHR_materials_specular
  sun            colour times intensity = irradiance facing it, in the environment's radiance times steradian; Blender:
                 import with the lighting mode Unitless
environment.*    the whole light, linear; +x in the centre, as three.js and Blender look for it. Either this or the
                 sun with environment_without_sun.*: both together light the scene twice";
const USD_FILES: &str = "\
*.usda, *.usdz   mesh, UsdPreviewSurface in its specular workflow, dome light; the package holds the same
diffuse.png      sRGB, diffuse reflectance as fitted
specular.png     sRGB, F0 as fitted
roughness.png    square root of the GGX width, no curve
environment.exr  the whole light, linear; left border -z, +z in the centre (OpenEXR's latitude-longitude)";
const MITSUBA_FILES: &str = "\
scene.xml        principled BSDF: base_color.exr, metallic.exr, roughness_ggx.exr (square root of the GGX width)
scene_exact.xml  the fitted model, BSDF `patina` of patina_lobe.py: diffuse.exr, specular.exr (F0), roughness.exr (a^2)
                 import mitsuba as mi; mi.set_variant(\"llvm_ad_rgb\"); import patina_lobe; mi.load_file(...)
environment_nodes.exr  the light on nodes, poles included: interpolated there it is the fitted one exactly
All maps are linear and read raw.";
const BLENDER_FILES: &str = "\
import_patina.py builds mesh, Principled BSDF and world: blender --python import_patina.py
base_color.exr   linear; diffuse reflectance over 1 - mean F, since Cycles takes from it what the lobe reflects
specular_tint.exr  linear; F0 over that of the index of refraction in material.json, specular level 0.5
roughness.exr    square root of the GGX width
metallic.exr     where the surface has metals (F0 above 0.16); base colour is F0 of what is metal
environment.exr  linear; +x in the centre";
const MATERIALX_FILES: &str = "\
*.mtlx           open_pbr_surface over the maps, all linear
base_color.exr   diffuse reflectance over 1 - mean F, since the layers of OpenPBR take from it what the lobe reflects
specular_color.exr  F0 over that of specular_ior
specular_roughness.exr  square root of the GGX width
base_metalness.exr  where the surface has metals (F0 above 0.16); base colour is F0 of what is metal
environment.exr  linear; left border -z, +z in the centre; mesh.obj with texture coordinates, v up";
const TEXTURE_FILES: &str = "\
BaseColor, Metallic, Specular, Roughness   metalness workflow: F0 = (1 - metallic) 0.08 specular + metallic base colour,
                 diffuse = (1 - metallic) base colour
Diffuse, SpecularF0, Roughness             specular workflow, reflectances as fitted
Colours carry the sRGB curve in PNG and TIFF and are linear in EXR; Metallic, Specular, Roughness carry no curve.
Roughness is the square root of the GGX width. Texture coordinates of the OBJ point up: row 0 is v = 1.
environment.*    linear; left border -z, +z in the centre";

const WEB_FILES: &str = "\
index.html       opens in any browser with WebGL 2, without a network; holds mesh, maps and environments
                 diffuse and F0 with the sRGB curve, microfacet width a = sqrt(r), eight bits each
                 drag turns, wheel zooms, Ctrl and drag moves, Shift and drag turns the light
                 index.html#light=1&rotation=90&exposure=0.5&backdrop=0&view=0&wipe=1 opens it so";

#[cfg(test)]
mod tests;
