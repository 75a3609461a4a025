//! A small scene to audit on: the demo, few and small pictures, and parameters that do not explain them.

use super::AuditSettings;
use crate::atlas::covered_texels;
use crate::error::{Error, ErrorKind, Result};
use crate::material::lobe::MIN_WIDTH;
use crate::material::texels::{PyramidWeights, TexelPyramid, texels_from_maps};
use crate::math::random::SequentialRandom;
use crate::render::picture::{PictureSettings, render};
use crate::render::{Parameters, Surface};
use crate::scene::Scene;
use crate::scene::demo::{self, DemoSettings};
use std::sync::atomic::AtomicBool;

/// Width and height of the maps.
const MAP_SIZE: usize = 64;
/// Width and height of the pictures.
const PICTURE_SIZE: (usize, usize) = (40, 30);
/// Samples a pixel of the photographs.
const PHOTO_SAMPLES: usize = 16;
/// Levels of the mip chain, as in a fit.
const LEVELS: usize = 6;

/// A scene with all that [`gradients`](fn@super::gradients) needs.
pub struct BuiltIn {
    /// Demo with rendered photographs.
    pub scene: Scene,
    /// Its surface.
    pub surface: Surface,
    /// The truth, every number moved at random by up to about a third.
    pub parameters: Parameters<f32>,
    /// Weights of the mip chain.
    pub weights: PyramidWeights,
}

/// Builds the scene; views and seed as in the settings.
///
/// # Errors
/// As [`demo::build`].
pub fn built_in(settings: &AuditSettings) -> Result<BuiltIn> {
    let demo_settings = DemoSettings {
        views: settings.views.max(1),
        held_out: 0,
        width: PICTURE_SIZE.0,
        height: PICTURE_SIZE.1,
        map_size: MAP_SIZE,
        seed: settings.seed,
        ..Default::default()
    };
    let mut scene = demo::build(&demo_settings)?.scene;
    let surface = Surface::new(scene.mesh.clone())?;
    let Some(truth) = &scene.truth else {
        return Err(Error::new(ErrorKind::Internal, "the demo has no truth"));
    };
    let weights = PyramidWeights::new(&covered_texels(&scene.mesh, MAP_SIZE, MAP_SIZE), LEVELS);
    let mut parameters =
        Parameters::new(TexelPyramid::from_base(texels_from_maps(&truth.maps), &weights), &truth.environment);
    let picture_settings =
        PictureSettings { samples: PHOTO_SAMPLES, max_bounces: settings.bounces, ..PictureSettings::default() };
    for view in 0..scene.views.len() {
        let camera = scene.views[view].camera;
        let stop = AtomicBool::new(false);
        let picture = render(&surface, &camera, &parameters, view as u32, &picture_settings, &stop);
        scene.set_photo(view, picture.radiance)?;
    }

    let mut random = SequentialRandom::new(settings.seed ^ 0xb111);
    let mut factor = || 0.7 + 0.6 * random.next_number();
    for texel in &mut parameters.texels.levels[0].texels {
        for value in texel.diffuse.iter_mut().chain(&mut texel.specular) {
            *value = (*value * factor()).clamp(0.0, 1.0);
        }
        texel.log_width = (texel.log_width + factor() - 1.0).clamp(MIN_WIDTH.ln(), 0.0);
    }
    parameters.texels.rebuild(&weights);
    for value in parameters.light.iter_mut().flatten() {
        *value *= factor();
    }
    Ok(BuiltIn { scene, surface, parameters, weights })
}
