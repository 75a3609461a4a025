//! Photos and cameras that are out of step, all of them or from some name on: one was added or lost on one side.
//!
//! Each pair of cameras is asked by itself: do their photos agree better when each is given the photo some places after its own?
//! A median over all views would not tell where neighbouring photos look alike, nor a shift of the last third.

use super::trial::{Given, Trial};
use crate::math::statistics::quantile;

/// Places that photos are moved on by.
const SHIFTS: [isize; 4] = [1, -1, 2, -2];
/// Views and pairs of them that a shift must be told by.
const FEWEST_VIEWS: usize = 3;
const FEWEST_PAIRS: usize = 6;
/// Share of the pairs that must agree better after the shift, and the share of what they lack that it must make up for.
const LEAST_IMPROVED: f64 = 0.8;
const LEAST_GAIN_SHARE: f64 = 0.3;
/// What a pair that agrees worse counts, against one that agrees better by as much.
const AGAINST: f64 = 3.0;
/// Share of the pairs before the first shifted photo that may agree better as well.
const MOST_IMPROVED_BEFORE: f64 = 0.3;
/// A shift is no explanation where photos correlate by less than this after it.
const LEAST_SHIFTED: f64 = 0.35;

/// Photos that are out of step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shift {
    /// Each camera is to be given the photo so many places after its own.
    pub by: isize,
    /// The first camera.
    pub from: usize,
    /// Correlation as they are, the median over its pairs, and after the shift.
    pub own: f64,
    pub shifted: f64,
    gain: f64,
}

/// Two cameras, and how their photos agree as they are and after a shift.
struct Tried {
    first: usize,
    last: usize,
    own: f64,
    shifted: f64,
}

/// The shift of the photos of `count` cameras that explains most, if one does; `found` is how their pairs agree as they are.
pub(super) fn best(trial: &Trial, count: usize, found: &[Option<f64>]) -> Option<Shift> {
    let signed = count as isize;
    let of_shift = |by: isize| {
        let mut given = Given::own(count);
        given.rotate_left(by.rem_euclid(signed) as usize);
        // At the end there is no photo to be given.
        let has_photo = |camera: usize| (0..signed).contains(&(camera as isize + by));
        let shifted = trial.of_pairs(&given);
        let tried = (0..found.len()).filter_map(|pair| {
            let cameras = trial.cameras_of(pair);
            let is_whole = cameras.into_iter().all(has_photo);
            let (own, shifted) = (found[pair]?, shifted[pair].filter(|_| is_whole)?);
            Some(Tried { first: cameras[0].min(cameras[1]), last: cameras[0].max(cameras[1]), own, shifted })
        });
        best_start(by, count, tried.collect())
    };
    let shifts = SHIFTS.into_iter().filter(|by| by.abs() < signed - 1).filter_map(of_shift);
    shifts.max_by(|a, b| a.gain.total_cmp(&b.gain))
}

/// From which camera on a shift explains most.
fn best_start(by: isize, count: usize, mut tried: Vec<Tried>) -> Option<Shift> {
    tried.sort_by_key(|pair| pair.first);
    let gain = |pairs: &[Tried]| pairs.iter().map(|pair| pair.shifted - pair.own).sum::<f64>();
    // Of a pair with one camera before the first that is out of step, one photo is wrong before as after: half of them agree
    // better by chance, which must not speak for an earlier start.
    let vote = |pair: &Tried| (pair.shifted - pair.own) * if pair.shifted > pair.own { 1.0 } else { AGAINST };
    let improved = |pairs: &mut dyn Iterator<Item = &Tried>| {
        let (better, all) = pairs
            .fold((0usize, 0usize), |(better, all), pair| (better + usize::from(pair.shifted > pair.own), all + 1));
        (better as f64 / all.max(1) as f64, all)
    };
    let starts = (0..count.saturating_sub(FEWEST_VIEWS - 1)).map(|from| {
        let place = tried.partition_point(|pair| pair.first < from);
        (tried[place..].iter().map(vote).sum::<f64>(), from, place)
    });
    // Of starts that explain as much the latest: no pair speaks for those before it.
    let (_, from, place) = starts.max_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))?;
    let pairs = &tried[place..];
    let total = gain(pairs);
    let lack: f64 = pairs.iter().map(|pair| 1.0 - pair.own).sum();
    let (share, number) = improved(&mut pairs.iter());
    let (share_before, _) = improved(&mut tried[..place].iter().filter(|pair| pair.last < from));
    let middle = |of: fn(&Tried) -> f64| quantile(&pairs.iter().map(of).collect::<Vec<_>>(), 0.5);
    let is_told = number >= FEWEST_PAIRS
        && share >= LEAST_IMPROVED
        && total >= LEAST_GAIN_SHARE * lack
        && share_before <= MOST_IMPROVED_BEFORE;
    // A camera that has no photo before its own says nothing of it.
    let is_all = from as isize <= -by;
    let shift = is_told.then(|| Shift {
        by,
        from: if is_all { 0 } else { from },
        own: middle(|pair| pair.own),
        shifted: middle(|pair| pair.shifted),
        gain: total,
    });
    shift.filter(|shift| shift.shifted > LEAST_SHIFTED)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pairs of each camera with the two after it, of which those from a place on agree better after a shift.
    fn pairs(count: usize, from: usize, own: f64, shifted: f64) -> Vec<Tried> {
        let mut made = Vec::new();
        for first in 0..count {
            for last in (first + 1)..(first + 3).min(count) {
                let is_after = first >= from;
                let (own, shifted) = if is_after { (own, shifted) } else { (0.95, 0.8) };
                made.push(Tried { first, last, own, shifted });
            }
        }
        made
    }

    #[test]
    fn a_shift_is_told_from_where_it_begins_and_also_where_photos_look_alike() {
        for (from, own, shifted) in [(0, 0.1, 0.8), (0, 0.88, 0.97), (10, 0.7, 0.95)] {
            let found = best_start(1, 16, pairs(16, from, own, shifted)).unwrap();
            assert_eq!((found.from, found.by), (from, 1));
            assert!((found.own - own).abs() < 1e-9 && (found.shifted - shifted).abs() < 1e-9);
        }
    }

    #[test]
    fn little_gain_few_pairs_and_improvement_everywhere_are_no_shift() {
        assert!(best_start(1, 16, pairs(16, 16, 0.0, 0.0)).is_none(), "nothing is better");
        assert!(best_start(1, 16, pairs(16, 0, 0.9, 0.92)).is_none(), "a fifth of what is lacking");
        assert!(best_start(1, 16, pairs(16, 13, 0.2, 0.9)).is_none(), "three pairs");
        assert!(best_start(1, 16, pairs(16, 4, 0.05, 0.3)).is_none(), "hardly alike after it");
        let mut half = pairs(16, 0, 0.5, 0.9);
        half.iter_mut().step_by(2).for_each(|pair| pair.shifted = 0.3);
        assert!(best_start(1, 16, half).is_none(), "half of the pairs");
        assert!(best_start(1, 2, Vec::new()).is_none());
    }
}
