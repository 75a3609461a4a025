//! Errors of maps and light against the truth of a scene, where one is known.

use crate::error::Result;
use crate::insight::intervals::interval_coverage;
use crate::insight::report::data::TruthErrors;
use crate::insight::truth::{environment_errors, map_errors};
use crate::light::Environment;
use crate::material::{Material, MaterialMaps};
use crate::render::Surface;
use crate::scene::Scene;

/// Errors of maps, their stated deviations and light against the truth of a scene, without relit pictures; `None` where no truth is known. Maps
/// are compared only where they lie on the texture coordinates of the truth.
pub(crate) fn truth_errors(
    scene: &Scene,
    surface: &Surface,
    maps: &MaterialMaps,
    deviations: Option<&MaterialMaps>,
    environment: &Environment,
) -> Result<Option<TruthErrors>> {
    let Some(truth) = &scene.truth else { return Ok(None) };
    let mut errors = TruthErrors::default();
    let size = (truth.texels_seen.width(), truth.texels_seen.height());
    if same_atlas(scene, surface) && size == (truth.maps.diffuse.width(), truth.maps.diffuse.height()) {
        let fitted = resampled(maps, size);
        let of_maps = map_errors(&fitted, &truth.maps, &truth.texels_seen)?;
        errors.intervals = deviations.and_then(|own| {
            interval_coverage(&fitted, &resampled(own, size), &truth.maps, &truth.texels_seen, &of_maps)
        });
        errors.maps = Some(of_maps);
    }
    let light = &truth.environment;
    errors.environment = Some(environment_errors(&environment.resampled(light.width(), light.height()), light)?);
    Ok(Some(errors))
}

/// Whether the fit kept the texture coordinates the mesh came with, so that its maps lie on those of the truth.
fn same_atlas(scene: &Scene, surface: &Surface) -> bool {
    let (before, after) = (&scene.mesh, surface.mesh());
    !before.uvs.is_empty()
        && before.triangles.len() == after.triangles.len()
        && before.triangles.iter().zip(&after.triangles).all(|(before_corners, after_corners)| {
            (0..3).all(|corner| {
                let (a, b) = (before.uvs[before_corners[corner] as usize], after.uvs[after_corners[corner] as usize]);
                (a - b).abs().max_element() < 1e-5
            })
        })
}

/// Maps read at the texel centres of another size.
pub(crate) fn resampled(maps: &MaterialMaps, (width, height): (usize, usize)) -> MaterialMaps {
    if (maps.diffuse.width(), maps.diffuse.height()) == (width, height) {
        return maps.clone();
    }
    use crate::material::texels::{maps_from_texels, texels_from_maps};
    let own = TexelImage { texels: texels_from_maps(maps), width: maps.diffuse.width(), height: maps.diffuse.height() };
    let texels = (0..width * height).map(|index| own.at(index, width, height)).collect::<Vec<_>>();
    maps_from_texels(&texels, width, height)
}

struct TexelImage {
    texels: Vec<Material<f32>>,
    width: usize,
    height: usize,
}

impl TexelImage {
    /// Mean over the texels that a texel of another size covers, or the nearest one.
    fn at(&self, index: usize, width: usize, height: usize) -> Material<f32> {
        let (row, column) = (index / width, index % width);
        let range = |place: usize, size: usize, own: usize| {
            let first = place * own / size;
            first..((place + 1) * own / size).max(first + 1).min(own)
        };
        let mut sum = Material::default();
        let mut count = 0.0;
        for row in range(row, height, self.height) {
            for column in range(column, width, self.width) {
                sum.add(&self.texels[row * self.width + column]);
                count += 1.0;
            }
        }
        sum.map(|sum| sum / count)
    }
}
