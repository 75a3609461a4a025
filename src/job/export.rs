//! A run written for other programs: one job, whoever asks for it.
//!
//! [`forecast`] tells before anything is read how much memory and disk an export takes and what its formats cannot hold:
//! a window shows it in its dialog. [`export`] writes; nothing is seen at the place of the export until it is whole.

mod format;
mod page;
mod sheets;

pub use format::Format;
pub(super) use page::page_of_report;

use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::export::asset::Asset;
use crate::export::asset::reflectance::MetalSplit;
use crate::export::environment_file::{with_x_in_the_centre, write_both};
use crate::export::sheet::{self, Losses};
use crate::export::texture::TextureFormat;
use crate::export::transfer::transfer;
use crate::export::whole_folder::WholeFolder;
use crate::export::{RunFolder, blender, exchange, gltf, materialx, mitsuba, texture_set, usd};
use crate::files::write_bytes;
use crate::image::file;
use crate::material::LobeModel;
use crate::scene::{Scene, demo};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use super::prepare::RunSettings;
use format::OF_METALNESS;
use page::write_page;
use sheets::{BLENDER_FILES, GLB_FILES, MATERIALX_FILES, MITSUBA_FILES, TEXTURE_FILES, USD_FILES, write_sheet};

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
    let (has_lobe, lobe) = lobe_of(&folder)?;
    let header = file::read_header(&folder.file("diffuse.exr")).map_err(|error| {
        Error::new(error.kind(), error.message())
            .at(error.place().clone())
            .remedy("name a run whose fit has ended, or go on with it: `patina resume RUN`")
    })?;
    let width = options.size.unwrap_or(header.width);
    let height = (width * header.height).div_ceil(header.width.max(1)).max(1);
    // Bytes a texel: the result (32), its filled copy (28) and distances (12) while it is read; the asset (28), converted
    // maps (52, for GLB, the most) and encoded files (46) while it is written. Vertices count little.
    let (read, written) = ((header.width * header.height) as u64, (width * height) as u64);
    let mesh_bytes = std::fs::metadata(folder.file("mesh.obj")).map_or(0, |facts| facts.len());
    let peak_bytes = (72 * read).max(126 * written) + 3 * mesh_bytes;
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
        true => options.formats.iter().flat_map(|&f| f.loses(lobe).map(move |s| (f, s.to_string()))).collect(),
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

/// Whether the surface of a run was fitted with a specular lobe, and which. A folder without settings is taken by its maps.
fn lobe_of(folder: &RunFolder) -> Result<(bool, LobeModel)> {
    if !folder.file("settings.toml").is_file() {
        return Ok((true, LobeModel::BlinnPhong));
    }
    let settings: RunSettings = folder.read_settings()?;
    Ok((settings.fit.has_lobe(), settings.fit.lobe))
}

/// How many metres a unit of a run's mesh is, where it was given: 1 elsewhere.
fn unit_of(folder: &RunFolder) -> Result<f64> {
    if !folder.file("settings.toml").is_file() {
        return Ok(1.0);
    }
    let settings: RunSettings = folder.read_settings()?;
    Ok(settings.read.unit_in_metres.unwrap_or(1.0))
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
    let mut asset = Asset::new(&name, result, has_light, lobe_of(&folder)?.0, options.size);
    asset.unit_in_metres = unit_of(&folder)?;
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

/// The scene of a run, in the world of its mesh; the demo is built anew.
///
/// # Errors
/// Settings that cannot be read; a scene that is no longer where the fit read it.
pub fn scene_of(folder: &RunFolder) -> Result<Scene> {
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
            let (held_share, metals) = usd::write(asset, folder, sixteen_bits)?;
            let losses = with_metals(lobe, held_share, metals.as_ref());
            ("USD", USD_FILES, if asset.has_lobe { losses.and(OF_METALNESS) } else { losses })
        }
        Format::Mitsuba => {
            mitsuba::write(asset, folder)?;
            let losses = match asset.has_lobe {
                true => lobe.and(
                    "of scene.xml: shadowing of its lobe does not know that what is hidden from one side is often hidden from \
                     the other too, and its rise towards grazing angles ends at 0.9; scene_exact.xml is the fitted model itself",
                ),
                false => lobe,
            };
            ("Mitsuba 3", MITSUBA_FILES, losses)
        }
        Format::Blender => {
            let (held_share, metals) = blender::write(asset, folder)?;
            let losses = with_metals(lobe, held_share, metals.as_ref());
            let of_one_shader =
                "but for the shape of the lobe these hold for --one-shader; two shaders are the fitted model itself";
            ("Blender 4.2 to 5", BLENDER_FILES, if asset.has_lobe { losses.and(of_one_shader) } else { losses })
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
    write_sheet(format, (title, files), &losses, asset, folder)?;
    Ok(losses)
}

#[cfg(test)]
mod tests;
