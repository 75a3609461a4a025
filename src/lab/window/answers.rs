//! Time from an act to the frame that shows its answer.

use super::driven::Glance;
use super::frames::stage_rect;
use super::person::Person;
use crate::error::Result;
use crate::math::statistics::quantile;
use crate::studio::model::FitStatus;
use eframe::egui::{Key, vec2};

/// Seconds after which an answer counts as missed.
const PATIENCE: f64 = 20.0;
/// Seconds between two acts: the window is at rest again.
const PAUSE: f64 = 0.35;

/// Times of one act.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct AnswersRow {
    /// The scene.
    pub scene: String,
    /// The act.
    pub act: String,
    /// The middle, in seconds.
    pub median: f64,
    /// The slowest of twenty, in seconds.
    pub slow: f64,
    /// The worst, in seconds.
    pub worst: f64,
    /// Number of answers.
    pub count: usize,
    /// Acts without an answer.
    pub missed: usize,
}

impl AnswersRow {
    fn new(scene: &str, act: &str, times: &[Option<f64>]) -> Self {
        let known: Vec<f64> = times.iter().copied().flatten().collect();
        AnswersRow {
            scene: scene.into(),
            act: act.into(),
            median: quantile(&known, 0.5),
            slow: quantile(&known, 0.95),
            worst: known.iter().copied().fold(f64::NAN, f64::max),
            count: known.len(),
            missed: times.len() - known.len(),
        }
    }
}

/// Does each act so many times and times its answers, while whatever runs goes on.
///
/// # Errors
/// Where the window does not answer at all.
pub fn measure(person: &Person, scene: &str, count: usize) -> Result<Vec<AnswersRow>> {
    let mut rows = Vec::new();
    let mut keys = |act: &str, keys: &[Key], answer: &dyn Fn(&Glance, &Glance) -> bool| {
        let time = |round: usize| {
            person.watch(PAUSE);
            person.answer_seconds(PATIENCE, || person.press(keys[round % keys.len()]), answer)
        };
        let times: Vec<Option<f64>> = (0..count).map(time).collect();
        rows.push(AnswersRow::new(scene, act, &times));
    };
    keys("next light, by its key", &[Key::ArrowRight], &|before, after| {
        after.light != before.light && !after.is_light_uploading && after.scenes_drawn > before.scenes_drawn
    });
    keys("another layer, by its key", &[Key::Num2, Key::Num3, Key::Num4, Key::Num5, Key::Num1], &|before, after| {
        after.layer != before.layer && after.scenes_drawn > before.scenes_drawn
    });
    keys("exposure, by its key", &[Key::E], &|before, after| after.exposure_stops != before.exposure_stops);
    keys("next photo, by its key", &[Key::CloseBracket], &|before, after| after.view != before.view);
    person.press(Key::R);
    rows.push(AnswersRow::new(scene, "turn the eye, by the mouse", &orbit_steps(person, count)?));
    let (said, done) = pauses(person, count.min(8))?;
    rows.push(AnswersRow::new(scene, "pause, by its key, to the word that it pauses", &said));
    rows.push(AnswersRow::new(scene, "pause, by its key, to the fit at rest", &done));
    Ok(rows)
}

fn orbit_steps(person: &Person, count: usize) -> Result<Vec<Option<f64>>> {
    let centre = stage_rect(person)?.center();
    person.grab(centre);
    person.watch(PAUSE);
    // Beyond the distance at which a press becomes a drag.
    person.move_to(centre + vec2(20.0, 0.0));
    let mut times = Vec::new();
    for round in 0..count {
        person.watch(PAUSE);
        let to = centre + vec2(if round % 2 == 0 { 30.0 } else { 20.0 }, 0.0);
        let turned =
            |before: &Glance, after: &Glance| after.eye != before.eye && after.scenes_drawn > before.scenes_drawn;
        times.push(person.answer_seconds(PATIENCE, || person.move_to(to), turned));
    }
    person.let_go(centre);
    Ok(times)
}

/// Seconds from a press to the frame that says that the fit pauses, and to the one that says that it does.
type Pauses = (Vec<Option<f64>>, Vec<Option<f64>>);

fn pauses(person: &Person, count: usize) -> Result<Pauses> {
    let (mut said, mut done) = (Vec::new(), Vec::new());
    for _ in 0..count {
        person.wait_until("a fit that runs", 60.0, |studio| studio.model.fit.status == FitStatus::Running)?;
        person.watch(PAUSE);
        let began = std::time::Instant::now();
        let says = |_: &Glance, after: &Glance| matches!(after.status, FitStatus::Pausing | FitStatus::Paused);
        said.push(person.answer_seconds(PATIENCE, || person.press(Key::Space), says));
        let rests = person.answer_seconds(PATIENCE, || {}, |_, after| after.status == FitStatus::Paused);
        done.push(rests.map(|_| began.elapsed().as_secs_f64()));
        person.watch(PAUSE);
        person.press(Key::Space);
        person.watch(PAUSE);
    }
    Ok((said, done))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missed_answers_are_counted_and_never_averaged() {
        let row = AnswersRow::new("scene", "act", &[Some(0.1), None, Some(0.3), Some(0.2)]);
        assert_eq!((row.median, row.worst, row.count, row.missed), (0.2, 0.3, 3, 1));
        assert!(AnswersRow::new("scene", "act", &[None]).median.is_nan());
    }
}
