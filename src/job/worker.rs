//! The thread of a job.

use super::outcome;
use super::prepare::{Prepared, RunSettings};
use super::{Command, Event, Progress, Slot, Snapshot};
use crate::error::{Error, ErrorKind, Result};
use crate::export::RunFolder;
use crate::fit::{Fitter, StepOutcome, checkpoint};
use crate::insight::report::data::StageTime;
use crossbeam_channel::{Receiver, Sender, TryRecvError, bounded};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Seconds between two checkpoints.
const CHECKPOINT_INTERVAL: Duration = Duration::from_secs(60);
/// Seconds between two snapshots, at least; maps of 2048^2 texels take a while to copy.
const SNAPSHOT_INTERVAL: Duration = Duration::from_millis(500);

/// A running job.
pub struct JobHandle {
    /// Where commands go. [`JobHandle::stop`] is better for stopping: it does not wait for a step.
    pub commands: Sender<Command>,
    /// Where events come from.
    pub events: Receiver<Event>,
    /// The newest maps and light.
    pub snapshot: Arc<Slot<Snapshot>>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl JobHandle {
    /// Asks the job to end within a tile of pixels; it writes a checkpoint first.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
        let _ = self.commands.try_send(Command::Stop);
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

/// Starts a job over a prepared scene. `fitter` may be new or resumed; results go to `folder`.
pub fn start(prepared: Prepared, fitter: Fitter, settings: RunSettings, folder: RunFolder) -> Result<JobHandle> {
    let (commands, command_receiver) = bounded(64);
    let (event_sender, events) = bounded(256);
    let snapshot = Arc::new(Slot::default());
    let stop = Arc::new(AtomicBool::new(false));
    let worker = Worker {
        fitter,
        settings,
        folder,
        commands: command_receiver,
        events: event_sender.clone(),
        snapshot: Arc::clone(&snapshot),
        stop: Arc::clone(&stop),
        began: Instant::now(),
        paused: false,
    };
    let thread = std::thread::Builder::new()
        .name("patina-fit".into())
        .spawn(move || {
            let outcome = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| worker.run(prepared)));
            let error = match outcome {
                Ok(Ok(())) => return,
                Ok(Err(error)) => error,
                Err(panic) => {
                    let message = panic.downcast_ref::<String>().map(String::as_str);
                    let message = message.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no message");
                    Error::new(ErrorKind::Internal, format!("the worker of the fit ended unexpectedly: {message}"))
                        .remedy("a defect of this program; the last checkpoint is whole: `patina resume`")
                }
            };
            let _ = event_sender.send(Event::Failed(error));
        })
        .map_err(|source| Error::new(ErrorKind::Internal, format!("cannot start a thread: {source}")))?;
    Ok(JobHandle { commands, events, snapshot, stop, thread: Some(thread) })
}

struct Worker {
    fitter: Fitter,
    settings: RunSettings,
    folder: RunFolder,
    commands: Receiver<Command>,
    events: Sender<Event>,
    snapshot: Arc<Slot<Snapshot>>,
    stop: Arc<AtomicBool>,
    began: Instant,
    paused: bool,
}

impl Worker {
    fn run(mut self, mut prepared: Prepared) -> Result<()> {
        self.folder.write_settings(&self.settings)?;
        crate::export::obj::write(&self.folder.file("mesh.obj"), self.fitter.surface().mesh())?;
        let steps_total = self.fitter.steps_total();
        self.send(Event::Started { steps_done: self.fitter.state().step, steps_total });
        for finding in &prepared.findings {
            self.send(Event::Finding(finding.clone()));
        }
        let mut told_events = 0;
        let mut last_checkpoint = Instant::now();
        let mut last_snapshot: Option<Instant> = None;
        let mut step_once = false;
        loop {
            match self.next_command()? {
                Some(Command::Stop) => return self.end_early(),
                Some(Command::Pause) => self.set_paused(true)?,
                Some(Command::Resume) => self.set_paused(false)?,
                Some(Command::StepOnce) => step_once = true,
                Some(Command::Checkpoint) => self.write_checkpoint()?,
                None => {}
            }
            if self.paused && !step_once {
                continue;
            }
            step_once = false;
            match self.fitter.step(&self.stop)? {
                StepOutcome::Interrupted => return self.end_early(),
                StepOutcome::Finished => break,
                StepOutcome::Stepped(row) => {
                    let state = self.fitter.state();
                    for event in &state.events[told_events..] {
                        let finding = crate::error::Finding::new(crate::Severity::Note, "fit-event", event.clone());
                        self.send(Event::Finding(finding));
                    }
                    told_events = state.events.len();
                    let _ = self.events.try_send(Event::Progress(self.progress(row, steps_total)));
                }
            }
            if last_snapshot.is_none_or(|then| then.elapsed() > SNAPSHOT_INTERVAL) {
                self.put_snapshot();
                last_snapshot = Some(Instant::now());
            }
            if last_checkpoint.elapsed() > CHECKPOINT_INTERVAL {
                self.write_checkpoint()?;
                last_checkpoint = Instant::now();
            }
        }
        self.put_snapshot();
        self.write_checkpoint()?;
        let fit_seconds = self.fitter.state().seconds;
        prepared.timings.push(StageTime { stage: "fit".into(), seconds: fit_seconds });
        let data =
            outcome::write(&self.fitter, prepared, &self.settings, &self.folder, self.began, &self.stop, &|what| {
                self.send(Event::Finishing(what.into()));
            })?;
        self.send(Event::Finished(Box::new(data)));
        Ok(())
    }

    /// The next command; waits for one while paused. A watcher that went away stops the job.
    fn next_command(&mut self) -> Result<Option<Command>> {
        if self.stop.load(Ordering::Relaxed) {
            return Ok(Some(Command::Stop));
        }
        if self.paused {
            // The flag may be raised without a command, so look at it now and then.
            return Ok(self.commands.recv_timeout(Duration::from_millis(50)).ok());
        }
        match self.commands.try_recv() {
            Ok(command) => Ok(Some(command)),
            Err(TryRecvError::Empty | TryRecvError::Disconnected) => Ok(None),
        }
    }

    fn set_paused(&mut self, paused: bool) -> Result<()> {
        if self.paused != paused {
            self.paused = paused;
            self.send(if paused { Event::Paused } else { Event::Resumed });
            if paused {
                self.put_snapshot();
                self.write_checkpoint()?;
            }
        }
        Ok(())
    }

    fn end_early(&self) -> Result<()> {
        self.write_checkpoint()?;
        self.send(Event::Stopped { steps_done: self.fitter.state().step });
        Ok(())
    }

    fn write_checkpoint(&self) -> Result<()> {
        let path = self.folder.checkpoint_path();
        checkpoint::write(&path, self.fitter.state())?;
        self.folder.write_loss(&outcome::loss_rows(self.fitter.state()))?;
        self.send(Event::Checkpoint(path));
        Ok(())
    }

    fn put_snapshot(&self) {
        self.snapshot.put(Snapshot {
            step: self.fitter.state().step,
            maps: self.fitter.maps(),
            environment: self.fitter.environment(),
            losses: self.fitter.state().losses.clone(),
        });
    }

    fn progress(&self, row: crate::fit::LossRow, steps_total: usize) -> Progress {
        let losses = &self.fitter.state().losses;
        // The pace of the last steps of the same stage; later stages are taken to go as fast.
        let same_stage = losses.iter().rev().take_while(|other| other.stage == row.stage).take(12).count();
        let first = losses.len() - same_stage;
        let before = if first > 0 { losses[first - 1].seconds } else { 0.0 };
        let steps_per_second = same_stage as f64 / (row.seconds - before).max(1e-9);
        let seconds_left = (steps_total - row.step) as f64 / steps_per_second;
        Progress { row, steps_total, steps_per_second, seconds_left }
    }

    fn send(&self, event: Event) {
        // Nobody listens any more: the fit goes on, its files are what counts.
        let _ = self.events.send_timeout(event, Duration::from_secs(5));
    }
}
