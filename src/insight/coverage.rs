//! Which texels the photographs see.

use crate::image::{GreyImage, Image};
use crate::material::TextureTap;
use crate::math::parallel;
use crate::render::Surface;
use crate::scene::{PixelState, Scene};
use glam::Vec2;

/// In how many of the given views, by index, each texel of square maps is seen.
pub fn times_seen_by(scene: &Scene, surface: &Surface, training: &[usize], map_size: usize) -> GreyImage {
    let mut counts = vec![0u16; map_size * map_size];
    // A few views at once: each needs a map of bits of its own.
    for group in training.chunks(8) {
        let seen: Vec<Vec<u64>> = parallel::map_items(group, |&view| texels_of_view(scene, surface, view, map_size));
        parallel::each_chunk(&mut counts, 4096, &|chunk, counts| {
            for (index, count) in (4096 * chunk..).zip(counts) {
                *count += seen.iter().filter(|bits| bits[index / 64] >> (index % 64) & 1 == 1).count() as u16;
            }
        });
    }
    Image::from_pixels(map_size, map_size, counts.into_iter().map(f32::from).collect())
}

fn texels_of_view(scene: &Scene, surface: &Surface, view: usize, map_size: usize) -> Vec<u64> {
    let view = &scene.views[view];
    let camera = &view.camera;
    let mut bits = vec![0u64; (map_size * map_size).div_ceil(64)];
    for row in 0..camera.height {
        for column in 0..camera.width {
            let state = view.states[(row, column)];
            if !state.is_surface() || state == PixelState::Ignored {
                continue;
            }
            let ray = camera.ray_through(Vec2::new(column as f32 + 0.5, row as f32 + 0.5));
            let Some(hit) = surface.closest(&ray) else { continue };
            let point = surface.point(&hit);
            let cosine = point.geometric_normal.dot(-ray.direction);
            if cosine <= 0.0 {
                continue;
            }
            let texels =
                camera.pixel_angle_radians() * hit.t / cosine.max(0.05).sqrt() * point.uv_per_length * map_size as f32;
            let level = (texels.log2() + 0.5).clamp(0.0, map_size.trailing_zeros() as f32) as u32;
            let size = map_size >> level;
            let tap = TextureTap::at(point.uv, level, size, size);
            for (&index, &weight) in tap.index.iter().zip(&tap.weight) {
                if weight > 0.05 {
                    mark_block(&mut bits, index as usize, level, size, map_size);
                }
            }
        }
    }
    bits
}

/// Marks the base texels below a texel of a coarser level.
fn mark_block(bits: &mut [u64], index: usize, level: u32, size: usize, map_size: usize) {
    let (first_row, first_column) = ((index / size) << level, (index % size) << level);
    for row in first_row..first_row + (1 << level) {
        for column in first_column..first_column + (1 << level) {
            let place = row * map_size + column;
            bits[place / 64] |= 1 << (place % 64);
        }
    }
}
