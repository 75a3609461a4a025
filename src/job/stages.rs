//! The stages of opening something, each told before and after, none begun once a stop flag is raised.

use crate::error::{Error, ErrorKind, Result};
use std::sync::atomic::{AtomicBool, Ordering};

/// What is being done on the way.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum OpenStage {
    /// Reading the scene.
    Read,
    /// The pre-flight check.
    Check,
    /// Rendering the photographs of the demo.
    Photograph,
    /// Making the atlas.
    Atlas,
    /// Building the structure that rays walk.
    Tracer,
    /// Reading maps and light, or a checkpoint.
    Maps,
    /// Choosing where the fit begins.
    Start,
}

impl OpenStage {
    /// In a few words, for a progress bar.
    pub fn label(self) -> &'static str {
        match self {
            OpenStage::Read => "reading the scene",
            OpenStage::Check => "checking the scene",
            OpenStage::Photograph => "photographing the demo scene",
            OpenStage::Atlas => "making the atlas",
            OpenStage::Tracer => "preparing the tracer",
            OpenStage::Maps => "reading the run",
            OpenStage::Start => "choosing a start",
        }
    }
}

/// Hears of each stage, and of the share of it that is done, in [0, 1]; may be called from any thread.
pub type Tell<'a> = &'a (dyn Fn(OpenStage, f32) + Sync);

/// Does a stage: told before and after, not begun when the flag is raised.
pub(super) fn told<T>(stage: OpenStage, stop: &AtomicBool, tell: Tell, work: impl FnOnce() -> Result<T>) -> Result<T> {
    if stop.load(Ordering::Relaxed) {
        return Err(Error::new(ErrorKind::Stopped, format!("stopped before {}", stage.label())));
    }
    tell(stage, 0.0);
    let outcome = work()?;
    tell(stage, 1.0);
    Ok(outcome)
}
