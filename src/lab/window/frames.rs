//! Frames a second while the eye turns, frames while nothing happens, and what the window takes of the processors.

use super::machine;
use super::person::Person;
use crate::error::{Error, ErrorKind, Result};
use crate::math::statistics::quantile;
use eframe::egui::Rect;
use std::time::Instant;

/// Frames while something went on.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct FramesRow {
    /// The scene.
    pub scene: String,
    /// What went on.
    pub case: String,
    /// Frames a second.
    pub frames_per_second: f64,
    /// The middle of the seconds between two frames.
    pub frame_seconds_median: f64,
    /// The same of the slowest of twenty.
    pub frame_seconds_slow: f64,
    /// Share of all processors that threads other than those of the fit took, in [0, 1].
    pub window_share: Option<f64>,
}

/// The stage's rectangle.
///
/// # Errors
/// `Internal` where no stage is drawn.
pub fn stage_rect(person: &Person) -> Result<Rect> {
    let rect = person.ask(|studio, _| studio.memory.stage.rect)?;
    rect.ok_or_else(|| Error::new(ErrorKind::Internal, "no stage is drawn"))
}

/// Counts frames while the mouse turns the eye.
///
/// # Errors
/// Where the window does not answer.
pub fn while_orbiting(person: &Person, scene: &str, case: &str, seconds: f64) -> Result<FramesRow> {
    let rect = stage_rect(person)?;
    person.orbit(rect, 1.0);
    counted(person, scene, case, || person.orbit(rect, seconds), seconds)
}

/// Counts frames while nobody touches the window.
///
/// # Errors
/// None of its own.
pub fn while_watching(person: &Person, scene: &str, case: &str, seconds: f64) -> Result<FramesRow> {
    counted(person, scene, case, || person.watch(seconds), seconds)
}

fn counted(person: &Person, scene: &str, case: &str, work: impl FnOnce(), seconds: f64) -> Result<FramesRow> {
    let first = person.shared.frames();
    let (before, began) = (machine::processor_seconds(), Instant::now());
    work();
    let (after, elapsed) = (machine::processor_seconds(), began.elapsed().as_secs_f64());
    // Orbiting takes hold of the mouse before and lets go after.
    let glances = person.shared.since(first);
    let gaps: Vec<f64> =
        glances.windows(2).map(|pair| pair[1].began.saturating_duration_since(pair[0].began).as_secs_f64()).collect();
    let processors = std::thread::available_parallelism().map_or(1, |count| count.get()) as f64;
    let window_share = before.zip(after).map(|(before, after)| {
        let window = (after.all - before.all) - (after.fit - before.fit);
        (window / (elapsed * processors)).max(0.0)
    });
    Ok(FramesRow {
        scene: scene.into(),
        case: case.into(),
        frames_per_second: glances.len() as f64 / seconds.max(1e-9),
        frame_seconds_median: quantile(&gaps, 0.5),
        frame_seconds_slow: quantile(&gaps, 0.95),
        window_share,
    })
}
