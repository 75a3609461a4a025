//! What the window should keep to, beside what was measured of it: one line a figure.

use super::opening::MOST_SECONDS_AGAIN;
use super::report::BenchReport;
use super::{relight, stalls, starting};
use std::fmt::Write;

/// Seconds that a new environment should take; beyond [`relight::MOST_SECONDS`] the bench fails.
const NEW_ENVIRONMENT_SECONDS: f64 = 0.15;
/// Pictures a second of an environment that turns.
const TURNING_ENVIRONMENT: f64 = 10.0;
/// Seconds in which the cache of transport should be there.
const CACHE_SECONDS: f64 = 10.0;
/// Pictures a second while the eye turns, where the processors draw and with a graphics card.
const TURNING_EYE: [f64; 2] = [20.0, 60.0];
/// Seconds from a key to its answer.
const ANSWER_SECONDS: f64 = 0.1;
/// Share of its pace that a fit keeps under the window.
const PACE_KEPT: f64 = 0.95;

/// A figure and its bar.
#[derive(Clone, Debug, PartialEq)]
pub struct Bar {
    /// What is measured, in words.
    pub figure: String,
    /// On which scene.
    pub scene: String,
    /// In which unit.
    pub unit: &'static str,
    /// What was measured.
    pub value: f64,
    /// What it should be at most, or at least.
    pub limit: f64,
    /// Whether less is better.
    pub is_most: bool,
}

impl Bar {
    /// Whether it holds; a figure that is no number does not.
    pub fn holds(&self) -> bool {
        if self.is_most { self.value <= self.limit } else { self.value >= self.limit }
    }

    /// On which side of the limit the figure should be.
    pub fn sign(&self) -> &'static str {
        if self.is_most { "at most" } else { "at least" }
    }
}

impl BenchReport {
    /// Every figure that has a bar and was measured.
    pub fn bars(&self) -> Vec<Bar> {
        let mut bars = Vec::new();
        let mut bar = |figure: &str, scene: &str, unit: &'static str, value: f64, limit: f64, is_most: bool| {
            bars.push(Bar { figure: figure.into(), scene: scene.into(), unit, value, limit, is_most });
        };
        for row in self.opening.iter().filter(|row| row.is_again) {
            bar("from drop to ready, opened before", &row.scene, "s", row.ready, MOST_SECONDS_AGAIN, true);
        }
        for row in &self.starting {
            let scene = format!("{}{}", row.scene, if row.is_again { ", again" } else { "" });
            let between = starting::MOST_SECONDS_BETWEEN;
            bar("from Start to the first maps", &scene, "s", row.first_maps, between, true);
            bar("longest wait for newer maps", &scene, "s", row.longest_wait, between, true);
            let error = 100.0 * row.left_error_most;
            bar("time left, from a quarter on, off by", &scene, "%", error, 100.0 * starting::LARGEST_ERROR, true);
            bar("times that the bar went back", &scene, "", row.backwards as f64, 0.0, true);
        }
        for row in &self.stalls {
            let figure = format!("the window hears nobody, {}", row.case);
            bar(&figure, &row.scene, "ms", 1e3 * row.longest, 1e3 * stalls::MOST_SECONDS, true);
        }
        for row in &self.relight {
            let scene = format!("{}, {}", row.scene, row.light);
            let limit = 1e3 * NEW_ENVIRONMENT_SECONDS;
            bar("a new environment", &scene, "ms", 1e3 * row.light_seconds, limit, true);
            bar("the same, of a view that just came", &scene, "ms", 1e3 * row.first_light_seconds, limit, true);
            bar("an environment that turns", &scene, "1/s", row.turns_per_second, TURNING_ENVIRONMENT, false);
            let limit = 100.0 * relight::LARGEST_ERROR;
            bar("relit, against the path tracer", &scene, "%", 100.0 * row.relative_error, limit, true);
        }
        let cached = self.relight.chunk_by(|one, other| one.scene == other.scene).filter_map(|rows| rows.first());
        for row in cached {
            bar("cached transport", &row.scene, "s", row.cache_seconds, CACHE_SECONDS, true);
        }
        let least = TURNING_EYE[usize::from(!self.machine.is_software)];
        for row in self.frames.iter().filter(|row| row.case.ends_with("the eye turns")) {
            bar(&format!("pictures, {}", row.case), &row.scene, "1/s", row.frames_per_second, least, false);
        }
        for row in self.answers.iter().filter(|row| !row.act.ends_with("the fit at rest")) {
            bar(&format!("answer to {}", row.act), &row.scene, "ms", 1e3 * row.median, 1e3 * ANSWER_SECONDS, true);
        }
        for row in &self.slowdown {
            bar("pace that a fit keeps", &row.scene, "", row.ratio, PACE_KEPT, false);
        }
        bars
    }

    pub(super) fn bars_text(&self, text: &mut String) {
        let bars = self.bars();
        if bars.is_empty() {
            return;
        }
        text.push_str("## What the window should keep to\n\n| figure | scene | measured | bar | holds |\n");
        text.push_str("| --- | --- | ---: | ---: | --- |\n");
        for bar in &bars {
            let holds = if bar.holds() { "yes" } else { "**no**" };
            let value = short(bar.value);
            let Bar { figure, scene, unit, limit, .. } = bar;
            let _ = writeln!(text, "| {figure} | {scene} | {value} {unit} | {} {limit} {unit} | {holds} |", bar.sign());
        }
        let held = bars.iter().filter(|bar| bar.holds()).count();
        let _ = writeln!(text, "\n{held} of {} hold.\n", bars.len());
    }
}

fn short(value: f64) -> String {
    match value.abs() {
        size if !size.is_finite() => "–".into(),
        size if size >= 100.0 => format!("{value:.0}"),
        size if size >= 10.0 => format!("{value:.1}"),
        _ => format!("{value:.2}"),
    }
}

#[cfg(test)]
mod tests {
    use super::super::answers::AnswersRow;
    use super::super::frames::FramesRow;
    use super::super::opening::OpeningRow;
    use super::*;

    #[test]
    fn a_figure_beyond_its_bar_is_told_and_one_without_a_bar_is_not() {
        let mut report = BenchReport::default();
        assert!(report.bars().is_empty() && !report.to_markdown().contains("should keep to"));
        let opened = |is_again, ready| OpeningRow { scene: "toy".into(), is_again, ready, ..Default::default() };
        report.opening = vec![opened(false, 9.0), opened(true, 1.5)];
        report.answers.push(AnswersRow { act: "a key".into(), median: f64::NAN, ..Default::default() });
        let frames =
            |case: &str, frames_per_second| FramesRow { case: case.into(), frames_per_second, ..Default::default() };
        report.frames = vec![frames("no fit, nobody touches it", 1.0), frames("no fit, the eye turns", 30.0)];
        report.machine.is_software = true;
        let holds = |report: &BenchReport| report.bars().iter().map(Bar::holds).collect::<Vec<_>>();
        assert_eq!(holds(&report), [true, true, false], "{:?}", report.bars());
        report.machine.is_software = false;
        assert_eq!(holds(&report), [true, false, false], "a graphics card has to be quicker");
        let text = report.to_markdown();
        assert!(text.contains("| toy | 1.50 s | at most 2 s | yes |") && text.contains("1 of 3 hold"), "{text}");
        assert!(
            report.to_csv().contains("bar,\"toy\",\"from drop to ready, opened before\",at most,s,2\n"),
            "{}",
            report.to_csv()
        );
    }
}
