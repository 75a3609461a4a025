//! Pictures of a run under its own light and under others.

use crate::error::{Finding, Result};
use crate::export::RunResult;
use crate::light::Environment;
use crate::light::sky::{BuiltInSky, sun_and_sky};
use crate::material::texels::{PyramidWeights, TexelPyramid, texels_from_maps};
use crate::material::{LobeModel, MaterialMaps};
use crate::render::picture::{Picture, PictureSettings, render};
use crate::render::{Parameters, Surface};
use crate::scene::Camera;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// Maps and light as the tracer reads them, with lobes of Blinn-Phong.
pub fn parameters(maps: &MaterialMaps, environment: &Environment) -> Parameters<f32> {
    parameters_with(maps, environment, LobeModel::BlinnPhong)
}

/// Maps and light as the tracer reads them, with these lobes.
pub fn parameters_with(maps: &MaterialMaps, environment: &Environment, lobe: LobeModel) -> Parameters<f32> {
    let weights = PyramidWeights::flat(maps.diffuse.width(), maps.diffuse.height());
    let texels = TexelPyramid::from_base(texels_from_maps(maps), &weights).with_model(lobe);
    Parameters::new(texels, environment)
}

/// Maps, light and lobe of a result as the tracer reads them.
pub fn parameters_of(result: &RunResult) -> Parameters<f32> {
    parameters_with(&result.maps, &result.environment, result.lobe)
}

/// The surface and the parameters of a run folder.
pub fn surface_of(result: &RunResult) -> Result<(Surface, Parameters<f32>)> {
    let surface = Surface::new(result.mesh.clone())?;
    Ok((surface, parameters_of(result)))
}

/// A light that was read or made.
#[derive(Clone, Debug, PartialEq)]
pub struct OpenedLight {
    /// The name of the sky, or of the file without its ending.
    pub name: String,
    /// The light.
    pub environment: Environment,
    /// What was noticed on reading: texels that were repaired, a range that holds no sun.
    pub findings: Vec<Finding>,
}

/// A light by its file, or by the name of a built-in sky: `noon`, `evening` or `overcast`.
pub fn light_of(name: &str, height: usize) -> Result<OpenedLight> {
    match BuiltInSky::of_name(name) {
        Some(sky) => {
            let environment = sun_and_sky(2 * height, height, &sky.settings());
            Ok(OpenedLight { name: name.into(), environment, findings: Vec::new() })
        }
        None => {
            let path = Path::new(name);
            let (environment, findings) = Environment::read(path)?;
            let name = path.file_stem().map_or_else(|| name.into(), |stem| stem.to_string_lossy().into_owned());
            let environment =
                if environment.height() > height { environment.resampled(2 * height, height) } else { environment };
            Ok(OpenedLight { name, environment, findings })
        }
    }
}

/// A light scaled so that its mean radiance has the luminance of another's: pictures under both are of like brightness.
pub fn matched(light: &Environment, to: &Environment) -> (Environment, f32) {
    let luminance = |light: &Environment| crate::math::luminance(light.mean_radiance()).max(1e-6);
    let factor = luminance(to) / luminance(light);
    (Environment { radiance: light.radiance.map(|radiance| *radiance * factor) }, factor)
}

/// A picture of a view under another light.
pub fn relit(
    surface: &Surface,
    own: &Parameters<f32>,
    light: &Environment,
    camera: &Camera,
    view: usize,
    settings: &PictureSettings,
    stop: &AtomicBool,
) -> Picture {
    let lit = Parameters {
        texels: own.texels.clone(),
        light: light.radiance.pixels().iter().map(|radiance| radiance.to_array()).collect(),
        environment_size: (light.width(), light.height()),
    };
    render(surface, camera, &lit, view as u32, settings, stop)
}
