//! Single photos that do not belong to their cameras, where the others do.
//!
//! How far a photo may fall behind the others hangs on the capture: gloss and sparse views spread the agreement of those that
//! belong. So it is held against the median over the views, by their median absolute deviation. What would explain a photo that
//! falls behind is tried, the worst first: it is turned or mirrored, exchanged with another, or of another camera. What is
//! explained is taken as it should be, what is not is left out, so that it does not spoil the agreement of its neighbours.
//!
//! Photos that are the same picture are told by their content.

use super::trial::{Given, JUDGED_ABOVE, Lie, Trial, is_clearly_better};
use super::{Report, copies, names_of, worst_first};
use crate::error::{Finding, Place, Severity};
use crate::math::statistics::quantile;
use crate::scene::Scene;

/// Standard deviations of a normal distribution with a median absolute deviation of one.
const DEVIATIONS: f64 = 1.4826;
/// A photo that falls behind the median by so many deviations, and by so much, is tried: an explanation speaks for itself.
const TRIED_DEVIATIONS: f64 = 3.0;
const TRIED_DISTANCE: f64 = 0.15;
/// One of which even the best of its neighbours falls behind by so many, and by so much, is named without an explanation: one
/// that belongs may have gloss or far neighbours, which lower its median, but not all of them.
const NAMED_DEVIATIONS: f64 = 6.0;
const NAMED_DISTANCE: f64 = 0.3;
/// Below this, a photo is named however much the others spread.
const LOW: f64 = 0.35;
/// An explanation makes up for this part of what a photo falls behind.
const LEAST_PART: f64 = 0.5;
/// The share of what it lacks that a photo must gain with another camera, which has a photo already.
const LEAST_GAIN_OF_MOVED: f64 = 0.5;
/// Photos that fall behind whose cameras are tried for each other: a capture may have hundreds.
const MOST_BEHIND: usize = 32;
/// Cameras beside a camera, in the order of names, whose photos are tried on it.
const BESIDE: usize = 3;

/// What is wrong with a photo.
enum Fault {
    Lies(Lie),
    ExchangedWith(usize),
    Of(usize, f64),
}

struct Search<'a> {
    trial: &'a Trial<'a>,
    scene: &'a Scene,
    given: Vec<Given>,
    /// Agreement over each pair of cameras.
    found: Vec<Option<f64>>,
    is_left_out: Vec<bool>,
}

/// Names single photos that do not belong, and marks their views. `found` is what `trial` finds of the photos as they are given.
pub(super) fn check(scene: &Scene, trial: &Trial, found: Vec<Option<f64>>, report: &mut Report) {
    let count = scene.views.len();
    let mut search = Search { trial, scene, given: Given::own(count), found, is_left_out: vec![false; count] };
    let names: Vec<&str> = scene.views.iter().map(|view| view.name.as_str()).collect();
    search.set_copies_aside(&names, report);
    let mut is_done = search.is_left_out.clone();
    let mut left: Vec<(f64, usize)> = Vec::new();
    loop {
        let agreement = trial.of_views(&search.found, &search.is_left_out);
        let Some(limits) = Limits::of(&agreement, &search.is_left_out) else { break };
        let is_behind = |(view, own): (usize, &Option<f64>)| {
            let own = own.filter(|own| !is_done[view] && *own < limits.tried)?;
            Some((own, view))
        };
        let mut behind: Vec<(f64, usize)> = agreement.iter().enumerate().filter_map(is_behind).collect();
        behind.sort_by(|a, b| a.0.total_cmp(&b.0));
        let Some(&(own, view)) = behind.first() else { break };
        is_done[view] = true;
        let best = trial.best_of_view(view, &search.found, &search.is_left_out).unwrap_or(own);
        let needed = (own + LEAST_PART * (limits.middle - own)).max(JUDGED_ABOVE);
        let finding = match search.fault(view, own, needed, &behind) {
            Some(Fault::Lies(lie)) => {
                search.give(view, Given { photo: view, lie });
                let message = format!("the photo matches the others only when it is {}", lie.in_words());
                Finding::new(Severity::Warning, "photo-turned", message)
                    .remedy("rotate or flip the photo file, or exclude the view")
            }
            Some(Fault::ExchangedWith(other)) => {
                is_done[other] = true;
                report.views[other].is_misplaced = true;
                search.exchange(view, other);
                let (first, second) = (names[view.min(other)], names[view.max(other)]);
                let message = format!("the photos {first} and {second} are swapped: each matches the other's camera");
                Finding::new(Severity::Warning, "photos-exchanged", message)
                    .remedy("swap their names, or those of their cameras")
            }
            Some(Fault::Of(other, there)) => {
                search.is_left_out[view] = true;
                let message = format!(
                    "the photo matches the camera of {} (correlation {there:.2}) and not its own ({own:.2})",
                    names[other]
                );
                Finding::new(Severity::Warning, "photo-misplaced", message).remedy(
                    "look for the photo of this camera: this one is a copy of another or has another's name; or \
                         exclude the view",
                )
            }
            None if own < limits.low || best < limits.named => {
                search.is_left_out[view] = true;
                report.views[view].is_misplaced = true;
                left.push((own, view));
                continue;
            }
            None => continue,
        };
        report.views[view].is_misplaced = true;
        report.findings.push(finding.at(Place::View(names[view].into())));
    }
    let agreement = trial.of_views(&search.found, &search.is_left_out);
    let middle = Limits::of(&agreement, &search.is_left_out).map_or(f64::NAN, |limits| limits.middle);
    let left = left.into_iter().map(|(own, view)| (-own, names[view])).collect();
    if let Some((least, left)) = worst_first(left) {
        let message = format!(
            "{} photos do not match the others on the same surface (correlation {:.2} in the first; the others have \
             {middle:.2}): {}",
            left.len(),
            -least,
            names_of(&left)
        );
        report.findings.push(
            Finding::new(Severity::Warning, "photos-disagree", message)
                .at(Place::View(left[0].into()))
                .remedy("check that these photos belong to their cameras, or exclude the views"),
        );
    }
}

/// Below what agreement a photo is tried and named.
struct Limits {
    middle: f64,
    tried: f64,
    named: f64,
    low: f64,
}

impl Limits {
    fn of(agreement: &[Option<f64>], is_left_out: &[bool]) -> Option<Self> {
        let known: Vec<f64> =
            agreement.iter().zip(is_left_out).filter(|(_, left_out)| !**left_out).filter_map(|(own, _)| *own).collect();
        let middle = quantile(&known, 0.5);
        let distances: Vec<f64> = known.iter().map(|own| (own - middle).abs()).collect();
        let deviation = DEVIATIONS * quantile(&distances, 0.5);
        let behind = |deviations: f64, distance: f64| middle - distance.max(deviations * deviation);
        let low = LOW.min(middle);
        let tried = behind(TRIED_DEVIATIONS, TRIED_DISTANCE).max(low);
        let named = behind(NAMED_DEVIATIONS, NAMED_DISTANCE);
        (!known.is_empty()).then_some(Limits { middle, tried, named, low })
    }
}

impl Search<'_> {
    fn give(&mut self, camera: usize, given: Given) {
        self.given[camera] = given;
        self.trial.renew(&mut self.found, camera, &self.given);
    }

    fn exchange(&mut self, one: usize, other: usize) {
        self.given.swap(one, other);
        self.trial.renew(&mut self.found, one, &self.given);
        self.trial.renew(&mut self.found, other, &self.given);
    }

    /// How a camera agrees with its neighbours by other `given`, without those left out and without `also`.
    fn with(&self, given: &[Given], camera: usize, also: Option<usize>) -> Option<f64> {
        self.trial.of_view(camera, given, |other| self.is_left_out[other] || also == Some(other))
    }

    /// What explains a photo that agrees by `own`, so that it agrees by what is `needed`. `behind` are all that fall behind, the worst first.
    fn fault(&self, view: usize, own: f64, needed: f64, behind: &[(f64, usize)]) -> Option<Fault> {
        let states = &self.scene.views[view].states;
        let mut given = self.given.clone();
        let lies = Lie::others((states.width(), states.height())).filter_map(|lie| {
            given[view] = Given { photo: view, lie };
            Some((self.with(&given, view, None)?, lie))
        });
        let best_lie = lies.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|(there, _)| *there >= needed);
        let others = self.others(view, behind);
        let exchanged = others.iter().filter_map(|&other| {
            let mut given = self.given.clone();
            given.swap(view, other);
            let (here, there) = (self.with(&given, view, None)?, self.with(&given, other, None)?);
            let before = self.with(&self.given, other, None)?;
            (here >= needed && there >= JUDGED_ABOVE && is_clearly_better(there, before))
                .then_some((here + there, other))
        });
        let exchanged = exchanged.max_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((_, lie)) = best_lie.filter(|(turned, _)| exchanged.is_none_or(|(sum, _)| *turned > 0.5 * sum)) {
            return Some(Fault::Lies(lie));
        }
        if let Some((_, other)) = exchanged {
            return Some(Fault::ExchangedWith(other));
        }
        let moved = others.iter().filter_map(|&other| {
            let mut given = self.given.clone();
            given[other] = given[view];
            Some((self.with(&given, other, Some(view))?, other))
        });
        let (there, other) = moved.max_by(|a, b| a.0.total_cmp(&b.0))?;
        // Things that look alike from many sides agree better by chance with another camera's neighbours, but not by much.
        let gained = there - own;
        (there >= needed && gained > LEAST_GAIN_OF_MOVED * (1.0 - own)).then_some(Fault::Of(other, there))
    }

    /// Cameras that a photo may be of: those that fall behind most, its neighbours, and those beside it in the order of names.
    fn others(&self, view: usize, behind: &[(f64, usize)]) -> Vec<usize> {
        let beside = view.saturating_sub(BESIDE)..(view + BESIDE + 1).min(self.given.len());
        let mut others: Vec<usize> = behind
            .iter()
            .take(MOST_BEHIND)
            .map(|(_, other)| *other)
            .chain(self.trial.neighbours(view))
            .chain(beside)
            .collect();
        others.sort_unstable();
        others.dedup();
        others.retain(|&other| other != view && !self.is_left_out[other]);
        others
    }

    /// Tells of photos that are the same picture, and leaves out all of them but the one that agrees best.
    fn set_copies_aside(&mut self, names: &[&str], report: &mut Report) {
        for group in copies::groups(&self.scene.views) {
            let agreement = |view: usize| report.views[view].agreement.unwrap_or(-1.0);
            let Some(best) = group.iter().rev().copied().max_by(|&a, &b| agreement(a).total_cmp(&agreement(b))) else {
                continue;
            };
            let cameras = |view: usize| {
                let camera = &self.scene.views[view].camera;
                (camera.rotation_camera_from_world, camera.translation_camera_from_world)
            };
            let (twins, strangers): (Vec<usize>, Vec<usize>) =
                group.iter().filter(|&&view| view != best).partition(|&&view| cameras(view) == cameras(best));
            let named = |views: &[usize]| names_of(&views.iter().map(|&view| names[view]).collect::<Vec<_>>());
            if !twins.is_empty() {
                let message =
                    format!("the view {} has a twin of the same photo and camera: {}", names[best], named(&twins));
                report.findings.push(
                    Finding::new(Severity::Note, "photos-identical", message)
                        .at(Place::View(names[twins[0]].into()))
                        .remedy("exclude the twin: what it shows counts twice"),
                );
            }
            let Some(&first) = strangers.first() else { continue };
            let message = format!(
                "photos of several cameras are the same picture: {}; {} fits its camera best",
                named(&group),
                names[best]
            );
            report.findings.push(
                Finding::new(Severity::Warning, "photos-identical", message)
                    .at(Place::View(names[first].into()))
                    .remedy("look for the photos of the other cameras, or exclude those views"),
            );
            for view in strangers {
                self.is_left_out[view] = true;
                report.views[view].is_misplaced = true;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn how_far_a_photo_may_fall_behind_hangs_on_the_others() {
        let of = |agreement: &[f64]| {
            let known: Vec<Option<f64>> = agreement.iter().copied().map(Some).collect();
            Limits::of(&known, &vec![false; known.len()]).unwrap()
        };
        let alike = of(&[0.99, 0.98, 0.99, 0.99, 0.98, 0.99, 0.42]);
        assert!(alike.named > 0.42 && alike.tried > 0.42, "one that falls far behind is named");
        assert!(alike.tried < 0.9 && alike.named < 0.8, "where all others agree, a little less is no fault");
        let spread = of(&[0.6, 0.9, 0.75, 0.8, 0.68, 0.85, 0.5]);
        assert!(spread.tried < 0.5 && spread.named < 0.5, "nor is 0.5 where they spread");
        assert!(Limits::of(&[None, Some(0.9)], &[false, true]).is_none());
    }
}
