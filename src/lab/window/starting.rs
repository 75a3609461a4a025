//! From Start to the report, as the window follows it, without the window: when pictures come, and what progress says.

use super::opening::until_ready;
use crate::error::{Error, ErrorKind, Result};
use crate::math::statistics::quantile;
use crate::studio::model::store::Store;
use crate::studio::model::{FitStatus, Model};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Seconds for which the viewport may show nothing newer while a fit runs.
pub const MOST_SECONDS_BETWEEN: f64 = 2.0;
/// Largest error of the time left, relative to it.
pub const LARGEST_ERROR: f64 = 0.2;
/// Between these shares of the whole time what is said of the time left counts: before, nothing is known; after, it is too
/// short to be judged by its share.
const JUDGED: (f64, f64) = (0.25, 0.9);
/// Between two looks at what the job says.
const BETWEEN_LOOKS: Duration = Duration::from_millis(10);
/// Seconds between two notes of the progress.
const BETWEEN_NOTES: f64 = 0.25;
/// How long a fit may take, in seconds.
const PATIENCE: f64 = 7200.0;

/// What a fit was like to watch.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct StartingRow {
    /// The scene.
    pub scene: String,
    /// Whether this machine had fitted it before, so that it knows how long finishing takes.
    pub is_again: bool,
    /// Seconds from Start to the first maps that were found.
    pub first_maps: f64,
    /// The longest time in seconds without newer maps, from Start to the last step.
    pub longest_wait: f64,
    /// Maps that could be shown.
    pub maps: usize,
    /// Seconds from Start to the report.
    pub whole: f64,
    /// Error of the time left relative to it, from a quarter of the time on: the median.
    pub left_error: f64,
    /// The same, the largest.
    pub left_error_most: f64,
    /// The share of the whole time at which it was that.
    pub left_error_most_at: f64,
    /// Seconds from Start at which the longest wait began.
    pub longest_wait_from: f64,
    /// How often the bar went back.
    pub backwards: usize,
}

/// What progress said at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Note {
    /// Seconds since Start.
    seconds: f64,
    /// Share of the job that was said to be done.
    share: f32,
    /// Seconds that were said to be left.
    left: Option<f64>,
}

/// Fits the scene at a path, or the demo, as its defaults have it. Also the folder of the last run, which is the caller's to
/// delete.
///
/// # Errors
/// What cannot be opened or fitted.
pub fn measure(
    path: Option<&Path>,
    times: usize,
    folder: &Path,
    tell: &dyn Fn(&str),
) -> Result<(Vec<StartingRow>, PathBuf)> {
    let name = super::opening::name_of(path);
    let own = super::scratch(folder, "starting");
    let mut rows = Vec::new();
    let mut run = PathBuf::new();
    for time in 0..times.max(1) {
        tell(&format!("from Start to the report: {name}"));
        let row;
        (row, run) = watched(path, &own)?;
        rows.push(StartingRow { scene: name.clone(), is_again: time > 0, ..row });
    }
    Ok((rows, run))
}

fn watched(path: Option<&Path>, folder: &Path) -> Result<(StartingRow, PathBuf)> {
    let store = Store::at(Some(folder.join("studio-settings.json")));
    let mut model = Model::new(store, Arc::new(|| {}));
    model.preferences.runs_folder = folder.join("runs");
    // A person looks first. Nothing is relit after that: what draws is no part of this.
    until_ready(&mut model, path, |project, _| project.transport.is_none())?;
    model.switches.traced = false;
    model.start_fit();
    let began = Instant::now();
    let (mut pictures, mut notes, mut steps_end) = (Vec::new(), Vec::<Note>::new(), None);
    loop {
        model.poll();
        let seconds = began.elapsed().as_secs_f64();
        if model.take_snapshot() {
            pictures.push(seconds);
        }
        let is_due = notes.last().is_none_or(|last| seconds - last.seconds > BETWEEN_NOTES);
        if is_due && model.fit.status.is_live() {
            let advance = &model.fit.advance;
            notes.push(Note { seconds, share: advance.share(), left: advance.seconds_left() });
        }
        match &model.fit.status {
            FitStatus::Finishing(_) => steps_end = steps_end.or(Some(seconds)),
            FitStatus::Finished => break,
            FitStatus::Failed(why) => return Err(Error::new(ErrorKind::Internal, format!("the fit failed: {why}"))),
            FitStatus::Idle if !model.tasks.is_busy() => {
                let why = model.log.banner().map(|message| message.text.clone()).unwrap_or_default();
                return Err(Error::new(ErrorKind::Internal, format!("the fit does not start: {why}")));
            }
            _ if seconds > PATIENCE => return Err(Error::new(ErrorKind::Internal, "the fit does not come to its end")),
            _ => {}
        }
        std::thread::sleep(BETWEEN_LOOKS);
    }
    let whole = began.elapsed().as_secs_f64();
    // What was learned is there for the next fit.
    model.write_preferences();
    let run = model.fit.folder.as_ref().map(|folder| folder.path().to_path_buf()).unwrap_or_default();
    let (left_error, (left_error_most, left_error_most_at)) = left_errors(&notes, whole);
    let (longest_wait, longest_wait_from) = longest_wait(&pictures, steps_end.unwrap_or(whole));
    let row = StartingRow {
        first_maps: pictures.first().copied().unwrap_or(f64::NAN),
        longest_wait,
        longest_wait_from,
        maps: pictures.len(),
        whole,
        left_error,
        left_error_most,
        left_error_most_at,
        backwards: notes.windows(2).filter(|pair| pair[1].share < pair[0].share).count(),
        ..StartingRow::default()
    };
    Ok((row, run))
}

/// The longest time without a picture, from 0 to `end`, and when it began.
fn longest_wait(pictures: &[f64], end: f64) -> (f64, f64) {
    let times: Vec<f64> = [0.0].into_iter().chain(pictures.iter().map(|&at| at.min(end))).chain([end]).collect();
    let longer =
        |most: (f64, f64), pair: &[f64]| if pair[1] - pair[0] > most.0 { (pair[1] - pair[0], pair[0]) } else { most };
    times.windows(2).fold((0.0, 0.0), longer)
}

/// Median and largest error of the time left, relative to it, the latter with the share of the whole time at which it was. A time
/// that is not told counts as wholly wrong.
fn left_errors(notes: &[Note], whole: f64) -> (f64, (f64, f64)) {
    let judged = notes.iter().filter(|note| (JUDGED.0 * whole..=JUDGED.1 * whole).contains(&note.seconds));
    let (errors, at): (Vec<f64>, Vec<f64>) = judged
        .map(|note| {
            let left = whole - note.seconds;
            (note.left.map_or(1.0, |told| (told - left).abs() / left), note.seconds / whole)
        })
        .unzip();
    let most =
        errors.iter().copied().zip(at).fold((f64::NAN, f64::NAN), |most, own| if own.0 <= most.0 { most } else { own });
    (quantile(&errors, 0.5), most)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waits_reach_from_start_to_the_last_step() {
        assert_eq!(longest_wait(&[3.0, 4.0, 9.0], 10.0), (5.0, 4.0));
        assert_eq!(longest_wait(&[7.0, 8.0], 9.0), (7.0, 0.0));
        assert_eq!(longest_wait(&[1.0], 9.0), (8.0, 1.0));
        assert_eq!(longest_wait(&[1.0, 12.0], 2.0), (1.0, 0.0), "after the last step nothing is waited for");
    }

    #[test]
    fn the_time_left_is_judged_from_a_quarter_on() {
        let note = |seconds, left| Note { seconds, share: 0.0, left };
        let notes = [note(10.0, Some(900.0)), note(30.0, Some(77.0)), note(50.0, Some(60.0)), note(95.0, Some(50.0))];
        let (median, (most, _)) = left_errors(&notes, 100.0);
        assert!((median - 0.15).abs() < 1e-9 && (most - 0.2).abs() < 1e-9, "{median} {most}");
        assert_eq!(left_errors(&[note(50.0, None)], 100.0).1, (1.0, 0.5));
    }
}
