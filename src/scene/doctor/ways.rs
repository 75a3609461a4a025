//! Photos that may lie one of two ways, as stored or turned by their EXIF orientation: which one agrees with their cameras?

use super::probe::Probe;
use super::silhouette;
use super::trial::{Given, Lie, Trial, is_clearly_better};
use crate::math::statistics::quantile;
use crate::scene::Scene;
use crate::trace::Bvh;

/// Rounds in which each photo may change its mind, as its neighbours did.
const ROUNDS: usize = 3;
/// The better way must agree by this much to be believed.
const LEAST_AGREEMENT: f64 = 0.35;

/// How a photo agrees with its neighbours either way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Way {
    /// Correlation as stored, in [-1, 1].
    pub as_stored: f64,
    /// Correlation when it is turned.
    pub turned: f64,
    /// Whether its mask overlaps with the mesh's outline at least as well when it is turned as when it is not.
    pub turns_mask: bool,
}

impl Way {
    /// Whether the photo is to be turned.
    pub fn turns(&self) -> bool {
        self.turned > self.as_stored
    }
}

/// The way of each view whose photo may be turned by one of the `orientations`; `None` for others and where the photos do not
/// tell.
pub(crate) fn choose(scene: &Scene, bvh: &Bvh, probes: &[Vec<Probe>], orientations: &[Option<u8>]) -> Vec<Option<Way>> {
    let trial = Trial::new(scene, bvh, probes);
    let open: Vec<(usize, Lie)> =
        orientations.iter().enumerate().filter_map(|(view, tag)| Some((view, Lie((*tag)?)))).collect();
    let stored = Given::own(scene.views.len());
    let mut turned = stored.clone();
    open.iter().for_each(|&(view, lie)| turned[view].lie = lie);
    let rate = |given: &[Given]| {
        let of_views = trial.of_views(&trial.of_pairs(given), &vec![false; given.len()]);
        quantile(&open.iter().filter_map(|&(view, _)| of_views[view]).collect::<Vec<_>>(), 0.5)
    };
    let mut given = if rate(&turned) > rate(&stored) { turned } else { stored };
    let both_ways = |view: usize, lie: Lie, given: &mut Vec<Given>| {
        let own = given[view];
        let mut agree = [Lie::AS_IT_IS, lie].map(|lie| {
            given[view].lie = lie;
            trial.of_view(view, given, |_| false)
        });
        given[view] = own;
        if own.lie == lie {
            agree.reverse();
        }
        Some((agree[0]?, agree[1]?))
    };
    for _ in 0..ROUNDS {
        let mut changes = false;
        for &(view, lie) in &open {
            if both_ways(view, lie, &mut given).is_some_and(|(own, other)| is_clearly_better(other, own)) {
                given[view].lie = if given[view].lie == lie { Lie::AS_IT_IS } else { lie };
                changes = true;
            }
        }
        if !changes {
            break;
        }
    }
    let mut ways = vec![None; scene.views.len()];
    for &(view, lie) in &open {
        let Some((own, other)) = both_ways(view, lie, &mut given) else { continue };
        let (as_stored, turned) = if given[view].lie == lie { (other, own) } else { (own, other) };
        let (better, worse) = (own.max(other), own.min(other));
        if better > LEAST_AGREEMENT && is_clearly_better(better, worse) {
            let overlap = |lie| silhouette::overlap_of(&scene.views[view], &probes[view], lie);
            let turns_mask = overlap(lie) >= overlap(Lie::AS_IT_IS);
            ways[view] = Some(Way { as_stored, turned, turns_mask });
        }
    }
    ways
}
