//! What a run of the workflow left behind, and whether it is what the guide promises.

use super::sitting::Ended;
use super::{BROKEN, BROKEN_PHOTO, FAILS_ONCE, KILLED};
use crate::lab::bar_table::BarRow;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// Stages of a capture, in their order.
const STAGES: [&str; 4] = ["check", "fit", "relight", "score"];

fn row(name: &str, seen: String, holds: bool) -> BarRow {
    let shortfall = (!holds).then(|| seen.replace('\n', " "));
    BarRow { name: name.into(), figures: vec![seen.replace('\n', " ")], shortfall }
}

fn read(path: &Path) -> String {
    std::fs::read(path).map_or_else(|_| String::new(), |bytes| String::from_utf8_lossy(&bytes).into_owned())
}

/// What a stage of a capture wrote down; `Null` where it did not.
fn stage(results: &Path, capture: &str, stage: &str) -> Value {
    serde_json::from_str(&read(&results.join(capture).join(format!("{stage}.json")))).unwrap_or_default()
}

/// Events of a log, by a key.
fn events(log: &Path, kind: &str) -> Vec<Value> {
    let text = read(log);
    let parsed = text.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
    parsed.filter(|event| event["event"] == kind).collect()
}

/// Steps that a fit has told of in its log.
pub fn steps_in(log: &Path) -> usize {
    events(log, "progress").len()
}

/// Whether a fit said that it ended early, its checkpoint written.
pub fn has_stopped(log: &Path) -> bool {
    !events(log, "stopped").is_empty()
}

/// Results that stand, with the time they were written.
#[derive(Clone, Debug, Default)]
pub struct Files {
    of_stages: BTreeMap<PathBuf, Option<SystemTime>>,
}

impl Files {
    /// What stages have written under a folder of results, and the table and the page.
    pub fn under(results: &Path) -> Self {
        let of_captures = [KILLED, FAILS_ONCE, BROKEN]
            .iter()
            .flat_map(|capture| STAGES.iter().map(move |stage| results.join(capture).join(format!("{stage}.json"))));
        let whole = ["table.csv", "index.html"].iter().map(|name| results.join(name));
        let paths = of_captures.chain(whole).filter(|path| path.is_file());
        Files { of_stages: paths.map(|path| (path.clone(), written(&path))).collect() }
    }
}

fn written(path: &Path) -> Option<SystemTime> {
    std::fs::metadata(path).and_then(|metadata| metadata.modified()).ok()
}

/// A sitting that ended well.
pub fn ended(name: &str, ended: &Ended) -> BarRow {
    let Ended { status, seconds, said } = ended;
    match status.success() {
        true => row(name, format!("ended well after {seconds:.0} s"), true),
        false => row(name, format!("{status}: {said}"), false),
    }
}

/// Stages that had ended were not run again.
pub fn untouched(when: &str, before: &Files, results: &Path) -> BarRow {
    let again: Vec<String> = before
        .of_stages
        .iter()
        .filter(|(path, time)| written(path) != **time)
        .map(|(path, _)| path.strip_prefix(results).unwrap_or(path).display().to_string())
        .collect();
    let seen = match again.is_empty() {
        true => format!("{} results stand as they stood", before.of_stages.len()),
        false => format!("written again: {}", again.join(", ")),
    };
    row(&format!("{when}, what had ended is not run again"), seen, again.is_empty() && !before.of_stages.is_empty())
}

/// The fit that was told to end went on from where it was.
pub fn resumed(log: &Path, steps_at_end: usize) -> BarRow {
    let started = events(log, "started");
    let number = |key: &str| started.last().and_then(|event| event[key].as_u64()).unwrap_or(0);
    let (done, total) = (number("steps_done"), number("steps_total"));
    let ended = !events(log, "finished").is_empty();
    let seen = format!("told to end after about {steps_at_end} steps, went on at step {done} of {total}");
    row(
        "a fit that was told to end resumes",
        seen,
        ended && 0 < done && done < total && done + 1 >= steps_at_end as u64,
    )
}

/// What failed once was tried again, and nothing else was.
pub fn retried(results: &Path) -> BarRow {
    let attempts = |capture: &str, of: &str| stage(results, capture, of)["attempt"].as_u64().unwrap_or(0);
    let (again, once) = (attempts(FAILS_ONCE, "relight"), attempts(KILLED, "relight"));
    let done = stage(results, FAILS_ONCE, "relight")["status"] == "done";
    let seen = format!("a relight that failed once took {again} attempts, another {once}");
    row("what failed once is tried again", seen, done && again == 2 && once == 1)
}

/// The broken capture is written down as failed, with the file and what to do about it; stages behind are skipped.
pub fn broken(results: &Path) -> BarRow {
    let check = stage(results, BROKEN, "check");
    let text = |key: &str| check[key].as_str().unwrap_or_default().to_string();
    let others: Vec<String> = STAGES[1..]
        .iter()
        .map(|of| stage(results, BROKEN, of)["status"].as_str().unwrap_or("nothing").to_string())
        .collect();
    let seen = format!(
        "check {} after {} attempts: {} ({}); behind it {}",
        text("status"),
        check["attempt"],
        text("message"),
        text("remedy"),
        others.join(", ")
    );
    let holds = text("status") == "failed"
        && check["attempt"] == 2
        && text("message").contains(BROKEN_PHOTO)
        && !text("remedy").is_empty()
        && others.iter().all(|status| status == "skipped");
    row("a broken capture is written down", seen, holds)
}

/// One table with a line for each capture.
pub fn table(results: &Path) -> BarRow {
    let text = read(&results.join("table.csv"));
    let mut lines = text.lines();
    let headings: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    let held_out = headings.iter().position(|heading| heading.contains("held-out PSNR"));
    // Only the last column, the message, may hold commas.
    let found: BTreeMap<&str, (&str, bool)> = lines
        .map(|line| {
            let fields: Vec<&str> = line.split(',').collect();
            let field = |index: usize| fields.get(index).copied().unwrap_or_default();
            (field(0), (field(1), held_out.is_some_and(|index| field(index).parse::<f64>().is_ok())))
        })
        .collect();
    let expected =
        BTreeMap::from([(KILLED, ("done", true)), (FAILS_ONCE, ("done", true)), (BROKEN, ("check failed", false))]);
    let seen: Vec<String> = found.iter().map(|(name, (status, _))| format!("{name}: {status}")).collect();
    let scored = found.values().filter(|(_, scored)| *scored).count();
    row("one table", format!("{}; {scored} with scores", seen.join(", ")), found == expected)
}

/// One page with thumbnails of every capture that is done.
pub fn page(results: &Path) -> BarRow {
    let text = read(&results.join("index.html"));
    let values = |opening: &str| -> Vec<String> {
        text.split(opening).skip(1).filter_map(|rest| Some(rest.split_once('"')?.0.to_string())).collect()
    };
    let pictures = values("src=\"");
    let there = pictures.iter().filter(|picture| results.join(picture).is_file()).count();
    let of = |capture: &str| pictures.iter().filter(|picture| picture.starts_with(&format!("{capture}/"))).count();
    let sections = values("<section class=\"");
    let done = sections.iter().filter(|class| *class == "done").count();
    let seen =
        format!("{} captures, {done} of them done, {there} of {} pictures there", sections.len(), pictures.len());
    let holds = sections.len() == 3
        && done == 2
        && there == pictures.len()
        && of(KILLED) > 0
        && of(FAILS_ONCE) > 0
        && read(&results.join("index.html")).contains(BROKEN);
    row("one page of thumbnails", seen, holds)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn write(results: &Path, capture: &str, name: &str, text: &str) {
        let path = results.join(capture).join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    }

    #[test]
    fn each_promise_of_the_guide_is_seen_to_be_kept_and_to_be_broken() {
        let folder = tempfile::tempdir().unwrap();
        let results = folder.path();
        let holds = |row: BarRow| row.shortfall.is_none();
        for row in [table(results), page(results), broken(results), retried(results)] {
            assert!(!holds(row.clone()), "nothing was done: {row:?}");
        }
        assert!(!holds(untouched("", &Files::under(results), results)), "nothing stood there");

        let log = results.join(KILLED).join("fit.log");
        let line = |event: Value| format!("{event}\n");
        let started = |done: usize| line(json!({"event": "started", "steps_done": done, "steps_total": 9}));
        let text = [started(6), line(json!({"event": "progress"})), line(json!({"event": "finished"}))].concat();
        write(results, KILLED, "fit.log", &text);
        assert!(holds(resumed(&log, 6)) && !holds(resumed(&log, 8)), "steps that were done are not done again");
        write(results, KILLED, "fit.log", &text.replace("\"steps_done\":6", "\"steps_done\":0"));
        assert!(!holds(resumed(&log, 0)), "a fit from its beginning is none that went on");

        let attempt = |count: usize| json!({"status": "done", "attempt": count}).to_string();
        write(results, KILLED, "relight.json", &attempt(1));
        write(results, FAILS_ONCE, "relight.json", &attempt(1));
        assert!(!holds(retried(results)));
        write(results, FAILS_ONCE, "relight.json", &attempt(2));
        assert!(holds(retried(results)));

        let failed =
            json!({"status": "failed", "attempt": 2, "message": "0000.exr: cut short", "remedy": "copy it again"});
        write(results, BROKEN, "check.json", &failed.to_string());
        for of in &STAGES[1..] {
            assert!(!holds(broken(results)));
            write(results, BROKEN, &format!("{of}.json"), "{\"status\": \"skipped\"}");
        }
        assert!(holds(broken(results)));

        let before = Files::under(results);
        assert!(holds(untouched("", &before, results)));
        std::fs::remove_file(results.join(KILLED).join("relight.json")).unwrap();
        assert!(!holds(untouched("", &before, results)), "what is gone does not stand");

        let rows = format!(
            "capture,status,held-out PSNR dB,message\n{BROKEN},check failed,,\"cut, short\"\n{FAILS_ONCE},done,20.1,\n"
        );
        write(results, "", "table.csv", &rows);
        assert!(!holds(table(results)), "a capture is missing");
        write(results, "", "table.csv", &format!("{rows}{KILLED},done,21.3,\n"));
        assert!(holds(table(results)));

        let section = |capture: &str, class: &str, picture: &str| {
            format!("<section class=\"{class}\"><h2>{capture}</h2><img src=\"{capture}/{picture}\"></section>")
        };
        let text = section(KILLED, "done", "a.png") + &section(FAILS_ONCE, "done", "a.png");
        write(results, KILLED, "a.png", "");
        write(results, "", "index.html", &format!("{text}<section class=\"failed\">{BROKEN}</section>"));
        assert!(!holds(page(results)), "a picture is missing");
        write(results, FAILS_ONCE, "a.png", "");
        assert!(holds(page(results)));
    }
}
