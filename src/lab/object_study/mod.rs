//! The experiments of the paper: figure 2 without any photo, figures 3, 4 and 5 with one, and shadows.
//!
//! [`representation`] is figure 2: models against tables, which `contender` fits. For the others [`inputs`] photographs:
//! the measured reflectance itself, asked at every part of a light that is finer than any that is fitted. [`case`]
//! estimates and measures one case. [`mod@plan`] says which cases there are. Results go to `results.csv` (`fig2.csv`) line
//! by line, and what stands there is not done again: a study that was stopped goes on.
//!
//! What this folder refuses to do: fit anything to the truth, or leave out a case that failed. A case that fails is a
//! line of NaN.

pub mod case;
mod contender;
pub mod inputs;
pub mod plan;
pub mod representation;
pub mod tables;

use crate::error::{Error, ErrorKind, Place, Result};
use crate::neural::Trained;
use crate::object::starts::ModelKind;
use case::{CaseResult, HEADER};
use inputs::Inputs;
use plan::{Case, plan};
use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

/// A part of the study that can be asked for alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Part {
    /// Figure 2: how closely models represent measured materials.
    Fig2,
    /// Figure 3: reflectance under a known light.
    Fig3,
    /// Figure 4: light with known reflectance.
    Fig4,
    /// Figure 5: both.
    Fig5,
    /// An object that shadows itself.
    Shadows,
    /// The schedule released with the paper, and other epsilons, beside the program's own.
    Schedules,
}

/// What is studied.
#[derive(Clone, Debug)]
pub struct StudyOptions {
    /// Folder of the neural fits of the MERL materials.
    pub library: PathBuf,
    /// Folder of environments.
    pub envmaps: PathBuf,
    /// Mesh of an object that shadows itself; without one that part is left out, and told.
    pub mesh: Option<PathBuf>,
    /// Weights of the neural model; those that ship for materials left out ([`crate::neural::shipped_leave_out`]) when
    /// not given.
    pub weights: Option<PathBuf>,
    /// Further weights for figure 2, each fitted to the materials it was trained without.
    pub leave_out_weights: Vec<PathBuf>,
    /// Models of the reflectance.
    pub models: Vec<ModelKind>,
    /// A few small cases.
    pub quick: bool,
    /// Materials of each figure, at most; those of the paper, or few when `quick`, when not given.
    pub materials: Option<usize>,
    /// Lights of each figure, at most; likewise.
    pub lights: Option<usize>,
    /// Only these parts; all but the schedules when empty.
    pub parts: Vec<Part>,
    /// Minutes after which figure 2 begins no further fit of DSBRDF, which takes a hundred times as long as the others.
    pub dsbrdf_minutes: f64,
    /// Seed of pixels, noise and nets.
    pub seed: u64,
    /// Where results go.
    pub output: PathBuf,
}

impl StudyOptions {
    /// Whether a part was asked for.
    pub fn wants(&self, part: Part) -> bool {
        // Schedules are no figure of the paper, and the released one is slow: only who asks for them gets them.
        self.parts.contains(&part) || self.parts.is_empty() && part != Part::Schedules
    }

    /// The neural model of the study.
    ///
    /// # Errors
    /// Weights that cannot be read.
    pub fn trained(&self) -> Result<Trained> {
        self.weights.as_deref().map_or_else(crate::neural::shipped_leave_out, Trained::read)
    }
}

/// Runs what is not done yet and writes tables and page. Returns the tables as text.
///
/// # Errors
/// Inputs that are missing, files that cannot be written, a stop. Cases that fail are results.
pub fn run(options: &StudyOptions, stop: &AtomicBool, tell: &dyn Fn(&str)) -> Result<String> {
    std::fs::create_dir_all(&options.output).map_err(|source| Error::writing(&options.output, source))?;
    check_facts(options)?;
    let mut text = String::new();
    let mut first = Vec::new();
    if options.wants(Part::Fig2) {
        let (markdown, section) = representation::run(options, stop, tell)?;
        text += &markdown;
        first.push((representation::TITLE, section));
    }
    if options.parts == [Part::Fig2] {
        tables::write_page(options, &first)?;
        return Ok(text);
    }
    let inputs = Inputs::read(options, tell)?;
    let cases = plan(&inputs, options);
    let path = options.output.join("results.csv");
    let mut lines = read_results(&path)?;
    // Photos of one material under all lights are taken at once: cases are grouped by what is photographed.
    let mut photographed: Option<(String, HashMap<String, inputs::Photographed>)> = None;
    let mut pictures = Vec::new();
    for (index, case) in cases.iter().enumerate() {
        if stop.load(Ordering::Relaxed) {
            return Err(Error::new(ErrorKind::Stopped, "the study was stopped; started again it goes on"));
        }
        if lines.iter().any(|line| line.starts_with(&case.key())) {
            continue;
        }
        let subject = case.subject();
        if photographed.as_ref().is_none_or(|(name, _)| *name != subject) {
            tell(&format!("photographing {subject}"));
            photographed = Some((subject, inputs.photograph(case)?));
        }
        let Some((_, photos)) = &photographed else { continue };
        let result = match case::run(case, &inputs, photos, options, stop) {
            Ok((result, shown)) => {
                pictures.extend(shown);
                result
            }
            Err(error) if error.kind() == ErrorKind::Stopped => return Err(error),
            Err(error) => {
                tell(&format!("{}: {error}", case.key()));
                CaseResult::failed()
            }
        };
        lines.push(format!("{}{}", case.key(), result.csv()));
        tell(&format!("{} of {}  {}{}", index + 1, cases.len(), case.key(), result.text()));
        let text = format!("{HEADER}\n{}\n", lines.join("\n"));
        crate::files::write_bytes(&path, text.as_bytes())?;
    }
    Ok(text + &tables::write(options, &inputs, &cases, &lines, &pictures, first)?)
}

/// Results that stand in a folder are not made again: they must be of the same seed, size and weights. The first sitting
/// writes these down, later ones are held against them.
fn check_facts(options: &StudyOptions) -> Result<()> {
    let name = |path: &std::path::PathBuf| path.to_string_lossy().into_owned();
    let facts = serde_json::json!({
        "quick": options.quick,
        "seed": options.seed,
        "weights": options.weights.as_ref().map(name),
        "leave_out_weights": options.leave_out_weights.iter().map(name).collect::<Vec<_>>(),
    });
    let path = options.output.join("study.json");
    if !path.is_file() {
        return crate::files::write_bytes(&path, format!("{facts:#}\n").as_bytes());
    }
    let text = std::fs::read_to_string(&path).map_err(|source| Error::reading(&path, source))?;
    if serde_json::from_str::<serde_json::Value>(&text).is_ok_and(|known| known == facts) {
        return Ok(());
    }
    Err(Error::new(ErrorKind::InvalidSetting, format!("the results in the folder were made with {}", text.trim()))
        .at(Place::File(path))
        .remedy("name another folder with -o, or give the options it began with"))
}

/// The lines of an earlier sitting.
fn read_results(path: &std::path::Path) -> Result<Vec<String>> {
    if !path.is_file() {
        return Ok(Vec::new());
    }
    let text = crate::scene::read::camera_file::read_text(path)?;
    let mut lines = text.lines();
    if lines.next() != Some(HEADER) {
        return Err(Error::new(ErrorKind::Malformed, "these are results of another study")
            .at(Place::File(path.into()))
            .remedy("name another folder with -o"));
    }
    Ok(lines.filter(|line| !line.is_empty()).map(str::to_string).collect())
}

/// Key of a case as text, for tables.
pub(super) fn fields_of<'a>(line: &'a str, case: &Case) -> Option<Vec<&'a str>> {
    line.strip_prefix(&case.key()).map(|rest| rest.split(',').collect())
}
