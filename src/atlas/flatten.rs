//! From sets of triangles to flat charts: map, check, split what fails, merge what fits.
//!
//! A chart is good when it has the shape of a disk (holes such as windows in a wall are fine), no triangle is flipped,
//! its outline does not cross itself, and angles and areas are kept within the limits. A chart that is not good is
//! halved, down to single triangles, which are always good.

use super::chart::{ChartMesh, Surface};
use super::lscm;
use super::outline;
use super::quality::chart_distortion;
use super::shape::least_box;
use crate::math::parallel;
use glam::{DVec2, DVec3};

/// A chart laid flat.
#[derive(Clone, Debug)]
pub(crate) struct FlatChart {
    pub chart: ChartMesh,
    /// Point of each chart vertex; the area of the chart equals its area in space.
    pub points: Vec<DVec2>,
}

/// What a chart may cost.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limits {
    /// Mean of the ratio of singular values, weighted by area; 1 is conformal.
    pub angle: f64,
    /// Mean of the larger of relative area and its inverse, weighted by area; 1 keeps areas.
    pub area: f64,
}

/// Lays a set of triangles flat, in as many charts as it takes.
pub(crate) fn flatten(surface: &Surface, triangles: Vec<u32>, limits: Limits) -> Vec<FlatChart> {
    let chart = ChartMesh::new(surface, triangles);
    match try_flatten(surface, &chart, limits) {
        Some(flat) => vec![flat],
        None => {
            let [first, second] = chart.halves(surface);
            let (mut first, second) =
                rayon::join(|| flatten(surface, first, limits), || flatten(surface, second, limits));
            first.extend(second);
            first
        }
    }
}

/// Lays a chart flat; `None` when it has to be split.
pub(crate) fn try_flatten(surface: &Surface, chart: &ChartMesh, limits: Limits) -> Option<FlatChart> {
    if chart.genus > 0 || chart.loops.is_empty() {
        return None;
    }
    if let [triangle] = chart.triangles[..] {
        let points = lscm::lay_flat(surface.corners(triangle)).unwrap_or_default().to_vec();
        return Some(FlatChart { chart: chart.clone(), points });
    }
    let mean: DVec3 =
        chart.triangles.iter().map(|&t| surface.normals[t as usize] * surface.areas[t as usize]).sum::<DVec3>();
    let normal = mean.normalize_or_zero();
    let lowest = chart.triangles.iter().map(|&t| surface.normals[t as usize].dot(normal)).fold(1.0, f64::min);
    // A flat chart is its own conformal map: projecting it spares the solve.
    if lowest < 1.0 - 1e-12
        && let Some(flat) = lscm::conformal_map(chart).and_then(|points| checked(surface, chart, points, limits))
    {
        return Some(flat);
    }
    // Seen from its mean normal nothing is flipped as long as every triangle faces that way.
    if lowest > 0.1
        && let Some(flat) = checked(surface, chart, lscm::project(chart, normal), limits)
    {
        return Some(flat);
    }
    None
}

/// The chart with these points, scaled to its area in space, when it is good.
fn checked(surface: &Surface, chart: &ChartMesh, mut points: Vec<DVec2>, limits: Limits) -> Option<FlatChart> {
    let double_areas = chart.corners.iter().map(|corners| {
        let [a, b, c] = corners.map(|vertex| points[vertex as usize]);
        (b - a).perp_dot(c - a)
    });
    let mut sum = 0.0;
    for double_area in double_areas {
        if double_area.is_nan() || double_area <= 0.0 {
            return None;
        }
        sum += double_area;
    }
    let area: f64 = chart.triangles.iter().map(|&triangle| surface.areas[triangle as usize]).sum();
    let scale = (2.0 * area / sum).sqrt();
    points.iter_mut().for_each(|point| *point *= scale);
    let distortion = chart_distortion(surface, chart, &points);
    let good = distortion.angle_mean <= limits.angle && distortion.area_mean <= limits.area;
    (good && !outline::wraps(chart, &points) && !outline::crosses_itself(&chart.loops, &points))
        .then(|| FlatChart { chart: chart.clone(), points })
}

/// Halves charts whose box is longer than `longest` until their pieces are shorter than `goal`, as long as the pieces
/// are much shorter: one long strip would dictate the scale of the whole map. Triangles are never cut, so a chart of few
/// long ones stays.
pub(crate) fn split_long(
    surface: &Surface,
    charts: Vec<FlatChart>,
    longest: f64,
    goal: f64,
    limits: Limits,
) -> Vec<FlatChart> {
    let split = |flat: FlatChart| -> Vec<FlatChart> {
        let length = least_box(&flat.points).size.x;
        if length <= longest || flat.chart.triangles.len() < 2 {
            return vec![flat];
        }
        let pieces: Vec<FlatChart> =
            flat.chart.halves(surface).into_iter().flat_map(|half| flatten(surface, half, limits)).collect();
        if pieces.iter().any(|piece| least_box(&piece.points).size.x > 0.8 * length) {
            return vec![flat];
        }
        split_long(surface, pieces, goal, goal, limits)
    };
    charts.into_iter().flat_map(split).collect()
}

/// Lays every cluster flat; `label` names the cluster of each triangle.
pub(crate) fn flatten_all(
    surface: &Surface,
    label: &[u32],
    limits: Limits,
    progress: &(dyn Fn(f32) + Sync),
) -> Vec<FlatChart> {
    let count = label.iter().max().map_or(0, |&last| last as usize + 1);
    let mut sets = vec![Vec::new(); count];
    for (triangle, &cluster) in label.iter().enumerate() {
        sets[cluster as usize].push(triangle as u32);
    }
    let done = std::sync::atomic::AtomicUsize::new(0);
    let charts = parallel::map_items(&sets, |triangles| {
        let size = triangles.len();
        let flat = flatten(surface, triangles.clone(), limits);
        let before = done.fetch_add(size, std::sync::atomic::Ordering::Relaxed);
        progress((before + size) as f32 / label.len() as f32);
        flat
    });
    charts.into_iter().flatten().collect()
}
