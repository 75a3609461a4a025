//! The figures as CSV.

use super::BenchReport;
use std::fmt::Write;

impl BenchReport {
    /// One line a figure: part, scene, case, measure, unit, value.
    pub fn to_csv(&self) -> String {
        let mut text = String::from("part,scene,case,measure,unit,value\n");
        let mut line = |part: &str, scene: &str, case: &str, measure: &str, unit: &str, value: f64| {
            let plain = |word: &str| format!("\"{}\"", word.replace('"', "\"\""));
            let _ = writeln!(text, "{part},{},{},{measure},{unit},{value}", plain(scene), plain(case));
        };
        for row in &self.opening {
            let case = if row.is_again { "again" } else { "first" };
            let mut own = |measure, unit, value| line("opening", &row.scene, case, measure, unit, value);
            own("shown", "s", row.shown);
            own("photos", "s", row.photos);
            own("ready", "s", row.ready);
            own("relit", "s", row.relit);
            own("processors to ready", "s", row.ready_processor.unwrap_or(f64::NAN));
            own("processors", "s", row.processor.unwrap_or(f64::NAN));
        }
        for row in &self.starting {
            let case = if row.is_again { "again" } else { "first" };
            let mut own = |measure, unit, value| line("starting", &row.scene, case, measure, unit, value);
            own("first maps", "s", row.first_maps);
            own("longest wait", "s", row.longest_wait);
            own("longest wait from", "s", row.longest_wait_from);
            own("maps", "", row.maps as f64);
            own("whole", "s", row.whole);
            own("time left off median", "", row.left_error);
            own("time left off most", "", row.left_error_most);
            own("time left off most at", "", row.left_error_most_at);
            own("bar went back", "", row.backwards as f64);
        }
        for row in &self.stalls {
            let mut own = |measure, unit, value| line("stalls", &row.scene, &row.case, measure, unit, value);
            own("median", "s", row.median);
            own("longest", "s", row.longest);
        }
        for bar in self.bars() {
            line("bar", &bar.scene, &bar.figure, "value", bar.unit, bar.value);
            line("bar", &bar.scene, &bar.figure, bar.sign(), bar.unit, bar.limit);
        }
        for row in &self.frames {
            let mut own = |measure, unit, value| line("frames", &row.scene, &row.case, measure, unit, value);
            own("rate", "1/s", row.frames_per_second);
            own("between frames median", "s", row.frame_seconds_median);
            own("between frames 95 %", "s", row.frame_seconds_slow);
            own("share of processors", "", row.window_share.unwrap_or(f64::NAN));
        }
        for row in &self.answers {
            let mut own = |measure, unit, value| line("answers", &row.scene, &row.act, measure, unit, value);
            own("median", "s", row.median);
            own("95 %", "s", row.slow);
            own("worst", "s", row.worst);
            own("count", "", row.count as f64);
            own("missed", "", row.missed as f64);
        }
        for row in &self.slowdown {
            let mut own = |measure, unit, value| line("slowdown", &row.scene, "", measure, unit, value);
            own("alone", "steps/s", row.alone);
            own("watched", "steps/s", row.watched);
            own("ratio", "", row.ratio);
            own("ratio least", "", row.ratio_least);
            own("ratio most", "", row.ratio_most);
            own("frames while alone", "", row.frames_alone as f64);
        }
        for row in &self.relight {
            let mut own = |measure, unit, value| line("relight", &row.scene, &row.light, measure, unit, value);
            own("new environment at first", "s", row.first_light_seconds);
            own("new environment", "s", row.light_seconds);
            own("rest", "s", row.rest_seconds);
            own("turning", "1/s", row.turns_per_second);
            own("relative error", "", row.relative_error);
            own("bias", "", row.bias);
            own("cache", "s", row.cache_seconds);
            own("view", "s", row.view_seconds);
            own("fine view", "s", row.fine_view_seconds);
        }
        if let Some(trend) = &self.memory_trend {
            line("memory", "", "", "slope", "bytes/cycle", trend.slope_bytes);
            line("memory", "", "", "error of slope", "bytes/cycle", trend.slope_error_bytes);
        }
        if let Some(row) = &self.equality {
            line("equality", &row.scene, "", "numbers that differ", "", row.different as f64);
        }
        text
    }

    /// Memory after each cycle.
    pub fn memory_csv(&self) -> String {
        let mut text = String::from("cycle,seconds,resident_bytes,threads,files\n");
        for row in &self.memory {
            let (bytes, threads, files) = (row.resident_bytes, row.threads, row.files);
            let [threads, files] =
                [threads, files].map(|count| count.map(|count| count.to_string()).unwrap_or_default());
            let bytes = bytes.map(|bytes| bytes.to_string()).unwrap_or_default();
            let _ = writeln!(text, "{},{:.3},{bytes},{threads},{files}", row.cycle, row.seconds);
        }
        text
    }
}
