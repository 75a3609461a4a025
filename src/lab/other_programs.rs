//! Other programs, started on scripts of this project, and what they print.

use crate::error::{Error, ErrorKind, Place, Result};
use std::path::Path;
use std::process::Command;

/// What to do about a program, on the command that starts it.
#[derive(Clone, Copy, Debug)]
pub struct Remedies {
    /// When it cannot be started.
    pub unstarted: &'static str,
    /// When it ends with an error.
    pub failed: &'static str,
}

/// Starts a program and gives what it prints.
///
/// # Errors
/// `Missing` when it cannot be started, `Unsupported` with its last lines when it fails.
pub fn output_of(command: &mut Command, remedies: Remedies) -> Result<String> {
    let name = command.get_program().to_string_lossy().into_owned();
    let output = command.output().map_err(|source| {
        Error::new(ErrorKind::Missing, format!("{name} cannot be started: {source}")).remedy(remedies.unstarted)
    })?;
    if output.status.success() {
        return Ok(String::from_utf8_lossy(&output.stdout).into_owned());
    }
    let last = last_lines(&String::from_utf8_lossy(&output.stderr));
    Err(Error::new(ErrorKind::Unsupported, format!("{name} ended with {}:\n{last}", output.status))
        .remedy(remedies.failed))
}

/// The last lines of what a program said, without empty ones.
pub fn last_lines(text: &str) -> String {
    let lines: Vec<&str> = text.lines().filter(|line| !line.trim().is_empty()).collect();
    lines[lines.len().saturating_sub(12)..].join("\n")
}

/// A command that starts a script of a folder.
///
/// # Errors
/// `Missing` when the script is not there.
pub fn script(python: &Path, folder: &Path, name: &str) -> Result<Command> {
    let path = folder.join(name);
    if !path.is_file() {
        return Err(Error::new(ErrorKind::Missing, "the script is missing")
            .at(Place::File(path))
            .remedy("name the folder of the scripts with --scripts"));
    }
    let mut command = Command::new(python);
    // A script leaves nothing beside itself.
    command.env("PYTHONDONTWRITEBYTECODE", "1").arg(path);
    Ok(command)
}
