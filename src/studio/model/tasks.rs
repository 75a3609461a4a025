//! Work beside the window: reading, preparing, saving. Each task has threads of its own; it can be stopped, it tells how
//! far it is, and a panic in it is an error like any other.

use crate::error::{Error, ErrorKind, Result, text_of_panic};
use crate::job::background;
use crossbeam_channel::{Receiver, bounded};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// What a task does. It names the task, and decides what becomes of it when another scene is opened.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum TaskKind {
    /// Reading a scene or a run.
    Opening,
    /// Reading a run to compare with.
    OpeningOther,
    /// The check of a scene that was read.
    Checking,
    /// The UV atlas and the tracer of a scene that was checked.
    Preparing,
    /// Projecting the photos of a scene onto its mesh.
    LayingPhotos,
    /// Tracing the transport that relights a surface.
    CachingTransport,
    /// Starting or resuming a fit.
    Starting,
    /// Rendering every photo again for its residual.
    Residuals,
    /// Comparing renders under novel lighting with the truth.
    NovelLighting,
    /// The viewport under every environment.
    ContactSheet,
    /// Rendering images to files.
    Saving,
    /// Writing a run for other programs.
    Exporting,
    /// Writing a run at another scale.
    Rescaling,
    /// Reading an environment.
    ReadingEnvironment(PathBuf),
    /// Reading a measured material.
    ReadingMaterial(PathBuf),
    /// A file dialog of the system.
    Choosing,
    /// Reading a result of the single-object workspace.
    OpeningResult,
    /// Writing such a result to another folder.
    SavingResult,
    /// The object under every environment.
    RelightingObject,
    /// Thumbnails of the material library.
    DrawingMaterials,
    /// Preview of the chosen material.
    DrawingMaterial,
}

impl TaskKind {
    /// What is being done, in a few words.
    pub fn words(&self) -> String {
        match self {
            TaskKind::Opening => "Opening".into(),
            TaskKind::OpeningOther => "Opening the other run".into(),
            TaskKind::Checking => "Checking".into(),
            TaskKind::Preparing => "Preparing".into(),
            TaskKind::LayingPhotos => "Projecting photos".into(),
            TaskKind::CachingTransport => "Caching light transport".into(),
            TaskKind::Starting => "Starting the fit".into(),
            TaskKind::Residuals => "Computing residuals".into(),
            TaskKind::NovelLighting => "Comparing under novel lighting".into(),
            TaskKind::ContactSheet => "Rendering the contact sheet".into(),
            TaskKind::Saving => "Rendering".into(),
            TaskKind::Exporting => "Exporting".into(),
            TaskKind::Rescaling => "Rescaling".into(),
            TaskKind::ReadingEnvironment(path) | TaskKind::ReadingMaterial(path) => {
                format!("Reading {}", path.display())
            }
            TaskKind::Choosing => "Choosing a file".into(),
            TaskKind::OpeningResult => "Opening the result".into(),
            TaskKind::SavingResult => "Saving the result".into(),
            TaskKind::RelightingObject => "Relighting the object".into(),
            TaskKind::DrawingMaterials => "Rendering the materials".into(),
            TaskKind::DrawingMaterial => "Rendering the material".into(),
        }
    }

    /// Whether it means nothing once another scene is open, or none. What is read for the library, an image or a result
    /// that is being saved goes on.
    pub fn is_of_scene(&self) -> bool {
        match self {
            TaskKind::Opening
            | TaskKind::OpeningOther
            | TaskKind::Checking
            | TaskKind::Preparing
            | TaskKind::LayingPhotos
            | TaskKind::CachingTransport
            | TaskKind::Starting
            | TaskKind::Residuals
            | TaskKind::NovelLighting
            | TaskKind::ContactSheet => true,
            TaskKind::Saving
            | TaskKind::Exporting
            | TaskKind::Rescaling
            | TaskKind::ReadingEnvironment(_)
            | TaskKind::ReadingMaterial(_)
            | TaskKind::Choosing
            | TaskKind::OpeningResult
            | TaskKind::SavingResult
            | TaskKind::RelightingObject
            | TaskKind::DrawingMaterials
            | TaskKind::DrawingMaterial => false,
        }
    }

    /// Whether a person waits for it and can do little else meanwhile: then it works at the usual priority.
    pub fn is_waited_for(&self) -> bool {
        match self {
            TaskKind::Opening
            | TaskKind::OpeningOther
            | TaskKind::Checking
            | TaskKind::Preparing
            | TaskKind::LayingPhotos
            | TaskKind::Starting
            | TaskKind::Exporting
            | TaskKind::Rescaling
            | TaskKind::ReadingEnvironment(_)
            | TaskKind::ReadingMaterial(_)
            | TaskKind::Choosing
            | TaskKind::OpeningResult
            | TaskKind::SavingResult
            | TaskKind::DrawingMaterial => true,
            TaskKind::Residuals
            | TaskKind::CachingTransport
            | TaskKind::NovelLighting
            | TaskKind::ContactSheet
            | TaskKind::Saving
            | TaskKind::RelightingObject
            | TaskKind::DrawingMaterials => false,
        }
    }
}

/// Called from any thread when the window should look again.
pub type Wake = Arc<dyn Fn() + Send + Sync>;

/// What a task is given.
#[derive(Clone)]
pub struct TaskContext {
    /// Raised when the task should end.
    pub stop: Arc<AtomicBool>,
    progress: Arc<Mutex<(String, f32)>>,
    wake: Wake,
}

impl TaskContext {
    /// Tells what is being done, and the share of it that is done, in [0, 1].
    pub fn tell(&self, what: &str, share: f32) {
        *self.progress.lock().unwrap_or_else(PoisonError::into_inner) = (what.into(), share);
        (self.wake)();
    }

    /// An error when the task should end.
    pub fn check(&self) -> Result<()> {
        match self.stop.load(Ordering::Relaxed) {
            true => Err(Error::new(ErrorKind::Stopped, "stopped as asked")),
            false => Ok(()),
        }
    }
}

struct Task<T> {
    kind: TaskKind,
    context: TaskContext,
    outcome: Receiver<Result<T>>,
}

/// Tasks in progress; `T` is what they bring.
pub struct Tasks<T> {
    running: Vec<Task<T>>,
    wake: Wake,
}

impl<T: Send + 'static> Tasks<T> {
    /// No tasks; `wake` is called when one has news.
    pub fn new(wake: Wake) -> Self {
        Tasks { running: Vec::new(), wake }
    }

    /// Starts a task on threads of its own; one that nobody waits for gives way to the window.
    pub fn spawn(&mut self, kind: TaskKind, work: impl FnOnce(&TaskContext) -> Result<T> + Send + 'static) {
        let is_waited_for = kind.is_waited_for();
        let context = TaskContext {
            stop: Arc::default(),
            progress: Arc::new(Mutex::new((String::new(), 0.0))),
            wake: Arc::clone(&self.wake),
        };
        let (sender, outcome) = bounded(1);
        let own = context.clone();
        let spawned = std::thread::Builder::new().name("patina-task".into()).spawn(move || {
            let result = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| match is_waited_for {
                true => background::run_beside("patina-task", || work(&own)),
                false => background::run("patina-task", || work(&own)),
            }));
            let result = result.unwrap_or_else(|panic| Err(panicked(panic.as_ref())));
            let _ = sender.send(result);
            (own.wake)();
        });
        // Without a thread the sender is gone, and `finished` tells of it.
        drop(spawned);
        self.running.push(Task { kind, context, outcome });
    }

    /// Kinds and outcomes of the tasks that ended since the last call.
    pub fn finished(&mut self) -> Vec<(TaskKind, Result<T>)> {
        let mut done = Vec::new();
        self.running.retain(|task| match task.outcome.try_recv() {
            Ok(outcome) => {
                done.push((task.kind.clone(), outcome));
                false
            }
            Err(crossbeam_channel::TryRecvError::Empty) => true,
            Err(crossbeam_channel::TryRecvError::Disconnected) => {
                let error = Error::new(ErrorKind::Internal, "the system gave no thread to work on");
                done.push((task.kind.clone(), Err(error.remedy("close other programs and try again"))));
                false
            }
        });
        done
    }

    /// Kind, what is being done and the share done of every running task.
    pub fn progress(&self) -> Vec<(TaskKind, String, f32)> {
        let read = |task: &Task<T>| {
            let progress = task.context.progress.lock().unwrap_or_else(PoisonError::into_inner);
            (task.kind.clone(), progress.0.clone(), progress.1)
        };
        self.running.iter().map(read).collect()
    }

    /// Whether a task of this kind runs.
    pub fn is_running(&self, kind: &TaskKind) -> bool {
        self.running.iter().any(|task| task.kind == *kind)
    }

    /// Whether any task runs.
    pub fn is_busy(&self) -> bool {
        !self.running.is_empty()
    }

    /// Asks every task to end; they end by themselves, their outcomes are dropped.
    pub fn stop_all(&mut self) {
        for task in self.running.drain(..) {
            task.context.stop.store(true, Ordering::Relaxed);
        }
    }

    /// Asks the tasks of this kind to end; their outcomes are dropped.
    pub fn stop(&mut self, kind: &TaskKind) {
        self.stop_where(|own| own == kind);
    }

    /// Asks the tasks of a scene to end; their outcomes are dropped.
    pub fn stop_those_of_scene(&mut self) {
        self.stop_where(TaskKind::is_of_scene);
    }

    fn stop_where(&mut self, is_meant: impl Fn(&TaskKind) -> bool) {
        self.running.retain(|task| {
            let is_meant = is_meant(&task.kind);
            if is_meant {
                task.context.stop.store(true, Ordering::Relaxed);
            }
            !is_meant
        });
    }
}

impl<T> Drop for Tasks<T> {
    fn drop(&mut self) {
        for task in &self.running {
            task.context.stop.store(true, Ordering::Relaxed);
        }
    }
}

fn panicked(panic: &(dyn std::any::Any + Send)) -> Error {
    Error::new(ErrorKind::Internal, format!("a task ended unexpectedly: {}", text_of_panic(panic)))
        .remedy("internal error (please report); what was saved before is whole")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wait<T: Send + 'static>(tasks: &mut Tasks<T>) -> (TaskKind, Result<T>) {
        loop {
            if let Some(done) = tasks.finished().pop() {
                return done;
            }
            std::thread::yield_now();
        }
    }

    #[test]
    fn a_task_brings_its_outcome_and_a_panic_is_an_error() {
        let mut tasks = Tasks::new(Arc::new(|| {}));
        tasks.spawn(TaskKind::Opening, |context| {
            context.tell("counting", 0.5);
            Ok(3)
        });
        assert_eq!(wait(&mut tasks).1.unwrap(), 3);
        tasks.spawn(TaskKind::Saving, |_| panic!("on purpose"));
        let error = wait(&mut tasks).1.unwrap_err();
        assert!(error.to_string().contains("on purpose"), "{error}");
        assert!(!tasks.is_busy());
    }

    #[test]
    fn a_stopped_task_is_told_and_forgotten() {
        let (sender, ended) = bounded(1);
        let mut tasks = Tasks::new(Arc::new(|| {}));
        tasks.spawn(TaskKind::Saving, move |context| {
            while context.check().is_ok() {
                std::thread::yield_now();
            }
            let _ = sender.send(());
            Ok(())
        });
        tasks.stop(&TaskKind::Saving);
        ended.recv().unwrap();
        assert!(tasks.finished().is_empty() && !tasks.is_busy());
    }
}
