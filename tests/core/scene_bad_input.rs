//! Bad input: each gives an error of the right kind with file, line or byte and a remedy, and costs no memory.

#![allow(clippy::unwrap_used, clippy::disallowed_methods)]

use super::scene_fixture::*;
use patina::image::{Image, file};
use patina::math::random::SequentialRandom;
use patina::scene::settings::{PixelCentre, Up};
use patina::scene::{ReadSettings, read, read_mesh};
use patina::{Error, ErrorKind, Place};
use std::path::Path;

/// Checks kind and text of an error, and that it says where and what to do.
fn assert_error(error: &Error, kind: ErrorKind, says: &str) {
    let text = error.to_string();
    assert_eq!(error.kind(), kind, "{text}");
    assert!(text.contains(says), "'{says}' is not in: {text}");
    assert!(!error.remedy_text().is_empty(), "no remedy: {text}");
    assert_ne!(*error.place(), Place::Nowhere, "no place: {text}");
}

/// Writes a file anew. Cutting an old one to nothing would make some file systems flush the disk each time.
fn put(path: impl AsRef<Path>, content: impl AsRef<[u8]>) -> std::io::Result<()> {
    let _ = std::fs::remove_file(&path);
    std::fs::write(path, content)
}

fn mesh_error(name: &str, content: &[u8]) -> Error {
    let (_keep, folder) = folder();
    let path = folder.join(name);
    put(&path, content).unwrap();
    read_mesh(&path).unwrap_err()
}

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

#[test]
fn bad_obj_files_are_named_by_line() {
    let cases = [
        ("f 0 1 2", ErrorKind::Malformed, "line 4: index 0 is not a vertex"),
        ("f 1 2 4", ErrorKind::Malformed, "line 4: vertex 4 of 3"),
        ("f 1 2 -4", ErrorKind::Malformed, "line 4: vertex -4 of 3"),
        ("f 1/x 2/2 3/3", ErrorKind::Malformed, "line 4: '1/x' is not an index"),
        ("f 1/1/1/1 2 3", ErrorKind::Malformed, "line 4: '1/1/1/1' has too many slashes"),
        ("f 1 2", ErrorKind::Malformed, "line 4: no face of the OBJ file has three corners"),
        ("f 1 2 x", ErrorKind::Malformed, "line 4: 'x' is not an index"),
        ("f 1 2 99999999999999999999", ErrorKind::Malformed, "line 4:"),
        ("v 1 2\nf 1 2 3", ErrorKind::Malformed, "line 4: fewer than 3 numbers"),
        ("v 1.0 2 3,5\nf 1 2 3", ErrorKind::Malformed, "line 4: '3,5' is not a number"),
        ("v 1 nan 3\nf 1 2 4", ErrorKind::NonFinite, "line 4: vertex 4"),
        ("v 1 1e300 3\nf 1 2 4", ErrorKind::NonFinite, "line 4: vertex 4"),
        ("", ErrorKind::Malformed, "no faces"),
    ];
    for line_end in ["\n", "\r\n"] {
        for (end, kind, says) in cases {
            assert_error(
                &mesh_error("a.obj", format!("{TRIANGLE}{end}").replace('\n', line_end).as_bytes()),
                kind,
                says,
            );
        }
    }
    assert_error(&mesh_error("a.obj", b""), ErrorKind::Malformed, "no faces");
    assert_error(&mesh_error("a.fbx", b"solid"), ErrorKind::Unsupported, ".fbx");
    assert_error(&read_mesh(Path::new("/nowhere/a.obj")).unwrap_err(), ErrorKind::Missing, "no mesh file");
}

fn ply(format: &str, vertices: &str, faces: &str) -> String {
    format!(
        "ply\nformat {format} 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {faces}\nproperty list uchar int vertex_indices\nend_header\n"
    )
}

#[test]
fn bad_ply_files_are_named_by_line_or_byte() {
    let points = "0 0 0\n1 0 0\n0 1 0\n";
    let ascii = |points: &str, faces: &str| {
        mesh_error("a.ply", format!("{}{points}{faces}", ply("ascii", "3", "1")).as_bytes())
    };
    assert_error(&ascii(points, "3 0 1 3\n"), ErrorKind::Malformed, "line 13: face 0 names vertex 3 of 3");
    assert_error(&ascii(points, "3 0 1 -1\n"), ErrorKind::Malformed, "face 0 names vertex -1 of 3");
    assert_error(&ascii(points, "2 0 1\n"), ErrorKind::Malformed, "line 13: no face of the PLY file has three corners");
    assert_error(&ascii("0 0 0\n1 inf 0\n0 1 0\n", "3 0 1 2\n"), ErrorKind::NonFinite, "line 11");
    assert_error(&ascii("0 0 0\n1 zero 0\n0 1 0\n", "3 0 1 2\n"), ErrorKind::Malformed, "line 11");
    assert_error(&ascii("0 0 0\n1 0 0\n", ""), ErrorKind::Malformed, "");
    assert_error(&mesh_error("a.ply", b""), ErrorKind::Malformed, "header");
    assert_error(&mesh_error("a.ply", b"plyx\nrubbish"), ErrorKind::Malformed, "header");
    assert_error(&mesh_error("a.ply", b"ply\nformat ascii 1.0\n"), ErrorKind::Malformed, "header");
    assert_error(
        &mesh_error("a.ply", format!("{}{points}", ply("ascii", "3", "0")).as_bytes()),
        ErrorKind::Malformed,
        "no faces",
    );

    // Short binary data, and headers that claim what the file cannot hold.
    let mut binary = ply("binary_little_endian", "3", "1").into_bytes();
    binary.extend([0; 36]);
    let header = binary.len() - 36;
    assert_error(&mesh_error("a.ply", &binary[..header + 20]), ErrorKind::Malformed, &format!("byte {}", header + 20));
    binary.extend([3, 0, 0, 0, 0]);
    assert_error(&mesh_error("a.ply", &binary), ErrorKind::Malformed, "ends within the 1 elements 'face'");
    let mut not_a_number = binary[..header + 36].to_vec();
    not_a_number.extend([3, 0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0]);
    not_a_number[header + 12..header + 16].copy_from_slice(&f32::NAN.to_le_bytes());
    assert_error(&mesh_error("a.ply", &not_a_number), ErrorKind::NonFinite, "vertex 1 is at [NaN, 0, 0]");
    for (vertices, faces) in [("1000000000", "1"), ("3", "4000000000"), ("18446744073709551615", "1")] {
        for format in ["ascii", "binary_big_endian"] {
            let mut lying = ply(format, vertices, faces).into_bytes();
            lying.extend([b'0'; 60]);
            assert_error(&mesh_error("a.ply", &lying), ErrorKind::Malformed, "");
        }
    }
    let empty_elements = "ply\nformat binary_little_endian 1.0\nelement nothing 9000000000000\nend_header\n";
    assert_error(
        &mesh_error("a.ply", empty_elements.as_bytes()),
        ErrorKind::Malformed,
        "claims 9000000000000 elements 'nothing'",
    );
    let long_list = "ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uint int vertex_indices\nend_header\n";
    let mut bytes = long_list.as_bytes().to_vec();
    bytes.extend([0; 12]);
    bytes.extend([0xff; 4]);
    assert_error(&mesh_error("a.ply", &bytes), ErrorKind::Malformed, "ends within");
}

#[test]
fn damaged_mesh_files_never_panic() {
    let (_keep, folder) = folder();
    let mut binary = ply("binary_little_endian", "3", "1").into_bytes();
    binary.extend((0..36).map(|i| i * 3));
    binary.extend([3, 0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0]);
    let obj = format!("{TRIANGLE}vt 0 0\nvn 0 0 1\nusemtl a\nf 1/1/1 2/1/1 3/1/1\nf -3 -2 -1\n").into_bytes();
    let mut random = SequentialRandom::new(7);
    let mut refused = 0;
    for (name, content) in [("a.ply", &binary), ("a.obj", &obj)] {
        for _ in 0..400 {
            let mut damaged = content.clone();
            for _ in 0..=random.below(4) {
                let place = random.below(damaged.len());
                damaged[place] = random.below(256) as u8;
            }
            damaged.truncate(1 + random.below(damaged.len()));
            let path = folder.join(name);
            put(&path, &damaged).unwrap();
            refused += usize::from(read_mesh(&path).is_err());
        }
    }
    assert!(refused > 400, "{refused} of 800");
}

/// A small BlendedMVS folder, then a change to it; the error of reading it.
fn folder_error(change: impl FnOnce(&Path)) -> Error {
    let (_keep, folder) = copy_of(&BLENDED_MVS);
    change(&folder);
    read(&folder, &ReadSettings { pixel_centre: PixelCentre::Integer, up: Up::Y, ..Default::default() }).unwrap_err()
}

#[test]
fn bad_camera_files_are_named_by_line() {
    let edited = |from: &'static str, to: &'static str| {
        folder_error(|folder| {
            let path = folder.join("cams/00000001_cam.txt");
            let text = std::fs::read_to_string(&path).unwrap();
            assert!(text.contains(from));
            put(&path, text.replace(from, to)).unwrap();
        })
    };
    assert_error(&edited("extrinsic\n", "extrinsic\nnan "), ErrorKind::NonFinite, "00000001_cam.txt, line 2");
    assert_error(&edited("extrinsic\n", "extrinsic\n0,5 "), ErrorKind::Malformed, "line 2: '0,5' is not a number");
    assert_error(&edited("extrinsic", "extrinsics"), ErrorKind::Malformed, "line 1: the word 'extrinsic' is missing");
    assert_error(&edited("0.0 0.0 0.0 1.0", "0.0 0.0 5.0 1.0"), ErrorKind::InvalidScene, "transposed");
    assert_error(&edited("\n0.0 0.0 1.0\n", "\n0.0 0.0 -1.0\n"), ErrorKind::InvalidScene, "the intrinsics are not");
    let truncated = folder_error(|folder| {
        let path = folder.join("cams/00000000_cam.txt");
        let text = std::fs::read_to_string(&path).unwrap();
        put(&path, &text[..90]).unwrap();
    });
    assert_error(&truncated, ErrorKind::Malformed, "the file ends before the extrinsic matrix");
    assert_error(
        &folder_error(|folder| put(folder.join("cams/00000000_cam.txt"), "").unwrap()),
        ErrorKind::Malformed,
        "line 1",
    );
    assert_error(
        &folder_error(|folder| put(folder.join("cams/00000000_cam.txt"), [0; 9]).unwrap()),
        ErrorKind::Malformed,
        "byte 0: the file is not text",
    );
    let scaled = folder_error(|folder| {
        let mut camera = ring(2)[1];
        camera.rotation_camera_from_world *= 1.25;
        write(&folder.join("cams/00000001_cam.txt"), &cam_text(&camera, &FolderStyle::default()));
    });
    assert_error(&scaled, ErrorKind::InvalidScene, "off a rotation by 5.63e-1");
}

#[test]
fn what_is_missing_is_said_at_once() {
    let bare = folder_error(|folder| {
        std::fs::remove_dir_all(folder.join("textured_mesh")).unwrap();
        std::fs::remove_dir_all(folder.join("cams")).unwrap();
    });
    assert_error(&bare, ErrorKind::Missing, "the cameras: cams/*_cam.txt; the mesh: textured_mesh/*.obj");
    let without_mesh = |folder: &Path| std::fs::remove_dir_all(folder.join("textured_mesh")).unwrap();
    let error = folder_error(without_mesh);
    assert_error(&error, ErrorKind::Missing, "no mesh was found");
    assert!(error.remedy_text().contains("separate download") && error.remedy_text().contains("--mesh"), "{error}");
    let (_keep, elsewhere) = copy_of(&BLENDED_MVS);
    let mesh = vec![elsewhere.join("cams/other.obj")];
    std::fs::rename(elsewhere.join("textured_mesh/mesh.obj"), &mesh[0]).unwrap();
    read(&elsewhere, &ReadSettings { mesh, ..Default::default() }).unwrap();
    let none = folder_error(|folder| {
        for name in ["00000000", "00000001"] {
            std::fs::remove_file(folder.join(format!("cams/{name}_cam.txt"))).unwrap();
        }
    });
    assert_error(&none, ErrorKind::Missing, "no photo has a camera");
    let (_keep, empty) = folder();
    assert_error(&read(&empty, &ReadSettings::default()).unwrap_err(), ErrorKind::Unsupported, "not a scene");
    assert_error(
        &read(Path::new("/nowhere"), &ReadSettings::default()).unwrap_err(),
        ErrorKind::Missing,
        "no such folder",
    );
    let bad_setting = read(&empty, &ReadSettings { shrink: 0, ..Default::default() }).unwrap_err();
    assert_error(&bad_setting, ErrorKind::InvalidSetting, "setting --downsample");
}

#[test]
fn photos_and_cameras_that_stand_alone_are_left_out_with_a_finding() {
    let (_keep, folder) = folder();
    write_blended_mvs(&folder, &scene(4), &FolderStyle::default());
    std::fs::remove_file(folder.join("cams/00000002_cam.txt")).unwrap();
    std::fs::remove_file(folder.join("blended_images/00000003.png")).unwrap();
    let scene = read(&folder, &ReadSettings { pixel_centre: PixelCentre::Integer, ..Default::default() }).unwrap();
    assert_eq!(scene.views.len(), 2);
    for (code, place) in [("photo-without-camera", "00000002.png"), ("camera-without-photo", "00000003_cam.txt")] {
        let finding = scene.findings.iter().find(|finding| finding.code == code).unwrap();
        assert!(finding.place.contains(place) && !finding.remedy.is_empty(), "{finding}");
    }
    assert!(scene.views.iter().all(|view| !view.held_out), "two views are too few to hold one out");
}

#[test]
fn bad_photos_and_masks_are_named() {
    let photo = "blended_images/00000001.png";
    let truncated = folder_error(|folder| {
        let bytes = std::fs::read(folder.join(photo)).unwrap();
        put(folder.join(photo), &bytes[..bytes.len() / 2]).unwrap();
    });
    assert_error(&truncated, ErrorKind::Malformed, "00000001.png");
    assert_error(&folder_error(|folder| put(folder.join(photo), b"").unwrap()), ErrorKind::Malformed, "00000001.png");
    let other_size = folder_error(|folder| {
        file::write_png_srgb8(&folder.join("masks/00000001.png"), &Image::filled(64, 48, [255; 3])).unwrap();
    });
    assert_error(&other_size, ErrorKind::InvalidScene, "the mask is 64 x 48 but the photo is 128 x 96");
    let twice = folder_error(|folder| {
        std::fs::copy(folder.join(photo), folder.join("blended_images/00000001.jpeg")).unwrap();
    });
    assert_error(&twice, ErrorKind::InvalidScene, "two photos are named '00000001'");
}

/// A small exchange folder, then a change to it; the error of reading it.
fn exchange_error(change: impl FnOnce(&Path)) -> Error {
    let (_keep, folder) = copy_of(&EXCHANGE);
    change(&folder);
    read(&folder, &ReadSettings::default()).unwrap_err()
}

#[test]
fn bad_exchange_folders_and_manifests_are_named() {
    let json = "cameras.json";
    let edited = |from: &'static str, to: &'static str| {
        exchange_error(|folder| {
            let text = std::fs::read_to_string(folder.join(json)).unwrap();
            assert!(text.contains(from), "{text}");
            put(folder.join(json), text.replace(from, to)).unwrap();
        })
    };
    assert_error(&edited("\"w2c\"", "\"w2d\""), ErrorKind::Malformed, "cameras.json, line 1");
    assert_error(
        &edited("\"width\":128", "\"width\":256"),
        ErrorKind::InvalidScene,
        "the photo is 128 x 96 but its camera is for 256 x 96",
    );
    assert_error(&edited("opencv", "blender"), ErrorKind::Unsupported, "'blender'");
    assert_error(&edited("\"file\"", "\"distortion\":[0.1],\"file\""), ErrorKind::Unsupported, "distortion");
    assert_error(&edited("00000001.exr", "00000000.exr"), ErrorKind::InvalidScene, "two views are named '00000000'");
    assert_error(
        &exchange_error(|folder| put(folder.join(json), r#"{"views": []}"#).unwrap()),
        ErrorKind::InvalidScene,
        "no views",
    );
    assert_error(
        &exchange_error(|folder| std::fs::remove_file(folder.join("mesh.obj")).unwrap()),
        ErrorKind::Missing,
        "mesh.obj",
    );
    assert_error(
        &exchange_error(|folder| std::fs::remove_file(folder.join("views/00000001.exr")).unwrap()),
        ErrorKind::Missing,
        "00000001.exr",
    );
    assert_error(
        &exchange_error(|folder| put(folder.join("scene.json"), "{").unwrap()),
        ErrorKind::Malformed,
        "scene.json, line 1",
    );
    let map = |width| Image::filled(width, 4, glam::Vec3::ONE);
    let truth = exchange_error(|folder| {
        for (name, width) in [("diffuse", 8), ("specular", 16), ("env", 8)] {
            file::write_exr_rgb(&folder.join(format!("{name}.exr")), &map(width)).unwrap();
        }
        file::write_exr_grey(&folder.join("roughness.exr"), &map(8).map(|pixel| pixel.x)).unwrap();
    });
    assert_error(&truth, ErrorKind::InvalidScene, "the map is 16 x 4, diffuse.exr is 8 x 4");

    let manifest = |text: &'static str| exchange_error(|folder| put(folder.join("scene.toml"), text).unwrap());
    assert_error(
        &manifest("mesh = \"mesh.obj\"\nimages = \"views\"\ncamera = \"cameras.json\"\n"),
        ErrorKind::Malformed,
        "scene.toml, line",
    );
    assert_error(
        &manifest("mesh = \"mesh.obj\"\nimages = \"photos\"\ncameras = \"cameras.json\"\n"),
        ErrorKind::Missing,
        "photos",
    );
    assert_error(
        &manifest("mesh = \"none.obj\"\nimages = \"views\"\ncameras = \"cameras.json\"\n"),
        ErrorKind::Missing,
        "none.obj",
    );
    assert_error(
        &manifest("mesh = \"mesh.obj\"\nimages = \"views\"\ncameras = \"cams\"\n"),
        ErrorKind::Missing,
        "the cameras named in scene.toml",
    );
}
