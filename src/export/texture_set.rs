//! Maps alone, named as artists name them, in both workflows: base colour with metalness, and diffuse with specular.

use super::asset::Asset;
use super::asset::reflectance::{DielectricRange, LARGEST_SPECULAR, MetalSplit};
use super::environment_file::write_both;
use super::texture::{Curve, Texture, TextureFormat};
use crate::error::Result;
use std::path::Path;

/// Writes the set, the mesh and the environment into a folder; gives what base colour and metalness lost.
///
/// # Errors
/// Files that cannot be written.
pub fn write(asset: &Asset, folder: &Path, format: TextureFormat) -> Result<MetalSplit> {
    let split = asset.metal_split(DielectricRange::UpTo(LARGEST_SPECULAR));
    let maps = [
        ("BaseColor", Texture::Rgb(&split.base_colour), Curve::Srgb),
        ("Metallic", Texture::Grey(&split.metallic), Curve::Linear),
        ("Specular", Texture::Grey(&split.specular), Curve::Linear),
        ("Diffuse", Texture::Rgb(&asset.maps.diffuse), Curve::Srgb),
        ("SpecularF0", Texture::Rgb(&asset.maps.specular), Curve::Srgb),
    ];
    for (kind, texture, curve) in maps {
        texture.write(folder, &format!("{}_{kind}", asset.name), format, curve)?;
    }
    let roughness = asset.perceptual_roughness();
    Texture::Grey(&roughness).write(folder, &format!("{}_Roughness", asset.name), format, Curve::Linear)?;
    super::obj::write(&folder.join(format!("{}.obj", asset.name)), &asset.mesh)?;
    if let Some(light) = &asset.light {
        write_both(&light.whole, folder, "environment")?;
    }
    Ok(split)
}

#[cfg(test)]
mod tests {
    use super::super::asset::tests::small_asset;
    use super::*;
    use crate::image::file;

    #[test]
    fn every_map_is_there_in_every_format() {
        let folder = tempfile::tempdir().unwrap();
        for format in [TextureFormat::Png8, TextureFormat::Png16, TextureFormat::Exr, TextureFormat::Tiff] {
            let place = folder.path().join(format!("{format:?}"));
            write(&small_asset(true), &place, format).unwrap();
            for kind in ["BaseColor", "Metallic", "Specular", "Roughness", "Diffuse", "SpecularF0"] {
                assert!(place.join(format!("a_run_{kind}.{}", format.extension())).is_file(), "{kind}");
            }
        }
        let read = file::read_rgb(&folder.path().join("Exr/a_run_SpecularF0.exr")).unwrap();
        assert_eq!(read, small_asset(true).maps.specular);
    }
}
