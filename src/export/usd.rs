//! USD: a stage as text (`.usda`) beside its textures, and the same stage with everything inside (`.usdz`).
//!
//! The material is a `UsdPreviewSurface` with a variant set `workflow`. `specular` takes diffuse reflectance, F0 and
//! roughness as they are; but few importers know that workflow, and Blender reads its colour as a factor of F0. So
//! `metalness` is chosen at first, and says what the [`gltf`](super::gltf) says: base colour, metalness where the surface has
//! metals, and F0 of what is none as a colour over that of [`LOW_IOR`]. Readers that pass over that colour in this workflow,
//! as its text asks, show the index alone: they do better with `specular`.
//! Texture coordinates point up, as in Patina; the dome light's left border looks along -z, as in Patina.

use super::asset::Asset;
use super::asset::reflectance::{GRAZING_OF_HALF_VECTORS, LOW_IOR, MetalSplit};
use super::environment_file::smooth;
use super::texture::{Curve, Texture};
use crate::error::{Error, ErrorKind, Result};
use crate::files::{write_atomically, write_bytes};
use crate::image::file::write_exr_rgb;
use glam::Vec3;
use std::fmt::Write as _;
use std::io::Write;
use std::path::Path;

/// Writes `NAME.usda`, its textures and `NAME.usdz` into a folder; gives the share of texels whose base colour would have had
/// to exceed 1, and what base colour and metalness lost, where there is a lobe.
///
/// # Errors
/// Files that cannot be written; `TooLarge` for a package beyond four gigabytes.
pub fn write(asset: &Asset, folder: &Path, sixteen_bits: bool) -> Result<(f64, Option<MetalSplit>)> {
    // Renderers interpolate between texels as they are written, and along the sRGB curve the mean of a bright and a dark one
    // comes out too dark. Sixteen bits hold colours in proportion; eight do not.
    let of_colours = if sixteen_bits { Curve::Linear } else { Curve::Srgb };
    let png = |texture: Texture, curve: Curve| texture.png(curve, sixteen_bits);
    let mut files = vec![("textures/diffuse.png", png(Texture::Rgb(&asset.maps.diffuse), of_colours)?)];
    let metals = asset.metals();
    let (mut held_share, mut lobe) = (0.0, None);
    if asset.has_lobe {
        let roughness = asset.perceptual_roughness();
        let (base_colour, held) = asset.base_colour_beside(metals.as_ref(), GRAZING_OF_HALF_VECTORS, Some(&roughness));
        held_share = held;
        let dielectric = asset.dielectric_beside(metals.as_ref());
        lobe = Some(Metalness { has_metals: metals.is_some(), tint_scale: dielectric.factor_over(LOW_IOR) });
        files.push(("textures/base_color.png", png(Texture::Rgb(&base_colour), of_colours)?));
        if let Some(split) = &metals {
            files.push(("textures/metallic.png", png(Texture::Grey(&split.metallic), Curve::Linear)?));
        }
        files.push(("textures/tint.png", png(Texture::Rgb(&dielectric.colour), of_colours)?));
        files.push(("textures/specular.png", png(Texture::Rgb(&asset.maps.specular), of_colours)?));
        files.push(("textures/roughness.png", png(Texture::Grey(&roughness), Curve::Linear)?));
    }
    for (name, bytes) in &files {
        write_bytes(&folder.join(name), bytes)?;
    }
    if let Some(light) = &asset.light {
        let name = "textures/environment.exr";
        write_exr_rgb(&folder.join(name), &smooth(&light.whole).radiance)?;
        let path = folder.join(name);
        files.push((name, std::fs::read(&path).map_err(|source| Error::reading(&path, source))?));
    }
    let stage = stage(asset, lobe, of_colours).into_bytes();
    let name = format!("{}.usda", asset.name);
    write_bytes(&folder.join(&name), &stage)?;
    let mut members: Vec<(&str, &[u8])> = vec![(&name, &stage)];
    members.extend(files.iter().map(|(name, bytes)| (*name, bytes.as_slice())));
    package(&folder.join(format!("{}.usdz", asset.name)), &members)?;
    Ok((held_share, metals))
}

/// What the metalness workflow holds where there is a lobe.
#[derive(Clone, Copy)]
struct Metalness {
    /// Whether there is a map of the share of metal; else there is none.
    has_metals: bool,
    /// What the texture of the tint is multiplied by.
    tint_scale: f32,
}

/// The stage as text; `lobe` is `None` without one, and colours are written by this curve.
fn stage(asset: &Asset, lobe: Option<Metalness>, of_colours: Curve) -> String {
    let name = &asset.name;
    let mesh = &asset.mesh;
    let mut text = format!(
        "#usda 1.0\n(\n    defaultPrim = \"{name}\"\n    doc = \"Written by Patina; see convention.txt\"\n    \
         metersPerUnit = {}\n    upAxis = \"Y\"\n)\n\ndef Xform \"{name}\" (\n    kind = \"component\"\n)\n{{\n",
        asset.unit_in_metres
    );
    let list = |values: &mut dyn Iterator<Item = String>| values.collect::<Vec<_>>().join(", ");
    let vectors = |values: &[glam::Vec3]| list(&mut values.iter().map(|v| format!("({}, {}, {})", v.x, v.y, v.z)));
    let (low, high) = mesh.bounds().unwrap_or_default();
    let lines = [
        "    def Mesh \"surface\" (\n        prepend apiSchemas = [\"MaterialBindingAPI\"]\n    )\n    {".to_string(),
        "        uniform bool doubleSided = 1".into(),
        format!("        float3[] extent = [{}]", vectors(&[low, high])),
        format!("        int[] faceVertexCounts = [{}]", list(&mut mesh.triangles.iter().map(|_| "3".into()))),
        format!(
            "        int[] faceVertexIndices = [{}]",
            list(&mut mesh.triangles.iter().flatten().map(u32::to_string))
        ),
        format!("        rel material:binding = </{name}/material>"),
        format!(
            "        normal3f[] normals = [{}] (\n            interpolation = \"vertex\"\n        )",
            vectors(&mesh.normals)
        ),
        format!("        point3f[] points = [{}]", vectors(&mesh.positions)),
        format!(
            "        texCoord2f[] primvars:st = [{}] (\n            interpolation = \"vertex\"\n        )",
            list(&mut mesh.uvs.iter().map(|uv| format!("({}, {})", uv.x, uv.y)))
        ),
        "        uniform token subdivisionScheme = \"none\"\n    }\n".into(),
    ];
    text.push_str(&lines.join("\n"));
    text.push_str(&material(&asset.name, lobe, of_colours));
    if asset.light.is_some() {
        text.push_str(
            "\n    def DomeLight \"environment\"\n    {\n        float inputs:intensity = 1\n        \
             asset inputs:texture:file = @textures/environment.exr@\n        \
             token inputs:texture:format = \"latlong\"\n    }\n",
        );
    }
    text.push_str("}\n");
    text
}

fn material(name: &str, lobe: Option<Metalness>, of_colours: Curve) -> String {
    let path = format!("/{name}/material");
    let variants = match lobe {
        Some(_) => {
            "\n        prepend variantSets = \"workflow\"\n        variants = {\n            string workflow = \"metalness\"\n        }\n    "
        }
        None => "",
    };
    let variants = if variants.is_empty() { String::new() } else { format!(" ({variants})") };
    let mut text = format!(
        "\n    def Material \"material\"{variants}\n    {{\n        token outputs:surface.connect = <{path}/surface.outputs:surface>\n\n        \
         def Shader \"surface\"\n        {{\n            uniform token info:id = \"UsdPreviewSurface\"\n"
    );
    match lobe {
        // What differs between the workflows stands in their variants.
        Some(_) => {
            let _ = writeln!(text, "            float inputs:roughness.connect = <{path}/roughness.outputs:r>");
        }
        None => {
            let _ = write!(
                text,
                "            color3f inputs:diffuseColor.connect = <{path}/diffuse.outputs:rgb>\n            \
                 float inputs:ior = 1\n            float inputs:roughness = 1\n            \
                 color3f inputs:specularColor = (0, 0, 0)\n            int inputs:useSpecularWorkflow = 1\n"
            );
        }
    }
    text.push_str(
        "            token outputs:surface\n        }\n\n        \
         def Shader \"coordinates\"\n        {\n            uniform token info:id = \"UsdPrimvarReader_float2\"\n            \
         string inputs:varname = \"st\"\n            float2 outputs:result\n        }\n",
    );
    let Some(lobe) = lobe else {
        return text + &texture(&path, "diffuse", Kind::Colour(of_colours), "        ") + "    }\n";
    };
    text += &texture(&path, "roughness", Kind::Value, "        ");
    let deep = "                ";
    let over = |lines: &[String]| {
        let lines: String = lines.iter().map(|line| format!("{deep}    {line}\n")).collect();
        format!("{deep}over \"surface\"\n{deep}{{\n{lines}{deep}}}\n")
    };
    let mut metalness = over(&[
        format!("color3f inputs:diffuseColor.connect = <{path}/base_color.outputs:rgb>"),
        format!("float inputs:ior = {LOW_IOR}"),
        match lobe.has_metals {
            true => format!("float inputs:metallic.connect = <{path}/metallic.outputs:r>"),
            false => "float inputs:metallic = 0".into(),
        },
        format!("color3f inputs:specularColor.connect = <{path}/tint.outputs:rgb>"),
        "int inputs:useSpecularWorkflow = 0".into(),
    ]) + &texture(&path, "base_color", Kind::Colour(of_colours), deep);
    if lobe.has_metals {
        metalness += &texture(&path, "metallic", Kind::Value, deep);
    }
    metalness += &texture(&path, "tint", Kind::Scaled(of_colours, lobe.tint_scale), deep);
    let specular = over(&[
        format!("color3f inputs:diffuseColor.connect = <{path}/diffuse.outputs:rgb>"),
        format!("color3f inputs:specularColor.connect = <{path}/specular.outputs:rgb>"),
        "int inputs:useSpecularWorkflow = 1".into(),
    ]) + &texture(&path, "diffuse", Kind::Colour(of_colours), deep)
        + &texture(&path, "specular", Kind::Colour(of_colours), deep);
    let _ = write!(
        text,
        "\n        variantSet \"workflow\" = {{\n            \"metalness\" {{\n{metalness}            }}\n            \
         \"specular\" {{\n{specular}            }}\n        }}\n    }}\n"
    );
    text
}

/// What a texture holds.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Colour(Curve),
    Value,
    /// A colour over this factor.
    Scaled(Curve, f32),
}

/// A node that reads `textures/MAP.png`.
fn texture(path: &str, map: &str, kind: Kind, indent: &str) -> String {
    let (space, output) = match kind {
        Kind::Colour(Curve::Srgb) | Kind::Scaled(Curve::Srgb, _) => ("sRGB", "float3 outputs:rgb"),
        Kind::Colour(Curve::Linear) | Kind::Scaled(Curve::Linear, _) => ("raw", "float3 outputs:rgb"),
        Kind::Value => ("raw", "float outputs:r"),
    };
    let lines = [
        "uniform token info:id = \"UsdUVTexture\"".to_string(),
        format!("asset inputs:file = @textures/{map}.png@"),
        format!("token inputs:sourceColorSpace = \"{space}\""),
        format!("float2 inputs:st.connect = <{path}/coordinates.outputs:result>"),
        "token inputs:wrapS = \"clamp\"".into(),
        "token inputs:wrapT = \"clamp\"".into(),
        output.into(),
    ];
    let scale = match kind {
        Kind::Scaled(_, scale) => vec![format!("float4 inputs:scale = ({scale}, {scale}, {scale}, 1)")],
        _ => Vec::new(),
    };
    let lines: String = lines.iter().chain(&scale).map(|line| format!("{indent}    {line}\n")).collect();
    format!("\n{indent}def Shader \"{map}\"\n{indent}{{\n{lines}{indent}}}\n")
}

/// A zip file without compression whose members begin at multiples of 64 bytes, as USD asks of a package.
fn package(path: &Path, members: &[(&str, &[u8])]) -> Result<()> {
    const ALIGNMENT: usize = 64;
    const LOCAL_HEADER: usize = 30;
    let total: usize = members.iter().map(|(name, bytes)| bytes.len() + 2 * name.len() + 256).sum();
    if u32::try_from(total).is_err() {
        return Err(Error::new(ErrorKind::TooLarge, "the maps outgrow the four gigabytes of a package")
            .remedy("write smaller maps with --size, or leave usd out of --to"));
    }
    let table = crc_table();
    write_atomically(path, |writer| {
        let mut directory = Vec::new();
        let mut at = 0usize;
        for (name, bytes) in members {
            let crc = crc32(&table, bytes);
            let padding = (ALIGNMENT - (at + LOCAL_HEADER + name.len() + 4) % ALIGNMENT) % ALIGNMENT;
            // Version, flags, method (stored), time and date (1 January 1980), checksum, sizes, length of the name.
            let mut common = Vec::new();
            common.extend([20u16, 0, 0, 0, 0x21].into_iter().flat_map(u16::to_le_bytes));
            common.extend([crc, bytes.len() as u32, bytes.len() as u32].into_iter().flat_map(u32::to_le_bytes));
            common.extend((name.len() as u16).to_le_bytes());
            writer.write_all(b"PK\x03\x04")?;
            writer.write_all(&common)?;
            writer.write_all(&(padding as u16 + 4).to_le_bytes())?;
            writer.write_all(name.as_bytes())?;
            // An extra field that only fills: an identifier of its own and its length.
            writer.write_all(&0x1986u16.to_le_bytes())?;
            writer.write_all(&(padding as u16).to_le_bytes())?;
            writer.write_all(&vec![0; padding])?;
            writer.write_all(bytes)?;
            directory.extend(b"PK\x01\x02\x14\x00");
            directory.extend(common);
            directory.extend([0u8; 12]);
            directory.extend((at as u32).to_le_bytes());
            directory.extend(name.as_bytes());
            at += LOCAL_HEADER + name.len() + 4 + padding + bytes.len();
        }
        writer.write_all(&directory)?;
        writer.write_all(b"PK\x05\x06\0\0\0\0")?;
        let count = (members.len() as u16).to_le_bytes();
        writer.write_all(&[count, count].concat())?;
        writer.write_all(&(directory.len() as u32).to_le_bytes())?;
        writer.write_all(&(at as u32).to_le_bytes())?;
        writer.write_all(&[0, 0])
    })
}

/// The table of the checksum of zip: the polynomial 0xEDB88320, bits reversed.
fn crc_table() -> [u32; 256] {
    std::array::from_fn(|byte| {
        (0..8).fold(byte as u32, |crc, _| if crc & 1 == 1 { (crc >> 1) ^ 0xEDB8_8320 } else { crc >> 1 })
    })
}

fn crc32(table: &[u32; 256], bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, &byte| table[((crc ^ u32::from(byte)) & 0xff) as usize] ^ (crc >> 8))
}

#[cfg(test)]
mod tests {
    use super::super::asset::tests::small_asset;
    use super::*;

    #[test]
    fn the_stage_names_every_texture_and_balances_its_braces() {
        let folder = tempfile::tempdir().unwrap();
        for (name, has_lobe, has_metals) in [("bare", false, false), ("paint", true, false), ("metal", true, true)] {
            let mut asset = small_asset(has_lobe);
            if has_metals {
                asset.maps.specular.pixels_mut()[..40].fill(Vec3::new(0.9, 0.7, 0.3));
            }
            let place = folder.path().join(name);
            assert_eq!(write(&asset, &place, true).unwrap().1.is_some(), has_metals);
            let text = std::fs::read_to_string(place.join("a_run.usda")).unwrap();
            assert!(!text.contains("\"sRGB\"") && text.contains("\"raw\""));
            assert_eq!(text.matches('{').count(), text.matches('}').count());
            assert_eq!(text.matches('(').count(), text.matches(')').count());
            assert!(text.contains("point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]"));
            assert!(text.contains("metersPerUnit = 1\n"));
            let small = stage(&Asset { unit_in_metres: 0.001, ..small_asset(has_lobe) }, None, Curve::Srgb);
            assert!(small.contains("metersPerUnit = 0.001\n"));
            assert!(text.contains("primvars:st = [(0.1, 0.1), "));
            assert!(text.contains("int inputs:useSpecularWorkflow = 1"));
            assert_eq!(text.contains("specularColor.connect"), has_lobe);
            assert_eq!(text.contains("string workflow = \"metalness\""), has_lobe);
            assert_eq!(text.contains("inputs:metallic = 0"), has_lobe && !has_metals);
            assert_eq!(text.matches("def Shader \"diffuse\"").count(), 1);
            assert_eq!(text.contains("specularColor = (0, 0, 0)"), !has_lobe);
            for reference in text.split('@').skip(1).step_by(2) {
                assert!(place.join(reference).is_file(), "{reference}");
            }
        }
    }

    #[test]
    fn members_of_a_package_are_aligned_and_whole() {
        assert_eq!(crc32(&crc_table(), b"123456789"), 0xCBF4_3926);
        let folder = tempfile::tempdir().unwrap();
        let asset = small_asset(true);
        write(&asset, folder.path(), false).unwrap();
        let bytes = std::fs::read(folder.path().join("a_run.usdz")).unwrap();
        let word = |at: usize| usize::from(u16::from_le_bytes([bytes[at], bytes[at + 1]]));
        let long = |at: usize| word(at) + (word(at + 2) << 16);
        let end = bytes.len() - 22;
        assert_eq!(&bytes[end..end + 4], b"PK\x05\x06");
        let (count, mut entry) = (word(end + 10), long(end + 16));
        assert_eq!((entry + long(end + 12), count), (end, 7));
        for _ in 0..count {
            assert_eq!(&bytes[entry..entry + 4], b"PK\x01\x02");
            let (size, name_length, local) = (long(entry + 24), word(entry + 28), long(entry + 42));
            let name = std::str::from_utf8(&bytes[entry + 46..entry + 46 + name_length]).unwrap();
            let data = local + 30 + word(local + 26) + word(local + 28);
            assert_eq!(data % 64, 0, "{name}");
            let on_disk = std::fs::read(folder.path().join(name)).unwrap();
            assert_eq!(&bytes[data..data + size], on_disk, "{name}");
            entry += 46 + name_length;
        }
    }
}
