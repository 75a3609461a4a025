//! glTF and GLB as programs write them: transforms, extensions, buffers, what is left out and what is refused.

#![allow(clippy::unwrap_used, clippy::disallowed_methods)]

use super::scene_fixture::folder;
use super::scene_meshes::{area, has};
use patina::scene::{Mesh, read_mesh};
use patina::{ErrorKind, Finding};

fn read(content: &[u8]) -> (Mesh, Vec<Finding>) {
    super::scene_meshes::read("a.glb", content)
}

/// A GLB file of one node: `json` with the length of the binary part in the place of `LENGTH`.
fn glb(json: &str, binary: &[u8]) -> Vec<u8> {
    let mut json = json.replace("LENGTH", &binary.len().to_string()).into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut binary = binary.to_vec();
    binary.resize(binary.len().next_multiple_of(4), 0);
    let mut file = b"glTF\x02\0\0\0".to_vec();
    file.extend((12 + 8 + json.len() as u32 + 8 + binary.len() as u32).to_le_bytes());
    for (kind, part) in [(b"JSON", &json), (b"BIN\0", &binary)] {
        file.extend((part.len() as u32).to_le_bytes());
        file.extend(kind);
        file.extend(part);
    }
    file
}

const GLTF: &str = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],
    "nodes":[{"children":[1],"translation":[500000,0,4000000]},{"mesh":0,"scale":[-2,2,2]}],
    "meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1},{"attributes":{"POSITION":0},"mode":1}]}],
    "buffers":[{"byteLength":LENGTH}],
    "bufferViews":[{"buffer":0,"byteOffset":0,"byteLength":48},{"buffer":0,"byteOffset":48,"byteLength":12}],
    "accessors":[{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3","min":[0,0,0],"max":[1,1,1]},
    {"bufferView":1,"componentType":5123,"count":6,"type":"SCALAR"}]}"#;

fn gltf_data() -> Vec<u8> {
    let points: [[f32; 3]; 4] = [[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.]];
    let mut data: Vec<u8> = points.iter().flatten().flat_map(|number| number.to_le_bytes()).collect();
    data.extend([0u16, 1, 2, 0, 2, 3].iter().flat_map(|corner| corner.to_le_bytes()));
    data
}

#[test]
fn gltf_is_read_with_its_transforms_and_damaged_ones_are_refused() {
    let (mesh, findings) = read(&glb(GLTF, &gltf_data()));
    assert_eq!((mesh.triangles.len(), mesh.positions.len(), area(&mesh)), (2, 4, 4.0));
    assert!(has(&findings, "mesh-lines-dropped"), "{findings:?}");
    // The mirror of the scale is undone: the square still faces +z.
    assert!(mesh.area_vector(0).z > 0.0);

    let whole = glb(GLTF, &gltf_data());
    let short = glb(GLTF, &gltf_data()[..40]);
    let beyond = {
        let mut data = gltf_data();
        data[48] = 9;
        glb(GLTF, &data)
    };
    for damaged in [&whole[..whole.len() - 20], &whole[..30], &short, &beyond] {
        let (_keep, folder) = folder();
        let path = folder.join("a.glb");
        std::fs::write(&path, damaged).unwrap();
        let error = read_mesh(&path).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Malformed, "{error}");
        assert!(!error.remedy_text().is_empty());
    }
}

#[test]
fn extensions_of_gltf_matter_only_where_they_change_the_geometry() {
    let requiring = |name: &str, of_texture: &str| {
        let head = format!(r#"{{"extensionsRequired":["{name}"],"extensionsUsed":["{name}"],{of_texture}"#);
        glb(&GLTF.replacen('{', &head, 1), &gltf_data())
    };
    let texture = r#""textures":[{"extensions":{"EXT_texture_webp":{"source":0}}}],"images":[{"uri":"a.webp"}],
        "materials":[{"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}],"#;
    for (name, texture) in [("KHR_materials_unlit", ""), ("KHR_lights_punctual", ""), ("EXT_texture_webp", texture)] {
        assert_eq!(read(&requiring(name, texture)).0.triangles.len(), 2, "{name}");
    }
    for (name, what) in [
        ("KHR_draco_mesh_compression", "compressed"),
        ("EXT_meshopt_compression", "compressed"),
        ("EXT_mesh_gpu_instancing", "EXT_mesh_gpu_instancing"),
    ] {
        let (_keep, folder) = folder();
        std::fs::write(folder.join("a.glb"), requiring(name, "")).unwrap();
        let error = read_mesh(&folder.join("a.glb")).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Unsupported);
        assert!(error.message().contains(what) && error.remedy_text().contains("without"), "{error}");
    }
    // Corners as bytes, a share of the largest.
    let bytes = GLTF.replacen(r#""componentType":5126"#, r#""componentType":5121,"normalized":true"#, 1);
    let bytes = bytes.replacen(r#""byteLength":48}"#, r#""byteLength":16,"byteStride":4}"#, 1).replacen(
        r#"{"asset""#,
        r#"{"extensionsRequired":["KHR_mesh_quantization"],"extensionsUsed":["KHR_mesh_quantization"],"asset""#,
        1,
    );
    let mut data = gltf_data();
    data[..16].copy_from_slice(&[0, 0, 0, 0, 255, 0, 0, 0, 255, 255, 0, 0, 0, 255, 0, 0]);
    assert_eq!(area(&read(&glb(&bytes, &data)).0), 4.0);
}

#[test]
fn buffers_of_gltf_are_found_by_names_with_escapes() {
    for (uri, name) in [("a%28b%29%20%C3%A9.bin", "a(b) \u{e9}.bin"), ("100%.bin", "100%.bin"), ("%41.bin", "%41.bin")]
    {
        let (_keep, folder) = folder();
        let json = GLTF.replace("LENGTH", "60").replacen(
            r#""byteLength":60"#,
            &format!(r#""byteLength":60,"uri":"{uri}""#),
            1,
        );
        std::fs::write(folder.join("a.gltf"), json).unwrap();
        let error = read_mesh(&folder.join("a.gltf")).unwrap_err();
        assert!(error.remedy_text().contains("beside"), "{error}");
        std::fs::write(folder.join(name), gltf_data()).unwrap();
        assert_eq!(read_mesh(&folder.join("a.gltf")).unwrap().0.triangles.len(), 2, "{name}");
    }
}

#[test]
fn texture_coordinates_of_one_material_are_kept_and_of_several_told() {
    let part = r#"{"attributes":{"POSITION":0,"TEXCOORD_0":2},"indices":1,"material":M}"#;
    let view = r#""byteLength":12},{"buffer":0,"byteOffset":60,"byteLength":32}"#;
    let accessor = r#""type":"SCALAR"},{"bufferView":2,"componentType":5126,"count":4,"type":"VEC2"}"#;
    let uvs: [[f32; 2]; 4] = [[0., 1.], [1., 1.], [1., 0.], [0., 0.]];
    let data = [gltf_data(), uvs.iter().flatten().flat_map(|number| number.to_le_bytes()).collect()].concat();
    let with = |parts: &str| {
        let start = GLTF.find("\"primitives\":[").unwrap() + "\"primitives\":[".len();
        let end = GLTF.find("]}],\n    \"buffers\"").unwrap();
        let json = format!("{}{parts}{}", &GLTF[..start], &GLTF[end..]);
        let json = json.replacen(r#""byteLength":12}"#, view, 1).replacen(r#""type":"SCALAR"}"#, accessor, 1);
        read(&glb(&json.replacen('{', r#"{"materials":[{},{}],"#, 1), &data))
    };
    let (mesh, findings) = with(&part.replace('M', "0"));
    assert_eq!((mesh.uvs.len(), mesh.uvs[0].to_array()), (4, [0.0, 0.0]), "v grows upwards here");
    assert!(!has(&findings, "mesh-uvs-dropped"));
    let plain = r#"{"attributes":{"POSITION":0},"indices":1,"material":0}"#;
    for second in [part.replace('M', "1"), plain.to_owned()] {
        let (mesh, findings) = with(&format!("{},{second}", part.replace('M', "0")));
        assert!(mesh.uvs.is_empty() && has(&findings, "mesh-uvs-dropped"), "{findings:?}");
    }
}
