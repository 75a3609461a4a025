//! Something on the graphics adapter that follows something behind an [`Arc`], made on another thread when it is large.

use crate::material::LobeModel;
use eframe::egui;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::time::Instant;

/// Whether two handles are of the same thing; not whether the things are equal.
pub(super) trait Same {
    fn same(&self, other: &Self) -> bool;
}

impl<T> Same for Arc<T> {
    fn same(&self, other: &Self) -> bool {
        Arc::ptr_eq(self, other)
    }
}

impl<T: Same> Same for Option<T> {
    fn same(&self, other: &Self) -> bool {
        match (self, other) {
            (Some(one), Some(other)) => one.same(other),
            (None, None) => true,
            _ => false,
        }
    }
}

impl Same for LobeModel {
    fn same(&self, other: &Self) -> bool {
        self == other
    }
}

impl<T: Same, U: Same> Same for (T, U) {
    fn same(&self, other: &Self) -> bool {
        self.0.same(&other.0) && self.1.same(&other.1)
    }
}

/// How the thing wanted is made.
pub(super) enum Speed<'a> {
    /// Now, within the frame.
    Now,
    /// On another thread, which wakes the window; the last one stays until then.
    Later(&'a egui::Context),
    /// On another thread; whatever frame comes next shows it.
    Quietly,
}

/// What is shown of a handle `K`, and what is being made of a newer one.
pub(super) struct Slot<K, G> {
    shown: Option<(K, G)>,
    /// What was shown before, the newest last; it is shown again at once.
    earlier: Vec<(K, G)>,
    /// How many of these are kept.
    kept: usize,
    pending: Option<(K, Receiver<(G, f64)>)>,
    /// A handle whose making broke: it is not tried again.
    broken: Option<K>,
    /// Seconds that other threads took to make what was shown so far.
    seconds: f64,
}

impl<K, G> Default for Slot<K, G> {
    fn default() -> Self {
        Slot { shown: None, earlier: Vec::new(), kept: 0, pending: None, broken: None, seconds: 0.0 }
    }
}

impl<K: Same + Clone + Send + 'static, G: Send + 'static> Slot<K, G> {
    /// One that keeps so many of what it showed before.
    pub fn keeping(kept: usize) -> Self {
        Slot { kept, ..Slot::default() }
    }

    /// What there is to draw with.
    pub fn shown(&self) -> Option<&G> {
        self.shown.as_ref().map(|(_, made)| made)
    }

    /// Whether something newer is being made.
    pub fn is_pending(&self) -> bool {
        self.pending.is_some()
    }

    /// Seconds that other threads took to make what was shown so far.
    pub fn seconds(&self) -> f64 {
        self.seconds
    }

    /// Follows the handle; whether what is shown is another than before.
    pub fn follow(&mut self, wanted: Option<K>, speed: Speed<'_>, make: impl FnOnce(&K) -> G + Send + 'static) -> bool {
        let Some(wanted) = wanted else {
            self.pending = None;
            return self.shown.take().is_some();
        };
        let mut changed = self.collect(matches!(speed, Speed::Now));
        let known = |known: Option<&K>| known.is_some_and(|known| known.same(&wanted));
        if known(self.shown.as_ref().map(|(key, _)| key)) || self.pending.is_some() || known(self.broken.as_ref()) {
            return changed;
        }
        if let Some(index) = self.earlier.iter().position(|(key, _)| key.same(&wanted)) {
            let (key, made) = self.earlier.remove(index);
            self.show(key, made);
            return true;
        }
        match speed {
            Speed::Now => {
                let made = make(&wanted);
                self.show(wanted, made);
                changed = true;
            }
            Speed::Later(_) | Speed::Quietly => {
                let (sender, receiver) = channel();
                let context = if let Speed::Later(context) = speed { Some(context.clone()) } else { None };
                let key = wanted.clone();
                let work = move || {
                    // The window may be gone meanwhile.
                    let began = Instant::now();
                    let made = make(&key);
                    let _ = sender.send((made, began.elapsed().as_secs_f64()));
                    if let Some(context) = context {
                        context.request_repaint();
                    }
                };
                match std::thread::Builder::new().name("stage upload".into()).spawn(work) {
                    Ok(_) => self.pending = Some((wanted, receiver)),
                    Err(_) => self.broken = Some(wanted),
                }
            }
        }
        changed
    }

    fn show(&mut self, key: K, made: G) {
        self.earlier.extend(self.shown.replace((key, made)));
        if self.earlier.len() > self.kept {
            self.earlier.remove(0);
        }
    }

    /// Takes what has been made; whether there was something. Of several handles the newest is made once the last is done.
    fn collect(&mut self, wait: bool) -> bool {
        let Some((key, receiver)) = self.pending.take() else { return false };
        let result = if wait { receiver.recv().map_err(|_| TryRecvError::Disconnected) } else { receiver.try_recv() };
        match result {
            Ok((made, seconds)) => {
                self.seconds += seconds;
                self.show(key, made);
                true
            }
            Err(TryRecvError::Empty) => {
                self.pending = Some((key, receiver));
                false
            }
            Err(TryRecvError::Disconnected) => {
                self.broken = Some(key);
                false
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_handle_is_made_once_and_an_equal_one_anew() {
        let mut slot = Slot::<Arc<u32>, u32>::default();
        let (one, other) = (Arc::new(3), Arc::new(3));
        assert!(slot.follow(Some(one.clone()), Speed::Now, |key| **key + 1));
        assert!(!slot.follow(Some(one), Speed::Now, |_| panic!("made twice")));
        assert!(slot.follow(Some(other), Speed::Now, |key| **key + 2));
        assert_eq!(slot.shown(), Some(&5));
        assert!(slot.follow(None, Speed::Now, |key| **key) && slot.shown().is_none());
    }

    #[test]
    fn what_was_shown_a_while_ago_is_shown_again_without_being_made_again() {
        let mut slot = Slot::<Arc<u32>, u32>::keeping(2);
        let handles: Vec<Arc<u32>> = (0..4).map(Arc::new).collect();
        for handle in &handles {
            slot.follow(Some(handle.clone()), Speed::Now, |key| **key);
        }
        assert!(slot.follow(Some(handles[1].clone()), Speed::Now, |_| panic!("it is still there")));
        assert!(slot.follow(Some(handles[3].clone()), Speed::Now, |_| panic!("it is still there")));
        assert_eq!(slot.shown(), Some(&3));
        slot.follow(Some(handles[0].clone()), Speed::Now, |_| 10);
        assert_eq!(slot.shown(), Some(&10), "only two are kept");
    }

    #[test]
    fn the_last_one_stays_until_the_next_is_ready_and_a_broken_one_is_not_tried_again() {
        let context = egui::Context::default();
        let mut slot = Slot::<Arc<u32>, u32>::default();
        let (one, other, broken) = (Arc::new(1), Arc::new(2), Arc::new(3));
        slot.follow(Some(one), Speed::Now, |key| **key);
        let (go, wait) = channel::<()>();
        assert!(!slot.follow(Some(other.clone()), Speed::Later(&context), move |key| {
            wait.recv().unwrap();
            **key
        }));
        assert!(slot.is_pending() && slot.shown() == Some(&1));
        go.send(()).unwrap();
        assert!(slot.follow(Some(other), Speed::Now, |_| panic!("already being made")));
        assert_eq!(slot.shown(), Some(&2));
        slot.follow(Some(broken.clone()), Speed::Later(&context), |_| panic!("breaks on purpose"));
        slot.follow(Some(broken.clone()), Speed::Now, |_| panic!("tried again"));
        assert!(!slot.is_pending() && slot.shown() == Some(&2));
        slot.follow(Some(broken), Speed::Now, |_| panic!("tried again"));
    }
}
