//! How much of each hat of the light a point sees: one byte, traced once.
//!
//! The light's texels are split into 2 x 2 cells, each seen or not by one ray through its centre; the visible share of a
//! hat is the weighted mean over its 4 x 4 cells. So most bytes are 0 or 255, and shadow edges have shares in between:
//! with two bits a texel, a hard edge across the sun showed as bands, with eight it does not.
//!
//! Two things save rays. Within a point, three of four cells are traced only where neighbouring texels disagree. Between
//! points, a texel that all coarser neighbours on the grid see wholly, or not at all, is taken over.

mod alike;

use self::alike::AlikeAround;
use super::light_basis::LightBasis;
use super::points::{NO_POINT, VisibilityGrid};
use crate::math::parallel;
use crate::math::sphere::direction_of_texel;
use crate::render::Surface;
use crate::trace::Ray;
use glam::Vec3;
use std::sync::atomic::{AtomicBool, Ordering};

/// Weights of a hat over four cells along an axis, when none is clamped.
const HAT: [f32; 4] = [0.125, 0.375, 0.375, 0.125];
/// Distance on the grid of the points that are traced first.
const COARSEST_STRIDE: usize = 4;
/// Cells of points this much alike are taken over: cosine between normals.
const ALIKE: f32 = 0.95;

/// Visible shares of all hats at all points.
#[derive(Clone, Debug)]
pub struct Visibility {
    /// Bytes a point has: the light's texels, padded.
    pub stride: usize,
    /// 255 is wholly visible; row after row of points.
    pub shares: Vec<u8>,
    /// Rays that were traced.
    pub rays: u64,
}

impl Visibility {
    /// Traces the visibility of all points of a grid; `None` when `stop` was raised. Without `fine_edges` no texel is
    /// looked at in more than one cell: half of the rays, and edges of shadows as wide as texels.
    pub fn trace(
        surface: &Surface,
        grid: &VisibilityGrid,
        basis: &LightBasis,
        fine_edges: bool,
        stop: &AtomicBool,
    ) -> Option<Self> {
        let stride = basis.padded();
        let mut shares = vec![0u8; grid.points.len() * stride];
        let cells = Cells::new(basis, fine_edges);
        let mut rays = 0;
        let mut step = COARSEST_STRIDE;
        let mut done = vec![false; grid.points.len()];
        while step >= 1 {
            let chosen: Vec<usize> = (0..grid.points.len())
                .filter(|&index| {
                    let (row, column) =
                        (grid.points[index].texel as usize / grid.size, grid.points[index].texel as usize % grid.size);
                    !done[index] && row % step == 0 && column % step == 0
                })
                .collect();
            // Few at a time: their bytes are held twice until they are written.
            for group in chosen.chunks(8192) {
                if stop.load(Ordering::Relaxed) {
                    return None;
                }
                let rows = parallel::map_with(group.len(), Scratch::default, |scratch, place| {
                    let index = group[place];
                    // Dropped as a whole above.
                    if stop.load(Ordering::Relaxed) {
                        return (vec![0; stride], 0);
                    }
                    let parents = parents(grid, index, step, &done);
                    let rows: Vec<&[u8]> =
                        parents.iter().map(|&parent| &shares[parent * stride..(parent + 1) * stride]).collect();
                    cells.shares(surface, grid, index, &rows, scratch)
                });
                for (&index, (row, traced)) in group.iter().zip(rows) {
                    shares[index * stride..(index + 1) * stride].copy_from_slice(&row);
                    rays += traced;
                }
            }
            for index in chosen {
                done[index] = true;
            }
            step /= 2;
        }
        (!stop.load(Ordering::Relaxed)).then_some(Visibility { stride, shares, rays })
    }

    /// The shares of a point.
    #[inline]
    pub fn of(&self, point: usize) -> &[u8] {
        &self.shares[point * self.stride..(point + 1) * self.stride]
    }
}

/// Points of the coarser grid around a point; none unless enough of them lie on the same smooth piece of surface.
fn parents(grid: &VisibilityGrid, index: usize, step: usize, done: &[bool]) -> Vec<usize> {
    if step == COARSEST_STRIDE {
        return Vec::new();
    }
    let own = &grid.points[index];
    let (row, column) = (own.texel as usize / grid.size, own.texel as usize % grid.size);
    let coarse = 2 * step;
    let corner = |value: usize| [value / coarse * coarse, value.div_ceil(coarse) * coarse];
    let mut found: Vec<usize> = Vec::with_capacity(4);
    for near_row in corner(row) {
        for near_column in corner(column) {
            if near_row >= grid.size || near_column >= grid.size {
                return Vec::new();
            }
            let point = grid.point_of_texel[near_row * grid.size + near_column];
            if point == NO_POINT || !done[point as usize] {
                return Vec::new();
            }
            if found.contains(&(point as usize)) {
                continue;
            }
            found.push(point as usize);
        }
    }
    let alike = found.iter().all(|&parent| {
        let parent = &grid.points[parent];
        let offset = parent.position - own.position;
        // On another chart a neighbour on the grid lies anywhere; on the same one it lies in the tangent plane.
        parent.shading_normal.dot(own.shading_normal) > ALIKE
            && offset.dot(own.geometric_normal).abs() < 0.35 * offset.length() + 1e-6
    });
    let spread = |points: &[usize]| {
        points.iter().map(|&parent| (grid.points[parent].position - own.position).length()).fold(0.0f32, f32::max)
    };
    let nearest =
        found.iter().map(|&p| (grid.points[p].position - own.position).length()).fold(f32::INFINITY, f32::min);
    if alike && found.len() >= 2 && spread(&found) < 4.0 * nearest { found } else { Vec::new() }
}

/// Directions of the cells and the weights of hats over them.
struct Cells {
    width: usize,
    height: usize,
    /// Directions of the cells, twice as many along each axis as texels.
    directions: Vec<Vec3>,
    /// Row by row of the light.
    hats: Vec<HatWeights>,
    padded: usize,
    /// Whether the other three cells of a texel are traced where its neighbourhood is not of one mind.
    fine_edges: bool,
}

/// Weights of a hat over its 4 x 4 cells.
struct HatWeights {
    /// Row after row; 0 beyond a pole.
    of_cells: [f32; 16],
    total: f32,
}

#[derive(Default)]
struct Scratch {
    /// Per cell: 0 hidden, 1 seen, 2 not known yet.
    cells: Vec<u8>,
    /// Per texel: 0 hidden, 1 seen, 2 mixed, 3 not known yet.
    texels: Vec<u8>,
    /// Per texel, whether what was looked at first is seen.
    first: Vec<u8>,
    alike: AlikeAround,
}

impl Cells {
    fn new(basis: &LightBasis, fine_edges: bool) -> Self {
        let (width, height) = (basis.width, basis.height);
        let directions = (0..4 * width * height)
            .map(|cell| direction_of_texel(cell / (2 * width), cell % (2 * width), 2 * width, 2 * height))
            .collect();
        let hats = (0..height).map(|row| HatWeights::of_row(row, height)).collect();
        Cells { width, height, directions, hats, padded: basis.padded(), fine_edges }
    }

    /// Visible shares of all hats at a point, and the number of rays that took.
    fn shares(
        &self,
        surface: &Surface,
        grid: &VisibilityGrid,
        index: usize,
        parents: &[&[u8]],
        scratch: &mut Scratch,
    ) -> (Vec<u8>, u64) {
        let (width, height) = (self.width, self.height);
        let Scratch { cells, texels, first, alike } = scratch;
        let point = &grid.points[index];
        let origin = surface.bvh().offset_origin(point.position, point.geometric_normal, point.geometric_normal);
        let mut rays = 0u64;
        let mut trace = |cell: usize| {
            let direction = self.directions[cell];
            // Both horizons count, as they do along a path.
            if direction.dot(point.geometric_normal) <= 0.0 || direction.dot(point.shading_normal) <= 0.0 {
                return 0;
            }
            rays += 1;
            u8::from(!surface.bvh().is_occluded(&Ray { origin, direction, t_max: f32::INFINITY }))
        };
        let cell_of = |row: usize, column: usize, k: usize| (2 * row + k / 2) * 2 * width + 2 * column + k % 2;
        cells.clear();
        cells.resize(4 * width * height, 2);
        take_over(parents, width * height, texels);
        // One cell a texel, in a checkerboard, so that neighbours look at different places.
        first.clear();
        first.extend_from_slice(texels);
        for row in 0..height {
            for (column, first) in first[row * width..(row + 1) * width].iter_mut().enumerate() {
                if *first == 3 {
                    let cell = cell_of(row, column, if (row + column) % 2 == 0 { 0 } else { 3 });
                    *first = trace(cell);
                    cells[cell] = *first;
                }
            }
        }
        // The other three where the neighbourhood is not of one mind.
        alike.look_at(first, width);
        for row in 0..height {
            for column in 0..width {
                let texel = row * width + column;
                let own = first[texel];
                if alike.of[texel] || texels[texel] != 3 || !self.fine_edges {
                    (0..4).for_each(|k| cells[cell_of(row, column, k)] = own);
                    texels[texel] = own;
                    continue;
                }
                let mut sum = 0;
                for k in 0..4 {
                    let cell = cell_of(row, column, k);
                    if cells[cell] == 2 {
                        cells[cell] = trace(cell);
                    }
                    sum += cells[cell];
                }
                texels[texel] = match sum {
                    0 => 0,
                    4 => 1,
                    _ => 2,
                };
            }
        }
        alike.look_at(texels, width);
        let mut made = vec![0u8; self.padded];
        for row in 0..height {
            for column in 0..width {
                let texel = row * width + column;
                let is_uniform = alike.of[texel] && texels[texel] != 2;
                made[texel] = if is_uniform { texels[texel] * 255 } else { self.hat_share(cells, row, column) };
            }
        }
        (made, rays)
    }

    /// Visible share of a hat that an edge crosses.
    fn hat_share(&self, cells: &[u8], row: usize, column: usize) -> u8 {
        let (width, height) = (2 * self.width, 2 * self.height);
        let HatWeights { of_cells, total } = &self.hats[row];
        let columns = [0, 1, 2, 3].map(|k| (2 * column + width + k - 1) % width);
        let mut seen = 0.0f32;
        for (i, weights) in of_cells.chunks_exact(4).enumerate() {
            // What lies beyond a pole has no weight.
            let first = (2 * row + i).saturating_sub(1).min(height - 1) * width;
            for (column, weight) in columns.iter().zip(weights) {
                seen += weight * f32::from(cells[first + column]);
            }
        }
        (255.0 * seen / total + 0.5) as u8
    }
}

/// What all of the coarser neighbours see wholly, or not at all: 1 and 0, and 3 for what is not known.
fn take_over(parents: &[&[u8]], count: usize, texels: &mut Vec<u8>) {
    texels.clear();
    let Some((first, others)) = parents.split_first() else { return texels.resize(count, 3) };
    texels.extend(first[..count].iter().map(|share| match share {
        0 => 0,
        255 => 1,
        _ => 3,
    }));
    for other in others {
        for ((texel, first), other) in texels.iter_mut().zip(*first).zip(*other) {
            *texel = if first == other { *texel } else { 3 };
        }
    }
}

impl HatWeights {
    fn of_row(row: usize, height: usize) -> Self {
        let (mut of_cells, mut total) = ([0.0; 16], 0.0f32);
        let height = 2 * height;
        for (i, weight_row) in HAT.iter().enumerate() {
            let cell_row = 2 * row as i64 - 1 + i as i64;
            // Beyond a pole there is nothing; within half a texel of it a hat stays at its full height.
            if cell_row < 0 || cell_row >= height as i64 {
                continue;
            }
            let at_pole = cell_row == 0 || cell_row == height as i64 - 1;
            let sine = (std::f32::consts::PI * (cell_row as f32 + 0.5) / height as f32).sin();
            let weight_row = if at_pole { 0.5 } else { *weight_row } * sine;
            for (k, weight_column) in HAT.iter().enumerate() {
                of_cells[4 * i + k] = weight_row * weight_column;
                total += weight_row * weight_column;
            }
        }
        HatWeights { of_cells, total }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hats_weigh_their_cells_alike_in_all_rows_and_across_the_seam() {
        let (width, height) = (8, 4);
        let all = Cells::new(&LightBasis::new(width, height), true);
        let (seen, mut edge) = (vec![1; 4 * width * height], vec![0; 4 * width * height]);
        edge.iter_mut().skip(2 * width - 1).step_by(2 * width).for_each(|cell| *cell = 1);
        for row in 0..height {
            for column in 0..width {
                assert_eq!(all.hat_share(&seen, row, column), 255, "{row} {column}");
                // Of the last column of cells an eighth is of the first hats, three of the last.
                let expected = [(0, 32), (width - 1, 96)].iter().find(|of| of.0 == column).map_or(0, |of| of.1);
                assert_eq!(all.hat_share(&edge, row, column), expected, "{row} {column}");
            }
        }
    }

    #[test]
    fn what_all_neighbours_see_alike_is_taken_over() {
        let mut texels = vec![7];
        take_over(&[&[0, 255, 255, 9, 0], &[0, 255, 0, 9, 1]], 4, &mut texels);
        assert_eq!(texels, [0, 1, 3, 3]);
        take_over(&[], 2, &mut texels);
        assert_eq!(texels, [3, 3]);
    }
}
