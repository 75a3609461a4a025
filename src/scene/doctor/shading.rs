//! Least squares over what several photos see of the same points: which function of directions explains the shading?
//!
//! `ln I(point, view) = reflectance(point) + gain(view) + b(view) . normal(point) + f . features(point, view)`
//!
//! with weights that leave out shadows and what shines (Geman and McClure's). Reflectances are eliminated as weighted means
//! over the views of a point, so that only differences between views are explained. The normal equations are made once for
//! everything; an explanation is a choice among their unknowns.
//!
//! It refuses to say what a share means: [`lights`](super::lights) does.

mod equations;
mod groups;

use equations::Equations;
use glam::{DMat3, DVec3};

/// Linear and quadratic terms of a direction: the spherical harmonics of the first two bands, but for constants.
const TERMS: usize = 8;
/// Terms of the normal in the camera, of the mirrored direction in the camera, of the mirrored direction in the world.
const FEATURES: usize = 3 * TERMS;
/// The normal in the camera: with these alone, a vector that stands still there.
const OF_NORMAL: std::ops::Range<usize> = 0..3;
/// Those of the camera.
const OF_CAMERA: std::ops::Range<usize> = 0..2 * TERMS;
/// Those of the world.
const OF_WORLD: std::ops::Range<usize> = 2 * TERMS..FEATURES;
/// Unknowns of a view: its gain and a vector.
const OF_VIEW: usize = 4;
/// Rounds of weighting.
const ROUNDS: usize = 4;

/// A point seen by several views.
pub(super) struct Sighted {
    /// Shading normal in the world.
    pub normal: DVec3,
    /// What each view sees of it.
    pub sights: Vec<Sight>,
}

/// What a view sees of a point.
pub(super) struct Sight {
    /// The view's place in the list of rotations.
    pub view: usize,
    /// Natural logarithm of the luminance.
    pub log: f64,
    features: [f64; FEATURES],
}

impl Sight {
    /// A sight along `to_eye`, a unit vector in the world from the point to the camera.
    pub fn new(view: usize, log: f64, normal: DVec3, to_eye: DVec3, camera_from_world: &DMat3) -> Self {
        let mirrored = 2.0 * normal.dot(to_eye) * normal - to_eye;
        let mut features = [0.0; FEATURES];
        let directions = [*camera_from_world * normal, *camera_from_world * mirrored, mirrored];
        for (terms, direction) in features.chunks_exact_mut(TERMS).zip(directions) {
            let DVec3 { x, y, z } = direction;
            terms.copy_from_slice(&[x, y, z, x * y, y * z, z * x, x * x - y * y, 3.0 * z * z - 1.0]);
        }
        Sight { view, log, features }
    }
}

/// Of the squared residuals under one light without gloss, the share in [0, 1] that each explanation takes away.
#[derive(Clone, Debug)]
pub(super) struct Shares {
    /// Root mean square of the residuals under one light, in natural logarithms.
    pub residual: f64,
    /// One vector that stands still in the cameras.
    pub with_camera: f64,
    /// One function of where normal and mirrored direction point in the camera.
    pub shine_with_camera: f64,
    /// One function of where the mirrored direction points in the world.
    pub shine_in_world: f64,
    /// Two groups of views with a vector each, cut at the best place.
    pub in_groups: f64,
    /// A vector for each view.
    pub of_each: f64,
    /// The first view of the second group.
    pub cut: usize,
    /// Groups of views in any order with a vector each, two or three of them.
    pub in_any_groups: f64,
    /// The group of each view; empty where there are none.
    pub groups: Vec<usize>,
}

/// Measures the shares; `None` where the equations have no solution.
pub(super) fn explain(points: &[Sighted], views: usize) -> Option<Shares> {
    let features_begin = OF_VIEW * views;
    let whole: Vec<Vec<(usize, f64)>> = (0..features_begin + FEATURES).map(|unknown| vec![(unknown, 1.0)]).collect();
    let mut weights: Vec<Vec<f64>> = points.iter().map(|point| vec![1.0; point.sights.len()]).collect();
    for _ in 0..ROUNDS {
        let (_, found) = Equations::of(points, views, &weights).least_squares(whole.len(), &whole)?;
        reweigh(points, &found, &mut weights);
    }
    let equations = Equations::of(points, views, &weights);
    // Gains stay free; behind them stand the unknowns that `named` gives to the vectors' parts and to the features.
    let residual = |more: usize, named: &dyn Fn(Unknown) -> Option<usize>| {
        let of: Vec<Vec<(usize, f64)>> = (0..features_begin + FEATURES)
            .map(|unknown| match (unknown.checked_sub(features_begin), unknown % OF_VIEW) {
                (None, 0) => vec![(unknown / OF_VIEW, 1.0)],
                (None, part) => list(views, named(Unknown::Vector { view: unknown / OF_VIEW, axis: part - 1 })),
                (Some(feature), _) => list(views, named(Unknown::Feature(feature))),
            })
            .collect();
        equations.least_squares(views + more, &of)
    };
    let only = |range: std::ops::Range<usize>| {
        let found = residual(range.len(), &|unknown| match unknown {
            Unknown::Feature(feature) if range.contains(&feature) => Some(feature - range.start),
            _ => None,
        });
        found.map(|found| found.0)
    };
    let of_one = residual(0, &|_| None)?.0;
    let (of_each, vectors) = residual(3 * views, &|unknown| match unknown {
        Unknown::Vector { view, axis } => Some(3 * view + axis),
        Unknown::Feature(_) => None,
    })?;
    let (of_vector, of_camera, of_world) = (only(OF_NORMAL)?, only(OF_CAMERA)?, only(OF_WORLD)?);
    let least_group = (views / 8).max(2);
    let (cut, of_groups) = (least_group..=views.checked_sub(least_group)?)
        .filter_map(|cut| {
            let of_cut = residual(3, &|unknown| match unknown {
                Unknown::Vector { view, axis } if view >= cut => Some(axis),
                _ => None,
            })?;
            Some((cut, of_cut.0))
        })
        .min_by(|a, b| a.1.total_cmp(&b.1))?;
    let vectors: Vec<DVec3> =
        vectors.chunks_exact(OF_VIEW).take(views).map(|own| DVec3::new(own[1], own[2], own[3])).collect();
    let mut of_any = (of_one, Vec::new());
    for count in [2, 3] {
        let Some(groups) = groups::of(&vectors, count) else { continue };
        let found = residual(3 * (count - 1), &|unknown| match unknown {
            Unknown::Vector { view, axis } => groups[view].checked_sub(1).map(|group| 3 * group + axis),
            Unknown::Feature(_) => None,
        });
        // A third group must take away half of what two leave.
        if let Some((left, _)) = found.filter(|(left, _)| of_any.1.is_empty() || *left < 0.5 * of_any.0) {
            of_any = (left, groups);
        }
    }
    let share = |residual: f64| if of_one > 0.0 { (1.0 - residual / of_one).clamp(0.0, 1.0) } else { 0.0 };
    let total: f64 = weights.iter().flatten().sum();
    Some(Shares {
        residual: (of_one / total.max(1e-12)).sqrt(),
        with_camera: share(of_vector),
        shine_with_camera: share(of_camera),
        shine_in_world: share(of_world),
        in_groups: share(of_groups),
        of_each: share(of_each),
        cut,
        in_any_groups: share(of_any.0),
        groups: of_any.1,
    })
}

/// What an unknown behind the gains stands for.
enum Unknown {
    /// A part of a view's vector.
    Vector { view: usize, axis: usize },
    /// The factor of a feature.
    Feature(usize),
}

fn list(views: usize, number: Option<usize>) -> Vec<(usize, f64)> {
    number.map(|number| (views + number, 1.0)).into_iter().collect()
}

/// Weights by how far each logarithm is from what gains, vectors and features say.
fn reweigh(points: &[Sighted], found: &[f64], weights: &mut [Vec<f64>]) {
    let features = &found[found.len() - FEATURES..];
    let of_point = |point: &Sighted, weights: &[f64]| -> Vec<f64> {
        let rest: Vec<f64> = point
            .sights
            .iter()
            .map(|sight| {
                let own = &found[OF_VIEW * sight.view..][..OF_VIEW];
                let of_features: f64 = sight.features.iter().zip(features).map(|(x, factor)| x * factor).sum();
                sight.log - own[0] - point.normal.dot(DVec3::new(own[1], own[2], own[3])) - of_features
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

    /// A ball of random reflectance, photographed from a ring; `shading` says what each view sees in a normal and in the
    /// direction mirrored by it, both in the world.
    fn ball(shading: impl Fn(usize, &DMat3, DVec3, DVec3) -> f64) -> Shares {
        let rotations: Vec<DMat3> = (0..16).map(|view| DMat3::from_rotation_y(f64::from(view) * 0.39)).collect();
        let mut random = SequentialRandom::new(9);
        let mut number = || f64::from(2.0 * random.next_number() - 1.0);
        let mut points = Vec::new();
        while points.len() < 1500 {
            let Some(normal) = DVec3::new(number(), number(), number()).try_normalize() else { continue };
            let reflectance = number();
            let mut sights = Vec::new();
            for (view, rotation) in rotations.iter().enumerate() {
                let to_eye = rotation.transpose() * DVec3::NEG_Z;
                if normal.dot(to_eye) < 0.3 {
                    continue;
                }
                // Some are in shadow, some in a highlight; each photo has an exposure of its own.
                let disturbance = if number() > 0.9 { 2.0 * number() } else { 0.05 * number() };
                let mirrored = 2.0 * normal.dot(to_eye) * normal - to_eye;
                let seen = shading(view, rotation, normal, mirrored);
                let log = reflectance + 0.1 * (view % 3) as f64 + seen + disturbance;
                sights.push(Sight::new(view, log, normal, to_eye, rotation));
            }
            if sights.len() >= 3 {
                points.push(Sighted { normal, sights });
            }
        }
        explain(&points, rotations.len()).unwrap()
    }

    #[test]
    fn one_light_a_turning_light_and_two_lights_are_told_apart() {
        let light = DVec3::new(0.5, 0.6, -0.2);
        let one = ball(|_, _, normal, _| light.dot(normal));
        assert!(one.of_each < 0.1 && one.shine_with_camera < 0.1, "{one:?}");
        let turning = ball(|_, rotation, normal, _| (rotation.transpose() * light).dot(normal));
        assert!(turning.with_camera > 0.8 && turning.in_groups < turning.with_camera, "{turning:?}");
        let other = DVec3::new(-0.4, 0.5, 0.3);
        let two = ball(|view, _, normal, _| if view < 6 { light } else { other }.dot(normal));
        assert!(two.in_groups > 0.8 && two.cut == 6, "{two:?}");
        // By turns, as of two cameras with a flash each, and of three hours.
        let turns = ball(|view, _, normal, _| if view % 2 == 0 { light } else { other }.dot(normal));
        assert!(turns.in_groups < 0.4 && turns.in_any_groups > 0.8, "{turns:?}");
        assert!((0..16).all(|view| turns.groups[view] == view % 2), "{turns:?}");
        let third = DVec3::new(-0.3, -0.6, 0.4);
        let three = ball(|view, _, normal, _| [light, other, third][view / 6].dot(normal));
        assert!(three.in_any_groups > 0.8 && (0..16).all(|view| three.groups[view] == view / 6), "{three:?}");
    }

    #[test]
    fn what_shines_under_one_light_is_told_from_what_shines_under_a_turning_one() {
        // Rough gloss: as much as the mirrored direction is near the light.
        let light = DVec3::new(0.5, 0.7, -0.5).normalize();
        let gloss = |mirrored: DVec3, light: DVec3| 0.8 * mirrored.dot(light).max(0.0).powi(3);
        let still = ball(|_, _, _, mirrored| gloss(mirrored, light));
        assert!(still.shine_in_world > 0.8 && still.shine_with_camera < still.shine_in_world - 0.2, "{still:?}");
        let turning = ball(|_, rotation, _, mirrored| gloss(mirrored, rotation.transpose() * light));
        assert!(turning.shine_with_camera > turning.shine_in_world + 0.2, "{turning:?}");
        assert!(turning.shine_with_camera > 0.8 && turning.with_camera < turning.shine_with_camera, "{turning:?}");
    }
}
