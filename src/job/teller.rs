//! Where a job tells its events: to a reader that may be slow or gone, and never waited for.

use super::Event;
use super::handle::Wake;
use crossbeam_channel::Sender;

/// Events that may wait for a reader before progress is dropped.
const MOST_WAITING_EVENTS: usize = 256;

/// Where events go.
#[derive(Clone)]
pub(super) struct Teller {
    pub events: Sender<Event>,
    pub wake: Option<Wake>,
}

impl Teller {
    /// Sends an event without waiting; progress only while the reader keeps up.
    pub fn send(&self, event: Event) {
        if matches!(event, Event::Progress(_) | Event::WithinStep(_)) && self.events.len() >= MOST_WAITING_EVENTS {
            return;
        }
        // Nobody listens any more: the fit goes on, its files are what counts.
        let _ = self.events.send(event);
        self.wake();
    }

    pub fn wake(&self) {
        if let Some(wake) = &self.wake {
            wake();
        }
    }
}
