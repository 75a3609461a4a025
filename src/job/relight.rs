//! A finished run under another light, for who has no window and no command line.

use crate::error::{Error, ErrorKind, Result};
use crate::export::RunFolder;
use crate::image::RgbImage;
use crate::light::Environment;
use crate::material::texels::{PyramidWeights, TexelPyramid, texels_from_maps};
use crate::render::picture::{PictureSettings, render};
use crate::render::{Parameters, Surface};
use crate::scene::Camera;
use std::sync::atomic::{AtomicBool, Ordering};

/// Renders a run from `camera` under `environment`: linear radiance, of the camera's size, with the environment behind the
/// surface. `samples` paths per pixel.
///
/// # Errors
/// A run without maps or mesh, or files that cannot be read; `Stopped` when `stop` was raised.
pub fn relight(
    run: &RunFolder,
    camera: &Camera,
    environment: &Environment,
    samples: usize,
    stop: &AtomicBool,
) -> Result<RgbImage> {
    let result = run.read_result()?;
    let surface = Surface::new(result.mesh)?;
    let maps = result.maps;
    let weights = PyramidWeights::flat(maps.diffuse.width(), maps.diffuse.height());
    let texels = TexelPyramid::from_base(texels_from_maps(&maps), &weights).with_model(result.lobe);
    let parameters = Parameters::new(texels, environment);
    let settings = PictureSettings { samples, two_sided: true, ..PictureSettings::default() };
    let picture = render(&surface, camera, &parameters, 0, &settings, stop).radiance;
    match stop.load(Ordering::Relaxed) {
        true => Err(Error::new(ErrorKind::Stopped, "rendering was stopped")),
        false => Ok(picture),
    }
}
