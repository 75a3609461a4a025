//! A result folder read again: what was estimated, from what, and how it went.

use super::bands::LightBands;
use super::inputs::ObjectInputs;
use super::joint::Estimate;
use super::nodes::NodeGrid;
use super::prior::LogLight;
use super::progress::read_rows;
use super::seen::LightSeen;
use super::settings::ObjectSettings;
use super::split::SplitSpread;
use super::starts::StartedModel;
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::image::file;
use crate::light::Environment;
use std::path::{Path, PathBuf};

/// Name of the file that marks a result of object mode.
pub const MARK: &str = "object.json";
/// Name of the file that says what the photos see of the light.
pub const SEEN: &str = "environment_seen.exr";
/// Darkest radiance of a light that was read, so that it has a logarithm.
const FLOOR: f32 = 1e-12;

/// Name of the file of the light of a photo, counted from 0; of the first, or of all, it is `env.exr`.
pub fn light_file(photo: usize) -> String {
    if photo == 0 { "env.exr".into() } else { format!("env_{photo}.exr") }
}

/// A start as the folder remembers it.
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
pub struct FollowedStart {
    /// Its name.
    pub start: String,
    /// The objective it came to at low resolution.
    pub objective: f64,
    /// Minus the logarithm of its evidence in nats, up to what is the same for all.
    #[serde(default)]
    pub evidence: f64,
}

/// What a folder holds.
pub struct ObjectResult {
    /// What it was estimated from.
    pub inputs: ObjectInputs,
    /// The settings.
    pub settings: ObjectSettings,
    /// The model.
    pub model: StartedModel,
    /// What was estimated; its candidates are empty, see [`ObjectResult::followed`].
    pub estimate: Estimate,
    /// The starts that were followed, the best first.
    pub followed: Vec<FollowedStart>,
    /// How far apart those are that are as good.
    pub spread: SplitSpread,
}

/// `object.json`, as far as it is read again.
#[derive(serde::Deserialize)]
struct Written {
    parameters: Vec<f64>,
    start: String,
    picture_log_rmse: f64,
    seconds: f64,
    split: SplitSpread,
    #[serde(default)]
    light_bands: Option<LightBands>,
    followed: Vec<FollowedStart>,
    #[serde(default)]
    findings: Vec<WrittenFinding>,
    inputs: Option<ObjectInputs>,
}

#[derive(serde::Deserialize)]
struct WrittenFinding {
    severity: Severity,
    message: String,
    #[serde(default)]
    remedy: String,
}

/// Whether a folder holds a result of object mode.
pub fn is_result(folder: &Path) -> bool {
    folder.join(MARK).is_file()
}

/// Reads a result.
///
/// # Errors
/// Files that are missing or damaged, and folders written before results said what they were estimated from.
pub fn read(folder: &Path) -> Result<ObjectResult> {
    let path = folder.join(MARK);
    let text = std::fs::read_to_string(&path).map_err(|source| Error::reading(&path, source))?;
    let damaged = |message: String| {
        Error::new(ErrorKind::Malformed, message)
            .at(Place::File(path.clone()))
            .remedy("estimate again with `patina object`, or copy the folder anew")
    };
    let written: Written =
        serde_json::from_str(&text).map_err(|source| damaged(format!("the result cannot be read: {source}")))?;
    let inputs = written.inputs.ok_or_else(|| {
        damaged("the result does not say what it was estimated from: it is of an older version".into())
    })?;
    let settings = read_settings(&folder.join("settings.toml"))?;
    settings.validate()?;
    let model = StartedModel::of(inputs.model, inputs.weights.as_deref(), inputs.lobes.clamp(1, 3), &settings)?;
    let count = model.model.parameter_count();
    if written.parameters.len() != count || written.parameters.iter().any(|value| !value.is_finite()) {
        let message = format!("{} parameters for a model of {count}", written.parameters.len());
        return Err(damaged(message));
    }
    let table = NodeGrid::new(settings.nodes).tabulate(model.model.as_ref(), &written.parameters);
    let (light, _) = Environment::read(&folder.join("env.exr"))?;
    let further = (1..).map(|index| folder.join(light_file(index))).take_while(|path| path.is_file());
    let read = |path: PathBuf| Environment::read(&path).map(|(light, _)| LogLight::of(&light, FLOOR));
    let further_lights = further.map(read).collect::<Result<Vec<LogLight>>>()?;
    let seen = folder.join(SEEN);
    let light_seen = if seen.is_file() { Some(LightSeen::new(file::read_rgb(&seen)?)) } else { None };
    let finding = |own: WrittenFinding| Finding::new(own.severity, "object-result", own.message).remedy(own.remedy);
    let estimate = Estimate {
        parameters: written.parameters,
        table,
        light: LogLight::of(&light, FLOOR),
        further_lights,
        start: written.start,
        candidates: Vec::new(),
        rows: read_rows(&folder.join("loss.csv"))?,
        light_seen,
        light_bands: written.light_bands,
        picture_log_rmse: written.picture_log_rmse,
        findings: written.findings.into_iter().map(finding).collect(),
        seconds: written.seconds,
    };
    Ok(ObjectResult { inputs, settings, model, estimate, followed: written.followed, spread: written.split })
}

fn read_settings(path: &Path) -> Result<ObjectSettings> {
    let text = std::fs::read_to_string(path).map_err(|source| Error::reading(path, source))?;
    crate::files::settings_of_toml(&text, path)
}

/// Copies the files of a result to another folder that is prepared for it.
///
/// # Errors
/// Files that cannot be read or written.
pub fn copy(from: &Path, to: &Path) -> Result<()> {
    if std::fs::canonicalize(from).ok() == std::fs::canonicalize(to).ok() {
        return Ok(());
    }
    let entries = std::fs::read_dir(from).map_err(|source| Error::reading(from, source))?;
    for entry in entries {
        let path = entry.map_err(|source| Error::reading(from, source))?.path();
        let Some(name) = path.file_name().filter(|_| path.is_file()) else { continue };
        let bytes = std::fs::read(&path).map_err(|source| Error::reading(&path, source))?;
        crate::files::write_bytes(&to.join(name), &bytes)?;
    }
    Ok(())
}
