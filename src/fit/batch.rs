//! What a step looks at: which views, and which pixels of them.
//!
//! Both are functions of the seed and the step's number alone. Every view comes once before any comes again, and so
//! does every tile of a view.

use super::targets::Target;
use crate::math::random::{SequentialRandom, mix};

/// Side of the square tiles in which pixels of a view are drawn.
const TILE_PIXELS: usize = 16;

/// The views of a step as (place among the `count` views of the fit, visit number): consecutive places of an endless
/// list in which each epoch is a shuffle of all views.
pub fn views_of_step(seed: u64, count: usize, per_step: usize, step: usize) -> Vec<(usize, usize)> {
    let per_step = per_step.min(count);
    let shuffled = |epoch: usize| {
        let mut order: Vec<usize> = (0..count).collect();
        SequentialRandom::new(mix(seed ^ ((epoch as u64) << 20))).shuffle(&mut order);
        order
    };
    let first = step * per_step;
    let mut epoch = first / count;
    let mut order = shuffled(epoch);
    (first..first + per_step)
        .map(|place| {
            if place / count != epoch {
                epoch = place / count;
                order = shuffled(epoch);
            }
            (order[place % count], epoch)
        })
        .collect()
}

/// The pixels of a view in its visit number `visit`, row-major indices: whole tiles, about `quota` pixels in all, each
/// tile once before any is repeated. A quota of 0 takes every pixel.
pub fn pixels_of_visit(seed: u64, target: &Target, visit: usize, quota: usize) -> Vec<u32> {
    let (width, height) = (target.camera.width, target.camera.height);
    if quota == 0 || quota >= width * height {
        return (0..(width * height) as u32).collect();
    }
    let (tiles_x, tiles_y) = (width.div_ceil(TILE_PIXELS), height.div_ceil(TILE_PIXELS));
    let mut tiles: Vec<usize> = (0..tiles_x * tiles_y).collect();
    SequentialRandom::new(mix(seed ^ ((target.view as u64) << 32) ^ 0x7411)).shuffle(&mut tiles);
    let per_visit = quota.div_ceil(TILE_PIXELS * TILE_PIXELS).min(tiles.len());
    let mut pixels = Vec::with_capacity(quota + TILE_PIXELS * TILE_PIXELS);
    for place in 0..per_visit {
        let tile = tiles[(visit * per_visit + place) % tiles.len()];
        let (row, column) = (tile / tiles_x * TILE_PIXELS, tile % tiles_x * TILE_PIXELS);
        for row in row..(row + TILE_PIXELS).min(height) {
            for column in column..(column + TILE_PIXELS).min(width) {
                pixels.push((row * width + column) as u32);
            }
        }
    }
    pixels
}
