//! One sitting of a study: takes cases that are not done yet until the list, the budget or the patience ends.

use super::line::{CaseInputs, CaseLine};
use super::order::{StudyCase, interleaved};
use super::pattern::CasePattern;
use super::results::Results;
use crate::error::{Error, ErrorKind, Result};
use std::collections::{BTreeMap, HashSet};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// How a sitting goes about it.
pub struct Sitting<'a> {
    /// No case is begun after this long; all are without it.
    pub budget: Option<Duration>,
    /// Which cases are taken.
    pub pattern: CasePattern,
    /// Ends the sitting in the midst of a case.
    pub stop: &'a AtomicBool,
    /// Hears a line for each case.
    pub tell: &'a dyn Fn(&str),
}

/// What a sitting did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Cases that the pattern takes.
    pub taken: usize,
    /// Of these, done in earlier sittings.
    pub done_before: usize,
    /// Done in this one, failures among them.
    pub done_now: usize,
    /// Failed in this one.
    pub failed: usize,
}

impl Tally {
    /// Cases that are left for another sitting.
    pub fn left(&self) -> usize {
        self.taken - self.done_before - self.done_now
    }

    /// In a sentence.
    pub fn sentence(&self) -> String {
        let Tally { taken, done_before, done_now, failed } = *self;
        let left = match self.left() {
            0 => "none is left".to_string(),
            left => format!("{left} are left: the same command goes on"),
        };
        format!("{done_now} of {taken} cases done now ({failed} failed), {done_before} before; {left}")
    }
}

/// Measures of a case by name.
pub type Figures = Vec<(&'static str, f64)>;

impl Sitting<'_> {
    /// Does the cases that are not in `results` yet, by `version` of the method, in interleaved order. `work` is given the
    /// place of a case in `cases` and returns its measures; a case that fails is a line, too.
    ///
    /// # Errors
    /// `InvalidSetting` for a pattern that takes no case, `Stopped`, a results file that cannot be written.
    pub fn run(
        &self,
        results: &mut Results,
        version: u32,
        cases: &[StudyCase],
        work: &mut dyn FnMut(usize) -> Result<Figures>,
    ) -> Result<Tally> {
        let began = Instant::now();
        let mut plan: BTreeMap<String, usize> = BTreeMap::new();
        cases.iter().for_each(|case| *plan.entry(case.part().to_string()).or_default() += 1);
        let order: Vec<usize> =
            interleaved(cases).into_iter().filter(|&place| self.pattern.takes(&cases[place].key)).collect();
        if order.is_empty() {
            let example = cases.first().map_or("there is none at all", |case| case.key.as_str());
            return Err(Error::new(ErrorKind::InvalidSetting, "no case of the study has such a name")
                .at(crate::error::Place::Setting("cases".into()))
                .remedy(format!("names of cases are such as `{example}`")));
        }
        results.plan(&plan)?;
        let done: HashSet<(String, CaseInputs)> =
            results.valid(version).into_iter().map(|line| (line.case.clone(), line.inputs.clone())).collect();
        let mut tally = Tally { taken: order.len(), ..Tally::default() };
        let missing: Vec<usize> = order
            .into_iter()
            .filter(|&place| !done.contains(&(cases[place].key.clone(), cases[place].inputs.clone())))
            .collect();
        tally.done_before = tally.taken - missing.len();
        for place in missing {
            if self.stop.load(Ordering::Relaxed) {
                return Err(stopped());
            }
            if self.budget.is_some_and(|budget| began.elapsed() >= budget) {
                break;
            }
            let case = &cases[place];
            let case_began = Instant::now();
            let (figures, failed) = match work(place) {
                Ok(figures) => (figures, None),
                Err(error) if error.kind() == ErrorKind::Stopped => return Err(stopped()),
                Err(error) => (Vec::new(), Some(error.to_string())),
            };
            let line = CaseLine {
                case: case.key.clone(),
                version,
                seed: case.seed,
                inputs: case.inputs.clone(),
                figures: figures
                    .iter()
                    .map(|&(name, value)| (name.into(), Some(value).filter(|v| v.is_finite())))
                    .collect(),
                failed,
                seconds: (1e3 * case_began.elapsed().as_secs_f64()).round() / 1e3,
            };
            tally.done_now += 1;
            tally.failed += usize::from(line.failed.is_some());
            (self.tell)(&told(&line, &figures, tally));
            results.append(line)?;
        }
        (self.tell)(&tally.sentence());
        Ok(tally)
    }
}

fn stopped() -> Error {
    Error::new(ErrorKind::Stopped, "the study was stopped").remedy("the same command goes on where it was")
}

fn told(line: &CaseLine, figures: &Figures, tally: Tally) -> String {
    let what = match &line.failed {
        Some(error) => format!("failed: {error}"),
        None => {
            let finite = figures.iter().filter(|(_, value)| value.is_finite());
            finite.map(|(name, value)| format!("{name} {value:.3}")).collect::<Vec<_>>().join("  ")
        }
    };
    format!("{} of {}  {}  {:.1} s  {what}", tally.done_before + tally.done_now, tally.taken, line.case, line.seconds)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::RefCell;
    use std::path::Path;

    fn cases() -> Vec<StudyCase> {
        let case = |number: usize| StudyCase::new(format!("fig{}/case {number}", number % 2), format!("{number}"), 7);
        (0..10).map(case).collect()
    }

    /// A sitting over the ten cases; returns its outcome and the names of what was done.
    fn sit(path: &Path, version: u32, sitting: &Sitting, cases: &[StudyCase]) -> (Result<Tally>, Vec<String>) {
        let done = RefCell::new(Vec::new());
        let mut work = |place: usize| {
            done.borrow_mut().push(cases[place].key.clone());
            if cases[place].key.ends_with("case 3") {
                return Err(Error::new(ErrorKind::Numerical, "no light explains it"));
            }
            Ok(vec![("error", place as f64), ("missing", f64::NAN)])
        };
        let outcome = sitting.run(&mut Results::read(path).unwrap(), version, cases, &mut work);
        (outcome, done.into_inner())
    }

    fn sitting<'a>(stop: &'a AtomicBool, budget: Option<f64>, pattern: &str) -> Sitting<'a> {
        let pattern = if pattern.is_empty() { CasePattern::default() } else { pattern.parse().unwrap() };
        Sitting { budget: budget.map(Duration::from_secs_f64), pattern, stop, tell: &|_| {} }
    }

    #[test]
    fn sittings_add_up_to_the_whole_and_do_nothing_twice() {
        let folder = tempfile::tempdir().unwrap();
        let (stop, all) = (AtomicBool::new(false), cases());
        let whole = folder.path().join("whole.jsonl");
        let (outcome, order) = sit(&whole, 1, &sitting(&stop, None, ""), &all);
        assert_eq!(outcome.unwrap(), Tally { taken: 10, done_before: 0, done_now: 10, failed: 1 });

        let parts = folder.path().join("parts.jsonl");
        // No time at all: ends in good order, with nothing done.
        let (outcome, done) = sit(&parts, 1, &sitting(&stop, Some(0.0), ""), &all);
        assert_eq!((outcome.unwrap().left(), done.len()), (10, 0));
        let (_, first) = sit(&parts, 1, &sitting(&stop, None, "fig0"), &all);
        assert!(first.len() == 5 && first.iter().all(|case| case.starts_with("fig0")));
        let (outcome, rest) = sit(&parts, 1, &sitting(&stop, None, ""), &all);
        assert_eq!(outcome.unwrap(), Tally { taken: 10, done_before: 5, done_now: 5, failed: 1 });
        assert!(rest.iter().all(|case| case.starts_with("fig1")));
        // The failure is a result: it is not done again either.
        let (_, none) = sit(&parts, 1, &sitting(&stop, None, ""), &all);
        assert_eq!(none, [""; 0]);

        let lines = |path: &Path| {
            let mut lines: Vec<CaseLine> = Results::read(path).unwrap().lines().to_vec();
            lines.iter_mut().for_each(|line| line.seconds = 0.0);
            lines
        };
        assert_eq!(lines(&whole).iter().map(|line| line.case.clone()).collect::<Vec<_>>(), order);
        let mut sorted = [lines(&whole), lines(&parts)];
        sorted.iter_mut().for_each(|lines| lines.sort_by(|a, b| a.case.cmp(&b.case)));
        assert_eq!(sorted[0], sorted[1]);
        let failed = sorted[0].iter().find(|line| line.failed.is_some()).unwrap();
        assert!(failed.case.ends_with("case 3") && failed.figure("error").is_nan());
        assert_eq!(Results::read(&whole).unwrap().shares(1), [("fig0".into(), 5, 5), ("fig1".into(), 5, 5)]);
    }

    #[test]
    fn a_new_version_other_inputs_and_a_cut_line_are_done_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("study.jsonl");
        let (stop, mut all) = (AtomicBool::new(false), cases());
        sit(&path, 1, &sitting(&stop, None, ""), &all).0.unwrap();
        assert_eq!(sit(&path, 2, &sitting(&stop, None, ""), &all).1.len(), 10);
        all[4].inputs.insert("weights".into(), "others".into());
        assert_eq!(sit(&path, 2, &sitting(&stop, None, ""), &all).1, ["fig0/case 4"]);
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() - 9]).unwrap();
        assert_eq!(sit(&path, 2, &sitting(&stop, None, ""), &all).1, ["fig0/case 4"]);
    }

    #[test]
    fn a_stop_leaves_no_line_and_a_pattern_without_cases_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("study.jsonl");
        let (stop, all) = (AtomicBool::new(false), cases());
        let mut count = 0;
        let mut work = |_| {
            count += 1;
            if count < 3 { Ok(vec![("error", 1.0)]) } else { Err(Error::new(ErrorKind::Stopped, "stopped")) }
        };
        let mut results = Results::read(&path).unwrap();
        let error = sitting(&stop, None, "").run(&mut results, 1, &all, &mut work).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Stopped);
        assert_eq!(Results::read(&path).unwrap().lines().len(), 2);
        let error = sit(&path, 1, &sitting(&stop, None, "fig9"), &all).0.unwrap_err();
        assert!(error.remedy_text().contains("fig0/case 0"), "{error}");
    }
}
