//! Other surface as lobes see it: what stands where a point does not see the light.
//!
//! The light's texels are put together in small cells. Where a point does not see all hats of a cell, one ray finds the
//! point of the grid that hides them. So to a lobe other surface is light like any other, nearly as fine as the light, and
//! what it sends is the same for all pixels that show the point: with four rays a pixel, whose mean was the colour of all
//! that is hidden, metals that look down on sunlit ground were noise, and came out as paints of their colour.

use super::bounce::point_hit;
use super::light_basis::LightBasis;
use super::points::{VisibilityGrid, are_lists};
use super::visibility::Visibility;
use crate::math::parallel;
use crate::math::sphere::direction_of_texel;
use crate::render::Surface;
use glam::Vec3;
use std::sync::atomic::{AtomicBool, Ordering};

/// A cell of the light that a point does not see wholly, and the point of the grid that hides it.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Hiding {
    /// Row-major cell.
    pub cell: u32,
    /// The point that is there.
    pub point: u32,
}

/// What hides the light from each point of a grid.
#[derive(Clone, Debug, PartialEq)]
pub struct Surroundings {
    cells: Cells,
    /// Where the list of each point begins in `hidings`, and the end of the last.
    offsets: Vec<u32>,
    hidings: Vec<Hiding>,
}

/// Cells of a light: squares of its texels, smaller ones at its right and lower edge.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Cells {
    /// Texels along the side of a cell.
    side: usize,
    /// Width and height of the light in texels.
    width: usize,
    height: usize,
}

impl Cells {
    fn across(&self) -> usize {
        self.width.div_ceil(self.side)
    }

    fn count(&self) -> usize {
        self.across() * self.height.div_ceil(self.side)
    }

    /// The texels of a cell.
    fn hats(&self, cell: usize) -> impl Iterator<Item = usize> + Clone + use<> {
        let Cells { side, width, height } = *self;
        let (row, column) = (cell / self.across() * side, cell % self.across() * side);
        let columns = column..(column + side).min(width);
        (row..(row + side).min(height)).flat_map(move |row| columns.clone().map(move |column| row * width + column))
    }
}

impl Surroundings {
    /// Looks for what hides each cell of `side` x `side` hats. Of no use when `stop` was raised.
    pub fn trace(
        surface: &Surface,
        grid: &VisibilityGrid,
        basis: &LightBasis,
        visibility: &Visibility,
        side: usize,
        stop: &AtomicBool,
    ) -> Self {
        let cells = Cells { side: side.max(1), width: basis.width, height: basis.height };
        let lists: Vec<Vec<Hiding>> = parallel::map(grid.points.len(), |index| {
            if stop.load(Ordering::Relaxed) {
                return Vec::new();
            }
            let mut hats = Vec::new();
            let found = |cell: usize| {
                let point = cells.hidden_by(cell, (surface, grid, index), basis, visibility.of(index), &mut hats)?;
                Some(Hiding { cell: cell as u32, point })
            };
            (0..cells.count()).filter_map(found).collect()
        });
        let (mut offsets, mut hidings) = (vec![0], Vec::with_capacity(lists.iter().map(Vec::len).sum()));
        for list in lists {
            hidings.extend(list);
            offsets.push(hidings.len() as u32);
        }
        Surroundings { cells, offsets, hidings }
    }

    /// The lists of so many points, which begin at `offsets` in one of all, over cells of `side` x `side` hats. `None` where
    /// these are no such lists.
    pub fn of_lists(
        offsets: Vec<u32>,
        hidings: Vec<Hiding>,
        (basis, side): (&LightBasis, usize),
        points: usize,
    ) -> Option<Self> {
        let cells = Cells { side: side.max(1), width: basis.width, height: basis.height };
        let is_whole = are_lists(&offsets, hidings.iter().map(|own| own.point), points)
            && hidings.iter().all(|own| (own.cell as usize) < cells.count());
        is_whole.then_some(Surroundings { cells, offsets, hidings })
    }

    /// What [`Surroundings::of_lists`] takes.
    pub fn lists(&self) -> (&[u32], &[Hiding]) {
        (&self.offsets, &self.hidings)
    }

    /// What hides the light from a point.
    #[inline]
    pub fn of(&self, point: usize) -> &[Hiding] {
        &self.hidings[self.offsets[point] as usize..self.offsets[point + 1] as usize]
    }

    /// The hats of a cell.
    #[inline]
    pub(super) fn hats(&self, cell: u32) -> impl Iterator<Item = usize> + Clone + use<> {
        self.cells.hats(cell as usize)
    }

    /// Bytes it takes.
    pub fn memory_bytes(&self) -> usize {
        self.offsets.len() * size_of::<u32>() + self.hidings.len() * size_of::<Hiding>()
    }
}

impl Cells {
    /// The point of the grid that hides a cell from another of its points; `None` where it sees all of the cell, or meets no
    /// front of any surface there. `hats` is room to work in.
    fn hidden_by(
        &self,
        cell: usize,
        (surface, grid, index): (&Surface, &VisibilityGrid, usize),
        basis: &LightBasis,
        shares: &[u8],
        hats: &mut Vec<usize>,
    ) -> Option<u32> {
        let point = &grid.points[index];
        hats.clear();
        hats.extend(
            self.hats(cell)
                .filter(|&hat| shares[hat] < u8::MAX && basis.direction_of(hat).dot(point.shading_normal) > 0.0),
        );
        if hats.is_empty() {
            return None;
        }
        // Points beside each other look at different hats of a cell.
        let (row, column) = (point.texel as usize / grid.size, point.texel as usize % grid.size);
        let turn = (2 * (row % 2) + column % 2 + cell) * hats.len() / 4 % hats.len();
        hats.rotate_left(turn);
        let met = |direction: Vec3| {
            let is_above = direction.dot(point.shading_normal) > 0.0;
            is_above.then(|| point_hit(surface, grid, point.position, point.geometric_normal, direction)).flatten()
        };
        // In the middle of a hat, or where an edge passes in one of the four parts of its texel.
        let part = |k: usize| {
            let (row, column) = (2 * (hats[0] / self.width) + k / 2, 2 * (hats[0] % self.width) + k % 2);
            direction_of_texel(row, column, 2 * self.width, 2 * self.height)
        };
        hats.iter().find_map(|&hat| met(basis.direction_of(hat))).or_else(|| (0..4).find_map(|k| met(part(k))))
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::light_basis::LightPlanes;
    use super::super::seen_light::SeenLight;
    use super::*;
    use crate::scene::demo;

    /// The demo's surface, and a coarse grid over it with what hides cells of so many hats.
    pub fn traced(side: usize) -> (Surface, VisibilityGrid, LightBasis, Visibility, Surroundings) {
        let settings = demo::DemoSettings {
            views: 1,
            held_out: 0,
            width: 8,
            height: 8,
            map_size: 128,
            seed: 1,
            ..Default::default()
        };
        let surface = Surface::new(demo::build(&settings).unwrap().scene.mesh).unwrap();
        let (grid, basis, go) = (VisibilityGrid::new(&surface, 64), LightBasis::new(32, 16), AtomicBool::new(false));
        let visibility = Visibility::trace(&surface, &grid, &basis, true, &go).unwrap();
        let surroundings = Surroundings::trace(&surface, &grid, &basis, &visibility, side, &go);
        (surface, grid, basis, visibility, surroundings)
    }

    #[test]
    fn what_hides_a_hat_lies_in_its_direction() {
        let (_, grid, basis, visibility, surroundings) = traced(1);
        let (mut hidden, mut found, mut off) = (0usize, 0usize, Vec::new());
        for (index, point) in grid.points.iter().enumerate() {
            for hat in 0..basis.count() {
                let cosine = basis.direction_of(hat).dot(point.shading_normal);
                let is_wholly = visibility.of(index)[hat] == 0 && cosine > 0.3;
                hidden += usize::from(is_wholly && basis.direction_of(hat).dot(point.geometric_normal) > 0.3);
            }
            for &Hiding { cell, point: met } in surroundings.of(index) {
                assert!(visibility.of(index)[cell as usize] < u8::MAX, "{index} sees all of {cell}");
                let cosine = basis.direction_of(cell as usize).dot(point.shading_normal);
                found += usize::from(visibility.of(index)[cell as usize] == 0 && cosine > 0.3);
                let towards = grid.points[met as usize].position - point.position;
                // Beside each other points of a coarse grid lie anywhere.
                if towards.length() > 1.0 {
                    off.push(towards.normalize_or(Vec3::Y).dot(basis.direction_of(cell as usize)));
                }
            }
        }
        let near = off.iter().filter(|&&cosine| cosine > 0.97).count() as f64 / off.len() as f64;
        println!("{hidden} hats are hidden, what hides {found} was found; {near:.4} of {} lie there", off.len());
        assert!(off.len() > 5000 && near > 0.99, "{near} of {}", off.len());
        assert!(found as f64 > 0.97 * hidden as f64, "{found} of {hidden}");
    }

    #[test]
    fn larger_cells_take_fewer_rays_and_see_about_the_same() {
        let (_, grid, basis, visibility, fine) = traced(1);
        let (.., coarse) = traced(2);
        // Each point sends how high it lies.
        let leaving: Vec<[f32; 3]> = grid.points.iter().map(|point| [1.0 + point.position.y; 3]).collect();
        let mut sums = [0.0f64; 2];
        let mut difference = 0.0f64;
        let dark: LightPlanes = basis.planes(&vec![[0.0; 3]; basis.count()]);
        for point in 0..grid.points.len() {
            let seen = [&fine, &coarse].map(|surroundings| {
                let mut seen = SeenLight::default();
                seen.turn_to(point as u32, &dark, visibility.of(point), (Some(surroundings), &leaving));
                // As white paint sees it: beside the horizon hats are hidden by nothing.
                let normal = grid.points[point].shading_normal;
                let arriving = |hat: usize| {
                    let cosine = basis.direction_of(hat).dot(normal).max(0.0);
                    f64::from(seen.channels[0][hat] * basis.solid_angle[hat] * cosine)
                };
                (0..basis.count()).map(arriving).sum::<f64>()
            });
            (0..2).for_each(|k| sums[k] += seen[k]);
            difference += (seen[0] - seen[1]).abs();
        }
        println!("{:?} and a mean difference of {:.4}", sums, difference / sums[0]);
        assert!(coarse.hidings.len() * 3 < fine.hidings.len());
        assert!((sums[1] / sums[0] - 1.0).abs() < 0.03 && difference < 0.08 * sums[0], "{sums:?} {difference}");
    }

    #[test]
    fn cells_cover_a_light_of_any_size_once() {
        for (width, height, side) in [(64, 32, 2), (7, 5, 3), (1, 1, 4), (16, 8, 1)] {
            let cells = Cells { side, width, height };
            let mut all: Vec<usize> = (0..cells.count()).flat_map(|cell| cells.hats(cell)).collect();
            all.sort_unstable();
            assert_eq!(all, (0..width * height).collect::<Vec<_>>());
        }
    }
}
