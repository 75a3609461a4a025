//! The results file of a study: JSON lines, appended case by case.

use super::line::{CaseLine, Line, PlanLine, part_of};
use crate::error::{Error, ErrorKind, Place, Result};
use std::collections::BTreeMap;
use std::fs::OpenOptions;
use std::io::Write;
use std::path::{Path, PathBuf};

/// The lines of a results file, and where more of them go.
#[derive(Clone, Debug)]
pub struct Results {
    path: PathBuf,
    lines: Vec<CaseLine>,
    plan: BTreeMap<String, usize>,
    /// Bytes up to the end of the last whole line: what lies behind is of a sitting that was killed while it wrote.
    whole: u64,
    /// Whether the last whole line still lacks its end.
    lacks_end: bool,
}

impl Results {
    /// Reads a results file; one that is not there is empty. A last line that was cut short is left out.
    ///
    /// # Errors
    /// `Malformed` with the line for any other that is none.
    pub fn read(path: &Path) -> Result<Self> {
        let mut own =
            Results { path: path.into(), lines: Vec::new(), plan: BTreeMap::new(), whole: 0, lacks_end: false };
        if !path.exists() {
            return Ok(own);
        }
        let bytes = std::fs::read(path).map_err(|source| Error::reading(path, source))?;
        for (index, bytes) in bytes.split_inclusive(|byte| *byte == b'\n').enumerate() {
            let text = String::from_utf8_lossy(bytes);
            let has_end = text.ends_with('\n');
            match serde_json::from_str::<Line>(text.trim()) {
                _ if text.trim().is_empty() => {}
                Ok(Line::Case(line)) => own.lines.push(line),
                Ok(Line::Plan(line)) => own.plan.extend(line.plan),
                Err(_) if !has_end => break,
                Err(source) => {
                    return Err(Error::new(ErrorKind::Malformed, format!("this is no line of a study: {source}"))
                        .at(Place::Line(path.into(), index + 1))
                        .remedy("delete the line: its case is then done again"));
                }
            }
            own.whole += bytes.len() as u64;
            own.lacks_end = !has_end;
        }
        Ok(own)
    }

    /// All lines, void ones among them.
    pub fn lines(&self) -> &[CaseLine] {
        &self.lines
    }

    /// The last line of each case that a version of the method made, in the order of the file.
    pub fn valid(&self, version: u32) -> Vec<&CaseLine> {
        let mut kept: Vec<&CaseLine> = Vec::new();
        for line in self.lines.iter().filter(|line| line.version == version) {
            kept.retain(|own| own.case != line.case || own.inputs != line.inputs);
            kept.push(line);
        }
        kept
    }

    /// Parts with the cases that are done by this version, and how many there are in all.
    pub fn shares(&self, version: u32) -> Vec<(String, usize, usize)> {
        let lines = self.valid(version);
        let done = |part: &str| lines.iter().filter(|line| part_of(&line.case) == part).count();
        self.plan.iter().map(|(part, &planned)| (part.clone(), done(part), planned)).collect()
    }

    /// Appends a case.
    ///
    /// # Errors
    /// `Unwritable`; what stands there already is kept.
    pub fn append(&mut self, line: CaseLine) -> Result<()> {
        self.write(&Line::Case(line.clone()))?;
        self.lines.push(line);
        Ok(())
    }

    /// Writes down how many cases parts have, where the file does not say so yet.
    ///
    /// # Errors
    /// As [`Results::append`].
    pub fn plan(&mut self, plan: &BTreeMap<String, usize>) -> Result<()> {
        if plan.iter().all(|(part, count)| self.plan.get(part) == Some(count)) {
            return Ok(());
        }
        self.write(&Line::Plan(PlanLine { plan: plan.clone() }))?;
        self.plan.extend(plan.clone());
        Ok(())
    }

    fn write(&mut self, line: &Line) -> Result<()> {
        let text = serde_json::to_string(line)
            .map_err(|source| Error::new(ErrorKind::Internal, format!("a case cannot be written: {source}")))?;
        let text = format!("{}{text}\n", if self.lacks_end { "\n" } else { "" });
        self.append_text(&text).map_err(|source| Error::writing(&self.path, source))?;
        self.whole += text.len() as u64;
        self.lacks_end = false;
        Ok(())
    }

    fn append_text(&self, text: &str) -> std::io::Result<()> {
        if let Some(folder) = self.path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
            std::fs::create_dir_all(folder)?;
        }
        let mut file = OpenOptions::new().create(true).append(true).open(&self.path)?;
        // What a killed sitting left of its last line is cut off.
        if file.metadata()?.len() > self.whole {
            file.set_len(self.whole)?;
        }
        file.write_all(text.as_bytes())?;
        file.sync_data()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(case: &str, version: u32, error: f64) -> CaseLine {
        let figures = [("error".to_string(), Some(error))].into();
        CaseLine { case: case.into(), version, seed: 1, inputs: BTreeMap::new(), figures, failed: None, seconds: 0.5 }
    }

    #[test]
    fn lines_survive_their_file_and_older_versions_are_void() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("below/study.jsonl");
        let mut results = Results::read(&path).unwrap();
        results.plan(&[("fig3".to_string(), 4)].into()).unwrap();
        results.append(line("fig3/a", 1, 0.5)).unwrap();
        results.append(line("fig3/b", 1, f64::NAN)).unwrap();
        results.append(line("fig3/a", 2, 0.25)).unwrap();
        // A plan that says nothing new is not written again.
        let size = std::fs::metadata(&path).unwrap().len();
        results.plan(&[("fig3".to_string(), 4)].into()).unwrap();
        assert_eq!(std::fs::metadata(&path).unwrap().len(), size);

        let read = Results::read(&path).unwrap();
        assert_eq!(read.lines().len(), 3);
        let names = |version| read.valid(version).iter().map(|line| line.case.as_str()).collect::<Vec<_>>();
        assert_eq!((names(1), names(2), names(3)), (vec!["fig3/a", "fig3/b"], vec!["fig3/a"], vec![]));
        assert!(read.lines()[1].figure("error").is_nan() && read.lines()[0].figure("other").is_nan());
        assert_eq!(read.shares(2), [("fig3".to_string(), 1, 4)]);
    }

    #[test]
    fn a_last_line_that_was_cut_short_is_done_again_and_a_damaged_one_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("study.jsonl");
        let mut results = Results::read(&path).unwrap();
        for case in ["fig3/a", "fig3/b"] {
            results.append(line(case, 1, 0.5)).unwrap();
        }
        let bytes = std::fs::read(&path).unwrap();
        // Wherever the second line is cut, the first is read, and another goes to its place.
        let second = bytes.iter().position(|byte| *byte == b'\n').unwrap() + 1;
        for end in [second + 1, second + 20, bytes.len() - 2] {
            std::fs::write(&path, &bytes[..end]).unwrap();
            let mut results = Results::read(&path).unwrap();
            assert_eq!(results.lines().len(), 1, "cut at {end}");
            results.append(line("fig3/c", 1, 0.5)).unwrap();
            let cases: Vec<String> = Results::read(&path).unwrap().lines().iter().map(|own| own.case.clone()).collect();
            assert_eq!(cases, ["fig3/a", "fig3/c"]);
        }
        // A last line that lacks only its end is whole.
        std::fs::write(&path, &bytes[..bytes.len() - 1]).unwrap();
        let mut results = Results::read(&path).unwrap();
        results.append(line("fig3/c", 1, 0.5)).unwrap();
        assert_eq!(Results::read(&path).unwrap().lines().len(), 3);
        // Damage in the midst is nobody's interrupted line.
        std::fs::write(&path, [&bytes[..second - 4], b"\n", &bytes[second..]].concat()).unwrap();
        let error = Results::read(&path).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Malformed);
        assert!(error.to_string().contains("line 1") && error.remedy_text().contains("delete the line"), "{error}");
    }
}
