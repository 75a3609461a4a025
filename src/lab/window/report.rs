//! The figures as Markdown, CSV and JSON, each with what it means.

mod csv;

use super::answers::AnswersRow;
use super::equality::EqualityRow;
use super::frames::FramesRow;
use super::machine::Machine;
use super::memory::{MemoryRow, MemoryTrend};
use super::opening::OpeningRow;
use super::relight::RelightRow;
use super::slowdown::SlowdownRow;
use super::stalls::StallsRow;
use super::starting::StartingRow;
use crate::error::{Error, ErrorKind, Result};
use std::fmt::Write;
use std::path::Path;

/// Everything that was measured.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct BenchReport {
    /// On what.
    pub machine: Machine,
    /// From drop to ready.
    pub opening: Vec<OpeningRow>,
    /// From Start to the report.
    pub starting: Vec<StartingRow>,
    /// How long the window hears nobody.
    pub stalls: Vec<StallsRow>,
    /// Frames.
    pub frames: Vec<FramesRow>,
    /// Answers to acts, beside a running fit.
    pub answers: Vec<AnswersRow>,
    /// What the window takes from a fit.
    pub slowdown: Vec<SlowdownRow>,
    /// Memory after each cycle.
    pub memory: Vec<MemoryRow>,
    /// Its trend.
    pub memory_trend: Option<MemoryTrend>,
    /// Views relit from cached transport.
    pub relight: Vec<RelightRow>,
    /// Whether watching changes a fit.
    pub equality: Option<EqualityRow>,
}

/// One mebibyte.
const MIB: f64 = (1u64 << 20) as f64;

impl BenchReport {
    /// Tables with the meaning of each figure.
    pub fn to_markdown(&self) -> String {
        let mut text = String::from("# The window in figures\n\n");
        self.machine_text(&mut text);
        self.bars_text(&mut text);
        self.opening_text(&mut text);
        self.starting_text(&mut text);
        self.stalls_text(&mut text);
        self.frames_text(&mut text);
        self.answers_text(&mut text);
        self.slowdown_text(&mut text);
        self.memory_text(&mut text);
        self.relight_text(&mut text);
        if let Some(row) = &self.equality {
            let verdict = if row.different == 0 { "none differs" } else { "watching changed the fit: a defect" };
            let _ = writeln!(
                text,
                "## The same fit\n\nMaps and light of the {} after {} steps, fitted once without the window and once under it \
                 with keys pressed, paused and continued: {} numbers, {} differ in a bit ({verdict}).\n",
                row.scene, row.steps, row.numbers, row.different
            );
        }
        text
    }

    fn machine_text(&self, text: &mut String) {
        let Machine { processors, processor, adapter, window_pixels: [width, height], .. } = &self.machine;
        let adapter = if adapter.is_empty() { "nothing that draws in 3-D" } else { adapter };
        let kind = if self.machine.is_software { "software: the processors draw" } else { "a graphics card" };
        let _ = writeln!(
            text,
            "{processors} processors ({processor}), {adapter} ({kind}), window {width} x {height} pixels."
        );
        let known = |value: Option<f64>| value.map_or("unknown".into(), |value| format!("{value:.1}"));
        let others =
            self.machine.taken_by_others.map_or("an unknown share".into(), |share| format!("{:.0} %", 100.0 * share));
        let _ = writeln!(
            text,
            "Load {} before, {} after; other programs took {others} of the processors meanwhile.",
            known(self.machine.load_before),
            known(self.machine.load_after),
        );
        if !self.machine.is_optimised {
            text.push_str("This is a build with checks: figures are for looking, not for quoting.\n");
        }
        text.push('\n');
    }

    fn frames_text(&self, text: &mut String) {
        if self.frames.is_empty() {
            return;
        }
        text.push_str(
            "## Frames\n\n| scene | case | frames/s | between frames, median [ms] | 95 % [ms] | window's share [%] |\n",
        );
        text.push_str("| --- | --- | ---: | ---: | ---: | ---: |\n");
        for row in &self.frames {
            let share = row.window_share.map_or("–".into(), |share| format!("{:.1}", 100.0 * share));
            let _ = writeln!(
                text,
                "| {} | {} | {:.1} | {} | {} | {share} |",
                row.scene,
                row.case,
                row.frames_per_second,
                milliseconds(row.frame_seconds_median),
                milliseconds(row.frame_seconds_slow)
            );
        }
        text.push_str(
            "\nThe eye turns by a drag of the mouse that has a movement ready for every frame. The share is the time of all \
             threads but the fit's, of all processors; it holds drawing where the processors draw.\n\n",
        );
    }

    fn answers_text(&self, text: &mut String) {
        if self.answers.is_empty() {
            return;
        }
        text.push_str("## From an act to its answer, while a fit runs\n\n");
        text.push_str("| scene | act | median [ms] | 95 % [ms] | worst [ms] | times | missed |\n");
        text.push_str("| --- | --- | ---: | ---: | ---: | ---: | ---: |\n");
        for row in &self.answers {
            let [median, slow, worst] = [row.median, row.slow, row.worst].map(milliseconds);
            let (scene, act, count, missed) = (&row.scene, &row.act, row.count, row.missed);
            let _ = writeln!(text, "| {scene} | {act} | {median} | {slow} | {worst} | {count} | {missed} |");
        }
        text.push_str(
            "\nFrom the moment the key or the mouse reaches the window until the adapter is done with the frame that shows \
             the answer; what the display adds is not in it.\n\n",
        );
    }

    fn slowdown_text(&self, text: &mut String) {
        if self.slowdown.is_empty() {
            return;
        }
        text.push_str("## What the window takes from a fit\n\n");
        text.push_str("| scene | alone [steps/s] | watched [steps/s] | watched / alone | least to most | pairs | steps | frames/s watched | frames alone |\n");
        text.push_str("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n");
        for row in &self.slowdown {
            let _ = writeln!(
                text,
                "| {} | {:.3} | {:.3} | **{:.3}** | {:.3} to {:.3} | {} | {} | {:.2} | {} |",
                row.scene,
                row.alone,
                row.watched,
                row.ratio,
                row.ratio_least,
                row.ratio_most,
                row.pairs,
                row.steps,
                row.frames_per_second_watched,
                row.frames_alone
            );
        }
        text.push_str(
            "\nThe same fit by turns with the window at rest and with the window following it: stage, maps and curves in \
             sight, nobody touching it. Medians over the pairs; each pair is compared over the same steps.\n\n",
        );
    }

    fn relight_text(&self, text: &mut String) {
        if self.relight.is_empty() {
            return;
        }
        text.push_str("## A view relit\n\n| scene | environment | new environment [ms] | at first [ms] | turning [1/s] | error [%] | bias [%] | lobes | cache [s] | view [s] | fine view [s] | rest [s] |\n");
        text.push_str("| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n");
        for row in &self.relight {
            let _ = writeln!(
                text,
                "| {} | {} | {} | {} | {:.1} | **{:.2}** | {:+.2} | {} | {:.1} | {:.2} | {:.2} | {:.2} |",
                row.scene,
                row.light,
                milliseconds(row.light_seconds),
                milliseconds(row.first_light_seconds),
                row.turns_per_second,
                100.0 * row.relative_error,
                100.0 * row.bias,
                row.lobe_points,
                row.cache_seconds,
                row.view_seconds,
                row.fine_view_seconds,
                row.rest_seconds,
            );
        }
        let [width, height] = super::relight::VIEW;
        let _ = writeln!(
            text,
            "\nA viewport of {width} x {height} pixels: from the light to the whole picture, medians; at first, before the \
             view has rested for as long as the last column says. The error is that of the \
             surface against the path tracer under the same environment, relative to the root mean square of its picture, with \
             its noise taken out by two independent pictures. Limits: {} ms and {:.0} %.\n",
            milliseconds(super::relight::MOST_SECONDS),
            100.0 * super::relight::LARGEST_ERROR
        );
    }

    fn memory_text(&self, text: &mut String) {
        let [Some(first), Some(last)] = [self.memory.first(), self.memory.last()] else { return };
        let mebibytes =
            |bytes: Option<u64>| bytes.map_or("unknown".into(), |bytes| format!("{:.1}", bytes as f64 / MIB));
        let count = |count: Option<usize>| count.map_or("unknown".into(), |count| count.to_string());
        let _ = writeln!(
            text,
            "## Memory over cycles of open, fit, close\n\nAfter the first of {} cycles {} MiB, {} threads, {} files; after the \
             last, {:.0} s later, {} MiB, {} threads, {} files.",
            self.memory.len(),
            mebibytes(first.resident_bytes),
            count(first.threads),
            count(first.files),
            last.seconds - first.seconds,
            mebibytes(last.resident_bytes),
            count(last.threads),
            count(last.files),
        );
        if let Some(trend) = &self.memory_trend {
            let _ = writeln!(
                text,
                "Over the second half {:+.3} MiB a cycle, standard error {:.3}.",
                trend.slope_bytes / MIB,
                trend.slope_error_bytes / MIB
            );
        }
        text.push('\n');
    }

    /// Writes `studio.md`, `studio.csv`, `studio.json` and, after cycles, `studio-memory.csv`.
    ///
    /// # Errors
    /// `Unwritable` where the system refuses.
    pub fn write(&self, folder: &Path) -> Result<()> {
        let write = |name: &str, text: &str| crate::files::write_bytes(&folder.join(name), text.as_bytes());
        write("studio.md", &self.to_markdown())?;
        write("studio.csv", &self.to_csv())?;
        let json = serde_json::to_string_pretty(self)
            .map_err(|source| Error::new(ErrorKind::Internal, format!("figures cannot be written: {source}")))?;
        write("studio.json", &json)?;
        if !self.memory.is_empty() {
            write("studio-memory.csv", &self.memory_csv())?;
        }
        Ok(())
    }
}

/// Milliseconds for a table; a dash for what was not measured.
pub(super) fn milliseconds(seconds: f64) -> String {
    if seconds.is_finite() { format!("{:.0}", 1e3 * seconds) } else { "–".into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_tells_figures_and_nothing_that_was_not_measured() {
        let mut report = BenchReport::default();
        assert!(!report.to_markdown().contains("##"));
        report.frames.push(FramesRow { scene: "a, b".into(), frames_per_second: 30.0, ..Default::default() });
        report.equality = Some(EqualityRow { different: 3, ..Default::default() });
        let text = report.to_markdown();
        assert!(text.contains("| 30.0 |") && text.contains("a defect") && !text.contains("## Memory"), "{text}");
        assert!(report.to_csv().contains("frames,\"a, b\",\"\",rate,1/s,30\n"), "{}", report.to_csv());
        let folder = tempfile::tempdir().unwrap();
        report.write(folder.path()).unwrap();
        assert!(folder.path().join("studio.json").is_file() && !folder.path().join("studio-memory.csv").exists());
    }
}
