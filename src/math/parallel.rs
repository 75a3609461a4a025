//! Work on many things at once, in the order of the things, with machinery that is compiled once.
//!
//! Rayon's iterators make their splitting, stealing and gathering anew for each closure, some thousand instructions of it,
//! and this program has hundreds of closures. Here the closure is called through a reference: a few nanoseconds a call. So
//! [`map`] is for work of a microsecond or more, a view, a row, a chunk of texels, and [`map_small`] for less; loops over single
//! texels in the midst of an iteration use rayon itself.

use rayon::prelude::*;
use std::sync::{Mutex, PoisonError};

/// Of small work so many are done together.
const TOGETHER: usize = 64;

/// Calls `body` with each of `0..count`, on the threads of the pool that is current.
fn each(count: usize, body: &(dyn Fn(usize) + Sync)) {
    (0..count).into_par_iter().for_each(body);
}

/// What `of` makes of each of `0..count`, in that order.
pub fn map<R: Send>(count: usize, of: impl Fn(usize) -> R + Sync) -> Vec<R> {
    // Nobody waits for these locks. A list handed out in parts needs none, but machinery for each type that it may hold.
    let made: Vec<Mutex<Option<R>>> = (0..count).map(|_| Mutex::new(None)).collect();
    each(count, &|index| *made[index].lock().unwrap_or_else(PoisonError::into_inner) = Some(of(index)));
    made.into_iter().filter_map(|one| one.into_inner().unwrap_or_else(PoisonError::into_inner)).collect()
}

/// The same for small work: some is done together.
pub fn map_small<R: Send>(count: usize, of: impl Fn(usize) -> R + Sync) -> Vec<R> {
    map_with(count, || (), |(), index| of(index))
}

/// The same for small work with memory that `scratch` makes, anew for what is done together.
pub fn map_with<S, R: Send>(
    count: usize,
    scratch: impl Fn() -> S + Sync,
    of: impl Fn(&mut S, usize) -> R + Sync,
) -> Vec<R> {
    let parts = map(count.div_ceil(TOGETHER), |part| {
        let mut scratch = scratch();
        let own = part * TOGETHER..count.min((part + 1) * TOGETHER);
        own.map(|index| of(&mut scratch, index)).collect::<Vec<R>>()
    });
    let mut made = Vec::with_capacity(count);
    parts.into_iter().for_each(|part| made.extend(part));
    made
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
            assert_eq!(map_small(count, |index| 3 * index), map(count, |index| 3 * index));
            let counted = map_with(
                count,
                || 0,
                |before, index| {
                    *before += 1;
                    (index, *before)
                },
            );
            assert_eq!(counted, (0..count).map(|index| (index, index % TOGETHER + 1)).collect::<Vec<_>>());
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
