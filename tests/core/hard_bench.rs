//! `patina bench hard`: every case ends with finite errors or a located error, and what is broken shows.

#![allow(clippy::unwrap_used)]

use patina::lab::contest::Contestant;
use patina::lab::hard::{HardOptions, HardTable, run};
use patina::lab::scenes::hard::HardCase;
use std::sync::atomic::AtomicBool;

fn table(cases: &[HardCase], quick: bool) -> HardTable {
    let folder = tempfile::tempdir().unwrap();
    let options = HardOptions {
        methods: vec![Contestant::Adam, Contestant::Solver],
        cases: cases.to_vec(),
        quick,
        seed: 1,
        output: folder.path().into(),
    };
    let table = run(&options, &AtomicBool::new(false), &|text| println!("{text}")).unwrap();
    let text = std::fs::read_to_string(folder.path().join("hard.md")).unwrap();
    assert_eq!(text, table.to_markdown());
    let csv = std::fs::read_to_string(folder.path().join("hard.csv")).unwrap();
    assert_eq!(csv.lines().count(), 1 + table.rows.len());
    table
}

fn assert_sound(table: &HardTable, cases: usize) {
    assert!(table.rows.iter().filter(|row| row.method == "adam").count() == cases);
    assert!(table.rows.len() == 2 * cases || table.notes.iter().any(|note| note.contains("solver")));
    for row in &table.rows {
        assert!(row.scores[0].is_finite() && row.scores[5].is_finite(), "{row:?}");
        assert_eq!(row.non_finite, 0, "{row:?}");
        assert_eq!(row.intervals.is_some(), row.method == "solver", "{row:?}");
    }
}

#[test]
fn some_hard_cases_end_with_sound_rows() {
    let cases = [HardCase::Plain, HardCase::Sun, HardCase::Ggx, HardCase::Missing];
    let table = table(&cases, true);
    assert_sound(&table, cases.len());
    let near = table.rows.iter().find(|row| row.case == "missing").unwrap().near_and_far.unwrap();
    assert!(near.iter().all(|error| error.is_finite()));
    assert!(table.rows.iter().find(|row| row.case == "plain").unwrap().near_and_far.is_none());
}
