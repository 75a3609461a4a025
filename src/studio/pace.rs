//! How often the window follows a fit nobody touches: as often as costs the fit little, and no more.
//!
//! Two things cost: a frame, and taking in a snapshot (its maps are converted, uploaded and drawn). Both are measured as
//! they happen, by the clock, and are given rests so long that each takes no more than half of the window's share of the
//! time. Beside a fit on all processors a clock counts other threads' turns too, so the share is rather kept than used.
//! Frames that a person causes are not counted and never held back.

use super::model::FitStatus;
use super::model::store::Follow;
use super::model::tasks::Wake;
use egui::Context;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Share of the time that following may cost with a graphics card.
const SHARE_CARD: f64 = 0.05;
/// The same where the processor draws.
const SHARE_SOFTWARE: f64 = 0.08;
/// Least and most seconds between two frames that nobody asked for.
const FRAME_INTERVAL: (f64, f64) = (0.25, 4.0);
/// Least and most seconds between two snapshots that are taken in.
const SNAPSHOT_INTERVAL: (f64, f64) = (0.5, 120.0);
/// Seconds between two frames while something is about to change that was asked for: the change itself wakes the window,
/// and frames would only put it off.
const SOON: f64 = 0.5;
/// A cost is measured anew after so many frames.
const FRAMES_BETWEEN_MEASURES: u32 = 16;
/// Weight of a new cost against those before.
const WEIGHT: f64 = 0.5;

/// What a frame that is being measured holds.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Measure {
    /// Nothing but a look at the fit.
    Plain,
    /// The first picture of a new snapshot.
    Redraw,
}

/// The pace of the window.
pub struct Pace {
    /// The next frame that nobody asked for.
    due: Arc<Mutex<Instant>>,
    share: f64,
    frame_seconds: Option<f64>,
    snapshot_seconds: Option<f64>,
    measuring: Option<Measure>,
    began: Instant,
    frames_unmeasured: u32,
    /// When the last snapshot was taken in, what it cost so far, and the seconds of uploads before.
    snapshot: Option<(Instant, f64, f64)>,
    redraw_is_due: bool,
    draw_seconds: f64,
}

impl Pace {
    /// A pace that knows no costs yet.
    pub fn new(is_software: bool) -> Self {
        let now = Instant::now();
        Pace {
            due: Arc::new(Mutex::new(now)),
            share: if is_software { SHARE_SOFTWARE } else { SHARE_CARD },
            frame_seconds: None,
            snapshot_seconds: None,
            measuring: None,
            began: now,
            frames_unmeasured: FRAMES_BETWEEN_MEASURES,
            snapshot: None,
            redraw_is_due: false,
            draw_seconds: 0.0,
        }
    }

    /// What a fit calls when it has news: the window looks when it is due, not at every step.
    pub fn wake(&self, context: Context) -> Wake {
        let due = Arc::clone(&self.due);
        Arc::new(move || {
            let due = *due.lock().unwrap_or_else(PoisonError::into_inner);
            let rest = due.saturating_duration_since(Instant::now());
            context.request_repaint_after(rest.max(Duration::from_millis(50)));
        })
    }

    /// A frame begins. `finish` waits for the drawing of the last one, where that is done by the processor.
    pub fn begin(&mut self, finish: impl FnOnce()) {
        if let Some(measure) = self.measuring.take() {
            finish();
            let seconds = self.began.elapsed().as_secs_f64();
            match measure {
                Measure::Plain => {
                    self.frame_seconds = Some(mixed(self.frame_seconds, seconds));
                    self.frames_unmeasured = 0;
                }
                Measure::Redraw => {
                    if let Some((_, cost, _)) = &mut self.snapshot {
                        *cost += seconds;
                    }
                }
            }
        }
        self.began = Instant::now();
    }

    /// Whether a snapshot of a fit in this state is to be taken in now, if there is a newer one.
    pub fn takes_snapshot(&self, follow: Follow, is_uploading: bool) -> bool {
        let least = match follow {
            Follow::Live => SNAPSHOT_INTERVAL.0,
            Follow::Seldom => 5.0,
            Follow::Off => return false,
        };
        let Some((at, ..)) = &self.snapshot else { return true };
        !is_uploading && at.elapsed().as_secs_f64() >= self.snapshot_interval().max(least)
    }

    /// The panels were drawn in so many seconds. `took_snapshot` where their maps are new, `upload_seconds` is what all
    /// uploads to the stage took so far. True when another frame is to follow at once, so that the cost of this one is known.
    pub fn drawn(&mut self, took_snapshot: bool, is_uploading: bool, upload_seconds: f64, follows: bool) -> bool {
        let seconds = self.began.elapsed().as_secs_f64();
        if took_snapshot {
            if let Some((_, cost, before)) = self.snapshot {
                self.snapshot_seconds = Some(mixed(self.snapshot_seconds, cost + (upload_seconds - before).max(0.0)));
            }
            self.snapshot = Some((Instant::now(), (seconds - self.draw_seconds).max(0.0), upload_seconds));
            self.redraw_is_due = true;
            return false;
        }
        self.draw_seconds += 0.2 * (seconds - self.draw_seconds);
        if self.redraw_is_due
            && let (Some((_, cost, _)), Some(frame)) = (&mut self.snapshot, self.frame_seconds)
        {
            // Frames between a snapshot and the last of its uploads would not be drawn without it.
            *cost += frame;
        }
        self.frames_unmeasured = self.frames_unmeasured.saturating_add(1);
        if !follows {
            return false;
        }
        if self.redraw_is_due && !is_uploading {
            self.redraw_is_due = false;
            self.measuring = Some(Measure::Redraw);
        } else if self.frames_unmeasured >= FRAMES_BETWEEN_MEASURES && !is_uploading {
            self.measuring = Some(Measure::Plain);
        }
        self.measuring.is_some()
    }

    /// How long the window may rest when nothing happens; `None` where it waits to be woken.
    pub fn rest(&mut self, status: &FitStatus, follow: Follow, has_tasks: bool) -> Option<Duration> {
        let seconds = match status {
            FitStatus::Pausing | FitStatus::Stopping => Some(SOON),
            FitStatus::Running | FitStatus::Finishing(_) => Some(match follow {
                Follow::Live => self.frame_interval(),
                Follow::Seldom | Follow::Off => self.frame_interval().max(1.0),
            }),
            _ if has_tasks => Some(0.2),
            _ => None,
        };
        let rest = seconds.map(Duration::from_secs_f64);
        *self.due.lock().unwrap_or_else(PoisonError::into_inner) = Instant::now() + rest.unwrap_or_default();
        rest
    }

    /// The next fit begins: its first snapshot is taken in at once.
    pub fn restart(&mut self) {
        self.snapshot = None;
        self.snapshot_seconds = None;
    }

    fn frame_interval(&self) -> f64 {
        let (least, most) = FRAME_INTERVAL;
        self.frame_seconds.map_or(least, |seconds| seconds / (0.5 * self.share)).clamp(least, most)
    }

    fn snapshot_interval(&self) -> f64 {
        let (least, most) = SNAPSHOT_INTERVAL;
        self.snapshot_seconds.map_or(2.0 * least, |seconds| seconds / (0.5 * self.share)).clamp(least, most)
    }
}

fn mixed(known: Option<f64>, new: f64) -> f64 {
    known.map_or(new, |known| known + WEIGHT * (new - known))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rests_grow_with_what_a_frame_costs_and_stay_within_reason() {
        let mut pace = Pace::new(true);
        let rest = |pace: &mut Pace, status: &FitStatus| pace.rest(status, Follow::Live, false);
        assert_eq!(rest(&mut pace, &FitStatus::Running), Some(Duration::from_millis(250)));
        pace.frame_seconds = Some(0.04);
        assert_eq!(rest(&mut pace, &FitStatus::Running), Some(Duration::from_secs(1)));
        pace.frame_seconds = Some(9.0);
        assert_eq!(rest(&mut pace, &FitStatus::Running), Some(Duration::from_secs(4)));
        assert_eq!(rest(&mut pace, &FitStatus::Pausing), Some(Duration::from_millis(500)));
        assert_eq!(rest(&mut pace, &FitStatus::Paused), None);
        assert_eq!(pace.rest(&FitStatus::Idle, Follow::Live, true), Some(Duration::from_millis(200)));
        assert!(Pace::new(false).share < pace.share);
    }

    #[test]
    fn a_costly_snapshot_is_followed_by_a_long_rest_and_the_first_is_taken_at_once() {
        let mut pace = Pace::new(true);
        assert!(pace.takes_snapshot(Follow::Live, false) && !pace.takes_snapshot(Follow::Off, false));
        pace.begin(|| {});
        assert!(!pace.drawn(true, true, 0.0, true));
        assert!(!pace.takes_snapshot(Follow::Live, false));
        // Its upload took four seconds: at a twenty-fifth of the time the next but one comes after a hundred.
        pace.begin(|| {});
        pace.drawn(true, true, 4.0, true);
        assert!((pace.snapshot_interval() - 100.0).abs() < 1.0, "{}", pace.snapshot_interval());
        pace.restart();
        assert!(pace.takes_snapshot(Follow::Live, false));
    }

    #[test]
    fn a_frame_is_measured_once_and_then_not_for_a_while() {
        let mut pace = Pace::new(true);
        pace.begin(|| {});
        assert!(pace.drawn(false, false, 0.0, true), "the first cost is not known");
        let mut finished = false;
        pace.begin(|| finished = true);
        assert!(finished && pace.frame_seconds.is_some());
        for _ in 0..FRAMES_BETWEEN_MEASURES - 1 {
            assert!(!pace.drawn(false, false, 0.0, true));
            pace.begin(|| panic!("waits without need"));
        }
        assert!(pace.drawn(false, false, 0.0, true));
    }
}
