//! Work beside the window: reading, preparing, saving. Each task has threads of its own; it can be stopped, it tells how
//! far it is, and a panic in it is an error like any other.

use crate::error::{Error, ErrorKind, Result, text_of_panic};
use crate::job::background;
use crossbeam_channel::{Receiver, bounded};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

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
    title: String,
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

    /// Starts a task under a title such as `reading the scene`.
    pub fn spawn(&mut self, title: impl Into<String>, work: impl FnOnce(&TaskContext) -> Result<T> + Send + 'static) {
        let title = title.into();
        let context = TaskContext {
            stop: Arc::default(),
            progress: Arc::new(Mutex::new((String::new(), 0.0))),
            wake: Arc::clone(&self.wake),
        };
        let (sender, outcome) = bounded(1);
        let own = context.clone();
        let spawned = std::thread::Builder::new().name("patina-task".into()).spawn(move || {
            let result = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
                background::run("patina-task", || work(&own))
            }));
            let result = result.unwrap_or_else(|panic| Err(panicked(panic.as_ref())));
            let _ = sender.send(result);
            (own.wake)();
        });
        // Without a thread the sender is gone, and `finished` tells of it.
        drop(spawned);
        self.running.push(Task { title, context, outcome });
    }

    /// Titles and outcomes of the tasks that ended since the last call.
    pub fn finished(&mut self) -> Vec<(String, Result<T>)> {
        let mut done = Vec::new();
        self.running.retain(|task| match task.outcome.try_recv() {
            Ok(outcome) => {
                done.push((task.title.clone(), outcome));
                false
            }
            Err(crossbeam_channel::TryRecvError::Empty) => true,
            Err(crossbeam_channel::TryRecvError::Disconnected) => {
                let error = Error::new(ErrorKind::Internal, "the system gave no thread to work on");
                done.push((task.title.clone(), Err(error.remedy("close other programs and try again"))));
                false
            }
        });
        done
    }

    /// Title, what is being done and the share done of every running task.
    pub fn progress(&self) -> Vec<(String, String, f32)> {
        let read = |task: &Task<T>| {
            let progress = task.context.progress.lock().unwrap_or_else(PoisonError::into_inner);
            (task.title.clone(), progress.0.clone(), progress.1)
        };
        self.running.iter().map(read).collect()
    }

    /// Whether a task with this title runs.
    pub fn is_running(&self, title: &str) -> bool {
        self.running.iter().any(|task| task.title == title)
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

    /// Asks the tasks with this title to end; their outcomes are dropped.
    pub fn stop(&mut self, title: &str) {
        self.running.retain(|task| {
            if task.title == title {
                task.context.stop.store(true, Ordering::Relaxed);
            }
            task.title != title
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
        .remedy("a defect of this program; what was saved before is whole")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wait<T: Send + 'static>(tasks: &mut Tasks<T>) -> (String, Result<T>) {
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
        tasks.spawn("count", |context| {
            context.tell("counting", 0.5);
            Ok(3)
        });
        assert_eq!(wait(&mut tasks).1.unwrap(), 3);
        tasks.spawn("fall", |_| panic!("on purpose"));
        let error = wait(&mut tasks).1.unwrap_err();
        assert!(error.to_string().contains("on purpose"), "{error}");
        assert!(!tasks.is_busy());
    }

    #[test]
    fn a_stopped_task_is_told_and_forgotten() {
        let (sender, ended) = bounded(1);
        let mut tasks = Tasks::new(Arc::new(|| {}));
        tasks.spawn("wait", move |context| {
            while context.check().is_ok() {
                std::thread::yield_now();
            }
            let _ = sender.send(());
            Ok(())
        });
        tasks.stop("wait");
        ended.recv().unwrap();
        assert!(tasks.finished().is_empty() && !tasks.is_busy());
    }
}
