//! A cell for the newest value: writing replaces, reading clones a pointer, nobody waits for work. Who writes can ask
//! whether the last value was looked at, so that no value is made for nobody.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A cell that holds the newest of a series of values.
#[derive(Debug)]
pub struct Slot<T>(Mutex<Cell<T>>);

#[derive(Debug)]
struct Cell<T> {
    number: u64,
    value: Option<Arc<T>>,
    is_seen: bool,
}

impl<T> Default for Slot<T> {
    fn default() -> Self {
        Slot(Mutex::new(Cell { number: 0, value: None, is_seen: true }))
    }
}

impl<T> Slot<T> {
    /// Replaces the value.
    pub fn put(&self, value: T) {
        let mut cell = self.cell();
        *cell = Cell { number: cell.number + 1, value: Some(Arc::new(value)), is_seen: false };
    }

    /// The newest value and its number in the series, from 1; `None` before the first.
    pub fn newest(&self) -> Option<(u64, Arc<T>)> {
        let mut cell = self.cell();
        cell.is_seen = true;
        cell.value.as_ref().map(|value| (cell.number, Arc::clone(value)))
    }

    /// The newest value for who writes: it does not count as seen.
    pub fn last(&self) -> Option<Arc<T>> {
        self.cell().value.clone()
    }

    /// Whether somebody has looked since the last value was put; true before the first.
    pub fn is_seen(&self) -> bool {
        self.cell().is_seen
    }

    fn cell(&self) -> MutexGuard<'_, Cell<T>> {
        // A panic elsewhere cannot leave a pointer half-written, so a poisoned lock is still good.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_value_wins() {
        let slot = Slot::default();
        assert!(slot.newest().is_none());
        slot.put(1);
        slot.put(2);
        assert_eq!(slot.newest().map(|(number, value)| (number, *value)), Some((2, 2)));
    }

    #[test]
    fn a_value_is_seen_once_somebody_has_looked() {
        let slot = Slot::default();
        assert!(slot.is_seen());
        slot.put(1);
        assert!(slot.last().is_some() && !slot.is_seen());
        slot.newest();
        assert!(slot.is_seen());
        slot.put(2);
        assert!(!slot.is_seen());
    }
}
