//! Steps a second of a fit under the window against the same fit without it.
//!
//! Both fits are the same down to the seed, so step for step they do the same work; they take turns, and each pair is
//! compared over the steps that both did. Without the window means: the window is open, at rest, and draws no frame
//! (the frames it did draw are counted). With it means: it shows stage, maps and curves of the fit and follows it.

use super::person::Person;
use crate::error::{Error, ErrorKind, Result};
use crate::export::RunFolder;
use crate::job::open;
use crate::job::prepare::{Prepared, RunSettings};
use crate::job::{self, Event, JobOptions};
use crate::math::statistics::quantile;
use crate::studio::act::Act;
use crate::studio::model::FitStatus;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Steps at the start that are not compared: memory is touched for the first time.
const WARM_STEPS: usize = 1;
/// How long the first step may take, in seconds.
const LONG: f64 = 600.0;

/// What the window takes from a fit.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct SlowdownRow {
    /// The scene.
    pub scene: String,
    /// The middle of steps a second without the window.
    pub alone: f64,
    /// The middle of steps a second under the window.
    pub watched: f64,
    /// The middle of the pairs' ratios, watched over alone.
    pub ratio: f64,
    /// The smallest of the ratios.
    pub ratio_least: f64,
    /// The largest of the ratios.
    pub ratio_most: f64,
    /// Number of pairs.
    pub pairs: usize,
    /// Steps of a pair that were compared, at least.
    pub steps: usize,
    /// Frames that the window drew during all fits without it.
    pub frames_alone: u64,
    /// Frames a second during the fits under it.
    pub frames_per_second_watched: f64,
}

/// The number of a step and when it began.
type StepTime = (usize, Instant);

/// When each step began.
#[derive(Clone, Default)]
pub struct StepClock(Arc<Mutex<Vec<StepTime>>>);

impl StepClock {
    /// To be called before each step.
    pub fn hook(&self) -> Arc<dyn Fn(usize) + Send + Sync> {
        let times = Arc::clone(&self.0);
        Arc::new(move |step| times.lock().unwrap_or_else(PoisonError::into_inner).push((step, Instant::now())))
    }

    /// The step begun last, and when each began, from the first on.
    fn times(&self) -> Vec<StepTime> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Waits until steps were done for so many seconds, and at least one.
    fn wait(&self, seconds: f64) -> Result<()> {
        let began = Instant::now();
        loop {
            let times = self.times();
            if let Some((_, first)) = times.get(WARM_STEPS)
                && first.elapsed().as_secs_f64() > seconds
                && times.len() > WARM_STEPS + 1
            {
                return Ok(());
            }
            if began.elapsed().as_secs_f64() > LONG + seconds {
                return Err(Error::new(ErrorKind::Internal, "the fit of the bench does no steps"));
            }
            std::thread::sleep(Duration::from_millis(50));
        }
    }
}

/// Seconds of so many steps after the warm ones.
fn seconds_of(times: &[StepTime], steps: usize) -> Option<f64> {
    let (_, from) = times.get(WARM_STEPS)?;
    let (_, to) = times.get(WARM_STEPS + steps)?;
    Some(to.saturating_duration_since(*from).as_secs_f64())
}

/// Runs the open scene's fit by turns with and without the window.
///
/// # Errors
/// Where a fit fails or does not come on.
pub fn measure(person: &Person, scene: &str, pairs: usize, seconds: f64, folder: &Path) -> Result<SlowdownRow> {
    let (mut alone, mut watched, mut ratios) = (Vec::new(), Vec::new(), Vec::new());
    let (mut frames_alone, mut frames_watched, mut seconds_watched, mut least_steps) = (0, 0, 0.0, usize::MAX);
    for pair in 0..pairs.max(1) {
        let mut both = [Vec::new(), Vec::new()];
        // Who begins changes from pair to pair: what a machine does over time favours neither.
        for turn in [pair % 2, 1 - pair % 2] {
            if turn == 0 {
                let (times, frames) = fit_alone(person, seconds, &folder.join(format!("alone-{pair}")))?;
                both[0] = times;
                frames_alone += frames;
            } else {
                let (times, frames, elapsed) = fit_watched(person, seconds)?;
                both[1] = times;
                frames_watched += frames;
                seconds_watched += elapsed;
            }
        }
        let steps = both.iter().map(|times| times.len().saturating_sub(WARM_STEPS + 1)).min().unwrap_or(0);
        let [own, under] = both.map(|times| seconds_of(&times, steps).unwrap_or(f64::NAN));
        least_steps = least_steps.min(steps);
        alone.push(steps as f64 / own);
        watched.push(steps as f64 / under);
        ratios.push(own / under);
    }
    Ok(SlowdownRow {
        scene: scene.into(),
        alone: quantile(&alone, 0.5),
        watched: quantile(&watched, 0.5),
        ratio: quantile(&ratios, 0.5),
        ratio_least: ratios.iter().copied().fold(f64::NAN, f64::min),
        ratio_most: ratios.iter().copied().fold(f64::NAN, f64::max),
        pairs: ratios.len(),
        steps: least_steps,
        frames_alone,
        frames_per_second_watched: frames_watched as f64 / f64::max(seconds_watched, 1e-9),
    })
}

/// What a fit without the window starts from: that of the project that is open.
///
/// # Errors
/// `Internal` where nothing is open.
pub fn prepared_of(person: &Person) -> Result<(Prepared, RunSettings)> {
    let parts = person.ask(|studio, _| {
        let project = studio.model.project.as_ref()?;
        let settings = RunSettings { fit: studio.model.edits.fit.clone(), ..project.settings.clone() };
        let (scene, surface) = (project.scene.clone()?, project.surface.clone()?);
        let (findings, timings) = (project.findings.clone(), project.timings.clone());
        Some((Prepared { scene, surface, quality: project.quality.clone(), findings, timings }, settings))
    })?;
    parts.ok_or_else(|| Error::new(ErrorKind::Internal, "nothing is open that could be fitted"))
}

/// A fit without the window; also the frames it drew all the same.
fn fit_alone(person: &Person, seconds: f64, folder: &Path) -> Result<(Vec<StepTime>, u64)> {
    let (prepared, settings) = prepared_of(person)?;
    // The path-traced preview rests, as it does while a fit runs.
    person.ask(|studio, _| studio.model.switches.traced = false)?;
    person.watch(1.0);
    let stop = AtomicBool::new(false);
    let (prepared, fitter, settings) = open::begin(prepared, settings, &stop, &|_, _| {})?;
    let clock = StepClock::default();
    let hook = clock.hook();
    let options = JobOptions { before_step: Some(Box::new(move |step| hook(step))), ..JobOptions::default() };
    let job = job::start_with(prepared, fitter, settings, RunFolder::create(folder)?, options)?;
    let frames = person.shared.frames();
    let waited = clock.wait(seconds);
    let frames = person.shared.frames() - frames;
    job.stop();
    let failure = job.events.iter().find_map(|event| match event {
        Event::Failed(error) => Some(Some(error)),
        Event::Stopped { .. } | Event::Finished(_) => Some(None),
        _ => None,
    });
    job.join();
    let _ = std::fs::remove_dir_all(folder);
    if let Some(Some(error)) = failure {
        return Err(error);
    }
    waited?;
    Ok((clock.times(), frames))
}

/// The same fit started in the window, which follows it; also its frames and the seconds they took.
fn fit_watched(person: &Person, seconds: f64) -> Result<(Vec<StepTime>, u64, f64)> {
    let clock = StepClock::default();
    let hook = clock.hook();
    person.ask(move |studio, _| {
        studio.model.before_step = Some(hook);
        forget_run(studio);
        studio.model.act(Act::Start);
    })?;
    let (began, frames) = (Instant::now(), person.shared.frames());
    let waited = clock.wait(seconds);
    let (frames, elapsed) = (person.shared.frames() - frames, began.elapsed().as_secs_f64());
    person.ask(|studio, _| {
        studio.model.before_step = None;
        studio.model.act(Act::Stop);
    })?;
    person.wait_until("a fit that has stopped", LONG, |studio| studio.model.fit.status == FitStatus::Stopped)?;
    waited?;
    Ok((clock.times(), frames, elapsed))
}

/// Without a folder the next start begins anew in place of going on.
pub fn forget_run(studio: &mut crate::studio::app::Studio) {
    if let Some(folder) = studio.model.fit.folder.take() {
        let _ = std::fs::remove_dir_all(folder.path());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_steps_after_the_warm_ones_are_timed() {
        let began = Instant::now();
        let at = |seconds: f64| began + Duration::from_secs_f64(seconds);
        let times = [(0, at(0.0)), (1, at(9.0)), (2, at(10.0)), (3, at(11.5))];
        assert!((seconds_of(&times, 2).unwrap() - 2.5).abs() < 1e-6);
        assert_eq!(seconds_of(&times, 3), None);
    }
}
