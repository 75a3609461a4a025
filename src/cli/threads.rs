//! The threads that everything works on.

use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use std::error::Error as _;

/// Starts the threads: as many as asked for, at most one a processor. Returns what to tell when that are fewer.
///
/// # Errors
/// `Internal` when the system refuses to start them.
pub(super) fn start(asked: Option<usize>) -> Result<Option<Finding>> {
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    let threads = asked.map(|asked| asked.min(processors));
    // 0 is as many as there are processors, or as the environment says.
    if let Err(failure) = rayon::ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).build_global()
        && let Some(source) = failure.source()
    {
        // Without a source a pool exists already, as in tests: then that one serves.
        let message = format!("the threads to work on cannot be started: {source}");
        return Err(Error::new(ErrorKind::Internal, message)
            .at(Place::Setting("threads".into()))
            .remedy("free memory or raise the limit of the account, or give fewer with --threads"));
    }
    let finding = asked.filter(|asked| *asked > processors).map(|asked| {
        let message = format!("{asked} threads are more than the {processors} processors here: {processors} are used");
        Finding::new(Severity::Note, "threads-clamped", message)
    });
    Ok(finding)
}
