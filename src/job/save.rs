//! Keeps the run folder whole while a fit runs.
//!
//! A disk that is full for an hour, or a folder that somebody moved, must not cost a fit: what cannot be written is a
//! warning and is tried again, and the last whole checkpoint stays.

use super::facts::loss_rows;
use super::prepare::RunSettings;
use crate::error::{Error, Finding, Result, Severity};
use crate::export::RunFolder;
use crate::fit::{Fitter, checkpoint};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Time between two checkpoints.
const INTERVAL: Duration = Duration::from_secs(60);
/// Time until a checkpoint that could not be written is tried again.
const RETRY_INTERVAL: Duration = Duration::from_secs(10);

/// The run folder of a fit that runs.
pub(super) struct Saver {
    folder: RunFolder,
    /// When the next checkpoint is due.
    due: Instant,
    /// Why the last attempt failed, as told.
    failure: Option<String>,
}

impl Saver {
    /// A folder whose first files are written already.
    pub fn new(folder: RunFolder) -> Self {
        Saver { folder, due: Instant::now() + INTERVAL, failure: None }
    }

    /// The folder.
    pub fn folder(&self) -> &RunFolder {
        &self.folder
    }

    /// Whether a checkpoint is due.
    pub fn is_due(&self) -> bool {
        Instant::now() >= self.due
    }

    /// Writes a checkpoint with the settings it belongs to. Settings come first: if the program is killed in between, a
    /// resumed fit goes on from the checkpoint before with the new settings, which is sound.
    pub fn save(&mut self, fitter: &Fitter, settings: &RunSettings) -> Result<PathBuf> {
        let outcome = self.write(fitter, settings);
        self.due = Instant::now() + if outcome.is_ok() { INTERVAL } else { RETRY_INTERVAL };
        outcome
    }

    /// Writes the maps that a fit keeps, where it keeps some: what goes on from a checkpoint reads them.
    pub fn write_known_maps(&self, fitter: &Fitter) -> Result<()> {
        let Some(known) = fitter.known_maps() else { return Ok(()) };
        self.folder.write_maps(&known.maps, &known.times_seen)
    }

    fn write(&self, fitter: &Fitter, settings: &RunSettings) -> Result<PathBuf> {
        // A folder that was deleted is made again, with all that a resumed fit needs.
        if !self.folder.is_run() {
            RunFolder::create(self.folder.path())?;
        }
        let mesh = self.folder.file("mesh.obj");
        if !mesh.is_file() {
            crate::export::obj::write(&mesh, fitter.surface().mesh())?;
            self.write_known_maps(fitter)?;
        }
        self.folder.write_settings(settings)?;
        let path = self.folder.checkpoint_path();
        checkpoint::write(&path, fitter.state())?;
        self.folder.write_loss(&loss_rows(fitter.state()))?;
        Ok(path)
    }

    /// What to tell of an attempt: a failure once, until it is another one or is over.
    pub fn news(&mut self, outcome: &Result<PathBuf>) -> Option<Finding> {
        match outcome {
            Ok(_) => self.failure.take().map(|_| {
                let message = "the checkpoint is saved again; nothing was lost";
                Finding::new(Severity::Note, "checkpoint-written-again", message)
            }),
            Err(error) => {
                let text = error.to_string();
                let is_news = self.failure.as_ref() != Some(&text);
                self.failure = Some(text);
                is_news.then(|| not_written(error))
            }
        }
    }
}

fn not_written(error: &Error) -> Finding {
    let message = format!("the checkpoint could not be saved; the fit continues without it: {}", error.message());
    Finding::new(Severity::Warning, "checkpoint-not-written", message).at(error.place().clone()).remedy(format!(
        "{}; it is retried every {} seconds",
        if error.remedy_text().is_empty() { "check free disk space and permissions" } else { error.remedy_text() },
        RETRY_INTERVAL.as_secs()
    ))
}
