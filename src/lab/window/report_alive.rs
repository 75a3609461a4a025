//! Tables of what a person waits for: opening, the first maps, a window that hears nobody.

use super::report::{BenchReport, milliseconds};
use crate::insight::report::data::StageTime;
use std::fmt::Write;

impl BenchReport {
    pub(super) fn opening_text(&self, text: &mut String) {
        if self.opening.is_empty() {
            return;
        }
        text.push_str("## From drop to ready\n\n| scene | opened | shown [s] | photos on it [s] | ready [s] | relit [s] | processors, ready [s] | relit [s] | stages [s] |\n");
        text.push_str("| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | --- |\n");
        for row in &self.opening {
            let stage = |own: &StageTime| format!("{} {:.2}", own.stage, own.seconds);
            let stages: Vec<String> = row.stages.iter().map(stage).collect();
            let _ = writeln!(
                text,
                "| {} | {} | {:.2} | {:.2} | **{:.2}** | {:.2} | {} | {} | {} |",
                row.scene,
                times(row.is_again),
                row.shown,
                row.photos,
                row.ready,
                row.relit,
                known(row.ready_processor),
                known(row.processor),
                stages.join(", ")
            );
        }
        text.push_str(
            "\nSeconds from the drop on, by the tasks of the window without the window: mesh and cameras, photos projected onto \
             the mesh, a fit that could start, and the maps relit from cached transport.\n\n",
        );
    }

    pub(super) fn starting_text(&self, text: &mut String) {
        if self.starting.is_empty() {
            return;
        }
        text.push_str("## From Start to the report\n\n| scene | fitted | first maps [s] | longest wait [s] | from [s] | maps | report [s] | time left off, median [%] | most [%] | at [%] | bar went back |\n");
        text.push_str("| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n");
        for row in &self.starting {
            let _ = writeln!(
                text,
                "| {} | {} | {:.2} | {:.2} | {:.1} | {} | {:.1} | {:.0} | {:.0} | {:.0} | {} |",
                row.scene,
                times(row.is_again),
                row.first_maps,
                row.longest_wait,
                row.longest_wait_from,
                row.maps,
                row.whole,
                100.0 * row.left_error,
                100.0 * row.left_error_most,
                100.0 * row.left_error_most_at,
                row.backwards
            );
        }
        text.push_str(
            "\nThe projected photos are in the viewport from opening on. A wait is a time without newer maps, from Start to the \
             last step. The time left is that to the report, its error relative to what was left, from a quarter of the time \
             on to nine tenths.\n\n",
        );
    }

    pub(super) fn stalls_text(&self, text: &mut String) {
        if self.stalls.is_empty() {
            return;
        }
        text.push_str("## While the window hears nobody\n\n| scene | case | frames | median [ms] | longest [ms] |\n");
        text.push_str("| --- | --- | ---: | ---: | ---: |\n");
        for row in &self.stalls {
            let [median, longest] = [row.median, row.longest].map(milliseconds);
            let _ = writeln!(text, "| {} | {} | {} | {median} | {longest} |", row.scene, row.case, row.frames);
        }
        text.push_str(
            "\nFrom the news that a frame takes in until its drawing begins to be handed on: the wait for an adapter that is behind is in it, as where \
             the processors draw.\n\n",
        );
    }
}

fn known(seconds: Option<f64>) -> String {
    seconds.map_or("unknown".into(), |seconds| format!("{seconds:.2}"))
}

fn times(is_again: bool) -> &'static str {
    if is_again { "again" } else { "for the first time" }
}
