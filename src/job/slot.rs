//! A cell for the newest value: writing replaces, reading clones a pointer, nobody waits for work.

use std::sync::{Arc, Mutex, PoisonError};

/// A cell that holds the newest of a series of values.
#[derive(Debug)]
pub struct Slot<T>(Mutex<(u64, Option<Arc<T>>)>);

impl<T> Default for Slot<T> {
    fn default() -> Self {
        Slot(Mutex::new((0, None)))
    }
}

impl<T> Slot<T> {
    /// Replaces the value.
    pub fn put(&self, value: T) {
        // A panic elsewhere cannot leave a pointer half-written, so a poisoned lock is still good.
        let mut cell = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        *cell = (cell.0 + 1, Some(Arc::new(value)));
    }

    /// The newest value and its number in the series, from 1; `None` before the first.
    pub fn newest(&self) -> Option<(u64, Arc<T>)> {
        let cell = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        cell.1.as_ref().map(|value| (cell.0, Arc::clone(value)))
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
}
