//! What takes too long to be asked on every change: `patina-lab nightly`.
//!
//! A [`Check`] fits, measures, and says a figure; where it falls short of what the program promises it says by how much.
//! One that lacks an input it needs is told as left out, never as passed. [`captures`] fits spoiled captures,
//! [`contests`] starts processes as `patina-lab bench fit` does, [`slow_tests`] runs what `cargo test` leaves out, [`tools`] asks
//! other tools.

mod captures;
mod contests;
mod slow_tests;
mod tools;

use crate::error::{Error, ErrorKind, Result};
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// What came of a check.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// It holds, with the figures that say so.
    Holds(String),
    /// It falls short, with the figures that say by how much.
    FallsShort(String),
    /// It could not be asked, and why.
    LeftOut(String),
}

/// A check by its name on the command line.
pub struct Check {
    /// The name.
    pub name: &'static str,
    /// What it asks, in a line.
    pub about: &'static str,
    run: fn(&Path, &AtomicBool) -> Result<Outcome>,
}

/// All checks, the quick ones first.
pub const CHECKS: [Check; 8] = [
    Check {
        name: "contest",
        about: "a contest leaves tables and says who could not run",
        run: contests::without_mitsuba,
    },
    Check {
        name: "hard-cases",
        about: "every hard case ends with finite errors or a located one",
        run: captures::every_case_is_sound,
    },
    Check {
        name: "spoiled-captures",
        about: "fits to spoiled captures tell what is wrong",
        run: captures::defects_are_told,
    },
    Check { name: "lobe-tails", about: "lobes with tails are told, over seeds", run: captures::tails_are_told },
    Check { name: "slow-tests", about: "every test marked as slow passes", run: slow_tests::pass },
    Check { name: "readers", about: "what other tools write is read as they read it", run: tools::readers_agree },
    Check {
        name: "pipelines",
        about: "the workflow for many captures goes on after kills",
        run: tools::workflow_goes_on,
    },
    Check { name: "mitsuba", about: "Mitsuba takes part in a contest", run: contests::with_mitsuba },
];

/// Runs the checks of these names, all when there is none, each in a folder of its own under `output`. `tell` hears a
/// line for each.
///
/// # Errors
/// A name that is not known; `Stopped`; after all were run, `Numerical` with the names of those that fell short.
pub fn run(names: &[String], output: &Path, stop: &AtomicBool, tell: &dyn Fn(&str)) -> Result<()> {
    if let Some(unknown) = names.iter().find(|name| CHECKS.iter().all(|check| check.name != **name)) {
        let known: Vec<&str> = CHECKS.iter().map(|check| check.name).collect();
        return Err(Error::new(ErrorKind::InvalidSetting, format!("no check is called {unknown}"))
            .remedy(format!("there are {}", known.join(", "))));
    }
    let mut short = Vec::new();
    let mut count = 0;
    for check in CHECKS.iter().filter(|check| names.is_empty() || names.iter().any(|name| name == check.name)) {
        let folder = output.join(check.name);
        std::fs::create_dir_all(&folder).map_err(|source| Error::writing(&folder, source))?;
        let began = Instant::now();
        let outcome = match (check.run)(&folder, stop) {
            Err(error) if error.kind() == ErrorKind::Stopped => return Err(error),
            Err(error) => Outcome::FallsShort(error.to_string()),
            Ok(outcome) => outcome,
        };
        let (word, text) = match &outcome {
            Outcome::Holds(text) => ("holds", text),
            Outcome::FallsShort(text) => ("FALLS SHORT", text),
            Outcome::LeftOut(text) => ("left out", text),
        };
        count += usize::from(!matches!(outcome, Outcome::LeftOut(_)));
        tell(&format!("{word}: {} ({}), {:.0} s: {text}", check.name, check.about, began.elapsed().as_secs_f64()));
        if matches!(outcome, Outcome::FallsShort(_)) {
            short.push(check.name);
        }
    }
    tell(&format!("{} of {count} checks hold", count - short.len()));
    if short.is_empty() {
        return Ok(());
    }
    Err(Error::new(ErrorKind::Numerical, format!("{} fell short", short.join(", ")))
        .remedy("the lines above say by how much"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_checks_are_asked_for_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let error = run(&["no-such".into()], folder.path(), &AtomicBool::new(false), &|_| {}).unwrap_err();
        assert!(error.remedy_text().contains("spoiled-captures"), "{error}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
