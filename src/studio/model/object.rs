//! The estimation of object mode as the window knows it: the job, in which state it is, what it told.

use super::lights::LightName;
use super::log::{Log, Message};
use super::words::capitalised;
use crate::image::{GreyImage, RgbImage};
use crate::job::object::{MaterialLook, ObjectJob, ObjectLook, ObjectNews, ObjectOutcome, PhotoSeen, ReopenedObject};
use crate::light::Environment;
use crate::object::progress::ObjectiveRow;
use std::sync::Arc;

/// In which state the estimation is.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum ObjectStatus {
    /// None was started.
    #[default]
    Idle,
    /// It works.
    Running,
    /// It was asked to stop and writes what it has.
    Stopping,
    /// Everything is done.
    Finished,
    /// It ended early; what it reached is kept.
    Ended,
    /// It ended with nothing.
    Failed(String),
}

impl ObjectStatus {
    /// Whether a thread works on it.
    pub fn is_live(&self) -> bool {
        matches!(self, ObjectStatus::Running | ObjectStatus::Stopping)
    }

    /// The state in a word or two.
    pub fn words(&self) -> &'static str {
        match self {
            ObjectStatus::Idle => "Not started",
            ObjectStatus::Running => "Estimating",
            ObjectStatus::Stopping => "Stopping",
            ObjectStatus::Finished => "Finished",
            ObjectStatus::Ended => "Ended early",
            ObjectStatus::Failed(_) => "Failed",
        }
    }
}

/// The object under a light of the shelf.
#[derive(Clone, Debug)]
pub struct RelitObject {
    /// The light.
    pub name: LightName,
    /// The object of the first photo, exposed for a display at 0 stops.
    pub object: Arc<RgbImage>,
    /// A sphere of the estimated reflectance, likewise.
    pub sphere: Arc<RgbImage>,
}

/// The estimation.
#[derive(Default)]
pub struct ObjectControl {
    job: Option<ObjectJob>,
    /// The state.
    pub status: ObjectStatus,
    /// What is done now, in words.
    pub stage: String,
    /// The photos.
    pub photos: Vec<PhotoSeen>,
    /// The photo that is shown.
    pub chosen_photo: usize,
    /// The objective after each step.
    pub rows: Vec<ObjectiveRow>,
    /// Rounds that were asked for.
    pub rounds: usize,
    /// What was noticed.
    pub findings: Vec<crate::error::Finding>,
    look_number: u64,
    /// The newest look.
    pub look: Option<Arc<ObjectLook>>,
    /// The result.
    pub outcome: Option<Arc<ObjectOutcome>>,
    /// The object under the lights of the shelf.
    pub relit: Vec<RelitObject>,
}

impl ObjectControl {
    /// Takes over a job that was just started.
    pub(super) fn begin(&mut self, job: ObjectJob, rounds: usize) {
        *self = ObjectControl { job: Some(job), status: ObjectStatus::Running, rounds, ..ObjectControl::default() };
    }

    /// Shows a result that was read from its folder.
    pub(super) fn show(&mut self, opened: ReopenedObject) {
        let ReopenedObject { photos, outcome, findings } = opened;
        *self = ObjectControl {
            status: ObjectStatus::Finished,
            photos,
            rows: outcome.parts.estimate.rows.clone(),
            rounds: outcome.parts.settings.outer_loops,
            findings,
            outcome: Some(Arc::new(outcome)),
            ..ObjectControl::default()
        };
    }

    /// Asks the job to end.
    pub fn stop(&mut self) {
        if let Some(job) = &self.job
            && self.status == ObjectStatus::Running
        {
            job.stop();
            self.status = ObjectStatus::Stopping;
        }
    }

    /// Asks the job to end and waits for it.
    pub fn stop_and_wait(&mut self) {
        if let Some(job) = self.job.take() {
            job.stop();
            job.join();
        }
    }

    /// Takes in what the job told. True when something changed; the second is true when a result came.
    pub fn poll(&mut self, log: &mut Log) -> (bool, bool) {
        let Some(job) = &self.job else { return (false, false) };
        let news: Vec<ObjectNews> = job.news.try_iter().collect();
        let mut changed = !news.is_empty();
        if let Some((number, look)) = job.looks.newest()
            && number > self.look_number
        {
            (self.look_number, self.look) = (number, Some(look));
            changed = true;
        }
        let mut came = false;
        for item in news {
            came |= self.take_in(item, log);
        }
        if !self.status.is_live() {
            self.job = None;
        }
        (changed, came)
    }

    fn take_in(&mut self, news: ObjectNews, log: &mut Log) -> bool {
        match news {
            ObjectNews::Stage(stage) => self.stage = capitalised(&stage),
            ObjectNews::Read(photos) => self.photos = photos,
            ObjectNews::Row(row) => self.rows.push(row),
            ObjectNews::Finding(finding) => {
                log.add(Message::from(&finding));
                self.findings.push(finding);
            }
            ObjectNews::Trouble(error) => log.error(&error),
            ObjectNews::Finished(outcome) => {
                log.note(told(&outcome));
                (self.status, self.outcome) = (ObjectStatus::Finished, Some(Arc::from(outcome)));
                return true;
            }
            ObjectNews::Ended(None) => {
                log.note("The estimation was stopped before its first round: no result");
                self.status = ObjectStatus::Ended;
            }
            ObjectNews::Ended(Some(outcome)) => {
                log.note(told(&outcome));
                (self.status, self.outcome) = (ObjectStatus::Ended, Some(Arc::from(outcome)));
                return true;
            }
            ObjectNews::Failed(error) => {
                self.status = ObjectStatus::Failed(error.message().into());
                log.error(&error);
            }
        }
        false
    }

    /// Re-render and error of the photo that is shown, as far as they are known.
    pub fn pictures(&self) -> Option<(Arc<RgbImage>, Arc<GreyImage>)> {
        let index = self.chosen_photo;
        if let Some(outcome) = &self.outcome
            && let (Some(picture), Some(error)) = (outcome.rerenders.get(index), outcome.log_errors.get(index))
        {
            return Some((Arc::clone(picture), Arc::clone(error)));
        }
        let look = self.look.as_ref().filter(|_| index == 0)?;
        Some((Arc::clone(&look.rerender), Arc::clone(&look.log_error)))
    }

    /// The newest reflectance.
    pub fn material(&self) -> Option<Arc<MaterialLook>> {
        let whole = self.outcome.as_ref().map(|outcome| Arc::clone(&outcome.material));
        whole.or_else(|| self.look.as_ref().map(|look| Arc::clone(&look.material)))
    }

    /// The newest light, of the photo that is shown where each has its own.
    pub fn light(&self) -> Option<Arc<Environment>> {
        let of_photo = |outcome: &Arc<ObjectOutcome>| {
            outcome.lights.get(self.chosen_photo).or(outcome.lights.first()).map(Arc::clone)
        };
        let whole = self.outcome.as_ref().and_then(of_photo);
        whole.or_else(|| self.look.as_ref().map(|look| Arc::clone(&look.light)))
    }
}

/// A result in one sentence.
fn told(outcome: &ObjectOutcome) -> String {
    let estimate = &outcome.parts.estimate;
    let place = outcome.folder.as_ref().map_or("not written yet".into(), |folder| folder.display().to_string());
    format!(
        "Best initialization: {}; log-RMSE {:.3}; {:.0} s: {place}",
        estimate.start, estimate.picture_log_rmse, estimate.seconds
    )
}
