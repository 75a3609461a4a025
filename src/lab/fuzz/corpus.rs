//! Small whole files of every kind that is read: what is damaged.
//!
//! Pictures are written by the program's own writers or by the crates it reads with, the rest is text. A scene has three
//! photos and a mesh beside it, so that what its reader lists can be read on.

mod scenes;

use crate::error::{Error, ErrorKind, Result};
use crate::image::{Image, RgbImage, file, transfer};
use crate::scene::read::numpy;
use crate::scene::read::zip::packed;
use std::io::Cursor;
use std::path::Path;

/// How the files of a kind are opened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Opening {
    /// As a mesh.
    Mesh,
    /// As a photo, and as a mask.
    Photo,
    /// As a scene: the whole folder.
    Scene,
}

/// A file that is damaged.
pub struct Target {
    /// Its path in the folder of the kind.
    pub path: String,
    /// What is damaged: the file, or what is packed in it.
    pub whole: Vec<u8>,
    /// What makes the file of it.
    pub wrap: fn(&[u8]) -> Vec<u8>,
}

/// A kind of input.
pub struct Kind {
    /// Its name.
    pub name: &'static str,
    /// How it is opened.
    pub opening: Opening,
    /// Files that stay whole, beside the targets.
    pub others: Vec<(String, Vec<u8>)>,
    /// Files of which one is damaged at a time.
    pub targets: Vec<Target>,
}

fn as_is(bytes: &[u8]) -> Vec<u8> {
    bytes.to_vec()
}

fn target(path: &str, whole: impl Into<Vec<u8>>) -> Target {
    Target { path: path.into(), whole: whole.into(), wrap: as_is }
}

const CUBE_OBJ: &str = "# two faces of a cube\nmtllib a.mtl\nv 0 0 0\nv 1 0 0 0.5 0.5 0.5\nv 1 1 0\nv 0 1 0\nv .5 0.5 1.\nvt 0 0\n\
vt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\nusemtl stone\nf 1/1/1 2/2/1 3/3/1 4/4/1\nf -1 -2 -3\nf 1 2 5 # a comment\nl 1 2 3\np 1\n";
const PLY_TEXT: &str = "ply\nformat ascii 1.0\ncomment made by hand\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
property uchar red\nelement face 3\nproperty list uchar int vertex_indices\nend_header\n0 0 0 9\n1 0 0 9\n0 1 0 9\n0 0 1 9\n3 0 1 2\n3 0 1 3\n3 1 2 3\n";
const STL_TEXT: &str = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n\
facet normal 0 0 1\nouter loop\nvertex 0 0 1\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n";
const GLTF: &str = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0,"translation":[0,0,1]}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1,"mode":4}]}],
"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]},
{"bufferView":1,"componentType":5123,"count":3,"type":"SCALAR"}],
"bufferViews":[{"buffer":0,"byteOffset":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":6}],"buffers":[{"byteLength":44BUFFER}]}"#;

/// Two triangles and the corners of a third as bytes: 36 of positions, 6 of indices, 2 of nothing.
fn gltf_buffer() -> Vec<u8> {
    let positions: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let mut buffer: Vec<u8> = positions.iter().flat_map(|value| value.to_le_bytes()).collect();
    [0u16, 1, 2, 0].iter().for_each(|index| buffer.extend(index.to_le_bytes()));
    buffer
}

fn glb() -> Vec<u8> {
    let mut json = GLTF.replace("BUFFER", "").into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let buffer = gltf_buffer();
    let mut bytes = b"glTF".to_vec();
    let word = |bytes: &mut Vec<u8>, value: usize| bytes.extend((value as u32).to_le_bytes());
    word(&mut bytes, 2);
    word(&mut bytes, 28 + json.len() + buffer.len());
    word(&mut bytes, json.len());
    bytes.extend(b"JSON");
    bytes.extend(json);
    word(&mut bytes, buffer.len());
    bytes.extend(b"BIN\0");
    bytes.extend(buffer);
    bytes
}

fn ply_binary() -> Vec<u8> {
    let mut bytes = b"ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
element face 2\nproperty list uchar uint vertex_indices\nend_header\n"
        .to_vec();
    let positions: [f32; 12] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    positions.iter().for_each(|value| bytes.extend(value.to_le_bytes()));
    for face in [[0u32, 1, 2], [0, 1, 3]] {
        bytes.push(3);
        face.iter().for_each(|index| bytes.extend(index.to_le_bytes()));
    }
    bytes
}

fn stl_binary() -> Vec<u8> {
    let mut bytes = vec![b' '; 80];
    bytes.extend(2u32.to_le_bytes());
    for z in [0.0f32, 1.0] {
        let values = [0.0, 0.0, 1.0, 0.0, 0.0, z, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        values.iter().for_each(|value: &f32| bytes.extend(value.to_le_bytes()));
        bytes.extend([0, 0]);
    }
    bytes
}

fn picture() -> Image<[u8; 3]> {
    Image::from_fn(12, 9, |row, column| [row as u8 * 25, column as u8 * 20, (row * column) as u8])
}

fn linear() -> RgbImage {
    picture().map(|pixel| transfer::linear_from_srgb8(*pixel) * 3.0)
}

/// What a writer of files writes.
fn written(write: impl FnOnce(&Path) -> Result<()>) -> Result<Vec<u8>> {
    let path = std::env::temp_dir().join(format!("patina-corpus-{}", std::process::id()));
    write(&path)?;
    let bytes = std::fs::read(&path).map_err(|source| Error::reading(&path, source));
    let _ = std::fs::remove_file(&path);
    bytes
}

fn unwritten(error: impl std::fmt::Display) -> Error {
    Error::new(ErrorKind::Internal, format!("a file of the corpus cannot be written: {error}"))
}

fn tiff() -> Result<Vec<Vec<u8>>> {
    use tiff::encoder::{Compression, TiffEncoder, colortype};
    let bytes = picture().pixels().as_flattened().to_vec();
    let words: Vec<u16> = bytes.iter().map(|byte| u16::from(*byte) * 257).collect();
    let floats: Vec<f32> = bytes.iter().map(|byte| f32::from(*byte)).collect();
    let mut files = Vec::new();
    let mut add = |write: &dyn Fn(&mut Cursor<Vec<u8>>) -> tiff::TiffResult<()>| -> Result<()> {
        let mut file = Cursor::new(Vec::new());
        write(&mut file).map_err(unwritten)?;
        files.push(file.into_inner());
        Ok(())
    };
    add(&|file| TiffEncoder::new(file)?.write_image::<colortype::RGB8>(12, 9, &bytes))?;
    add(&|file| {
        let encoder = TiffEncoder::new(file)?.with_compression(Compression::Deflate(Default::default()));
        { encoder }.write_image::<colortype::RGB16>(12, 9, &words)
    })?;
    add(&|file| {
        let encoder = TiffEncoder::new(file)?.with_compression(Compression::Lzw);
        { encoder }.write_image::<colortype::RGB32Float>(12, 9, &floats)
    })?;
    Ok(files)
}

/// Photos with a whole file of each of the formats.
fn photos() -> Result<Vec<Kind>> {
    let kind = |name, extension: &str, files: Vec<Vec<u8>>| {
        let targets = files.into_iter().enumerate().map(|(index, file)| target(&format!("{index}.{extension}"), file));
        Kind { name, opening: Opening::Photo, others: Vec::new(), targets: targets.collect() }
    };
    let jpeg = file::encode_jpeg(&picture(), 80)?;
    let exif: &[u8] = b"\xff\xe1\0\x22Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0";
    let turned = [&jpeg[..2], exif, &jpeg[2..]].concat();
    let float_map =
        [b"PF\n5 4\n-1.0\n".to_vec(), (0..60).flat_map(|own| (own as f32).to_le_bytes()).collect()].concat();
    let flat = [b"#?RADIANCE\nEXPOSURE=2\nFORMAT=32-bit_rle_xyze\n\n+X 5 -Y 4\n".to_vec(), vec![99; 80]].concat();
    let old = b"#?RGBE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 5\n\x10\x20\x30\x80\x01\x01\x01\x04".to_vec();
    let grey = linear().map(|pixel| pixel.y);
    Ok(vec![
        kind("png", "png", vec![file::encode_png_srgb8(&picture())?]),
        kind("jpeg", "jpg", vec![jpeg, turned]),
        kind("tiff", "tif", tiff()?),
        kind(
            "exr",
            "exr",
            vec![
                written(|path| file::write_exr_rgb(path, &linear()))?,
                written(|path| file::write_exr_grey(path, &grey))?,
            ],
        ),
        kind("hdr", "hdr", vec![written(|path| file::write_hdr(path, &linear()))?, flat, old]),
        kind("pfm", "pfm", vec![float_map]),
    ])
}

fn meshes() -> Vec<Kind> {
    let kind = |name, targets| Kind { name, opening: Opening::Mesh, others: Vec::new(), targets };
    let mut gltf =
        kind("gltf", vec![target("a.gltf", GLTF.replace("BUFFER", ",\"uri\":\"a.bin\"")), target("b.glb", glb())]);
    gltf.others.push(("a.bin".into(), gltf_buffer()));
    vec![
        kind("obj", vec![target("a.obj", CUBE_OBJ)]),
        kind("ply", vec![target("a.ply", PLY_TEXT), target("b.ply", ply_binary())]),
        kind("stl", vec![target("a.stl", STL_TEXT), target("b.stl", stl_binary())]),
        gltf,
    ]
}

/// Names of the photos of a scene.
pub const PHOTOS: [&str; 3] = ["a.png", "b.png", "c.png"];

/// A scene of a tool: a mesh, photos in a folder of this name, and the files that are damaged.
fn scene(name: &'static str, images: &str, targets: Vec<Target>) -> Result<Kind> {
    let mut others = vec![("mesh.ply".to_owned(), PLY_TEXT.as_bytes().to_vec())];
    let photo = file::encode_png_srgb8(&picture())?;
    others.extend(PHOTOS.map(|name| (format!("{images}{name}"), photo.clone())));
    Ok(Kind { name, opening: Opening::Scene, others, targets })
}

fn doc(bytes: &[u8]) -> Vec<u8> {
    packed(&[("doc.xml", bytes)])
}

/// Scenes of every format.
fn scenes() -> Result<Vec<Kind>> {
    use scenes as own;
    let mut blended = scene(
        "blended-mvs",
        "blended_images/",
        PHOTOS.map(|name| target(&format!("cams/{}_cam.txt", name.trim_end_matches(".png")), own::CAM_TXT)).into(),
    )?;
    blended.others[0].0 = "textured_mesh/mesh.ply".into();
    let mut manifest = scene(
        "manifest",
        "photos/",
        vec![target("scene.toml", own::MANIFEST), target("cameras.json", own::CAMERAS_JSON)],
    )?;
    manifest.others.push(("cams/a_cam.txt".into(), own::CAM_TXT.into()));
    let mut exchange = scene("exchange", "views/", vec![target("cameras.json", own::EXCHANGE)])?;
    exchange.others[0] = ("mesh.obj".into(), CUBE_OBJ.into());
    let colmap = |extension: &str, cameras: Vec<u8>, images: Vec<u8>| {
        vec![
            target(&format!("sparse/0/cameras.{extension}"), cameras),
            target(&format!("sparse/0/images.{extension}"), images),
        ]
    };
    let mut project = scene("metashape-project", "", own::metashape_project())?;
    project.targets.iter_mut().filter(|own| own.path.ends_with(".zip")).for_each(|own| own.wrap = doc);
    project.targets.push(target("p.files/0/chunk.zip", doc(own::METASHAPE_CHUNK.as_bytes())));
    let mut neus = scene("neus", "image/", vec![own::neus_target()])?;
    neus.targets[0].wrap = |bytes| {
        packed(&[
            ("world_mat_0.npy", bytes),
            ("world_mat_1.npy", bytes),
            ("world_mat_2.npy", bytes),
            ("scale_mat_0.npy", bytes),
        ])
    };
    let mut lighting = scene(
        "objects-with-lighting",
        "",
        (0..PHOTOS.len()).map(|number| target(&format!("test/inputs/camera_000{number}.txt"), own::LIGHTING)).collect(),
    )?;
    // Photos and masks go by the numbers of their cameras.
    let photos = lighting.others.drain(1..).enumerate();
    let photos: Vec<_> =
        photos.map(|(number, (_, photo))| (format!("test/inputs/image_000{number}.png"), photo)).collect();
    lighting.others.push(("test/inputs/mask_0001.png".into(), photos[1].1.clone()));
    lighting.others.extend(photos);
    let side = |name: &str| target(&name.replace(".png", ".xmp"), own::XMP);
    Ok(vec![
        blended,
        manifest,
        exchange,
        scene("colmap-text", "images/", colmap("txt", own::COLMAP_CAMERAS.into(), own::COLMAP_IMAGES.into()))?,
        scene("colmap-binary", "images/", colmap("bin", own::colmap_cameras(), own::colmap_images()))?,
        scene("transforms", "", vec![target("transforms.json", own::TRANSFORMS)])?,
        scene("metashape-xml", "", vec![target("cameras.xml", own::METASHAPE_XML)])?,
        project,
        scene("realitycapture-xmp", "", PHOTOS.map(side).into())?,
        scene("realitycapture-csv", "", vec![target("cameras.csv", own::CSV)])?,
        scene("bundler", "", vec![target("bundle.out", own::bundle()), target("list.txt", "a.png\nb.png\nc.png\n")])?,
        scene("openmvs", "images/", vec![target("scene.mvs", own::openmvs())])?,
        scene("opensfm", "images/", vec![target("reconstruction.json", own::OPENSFM)])?,
        scene("alicevision", "", vec![target("sfm.json", own::ALICEVISION)])?,
        neus,
        lighting,
        scene("llff", "images/", vec![target("poses_bounds.npy", numpy::written(&[3, 17], &own::llff_rows()))])?,
    ])
}

/// All kinds.
///
/// # Errors
/// When a picture cannot be written.
pub fn kinds() -> Result<Vec<Kind>> {
    Ok(meshes().into_iter().chain(photos()?).chain(scenes()?).collect())
}
