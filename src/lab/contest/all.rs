//! Every scene of a folder in one table, so that a change of the solver is judged by its mean over scenes.
//! `patina-lab bench fit --all FOLDER`.
//!
//! A scene is an exchange folder with its truth. One whose `scene.json` names another by `judged_by` is fitted with its
//! own photos and judged by the pictures of that other: so an 8-bit version and a linear one are held against the same
//! pixels. What is done is kept as a line of `results.jsonl`, and used again while program, inputs and options are the
//! same; a run that is cut off goes on where it was.

use super::all_table::{AllTable, COLUMNS, Line};
use super::contestant::Contestant;
use super::entry::base_settings;
use super::judge::Judge;
use super::options::ContestOptions;
use super::race::{Race, trouble_of, write_start};
use super::snapshot::{self, Snapshot};
use crate::error::{Error, ErrorKind, Place, Result};
use crate::light::blur::BANDS;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// A fit shows relightable maps once its error of training pictures is at most this times that of its end.
const FIRST_MAPS: f64 = 2.0;
/// Degrees by which lights are blurred: a texel of a usual fit, and a highlight or the edge of a shadow.
const LIGHT_BLURS: [f64; 2] = [BANDS[0], BANDS[1]];
/// Seed of every fit: the spread that counts is that of scenes.
const SEED: u64 = 1;

/// A scene of the folder.
#[derive(Clone, Debug, PartialEq)]
struct Entrant {
    name: String,
    folder: PathBuf,
    /// Whose pictures judge it: its own folder, or another's.
    judged_by: PathBuf,
}

/// Runs every method on every scene below `folder` and writes `all.md` and `all.csv`, anew after each fit.
///
/// # Errors
/// A folder without scenes, a scene without truth, an output folder that cannot be written; `Stopped` when `stop` is
/// raised. A method that cannot run is noted in the table.
pub fn run(folder: &Path, options: &ContestOptions, stop: &AtomicBool, tell: &dyn Fn(&str)) -> Result<AllTable> {
    let output = std::path::absolute(&options.output).unwrap_or_else(|_| options.output.clone());
    let options = &ContestOptions { output, ..options.clone() };
    std::fs::create_dir_all(&options.output).map_err(|source| Error::writing(&options.output, source))?;
    let entrants = entrants(folder)?;
    let mut table = AllTable::default();
    let mut methods = Vec::new();
    for &method in &options.methods {
        match trouble_of(method, options) {
            Some(why) => table.notes.push(format!("`{}` was left out: {why}.", method.name())),
            None if !methods.contains(&method) => methods.push(method),
            None => {}
        }
    }
    let program = fingerprint_of_file(&options.program, Fingerprint::default())?;
    let path = options.output.join("results.jsonl");
    let earlier = read_lines(&path);
    for entrant in &entrants {
        let inputs = fingerprint_of_inputs(entrant, program)?;
        for &method in &methods {
            let key = format!("{:016x}", asked(options, method, inputs).0);
            let line = match earlier.iter().find(|line| line.key == key) {
                Some(line) => line.clone(),
                None => {
                    tell(&format!("{}: {}", entrant.name, method.name()));
                    let line = one(entrant, method, key, options, stop, tell)?;
                    append(&path, &line)?;
                    line
                }
            };
            table.lines.push(line);
            table.write(&options.output)?;
        }
    }
    table.write(&options.output)?;
    Ok(table)
}

/// The exchange folders below a folder, by name.
fn entrants(folder: &Path) -> Result<Vec<Entrant>> {
    let listed = std::fs::read_dir(folder).map_err(|source| Error::reading(folder, source))?;
    let mut folders: Vec<PathBuf> = listed.filter_map(|entry| entry.ok().map(|entry| entry.path())).collect();
    folders.retain(|path| path.join("scene.json").is_file() && path.join("cameras.json").is_file());
    folders.sort();
    if folders.is_empty() {
        return Err(Error::new(ErrorKind::Missing, "there is no scene in the folder")
            .at(Place::File(folder.into()))
            .remedy("give a folder of exchange folders, such as tests/mitsuba/make_development_scenes.py writes"));
    }
    folders.into_iter().map(entrant).collect()
}

fn entrant(folder: PathBuf) -> Result<Entrant> {
    let path = folder.join("scene.json");
    let text = std::fs::read_to_string(&path).map_err(|source| Error::reading(&path, source))?;
    let facts: serde_json::Value = serde_json::from_str(&text).map_err(|error| {
        Error::new(ErrorKind::Malformed, format!("the description of the scene cannot be read: {error}"))
            .at(Place::Line(path, error.line().max(1)))
            .remedy("make the scene again")
    })?;
    let judged_by = facts.get("judged_by").and_then(|other| other.as_str());
    let judged_by = judged_by.map_or(folder.clone(), |other| folder.join(other));
    let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Ok(Entrant { name, folder: std::path::absolute(&folder).unwrap_or(folder), judged_by })
}

/// Fits and judges.
fn one(
    entrant: &Entrant,
    method: Contestant,
    key: String,
    options: &ContestOptions,
    stop: &AtomicBool,
    tell: &dyn Fn(&str),
) -> Result<Line> {
    let judge =
        Judge::new(crate::scene::read(&entrant.judged_by, &options.read)?, options.samples, options.most_views)?;
    let base = base_settings(judge.scene(), options.settings.as_deref(), SEED)?;
    let judge = judge.of_lobe(base.lobe);
    let place = options.output.join(&entrant.name);
    let start = write_start(judge.scene(), &base, &place)?;
    let place = place.join(method.name());
    let race = Race { options, scene: &entrant.folder, judge: &judge, start: &start, place: &place, seed: SEED };
    let trouble = race.fit(method, stop)?;
    if let Some(trouble) = &trouble {
        tell(&format!("{}: {} {trouble}", entrant.name, method.name()));
    }
    let snapshots = snapshot::list(&place)?;
    let mut line = Line {
        scene: entrant.name.clone(),
        twin_of: (entrant.judged_by != entrant.folder).then(|| name_of(&entrant.judged_by)),
        method: method.name().into(),
        key,
        trouble,
        scores: vec![None; COLUMNS.len()],
    };
    if let Some(last) = snapshots.last() {
        let scores = scores(&judge, &place, &snapshots, last, stop)?;
        line.scores = scores.into_iter().map(|score| score.is_finite().then_some(score)).collect();
    }
    Ok(line)
}

fn name_of(folder: &Path) -> String {
    let whole = folder.canonicalize().unwrap_or_else(|_| folder.into());
    whole.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// One a column of [`COLUMNS`].
fn scores(judge: &Judge, place: &Path, snapshots: &[Snapshot], last: &Snapshot, stop: &AtomicBool) -> Result<Vec<f64>> {
    let (maps, light) = last.read(place)?;
    let own = judge.scores(&maps, &light, last.non_finite, stop)?;
    let of_truth = match &judge.scene().truth {
        Some(truth) => judge.training_error(&truth.maps, &truth.environment, stop),
        None => f64::NAN,
    };
    let held = match snapshot::read_deviations(place)? {
        Some(deviations) => judge.intervals(&maps, &deviations)?,
        None => None,
    };
    let held = held.map_or([f64::NAN; 3], |held| [held.diffuse, held.specular, held.roughness]);
    let mut first = last.seconds;
    for snapshot in snapshots {
        let (maps, light) = snapshot.read(place)?;
        if judge.training_error(&maps, &light, stop) <= FIRST_MAPS * own[super::judge::IMAGE] {
            first = snapshot.seconds;
            break;
        }
    }
    let mut scores = vec![of_truth];
    // Image, held out, diffuse aligned, specular, roughness, light aligned.
    scores.extend([0, 2, 5, 6, 8, 11].map(|column| own[column]));
    for degrees in LIGHT_BLURS {
        scores.push(judge.light_error_blurred(&light, degrees)?);
    }
    // Brightest light, relit, relit aligned.
    scores.extend([14, 15, 16].map(|column| own[column]));
    scores.extend(held);
    scores.extend([first, last.seconds, last.cpu_seconds.unwrap_or(f64::NAN), own[17]]);
    Ok(scores)
}

/// FNV-1a (Fowler, Noll, Vo 1991), 64 bits: tells inputs apart, nothing more.
#[derive(Clone, Copy)]
struct Fingerprint(u64);

impl Default for Fingerprint {
    fn default() -> Self {
        Fingerprint(0xcbf2_9ce4_8422_2325)
    }
}

impl Fingerprint {
    fn with(self, bytes: &[u8]) -> Self {
        let step = |hash: u64, byte: &u8| (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3);
        // The length parts what is joined.
        Fingerprint(bytes.iter().chain(&bytes.len().to_le_bytes()).fold(self.0, step))
    }
}

fn fingerprint_of_file(path: &Path, before: Fingerprint) -> Result<Fingerprint> {
    std::fs::read(path).map(|bytes| before.with(&bytes)).map_err(|source| Error::reading(path, source))
}

/// Of all files of a scene and of the one that judges it, by name and content.
fn fingerprint_of_inputs(entrant: &Entrant, before: Fingerprint) -> Result<Fingerprint> {
    let mut result = before;
    for root in [&entrant.folder, &entrant.judged_by] {
        let mut folders = vec![root.clone()];
        let mut files = Vec::new();
        while let Some(folder) = folders.pop() {
            let listed = std::fs::read_dir(&folder).map_err(|source| Error::reading(&folder, source))?;
            for path in listed.filter_map(|entry| entry.ok().map(|entry| entry.path())) {
                if path.is_dir() { folders.push(path) } else { files.push(path) }
            }
        }
        files.sort();
        for file in files {
            let name = file.strip_prefix(root).unwrap_or(&file).to_string_lossy().into_owned();
            result = fingerprint_of_file(&file, result.with(name.as_bytes()))?;
        }
    }
    Ok(result)
}

/// Of what is asked beside the inputs.
fn asked(options: &ContestOptions, method: Contestant, inputs: Fingerprint) -> Fingerprint {
    let settings = options.settings.as_ref().and_then(|path| std::fs::read(path).ok()).unwrap_or_default();
    let text = format!(
        "{} {} {:?} {} {} {:?} {:?}",
        method.name(),
        options.seconds,
        options.due(),
        options.samples,
        options.most_views,
        options.threads,
        options.read
    );
    inputs.with(text.as_bytes()).with(&settings)
}

/// The lines of an earlier run; a last one that was cut off is no line.
fn read_lines(path: &Path) -> Vec<Line> {
    let text = std::fs::read_to_string(path).unwrap_or_default();
    let lines = text.lines().filter_map(|line| serde_json::from_str::<Line>(line).ok());
    lines.filter(|line| line.scores.len() == COLUMNS.len()).collect()
}

fn append(path: &Path, line: &Line) -> Result<()> {
    let mut text = std::fs::read_to_string(path).unwrap_or_default();
    if !text.is_empty() && !text.ends_with('\n') {
        text.push('\n');
    }
    text += &serde_json::to_string(line)
        .map_err(|error| Error::new(ErrorKind::Internal, format!("a result has no JSON: {error}")))?;
    text.push('\n');
    crate::files::write_bytes(path, text.as_bytes())
}

#[cfg(test)]
#[allow(clippy::disallowed_methods)]
mod tests {
    use super::*;

    #[test]
    fn scenes_are_found_by_name_and_a_twin_knows_its_judge() {
        let root = tempfile::tempdir().unwrap();
        for (name, facts) in [("b-srgb8", r#"{"judged_by": "../b"}"#), ("b", "{}"), ("sheets", "")] {
            let folder = root.path().join(name);
            std::fs::create_dir(&folder).unwrap();
            if !facts.is_empty() {
                std::fs::write(folder.join("scene.json"), facts).unwrap();
                std::fs::write(folder.join("cameras.json"), "{}").unwrap();
            }
        }
        let found = entrants(root.path()).unwrap();
        assert_eq!(found.iter().map(|one| one.name.as_str()).collect::<Vec<_>>(), ["b", "b-srgb8"]);
        assert_eq!(name_of(&found[1].judged_by), "b");
        assert!(entrants(&root.path().join("sheets")).is_err());
        // A photo that changes is another input.
        let before = fingerprint_of_inputs(&found[0], Fingerprint::default()).unwrap();
        std::fs::write(root.path().join("b/0.exr"), "1").unwrap();
        assert!(fingerprint_of_inputs(&found[0], Fingerprint::default()).unwrap().0 != before.0);
    }

    #[test]
    fn results_are_read_back_and_a_torn_line_is_none() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("results.jsonl");
        let line = Line { scene: "a".into(), scores: vec![Some(0.5); COLUMNS.len()], ..Default::default() };
        append(&path, &line).unwrap();
        std::fs::write(&path, std::fs::read_to_string(&path).unwrap() + "{\"scene\": \"b").unwrap();
        assert_eq!(read_lines(&path), std::slice::from_ref(&line));
        append(&path, &line).unwrap();
        assert_eq!(read_lines(&path).len(), 2);
    }
}
