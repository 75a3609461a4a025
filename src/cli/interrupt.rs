//! Ctrl-C and SIGTERM: work stops at its next look at a flag, and what is only being opened ends with the program.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Raises a flag on Ctrl-C or SIGTERM; a second one ends the program at once. While something is opened, the program ends
/// within half a second, whatever it is at.
pub fn stop_on_interrupt(stop: Arc<AtomicBool>) {
    // Fails only if a handler exists already, as in tests.
    let _ = ctrlc::set_handler(move || {
        if stop.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
        // What is opened may be deep in a file, a tree or an atlas, and nothing is written yet that could be half done.
        for _ in 0..PATIENCE_ON_OPENING.as_millis() / 20 {
            if !OPENING.load(Ordering::Relaxed) {
                return;
            }
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
        if OPENING.load(Ordering::Relaxed) {
            eprintln!("stopped before the fit began");
            std::process::exit(3);
        }
    });
}

/// Whether something is being opened: no file is written meanwhile.
static OPENING: AtomicBool = AtomicBool::new(false);
/// How long what is opened is waited for when a stop is asked for.
const PATIENCE_ON_OPENING: std::time::Duration = std::time::Duration::from_millis(400);

/// Opens something: a stop asked for meanwhile need not wait for it.
pub fn while_opening<T>(work: impl FnOnce() -> T) -> T {
    OPENING.store(true, Ordering::Relaxed);
    let outcome = work();
    OPENING.store(false, Ordering::Relaxed);
    outcome
}
