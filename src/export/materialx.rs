//! MaterialX: an OpenPBR surface over OpenEXR maps, all linear.

use super::asset::Asset;
use super::asset::reflectance::{Dielectric, GRAZING_OF_VIEWS, MetalSplit};
use super::environment_file::smooth;
use crate::error::Result;
use crate::files::write_bytes;
use crate::image::file::{write_exr_grey, write_exr_rgb};
use std::path::Path;

/// Writes `NAME.mtlx`, its maps, the mesh and the environment into a folder; gives the share of texels whose diffuse
/// reflectance would have had to exceed 1, and metalness where there are metals.
///
/// # Errors
/// Files that cannot be written.
pub fn write(asset: &Asset, folder: &Path) -> Result<(f64, Option<MetalSplit>)> {
    let metals = asset.metals();
    let roughness = asset.perceptual_roughness();
    let (base_colour, held_share) = asset.base_colour_beside(metals.as_ref(), GRAZING_OF_VIEWS, Some(&roughness));
    write_exr_rgb(&folder.join("base_color.exr"), &base_colour)?;
    write_exr_grey(&folder.join("specular_roughness.exr"), &roughness)?;
    let dielectric = asset.has_lobe.then(|| asset.dielectric_beside(metals.as_ref()));
    if let Some(split) = &metals {
        write_exr_grey(&folder.join("base_metalness.exr"), &split.metallic)?;
    }
    if let Some(dielectric) = &dielectric {
        write_exr_rgb(&folder.join("specular_color.exr"), &dielectric.colour)?;
    }
    super::obj::write(&folder.join("mesh.obj"), &asset.mesh)?;
    if let Some(light) = &asset.light {
        write_exr_rgb(&folder.join("environment.exr"), &smooth(&light.whole).radiance)?;
    }
    write_bytes(
        &folder.join(format!("{}.mtlx", asset.name)),
        document(&asset.name, dielectric.as_ref(), metals.is_some()).as_bytes(),
    )?;
    Ok((held_share, metals))
}

/// The document; the surface has no lobe without a dielectric.
fn document(name: &str, dielectric: Option<&Dielectric>, has_metals: bool) -> String {
    let image = |map: &str, kind: &str| {
        format!(
            "    <image name=\"{map}_image\" type=\"{kind}\">\n      \
             <input name=\"file\" type=\"filename\" value=\"{map}.exr\" colorspace=\"lin_rec709\" />\n      \
             <input name=\"uaddressmode\" type=\"string\" value=\"clamp\" />\n      \
             <input name=\"vaddressmode\" type=\"string\" value=\"clamp\" />\n    </image>\n"
        )
        .replace(if kind == "float" { " colorspace=\"lin_rec709\"" } else { "\0" }, "")
    };
    let output =
        |map: &str, kind: &str| format!("    <output name=\"{map}\" type=\"{kind}\" nodename=\"{map}_image\" />\n");
    let input = |map: &str, kind: &str| {
        format!("    <input name=\"{map}\" type=\"{kind}\" nodegraph=\"{name}_maps\" output=\"{map}\" />\n")
    };
    let mut maps = vec![("base_color", "color3"), ("specular_roughness", "float")];
    let mut constants = "    <input name=\"base_weight\" type=\"float\" value=\"1\" />\n    \
        <input name=\"base_diffuse_roughness\" type=\"float\" value=\"0\" />\n"
        .to_string();
    match has_metals {
        true => maps.push(("base_metalness", "float")),
        false => constants += "    <input name=\"base_metalness\" type=\"float\" value=\"0\" />\n",
    }
    match dielectric {
        Some(dielectric) => {
            maps.push(("specular_color", "color3"));
            constants += &format!(
                "    <input name=\"specular_weight\" type=\"float\" value=\"1\" />\n    \
                 <input name=\"specular_ior\" type=\"float\" value=\"{:.6}\" />\n",
                dielectric.ior
            );
        }
        None => constants += "    <input name=\"specular_weight\" type=\"float\" value=\"0\" />\n",
    }
    let all = |line: &dyn Fn(&str, &str) -> String| maps.iter().map(|(map, kind)| line(map, kind)).collect::<String>();
    format!(
        "<?xml version=\"1.0\"?>\n<materialx version=\"1.39\" colorspace=\"lin_rec709\">\n  \
         <nodegraph name=\"{name}_maps\">\n{}{}  </nodegraph>\n  \
         <open_pbr_surface name=\"{name}_surface\" type=\"surfaceshader\">\n{constants}{}  </open_pbr_surface>\n  \
         <surfacematerial name=\"{name}\" type=\"material\">\n    \
         <input name=\"surfaceshader\" type=\"surfaceshader\" nodename=\"{name}_surface\" />\n  </surfacematerial>\n\
         </materialx>\n",
        all(&image),
        all(&output),
        all(&input),
    )
}

#[cfg(test)]
mod tests {
    use super::super::asset::tests::small_asset;
    use super::super::xml::tests::tags_are_balanced;
    use super::*;

    #[test]
    fn the_document_is_well_formed_and_its_files_are_there() {
        let folder = tempfile::tempdir().unwrap();
        for has_lobe in [true, false] {
            let mut asset = small_asset(has_lobe);
            asset.maps.specular.pixels_mut()[..32].fill(glam::Vec3::splat(0.8));
            let place = folder.path().join(format!("{has_lobe}"));
            assert_eq!(write(&asset, &place).unwrap().1.is_some(), has_lobe);
            let text = std::fs::read_to_string(place.join("a_run.mtlx")).unwrap();
            tags_are_balanced(&text);
            for file in text.split("value=\"").skip(1).filter_map(|rest| rest.split('"').next()) {
                assert!(!file.ends_with(".exr") || place.join(file).is_file(), "{file}");
            }
            assert_eq!(text.matches("specular_color.exr").count(), usize::from(has_lobe));
            assert_eq!(text.contains("name=\"specular_weight\" type=\"float\" value=\"0\""), !has_lobe);
            assert_eq!(text.matches("colorspace=\"lin_rec709\"").count(), if has_lobe { 3 } else { 2 });
        }
    }
}
