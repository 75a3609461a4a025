//! Photos given to cameras on trial: how do they agree where those cameras see the same points of the surface?
//!
//! Visibility hangs on the cameras only, so that a trial of another photo, or of one that lies another way, is some thousand
//! pixels looked up.

use super::neighbours;
use super::probe::Probe;
use crate::image::file::{place_in_stored, swaps_sides};
use crate::math::{luminance, parallel, statistics::quantile};
use crate::scene::{PixelState, Scene, View};
use crate::trace::Bvh;

/// Points of each view that are looked up in its neighbours.
const POINTS_PER_VIEW: usize = 600;
/// Neighbours of each view: those that look from the most similar side.
const NEIGHBOURS: usize = 6;
/// A pair needs this many shared points.
const FEWEST_SHARED: usize = 40;
/// Below this radiance a pixel is dark: its logarithm is noise.
const DARK: f32 = 2e-3;
/// Another order of the photos, or another way they lie, is believed when the correlation rises by so much, and by this share
/// of what it lacks.
const LEAST_GAIN: f64 = 0.1;
const LEAST_GAIN_SHARE: f64 = 0.2;
/// Where most views correlate by less than this, that itself is told, and nothing is said of single ones.
pub(super) const JUDGED_ABOVE: f64 = 0.5;

/// Whether an agreement is clearly better than another.
pub(super) fn is_clearly_better(other: f64, own: f64) -> bool {
    other - own > (LEAST_GAIN_SHARE * (1.0 - own)).max(LEAST_GAIN)
}

/// How a photo lies in its picture: what is to be done to it, as the EXIF orientation of that number says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Lie(pub u8);

impl Lie {
    /// Nothing is to be done.
    pub const AS_IT_IS: Lie = Lie(1);

    /// All others that keep the sides of a picture of a size.
    pub fn others(size: (usize, usize)) -> impl Iterator<Item = Lie> {
        [3, 2, 4, 6, 8, 5, 7].into_iter().filter(move |&lie| size.0 == size.1 || !swaps_sides(lie)).map(Lie)
    }

    /// What is to be done.
    pub fn in_words(self) -> &'static str {
        match self.0 {
            2 => "mirrored left to right",
            3 => "turned by 180 degrees",
            4 => "mirrored top to bottom",
            5 => "mirrored and turned by 90 degrees counterclockwise",
            6 => "turned by 90 degrees clockwise",
            7 => "mirrored and turned by 90 degrees clockwise",
            8 => "turned by 90 degrees counterclockwise",
            _ => "as it is",
        }
    }
}

/// What a camera is given: a photo by the number of its view, and how that is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Given {
    pub photo: usize,
    pub lie: Lie,
}

impl Given {
    /// To each of `count` cameras its own photo as it is.
    pub fn own(count: usize) -> Vec<Given> {
        (0..count).map(|photo| Given { photo, lie: Lie::AS_IT_IS }).collect()
    }
}

/// Two cameras and where each sees the points that both see, by index of the pixel.
struct Pair {
    cameras: [usize; 2],
    pixels: [Vec<u32>; 2],
}

/// The cameras of a scene in pairs, and its photos.
pub(super) struct Trial<'a> {
    views: &'a [View],
    pairs: Vec<Pair>,
    /// The pairs of each camera.
    of_camera: Vec<Vec<usize>>,
}

impl<'a> Trial<'a> {
    /// Finds what the cameras share.
    pub fn new(scene: &'a Scene, bvh: &Bvh, probes: &[Vec<Probe>]) -> Self {
        let pairs = neighbours::over_views(scene, |view| pairs_of(scene, bvh, probes, view));
        let mut of_camera = vec![Vec::new(); scene.views.len()];
        for (index, pair) in pairs.iter().enumerate() {
            pair.cameras.into_iter().for_each(|camera| of_camera[camera].push(index));
        }
        Trial { views: &scene.views, pairs, of_camera }
    }

    /// How many pairs of cameras share enough.
    pub fn pair_count(&self) -> usize {
        self.pairs.len()
    }

    /// The cameras of a pair.
    pub fn cameras_of(&self, pair: usize) -> [usize; 2] {
        self.pairs[pair].cameras
    }

    /// The other cameras of a camera's pairs.
    pub fn neighbours(&self, camera: usize) -> impl Iterator<Item = usize> {
        self.of_camera[camera].iter().flat_map(move |&pair| self.pairs[pair].cameras).filter(move |&own| own != camera)
    }

    /// How the photos agree over the points of each pair, by what is given to the cameras.
    pub fn of_pairs(&self, given: &[Given]) -> Vec<Option<f64>> {
        parallel::map(self.pairs.len(), |pair| self.of_pair(pair, given))
    }

    /// The same anew for the pairs of one camera.
    pub fn renew(&self, found: &mut [Option<f64>], camera: usize, given: &[Given]) {
        self.of_camera[camera].iter().for_each(|&pair| found[pair] = self.of_pair(pair, given));
    }

    /// How each camera agrees with its neighbours: the median over its pairs, without those of cameras left out.
    pub fn of_views(&self, found: &[Option<f64>], is_left_out: &[bool]) -> Vec<Option<f64>> {
        let of_view = |camera: usize| {
            let known: Vec<f64> =
                self.pairs_with(camera, |other| is_left_out[other]).filter_map(|pair| found[pair]).collect();
            (!known.is_empty()).then(|| quantile(&known, 0.5))
        };
        (0..self.views.len()).map(of_view).collect()
    }

    /// How a camera agrees with the neighbour that it agrees best with.
    pub fn best_of_view(&self, camera: usize, found: &[Option<f64>], is_left_out: &[bool]) -> Option<f64> {
        self.pairs_with(camera, |other| is_left_out[other]).filter_map(|pair| found[pair]).max_by(f64::total_cmp)
    }

    /// The pairs of a camera, without those with cameras that are left out.
    fn pairs_with(&self, camera: usize, is_left_out: impl Fn(usize) -> bool) -> impl Iterator<Item = usize> {
        let is_counted = move |pair: &usize| {
            self.pairs[*pair].cameras.into_iter().all(|other| other == camera || !is_left_out(other))
        };
        self.of_camera[camera].iter().copied().filter(is_counted)
    }

    /// How one camera agrees with its neighbours, without those that are `left_out`.
    pub fn of_view(&self, camera: usize, given: &[Given], is_left_out: impl Fn(usize) -> bool) -> Option<f64> {
        let of_camera = self.pairs_with(camera, is_left_out);
        let known: Vec<f64> = of_camera.filter_map(|pair| self.of_pair(pair, given)).collect();
        (!known.is_empty()).then(|| quantile(&known, 0.5))
    }

    /// The median over all cameras; `None` where fewer than `fewest` have one.
    pub fn of_all(&self, given: &[Given], fewest: usize) -> Option<f64> {
        let of_views = self.of_views(&self.of_pairs(given), &vec![false; self.views.len()]);
        let known: Vec<f64> = of_views.into_iter().flatten().collect();
        (known.len() >= fewest).then(|| quantile(&known, 0.5))
    }

    /// Correlation of two photos over the points that two cameras share; `None` where too few can be compared.
    fn of_pair(&self, pair: usize, given: &[Given]) -> Option<f64> {
        let Pair { cameras, pixels } = &self.pairs[pair];
        let own = cameras.map(|camera| given[camera]);
        let sizes = own.map(|own| (self.views[own.photo].states.width(), self.views[own.photo].states.height()));
        let sizes_agree = [0, 1].into_iter().all(|side| {
            let states = &self.views[cameras[side]].states;
            let (width, height) =
                if swaps_sides(own[side].lie.0) { (sizes[side].1, sizes[side].0) } else { sizes[side] };
            (states.width(), states.height()) == (width, height)
        });
        if !sizes_agree {
            return None;
        }
        let look_up = |side: usize, index: u32| {
            let width = self.views[cameras[side]].states.width();
            let place = (index as usize / width, index as usize % width);
            let (row, column) = place_in_stored(own[side].lie.0, sizes[side], place);
            log_of(&self.views[own[side].photo], row, column)
        };
        let values = pixels[0].iter().zip(&pixels[1]).map(|(&a, &b)| (look_up(0, a), look_up(1, b)));
        correlation(values.filter(|(x, y)| x.is_finite() && y.is_finite()))
    }
}

/// Logarithm of the radiance over three by three pixels, so that a fine texture and the grain of the film do not decide; NaN
/// where the photo tells none.
fn log_of(View { photo, states, .. }: &View, row: usize, column: usize) -> f64 {
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
