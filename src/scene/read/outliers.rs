//! Vertices far from all others: one of them must not set the scale for a whole scene.
//!
//! A scanner's stray point or a vertex at the origin of survey coordinates stretches the bounding box, and with it
//! every length that is taken from the box: the step of `f32`, the offset of rays, the shortest edge, the texels of the
//! atlas. Distances are counted from the median point, in units of the median distance, which single vertices do not
//! move.

use super::source_mesh::SourceMesh;
use super::world;
use crate::error::{Finding, Severity};
use glam::DVec3;

/// Within this many median distances lies what the coordinates are to be precise for.
const NEAR_DISTANCES: f64 = 64.0;
/// A triangle that reaches from among the others to beyond so many is a spike; a floor this wide has no corner there.
const SPIKE_DISTANCES: f64 = 512.0;
/// Beyond so many nothing can belong to a photographed surface: a photo that shows it has all others in one pixel.
const FAR_DISTANCES: f64 = 8192.0;
/// Corners of spikes are outliers only while they are less than this share of all; a scene may have its horizon there.
const LARGEST_SHARE: f64 = 0.01;
/// The same for what nothing photographed can belong to: medians stand as long as most is near.
const LARGEST_FAR_SHARE: f64 = 0.25;
/// Fewer points than this have no outliers.
const FEWEST_POINTS: usize = 16;

/// Median of each coordinate, and the median distance from there. `None` for no points, or where most are one.
fn middle_of(points: &[DVec3]) -> Option<(DVec3, f64)> {
    if points.is_empty() {
        return None;
    }
    let median = |values: &mut Vec<f64>| {
        let half = values.len() / 2;
        *values.select_nth_unstable_by(half, f64::total_cmp).1
    };
    let middle = DVec3::from_array([0, 1, 2].map(|axis| median(&mut points.iter().map(|point| point[axis]).collect())));
    let distance = median(&mut points.iter().map(|point| point.distance(middle)).collect());
    (distance > 0.0).then_some((middle, distance))
}

/// Lower and upper corner of the points, without those far from the others; `None` for no points.
pub fn bounds_of_most(points: Vec<DVec3>) -> Option<(DVec3, DVec3)> {
    let limit = middle_of(&points).filter(|_| points.len() >= FEWEST_POINTS);
    let is_near =
        |point: &&DVec3| limit.is_none_or(|(middle, distance)| point.distance(middle) <= NEAR_DISTANCES * distance);
    let mut near = points.iter().filter(is_near);
    let first = *near.next()?;
    Some(near.fold((first, first), |(low, high), point| (low.min(*point), high.max(*point))))
}

impl SourceMesh {
    /// Lower and upper corner of the vertices in use, without those far from the others: `f32` is to fit what is there,
    /// not what one bad vertex adds.
    pub fn bounds_of_most(&self) -> Option<(DVec3, DVec3)> {
        bounds_of_most(self.triangles.iter().flatten().map(|&corner| self.positions[corner as usize]).collect())
    }
}

/// The point to take as origin where `f32` would lose the shape of the points.
pub fn far_origin_of(points: Vec<DVec3>) -> Option<DVec3> {
    let (low, high) = bounds_of_most(points)?;
    world::far_origin(low, high)
}

/// Leaves out the triangles at vertices that lie far from all others, and names the first.
pub fn leave_out(mesh: &mut SourceMesh) {
    let mut used = vec![false; mesh.positions.len()];
    mesh.triangles.iter().flatten().for_each(|&vertex| used[vertex as usize] = true);
    let points: Vec<DVec3> =
        mesh.positions.iter().zip(&used).filter(|(_, used)| **used).map(|(point, _)| *point).collect();
    let Some((middle, distance)) = middle_of(&points).filter(|_| points.len() >= FEWEST_POINTS) else { return };
    let positions = &mesh.positions;
    let outwards = |vertex: u32| positions[vertex as usize].distance(middle) / distance;
    let span = |triangle: &[u32; 3]| {
        let distances = triangle.map(outwards);
        (distances.iter().copied().fold(f64::INFINITY, f64::min), distances.iter().copied().fold(0.0, f64::max))
    };
    let is_far = |triangle: &[u32; 3]| span(triangle).1 > FAR_DISTANCES;
    let is_far_or_spike = |triangle: &[u32; 3]| {
        let (nearest, farthest) = span(triangle);
        farthest > FAR_DISTANCES || farthest > SPIKE_DISTANCES && nearest < NEAR_DISTANCES
    };
    let corners_of = |is_stray: &dyn Fn(&[u32; 3]) -> bool, limit: f64| {
        let mut corners: Vec<usize> = (mesh.triangles.iter().filter(|triangle| is_stray(triangle)).flatten())
            .filter(|&&vertex| outwards(vertex) > limit)
            .map(|&vertex| vertex as usize)
            .collect();
        corners.sort_unstable();
        corners.dedup();
        corners
    };
    let are_few = |count: usize, share: f64| count as f64 <= (share * points.len() as f64).max(1.0);
    // Spikes go with what is far where both are few; where spikes are many, what is far goes alone.
    let mut is_stray: &dyn Fn(&[u32; 3]) -> bool = &is_far_or_spike;
    let mut far = corners_of(is_stray, SPIKE_DISTANCES);
    let spikes = far.iter().filter(|&&vertex| outwards(vertex as u32) <= FAR_DISTANCES).count();
    if !are_few(spikes, LARGEST_SHARE) {
        is_stray = &is_far;
        far = corners_of(is_stray, FAR_DISTANCES);
    }
    if far.is_empty() || !are_few(far.len(), LARGEST_FAR_SHARE) {
        return;
    }
    let before = mesh.triangles.len();
    let triangles = mesh.triangles.iter().filter(|triangle| !is_stray(triangle)).copied().collect();
    mesh.triangles = triangles;
    let first = mesh.positions[far[0]];
    let message = format!(
        "{} of {} vertices lie far from all others, the first at ({}, {}, {}), {:.0} times as far out as half of them: \
         the {} triangles there are left out",
        far.len(),
        points.len(),
        first.x,
        first.y,
        first.z,
        first.distance(middle) / distance,
        before - mesh.triangles.len()
    );
    mesh.findings.push(
        Finding::new(Severity::Warning, "mesh-outlier", message)
            .remedy("delete these vertices in the mesh; what is so far off cannot be what the photos show"),
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> SourceMesh {
        let mut mesh = SourceMesh::default();
        for row in 0..20u32 {
            for column in 0..20u32 {
                mesh.positions.push(DVec3::new(f64::from(column), 0.0, f64::from(row)));
                if row > 0 && column > 0 {
                    let v = row * 20 + column;
                    mesh.triangles.extend([[v - 21, v - 1, v], [v - 21, v, v - 20]]);
                }
            }
        }
        mesh
    }

    #[test]
    fn one_far_vertex_goes_with_its_triangles_and_a_large_floor_stays() {
        let mut mesh = grid();
        let whole = mesh.triangles.len();
        leave_out(&mut mesh);
        assert!(mesh.findings.is_empty());
        mesh.positions[210] = DVec3::splat(1e6);
        leave_out(&mut mesh);
        assert_eq!(mesh.triangles.len(), whole - 6);
        assert_eq!(mesh.findings[0].code, "mesh-outlier");
        assert!(mesh.findings[0].message.contains("(1000000, 1000000, 1000000)"), "{}", mesh.findings[0]);

        let mut mesh = grid();
        let first = mesh.positions.len() as u32;
        mesh.positions
            .extend([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, z)| 4000.0 * DVec3::new(x, 0.0, z)));
        mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        leave_out(&mut mesh);
        assert!(mesh.findings.is_empty() && mesh.triangles.len() == whole + 2);
    }

    #[test]
    fn many_far_vertices_go_as_one_does_and_a_wide_horizon_stays() {
        let mut mesh = grid();
        let whole = mesh.triangles.len();
        for place in 0..40 {
            let turn = f64::from(place);
            mesh.positions[place as usize * 10] = 1e6 * DVec3::new(turn.sin(), turn.cos(), (2.0 * turn).sin());
        }
        leave_out(&mut mesh);
        assert!(mesh.findings[0].message.contains("40 of 400 vertices lie far"), "{}", mesh.findings[0]);
        let (low, high) = mesh.bounds().unwrap();
        assert!(low.min_element() >= 0.0 && high.max_element() < 20.0 && mesh.triangles.len() < whole);

        // A tenth of the vertices on a horizon that a photo may show.
        let mut mesh = grid();
        for place in 0..40 {
            let turn = f64::from(place);
            mesh.positions[place as usize * 10] = 5000.0 * DVec3::new(turn.sin(), 0.0, turn.cos());
        }
        leave_out(&mut mesh);
        assert!(mesh.findings.is_empty() && mesh.triangles.len() == whole, "{:?}", mesh.findings);
    }

    #[test]
    fn survey_coordinates_are_recentred_although_one_vertex_lies_at_the_origin() {
        let far = DVec3::new(500_000.0, 4_000_000.0, 100.0);
        let mut points: Vec<DVec3> = grid().positions.iter().map(|point| *point + far).collect();
        points.push(DVec3::ZERO);
        let origin = far_origin_of(points).unwrap();
        assert!((origin - far).length() < 30.0, "{origin}");
        assert_eq!(bounds_of_most(Vec::new()), None);
        assert_eq!(bounds_of_most(vec![DVec3::X; 20]), Some((DVec3::X, DVec3::X)));
    }
}
