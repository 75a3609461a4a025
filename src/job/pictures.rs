//! Pictures of a run under its own light and under others.

use crate::error::{Error, ErrorKind, Finding, Place, Result};
use crate::export::RunResult;
use crate::light::Environment;
use crate::light::day::Day;
use crate::light::sky::{BuiltInSky, sun_and_sky};
use crate::material::texels::{PyramidWeights, TexelPyramid, texels_from_maps};
use crate::material::{LobeModel, MaterialMaps};
use crate::render::picture::{Picture, PictureSettings, render};
use crate::render::{Parameters, Surface};
use crate::scene::{Camera, Truth};
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

/// Maps, light and lobe of a truth as the tracer reads them.
pub fn parameters_of_truth(truth: &Truth) -> Parameters<f32> {
    parameters_with(&truth.maps, &truth.environment, truth.lobe)
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

/// A light by its file, by the name of a built-in sky (`noon`, `evening`, `overcast`), or by an hour and a latitude as
/// [`Day::of_name`] reads them.
///
/// # Errors
/// A name that is none of them, a sun that has not risen, and those of [`Environment::read`].
pub fn light_of(name: &str, height: usize) -> Result<OpenedLight> {
    let made = |environment| OpenedLight { name: name.into(), environment, findings: Vec::new() };
    if let Some(sky) = BuiltInSky::of_name(name) {
        return Ok(made(sun_and_sky(2 * height, height, &sky.settings())));
    }
    if let Some(day) = Day::of_name(name) {
        return Ok(OpenedLight { name: name.replace([':', '@', ','], "-"), ..made(day.environment(height)?) });
    }
    let path = Path::new(name);
    if path.extension().is_none() && !path.exists() {
        return Err(unknown_light(name));
    }
    let (environment, findings) = Environment::read(path)?;
    let name = path.file_stem().map_or_else(|| name.into(), |stem| stem.to_string_lossy().into_owned());
    let environment =
        if environment.height() > height { environment.resampled(2 * height, height) } else { environment };
    Ok(OpenedLight { name, environment, findings })
}

/// What to say of a name that is neither a sky nor a file.
fn unknown_light(name: &str) -> Error {
    let skies = BuiltInSky::ALL.map(BuiltInSky::name).join(", ");
    Error::new(ErrorKind::InvalidSetting, format!("{name} is neither a file nor a built-in sky"))
        .at(Place::Setting("env".into()))
        .remedy(format!(
            "the skies are {skies}, or an hour and a latitude as 16:30@48; files end in .hdr, .exr or .pfm"
        ))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_light_is_known_by_sky_hour_or_file_and_a_wrong_name_is_told_the_skies() {
        assert_eq!(light_of("noon", 8).unwrap().environment.height(), 8);
        let afternoon = light_of("16:30@48", 8).unwrap();
        assert_eq!(afternoon.name, "16-30-48", "files are named after it");
        let error = light_of("nonn", 8).unwrap_err();
        assert!(error.remedy_text().contains("noon, evening, overcast"), "{error}");
        // What looks like a file is looked for.
        let error = light_of("nonn.hdr", 8).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Missing);
        assert_eq!(light_of("3:00@48", 8).unwrap_err().kind(), ErrorKind::InvalidSetting, "the sun is not up");
    }
}
