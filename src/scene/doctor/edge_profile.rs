//! How far the photo's edges lie from the mesh's silhouette.
//!
//! Along rows and columns, the place where the silhouette passes is found by bisection between the rays of two pixels.
//! The photo's contrast around all these places is added up into a profile; an edge of the photo that lies beside the
//! silhouette by the same distance everywhere shows as a displaced peak, and edges that have nothing to do with the
//! silhouette add a flat floor. A mesh that is a little too fat or too thin displaces left and right edges in opposite
//! directions; so they are kept apart and their mean counts.

use super::probe::{centre_of, hit_at};
use crate::math::luminance;
use crate::scene::{PixelState, View};
use crate::trace::{Bvh, Hit};
use glam::Vec2;

/// Rows and columns that are searched, each.
const LINES: usize = 120;
/// Half the length of the profile, in pixels, and its step.
const REACH_PIXELS: f32 = 4.0;
const STEP_PIXELS: f32 = 0.25;
const PROFILE_LENGTH: usize = 33;
/// A profile needs this many crossings and this contrast of its peak over its floor.
const FEWEST_CROSSINGS: usize = 40;
const LEAST_CONTRAST: f64 = 1.5;
/// A jump in depth by this share, or to the background, is a silhouette.
const DEPTH_JUMP: f32 = 0.04;

/// Sum of contrast profiles around crossings of the silhouette.
#[derive(Clone, Copy, Debug)]
pub struct Profile {
    sums: [f64; PROFILE_LENGTH],
    count: usize,
}

/// The profiles of one view, or of several added up: along x and y, where the nearer surface ends and where it begins.
#[derive(Clone, Copy, Debug)]
pub struct Profiles([[Profile; 2]; 2]);

impl Profiles {
    /// No crossings.
    pub const EMPTY: Profiles = Profiles([[Profile { sums: [0.0; PROFILE_LENGTH], count: 0 }; 2]; 2]);

    /// The profiles of a view.
    pub fn of_view(view: &View, bvh: &Bvh) -> Self {
        let mut profiles = Profiles::EMPTY;
        profiles.add_along(view, bvh, Vec2::X);
        profiles.add_along(view, bvh, Vec2::Y);
        profiles
    }

    /// Adds the crossings of other views.
    pub fn add(&mut self, other: &Profiles) {
        for (own, other) in self.0.as_flattened_mut().iter_mut().zip(other.0.as_flattened()) {
            own.sums.iter_mut().zip(other.sums).for_each(|(sum, value)| *sum += value);
            own.count += other.count;
        }
    }

    /// Number of crossings.
    pub fn count(&self) -> usize {
        self.0.as_flattened().iter().map(|profile| profile.count).sum()
    }

    /// Offset in pixels along x and y of the photo's edges from the mesh's silhouette; `None` along an axis with too
    /// little contrast or silhouette.
    pub fn offsets(&self) -> [Option<f64>; 2] {
        let along = |[ends, begins]: &[Profile; 2]| Some(0.5 * (peak(ends)? + peak(begins)?));
        [along(&self.0[0]), along(&self.0[1])]
    }

    fn add_along(&mut self, view: &View, bvh: &Bvh, axis: Vec2) {
        let camera = &view.camera;
        let (length, lines) =
            if axis == Vec2::X { (camera.width, camera.height) } else { (camera.height, camera.width) };
        let sides = &mut self.0[usize::from(axis != Vec2::X)];
        let step = (lines / LINES).max(1);
        for line in (step / 2..lines).step_by(step) {
            let centre = |along: usize| if axis == Vec2::X { centre_of(line, along) } else { centre_of(along, line) };
            let mut before = hit_at(camera, bvh, centre(0));
            for along in 1..length {
                let after = hit_at(camera, bvh, centre(along));
                if let Some(begins) = silhouette_between(before, after)
                    && let Some(front) = if begins { after } else { before }
                {
                    let crossing = bisect(view, bvh, centre(along - 1), centre(along), front, begins);
                    add_profile(view, crossing, axis, &mut sides[usize::from(begins)]);
                }
                before = after;
            }
        }
    }
}

/// Whether a silhouette lies between two neighbouring hits; `true` when the nearer surface begins there.
fn silhouette_between(before: Option<Hit>, after: Option<Hit>) -> Option<bool> {
    match (before, after) {
        (None, None) => None,
        (None, Some(_)) => Some(true),
        (Some(_), None) => Some(false),
        (Some(before), Some(after)) => {
            let jump = (before.t - after.t) / before.t.min(after.t);
            (jump.abs() > DEPTH_JUMP).then_some(jump > 0.0)
        }
    }
}

/// The place between two pixel centres where the nearer surface begins or ends.
fn bisect(view: &View, bvh: &Bvh, first: Vec2, second: Vec2, front: Hit, begins: bool) -> Vec2 {
    let (mut low, mut high) = (first, second);
    for _ in 0..6 {
        let middle = 0.5 * (low + high);
        let is_front =
            hit_at(&view.camera, bvh, middle).is_some_and(|hit| (hit.t - front.t).abs() < 0.5 * DEPTH_JUMP * front.t);
        if is_front == begins {
            high = middle;
        } else {
            low = middle;
        }
    }
    0.5 * (low + high)
}

fn add_profile(view: &View, crossing: Vec2, axis: Vec2, profile: &mut Profile) {
    let mut contrast = [0.0f64; PROFILE_LENGTH];
    for (index, value) in contrast.iter_mut().enumerate() {
        let place = crossing + axis * (index as f32 * STEP_PIXELS - REACH_PIXELS);
        let (Some(before), Some(after)) = (brightness(view, place - 0.5 * axis), brightness(view, place + 0.5 * axis))
        else {
            return;
        };
        *value = f64::from((after - before).abs());
    }
    let sum: f64 = contrast.iter().sum();
    // A crossing without any contrast would only add noise of the encoding.
    if sum < 0.02 * PROFILE_LENGTH as f64 {
        return;
    }
    profile.count += 1;
    profile.sums.iter_mut().zip(contrast).for_each(|(total, value)| *total += value / sum);
}

/// Perceptual brightness (square root of luminance) between pixel centres, bilinear; `None` off the picture or where
/// pixels are ignored.
fn brightness(view: &View, place: Vec2) -> Option<f32> {
    let corner = place - 0.5;
    let (x, y) = (corner.x.floor(), corner.y.floor());
    if x < 0.0 || y < 0.0 || x + 1.0 >= view.camera.width as f32 || y + 1.0 >= view.camera.height as f32 {
        return None;
    }
    let (column, row) = (x as usize, y as usize);
    let at = |row: usize, column: usize| {
        let known = view.states[(row, column)] != PixelState::Ignored;
        known.then(|| luminance(view.photo.radiance(row, column)).max(0.0).sqrt())
    };
    let (u, v) = (corner.x - x, corner.y - y);
    let upper = at(row, column)? * (1.0 - u) + at(row, column + 1)? * u;
    let lower = at(row + 1, column)? * (1.0 - u) + at(row + 1, column + 1)? * u;
    Some(upper * (1.0 - v) + lower * v)
}

/// Where a profile peaks, in pixels from the silhouette: the centroid of what rises above the floor, around the
/// highest place.
fn peak(profile: &Profile) -> Option<f64> {
    if profile.count < FEWEST_CROSSINGS {
        return None;
    }
    let mean = |range: std::ops::Range<usize>| range.clone().map(|i| profile.sums[i]).sum::<f64>() / range.len() as f64;
    let floor = 0.5 * (mean(0..5) + mean(PROFILE_LENGTH - 5..PROFILE_LENGTH));
    let centre = (5..PROFILE_LENGTH - 5).max_by(|&a, &b| profile.sums[a].total_cmp(&profile.sums[b]))?;
    if profile.sums[centre] < LEAST_CONTRAST * floor {
        return None;
    }
    // The window is two pixels wide and moves until the centroid is in its middle.
    let mut place = centre as f64;
    for _ in 0..20 {
        let (mut sum, mut weighted) = (0.0, 0.0);
        for (index, value) in profile.sums.iter().enumerate() {
            let window = (1.0 - (index as f64 - place).abs() * f64::from(STEP_PIXELS) / 1.5).max(0.0);
            let weight = window * (value - floor).max(0.0);
            sum += weight;
            weighted += weight * index as f64;
        }
        if sum <= 0.0 {
            return None;
        }
        place = weighted / sum;
    }
    Some(place * f64::from(STEP_PIXELS) - f64::from(REACH_PIXELS))
}
