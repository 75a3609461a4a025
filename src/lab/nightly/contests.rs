//! Contests by processes: what they leave, and whether Mitsuba takes part.

use super::Outcome;
use crate::error::{Error, Result};
use crate::lab::contest::{self, ContestOptions, Contestant};
use crate::scene::ReadSettings;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

fn options(folder: &Path, methods: &[Contestant], seconds: f64, python: PathBuf) -> Result<ContestOptions> {
    Ok(ContestOptions {
        scenes: Vec::new(),
        read: ReadSettings::default(),
        methods: methods.to_vec(),
        seconds,
        at: vec![seconds / 3.0],
        seeds: 1,
        quick: true,
        reuse: false,
        threads: None,
        samples: 8,
        most_views: 3,
        settings: None,
        program: std::env::current_exe().map_err(|source| Error::reading("patina-lab".as_ref(), source))?,
        python,
        scripts: "tests/mitsuba".into(),
        output: folder.into(),
    })
}

/// Lines of a CSV file as pairs of heading and field.
fn lines(path: &Path) -> Result<Vec<Vec<(String, String)>>> {
    let text = std::fs::read_to_string(path).map_err(|source| Error::reading(path, source))?;
    let mut lines = text.lines().map(|line| line.split(',').map(str::to_string).collect::<Vec<_>>());
    let headings = lines.next().unwrap_or_default();
    Ok(lines.map(|fields| headings.iter().cloned().zip(fields).collect()).collect())
}

fn field<'a>(line: &'a [(String, String)], name: &str) -> &'a str {
    line.iter().find(|(heading, _)| heading == name).map_or("", |(_, value)| value)
}

fn number(line: &[(String, String)], name: &str) -> f64 {
    field(line, name).parse().unwrap_or(f64::NAN)
}

/// A contest in which one method cannot run leaves tables and plots, says who could not run, and the truth is better than
/// the start in every score.
pub fn without_mitsuba(folder: &Path, stop: &AtomicBool) -> Result<Outcome> {
    let asked = options(folder, &[Contestant::Adam, Contestant::Mitsuba], 6.0, "no-such-python".into())?;
    let text = contest::run(&asked, stop, &|_| {})?.to_markdown();
    let mut short = Vec::new();
    if !text.contains("`mitsuba` was left out") || !text.contains("no-such-python") {
        short.push("who could not run is not told".to_string());
    }
    let lines = lines(&folder.join("contest.csv"))?;
    let of = |method: &str| lines.iter().filter(|line| field(line, "method") == method).collect::<Vec<_>>();
    let (truth, start, adam) = (of("truth"), of("start"), of("adam"));
    let (Some(truth), Some(start), Some(end)) = (truth.first(), start.first(), adam.last()) else {
        return Ok(Outcome::FallsShort("truth, start or fit are not in the table".into()));
    };
    for score in ["image", "held_out", "relit_aligned", "light_rel_L2"] {
        if !(number(truth, score) < 0.6 * number(start, score)) {
            short.push(format!("{score}: truth {}, start {}", field(truth, score), field(start, score)));
        }
    }
    // On an idle machine enough steps are done to fit the noise of so small photos: those that took no part judge.
    let is_between =
        number(end, "image") < number(start, "image") && number(end, "held_out") > number(truth, "held_out");
    if !is_between || number(truth, "diffuse") != 0.0 {
        let of = |line| format!("{}, held out {}", field(line, "image"), field(line, "held_out"));
        short.push(format!("the fit ends at {}; truth {}, start {}", of(end), of(truth), of(start)));
    }
    for file in ["contest-demo.svg", "contest-demo.csv", "demo/adam-1/snapshots.jsonl", "demo/start/env.exr"] {
        if !folder.join(file).is_file() {
            short.push(format!("{file} is missing"));
        }
    }
    Ok(match short.is_empty() {
        true => Outcome::Holds(format!("picture error {} at the end", field(end, "image"))),
        false => Outcome::FallsShort(short.join("; ")),
    })
}

/// Mitsuba, by the Python that `PATINA_MITSUBA_PYTHON` names, comes nearer to the photos within 25 seconds.
pub fn with_mitsuba(folder: &Path, stop: &AtomicBool) -> Result<Outcome> {
    let Some(python) = std::env::var_os("PATINA_MITSUBA_PYTHON") else {
        return Ok(Outcome::LeftOut("PATINA_MITSUBA_PYTHON names no Python with Mitsuba".into()));
    };
    contest::run(&options(folder, &[Contestant::Mitsuba], 25.0, python.into())?, stop, &|_| {})?;
    let lines = lines(&folder.join("contest.csv"))?;
    let last = |method: &str| lines.iter().rfind(|line| field(line, "method") == method);
    let (Some(start), Some(end)) = (last("start"), last("mitsuba")) else {
        return Ok(Outcome::FallsShort("it is not in the table".into()));
    };
    let text = format!("picture error {} from {}", field(end, "image"), field(start, "image"));
    let is_nearer = number(end, "image") < 0.7 * number(start, "image") && number(end, "step") > 5.0;
    Ok(if is_nearer { Outcome::Holds(text) } else { Outcome::FallsShort(text) })
}
