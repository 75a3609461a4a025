//! What is said on standard output and error, where somebody listens.
//!
//! A pipe may be closed and a disk full while a fit goes on: its files are what counts. So a line that cannot be written
//! is lost, where the standard library's `println!` would end the program.

use std::fmt::Arguments;
use std::io::Write;

/// Writes a line to standard output, if it can be written.
pub(super) fn out(line: Arguments<'_>) {
    let _ = writeln!(std::io::stdout().lock(), "{line}");
}

/// Writes a line to standard error, if it can be written.
pub(super) fn error(line: Arguments<'_>) {
    let _ = writeln!(std::io::stderr().lock(), "{line}");
}
