//! Work on many things at once, in the order of the things, with machinery that is compiled once.
//!
//! Rayon's iterators make their splitting, stealing and gathering anew for each closure, some thousand instructions of it,
//! and this program has hundreds of closures. Here the closure is called through a reference: a few nanoseconds a call. So
//! this is for work of a microsecond or more, a view, a row, a chunk of texels; loops over single texels use rayon itself.

use rayon::prelude::*;
use std::sync::{Mutex, PoisonError};

/// Calls `body` with each of `0..count`, on the threads of the pool that is current.
pub fn each(count: usize, body: &(dyn Fn(usize) + Sync)) {
    (0..count).into_par_iter().for_each(body);
}

/// What `of` makes of each of `0..count`, in that order.
pub fn map<R: Send>(count: usize, of: impl Fn(usize) -> R + Sync) -> Vec<R> {
    let made: Vec<Mutex<Option<R>>> = (0..count).map(|_| Mutex::new(None)).collect();
    each(count, &|index| *made[index].lock().unwrap_or_else(PoisonError::into_inner) = Some(of(index)));
    made.into_iter().filter_map(|one| one.into_inner().unwrap_or_else(PoisonError::into_inner)).collect()
}

/// What `of` makes of each item, in their order.
pub fn map_items<T: Sync, R: Send>(items: &[T], of: impl Fn(&T) -> R + Sync) -> Vec<R> {
    map(items.len(), |index| of(&items[index]))
}

/// What `of` makes of each chunk of `size` items, the last one may be shorter, in their order.
pub fn map_chunks<T: Sync, R: Send>(items: &[T], size: usize, of: impl Fn(usize, &[T]) -> R + Sync) -> Vec<R> {
    map(items.len().div_ceil(size), |chunk| of(chunk, &items[chunk * size..items.len().min((chunk + 1) * size)]))
}

/// Calls `body` with the number of each chunk of `size` values, the last one may be shorter, and the chunk to change.
pub fn each_chunk<T: Send>(values: &mut [T], size: usize, body: &(dyn Fn(usize, &mut [T]) + Sync)) {
    values.par_chunks_mut(size).enumerate().for_each(|(chunk, values)| body(chunk, values));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_is_done_once_and_stays_in_order() {
        for count in [0, 1, 7, 1000] {
            assert_eq!(map(count, |index| 3 * index), (0..count).map(|index| 3 * index).collect::<Vec<_>>());
            let items: Vec<usize> = (0..count).collect();
            assert_eq!(map_items(&items, |item| item + 1), (1..=count).collect::<Vec<_>>());
            let sums = map_chunks(&items, 16, |chunk, items| (chunk, items.iter().sum::<usize>()));
            let expected: Vec<_> = items.chunks(16).map(|items| items.iter().sum::<usize>()).enumerate().collect();
            assert_eq!(sums, expected);
            let mut values = vec![0; count];
            each_chunk(&mut values, 16, &|chunk, values| values.iter_mut().for_each(|value| *value += chunk + 1));
            assert_eq!(values, (0..count).map(|index| index / 16 + 1).collect::<Vec<_>>());
        }
    }
}
