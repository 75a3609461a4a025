//! What a step looks at: which views, and which pixels of them.
//!
//! Both are functions of the seed and the step's number alone. Every view comes once before any comes again, and so
//! does every tile of a view.

use super::targets::Target;
use crate::math::random::{SequentialRandom, mix};

/// Side of the square tiles in which pixels of a view are drawn.
const TILE_PIXELS: usize = 16;

/// The views of a step as (place among the `count` views of the fit, visit number): consecutive places of an endless
/// list in which each epoch is a shuffle of all views. No step has a view twice: it would count as two that agree.
pub fn views_of_step(seed: u64, count: usize, per_step: usize, step: usize) -> Vec<(usize, usize)> {
    let per_step = per_step.min(count);
    let first = step * per_step;
    let mut epoch = 0;
    let mut order = shuffled(seed, count, epoch);
    let mut own = Vec::with_capacity(per_step);
    for place in first..first + per_step {
        while epoch < place / count {
            epoch += 1;
            order = following(&order, shuffled(seed, count, epoch), per_step, epoch);
        }
        own.push((order[place % count], epoch));
    }
    own
}

fn shuffled(seed: u64, count: usize, epoch: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..count).collect();
    SequentialRandom::new(mix(seed ^ ((epoch as u64) << 20))).shuffle(&mut order);
    order
}

/// The order of an epoch after another: views that the step across the border has already come later.
fn following(before: &[usize], mut order: Vec<usize>, per_step: usize, epoch: usize) -> Vec<usize> {
    let count = order.len();
    let of_border = epoch * count % per_step;
    if of_border == 0 {
        return order;
    }
    let (taken, rest) = (&before[count - of_border..], per_step - of_border);
    for place in 0..rest {
        if taken.contains(&order[place])
            && let Some(later) = (rest..count).find(|&later| !taken.contains(&order[later]))
        {
            order.swap(place, later);
        }
    }
    order
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_view_comes_once_an_epoch_and_no_step_has_one_twice() {
        for (count, per_step) in [(4, 3), (5, 3), (7, 5), (5, 5), (3, 8), (1, 2)] {
            let steps: Vec<_> = (0..60).map(|step| views_of_step(9, count, per_step, step)).collect();
            for own in &steps {
                let mut views: Vec<usize> = own.iter().map(|(view, _)| *view).collect();
                views.sort_unstable();
                views.dedup();
                assert_eq!(views.len(), per_step.min(count), "{count} views, {per_step} a step: {own:?}");
            }
            let all: Vec<(usize, usize)> = steps.concat();
            for (epoch, own) in all.chunks_exact(count).enumerate() {
                let mut views: Vec<usize> = own.iter().map(|(view, _)| *view).collect();
                views.sort_unstable();
                assert_eq!(views, (0..count).collect::<Vec<_>>(), "epoch {epoch}");
                assert!(own.iter().all(|(_, of)| *of == epoch), "{own:?}");
            }
        }
    }
}
