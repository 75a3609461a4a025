//! `patina completions`.

use super::say;
use crate::error::Result;
use clap::{Args, Command};
use clap_complete::Shell;

/// Options of `patina completions`.
#[derive(Debug, Args)]
pub struct CompletionsOptions {
    /// The shell.
    #[arg(value_enum)]
    pub shell: Shell,
}

/// Prints the script that completes the commands and options of `patina` in a shell.
pub fn completions(options: &CompletionsOptions, mut patina: Command) -> Result<()> {
    let mut script = Vec::new();
    // Into memory first: the generator panics where its output is refused.
    clap_complete::generate(options.shell, &mut patina, "patina", &mut script);
    say::text(&String::from_utf8_lossy(&script))
}
