//! Whole texts on the standard output.

use crate::error::{Error, ErrorKind, Result};
use std::io::{ErrorKind as IoKind, Write};

/// Writes a text. That the reader has gone, as `head` does after its lines, is no error.
///
/// # Errors
/// `Unwritable` when the operating system refuses otherwise, as on a full disk.
pub fn write(text: &str) -> Result<()> {
    let mut output = std::io::stdout().lock();
    match output.write_all(text.as_bytes()).and_then(|()| output.flush()) {
        Err(source) if source.kind() != IoKind::BrokenPipe => {
            Err(Error::new(ErrorKind::Unwritable, format!("cannot write to the standard output: {source}"))
                .remedy("check where it leads, and the free space there"))
        }
        _ => Ok(()),
    }
}
