//! The run folder: everything a fit leaves behind, under fixed names.
//!
//! | file | what | made by |
//! |---|---|---|
//! | `convention.txt` | what the numbers mean; marks the folder as a run | [`RunFolder::create`] |
//! | `settings.toml` | settings of the run | `patina fit`, at its start |
//! | `checkpoint` | state to resume from | `patina fit`, while it runs |
//! | `diffuse.exr specular.exr roughness.exr seen.exr env.exr mesh.obj` | the result | `patina fit`, at its end |
//! | `diffuse_deviation.exr specular_deviation.exr roughness_deviation.exr` | standard deviations of the maps | `patina fit --method solver`, at its end |
//! | `lobe_sharing.exr` | number of texels that share a texel's lobe, 0 where no pixel shows the texel best | the same |
//! | `choices.exr` | what views that took no part chose: 1 no lobe, 2 one lobe a region, 3 lobes of their own; 0 where less than two judge | the same, unless resumed after its maps |
//! | `environment_evidence.exr` | what a texel of the light is known by: highlights (red), background (green), diffuse light and shadows (blue); the rest to 1 is belief | the same, unless resumed after its rounds |
//! | `light_scale.json` | how far photos leave the factor open that light and reflectance have in common: `relative_deviation`, null where they say nothing | `patina fit --method solver`, at its end |
//! | `loss.csv` | the loss of every step | `patina fit` |
//! | `capture.csv` | how each photo lies against the model's picture: shift, roll, gain, doubtful mask | `patina fit`, at its end |
//! | `report.json report.html` | scores and pictures | `patina fit`, at its end |
//! | `lock` | who fits into the folder now | [`RunFolder::held`] |
//! | `earlier` | the result that was here before, a run folder of its own | `patina fit` at its start, until its end |

pub(super) mod earlier;
mod lock;
mod new_folder;
mod result;
mod stated;

pub use new_folder::new_run_folder;
pub use result::RunResult;

use super::{LossRow, convention, loss_log, obj};
use crate::error::{Error, ErrorKind, Place, Result};
use crate::image::{GreyImage, RgbImage, file};
use crate::light::Environment;
use crate::material::{LobeModel, MaterialMaps};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A folder that holds a run.
#[derive(Clone, Debug)]
pub struct RunFolder {
    path: PathBuf,
    /// Its lock, where it is held.
    lock: Option<Arc<lock::RunLock>>,
}

impl PartialEq for RunFolder {
    fn eq(&self, other: &Self) -> bool {
        self.path == other.path
    }
}

impl RunFolder {
    /// Makes a run folder, or takes one that is there already. Nothing in it is deleted; a result in it is set aside by a
    /// new fit ([`Self::set_result_aside`]), and each file is replaced when its successor is complete.
    ///
    /// # Errors
    /// `Unwritable` when the folder cannot be made, or when it holds other things than a run: a scene's own `mesh.obj`
    /// must not be overwritten.
    pub fn create(path: &Path) -> Result<Self> {
        let folder = RunFolder { path: path.into(), lock: None };
        if path.exists() && !folder.is_run() {
            let mut entries = std::fs::read_dir(path).map_err(|source| {
                Error::writing(path, source).remedy("name a folder that does not exist yet with -o")
            })?;
            if entries.next().is_some() {
                return Err(Error::new(
                    ErrorKind::Unwritable,
                    "the folder holds other files and is not a run of Patina",
                )
                .at(Place::File(path.into()))
                .remedy("name a new or an empty folder with -o; nothing was changed"));
            }
        }
        std::fs::create_dir_all(path).map_err(|source| Error::writing(path, source))?;
        crate::files::write_bytes(&folder.file(MARK_FILE), convention::SHEET.as_bytes())?;
        Ok(folder)
    }

    /// Opens a run folder to read. Only the folder itself is checked here: each file is checked when it is read.
    pub fn open(path: &Path) -> Result<Self> {
        if !path.is_dir() {
            let message =
                if path.exists() { "this is a file, not a run folder" } else { "there is no such run folder" };
            return Err(Error::new(ErrorKind::Missing, message)
                .at(Place::File(path.into()))
                .remedy("check the path, or make it with `patina fit SCENE -o RUN`"));
        }
        Ok(RunFolder { path: path.into(), lock: None })
    }

    /// Whether the folder bears the mark of a run.
    pub fn is_run(&self) -> bool {
        std::fs::read(self.file(MARK_FILE)).is_ok_and(|bytes| bytes.starts_with(convention::FIRST_LINE.as_bytes()))
    }

    /// Whether every file of a [`RunResult`] is there.
    pub fn has_result(&self) -> bool {
        RESULT_FILES.iter().all(|name| self.file(name).is_file())
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// A file of the folder by its name.
    pub fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// Where the checkpoint lies; its content is the fit's own.
    pub fn checkpoint_path(&self) -> PathBuf {
        self.file("checkpoint")
    }

    /// Removes the checkpoint, where there is one.
    ///
    /// # Errors
    /// `Unwritable` when it is there and cannot be removed.
    pub fn remove_checkpoint(&self) -> Result<()> {
        let path = self.checkpoint_path();
        match std::fs::remove_file(&path) {
            Err(source) if source.kind() != std::io::ErrorKind::NotFound => Err(Error::writing(&path, source)),
            _ => Ok(()),
        }
    }

    /// Where the HTML report lies.
    pub fn report_html_path(&self) -> PathBuf {
        self.file("report.html")
    }

    /// Writes the result, checked first: a result that would not be read back is not written.
    pub fn write_result(&self, result: &RunResult) -> Result<()> {
        result.validate(&self.path)?;
        self.write_maps(&result.maps, &result.times_seen)?;
        file::write_exr_rgb(&self.file("env.exr"), &result.environment.radiance)?;
        obj::write(&self.file("mesh.obj"), &result.mesh)
    }

    /// Writes the maps alone, with what photos have seen of them.
    pub fn write_maps(&self, maps: &MaterialMaps, times_seen: &GreyImage) -> Result<()> {
        file::write_exr_rgb(&self.file("diffuse.exr"), &maps.diffuse)?;
        file::write_exr_rgb(&self.file("specular.exr"), &maps.specular)?;
        file::write_exr_grey(&self.file("roughness.exr"), &maps.roughness)?;
        file::write_exr_grey(&self.file("seen.exr"), times_seen)
    }

    /// Reads what [`Self::write_maps`] wrote.
    pub fn read_maps(&self) -> Result<(MaterialMaps, GreyImage)> {
        let maps = MaterialMaps {
            diffuse: self.read_rgb("diffuse.exr")?,
            specular: self.read_rgb("specular.exr")?,
            roughness: self.read_grey("roughness.exr")?,
        };
        Ok((maps, self.read_grey("seen.exr")?))
    }

    /// Reads the result. Before anything is read, all missing files are named in one error.
    pub fn read_result(&self) -> Result<RunResult> {
        self.read_with(|folder| Ok(Environment { radiance: folder.read_rgb(LIGHT_FILE)? }), &RESULT_FILES)
    }

    /// Reads the result of a run whose light may be missing: a black one stands for it, and the second value is false.
    ///
    /// # Errors
    /// As [`RunFolder::read_result`], but for a missing light.
    pub fn read_result_with_or_without_light(&self) -> Result<(RunResult, bool)> {
        if self.file(LIGHT_FILE).is_file() {
            return Ok((self.read_result()?, true));
        }
        let needed: Vec<&str> = RESULT_FILES.into_iter().filter(|&name| name != LIGHT_FILE).collect();
        let black = |_: &Self| Ok(Environment::constant(2, 1, glam::Vec3::ZERO));
        Ok((self.read_with(black, &needed)?, false))
    }

    /// Reads the result, the light by the first argument; `needed` are the files that must be there.
    fn read_with(&self, light: impl FnOnce(&Self) -> Result<Environment>, needed: &[&str]) -> Result<RunResult> {
        let missing: Vec<&str> = needed.iter().copied().filter(|name| !self.file(name).is_file()).collect();
        if let Some(first) = missing.first() {
            let how = if self.checkpoint_path().is_file() {
                "the fit has not ended: resume it with `patina resume RUN`"
            } else {
                "make the run again with `patina fit SCENE -o RUN`"
            };
            let otherwise = if self.has_earlier() { ", or name RUN/earlier, the result before it" } else { "" };
            let remedy = format!("{how}{otherwise}");
            let message = format!("the run has no {}", missing.join(", no "));
            return Err(Error::new(ErrorKind::Missing, message).at(Place::File(self.file(first))).remedy(remedy));
        }
        let (maps, times_seen) = self.read_maps()?;
        let result = RunResult {
            maps,
            environment: light(self)?,
            mesh: obj::read(&self.file("mesh.obj"))?,
            times_seen,
            lobe: self.read_lobe()?,
        };
        result.validate(&self.path)?;
        Ok(result)
    }

    /// The lobe that the settings name; [`LobeModel::BlinnPhong`] where they name none, as those of earlier versions.
    fn read_lobe(&self) -> Result<LobeModel> {
        #[derive(Default, serde::Deserialize)]
        #[serde(default)]
        struct Settings {
            fit: Fit,
        }
        #[derive(Default, serde::Deserialize)]
        #[serde(default)]
        struct Fit {
            lobe: LobeModel,
        }
        match self.file("settings.toml").is_file() {
            true => Ok(self.read_settings::<Settings>()?.fit.lobe),
            false => Ok(LobeModel::BlinnPhong),
        }
    }

    /// Writes `loss.csv`.
    pub fn write_loss(&self, rows: &[LossRow]) -> Result<()> {
        loss_log::write(&self.file("loss.csv"), rows)
    }

    /// Reads `loss.csv`.
    pub fn read_loss(&self) -> Result<Vec<LossRow>> {
        loss_log::read(&self.file("loss.csv")).map_err(|error| made_by(error, "patina fit SCENE -o RUN"))
    }

    /// Writes `settings.toml`.
    pub fn write_settings<T: serde::Serialize>(&self, settings: &T) -> Result<()> {
        let path = self.file("settings.toml");
        let text = toml::to_string_pretty(settings).map_err(|source| {
            Error::new(ErrorKind::Internal, format!("settings cannot be written as TOML: {source}"))
                .at(Place::File(path.clone()))
        })?;
        crate::files::write_bytes(&path, text.as_bytes())
    }

    /// Reads `settings.toml`. An error names the line.
    pub fn read_settings<T: serde::de::DeserializeOwned>(&self) -> Result<T> {
        let text = self.read_text("settings.toml", "patina fit SCENE -o RUN")?;
        crate::files::settings_of_toml(&text, &self.file("settings.toml"))
    }

    /// Writes `report.json`. A number that is not finite becomes `null`.
    pub fn write_report_json<T: serde::Serialize>(&self, report: &T) -> Result<()> {
        let path = self.file("report.json");
        let mut text = serde_json::to_string_pretty(report).map_err(|source| {
            Error::new(ErrorKind::Internal, format!("the report cannot be written as JSON: {source}"))
                .at(Place::File(path.clone()))
        })?;
        text.push('\n');
        crate::files::write_bytes(&path, text.as_bytes())
    }

    /// Reads `report.json`. An error names the line.
    pub fn read_report_json<T: serde::de::DeserializeOwned>(&self) -> Result<T> {
        let command = self.command_for_a_report();
        let text = self.read_text("report.json", command)?;
        serde_json::from_str(&text).map_err(|source| {
            Error::new(ErrorKind::Malformed, source.to_string())
                .at(Place::Line(self.file("report.json"), source.line()))
                .remedy(format!("make it again with `{command}`"))
        })
    }

    /// What makes a report: the end of a fit.
    fn command_for_a_report(&self) -> &'static str {
        if self.checkpoint_path().is_file() { "patina resume RUN" } else { "patina fit SCENE -o RUN" }
    }

    fn read_text(&self, name: &str, command: &str) -> Result<String> {
        let path = self.file(name);
        std::fs::read_to_string(&path).map_err(|source| made_by(Error::reading(&path, source), command))
    }

    fn read_rgb(&self, name: &str) -> Result<RgbImage> {
        file::read_rgb(&self.file(name)).map_err(|error| made_by(error, "patina fit SCENE -o RUN"))
    }

    fn read_grey(&self, name: &str) -> Result<GreyImage> {
        file::read_grey(&self.file(name)).map_err(|error| made_by(error, "patina fit SCENE -o RUN"))
    }
}

/// How each photograph lies against the model's picture.
pub const CAPTURE_FILE: &str = "capture.csv";
/// The mark of a run folder: [`convention::SHEET`].
const MARK_FILE: &str = "convention.txt";
const LIGHT_FILE: &str = "env.exr";
const RESULT_FILES: [&str; 6] = ["diffuse.exr", "specular.exr", "roughness.exr", "seen.exr", LIGHT_FILE, "mesh.obj"];

/// The same error with the command that makes the file as its remedy, where the file is missing or damaged.
fn made_by(error: Error, command: &str) -> Error {
    if !matches!(error.kind(), ErrorKind::Missing | ErrorKind::Malformed) {
        return error;
    }
    let verb = if error.kind() == ErrorKind::Missing { "make it" } else { "make it again" };
    Error::new(error.kind(), error.message()).at(error.place().clone()).remedy(format!("{verb} with `{command}`"))
}
