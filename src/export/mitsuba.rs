//! Mitsuba 3: a scene with the nearest built-in BSDF, the same with the exact lobe, and the lobe as a Python plugin.
//!
//! `scene.xml` is the sum of `diffuse` and `principled`, which every Mitsuba has: `principled` alone has one F0 for all that
//! is no metal and one colour for both parts. Mitsuba has no sum but `blendbsdf`, a weighted mean: each part's reflectance is
//! over its weight, so beyond 1 in the diffuse one. As a metal `principled` is Schlick's rise from the F0 of its base colour. `scene_exact.xml` uses the BSDF `patina` of
//! `patina_lobe.py`: import that module after choosing a variant, then load the scene. Maps are OpenEXR read raw; the
//! environment is on nodes, see [`super::environment_file`].

use super::asset::Asset;
use super::environment_file::on_nodes;
use super::ply;
use crate::error::Result;
use crate::files::write_bytes;
use crate::image::RgbImage;
use crate::image::file::{write_exr_grey, write_exr_rgb};
use crate::material::LobeModel;
use glam::Vec3;
use std::path::Path;

/// The plugin.
const PLUGIN: &str = include_str!("python/patina_lobe.py");
/// Weight of the lobe in the mean of both parts: its rise towards grazing angles ends at this in place of 1, so nearly 1.
const WEIGHT_OF_LOBE: f32 = 0.9;
/// Vertical field of view of the camera that is set up, in degrees.
const FIELD_OF_VIEW: f32 = 40.0;

/// Writes everything into a folder.
///
/// # Errors
/// Files that cannot be written.
pub fn write(asset: &Asset, folder: &Path) -> Result<()> {
    ply::write(&folder.join("mesh.ply"), &asset.mesh)?;
    write_exr_rgb(&folder.join("diffuse.exr"), &asset.maps.diffuse)?;
    if let Some(light) = &asset.light {
        write_exr_rgb(&folder.join("environment_nodes.exr"), &on_nodes(&light.whole).radiance)?;
    }
    if asset.has_lobe {
        write_exr_rgb(&folder.join("specular.exr"), &asset.maps.specular)?;
        write_exr_grey(&folder.join("roughness.exr"), &asset.maps.roughness)?;
        let over = |map: &RgbImage, weight: f32| map.map(|rgb| *rgb / weight);
        write_exr_rgb(&folder.join("diffuse_part.exr"), &over(&asset.maps.diffuse, 1.0 - WEIGHT_OF_LOBE))?;
        write_exr_rgb(&folder.join("lobe_part.exr"), &over(&asset.maps.specular, WEIGHT_OF_LOBE))?;
        write_exr_grey(&folder.join("roughness_ggx.exr"), &asset.perceptual_roughness())?;
    }
    write_bytes(&folder.join("patina_lobe.py"), PLUGIN.as_bytes())?;
    let built_in = match asset.has_lobe {
        true => two_sided(&format!(
            "<bsdf type=\"blendbsdf\">\n        <float name=\"weight\" value=\"{WEIGHT_OF_LOBE}\"/>\n        \
             <bsdf type=\"diffuse\">\n{}        </bsdf>\n        <bsdf type=\"principled\">\n{}{}        \
             <float name=\"metallic\" value=\"1\"/>\n        </bsdf>\n      </bsdf>",
            bitmap("reflectance", "diffuse_part.exr"),
            bitmap("base_color", "lobe_part.exr"),
            bitmap("roughness", "roughness_ggx.exr"),
        )),
        false => two_sided(&format!("<bsdf type=\"diffuse\">\n{}      </bsdf>", bitmap("reflectance", "diffuse.exr"))),
    };
    write_bytes(&folder.join("scene.xml"), scene(asset, &built_in).as_bytes())?;
    // The plugin is two-sided itself: it knows the triangle's normal.
    let exact = match asset.has_lobe {
        true => format!(
            "<bsdf type=\"patina\">\n{}{}{}        <string name=\"distribution\" value=\"{}\"/>\n      </bsdf>",
            bitmap("diffuse", "diffuse.exr"),
            bitmap("specular", "specular.exr"),
            bitmap("roughness", "roughness.exr"),
            match asset.lobe {
                LobeModel::BlinnPhong => "blinn-phong",
                LobeModel::Ggx => "ggx",
            }
        ),
        false => built_in,
    };
    write_bytes(&folder.join("scene_exact.xml"), scene(asset, &exact).as_bytes())?;
    Ok(())
}

fn bitmap(name: &str, file: &str) -> String {
    format!(
        "        <texture type=\"bitmap\" name=\"{name}\">\n          <string name=\"filename\" value=\"{file}\"/>\n          \
         <boolean name=\"raw\" value=\"true\"/>\n          <string name=\"wrap_mode\" value=\"clamp\"/>\n        </texture>\n"
    )
}

fn two_sided(bsdf: &str) -> String {
    format!("<bsdf type=\"twosided\">\n      {bsdf}\n    </bsdf>")
}

fn scene(asset: &Asset, bsdf: &str) -> String {
    // A camera that sees all of it, from the front and a little above.
    let (low, high) = asset.mesh.bounds().unwrap_or((Vec3::NEG_ONE, Vec3::ONE));
    let (centre, radius) = (0.5 * (low + high), 0.5 * (high - low).length().max(1e-6));
    let eye = centre
        + Vec3::new(0.4, 0.35, 1.0).normalize_or_zero() * (1.1 * radius / (0.5 * FIELD_OF_VIEW).to_radians().sin());
    let point = |p: Vec3| format!("{}, {}, {}", p.x, p.y, p.z);
    let light = match asset.light {
        Some(_) => {
            "  <emitter type=\"envmap\">\n    <string name=\"filename\" value=\"environment_nodes.exr\"/>\n  </emitter>\n"
        }
        None => "  <emitter type=\"constant\"/>\n",
    };
    format!(
        "<?xml version=\"1.0\"?>\n<scene version=\"3.0.0\">\n  <integrator type=\"path\">\n    \
         <integer name=\"max_depth\" value=\"4\"/>\n  </integrator>\n  <sensor type=\"perspective\">\n    \
         <float name=\"fov\" value=\"{FIELD_OF_VIEW}\"/>\n    <transform name=\"to_world\">\n      \
         <lookat origin=\"{}\" target=\"{}\" up=\"0, 1, 0\"/>\n    </transform>\n    \
         <sampler type=\"independent\">\n      <integer name=\"sample_count\" value=\"64\"/>\n    </sampler>\n    \
         <film type=\"hdrfilm\">\n      <integer name=\"width\" value=\"768\"/>\n      \
         <integer name=\"height\" value=\"576\"/>\n      <rfilter type=\"box\"/>\n    </film>\n  </sensor>\n{light}  \
         <shape type=\"ply\">\n    <string name=\"filename\" value=\"mesh.ply\"/>\n    \
         <boolean name=\"flip_tex_coords\" value=\"true\"/>\n    {bsdf}\n  </shape>\n</scene>\n",
        point(eye),
        point(centre),
    )
}

#[cfg(test)]
mod tests {
    use super::super::asset::tests::small_asset;
    use super::super::xml::tests::tags_are_balanced;
    use super::*;
    use crate::image::file;

    #[test]
    fn scenes_are_well_formed_and_their_files_are_there() {
        let folder = tempfile::tempdir().unwrap();
        for (has_lobe, has_light) in [(true, true), (false, true), (true, false)] {
            let mut asset = small_asset(has_lobe);
            if !has_light {
                asset.light = None;
            }
            let place = folder.path().join(format!("{has_lobe}{has_light}"));
            write(&asset, &place).unwrap();
            for name in ["scene.xml", "scene_exact.xml"] {
                let text = std::fs::read_to_string(place.join(name)).unwrap();
                tags_are_balanced(&text);
                for file in text.split("name=\"filename\" value=\"").skip(1) {
                    let file = file.split('"').next().unwrap();
                    assert!(place.join(file).is_file(), "{file}");
                }
                assert_eq!(text.contains("type=\"patina\""), has_lobe && name == "scene_exact.xml");
                assert_eq!(text.contains("envmap"), has_light);
                assert_eq!(text.contains("blendbsdf"), has_lobe && name == "scene.xml");
            }
        }
        let place = folder.path().join("truetrue");
        assert_eq!(file::read_rgb(&place.join("diffuse.exr")).unwrap(), small_asset(true).maps.diffuse);
        assert_eq!(file::read_grey(&place.join("roughness.exr")).unwrap(), small_asset(true).maps.roughness);
        // Each part times its weight is what was fitted.
        for (name, weight, map) in [
            ("diffuse_part.exr", 1.0 - WEIGHT_OF_LOBE, &small_asset(true).maps.diffuse),
            ("lobe_part.exr", WEIGHT_OF_LOBE, &small_asset(true).maps.specular),
        ] {
            let part = file::read_rgb(&place.join(name)).unwrap();
            let mut pairs = part.pixels().iter().zip(map.pixels());
            assert!(pairs.all(|(part, whole)| (*part * weight - *whole).length() < 1e-6), "{name}");
        }
    }
}
