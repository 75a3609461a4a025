//! Light between surfaces: which points a point sees, as a sparse matrix, and its exact transpose.
//!
//! From each point a fixed number of rays leaves with a cosine's density, one a stratum. `K B` at a point is the mean,
//! over its rays, of the radiance `B` of the points they hit; rays that escape or meet a back face bring nothing. Rows
//! sum to at most 1 by construction, so the series of bounces converges for reflectances below 1.

use super::points::{VisibilityGrid, are_lists};
use crate::math::frame::sample_cosine_hemisphere;
use crate::math::parallel;
use crate::math::random::{SampleStream, StreamKey};
use crate::render::Surface;
use std::sync::atomic::{AtomicBool, Ordering};

/// The sparse matrix: entries are all one over the number of rays.
#[derive(Clone, Debug, PartialEq)]
pub struct BounceMatrix {
    /// Where each row begins in `targets`, and the end of the last.
    offsets: Vec<u32>,
    /// The points that are seen.
    targets: Vec<u32>,
    /// Where each column begins in `sources`.
    transposed_offsets: Vec<u32>,
    /// The points that see.
    sources: Vec<u32>,
    /// One over the number of rays.
    share: f32,
}

/// Rays leave one a stratum, in a square of so many on a side for at least so many rays.
pub(super) fn strata_along_a_side(rays: usize) -> usize {
    (rays.max(1) as f32).sqrt().ceil() as usize
}

impl BounceMatrix {
    /// Traces `rays` rays from each point; the next square number is taken. Of no use when `stop` was raised.
    pub fn trace(surface: &Surface, grid: &VisibilityGrid, rays: usize, seed: u64, stop: &AtomicBool) -> Self {
        let side = strata_along_a_side(rays);
        let rows = parallel::map(grid.points.len(), |index| {
            if stop.load(Ordering::Relaxed) {
                return Vec::new();
            }
            let point = &grid.points[index];
            let frame = point.frame();
            let mut stream = SampleStream::new(StreamKey::new(seed, u32::MAX - 1, 0, index as u32), 0);
            let mut targets = Vec::new();
            for stratum in 0..side * side {
                let [u, v] = stream.next_pair();
                let place = [(stratum / side) as f32 + u, (stratum % side) as f32 + v].map(|value| value / side as f32);
                let direction = frame.outer_from_local(sample_cosine_hemisphere(place));
                targets.extend(point_hit(surface, grid, point.position, point.geometric_normal, direction));
            }
            targets.sort_unstable();
            targets
        });
        let (mut offsets, mut targets) = (vec![0u32], Vec::with_capacity(rows.iter().map(Vec::len).sum()));
        for row in rows {
            targets.extend(row);
            offsets.push(targets.len() as u32);
        }
        BounceMatrix::new(offsets, targets, side * side)
    }

    /// The matrix whose rows begin at `offsets` in a list of the points that are seen, by so many rays from each of so many
    /// points. `None` where these are no rows.
    pub fn of_rows(offsets: Vec<u32>, targets: Vec<u32>, rays: usize, points: usize) -> Option<Self> {
        let is_whole = are_lists(&offsets, targets.iter().copied(), points) && rays > 0;
        is_whole.then(|| BounceMatrix::new(offsets, targets, rays))
    }

    /// What [`BounceMatrix::of_rows`] takes.
    pub fn rows(&self) -> (&[u32], &[u32]) {
        (&self.offsets, &self.targets)
    }

    fn new(offsets: Vec<u32>, targets: Vec<u32>, rays: usize) -> Self {
        let points = offsets.len() - 1;
        let mut transposed_offsets = vec![0u32; points + 1];
        for &target in &targets {
            transposed_offsets[target as usize + 1] += 1;
        }
        for point in 0..points {
            transposed_offsets[point + 1] += transposed_offsets[point];
        }
        let mut next = transposed_offsets.clone();
        let mut sources = vec![0u32; targets.len()];
        for source in 0..points {
            for &target in &targets[offsets[source] as usize..offsets[source + 1] as usize] {
                let place = &mut next[target as usize];
                sources[*place as usize] = source as u32;
                *place += 1;
            }
        }
        BounceMatrix { offsets, targets, transposed_offsets, sources, share: 1.0 / rays as f32 }
    }

    /// `K B`: the light of other surfaces that a white Lambert surface would send back.
    pub fn apply(&self, leaving: &[[f32; 3]]) -> Vec<[f32; 3]> {
        gather(&self.offsets, &self.targets, self.share, leaving)
    }

    /// `K' d`, the transpose.
    pub fn apply_transposed(&self, d_arriving: &[[f32; 3]]) -> Vec<[f32; 3]> {
        gather(&self.transposed_offsets, &self.sources, self.share, d_arriving)
    }

    /// Share of a point's rays that meet surface, in [0, 1].
    #[cfg(test)]
    fn row_sum(&self, point: usize) -> f32 {
        (self.offsets[point + 1] - self.offsets[point]) as f32 * self.share
    }
}

/// The point of the grid that a ray from the surface meets, on a front face.
pub(super) fn point_hit(
    surface: &Surface,
    grid: &VisibilityGrid,
    position: glam::Vec3,
    geometric_normal: glam::Vec3,
    direction: glam::Vec3,
) -> Option<u32> {
    if direction.dot(geometric_normal) <= 0.0 {
        return None;
    }
    let origin = surface.bvh().offset_origin(position, geometric_normal, direction);
    let hit = surface.closest(&crate::trace::Ray { origin, direction, t_max: f32::INFINITY })?;
    let point = surface.point(&hit);
    if point.geometric_normal.dot(direction) >= 0.0 || point.shading_normal.dot(direction) >= 0.0 {
        return None;
    }
    grid.tap(&point).map(|tap| tap.heaviest())
}

fn gather(offsets: &[u32], indices: &[u32], share: f32, values: &[[f32; 3]]) -> Vec<[f32; 3]> {
    let mut sums = vec![[0.0f32; 3]; offsets.len() - 1];
    parallel::each_chunk(&mut sums, 1024, &|chunk, sums| {
        for (sum, row) in sums.iter_mut().zip(1024 * chunk..) {
            for &index in &indices[offsets[row] as usize..offsets[row + 1] as usize] {
                for channel in 0..3 {
                    sum[channel] += values[index as usize][channel];
                }
            }
            *sum = sum.map(|value| value * share);
        }
    });
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::SequentialRandom;

    #[test]
    fn the_transpose_is_one() {
        let mut random = SequentialRandom::new(4);
        let (mut offsets, mut targets) = (vec![0], Vec::new());
        for _ in 0..50 {
            targets.extend((0..random.below(9)).map(|_| random.below(50) as u32));
            offsets.push(targets.len() as u32);
        }
        let matrix = BounceMatrix::of_rows(offsets.clone(), targets.clone(), 8, 50).unwrap();
        assert_eq!(matrix.rows(), (offsets.as_slice(), targets.as_slice()));
        let is_matrix = |offsets: &[u32], targets: &[u32]| {
            BounceMatrix::of_rows(offsets.to_vec(), targets.to_vec(), 8, 50).is_some()
        };
        assert!(is_matrix(&offsets, &targets) && is_matrix(&[0; 51], &[]));
        assert!(!is_matrix(&offsets[1..], &targets) && !is_matrix(&offsets, &targets[1..]) && !is_matrix(&[], &[]));
        assert!(!is_matrix(&offsets, &vec![50; targets.len()]), "no such point");
        let mut values = || (0..50).map(|_| [(); 3].map(|()| random.next_number())).collect::<Vec<[f32; 3]>>();
        let (x, y) = (values(), values());
        let dot = |a: &[[f32; 3]], b: &[[f32; 3]]| -> f64 {
            a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| f64::from(a * b)).sum()
        };
        let (forward, backward) = (dot(&matrix.apply(&x), &y), dot(&x, &matrix.apply_transposed(&y)));
        assert!((forward / backward - 1.0).abs() < 1e-6, "{forward} {backward}");
        assert!((0..50).all(|row| (0.0..=1.0).contains(&matrix.row_sum(row))));
    }
}
