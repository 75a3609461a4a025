//! Scenes that are fitted one after the other, each into a run folder of its own.
//!
//! A scene of the queue is opened as a person would open it, fitted by the preset of the queue once it is ready, and left
//! for the next when its report is written. One that cannot be opened or fitted is told and passed over. Who stops a fit of
//! the queue, or opens something else, holds the queue: nothing is taken from under a person's hands.

use super::tasks::TaskKind;
use super::{Model, Phase};
use crate::fit::{FitSettings, Preset};
use crate::job::open::{self, PathKind};
use crate::studio::workspace::Workspace;
use std::path::{Path, PathBuf};

/// How far a scene of the queue is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum QueueState {
    /// It waits for its turn.
    Waiting,
    /// It is opened or fitted.
    AtWork,
    /// Its report is written; the run folder.
    Done(PathBuf),
    /// There is no result, and why.
    NotDone(String),
}

/// A scene of the queue.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct QueuedScene {
    /// Its folder.
    pub path: PathBuf,
    /// How far it is.
    pub state: QueueState,
}

/// Scenes in the order in which they are fitted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneQueue {
    scenes: Vec<QueuedScene>,
    /// Whether no further scene begins by itself.
    pub is_held: bool,
    /// By which preset they are fitted.
    pub preset: Preset,
    /// Whether the scene at work was read, and whether its fit was asked for.
    was_read: bool,
    was_asked: bool,
    /// What was open before it.
    open_before: Option<PathBuf>,
}

impl SceneQueue {
    /// The scenes, in their order.
    pub fn scenes(&self) -> &[QueuedScene] {
        &self.scenes
    }

    /// Scenes that wait.
    pub fn waiting(&self) -> usize {
        self.scenes.iter().filter(|scene| scene.state == QueueState::Waiting).count()
    }

    /// Takes a scene out; the one at work goes on, as a fit that nobody queued.
    pub fn remove(&mut self, path: &Path) {
        self.scenes.retain(|scene| scene.path != path);
    }

    /// Takes out all that are done or passed over.
    pub fn clear_ended(&mut self) {
        self.scenes.retain(|scene| matches!(scene.state, QueueState::Waiting | QueueState::AtWork));
    }

    fn at_work(&self) -> Option<PathBuf> {
        self.scenes.iter().find(|scene| scene.state == QueueState::AtWork).map(|scene| scene.path.clone())
    }

    fn ends(&mut self, path: &Path, state: QueueState) {
        if let Some(scene) = self.scenes.iter_mut().find(|scene| scene.path == path) {
            scene.state = state;
        }
    }
}

impl Model {
    /// Puts scenes at the end of the queue. Runs, and scenes that wait already, are left out and told.
    pub fn queue_scenes(&mut self, paths: Vec<PathBuf>) {
        for path in paths {
            let path = std::path::absolute(&path).unwrap_or(path);
            let is_known = |scene: &QueuedScene| {
                scene.path == path && matches!(scene.state, QueueState::Waiting | QueueState::AtWork)
            };
            if self.queue.scenes.iter().any(is_known) {
                self.log.note(format!("{} is in the queue already", path.display()));
                continue;
            }
            match open::kind_of(&path) {
                Ok(PathKind::Scene) => {
                    self.queue.scenes.retain(|scene| scene.path != path);
                    self.queue.scenes.push(QueuedScene { path, state: QueueState::Waiting });
                }
                Ok(PathKind::Run) => {
                    self.log.note(format!("{} is a run, not a scene: open it to resume it", path.display()));
                }
                Err(error) => self.log.error(&error),
            }
        }
    }

    /// Takes the queue a step further where something has ended. True when something changed.
    pub(super) fn poll_queue(&mut self) -> bool {
        match self.queue.at_work() {
            Some(path) => self.follow_queued(&path),
            None => self.begin_queued(),
        }
    }

    fn begin_queued(&mut self) -> bool {
        let is_busy = self.fit.status.is_live()
            || self.start_is_queued
            || self.workspace == Workspace::Object
            || [TaskKind::Opening, TaskKind::Starting].iter().any(|kind| self.tasks.is_running(kind));
        if self.queue.is_held || is_busy {
            return false;
        }
        let Some(next) = self.queue.scenes.iter_mut().find(|scene| scene.state == QueueState::Waiting) else {
            return false;
        };
        next.state = QueueState::AtWork;
        let path = next.path.clone();
        (self.queue.was_read, self.queue.was_asked) = (false, false);
        self.queue.open_before = self.project.as_ref().and_then(|project| project.path.clone());
        self.log.note(format!("Next in the queue: {}", path.display()));
        self.open(path);
        true
    }

    fn follow_queued(&mut self, path: &Path) -> bool {
        let is_open =
            self.project.as_ref().is_some_and(|project| !project.is_run && project.path.as_deref() == Some(path));
        let (state, holds) = match is_open {
            false if self.tasks.is_running(&TaskKind::Opening) => return false,
            false if self.queue.was_read || self.is_another_open() => {
                (QueueState::NotDone("its project was closed".into()), true)
            }
            false => (QueueState::NotDone("it could not be opened: see Messages".into()), false),
            true => {
                self.queue.was_read = true;
                match self.phase() {
                    Phase::Ready if !self.queue.was_asked => {
                        self.queue.was_asked = true;
                        self.take_preset_of_queue();
                        self.start_fit();
                        return true;
                    }
                    Phase::Finished => {
                        let run = self.fit.folder.as_ref().map(|folder| folder.path().to_path_buf());
                        (QueueState::Done(run.unwrap_or_default()), false)
                    }
                    Phase::Failed(why) => (QueueState::NotDone(why), false),
                    Phase::Unprepared => (QueueState::NotDone("it could not be prepared: see Messages".into()), false),
                    Phase::Stopped => (QueueState::NotDone("stopped".into()), true),
                    Phase::Ready => (QueueState::NotDone("its fit did not start".into()), true),
                    _ => return false,
                }
            }
        };
        self.queue.ends(path, state);
        if holds && self.queue.waiting() > 0 {
            self.queue.is_held = true;
            self.log.note(format!("The queue is paused: {} scenes wait", self.queue.waiting()));
        }
        true
    }

    /// Whether what is open is not what was before the scene at work.
    fn is_another_open(&self) -> bool {
        let open = self.project.as_ref().and_then(|project| project.path.as_ref());
        open.is_some() && open != self.queue.open_before.as_ref()
    }

    fn take_preset_of_queue(&mut self) {
        let suited = self.project.as_ref().and_then(|project| project.suited.as_ref());
        if let (Some(suited), true) = (suited, self.queue.preset != Preset::Balanced) {
            self.edits.fit = suited.resolve(&FitSettings::preset(self.queue.preset), &[]);
        }
    }
}
