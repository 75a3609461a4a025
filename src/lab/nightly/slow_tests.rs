//! Tests that the gate leaves out for the time they take: by cargo, in a process of its own.

use super::Outcome;
use crate::error::{Error, ErrorKind, Result};
use std::fs::File;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// How often the process is looked at.
const INTERVAL: Duration = Duration::from_millis(200);

/// Every test marked `#[ignore]`, those of the lab too, passes. What cargo says is left in the folder as `cargo.log`.
pub fn pass(folder: &Path, stop: &AtomicBool) -> Result<Outcome> {
    let manifest = Path::new("Cargo.toml");
    if !manifest.is_file() {
        return Ok(Outcome::LeftOut("no Cargo.toml here: run it from the root of the source".into()));
    }
    let log = folder.join("cargo.log");
    let written = File::create(&log).map_err(|source| Error::writing(&log, source))?;
    let again = written.try_clone().map_err(|source| Error::writing(&log, source))?;
    let mut child = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
        // A test that finds neither data nor an adapter fails here: passing it over would count as passed.
        .env("PATINA_REQUIRE", std::env::var_os("PATINA_REQUIRE").unwrap_or_else(|| "adapter,data".into()))
        .args(["test", "--lib", "--features", "lab", "--", "--ignored"])
        .stdin(Stdio::null())
        .stdout(written)
        .stderr(again)
        .spawn()
        .map_err(|source| Error::reading("cargo".as_ref(), source))?;
    while child.try_wait().map_err(|source| Error::reading("cargo".as_ref(), source))?.is_none() {
        if stop.load(Ordering::Relaxed) {
            let _ = child.kill();
            let _ = child.wait();
            return Err(Error::new(ErrorKind::Stopped, "stopped while tests ran"));
        }
        std::thread::sleep(INTERVAL);
    }
    let text = std::fs::read(&log).map_err(|source| Error::reading(&log, source))?;
    Ok(outcome(&String::from_utf8_lossy(&text), &log))
}

/// What a log of cargo says: only tests that ran count.
fn outcome(text: &str, log: &Path) -> Outcome {
    let verdicts = |word: &str| -> Vec<&str> {
        let of_line = |line: &str| line.starts_with("test ") && line.ends_with(word);
        let name = |line| str::split_whitespace(line).nth(1).unwrap_or_default();
        text.lines().filter(|line| of_line(line)).map(name).collect()
    };
    let (passed, failed) = (verdicts("... ok").len(), verdicts("... FAILED"));
    let ended = text.lines().any(|line| line.starts_with("test result: "));
    match (ended, failed.is_empty()) {
        (true, true) if passed > 0 => Outcome::Holds(format!("{passed} tests passed")),
        (true, false) => {
            Outcome::FallsShort(format!("of {} tests failed {}", passed + failed.len(), failed.join(", ")))
        }
        _ => Outcome::FallsShort(format!("no test ran to its end, see {}", log.display())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_is_read_by_what_ran() {
        let log = Path::new("cargo.log");
        let of = |text: &str| outcome(text, log);
        let two = "test a::b ... ok\ntest c::d ... FAILED\n\ntest result: FAILED. 1 passed; 1 failed;\n";
        assert_eq!(of(two), Outcome::FallsShort("of 2 tests failed c::d".into()));
        let one = "test a::b ... ok\n\ntest result: ok. 1 passed; 0 failed; 900 filtered out\n";
        assert_eq!(of(one), Outcome::Holds("1 tests passed".into()));
        for nothing in ["error: could not compile", "test a::b ... ok\n", "test result: ok. 0 passed; 0 failed;\n", ""]
        {
            assert!(matches!(of(nothing), Outcome::FallsShort(_)), "{nothing}");
        }
    }
}
