//! What a stage keeps between its steps: mip chains, photographs at its resolution, first hits.

use super::targets::Target;
use crate::material::Material;
use crate::material::texels::PyramidWeights;
use crate::render::first_hits::FirstHits;
use crate::render::{ParameterGradient, Parameters};
use crate::scene::{PixelState, Scene};

/// What a stage needs and no checkpoint holds: all of it follows from scene, settings and state.
pub(super) struct StageWork {
    pub weights: PyramidWeights,
    pub parameters: Parameters<f32>,
    pub gradient: ParameterGradient<f32>,
    pub targets: Vec<Target>,
    pub first_hits: Vec<Option<FirstHits>>,
    /// Mean radiance of the pixels that are evidence, over all photos and channels.
    pub mean_of_photos: f32,
}

/// Mean radiance over all pixels that say something, on at most about 128 x 128 pixels a photo.
pub(super) fn mean_of_photos(scene: &Scene, targets: &[Target]) -> f32 {
    let (mut sum, mut count) = (0.0f64, 0u64);
    for target in targets {
        let stride = (target.pixel_count() >> 14).max(1);
        for pixel in (0..target.pixel_count()).step_by(stride) {
            let (radiance, state) = target.at(scene, pixel);
            if state != PixelState::Ignored {
                sum += f64::from(radiance.element_sum().max(0.0)) / 3.0;
                count += 1;
            }
        }
    }
    (sum / count.max(1) as f64) as f32
}

/// What is said of the texels of square maps, of maps of twice the size: each texel becomes four.
pub(super) fn doubled<T: Copy>(texels: &[T], size: usize) -> Vec<T> {
    (0..4 * size * size)
        .map(|index| {
            let (row, column) = (index / (2 * size), index % (2 * size));
            texels[row / 2 * size + column / 2]
        })
        .collect()
}

/// Maps of half the size: each texel is the mean of four.
pub(super) fn halved(texels: &[Material<f32>], size: usize) -> Vec<Material<f32>> {
    let half = size / 2;
    (0..half * half)
        .map(|index| {
            let first = 2 * (index / half) * size + 2 * (index % half);
            let four = [first, first + 1, first + size, first + size + 1].map(|texel| texels[texel].to_array());
            Material::from_array(std::array::from_fn(|k| 0.25 * four.iter().map(|texel| texel[k]).sum::<f32>()))
        })
        .collect()
}
