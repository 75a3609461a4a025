//! A result made ready for other programs: maps filled past their charts, at the wanted size, in the numbers that others
//! use. Every format writes from this.

pub mod reflectance;

use super::run_folder::RunResult;
use super::sun::{Sun, sun_of};
use crate::atlas::{covered_texels, dilate, nearest_covered};
use crate::image::GreyImage;
use crate::image::area::area_mean;
use crate::image::resize::enlarge;
use crate::light::Environment;
use crate::material::lobe::nearest::perceptual_roughness;
use crate::material::{LobeModel, MaterialMaps};
use crate::scene::Mesh;
use glam::Vec3;

/// Everything a format may write.
#[derive(Clone, Debug)]
pub struct Asset {
    /// Name of files and objects: letters, digits, `_` and `-`.
    pub name: String,
    /// The surface with texture coordinates and normals.
    pub mesh: Mesh,
    /// The maps as Patina means them, every texel filled.
    pub maps: MaterialMaps,
    /// Whether the surface has a specular lobe at all.
    pub has_lobe: bool,
    /// The lobe that was fitted.
    pub lobe: LobeModel,
    /// The light; `None` for a run without one.
    pub light: Option<Light>,
    /// How many metres a unit of the mesh is: 1 where it is not known.
    pub unit_in_metres: f64,
}

/// The light of an asset.
#[derive(Clone, Debug)]
pub struct Light {
    /// All of it.
    pub whole: Environment,
    /// Its sun, where it has one.
    pub sun: Option<Sun>,
}

impl Asset {
    /// Makes the asset of a result. `size` is the width of the written maps in texels; that of the result when `None`.
    pub fn new(name: &str, result: RunResult, has_light: bool, has_lobe: bool, size: Option<usize>) -> Self {
        let RunResult { maps, environment, mesh, lobe, .. } = result;
        let (width, height) = (maps.diffuse.width(), maps.diffuse.height());
        let nearest = nearest_covered(&covered_texels(&mesh, width, height));
        let maps = MaterialMaps {
            diffuse: dilate(&maps.diffuse, &nearest).map(|rgb| rgb.clamp(Vec3::ZERO, Vec3::ONE)),
            specular: dilate(&maps.specular, &nearest).map(|rgb| rgb.clamp(Vec3::ZERO, Vec3::ONE)),
            roughness: dilate(&maps.roughness, &nearest).map(|value| value.clamp(0.0, 1.0)),
        };
        drop(nearest);
        let maps = match size.filter(|&size| size != width) {
            Some(size) => resized(&maps, size, (size * height).div_ceil(width).max(1)),
            None => maps,
        };
        let light = (has_light && environment.power().max_element() > 0.0).then(|| {
            let sun = sun_of(&environment);
            Light { whole: environment, sun }
        });
        Asset { name: file_name_of(name), mesh, maps, has_lobe, lobe, light, unit_in_metres: 1.0 }
    }

    /// Roughness of glTF, Disney, Blender: the square root of the width of the GGX lobe, or of the nearest one.
    pub fn perceptual_roughness(&self) -> GreyImage {
        self.maps.roughness.map(|&roughness| match self.lobe {
            LobeModel::BlinnPhong => perceptual_roughness(roughness),
            LobeModel::Ggx => roughness.max(0.0).sqrt().sqrt(),
        })
    }
}

fn resized(maps: &MaterialMaps, width: usize, height: usize) -> MaterialMaps {
    if width < maps.diffuse.width() {
        MaterialMaps {
            diffuse: area_mean(&maps.diffuse, width, height),
            specular: area_mean(&maps.specular, width, height),
            roughness: area_mean(&maps.roughness, width, height),
        }
    } else {
        MaterialMaps {
            diffuse: enlarge(&maps.diffuse, width, height),
            specular: enlarge(&maps.specular, width, height),
            roughness: enlarge(&maps.roughness, width, height),
        }
    }
}

/// A name that every file system and every format takes.
fn file_name_of(name: &str) -> String {
    let kept: String = name.chars().map(|c| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' }).collect();
    match kept.chars().next() {
        None => "patina".into(),
        Some(first) if first.is_ascii_alphabetic() => kept,
        Some(_) => format!("patina_{kept}"),
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::image::Image;
    use glam::Vec2;

    /// Two triangles with a material that varies.
    pub fn small_asset(has_lobe: bool) -> Asset {
        let mesh = Mesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y],
            normals: vec![Vec3::Z; 4],
            uvs: vec![Vec2::new(0.1, 0.1), Vec2::new(0.9, 0.1), Vec2::new(0.9, 0.9), Vec2::new(0.1, 0.9)],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        };
        let at = |row: usize, column: usize| (row as f32 / 15.0, column as f32 / 15.0);
        let maps = MaterialMaps {
            diffuse: Image::from_fn(16, 16, |row, column| Vec3::new(at(row, column).0, 0.3, at(row, column).1)),
            specular: Image::from_fn(16, 16, |row, column| Vec3::new(0.04, 0.03, 0.05) * (1.0 + at(row, column).0)),
            roughness: Image::from_fn(16, 16, |row, column| 0.05 + 0.9 * at(row, column).1),
        };
        let mut environment = Environment::constant(16, 8, Vec3::splat(0.2));
        environment.radiance[(2, 3)] = Vec3::new(60.0, 55.0, 50.0);
        let times_seen = Image::filled(16, 16, 1.0);
        Asset::new(
            "a run",
            RunResult { maps, environment, mesh, times_seen, lobe: LobeModel::BlinnPhong },
            true,
            has_lobe,
            None,
        )
    }

    #[test]
    fn texels_outside_the_charts_take_the_nearest_inside() {
        let asset = small_asset(true);
        assert_eq!(asset.name, "a_run");
        // The chart reaches from texel 1 to texel 14.
        assert_eq!(asset.maps.diffuse[(0, 7)], asset.maps.diffuse[(1, 7)]);
        assert_eq!(asset.maps.roughness[(9, 15)], asset.maps.roughness[(9, 14)]);
        assert_ne!(asset.maps.diffuse[(1, 7)], asset.maps.diffuse[(2, 7)]);
    }
}
