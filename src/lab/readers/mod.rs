//! Is read here what other tools wrote, as they read it? `patina-lab readers --python PYTHON`.
//!
//! The scripts of `tests/readers` have the tools write files and their own answers; the product's readers open the files, and
//! [`cameras`] and [`meshes`] compare. The bars: every lens model that pycolmap knows, from its text and its binary files, within
//! [`cameras::LARGEST_PIXELS`] of its own projection before and after undistortion; meshes with the triangle counts, areas
//! and boxes that trimesh and PyMeshLab find.

pub mod cameras;
pub mod meshes;

use super::bar_table::BarTable;
use super::other_programs::{Remedies, output_of, script};
use crate::error::{Error, ErrorKind, Place, Result};
use crate::files::write_bytes;
use std::path::{Path, PathBuf};

/// What to do about the tools.
const REMEDIES: Remedies = Remedies {
    unstarted: "name the Python that has the tools with --python",
    failed: "install what tests/readers/README.md names, or leave a part out with --only",
};

/// What is compared, and with what.
#[derive(Clone, Debug, clap::Args)]
pub struct ReaderOptions {
    /// The Python that has `pycolmap`, `trimesh` and `pymeshlab`.
    #[arg(long, default_value = "python3")]
    pub python: PathBuf,
    /// The folder of the scripts.
    #[arg(long, default_value = "tests/readers")]
    pub scripts: PathBuf,
    /// Folders of further meshes, with their subfolders.
    #[arg(long)]
    pub meshes: Vec<PathBuf>,
    /// Points of each lens model.
    #[arg(long, default_value_t = 1000)]
    pub points: usize,
    /// Only these parts.
    #[arg(long, value_enum, value_delimiter = ',')]
    pub only: Vec<Part>,
    /// Folder of files and answers.
    #[arg(short, long, default_value = "patina-readers")]
    pub output: PathBuf,
}

/// A part of the comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Part {
    /// Lens models, by pycolmap.
    Cameras,
    /// Meshes, by trimesh and PyMeshLab.
    Meshes,
}

/// Has the tools write, reads, and compares; a table for each part. `tell` hears what is asked.
///
/// # Errors
/// A tool or a script that is missing or fails, a folder that cannot be written. What the readers refuse is a row that
/// falls short.
pub fn run(options: &ReaderOptions, tell: &dyn Fn(&str)) -> Result<Vec<BarTable>> {
    if let Some(missing) = options.meshes.iter().find(|folder| !folder.is_dir()) {
        return Err(Error::new(ErrorKind::Missing, "there is no folder of meshes here")
            .at(Place::File(missing.clone()))
            .remedy("give one with --meshes"));
    }
    std::fs::create_dir_all(&options.output).map_err(|source| Error::writing(&options.output, source))?;
    let asked = |part: Part| options.only.is_empty() || options.only.contains(&part);
    let mut tables = Vec::new();
    if asked(Part::Cameras) {
        let mut command = script(&options.python, &options.scripts, "write_cameras.py")?;
        output_of(command.arg(&options.output).arg(options.points.to_string()), REMEDIES)?;
        let answers: cameras::Answers = answers_of(&options.output.join("cameras.json"))?;
        tell(&format!("pycolmap {} wrote {} lens models", answers.version, answers.models.len()));
        tables.push(cameras::compare(&answers, options));
    }
    if asked(Part::Meshes) {
        let mut command = script(&options.python, &options.scripts, "write_meshes.py")?;
        output_of(command.arg(&options.output).args(&options.meshes), REMEDIES)?;
        let answers: meshes::Answers = answers_of(&options.output.join("meshes.json"))?;
        tell(&format!("{} read {} meshes", answers.tools.join(" and "), answers.files.len()));
        tables.push(meshes::compare(&answers));
    }
    let text: Vec<String> = tables.iter().map(BarTable::to_markdown).collect();
    write_bytes(&options.output.join("readers.md"), text.join("\n").as_bytes())?;
    Ok(tables)
}

/// What a script wrote down.
fn answers_of<T: serde::de::DeserializeOwned>(path: &Path) -> Result<T> {
    let bytes = std::fs::read(path).map_err(|source| Error::reading(path, source))?;
    serde_json::from_slice(&bytes).map_err(|source| {
        Error::new(ErrorKind::Malformed, format!("the answers are not understood: {source}"))
            .at(Place::File(path.into()))
            .remedy("script and program belong to different versions: name the folder of the scripts with --scripts")
    })
}
