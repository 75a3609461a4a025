//! The program as a process.

use std::path::PathBuf;
use std::process::Command;

/// `patina`, as `cargo test` has built it beside the tests.
pub fn patina() -> Command {
    let mut path = std::env::current_exe().unwrap();
    path.pop();
    if path.ends_with("deps") {
        path.pop();
    }
    let program: PathBuf = path.join(format!("patina{}", std::env::consts::EXE_SUFFIX));
    assert!(program.is_file(), "{} is not built: cargo test builds it, cargo test --lib does not", program.display());
    Command::new(program)
}
