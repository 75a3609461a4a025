//! Blender 4.2 to 5: a script that builds mesh, material and world.
//!
//! Its material is the fitted model, a Diffuse BSDF plus a Principled BSDF that is all lobe; maps of one Principled BSDF alone
//! lie beside, since Cycles lays that one's lobe over its diffuse part and darkens it towards grazing angles.

use super::asset::Asset;
use super::asset::reflectance::{GRAZING_OF_VIEWS, LOW_IOR, MetalSplit};
use super::environment_file::with_x_in_the_centre;
use crate::error::{Error, ErrorKind, Result};
use crate::files::write_bytes;
use crate::image::file::{write_exr_grey, write_exr_rgb};
use std::path::Path;

/// The script.
const SCRIPT: &str = include_str!("python/import_patina.py");

/// Writes the script, the mesh, maps as OpenEXR, the environment and `material.json`, which the script reads; gives, for
/// the maps of one shader, the share of texels whose diffuse reflectance would have had to exceed 1, and metalness where
/// there are metals.
///
/// # Errors
/// Files that cannot be written.
pub fn write(asset: &Asset, folder: &Path) -> Result<(f64, Option<MetalSplit>)> {
    let metals = asset.metals();
    let (base_colour, held_share) = asset.base_colour_beside(metals.as_ref(), GRAZING_OF_VIEWS, None);
    write_exr_rgb(&folder.join("diffuse.exr"), &asset.maps.diffuse)?;
    if asset.has_lobe {
        write_exr_rgb(&folder.join("specular.exr"), &asset.maps.specular)?;
        write_exr_rgb(&folder.join("base_color.exr"), &base_colour)?;
        if let Some(split) = &metals {
            write_exr_grey(&folder.join("metallic.exr"), &split.metallic)?;
        }
        let dielectric = asset.dielectric_beside(metals.as_ref());
        let factor = dielectric.factor_over(LOW_IOR);
        write_exr_rgb(&folder.join("specular_tint.exr"), &dielectric.colour.map(|colour| *colour * factor))?;
        write_exr_grey(&folder.join("roughness.exr"), &asset.perceptual_roughness())?;
    }
    super::obj::write(&folder.join("mesh.obj"), &asset.mesh)?;
    if let Some(light) = &asset.light {
        write_exr_rgb(&folder.join("environment.exr"), &with_x_in_the_centre(&light.whole).radiance)?;
    }
    let facts = serde_json::json!({
        "name": asset.name, "ior": LOW_IOR, "has_lobe": asset.has_lobe, "has_metals": metals.is_some(),
        "has_environment": asset.light.is_some(),
    });
    let text = serde_json::to_string_pretty(&facts)
        .map_err(|source| Error::new(ErrorKind::Internal, format!("cannot encode material.json: {source}")))?;
    write_bytes(&folder.join("material.json"), text.as_bytes())?;
    write_bytes(&folder.join("import_patina.py"), SCRIPT.as_bytes())?;
    Ok((held_share, metals))
}

#[cfg(test)]
mod tests {
    use super::super::asset::tests::small_asset;
    use super::*;

    #[test]
    fn every_file_the_script_names_is_there() {
        let folder = tempfile::tempdir().unwrap();
        let mut asset = small_asset(true);
        asset.maps.specular.pixels_mut()[..32].fill(glam::Vec3::splat(0.8));
        assert!(write(&asset, folder.path()).unwrap().1.is_some());
        let named: Vec<&str> =
            SCRIPT.split('"').filter(|word| word.ends_with(".exr") || word.ends_with(".obj")).collect();
        assert!(named.len() >= 7, "{named:?}");
        for name in named {
            assert!(folder.path().join(name).is_file(), "{name}");
        }
        let text = std::fs::read_to_string(folder.path().join("material.json")).unwrap();
        let facts: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!((&facts["name"], &facts["has_lobe"]), (&"a_run".into(), &true.into()));
    }
}
