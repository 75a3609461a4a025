//! The surface as blocks of neighbouring texels.

use super::observations::Observations;
use crate::math::random::mix;
use crate::render::cached::VisibilityGrid;
use crate::render::cached::points::NO_POINT;
use glam::Vec3;

/// A block: its texels with observations, and the cell each belongs to.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Block {
    /// (texel, cell).
    pub texels: Vec<(u32, u16)>,
    /// Number of cells.
    pub cell_count: usize,
    /// Number of observations.
    pub observations: usize,
    /// Mean position of its texels in the world.
    pub centre: Vec3,
}

impl Block {
    /// The cell that a texel is in; the first where it is in none.
    pub fn cell_of(&self, texel: u32) -> u16 {
        self.texels.iter().find(|(own, _)| *own == texel).map_or(0, |(_, cell)| *cell)
    }
}

/// Cuts square maps into blocks of `side` texels with cells of `cell` texels.
///
/// Charts meet in the gutters of an atlas: texels of one block that lie far apart in the world become blocks of their own.
pub fn blocks(
    observations: &Observations,
    grid: &VisibilityGrid,
    map_size: usize,
    side: usize,
    cell: usize,
) -> Vec<Block> {
    let texel_in_world = texel_in_world(grid) * grid.size as f32 / map_size as f32;
    let position = |texel: usize| -> Option<Vec3> {
        let (row, column) = (texel / map_size * grid.size / map_size, texel % map_size * grid.size / map_size);
        let point = grid.point_of_texel[row * grid.size + column];
        (point != NO_POINT).then(|| grid.points[point as usize].position)
    };
    let across = map_size / side;
    let mut made = Vec::new();
    for block in 0..across * across {
        let (first_row, first_column) = (block / across * side, block % across * side);
        let mut pieces: Vec<(Vec3, Block, Vec<u32>)> = Vec::new();
        for offset in 0..side * side {
            let (row, column) = (offset / side, offset % side);
            let texel = (first_row + row) * map_size + first_column + column;
            let count = observations.range(texel).len();
            if count == 0 {
                continue;
            }
            let Some(place) = position(texel) else { continue };
            let near = |piece: &(Vec3, Block, Vec<u32>)| {
                (piece.0 - place).length() < 2.5 * side.max(2) as f32 * texel_in_world
            };
            let index = match pieces.iter().position(near) {
                Some(index) => index,
                None => {
                    pieces.push((place, Block::default(), Vec::new()));
                    pieces.len() - 1
                }
            };
            let (_, block, cells) = &mut pieces[index];
            block.centre += (place - block.centre) / (block.texels.len() + 1) as f32;
            let cell_key = (row / cell * side + column / cell) as u32;
            let cell_index = cells.iter().position(|&known| known == cell_key).unwrap_or_else(|| {
                cells.push(cell_key);
                cells.len() - 1
            });
            block.texels.push((texel as u32, cell_index as u16));
            block.cell_count = cells.len();
            block.observations += count;
        }
        made.extend(pieces.into_iter().map(|(_, block, _)| block));
    }
    made
}

/// Median distance in the world between neighbours of the grid.
fn texel_in_world(grid: &VisibilityGrid) -> f32 {
    let mut distances: Vec<f32> = grid
        .points
        .iter()
        .filter_map(|point| {
            let texel = point.texel as usize;
            let right = if (texel + 1).is_multiple_of(grid.size) { NO_POINT } else { grid.point_of_texel[texel + 1] };
            (right != NO_POINT).then(|| (grid.points[right as usize].position - point.position).length())
        })
        .collect();
    let middle = distances.len() / 2;
    if distances.is_empty() {
        return 1.0;
    }
    *distances.select_nth_unstable_by(middle, f32::total_cmp).1
}

/// Some of the blocks, other ones each round: those with few observations are left to the end.
pub fn choose(blocks: &[Block], count: usize, least_observations: usize, seed: u64, round: usize) -> Vec<usize> {
    let mut keyed: Vec<(u64, usize)> = blocks
        .iter()
        .enumerate()
        .filter(|(_, block)| block.observations >= least_observations)
        .map(|(index, _)| (mix(seed ^ mix(round as u64 ^ mix(index as u64))), index))
        .collect();
    keyed.sort_unstable();
    let mut chosen: Vec<usize> = keyed.into_iter().take(count).map(|(_, index)| index).collect();
    chosen.sort_unstable();
    chosen
}
