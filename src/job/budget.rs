//! A limit on the time that a fit may take.
//!
//! Between two steps the job looks at the clock by itself; within one, a thread of its own raises the flag by which steps
//! are stopped. A step that is stopped changes nothing, so a fit that ends by its budget has the state that it had between
//! two steps, and goes on from there bit for bit. What is written then is made from that state, or from what a descent had
//! reached, and not kept in it.

use crate::error::{Finding, Severity};
use crate::fit::Fitter;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Code of the finding that a report has of a fit which its budget ended.
pub const ENDED_BY_BUDGET: &str = "ended-by-budget";
/// Time between two looks at the clock within a step.
const LOOK_INTERVAL: Duration = Duration::from_millis(20);

/// Seconds that have passed; any clock, so that tests need not wait.
pub type Clock = Arc<dyn Fn() -> f64 + Send + Sync>;

/// Seconds that a fit may take, and the clock that tells how many have passed.
#[derive(Clone)]
pub struct Budget {
    seconds: f64,
    clock: Clock,
}

impl Budget {
    /// So many seconds from now on.
    pub fn of_seconds(seconds: f64) -> Self {
        let began = Instant::now();
        Budget::by_clock(seconds, Arc::new(move || began.elapsed().as_secs_f64()))
    }

    /// So many seconds by a clock that stands at 0 when the fit begins.
    pub fn by_clock(seconds: f64, clock: Clock) -> Self {
        Budget { seconds, clock }
    }

    /// Whether the time is up.
    pub fn is_over(&self) -> bool {
        (self.clock)() >= self.seconds
    }

    /// Does a piece of work with a flag that is raised when `stop` is, and once the time is up.
    pub(super) fn limit<T>(&self, stop: &AtomicBool, work: impl FnOnce(&AtomicBool) -> T) -> T {
        let (flag, done) = (AtomicBool::new(stop.load(Ordering::Relaxed)), AtomicBool::new(false));
        let watch = || {
            while !done.load(Ordering::Relaxed) {
                if stop.load(Ordering::Relaxed) || self.is_over() {
                    flag.store(true, Ordering::Relaxed);
                    return;
                }
                std::thread::park_timeout(LOOK_INTERVAL);
            }
        };
        std::thread::scope(|scope| {
            let name = "patina-clock".to_string();
            match std::thread::Builder::new().name(name).spawn_scoped(scope, watch) {
                Ok(watcher) => {
                    // Ended also when the work panics: the scope waits for the thread.
                    let _ended = Ended { done: &done, watcher: watcher.thread() };
                    work(&flag)
                }
                // Without a thread the clock is looked at between steps only.
                Err(_) => work(stop),
            }
        })
    }

    /// What a report says of a fit that ends here by its budget, within a step of which something was kept or not. To be
    /// asked before the fit is cut short.
    pub(super) fn finding(&self, fitter: &Fitter, has_reached: bool) -> Finding {
        let left = fitter.steps_left();
        let names: Vec<String> = left
            .iter()
            .map(|(name, steps)| if *steps > 1 { format!("{name} ({steps} steps)") } else { name.clone() })
            .collect();
        let (done, total) = (fitter.state().step, fitter.steps_total());
        let maps = match fitter.has_maps() {
            _ if has_reached => "; the maps are those that the first of these had reached",
            true => "",
            false => "; no maps were made yet: theirs are the rough values that the light was sought with",
        };
        let message = format!(
            "the fit ended by its budget of {} seconds after {done} of {total} steps; left out: {}{maps}",
            self.seconds,
            names.join(", ")
        );
        Finding::new(Severity::Warning, ENDED_BY_BUDGET, message)
            .remedy("`patina resume RUN` does what is left, from where the fit ended; or give more --seconds")
    }
}

/// Ends the thread that looks at the clock.
struct Ended<'a> {
    done: &'a AtomicBool,
    watcher: &'a std::thread::Thread,
}

impl Drop for Ended<'_> {
    fn drop(&mut self) {
        self.done.store(true, Ordering::Relaxed);
        self.watcher.unpark();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A clock that stands still until it is set.
    fn by_hand() -> (Arc<AtomicBool>, Budget) {
        let is_late = Arc::new(AtomicBool::new(false));
        let own = Arc::clone(&is_late);
        let clock = move || if own.load(Ordering::Relaxed) { 60.0 } else { 0.0 };
        (is_late, Budget::by_clock(60.0, Arc::new(clock)))
    }

    fn wait_for(flag: &AtomicBool) {
        while !flag.load(Ordering::Relaxed) {
            std::thread::yield_now();
        }
    }

    #[test]
    fn work_is_stopped_when_the_time_is_up_and_when_it_is_asked_for() {
        let (is_late, budget) = by_hand();
        let never = AtomicBool::new(false);
        assert!(!budget.limit(&never, |flag| flag.load(Ordering::Relaxed)));
        budget.limit(&never, |flag| {
            is_late.store(true, Ordering::Relaxed);
            wait_for(flag);
        });
        assert!(budget.is_over() && !never.load(Ordering::Relaxed), "who asked for nothing has asked for nothing");
        let (_, budget) = by_hand();
        let stop = AtomicBool::new(false);
        budget.limit(&stop, |flag| {
            stop.store(true, Ordering::Relaxed);
            wait_for(flag);
        });
        assert!(!budget.is_over());
    }

    #[test]
    fn no_time_is_over_at_once() {
        assert!(Budget::of_seconds(0.0).is_over() && !Budget::of_seconds(f64::MAX).is_over());
    }
}
