//! Do photos and cameras belong together? By the photos alone: no mask is needed.
//!
//! Two cameras that see the same points of the surface should find the same bright and dark places there. How far they do
//! is the correlation of the logarithms of radiance over the shared points; exposures, gains and a common reflectance drop
//! out of it. A photo that was given the camera of another one correlates with nobody. What explains it is looked for by
//! trying: the photos of all cameras moved on by one or two, two photos exchanged, one turned or mirrored. Visibility
//! hangs on the cameras only, so a trial is some thousand pixels looked up.
//!
//! It refuses to judge surfaces that look everywhere alike, and mirrors, whose pictures move with the camera.

use super::probe::Probe;
use super::{Report, names_of, neighbours, worst_first};
use crate::error::{Finding, Place, Severity};
use crate::math::{luminance, parallel, statistics::quantile};
use crate::scene::{PixelState, Scene, View};
use crate::trace::Bvh;

/// Points of each view that are looked up in its neighbours.
const POINTS_PER_VIEW: usize = 600;
/// Neighbours of each view: those that look from the most similar side.
const NEIGHBOURS: usize = 6;
/// A pair needs this many shared points.
const FEWEST_SHARED: usize = 40;
/// Of fewer views nothing is said.
const FEWEST_VIEWS: usize = 3;
/// Below this radiance a pixel is dark: its logarithm is noise.
const DARK: f32 = 2e-3;
/// Another order of the photos is believed when the correlation rises by so much, and by this share of what it lacks.
const LEAST_GAIN: f64 = 0.1;
const LEAST_GAIN_SHARE: f64 = 0.2;
/// Where most views correlate by less than this, photos belong to other cameras or another mesh; where they do by less than
/// [`JUDGED_ABOVE`], something of them is off.
const HARDLY: f64 = 0.2;
/// What captures have whose cameras and mesh fit.
const USUAL: f64 = 0.7;
/// Views that correlate by less than this with all others, where the others do, are named.
const LOW: f64 = 0.35;
/// Where most views correlate by less than this, that itself is told, and nothing is said of single ones.
const JUDGED_ABOVE: f64 = 0.5;

/// Two cameras and where each sees the points that both see, by index of the pixel.
struct Pair {
    cameras: [usize; 2],
    pixels: [Vec<u32>; 2],
}

/// How a photo may lie in its picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Lie {
    AsItIs,
    HalfTurned,
    Mirrored,
    UpsideDown,
}

impl Lie {
    const OTHERS: [Lie; 3] = [Lie::HalfTurned, Lie::Mirrored, Lie::UpsideDown];

    fn in_words(self) -> &'static str {
        match self {
            Lie::AsItIs => "as it is",
            Lie::HalfTurned => "turned by 180 degrees",
            Lie::Mirrored => "mirrored left to right",
            Lie::UpsideDown => "mirrored top to bottom",
        }
    }
}

/// The photos, looked up pixel by pixel: most of them are never asked for.
struct Pictures<'a> {
    views: &'a [View],
}

impl Pictures<'_> {
    /// Logarithm of the radiance over three by three pixels, so that a fine texture and the grain of the film do not decide;
    /// NaN where the photo tells none.
    fn log(&self, photo: usize, row: usize, column: usize) -> f64 {
        let View { photo, states, .. } = &self.views[photo];
        let is_known = |place| !matches!(states[place], PixelState::Ignored) && !states[place].is_clipped();
        if !is_known((row, column)) {
            return f64::NAN;
        }
        let (mut sum, mut count) = (0.0, 0);
        for r in row.saturating_sub(1)..(row + 2).min(states.height()) {
            for c in column.saturating_sub(1)..(column + 2).min(states.width()) {
                if is_known((r, c)) {
                    sum += luminance(photo.radiance(r, c));
                    count += 1;
                }
            }
        }
        let mean = sum / count as f32;
        if mean > DARK { f64::from(mean.ln()) } else { f64::NAN }
    }

    /// Correlation of two photos over the points that two cameras share, as if they were those cameras' own; `None` where
    /// too few can be compared.
    fn correlation(&self, pair: &Pair, photos: [usize; 2], lies: [Lie; 2]) -> Option<f64> {
        let sizes_agree = [0, 1].into_iter().all(|side| {
            let [own, photo] = [pair.cameras[side], photos[side]].map(|view| &self.views[view].states);
            (own.width(), own.height()) == (photo.width(), photo.height())
        });
        if !sizes_agree {
            return None;
        }
        let look_up = |side: usize, index: u32| {
            let states = &self.views[photos[side]].states;
            let (row, column) = (index as usize / states.width(), index as usize % states.width());
            let (across, down) = (states.width() - 1 - column, states.height() - 1 - row);
            let (row, column) = match lies[side] {
                Lie::AsItIs => (row, column),
                Lie::HalfTurned => (down, across),
                Lie::Mirrored => (row, across),
                Lie::UpsideDown => (down, column),
            };
            self.log(photos[side], row, column)
        };
        let values = pair.pixels[0].iter().zip(&pair.pixels[1]).map(|(&a, &b)| (look_up(0, a), look_up(1, b)));
        correlation(values.filter(|(x, y)| x.is_finite() && y.is_finite()))
    }
}

/// Pearson's correlation; `None` for too few values, or where one side does not vary.
fn correlation(values: impl Iterator<Item = (f64, f64)>) -> Option<f64> {
    let values: Vec<(f64, f64)> = values.collect();
    if values.len() < FEWEST_SHARED {
        return None;
    }
    let count = values.len() as f64;
    let (mean_x, mean_y) = values.iter().fold((0.0, 0.0), |(x, y), value| (x + value.0 / count, y + value.1 / count));
    let (mut xx, mut yy, mut xy) = (0.0, 0.0, 0.0);
    for (x, y) in values {
        xx += (x - mean_x).powi(2);
        yy += (y - mean_y).powi(2);
        xy += (x - mean_x) * (y - mean_y);
    }
    // What rounding of the mean leaves of a constant is no variation.
    let least = |mean: f64| 1e-20 * count * (1.0 + mean * mean);
    (xx > least(mean_x) && yy > least(mean_y)).then(|| xy / (xx * yy).sqrt())
}

/// How the photos of a scene agree, the median over the views, in [-1, 1]; `None` where they share too little.
pub(crate) fn measure(scene: &Scene, bvh: &Bvh, probes: &[Vec<Probe>]) -> Option<f64> {
    let pairs = neighbours::over_views(scene, |view| pairs_of(scene, bvh, probes, view));
    let pictures = Pictures { views: &scene.views };
    let trial = Trial { pictures: &pictures, pairs: &pairs, count: scene.views.len() };
    let own: Vec<usize> = (0..scene.views.len()).collect();
    let known: Vec<f64> = trial.of_views(&own).into_iter().flatten().collect();
    (known.len() >= FEWEST_VIEWS).then(|| quantile(&known, 0.5))
}

/// Measures how the photos agree, and names those that do not belong to their cameras.
pub fn check(scene: &Scene, bvh: &Bvh, probes: &[Vec<Probe>], report: &mut Report) {
    let pairs = neighbours::over_views(scene, |view| pairs_of(scene, bvh, probes, view));
    if pairs.len() < 2 {
        return;
    }
    let pictures = Pictures { views: &scene.views };
    let trial = Trial { pictures: &pictures, pairs: &pairs, count: scene.views.len() };
    let own: Vec<usize> = (0..scene.views.len()).collect();
    let agreement = trial.of_views(&own);
    for (line, agreement) in report.views.iter_mut().zip(&agreement) {
        line.agreement = *agreement;
    }
    let known: Vec<f64> = agreement.iter().copied().flatten().collect();
    if known.len() < FEWEST_VIEWS {
        return;
    }
    let middle = quantile(&known, 0.5);
    report.agreement = Some(middle);
    let names: Vec<&str> = scene.views.iter().map(|view| view.name.as_str()).collect();
    if let Some((shift, shifted)) = trial.best_shift(middle) {
        let message = format!(
            "photos and cameras are out of step: where photos show the same surface their correlation is {middle:.2}, and \
             {shifted:.2} when each camera is given the photo {} in the order of names",
            match shift {
                1 => "after its own".into(),
                -1 => "before its own".into(),
                shift if shift > 0 => format!("{shift} places after its own"),
                shift => format!("{} places before its own", -shift),
            }
        );
        report.findings.push(Finding::new(Severity::Warning, "photos-shifted", message).remedy(
            "rename photos and cameras to match: one was added or removed on one side, or numbering starts at 1 there",
        ));
        return;
    }
    if (HARDLY..JUDGED_ABOVE).contains(&middle) && masks_tell(report) {
        return;
    }
    if middle < JUDGED_ABOVE {
        let hardly = if middle < HARDLY { "barely" } else { "poorly" };
        let message = format!(
            "photos correlate {hardly} where the cameras say they show the same surface ({middle:.2}; 1 is a perfect match, \
             captures that fit have {USUAL:.1} and more)"
        );
        report.findings.push(Finding::new(Severity::Warning, "photos-disagree", message).remedy(
            "look at the outlines over the photos (check -o FOLDER): the mesh may be larger, smaller or turned, photos may have \
             been cropped, resized or given another's camera; mirrors, glass and moving light have the same effect",
        ));
        return;
    }
    let bad: Vec<usize> =
        (0..names.len()).filter(|&view| agreement[view].is_some_and(|agreement| agreement < LOW)).collect();
    let mut left: Vec<(f64, &str)> = Vec::new();
    let mut done = vec![false; names.len()];
    for &view in &bad {
        if done[view] {
            continue;
        }
        let own = agreement[view].unwrap_or_default();
        let needed = own + 0.5 * (middle - own);
        if let Some(lie) = Lie::OTHERS.into_iter().find(|&lie| trial.of_view(view, view, lie) >= Some(needed)) {
            let message = format!("the photo matches the others only when it is {}", lie.in_words());
            report.findings.push(
                Finding::new(Severity::Warning, "photo-turned", message)
                    .at(Place::View(names[view].into()))
                    .remedy("rotate or flip the photo file, or exclude the view"),
            );
            continue;
        }
        let partner = bad.iter().copied().find(|&other| {
            other > view
                && !done[other]
                && trial.of_view(view, other, Lie::AsItIs) >= Some(needed)
                && trial.of_view(other, view, Lie::AsItIs) >= Some(needed)
        });
        if let Some(other) = partner {
            done[other] = true;
            let message =
                format!("the photos {} and {} are swapped: each matches the other's camera", names[view], names[other]);
            report.findings.push(
                Finding::new(Severity::Warning, "photos-exchanged", message)
                    .at(Place::View(names[view].into()))
                    .remedy("swap their names, or those of their cameras"),
            );
            continue;
        }
        left.push((-own, names[view]));
    }
    if let Some((least, left)) = worst_first(left) {
        let message = format!(
            "{} photos do not match the others on the same surface (correlation below {LOW}, {:.2} in the first; the \
             others have {middle:.2}): {}",
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

/// Whether masks say already that the mesh is not the object: then photos cannot agree through it.
fn masks_tell(report: &Report) -> bool {
    /// Below this median overlap of masks and outline.
    const ANOTHER: f64 = 0.5;
    let overlaps: Vec<f64> = report.views.iter().filter_map(|view| view.mask_overlap).collect();
    !overlaps.is_empty() && quantile(&overlaps, 0.5) < ANOTHER
}

struct Trial<'a> {
    pictures: &'a Pictures<'a>,
    pairs: &'a [Pair],
    count: usize,
}

impl Trial<'_> {
    /// How each view agrees with its neighbours: the median correlation, with a photo for each camera.
    fn of_views(&self, photos: &[usize]) -> Vec<Option<f64>> {
        let found: Vec<Option<f64>> = parallel::map_items(self.pairs, |pair| {
            self.pictures.correlation(pair, pair.cameras.map(|camera| photos[camera]), [Lie::AsItIs; 2])
        });
        let mut of_views = vec![Vec::new(); self.count];
        for (pair, correlation) in self.pairs.iter().zip(found) {
            for camera in pair.cameras {
                of_views[camera].extend(correlation);
            }
        }
        of_views.into_iter().map(|found| (!found.is_empty()).then(|| quantile(&found, 0.5))).collect()
    }

    /// How one camera agrees with its neighbours when it takes another photo, or its own another way.
    fn of_view(&self, camera: usize, photo: usize, lie: Lie) -> Option<f64> {
        let of_camera = self.pairs.iter().filter(|pair| pair.cameras.contains(&camera));
        let found: Vec<f64> = of_camera
            .filter_map(|pair| {
                let is_own = pair.cameras.map(|other| other == camera);
                let photos = [0, 1].map(|side| if is_own[side] { photo } else { pair.cameras[side] });
                self.pictures.correlation(pair, photos, is_own.map(|own| if own { lie } else { Lie::AsItIs }))
            })
            .collect();
        (!found.is_empty()).then(|| quantile(&found, 0.5))
    }

    /// By how many places the photos are to be moved on to agree clearly better than by `own`, and how they agree then.
    fn best_shift(&self, own: f64) -> Option<(isize, f64)> {
        let count = self.count as isize;
        let trials = [1, -1, 2, -2].into_iter().filter(|shift: &isize| shift.abs() < count - 1);
        let (shift, agreement) = trials
            .filter_map(|shift| {
                let photos: Vec<usize> = (0..count).map(|camera| (camera + shift).rem_euclid(count) as usize).collect();
                let known: Vec<f64> = self.of_views(&photos).into_iter().flatten().collect();
                (known.len() > 2).then(|| (shift, quantile(&known, 0.5)))
            })
            .max_by(|a, b| a.1.total_cmp(&b.1))?;
        let needed = (LEAST_GAIN_SHARE * (1.0 - own)).max(LEAST_GAIN);
        (agreement - own > needed && agreement > LOW).then_some((shift, agreement))
    }
}

/// The pairs of a view with the neighbours that come after it, or that do not count it among their own.
fn pairs_of(scene: &Scene, bvh: &Bvh, probes: &[Vec<Probe>], a: usize) -> Vec<Pair> {
    let view = &scene.views[a];
    let pixel = |probe: &Probe| Some((probe.row * view.camera.width + probe.column) as u32);
    let points = neighbours::points(scene, &probes[a], POINTS_PER_VIEW, |_| true, pixel);
    neighbours::of(scene, probes, a, NEIGHBOURS)
        .into_iter()
        .filter_map(|b| {
            let camera = &scene.views[b].camera;
            let eye = camera.position_in_world();
            let (mut in_a, mut in_b) = (Vec::new(), Vec::new());
            for (point, normal, pixel) in &points {
                let Some(place) = camera.place_in_picture(*point) else { continue };
                let to_eye = eye - *point;
                // Grazing sights blur over many points of the surface.
                let is_grazing = to_eye.dot(*normal).abs() < 0.2 * to_eye.length();
                if !is_grazing && !bvh.is_hidden_from(*point, *normal, eye) {
                    in_a.push(*pixel);
                    in_b.push((place.y as usize * camera.width + place.x as usize) as u32);
                }
            }
            (in_a.len() >= FEWEST_SHARED).then_some(Pair { cameras: [a, b], pixels: [in_a, in_b] })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlation_is_that_of_a_line_and_none_of_a_constant() {
        let line = (0..50).map(|i| (f64::from(i), 3.0 - 2.0 * f64::from(i)));
        assert!((correlation(line).unwrap() + 1.0).abs() < 1e-12);
        assert_eq!(correlation((0..50).map(|i| (f64::from(i), 1.0))), None);
        assert_eq!(correlation((0..5).map(|i| (f64::from(i), f64::from(i)))), None);
    }
}
