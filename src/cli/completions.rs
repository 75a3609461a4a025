//! `patina completions`.

use super::arguments::Arguments;
use super::say;
use crate::error::Result;
use clap::{Args, CommandFactory};
use clap_complete::Shell;

/// Options of `patina completions`.
#[derive(Debug, Args)]
pub struct CompletionsOptions {
    /// The shell.
    #[arg(value_enum)]
    pub shell: Shell,
}

/// Prints the script that completes commands and options in a shell.
pub fn completions(options: &CompletionsOptions) -> Result<()> {
    let mut script = Vec::new();
    // Into memory first: the generator panics where its output is refused.
    clap_complete::generate(options.shell, &mut Arguments::command(), "patina", &mut script);
    say::text(&String::from_utf8_lossy(&script))
}
