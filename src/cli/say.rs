//! What is said on standard output and error, where somebody listens.
//!
//! A pipe may be closed and a disk full while a fit goes on: its files are what counts. So a line that cannot be written
//! is lost, where the standard library's `println!` would end the program. Where a text is all that is asked for, that it
//! cannot be written is an error.

use crate::error::{Error, ErrorKind, Result};
use std::fmt::Arguments;
use std::io::{ErrorKind as IoKind, Write};

/// Writes a line to standard output, if it can be written.
pub(super) fn out(line: Arguments<'_>) {
    let _ = writeln!(std::io::stdout().lock(), "{line}");
}

/// Writes a line to standard error, if it can be written.
pub(super) fn error(line: Arguments<'_>) {
    let _ = writeln!(std::io::stderr().lock(), "{line}");
}

/// Writes a whole text to standard output. That the reader has gone, as `head` does after its lines, is no error.
///
/// # Errors
/// `Unwritable` when the operating system refuses otherwise, as on a full disk.
pub(super) fn text(text: &str) -> Result<()> {
    let mut output = std::io::stdout().lock();
    match output.write_all(text.as_bytes()).and_then(|()| output.flush()) {
        Err(source) if source.kind() != IoKind::BrokenPipe => {
            Err(Error::new(ErrorKind::Unwritable, format!("cannot write to the standard output: {source}"))
                .remedy("check where it leads, and the free space there"))
        }
        _ => Ok(()),
    }
}
