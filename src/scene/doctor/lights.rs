//! Is there one light, does it turn with the camera, or does it fall into groups?
//!
//! A fit explains all photos by one light that stands still in the world. On a turntable it is the camera that stands
//! still beside the light; and of photos taken in the morning and at noon each has its own. What tells is shading: over
//! points that several photos show, the logarithm of radiance is taken as
//!
//! `ln I(point, view) = reflectance(point) + gain(view) + b(view) . normal(point)`
//!
//! by least squares with weights that leave out highlights and shadows (Geman and McClure's). Reflectance and what all
//! photos have in common drop out; what is left is how far the vectors `b` differ: not at all (one light), as one vector
//! that stands still in the cameras, or as one vector for each run of photos in the order of their names. The share of
//! the squared residuals that each of these takes away decides.
//!
//! It refuses to judge where the photos share too little, and it takes no gloss for a light: what a light must explain is
//! larger than what highlights leave. Of a metal, all of whose light is mirrored, a turning light is not told: its shading
//! goes with the mirrored direction, not with the normal.

use super::Report;
use super::probe::{Probe, surface_at};
use crate::error::{Finding, Place, Severity};
use crate::math::luminance;
use crate::scene::{PixelState, Scene, View};
use crate::trace::Bvh;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// At most so many views are looked at, spread evenly.
const MOST_VIEWS: usize = 48;
/// Points that are looked at.
const POINTS: usize = 4000;
/// A point must be seen by so many views.
const FEWEST_SIGHTS: usize = 3;
/// With fewer points than this nothing is said.
const FEWEST_POINTS: usize = 200;
/// Below this radiance a pixel is dark: its logarithm is noise.
const DARK: f32 = 2e-3;
/// Share of the squared residuals that another light must take away.
const LEAST_SHARE: f64 = 0.25;
/// Share of what a light of its own for each photo takes away that the simpler explanation must reach.
const LEAST_PART: f64 = 0.55;
/// Root mean square of what it takes away, in natural logarithms of radiance: gloss under one light comes to 0.1.
const LEAST_SIZE: f64 = 0.15;
/// Rounds of weighting.
const ROUNDS: usize = 4;

/// How the shading of the photos goes with the cameras.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct LightCheck {
    /// Root mean square of what one light leaves of the logarithms of radiance.
    pub one_light_residual: f64,
    /// Share of the squared residuals under one light that a light standing still in the cameras takes away, in [0, 1].
    pub with_camera: f64,
    /// The same for the best cut of the photos, in the order of their names, into two groups with a light each.
    pub in_groups: f64,
    /// The same for a light of its own for each photo.
    pub of_each: f64,
    /// Name of the first view of the second group.
    pub second_group_begins: String,
}

/// What the light of the photos is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LightKind {
    /// One for all photos.
    One,
    /// One that turns with the camera.
    WithCamera,
    /// One for each of two groups of photos.
    InGroups,
}

impl LightCheck {
    /// Which explanation is believed: the simplest that is as good as any.
    pub fn kind(&self) -> LightKind {
        let explained = |share: f64| {
            let is_most = share > LEAST_SHARE && share > LEAST_PART * self.of_each;
            is_most && self.one_light_residual * share.sqrt() > LEAST_SIZE
        };
        if explained(self.with_camera) && self.with_camera >= self.in_groups {
            LightKind::WithCamera
        } else if explained(self.in_groups) {
            LightKind::InGroups
        } else {
            LightKind::One
        }
    }
}

/// A point seen by several views: (view, logarithm of radiance), and the normal there.
struct Sighted {
    normal: DVec3,
    logs: Vec<(usize, f64)>,
}

/// Measures the lights and says what they are.
pub fn check(scene: &Scene, bvh: &Bvh, probes: &[Vec<Probe>], report: &mut Report) {
    let step = scene.views.len().div_ceil(MOST_VIEWS).max(1);
    let views: Vec<usize> = (0..scene.views.len()).step_by(step).filter(|&view| !probes[view].is_empty()).collect();
    if views.len() < 4 {
        return;
    }
    let points = sighted(scene, bvh, probes, &views);
    if points.len() < FEWEST_POINTS {
        return;
    }
    let rotations: Vec<_> =
        views.iter().map(|&view| scene.views[view].camera.rotation_camera_from_world.as_dmat3()).collect();
    let Some((found, cut)) = explain(&points, &rotations) else { return };
    let name = |place: usize| scene.views[views[place]].name.as_str();
    let first = name(cut);
    let percent = |share: f64| format!("{:.0} %", 100.0 * share);
    let found = LightCheck { second_group_begins: first.into(), ..found };
    let remedy =
        "a fit takes one light for all photos, and bakes what differs into the maps: fit photos of one light alone";
    if found.kind() == LightKind::WithCamera {
        let message = format!(
            "the light turns with the camera, as on a turntable: that explains {} of how the shading of the same surface \
             differs between photos",
            percent(found.with_camera)
        );
        report.findings.push(
            Finding::new(Severity::Warning, "light-turns-with-camera", message)
                .remedy(format!("{remedy}, or move the camera around the object instead")),
        );
    } else if found.kind() == LightKind::InGroups {
        let (last, of_first) = (name(cut - 1), name(0));
        let message = format!(
            "the photos fall into two groups with a light each, {of_first} to {last} and {first} to {}: that explains {} of \
             how the shading of the same surface differs between photos",
            name(views.len() - 1),
            percent(found.in_groups)
        );
        report.findings.push(
            Finding::new(Severity::Warning, "light-in-groups", message).at(Place::View(first.into())).remedy(remedy),
        );
    }
    report.light = Some(found);
}

fn sighted(scene: &Scene, bvh: &Bvh, probes: &[Vec<Probe>], views: &[usize]) -> Vec<Sighted> {
    let from_each = POINTS.div_ceil(views.len());
    let places: Vec<(Vec3, Vec3, Vec3)> = views
        .iter()
        .flat_map(|&view| {
            let hits: Vec<_> = probes[view].iter().filter_map(|probe| probe.hit.as_ref()).collect();
            let step = (hits.len() / from_each).max(1);
            hits.into_iter().step_by(step).filter_map(|hit| surface_at(&scene.mesh, hit)).collect::<Vec<_>>()
        })
        .collect();
    places
        .into_par_iter()
        .filter_map(|(point, normal, shading)| {
            let logs: Vec<(usize, f64)> = views
                .iter()
                .enumerate()
                .filter_map(|(place, &view)| Some((place, log_seen(scene, bvh, view, point, normal)?)))
                .collect();
            (logs.len() >= FEWEST_SIGHTS).then(|| Sighted { normal: shading.as_dvec3(), logs })
        })
        .collect()
}

/// Logarithm of what a view sees at a point; `None` where it does not see it well.
fn log_seen(scene: &Scene, bvh: &Bvh, view: usize, point: Vec3, normal: Vec3) -> Option<f64> {
    let View { camera, photo, states, .. } = &scene.views[view];
    let place = camera.place_in_picture(point)?;
    let to_eye = camera.position_in_world() - point;
    if to_eye.dot(normal) < 0.3 * to_eye.length() {
        return None;
    }
    let (row, column) = (place.y as usize, place.x as usize);
    if states[(row, column)] != PixelState::Surface {
        return None;
    }
    let value = luminance(photo.radiance(row, column));
    (value > DARK && !bvh.is_hidden_from(point, normal, camera.position_in_world())).then(|| f64::from(value.ln()))
}

/// The normal equations of gains and vectors of all views, four unknowns a view, with reflectances eliminated.
struct Equations {
    size: usize,
    /// Upper and lower half, row by row.
    matrix: Vec<f64>,
    right: Vec<f64>,
    squares: f64,
}

impl Equations {
    fn of(points: &[Sighted], views: usize, weights: &[Vec<f64>]) -> Self {
        let size = 4 * views;
        let mut equations = Equations { size, matrix: vec![0.0; size * size], right: vec![0.0; size], squares: 0.0 };
        for (point, weights) in points.iter().zip(weights) {
            let total: f64 = weights.iter().sum();
            if total <= 0.0 {
                continue;
            }
            let mean = point.logs.iter().zip(weights).map(|((_, log), weight)| weight * log).sum::<f64>() / total;
            let unknowns = [1.0, point.normal.x, point.normal.y, point.normal.z];
            // The weighted mean over the views of a point is its reflectance: what is left are differences from it.
            for (&(a, log), &weight_a) in point.logs.iter().zip(weights) {
                equations.squares += weight_a * (log - mean).powi(2);
                for (i, &x) in unknowns.iter().enumerate() {
                    equations.right[4 * a + i] += weight_a * x * (log - mean);
                }
                for (&(b, _), &weight_b) in point.logs.iter().zip(weights) {
                    let own = if a == b { weight_a } else { 0.0 };
                    let coupling = own - weight_a * weight_b / total;
                    for (i, &x) in unknowns.iter().enumerate() {
                        let row = (4 * a + i) * size + 4 * b;
                        for (j, &y) in unknowns.iter().enumerate() {
                            equations.matrix[row + j] += coupling * x * y;
                        }
                    }
                }
            }
        }
        equations
    }

    /// The least sum of squared residuals when all unknowns are combinations of fewer, and those combined: each unknown
    /// is a list of (number among the fewer, factor).
    fn least_squares(&self, fewer: usize, of: &[Vec<(usize, f64)>]) -> Option<(f64, Vec<f64>)> {
        let mut matrix = vec![0.0; fewer * fewer];
        let mut right = vec![0.0; fewer];
        for (row, from_row) in of.iter().enumerate() {
            for &(i, x) in from_row {
                right[i] += x * self.right[row];
            }
            for (column, from_column) in of.iter().enumerate() {
                let value = self.matrix[row * self.size + column];
                if value != 0.0 {
                    for &(i, x) in from_row {
                        for &(j, y) in from_column {
                            matrix[i * fewer + j] += x * y * value;
                        }
                    }
                }
            }
        }
        let found = solve(matrix, &right)?;
        let explained: f64 = found.iter().zip(&right).map(|(x, y)| x * y).sum();
        let whole = of.iter().map(|from| from.iter().map(|&(i, x)| x * found[i]).sum()).collect();
        Some(((self.squares - explained).max(0.0), whole))
    }
}

/// Solves a symmetric system by Cholesky's method. What all views have in common has no equation: a little is added to the
/// diagonal, which keeps it at 0.
fn solve(mut matrix: Vec<f64>, right: &[f64]) -> Option<Vec<f64>> {
    let size = right.len();
    let trace: f64 = (0..size).map(|i| matrix[i * size + i]).sum();
    let little = 1e-7 * trace / size as f64;
    for i in 0..size {
        for j in 0..=i {
            let mut value = matrix[i * size + j] + if i == j { little } else { 0.0 };
            value -= (0..j).map(|k| matrix[i * size + k] * matrix[j * size + k]).sum::<f64>();
            if i == j {
                if !(value > 0.0) {
                    return None;
                }
                matrix[i * size + i] = value.sqrt();
            } else {
                matrix[i * size + j] = value / matrix[j * size + j];
            }
        }
    }
    let mut found = right.to_vec();
    for i in 0..size {
        let known: f64 = (0..i).map(|k| matrix[i * size + k] * found[k]).sum();
        found[i] = (found[i] - known) / matrix[i * size + i];
    }
    for i in (0..size).rev() {
        let known: f64 = (i + 1..size).map(|k| matrix[k * size + i] * found[k]).sum();
        found[i] = (found[i] - known) / matrix[i * size + i];
    }
    Some(found)
}

/// The shares that each explanation takes away, and where the second group begins.
fn explain(points: &[Sighted], rotations: &[glam::DMat3]) -> Option<(LightCheck, usize)> {
    let views = rotations.len();
    let free: Vec<Vec<(usize, f64)>> = (0..4 * views).map(|unknown| vec![(unknown, 1.0)]).collect();
    let mut weights: Vec<Vec<f64>> = points.iter().map(|point| vec![1.0; point.logs.len()]).collect();
    for _ in 0..ROUNDS {
        let (_, found) = Equations::of(points, views, &weights).least_squares(4 * views, &free)?;
        reweigh(points, &found, &mut weights);
    }
    let equations = Equations::of(points, views, &weights);
    let residual = |fewer, of: &[Vec<(usize, f64)>]| equations.least_squares(fewer, of).map(|found| found.0);
    // Each view's gain stays free; `b` of a view is what `vector` makes of unknowns behind the gains.
    let with = |vectors: usize, vector: &dyn Fn(usize, usize) -> Vec<(usize, f64)>| {
        let of: Vec<Vec<(usize, f64)>> = (0..4 * views)
            .map(|unknown| {
                let (view, part) = (unknown / 4, unknown % 4);
                if part == 0 {
                    return vec![(view, 1.0)];
                }
                vector(view, part - 1).into_iter().map(|(number, factor)| (views + number, factor)).collect()
            })
            .collect();
        residual(views + vectors, &of)
    };
    let of_one = with(0, &|_, _| Vec::new())?;
    let of_each = residual(4 * views, &free)?;
    // b in the world = transpose of the rotation times b in the camera.
    let of_camera = with(3, &|view, axis| (0..3).map(|i| (i, rotations[view].col(axis)[i])).collect())?;
    let least_group = (views / 8).max(2);
    let (cut, of_groups) = (least_group..=views - least_group)
        .filter_map(|cut| {
            let of_cut = with(3, &|view, axis| if view < cut { Vec::new() } else { vec![(axis, 1.0)] })?;
            Some((cut, of_cut))
        })
        .min_by(|a, b| a.1.total_cmp(&b.1))?;
    let share = |residual: f64| if of_one > 0.0 { (1.0 - residual / of_one).clamp(0.0, 1.0) } else { 0.0 };
    let total: f64 = weights.iter().flatten().sum();
    let found = LightCheck {
        one_light_residual: (of_one / total.max(1e-12)).sqrt(),
        with_camera: share(of_camera),
        in_groups: share(of_groups),
        of_each: share(of_each),
        second_group_begins: String::new(),
    };
    Some((found, cut))
}

/// Weights by how far each logarithm is from what gains and vectors say.
fn reweigh(points: &[Sighted], found: &[f64], weights: &mut [Vec<f64>]) {
    let of_point = |point: &Sighted, weights: &[f64]| -> Vec<f64> {
        let rest: Vec<f64> = point
            .logs
            .iter()
            .map(|&(view, log)| {
                let own = &found[4 * view..4 * view + 4];
                log - own[0] - point.normal.dot(DVec3::new(own[1], own[2], own[3]))
            })
            .collect();
        let total: f64 = weights.iter().sum();
        let mean = rest.iter().zip(weights).map(|(rest, weight)| rest * weight).sum::<f64>() / total.max(1e-12);
        rest.into_iter().map(|rest| rest - mean).collect()
    };
    let rests: Vec<Vec<f64>> =
        points.iter().zip(weights.iter()).map(|(point, weights)| of_point(point, weights)).collect();
    let mut sizes: Vec<f64> = rests.iter().flatten().map(|rest| rest.abs()).collect();
    let half = sizes.len() / 2;
    let median = *sizes.select_nth_unstable_by(half, f64::total_cmp).1;
    let scale = (2.0 * median).max(1e-6);
    for (weights, rests) in weights.iter_mut().zip(rests) {
        for (weight, rest) in weights.iter_mut().zip(rests) {
            *weight = (1.0 + (rest / scale).powi(2)).powi(-2);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::SequentialRandom;
    use glam::DMat3;

    /// A ball of random reflectance, photographed from a ring; `b` gives the shading vector of each view.
    fn ball(b: impl Fn(usize, &DMat3) -> DVec3) -> (Vec<Sighted>, Vec<DMat3>) {
        let rotations: Vec<DMat3> = (0..16).map(|view| DMat3::from_rotation_y(f64::from(view) * 0.39)).collect();
        let mut random = SequentialRandom::new(9);
        let mut number = || f64::from(2.0 * random.next_number() - 1.0);
        let mut points = Vec::new();
        while points.len() < 1500 {
            let Some(normal) = DVec3::new(number(), number(), number()).try_normalize() else { continue };
            let reflectance = number();
            let logs: Vec<(usize, f64)> = rotations
                .iter()
                .enumerate()
                .filter(|(_, rotation)| (**rotation * normal).z < -0.3)
                .map(|(view, rotation)| {
                    // Some are in shadow, some in a highlight; each photo has an exposure of its own.
                    let disturbance = if number() > 0.9 { 2.0 * number() } else { 0.05 * number() };
                    (view, reflectance + 0.1 * (view % 3) as f64 + b(view, rotation).dot(normal) + disturbance)
                })
                .collect();
            if logs.len() >= FEWEST_SIGHTS {
                points.push(Sighted { normal, logs });
            }
        }
        (points, rotations)
    }

    fn shares(b: impl Fn(usize, &DMat3) -> DVec3) -> (LightCheck, usize) {
        let (points, rotations) = ball(b);
        explain(&points, &rotations).unwrap()
    }

    #[test]
    fn one_light_a_turning_light_and_two_lights_are_told_apart() {
        let light = DVec3::new(0.5, 0.6, -0.2);
        let (one, _) = shares(|_, _| light);
        assert!(one.of_each < 0.1, "{one:?}");
        let (turning, _) = shares(|_, rotation| rotation.transpose() * light);
        assert!(turning.with_camera > 0.8 && turning.in_groups < turning.with_camera, "{turning:?}");
        let (two, cut) = shares(|view, _| if view < 6 { light } else { DVec3::new(-0.4, 0.5, 0.3) });
        assert!(two.in_groups > 0.8 && cut == 6, "{two:?} {cut}");
    }
}
