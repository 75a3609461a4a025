//! Mitsuba 3: a scene with the nearest built-in BSDF, the same with the exact lobe, and the lobe as a Python plugin.
//!
//! `scene.xml` uses `principled`, which every Mitsuba has. `scene_exact.xml` uses the BSDF `patina` of
//! `patina_lobe.py`: import that module after choosing a variant, then load the scene. Maps are OpenEXR read raw; the
//! environment is on nodes, see [`super::environment_file`].

use super::asset::{Asset, DielectricRange, MetalSplit};
use super::environment_file::on_nodes;
use super::ply;
use crate::error::Result;
use crate::files::write_bytes;
use crate::image::file::{write_exr_grey, write_exr_rgb};
use crate::material::LobeModel;
use glam::Vec3;
use std::path::Path;

/// The plugin.
const PLUGIN: &str = include_str!("python/patina_lobe.py");
/// Vertical field of view of the camera that is set up, in degrees.
const FIELD_OF_VIEW: f32 = 40.0;

/// Writes everything into a folder; gives what base colour and metalness lost, where there is a lobe.
///
/// # Errors
/// Files that cannot be written.
pub fn write(asset: &Asset, folder: &Path) -> Result<Option<MetalSplit>> {
    ply::write(&folder.join("mesh.ply"), &asset.mesh)?;
    write_exr_rgb(&folder.join("diffuse.exr"), &asset.maps.diffuse)?;
    if let Some(light) = &asset.light {
        write_exr_rgb(&folder.join("environment_nodes.exr"), &on_nodes(&light.whole).radiance)?;
    }
    let split = asset.has_lobe.then(|| {
        // A plain renderer has one F0 for all that is no metal: a low one, above which metalness makes up the rest.
        asset.metal_split(DielectricRange::Always(asset.f0_quantile(0.1).clamp(1e-4, 0.16)))
    });
    if let Some(split) = &split {
        write_exr_rgb(&folder.join("specular.exr"), &asset.maps.specular)?;
        write_exr_grey(&folder.join("roughness.exr"), &asset.maps.roughness)?;
        write_exr_rgb(&folder.join("base_color.exr"), &split.base_colour)?;
        write_exr_grey(&folder.join("metallic.exr"), &split.metallic)?;
        write_exr_grey(&folder.join("roughness_ggx.exr"), &asset.perceptual_roughness())?;
    }
    write_bytes(&folder.join("patina_lobe.py"), PLUGIN.as_bytes())?;
    let built_in = match &split {
        Some(split) => two_sided(&format!(
            "<bsdf type=\"principled\">\n{}{}{}        <float name=\"specular\" value=\"{}\"/>\n      </bsdf>",
            bitmap("base_color", "base_color.exr"),
            bitmap("metallic", "metallic.exr"),
            bitmap("roughness", "roughness_ggx.exr"),
            split.dielectric_f0 / 0.08,
        )),
        None => two_sided(&format!("<bsdf type=\"diffuse\">\n{}      </bsdf>", bitmap("reflectance", "diffuse.exr"))),
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
    Ok(split)
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
            assert_eq!(write(&asset, &place).unwrap().is_some(), has_lobe);
            for name in ["scene.xml", "scene_exact.xml"] {
                let text = std::fs::read_to_string(place.join(name)).unwrap();
                tags_are_balanced(&text);
                for file in text.split("name=\"filename\" value=\"").skip(1) {
                    let file = file.split('"').next().unwrap();
                    assert!(place.join(file).is_file(), "{file}");
                }
                assert_eq!(text.contains("type=\"patina\""), has_lobe && name == "scene_exact.xml");
                assert_eq!(text.contains("envmap"), has_light);
            }
        }
        let place = folder.path().join("truetrue");
        assert_eq!(file::read_rgb(&place.join("diffuse.exr")).unwrap(), small_asset(true).maps.diffuse);
        assert_eq!(file::read_grey(&place.join("roughness.exr")).unwrap(), small_asset(true).maps.roughness);
    }
}
