//! What a method has at a time: maps and light as linear EXR, and a line of figures.
//!
//! `snapshots.jsonl` holds a line a snapshot; its folder beside it holds `diffuse.exr`, `specular.exr`, `roughness.exr`
//! (`r = a^2`) and `env.exr`.

use super::clock::{Clock, processor_seconds};
use crate::error::{Error, ErrorKind, Place, Result};
use crate::image::file::{read_grey, read_rgb, write_exr_grey, write_exr_rgb};
use crate::insight::memory::peak_bytes;
use crate::light::Environment;
use crate::material::MaterialMaps;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Folder of stated standard deviations beside the list.
const DEVIATIONS: &str = "deviations";

/// Figures of a snapshot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Snapshot {
    /// Its folder, relative to the list.
    pub folder: String,
    /// The latest of the asked times that had passed, in seconds; `None` at the end.
    pub due: Option<f64>,
    /// Wall-clock seconds since the process began, without writing snapshots.
    pub seconds: f64,
    /// Processor seconds over all threads, where known.
    pub cpu_seconds: Option<f64>,
    /// Steps done.
    pub step: usize,
    /// Name of the stage.
    pub stage: String,
    /// Largest resident memory so far in bytes, where known.
    pub peak_bytes: Option<u64>,
    /// Numbers so far that were not finite and left out.
    pub non_finite: u64,
    /// Warnings and notes of the fit, at the end.
    #[serde(default)]
    pub findings: Vec<String>,
}

impl Snapshot {
    /// Its maps and light, from the folder of the list.
    pub fn read(&self, list_folder: &Path) -> Result<(MaterialMaps, Environment)> {
        read_maps(&list_folder.join(&self.folder))
    }
}

/// Maps and light of a folder.
pub fn read_maps(folder: &Path) -> Result<(MaterialMaps, Environment)> {
    let maps = read_three(folder)?;
    Ok((maps, Environment { radiance: read_rgb(&folder.join("env.exr"))? }))
}

fn read_three(folder: &Path) -> Result<MaterialMaps> {
    Ok(MaterialMaps {
        diffuse: read_rgb(&folder.join("diffuse.exr"))?,
        specular: read_rgb(&folder.join("specular.exr"))?,
        roughness: read_grey(&folder.join("roughness.exr"))?,
    })
}

fn write_three(folder: &Path, maps: &MaterialMaps) -> Result<()> {
    std::fs::create_dir_all(folder).map_err(|source| Error::writing(folder, source))?;
    write_exr_rgb(&folder.join("diffuse.exr"), &maps.diffuse)?;
    write_exr_rgb(&folder.join("specular.exr"), &maps.specular)?;
    write_exr_grey(&folder.join("roughness.exr"), &maps.roughness)
}

/// Writes the standard deviations a fit states at its end, as maps, beside its list.
pub fn write_deviations(list_folder: &Path, deviations: &MaterialMaps) -> Result<()> {
    write_three(&list_folder.join(DEVIATIONS), deviations)
}

/// The standard deviations a fit stated; `None` where it stated none.
pub fn read_deviations(list_folder: &Path) -> Result<Option<MaterialMaps>> {
    let folder = list_folder.join(DEVIATIONS);
    if folder.join("roughness.exr").is_file() { read_three(&folder).map(Some) } else { Ok(None) }
}

/// Writes maps and light into a folder, which is made.
pub fn write_maps(folder: &Path, maps: &MaterialMaps, light: &Environment) -> Result<()> {
    write_three(folder, maps)?;
    write_exr_rgb(&folder.join("env.exr"), &light.radiance)
}

/// The list of a folder; empty when there is none.
pub fn list(folder: &Path) -> Result<Vec<Snapshot>> {
    let path = folder.join("snapshots.jsonl");
    let Ok(text) = std::fs::read_to_string(&path) else { return Ok(Vec::new()) };
    let line = |(number, line): (usize, &str)| {
        serde_json::from_str(line).map_err(|error| {
            Error::new(ErrorKind::Malformed, format!("not a line of a snapshot: {error}"))
                .at(Place::Line(path.clone(), number + 1))
        })
    };
    text.lines().enumerate().filter(|(_, text)| !text.trim().is_empty()).map(line).collect()
}

/// What a method is at, when it offers a snapshot.
pub struct Progress<'a> {
    /// Maps and light; asked for only when they are written.
    pub state: &'a dyn Fn() -> (MaterialMaps, Environment),
    /// Steps done.
    pub step: usize,
    /// Name of the stage.
    pub stage: String,
    /// Numbers that were not finite.
    pub non_finite: u64,
}

/// Writes snapshots when they are due.
pub struct Snapshots {
    folder: PathBuf,
    due: Vec<f64>,
    lines: Vec<Snapshot>,
}

impl Snapshots {
    /// A new list in a folder; `due` are the seconds asked for, in any order.
    pub fn create(folder: &Path, due: &[f64]) -> Result<Self> {
        std::fs::create_dir_all(folder).map_err(|source| Error::writing(folder, source))?;
        let mut due = due.to_vec();
        due.sort_by(f64::total_cmp);
        let snapshots = Snapshots { folder: folder.into(), due, lines: Vec::new() };
        snapshots.write_list()?;
        Ok(snapshots)
    }

    /// Writes a snapshot when a time that was asked for has passed, or at the end. The clock does not count it.
    pub fn offer(&mut self, clock: &mut Clock, progress: &Progress, end: Option<Vec<String>>) -> Result<()> {
        let seconds = clock.seconds();
        let passed = self.due.iter().copied().rfind(|due| *due <= seconds);
        if passed.is_none() && end.is_none() {
            return Ok(());
        }
        self.due.retain(|due| *due > seconds);
        let snapshot = Snapshot {
            folder: format!("{:03}", self.lines.len()),
            due: if end.is_some() { None } else { passed },
            seconds,
            cpu_seconds: processor_seconds(),
            step: progress.step,
            stage: progress.stage.clone(),
            peak_bytes: peak_bytes(),
            non_finite: progress.non_finite,
            findings: end.unwrap_or_default(),
        };
        clock.without(|| {
            let (maps, light) = (progress.state)();
            write_maps(&self.folder.join(&snapshot.folder), &maps, &light)?;
            self.lines.push(snapshot);
            self.write_list()
        })
    }

    fn write_list(&self) -> Result<()> {
        let path = self.folder.join("snapshots.jsonl");
        let mut text = String::new();
        for line in &self.lines {
            let line = serde_json::to_string(line)
                .map_err(|error| Error::new(ErrorKind::Internal, format!("a snapshot has no JSON: {error}")))?;
            text += &line;
            text.push('\n');
        }
        crate::files::write_bytes(&path, text.as_bytes())
    }
}
