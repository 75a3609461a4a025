//! `patina bench fit`: processes are started, timed, judged and written down.

use std::collections::HashMap;
use std::path::Path;
use std::process::{Command, Output};

fn bench_fit(output: &Path, more: &[&str]) -> Output {
    let program = env!("CARGO_BIN_EXE_patina-lab");
    let common = ["bench", "fit", "--quick", "--samples", "8", "--most-views", "3", "--seeds", "1", "-o"];
    Command::new(program).args(common).arg(output).args(more).output().unwrap()
}

/// Lines of a CSV file by their headings.
fn lines(path: &Path) -> Vec<HashMap<String, String>> {
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines().map(|line| line.split(',').map(str::to_string).collect::<Vec<_>>());
    let headings = lines.next().unwrap();
    lines.map(|fields| headings.iter().cloned().zip(fields).collect()).collect()
}

fn number(line: &HashMap<String, String>, name: &str) -> f64 {
    line[name].parse().unwrap()
}

#[test]
fn a_short_contest_leaves_tables_plots_and_says_what_could_not_run() {
    let folder = tempfile::tempdir().unwrap();
    let output = bench_fit(
        folder.path(),
        &["--methods", "adam,mitsuba", "--seconds", "1.5", "--at", "0.5,1", "--python", "no-such-python"],
    );
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = std::fs::read_to_string(folder.path().join("contest.md")).unwrap();
    assert!(text.contains("`mitsuba` was left out") && text.contains("no-such-python"), "{text}");
    assert!(text.contains("adam, end") && text.contains("the truth itself"), "{text}");

    let lines = lines(&folder.path().join("contest.csv"));
    let of = |method: &str| lines.iter().filter(|line| line["method"] == method).collect::<Vec<_>>();
    let (truth, start, adam) = (of("truth")[0], of("start")[0], of("adam"));
    let end = adam.last().unwrap();
    assert_eq!(end["due"], "end");
    assert!(adam.windows(2).all(|pair| number(pair[0], "seconds") <= number(pair[1], "seconds")));
    for score in ["image", "held_out", "relit_aligned", "light_rel_L2"] {
        assert!(number(truth, score) < 0.6 * number(start, score), "{score}: {truth:?} against {start:?}");
    }
    // How far it comes in its seconds is no matter of a test.
    assert!(number(end, "image") > number(truth, "image") && number(end, "image").is_finite(), "{end:?}");
    assert_eq!((number(truth, "diffuse"), number(truth, "non_finite")), (0.0, 0.0));
    for file in ["contest-demo.svg", "contest-demo.csv", "demo/adam-1/snapshots.jsonl", "demo/start/env.exr"] {
        assert!(folder.path().join(file).is_file(), "{file}");
    }
}

#[test]
fn without_a_method_that_runs_the_tables_say_so() {
    let folder = tempfile::tempdir().unwrap();
    let output = bench_fit(folder.path(), &["--methods", "mitsuba", "--scripts", "no-such-folder", "--seconds", "1"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(text.contains("no-such-folder") && text.contains("start of all"), "{text}");
    let output = bench_fit(folder.path(), &["--seconds", "0"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("seconds"));
}

/// Needs a Python with Mitsuba, named by `PATINA_MITSUBA_PYTHON`.
#[test]
#[ignore = "slow"]
fn mitsuba_takes_part_where_it_is() {
    let Ok(python) = std::env::var("PATINA_MITSUBA_PYTHON") else {
        println!("skipped: a Python with Mitsuba is not present (PATINA_MITSUBA_PYTHON)");
        return;
    };
    let scripts = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/mitsuba");
    let folder = tempfile::tempdir().unwrap();
    let more = ["--methods", "mitsuba", "--seconds", "25", "--at", "5", "--python", &python, "--scripts", scripts];
    let output = bench_fit(folder.path(), &more);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let lines = lines(&folder.path().join("contest.csv"));
    let start = lines.iter().find(|line| line["method"] == "start").unwrap();
    let end = lines.iter().rfind(|line| line["method"] == "mitsuba").expect("it ran");
    assert!(number(end, "image") < 0.7 * number(start, "image"), "{end:?} against {start:?}");
    assert!(number(end, "seconds") >= 25.0 && number(end, "step") > 5.0, "{end:?}");
}
