//! Seconds since a process began.

use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Clock ticks a second in `/proc/self/stat`: a constant of Linux towards programs.
const TICKS_A_SECOND: f64 = 100.0;

/// Wall-clock seconds since the process was started, less what is left out on purpose.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    made: Instant,
    /// Seconds between the start of the process and `made`.
    before: f64,
    left_out: Duration,
}

impl Clock {
    /// A clock that began when the process was started: `began` in seconds since 1970 as the parent noted them, now when
    /// it is not known.
    pub fn since(began: Option<f64>) -> Self {
        let before = began.map_or(0.0, |began| (now() - began).max(0.0));
        Clock { made: Instant::now(), before, left_out: Duration::ZERO }
    }

    /// Seconds so far.
    pub fn seconds(&self) -> f64 {
        self.before + self.made.elapsed().saturating_sub(self.left_out).as_secs_f64()
    }

    /// Does work that does not count.
    pub fn without<T>(&mut self, work: impl FnOnce() -> T) -> T {
        let began = Instant::now();
        let outcome = work();
        self.left_out += began.elapsed();
        outcome
    }
}

/// Seconds since 1970.
pub fn now() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64())
}

/// Seconds of processor time of this process, over all threads; `None` where the system does not tell. On a machine that
/// others share it says more than the wall clock.
pub fn processor_seconds() -> Option<f64> {
    processor_seconds_of_stat(&std::fs::read_to_string("/proc/self/stat").ok()?)
}

/// User and system time of a line of `stat`; the name of the program stands in brackets and may hold anything.
fn processor_seconds_of_stat(stat: &str) -> Option<f64> {
    let (_, rest) = stat.rsplit_once(')')?;
    let mut times = rest.split_whitespace().skip(11).map(|field| field.parse::<u64>().ok());
    Some((times.next()?? + times.next()??) as f64 / TICKS_A_SECOND)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn processor_time_is_found_behind_a_strange_name() {
        let stat = "7 (a) b) R 1 2 3 4 5 6 7 8 9 10 150 50 0 0 20 0";
        assert_eq!(processor_seconds_of_stat(stat), Some(2.0));
        assert_eq!(processor_seconds_of_stat("7 a R"), None);
    }

    #[test]
    fn what_is_left_out_does_not_count_and_the_start_of_the_process_does() {
        let mut clock = Clock::since(Some(now() - 100.0));
        clock.without(|| std::thread::sleep(Duration::from_millis(400)));
        let counted = clock.seconds();
        let all = 100.0 + clock.made.elapsed().as_secs_f64();
        assert!(counted >= 100.0 && all - counted >= 0.4, "{counted} of {all}");
    }
}
