//! What a watcher holds of a running job: where commands go, where events and snapshots come from.

use super::time_left::MachinePace;
use super::{Budget, Command, Event, Slot, Snapshot};
use crossbeam_channel::{Receiver, Sender};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

/// Called after each event and snapshot, on the thread of the fit: it must return at once. A window repaints then.
pub type Wake = Arc<dyn Fn() + Send + Sync>;

/// What a job may be given beside its work.
#[derive(Default)]
pub struct JobOptions {
    /// Called after each event and snapshot.
    pub wake: Option<Wake>,
    /// Threads of its own; the usual ones when not given. Results do not depend on it.
    pub pool: Option<rayon::ThreadPool>,
    /// How long the fit may take; as long as it needs when not given. It ends by then with what there is, as any fit ends,
    /// and can be taken up.
    pub budget: Option<Budget>,
    /// How long steps take on this machine, as fits before have shown; only what is told of the time left depends on it.
    pub machine_pace: MachinePace,
    /// Called before each step with the number of steps done; a seam for tests of faults.
    #[doc(hidden)]
    pub before_step: Option<Box<dyn FnMut(usize) + Send>>,
}

/// A running job.
pub struct JobHandle {
    /// Where commands go. [`JobHandle::stop`] is better for stopping: it does not wait for a step.
    pub commands: Sender<Command>,
    /// Where events come from.
    pub events: Receiver<Event>,
    /// The newest maps and light; while a fit runs, newer ones are put once these were looked at.
    pub snapshot: Arc<Slot<Snapshot>>,
    pub(super) stop: Arc<AtomicBool>,
    pub(super) thread: Option<JoinHandle<()>>,
}

impl JobHandle {
    /// Asks the job to end within a tile of pixels; it writes a checkpoint first.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
        let _ = self.commands.send(Command::Stop);
    }

    /// A flag that stops the job when raised; for signal handlers.
    pub fn stop_flag(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.stop)
    }

    /// Waits for the thread to end.
    pub fn join(mut self) {
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

impl Drop for JobHandle {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}
