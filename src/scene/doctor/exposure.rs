//! Do views agree on the radiance of the surface they share?
//!
//! Points seen by two views give the logarithm of a ratio; its median over the points hardly feels highlights. The
//! views' exposures are the least-squares solution of all pairs, with median zero.

use super::probe::Probe;
use super::{Report, ViewCheck, names_of, neighbours};
use crate::error::{Finding, Place, Severity};
use crate::math::{luminance, statistics::quantile};
use crate::scene::{PixelState, Scene};
use crate::trace::Bvh;

/// Points of each view that are looked up in its neighbours.
const POINTS_PER_VIEW: usize = 500;
/// Neighbours of each view: those that look from the most similar side.
const NEIGHBOURS: usize = 8;
/// A pair needs this many shared points.
const FEWEST_SHARED: usize = 20;
/// A view that is off by more than this, in stops, is named.
const JUMP_STOPS: f64 = 0.5;
/// One that is off by more is a warning: less is what cameras on automatic do, and a fit finds it.
const WARNED_STOPS: f64 = 0.75;
/// Where no view is, views that differ by more than this, in stops, are told of: root of the mean square.
const SPREAD_STOPS: f64 = 0.1;
/// More than gloss makes of photos that all have one exposure, less than a camera makes that chooses its own.
const SPREAD_BEYOND_GLOSS_STOPS: f64 = 0.25;

/// A pair of views and the median of ln(radiance in b / radiance in a) over what they share.
struct Pair {
    a: usize,
    b: usize,
    log_ratio: f64,
    weight: f64,
}

/// Measures the views' exposures against each other.
pub fn check(scene: &Scene, bvh: &Bvh, probes: &[Vec<Probe>], report: &mut Report) {
    let mut pairs = neighbours::over_views(scene, |view| pairs_of(scene, bvh, probes, view));
    // A photo of something else is neither brighter nor darker.
    pairs.retain(|pair| [pair.a, pair.b].into_iter().all(|view| !report.views[view].is_misplaced));
    let exposures = solve(scene.views.len(), &pairs);
    for (line, exposure) in report.views.iter_mut().zip(&exposures) {
        line.exposure_stops = exposure.map(|log| log / std::f64::consts::LN_2);
    }
    let mut unknown = exposures;
    leave_out_known(&mut unknown, scene.views.iter().map(|view| view.exposure_prior_stops));
    let unknown = unknown.iter().map(|log| log.map(|log| log / std::f64::consts::LN_2));
    let mut jumps: Vec<(f64, &str)> = unknown
        .zip(&report.views)
        .filter_map(|(stops, line)| Some((stops.filter(is_jump)?, line.name.as_str())))
        .collect();
    jumps.sort_by(|a, b| b.0.abs().total_cmp(&a.0.abs()).then(a.1.cmp(b.1)));
    let found = jumps.first().map(|&(most, first)| {
        let severity = if most.abs() > WARNED_STOPS { Severity::Warning } else { Severity::Note };
        let listed: Vec<String> = jumps.iter().map(|(stops, name)| format!("{name} by {stops:+.1}")).collect();
        let listed: Vec<&str> = listed.iter().map(String::as_str).collect();
        let message = format!(
            "{} of {} photos are more than {JUMP_STOPS} EV brighter or darker than the others on the same surface: {}",
            jumps.len(),
            scene.views.len(),
            names_of(&listed)
        );
        Finding::new(severity, "exposure-jump", message).at(Place::View(first.into())).remedy(
            "fit an exposure per view, as is done with photos of 8 bits, or develop all photos with one exposure and \
             white balance; of things that shine all over it may be their gloss",
        )
    });
    let jumps = jumps.len();
    report.findings.extend(found);
    if let Some(spread) = spread_stops(&report.views).filter(|spread| jumps == 0 && *spread > SPREAD_STOPS) {
        report.findings.push(
            Finding::new(
                Severity::Note,
                "exposure-varies",
                format!("exposures vary by {spread:.2} EV (standard deviation over the views)"),
            )
            .remedy("fit an exposure per view if the fit leaves brightness errors of whole pictures"),
        );
    }
}

/// Takes off what the photos' EXIF says of their exposures, which a fit begins with. Not where that leaves
/// more than there was: then the files say something else than the pixels.
fn leave_out_known(exposures: &mut [Option<f64>], stops: impl Iterator<Item = Option<f32>>) {
    let stops: Vec<Option<f32>> = stops.collect();
    if stops.iter().all(Option::is_none) {
        return;
    }
    let known = stops.iter().map(|stops| f64::from(stops.unwrap_or(0.0)) * std::f64::consts::LN_2);
    let left: Vec<f64> =
        exposures.iter().zip(known).map(|(own, known)| own.map_or(f64::NAN, |own| own - known)).collect();
    let finite: Vec<f64> = left.iter().copied().filter(|left| left.is_finite()).collect();
    let middle = if finite.is_empty() { 0.0 } else { quantile(&finite, 0.5) };
    let squares = |values: &mut dyn Iterator<Item = f64>| values.map(|value| value * value).sum::<f64>();
    let before = squares(&mut exposures.iter().flatten().copied());
    if squares(&mut finite.iter().map(|left| left - middle)) < before {
        exposures.iter_mut().zip(&left).for_each(|(own, left)| *own = own.map(|_| left - middle));
    }
}

/// Whether views see the surface they share so differently that their exposures must differ: one of them by more than half
/// a stop, or all of them by more than a quarter in the root of the mean square.
pub fn differ(views: &[ViewCheck]) -> bool {
    views.iter().filter_map(|view| view.exposure_stops).any(|stops| is_jump(&stops))
        || spread_stops(views).is_some_and(|spread| spread > SPREAD_BEYOND_GLOSS_STOPS)
}

/// Whether a view is off by so much that it is named.
fn is_jump(stops: &f64) -> bool {
    stops.abs() > JUMP_STOPS
}

/// Root of the mean square over the views; `None` where fewer than three are known, which differ by what they see.
fn spread_stops(views: &[ViewCheck]) -> Option<f64> {
    let known: Vec<f64> = views.iter().filter_map(|view| view.exposure_stops).collect();
    let mean_square = known.iter().map(|stops| stops * stops).sum::<f64>() / known.len() as f64;
    (known.len() > 2).then(|| mean_square.sqrt())
}

fn pairs_of(scene: &Scene, bvh: &Bvh, probes: &[Vec<Probe>], a: usize) -> Vec<Pair> {
    let view = &scene.views[a];
    let evident = |state: PixelState| state == PixelState::Surface;
    let is_evident = |probe: &Probe| evident(view.states[(probe.row, probe.column)]);
    let radiance = |probe: &Probe| {
        let value = f64::from(luminance(view.photo.radiance(probe.row, probe.column)));
        (value > 1e-4).then_some(value)
    };
    let points = neighbours::points(scene, &probes[a], POINTS_PER_VIEW, is_evident, radiance);
    let mut pairs = Vec::new();
    for b in neighbours::of(scene, probes, a, NEIGHBOURS) {
        let other = &scene.views[b];
        let eye = other.camera.position_in_world();
        let ratios: Vec<f64> = points
            .iter()
            .filter_map(|(point, normal, value)| {
                let place = other.camera.place_in_picture(*point)?;
                let to_eye = eye - *point;
                // Grazing sights blur over many points of the surface.
                if to_eye.dot(*normal) < 0.2 * to_eye.length() {
                    return None;
                }
                let (row, column) = (place.y as usize, place.x as usize);
                if !evident(other.states[(row, column)]) {
                    return None;
                }
                let seen = f64::from(luminance(other.photo.radiance(row, column)));
                let visible = seen > 1e-4 && !bvh.is_hidden_from(*point, *normal, eye);
                visible.then(|| (seen / value).ln())
            })
            .collect();
        if ratios.len() >= FEWEST_SHARED {
            pairs.push(Pair { a, b, log_ratio: quantile(&ratios, 0.5), weight: (ratios.len() as f64).sqrt() });
        }
    }
    pairs
}

/// Minimises Σ w (x_b - x_a - ratio)² by Gauss-Seidel sweeps, with the median of the connected views at 0.
fn solve(count: usize, pairs: &[Pair]) -> Vec<Option<f64>> {
    let mut neighbours: Vec<Vec<(usize, f64, f64)>> = vec![Vec::new(); count];
    for pair in pairs {
        neighbours[pair.a].push((pair.b, -pair.log_ratio, pair.weight));
        neighbours[pair.b].push((pair.a, pair.log_ratio, pair.weight));
    }
    let mut exposures = vec![0.0; count];
    for _ in 0..200 {
        for view in 0..count {
            let weight: f64 = neighbours[view].iter().map(|(_, _, weight)| weight).sum();
            if weight > 0.0 {
                exposures[view] =
                    neighbours[view].iter().map(|(other, ratio, w)| w * (exposures[*other] + ratio)).sum::<f64>()
                        / weight;
            }
        }
    }
    let connected = |view: usize| !neighbours[view].is_empty();
    // The median, not the mean: one bad view must not make the good ones look bad.
    let known: Vec<f64> = (0..count).filter(|&view| connected(view)).map(|view| exposures[view]).collect();
    let middle = if known.is_empty() { 0.0 } else { quantile(&known, 0.5) };
    (0..count).map(|view| connected(view).then(|| exposures[view] - middle)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exposures_are_recovered_from_pairs() {
        let truth = [0.0, 0.1, -0.2, 1.5, 0.0, 0.0];
        let mut pairs = Vec::new();
        for a in 0..5 {
            for b in [a + 1, (a + 2) % 5] {
                if b < 5 && b != a {
                    pairs.push(Pair { a, b, log_ratio: truth[b] - truth[a], weight: 1.0 + a as f64 });
                }
            }
        }
        let solved = solve(6, &pairs);
        for view in 0..5 {
            assert!((solved[view].unwrap() - truth[view]).abs() < 1e-6, "{solved:?}");
        }
        assert_eq!(solved[5], None);
    }

    #[test]
    fn what_exif_says_is_no_jump_unless_the_pixels_say_otherwise() {
        let exposures = || vec![Some(0.0), Some(1.0), None, Some(-0.5), Some(0.1)];
        let stops = [0.2, 1.0 / std::f32::consts::LN_2, 3.0, -0.5 / std::f32::consts::LN_2, 0.0].map(Some);
        let mut left = exposures();
        leave_out_known(&mut left, stops.into_iter());
        assert!(left[2].is_none() && left.iter().flatten().all(|left| left.abs() < 0.2), "{left:?}");
        let mut kept = exposures();
        leave_out_known(&mut kept, stops.map(|stops| stops.map(|stops| -stops)).into_iter());
        assert_eq!(kept, exposures());
        leave_out_known(&mut kept, [None; 5].into_iter());
        assert_eq!(kept, exposures());
    }

    #[test]
    fn a_jump_or_a_wide_spread_is_of_exposures_and_less_is_not() {
        let of = |stops: &[Option<f64>]| {
            let view = |stops: &Option<f64>| ViewCheck { exposure_stops: *stops, ..ViewCheck::default() };
            differ(&stops.iter().map(view).collect::<Vec<_>>())
        };
        assert!(!of(&[]) && !of(&[None, None, None]));
        assert!(!of(&[Some(0.2), Some(-0.2), Some(0.0), None]));
        assert!(of(&[Some(0.4), Some(-0.4), Some(0.0)]));
        assert!(!of(&[Some(0.4), Some(-0.4), None]), "two views are no spread");
        assert!(of(&[Some(0.6), Some(0.0)]), "but a jump is one");
        assert!(of(&[&[Some(-0.6)][..], &[Some(0.0); 99]].concat()));
    }
}
