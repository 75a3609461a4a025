//! A job begins: its thread, what it is talked to by, and what becomes of an error or a panic.

use super::handle::{JobHandle, JobOptions};
use super::prepare::{Prepared, RunSettings};
use super::save::Saver;
use super::teller::Teller;
use super::worker::Worker;
use super::{Event, Slot};
use crate::error::{Error, ErrorKind, Result, text_of_panic};
use crate::export::RunFolder;
use crate::fit::Fitter;
use crossbeam_channel::unbounded;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// Starts a job over a prepared scene. `fitter` may be new or resumed; results go to `folder`.
///
/// # Errors
/// `Internal` when no thread can be started, `Unwritable` when another fit holds the folder. What goes wrong later is told as [`Event::Failed`].
pub fn start(prepared: Prepared, fitter: Fitter, settings: RunSettings, folder: RunFolder) -> Result<JobHandle> {
    start_with(prepared, fitter, settings, folder, JobOptions::default())
}

/// [`start`] with options.
///
/// # Errors
/// As of [`start`].
pub fn start_with(
    prepared: Prepared,
    fitter: Fitter,
    settings: RunSettings,
    folder: RunFolder,
    options: JobOptions,
) -> Result<JobHandle> {
    let folder = folder.held()?;
    // Neither channel makes its sender wait; what is sent is little, since progress is dropped when nobody reads it.
    let (commands, command_receiver) = unbounded();
    let (event_sender, events) = unbounded();
    let snapshot = Arc::new(Slot::default());
    let stop = Arc::new(AtomicBool::new(false));
    let teller = Teller { events: event_sender, wake: options.wake };
    let first_of_session = fitter.state().step;
    let worker = Worker {
        fitter,
        settings,
        saver: Saver::new(folder),
        commands: command_receiver,
        teller: teller.clone(),
        before_step: options.before_step,
        budget: options.budget,
        snapshot: Arc::clone(&snapshot),
        stop: Arc::clone(&stop),
        began: Instant::now(),
        paused: false,
        steps_asked: 0,
        reached: None,
        first_of_session,
        machine_pace: options.machine_pace,
    };
    let thread = std::thread::Builder::new()
        .name("patina-fit".into())
        .spawn(move || {
            let work = move || match options.pool {
                Some(pool) => pool.install(move || worker.run(prepared)),
                None => worker.run(prepared),
            };
            let outcome = std::panic::catch_unwind(std::panic::AssertUnwindSafe(work));
            let error = match outcome {
                Ok(Ok(())) => return,
                Ok(Err(error)) => error,
                Err(panic) => {
                    let message = text_of_panic(&*panic);
                    Error::new(ErrorKind::Internal, format!("the worker of the fit ended unexpectedly: {message}"))
                        .remedy("internal error (please report); the last checkpoint is valid: `patina resume`")
                }
            };
            teller.send(Event::Failed(error));
        })
        .map_err(|source| Error::new(ErrorKind::Internal, format!("cannot start a thread: {source}")))?;
    Ok(JobHandle { commands, events, snapshot, stop, thread: Some(thread) })
}
