//! One GLB file: mesh, material and textures, and the sun where the light has one.
//!
//! Laid out by the glTF 2.0 specification with `KHR_materials_ior`, `KHR_materials_specular` and `KHR_lights_punctual`
//! as ratified. F0 is `((ior - 1) / (ior + 1))^2` times factor and texture of the specular colour, so that no reader needs an
//! index of zero.

use super::asset::Asset;
use super::asset::reflectance::{GRAZING_OF_HALF_VECTORS, LOW_IOR, MetalSplit};
use super::texture::{Curve, Texture};
use crate::error::{Error, ErrorKind, Result};
use crate::image::Image;
use crate::scene::Mesh;
use glam::{Quat, Vec3};
use serde_json::{Value, json};

/// The bytes of a GLB file and what was lost on the way.
pub struct Glb {
    /// The file.
    pub bytes: Vec<u8>,
    /// Share of texels whose diffuse reflectance would have had to exceed 1.
    pub held_share: f64,
    /// Base colour and metalness, where the surface has metals.
    pub metals: Option<MetalSplit>,
}

/// Parts of the binary chunk, each at a multiple of four bytes.
#[derive(Default)]
struct Binary {
    bytes: Vec<u8>,
    views: Vec<Value>,
}

impl Binary {
    /// Adds a part and gives the index of its view; `target` is 34962 for vertices, 34963 for indices.
    fn add(&mut self, part: &[u8], target: Option<u32>) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let mut view = json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": part.len()});
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        self.bytes.extend(part);
        self.views.push(view);
        self.views.len() - 1
    }
}

/// Makes the file. Textures are PNG of 16 bits or 8.
///
/// # Errors
/// `TooLarge` when the file would outgrow the 32-bit lengths of its format.
pub fn glb(asset: &Asset, sixteen_bits: bool) -> Result<Glb> {
    let mut binary = Binary::default();
    let accessors = accessors_of(&asset.mesh, &mut binary);

    // The material.
    let metals = asset.metals();
    let roughness = asset.perceptual_roughness();
    let (base_colour, held_share) =
        asset.base_colour_beside(metals.as_ref(), GRAZING_OF_HALF_VECTORS, Some(&roughness));
    let mut metallic_roughness = roughness.map(|&roughness| Vec3::new(1.0, roughness, 0.0));
    if let Some(split) = &metals {
        metallic_roughness.pixels_mut().iter_mut().zip(split.metallic.pixels()).for_each(|(rgb, metal)| rgb.z = *metal);
    }
    let mut images = Vec::new();
    let mut texture = |map: &Image<Vec3>, curve: Curve, name: &str, binary: &mut Binary| -> Result<Value> {
        let view = binary.add(&Texture::Rgb(map).png(curve, sixteen_bits)?, None);
        images.push(json!({"bufferView": view, "mimeType": "image/png", "name": name}));
        Ok(json!({"index": images.len() - 1}))
    };
    let base_colour = texture(&base_colour, Curve::Srgb, "base_colour", &mut binary)?;
    let metallic_roughness = texture(&metallic_roughness, Curve::Linear, "metallic_roughness", &mut binary)?;
    let mut extensions_used = vec!["KHR_materials_specular"];
    let material_extensions = if asset.has_lobe {
        extensions_used.push("KHR_materials_ior");
        let dielectric = asset.dielectric_beside(metals.as_ref());
        // Beyond 1, which the extension allows: F0 is the lesser of 1 and the product.
        let factor = dielectric.factor_over(LOW_IOR);
        let colour = texture(&dielectric.colour, Curve::Srgb, "specular_colour", &mut binary)?;
        json!({
            "KHR_materials_ior": {"ior": LOW_IOR},
            "KHR_materials_specular": {
                "specularFactor": 1.0, "specularColorFactor": [factor, factor, factor], "specularColorTexture": colour},
        })
    } else {
        json!({"KHR_materials_specular": {"specularFactor": 0.0}})
    };
    let textures: Vec<Value> = (0..images.len()).map(|image| json!({"sampler": 0, "source": image})).collect();

    // The scene: the surface, and the sun as a light that shines along -z of its node.
    let mut nodes = vec![json!({"mesh": 0, "name": asset.name})];
    // glTF is in metres; what it has no unit for stays as it is.
    if asset.unit_in_metres != 1.0 {
        nodes[0]["scale"] = json!(vec![asset.unit_in_metres; 3]);
    }
    let mut document_extensions = json!({});
    if let Some(sun) = asset.light.as_ref().and_then(|light| light.sun.as_ref()) {
        extensions_used.push("KHR_lights_punctual");
        let strength = sun.irradiance.max_element();
        let colour = (sun.irradiance / strength).to_array();
        document_extensions["KHR_lights_punctual"] =
            json!({"lights": [{"type": "directional", "name": "sun", "color": colour, "intensity": strength}]});
        let rotation = Quat::from_rotation_arc(Vec3::Z, sun.towards).to_array();
        nodes.push(json!({"name": "sun", "rotation": rotation,
            "extensions": {"KHR_lights_punctual": {"light": 0}}}));
    }
    let document = json!({
        "asset": {"version": "2.0", "generator": concat!("Patina ", env!("CARGO_PKG_VERSION"))},
        "extensionsUsed": extensions_used,
        "extensions": document_extensions,
        "scene": 0,
        "scenes": [{"nodes": (0..nodes.len()).collect::<Vec<_>>()}],
        "nodes": nodes,
        "meshes": [{"name": asset.name, "primitives": [{
            "attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2}, "indices": 3, "material": 0}]}],
        "materials": [{
            "name": asset.name,
            "doubleSided": true,
            "pbrMetallicRoughness": {
                "baseColorTexture": base_colour, "metallicRoughnessTexture": metallic_roughness,
                "metallicFactor": if metals.is_some() { 1.0 } else { 0.0 }, "roughnessFactor": 1.0},
            "extensions": material_extensions,
        }],
        "samplers": [{"magFilter": 9729, "minFilter": 9987, "wrapS": 33071, "wrapT": 33071}],
        "textures": textures,
        "images": images,
        "accessors": accessors,
        "bufferViews": binary.views,
        "buffers": [{"byteLength": binary.bytes.len().next_multiple_of(4)}],
    });
    Ok(Glb { bytes: container(without_empty(document), binary.bytes)?, held_share, metals })
}

/// Lists without entries are not allowed.
fn without_empty(mut document: Value) -> Value {
    if let Some(object) = document.as_object_mut() {
        object.retain(|_, value| !value.as_object().is_some_and(|inner| inner.is_empty()));
    }
    document
}

fn accessors_of(mesh: &Mesh, binary: &mut Binary) -> Vec<Value> {
    const VERTICES: Option<u32> = Some(34962);
    const INDICES: Option<u32> = Some(34963);
    let count = mesh.positions.len();
    let words = |values: &mut dyn Iterator<Item = f32>| values.flat_map(f32::to_le_bytes).collect::<Vec<u8>>();
    let positions = words(&mut mesh.positions.iter().flat_map(|p| p.to_array()));
    let unit = |normal: &Vec3| normal.try_normalize().unwrap_or(Vec3::Y).to_array();
    let normals = words(&mut mesh.normals.iter().flat_map(unit));
    // v points down in glTF.
    let uvs = words(&mut mesh.uvs.iter().flat_map(|uv| [uv.x, 1.0 - uv.y]));
    let indices: Vec<u8> = mesh.triangles.iter().flatten().flat_map(|index| index.to_le_bytes()).collect();
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    mesh.positions.iter().for_each(|&p| (low, high) = (low.min(p), high.max(p)));
    vec![
        json!({"bufferView": binary.add(&positions, VERTICES), "componentType": 5126, "count": count, "type": "VEC3",
            "min": low.to_array(), "max": high.to_array()}),
        json!({"bufferView": binary.add(&normals, VERTICES), "componentType": 5126, "count": count, "type": "VEC3"}),
        json!({"bufferView": binary.add(&uvs, VERTICES), "componentType": 5126, "count": count, "type": "VEC2"}),
        json!({"bufferView": binary.add(&indices, INDICES), "componentType": 5125,
            "count": 3 * mesh.triangles.len(), "type": "SCALAR"}),
    ]
}

/// The binary container: twelve bytes of header, a chunk of JSON filled with spaces, a chunk of bytes filled with zeros.
fn container(document: Value, mut binary: Vec<u8>) -> Result<Vec<u8>> {
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    binary.resize(binary.len().next_multiple_of(4), 0);
    let length = 12 + 8 + text.len() + 8 + binary.len();
    let length = u32::try_from(length).map_err(|_| {
        Error::new(ErrorKind::TooLarge, "the maps outgrow the four gigabytes of a GLB file")
            .remedy("write smaller maps with --size, or leave glb out of --to")
    })?;
    let mut file = Vec::with_capacity(length as usize);
    file.extend(b"glTF");
    file.extend(2u32.to_le_bytes());
    file.extend(length.to_le_bytes());
    for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &binary)] {
        file.extend((chunk.len() as u32).to_le_bytes());
        file.extend(kind);
        file.extend(chunk);
    }
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::super::asset::tests::small_asset;
    use super::*;
    use crate::image::file;

    /// JSON and binary chunk of a file.
    fn parts(bytes: &[u8]) -> (Value, &[u8]) {
        let long = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        assert_eq!(&bytes[..4], b"glTF");
        assert_eq!((long(4), long(8)), (2, bytes.len()));
        let json_length = long(12);
        assert_eq!((&bytes[16..20], json_length % 4), (b"JSON".as_slice(), 0));
        let at = 20 + json_length;
        assert_eq!((&bytes[at + 4..at + 8], at + 8 + long(at)), (b"BIN\0".as_slice(), bytes.len()));
        (serde_json::from_slice(&bytes[20..at]).unwrap(), &bytes[at + 8..])
    }

    fn view<'a>(document: &Value, binary: &'a [u8], index: usize) -> &'a [u8] {
        let view = &document["bufferViews"][index];
        let number = |key: &str| view[key].as_u64().unwrap() as usize;
        assert_eq!(number("byteOffset") % 4, 0);
        &binary[number("byteOffset")..number("byteOffset") + number("byteLength")]
    }

    /// F0 where the texture of the specular colour is white.
    fn largest_f0(material: &Value) -> f32 {
        let ior = material["extensions"]["KHR_materials_ior"]["ior"].as_f64().unwrap();
        let factor = material["extensions"]["KHR_materials_specular"]["specularColorFactor"][0].as_f64().unwrap();
        (super::super::asset::reflectance::f0_of(ior) * factor) as f32
    }

    #[test]
    fn what_is_written_is_what_a_reader_finds() {
        let asset = small_asset(true);
        let file = glb(&asset, true).unwrap();
        let (document, binary) = parts(&file.bytes);
        let floats = |index: usize| -> Vec<f32> {
            let accessor = &document["accessors"][index];
            let bytes = view(&document, binary, accessor["bufferView"].as_u64().unwrap() as usize);
            bytes.chunks_exact(4).map(|word| f32::from_le_bytes(word.try_into().unwrap())).collect()
        };
        let positions: Vec<f32> = asset.mesh.positions.iter().flat_map(|p| p.to_array()).collect();
        assert_eq!(floats(0), positions);
        assert_eq!(floats(2)[..2], [0.1, 1.0 - 0.1]);
        assert_eq!(document["accessors"][0]["max"], json!([1.0, 1.0, 0.0]));
        let indices = view(&document, binary, document["accessors"][3]["bufferView"].as_u64().unwrap() as usize);
        let first: Vec<u32> = indices.chunks_exact(4).map(|w| u32::from_le_bytes(w.try_into().unwrap())).collect();
        assert_eq!(first, [0, 1, 2, 0, 2, 3]);

        // Textures decode to the maps, and F0 of a reader is that of the map.
        let folder = tempfile::tempdir().unwrap();
        let image = |name: &str| {
            let images = document["images"].as_array().unwrap();
            let image = images.iter().find(|image| image["name"] == name).unwrap();
            let path = folder.path().join("image.png");
            let bytes = view(&document, binary, image["bufferView"].as_u64().unwrap() as usize);
            crate::files::write_bytes(&path, bytes).unwrap();
            file::read_rgb(&path).unwrap()
        };
        let material = &document["materials"][0];
        let f0 = largest_f0(material);
        for (read, own) in image("specular_colour").pixels().iter().zip(asset.maps.specular.pixels()) {
            assert!((*read * f0 - *own).abs().max_element() < 1e-4, "{read} {own}");
        }
        let roughness = image("metallic_roughness").map(|rgb| crate::image::transfer::srgb_from_linear(rgb.y));
        for (read, own) in roughness.pixels().iter().zip(asset.perceptual_roughness().pixels()) {
            assert!((read - own).abs() < 1e-4, "{read} {own}");
        }
        assert_eq!(material["pbrMetallicRoughness"]["metallicFactor"], 0.0);
    }

    #[test]
    fn the_sun_shines_from_where_it_stands() {
        let asset = small_asset(true);
        let sun = asset.light.as_ref().unwrap().sun.as_ref().unwrap();
        let bytes = glb(&asset, false).unwrap().bytes;
        let (document, _) = parts(&bytes);
        assert!(document["nodes"][0]["scale"].is_null());
        let small = glb(&Asset { unit_in_metres: 0.5, ..small_asset(true) }, false).unwrap().bytes;
        assert_eq!(parts(&small).0["nodes"][0]["scale"], json!([0.5, 0.5, 0.5]), "glTF is in metres");
        let rotation: Vec<f32> = document["nodes"][1]["rotation"]
            .as_array()
            .unwrap()
            .iter()
            .map(|number| number.as_f64().unwrap() as f32)
            .collect();
        let shines_along = Quat::from_slice(&rotation) * Vec3::NEG_Z;
        assert!((shines_along + sun.towards).length() < 1e-5);
        let light = &document["extensions"]["KHR_lights_punctual"]["lights"][0];
        assert!((light["intensity"].as_f64().unwrap() as f32 - sun.irradiance.max_element()).abs() < 1e-3);
    }

    #[test]
    fn metals_are_written_as_metals() {
        let mut asset = small_asset(true);
        (0..64).for_each(|index| {
            asset.maps.specular.pixels_mut()[index] = Vec3::new(0.9, 0.7, 0.3);
            asset.maps.diffuse.pixels_mut()[index] = Vec3::ZERO;
        });
        let file = glb(&asset, true).unwrap();
        let (document, _) = parts(&file.bytes);
        let material = &document["materials"][0];
        assert_eq!(material["pbrMetallicRoughness"]["metallicFactor"], 1.0);
        assert!((largest_f0(material) - 0.08).abs() < 1e-5, "{}", largest_f0(material));
        let split = file.metals.unwrap();
        assert!(split.metallic.pixels()[..64].iter().all(|metal| *metal > 0.99));
        assert!(split.metallic.pixels()[64..].iter().all(|metal| *metal == 0.0));
        assert!((split.specular_colour[(9, 9)] * 0.08 - asset.maps.specular[(9, 9)]).length() < 1e-5);
    }

    #[test]
    fn a_surface_without_a_lobe_says_so() {
        let mut asset = small_asset(false);
        asset.light = None;
        let bytes = glb(&asset, false).unwrap().bytes;
        let (document, _) = parts(&bytes);
        let extensions = &document["materials"][0]["extensions"];
        assert_eq!(extensions["KHR_materials_specular"]["specularFactor"], 0.0);
        assert!(extensions.get("KHR_materials_ior").is_none() && document.get("extensions").is_none());
        assert_eq!(document["nodes"].as_array().unwrap().len(), 1);
    }
}
