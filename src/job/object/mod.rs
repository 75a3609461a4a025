//! Estimation from photos of one object, as a job: a thread of its own that reads, estimates, renders and writes.
//!
//! The library's [`crate::object`] knows of no thread. Here [`start`] puts it on one: [`ObjectNews`] come out of a
//! channel, and a [`Slot`] holds the newest [`ObjectLook`], painted by a second thread so that the estimation does not
//! wait for its pictures. Whoever is slow misses looks, never the last one.
//!
//! What was reached is never thrown away: a job that is stopped, or whose estimation ends with an error or a panic after
//! its first round, writes the state after its last round. A folder that cannot be written leaves the result in memory,
//! and [`ObjectParts::write`] can be asked again.
//!
//! [`look`] makes what is looked at, [`worker`](self) is the thread, [`parts`] a result that can be written and relit,
//! [`reopen()`] reads one from its folder again.

pub mod look;
pub mod parts;
mod reached;
mod reopen;
mod worker;

pub use look::{MaterialLook, ObjectLook};
pub use parts::ObjectParts;
pub use reached::estimate_as_far_as_it_goes;
pub use reopen::{ReopenedObject, reopen};

use super::{Slot, Wake};
use crate::error::{Error, ErrorKind, Finding, Result, text_of_panic};
use crate::image::{GreyImage, Image, RgbImage};
use crate::light::Environment;
use crate::object::inputs::ObjectInputs;
use crate::object::nodes::NodeGrid;
use crate::object::progress::ObjectiveRow;
use crate::object::result_read::FollowedStart;
use crate::object::settings::ObjectSettings;
use crate::object::split::{Gauge, SplitSpread};
use crossbeam_channel::{Receiver, Sender, unbounded};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

/// What is to be estimated, from what.
#[derive(Clone, Debug)]
pub struct ObjectRequest {
    /// Photos, shape, known lights, and the model.
    pub inputs: ObjectInputs,
    /// Settings.
    pub settings: ObjectSettings,
    /// Lights to show the object under, with their names.
    pub relights: Vec<(String, Arc<Environment>)>,
    /// The result folder: new, empty, or one of an earlier estimation.
    pub output: PathBuf,
}

/// A photo as it was read.
#[derive(Clone, Debug)]
pub struct PhotoSeen {
    /// Short name.
    pub name: String,
    /// Linear radiance.
    pub radiance: Arc<RgbImage>,
    /// Pixels that show the object by mask and shape.
    pub is_object: Arc<Image<bool>>,
}

/// A start that was followed.
#[derive(Clone, Debug, PartialEq)]
pub struct StartFollowed {
    /// Its name.
    pub name: String,
    /// The objective it came to at low resolution.
    pub objective: f64,
    /// Minus the logarithm of its evidence, less that of the best: nats by which it explains the photo worse.
    pub nats_behind: f64,
    /// Whether it explains the photo about as well as the best.
    pub is_as_good: bool,
}

/// What an estimation came to.
#[derive(Clone)]
pub struct ObjectOutcome {
    /// All of it, to be written elsewhere or relit.
    pub parts: Arc<ObjectParts>,
    /// The result folder; `None` when it could not be written.
    pub folder: Option<PathBuf>,
    /// Each photo's re-render at its full size.
    pub rerenders: Vec<Arc<RgbImage>>,
    /// Logarithm of re-render over photo, of luminance; NaN beside the object.
    pub log_errors: Vec<Arc<GreyImage>>,
    /// The reflectance.
    pub material: Arc<MaterialLook>,
    /// The light of each photo, or that of all.
    pub lights: Vec<Arc<Environment>>,
    /// The starts that were followed, the best first; empty when the job was stopped before its end.
    pub starts: Vec<StartFollowed>,
    /// How far apart those are that are as good.
    pub spread: SplitSpread,
    /// Level of the light and the room that physics leaves for it.
    pub gauge: Gauge,
}

impl ObjectOutcome {
    /// The outcome of a result whose re-renders, with their errors, and starts, the best first, are these.
    fn of(
        parts: Arc<ObjectParts>,
        folder: Option<PathBuf>,
        pictures: Vec<(Arc<RgbImage>, Arc<GreyImage>)>,
        spread: SplitSpread,
        followed: Vec<FollowedStart>,
    ) -> Self {
        let best = followed.first().map_or(0.0, |best| best.evidence);
        let starts = followed.into_iter().map(|own| StartFollowed {
            objective: own.objective,
            nats_behind: own.evidence - best,
            is_as_good: spread.starts.contains(&own.start),
            name: own.start,
        });
        let starts = starts.collect();
        let (rerenders, log_errors) = pictures.into_iter().unzip();
        let found = &parts.estimate;
        let gauge = Gauge::of(&found.light, &NodeGrid::new(parts.settings.nodes), &found.table);
        let lights = std::iter::once(&found.light).chain(&found.further_lights);
        let lights = lights.map(|light| Arc::new(light.environment())).collect();
        let material = Arc::new(MaterialLook::of(&parts.reflectance(), None));
        ObjectOutcome { parts, folder, rerenders, log_errors, material, lights, starts, spread, gauge }
    }
}

/// What a job tells.
pub enum ObjectNews {
    /// In words, what is done now.
    Stage(String),
    /// The photos were read.
    Read(Vec<PhotoSeen>),
    /// A step was done.
    Row(ObjectiveRow),
    /// Something the user should know.
    Finding(Finding),
    /// Something failed, and the job goes on with what there is.
    Trouble(Error),
    /// Everything is done and written.
    Finished(Box<ObjectOutcome>),
    /// The job ended early, as asked or by an error that was told before; with what was reached, if a round was.
    Ended(Option<Box<ObjectOutcome>>),
    /// The job ended with nothing.
    Failed(Error),
}

/// A running job.
pub struct ObjectJob {
    /// Where news come from.
    pub news: Receiver<ObjectNews>,
    /// The newest look.
    pub looks: Arc<Slot<ObjectLook>>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl ObjectJob {
    /// Asks the job to end within a step; it writes what was reached first.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }

    /// Waits for the thread to end.
    pub fn join(mut self) {
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

impl Drop for ObjectJob {
    fn drop(&mut self) {
        self.stop();
    }
}

/// What a job may be given beside its request.
#[derive(Default)]
pub struct ObjectJobOptions {
    /// Called after all news and looks, on a thread of the job: it must return at once.
    pub wake: Option<Wake>,
    /// Called after each round with its number; a seam for tests of faults.
    #[doc(hidden)]
    pub after_round: Option<Box<dyn Fn(usize) + Send + Sync>>,
}

/// Where news go.
#[derive(Clone)]
struct Teller {
    news: Sender<ObjectNews>,
    wake: Option<Wake>,
}

impl Teller {
    fn send(&self, news: ObjectNews) {
        // Nobody listens any more: the files are what counts.
        let _ = self.news.send(news);
        self.wake();
    }

    fn wake(&self) {
        if let Some(wake) = &self.wake {
            wake();
        }
    }
}

/// Starts a job. What goes wrong later is told as [`ObjectNews::Failed`].
///
/// # Errors
/// `Internal` when no thread can be started.
pub fn start(request: ObjectRequest, options: ObjectJobOptions) -> Result<ObjectJob> {
    let (sender, news) = unbounded();
    let looks = Arc::new(Slot::default());
    let stop = Arc::new(AtomicBool::new(false));
    let teller = Teller { news: sender, wake: options.wake };
    let worker = worker::Worker {
        request,
        teller: teller.clone(),
        looks: Arc::clone(&looks),
        stop: Arc::clone(&stop),
        after_round: options.after_round,
    };
    let thread = std::thread::Builder::new()
        .name("patina-object".into())
        .spawn(move || {
            let work = || super::background::run("patina-object", || worker.run());
            let error = match std::panic::catch_unwind(std::panic::AssertUnwindSafe(work)) {
                Ok(Ok(())) => return,
                Ok(Err(error)) if error.kind() == ErrorKind::Stopped => return teller.send(ObjectNews::Ended(None)),
                Ok(Err(error)) => error,
                Err(panic) => panicked(&*panic),
            };
            teller.send(ObjectNews::Failed(error));
        })
        .map_err(|source| Error::new(ErrorKind::Internal, format!("cannot start a thread: {source}")))?;
    Ok(ObjectJob { news, looks, stop, thread: Some(thread) })
}

fn panicked(panic: &(dyn std::any::Any + Send)) -> Error {
    Error::new(ErrorKind::Internal, format!("the estimation ended unexpectedly: {}", text_of_panic(panic)))
        .remedy("internal error (please report); try another model or other settings")
}
