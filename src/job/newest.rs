//! A place for one request, between a window and a thread that works for it: the newest request wins.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

/// The place.
pub(super) struct Newest<R> {
    inbox: Mutex<Inbox<R>>,
    arrived: Condvar,
    /// Ends what is in progress; lowered when the next request is taken.
    pub stop: AtomicBool,
}

struct Inbox<R> {
    request: Option<R>,
    /// What is in progress was not asked for: whatever is asked for ends it.
    is_spare: bool,
    is_closed: bool,
}

impl<R> Default for Newest<R> {
    fn default() -> Self {
        let inbox = Inbox { request: None, is_spare: false, is_closed: false };
        Newest { inbox: Mutex::new(inbox), arrived: Condvar::new(), stop: AtomicBool::new(false) }
    }
}

impl<R> Newest<R> {
    fn inbox(&self) -> MutexGuard<'_, Inbox<R>> {
        // Nothing panics while the inbox is held, and its parts are whole at any time.
        self.inbox.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Asks for this next; with `comes_first` it ends what is in progress.
    pub fn put(&self, request: R, comes_first: bool) {
        let mut inbox = self.inbox();
        inbox.request = Some(request);
        self.stop.fetch_or(comes_first || inbox.is_spare, Ordering::Relaxed);
        self.arrived.notify_one();
    }

    /// Drops what is waiting or in progress.
    pub fn cancel(&self) {
        let mut inbox = self.inbox();
        inbox.request = None;
        self.stop.store(true, Ordering::Relaxed);
    }

    /// Ends the thread that takes requests, and what it has in progress.
    pub fn close(&self) {
        self.inbox().is_closed = true;
        self.stop.store(true, Ordering::Relaxed);
        self.arrived.notify_one();
    }

    /// Waits for a request, or takes `spare` work where none is there, told by `true`; `None` at the end.
    pub fn next(&self, spare: &mut Option<R>) -> Option<(R, bool)> {
        let mut inbox = self.inbox();
        loop {
            if inbox.is_closed {
                return None;
            }
            // Lowered while the inbox is held: a request that comes later raises it again.
            self.stop.store(false, Ordering::Relaxed);
            let asked = inbox.request.take().map(|request| (request, false));
            if let Some((request, is_spare)) = asked.or_else(|| spare.take().map(|request| (request, true))) {
                inbox.is_spare = is_spare;
                return Some((request, is_spare));
            }
            inbox = self.arrived.wait(inbox).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_request_wins_and_spare_work_gives_way() {
        let (newest, mut spare) = (Newest::default(), Some(9));
        let is_stopped = || newest.stop.load(Ordering::Relaxed);
        newest.put(1, false);
        newest.put(2, false);
        assert_eq!(newest.next(&mut spare), Some((2, false)));
        newest.put(3, false);
        assert!(!is_stopped(), "what was asked for is finished");
        newest.put(4, true);
        assert!(is_stopped());
        assert_eq!((newest.next(&mut spare), is_stopped()), (Some((4, false)), false));
        assert_eq!((newest.next(&mut spare), spare), (Some((9, true)), None));
        newest.put(5, false);
        assert!(is_stopped(), "spare work is not");
        newest.cancel();
        newest.close();
        assert_eq!(newest.next(&mut spare), None);
    }
}
