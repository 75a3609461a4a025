//! Round trips: a scene written as each kind of folder is read back as it was.

#![allow(clippy::unwrap_used, clippy::disallowed_methods)]

use super::scene_fixture::*;
use glam::{Mat3, Vec3};
use patina::error::Place;
use patina::image::{Image, file};
use patina::scene::read::understand;
use patina::scene::settings::{MaskUse, PixelCentre, Up};
use patina::scene::{Camera, Mesh, Photo, PixelState, ReadSettings, Scene, read, read_mesh};
use std::path::{Path, PathBuf};

fn assert_same_cameras(read: &Scene, written: &Scene) {
    assert_eq!(read.views.len(), written.views.len());
    for (read, written) in read.views.iter().zip(&written.views) {
        let (a, b) = (&read.camera, &written.camera);
        assert_eq!(read.name, written.name);
        assert_eq!((a.width, a.height), (b.width, b.height));
        assert!((a.position_in_world() - b.position_in_world()).length() < 1e-4, "{}", read.name);
        assert!((a.forward_in_world() - b.forward_in_world()).length() < 1e-5);
        assert!((a.centre_pixels - b.centre_pixels).length() < 1e-4, "{} {}", a.centre_pixels, b.centre_pixels);
        assert!((a.focal_pixels - b.focal_pixels).length() < 1e-3);
    }
}

fn has(scene: &Scene, code: &str) -> bool {
    scene.findings.iter().any(|finding| finding.code == code)
}

#[test]
fn a_blended_mvs_folder_is_read_in_either_pixel_convention_and_any_up_axis() {
    let written = scene(8);
    for (centre_shift, convention, last_line) in [(-0.5, "(0, 0)", "2.0 0.01"), (0.0, "(0.5, 0.5)", "2.0 0.01 192 9.0")]
    {
        let (_keep, folder) = folder();
        let style = FolderStyle { centre_shift, source_from_world: z_up(), last_line, ..Default::default() };
        write_blended_mvs(&folder, &written, &style);
        let scene = read(&folder, &ReadSettings::default()).unwrap();
        let measured = scene.findings.iter().find(|finding| finding.code == "pixel-centre-measured").unwrap();
        assert!(measured.message.contains(&format!("at {convention}: ")), "{measured}");
        assert!(scene.findings.iter().any(|f| f.code == "up-estimated" && f.message.starts_with("up is Z ")));
        assert_same_cameras(&scene, &written);
        assert_eq!(scene.views.iter().filter(|view| view.held_out).count(), 1);
        assert_eq!(scene.views[3].photo, written.views[3].photo);
        assert_eq!(scene.views[3].states, written.views[3].states);
        // The seam of each ball repeats no vertex, but each pole is one point of many normals.
        assert_eq!(scene.mesh.triangles.len(), written.mesh.triangles.len());
        for index in (0..scene.mesh.triangles.len()).step_by(97) {
            let (a, b) = (scene.mesh.corners(index), written.mesh.corners(index));
            assert!((0..3).all(|corner| (a[corner] - b[corner]).length() < 1e-5));
        }
    }
}

#[test]
fn a_wrong_convention_that_is_asked_for_is_kept() {
    let (_keep, folder) = folder();
    let written = scene(4);
    write_blended_mvs(&folder, &written, &FolderStyle::default());
    let settings = ReadSettings { pixel_centre: PixelCentre::Half, up: Up::X, hold_out_every: 0, ..Default::default() };
    let scene = read(&folder, &settings).unwrap();
    assert_eq!(scene.views[0].camera.centre_pixels, written.views[0].camera.centre_pixels - 0.5);
    let up = scene.world_from_source.rotation * glam::DVec3::X;
    assert!((up - glam::DVec3::Y).length() < 1e-12);
    assert!(scene.views.iter().all(|view| !view.held_out));
}

#[test]
fn a_download_is_read_nested_with_twins_pieces_and_windows_line_ends() {
    let (_keep, root) = folder();
    let folder = root.join("5a3ca9cb/5a3ca9cb");
    let written = scene(4);
    write_blended_mvs(&folder, &written, &FolderStyle { line_end: "\r\n", ..Default::default() });
    std::fs::remove_dir_all(folder.join("masks")).unwrap();
    for view in &written.views {
        let Photo::Srgb8(bytes) = &view.photo else { unreachable!() };
        let twin = Image::from_fn(SIZE.0, SIZE.1, |row, column| {
            if view.states[(row, column)].is_surface() { bytes[(row, column)] } else { [0; 3] }
        });
        file::write_png_srgb8(&folder.join(format!("blended_images/{}_masked.png", view.name)), &twin).unwrap();
    }
    write(&folder.join("cams/pair.txt"), "4\r\n0\r\n2 1 9.5 3 8.0\r\n1\r\n1 0 9.5\r\n2\r\n0\r\n3\r\n1 7 8.0\r\n");
    write(&folder.join("rendered_depth_maps/00000000.pfm"), "not read");
    // The mesh in two pieces that share an edge; each piece has its own vertices and texture coordinates.
    std::fs::remove_file(folder.join("textured_mesh/mesh.obj")).unwrap();
    let uv = "vt 0 0\r\nvt 1 0\r\nvt 0 1\r\n";
    let piece = |third: &str| {
        format!("mtllib none.mtl\r\nv 0 0 0\r\nv 0 2 0\r\nv {third}\r\n{uv}usemtl a\r\nf 1/1 2/2 3/3\r\n")
    };
    write(&folder.join("textured_mesh/mesh_000.obj"), &piece("2 0 0"));
    write(&folder.join("textured_mesh/mesh_001.obj"), &piece("-2 0 0"));

    let settings = ReadSettings { pixel_centre: PixelCentre::Integer, ..Default::default() };
    let scene = read(&root, &settings).unwrap();
    assert_eq!(scene.name, "5a3ca9cb");
    assert_same_cameras(&scene, &written);
    assert_eq!((scene.mesh.positions.len(), scene.mesh.triangles.len()), (4, 2), "the shared edge is joined");
    assert!(scene.mesh.uvs.is_empty() && scene.mesh.normals.len() == 4);
    for code in ["masks-from-twins", "depth-maps-ignored", "mesh-pieces", "mesh-normals-computed", "pairs-invalid"] {
        assert!(has(&scene, code), "{code} is not among {:?}", scene.findings);
    }
    let (states, truth) = (&scene.views[1].states, &written.views[1].states);
    let wrong = states.pixels().iter().zip(truth.pixels()).filter(|(a, b)| a.is_surface() != b.is_surface()).count();
    assert_eq!(wrong, 0, "the twins give the masks back");
    let ignored = read(&root, &ReadSettings { masks: MaskUse::Ignore, ..settings }).unwrap();
    assert!(ignored.views[1].states.pixels().iter().all(|state| state.is_surface()));
}

#[test]
fn an_exchange_folder_is_read_with_truth_and_bad_pixels_are_set_aside() {
    let (_keep, folder) = folder();
    let written = scene(5);
    write_exchange(&folder, &written);
    let mut bad = written.views[2].photo.to_linear();
    bad[(7, 9)] = Vec3::new(0.1, f32::NAN, 0.0);
    bad[(8, 9)] = Vec3::new(f32::INFINITY, 0.0, 0.0);
    bad[(9, 9)] = Vec3::new(-0.25, 0.5, 0.0);
    file::write_exr_rgb(&folder.join("views/00000002.exr"), &bad).unwrap();
    let map = Image::from_fn(8, 4, |row, column| Vec3::new(row as f32, column as f32, 1.0) / 8.0);
    for name in ["diffuse", "specular", "env", "env_heldout"] {
        file::write_exr_rgb(&folder.join(format!("{name}.exr")), &map).unwrap();
    }
    file::write_exr_grey(&folder.join("roughness.exr"), &map.map(|pixel| pixel.x)).unwrap();
    file::write_exr_grey(&folder.join("texel_seen.exr"), &map.map(|pixel| f32::from(u8::from(pixel.x > 0.2)))).unwrap();
    file::write_exr_rgb(&folder.join("relight/00000003.exr"), &written.views[3].photo.to_linear()).unwrap();

    let scene = read(&folder, &ReadSettings::default()).unwrap();
    assert_same_cameras(&scene, &written);
    assert_eq!(scene.views[1].photo.to_linear(), written.views[1].photo.to_linear());
    let view = &scene.views[2];
    assert_eq!(
        [view.states[(7, 9)], view.states[(8, 9)], view.states[(9, 9)]],
        [PixelState::Ignored, PixelState::Ignored, PixelState::Surface]
    );
    assert_eq!([view.photo.radiance(7, 9), view.photo.radiance(9, 9)], [Vec3::ZERO, Vec3::new(0.0, 0.5, 0.0)]);
    let finding = scene.findings.iter().find(|finding| finding.code == "photo-not-finite").unwrap();
    assert!(finding.place.contains("00000002, pixel row 7 column 9") && finding.message.starts_with("2 "), "{finding}");
    let truth = scene.truth.unwrap();
    assert_eq!((truth.max_bounces, truth.maps.diffuse.width()), (2, 8));
    assert_eq!(truth.texels_seen.pixels().iter().filter(|seen| **seen).count(), 16);
    let relight = truth.relight.unwrap();
    assert_eq!(relight.pictures.len(), 1);
    assert_eq!(relight.pictures[0].0, 3);
}

#[test]
fn shrinking_and_taking_fewer_views_keep_cameras_and_photos_together() {
    let (_keep, folder) = folder();
    let written = scene(8);
    write_blended_mvs(&folder, &written, &FolderStyle::default());
    let settings = ReadSettings { shrink: 2, max_views: 4, ..Default::default() };
    let scene = read(&folder, &settings).unwrap();
    let names: Vec<_> = scene.views.iter().map(|view| view.name.as_str()).collect();
    assert_eq!(names, ["00000000", "00000002", "00000004", "00000006"]);
    assert!(has(&scene, "pixel-centre-measured"));
    for (small, large) in scene.views.iter().zip(written.views.iter().step_by(2)) {
        assert_eq!((small.camera.width, small.photo.width(), small.states.height()), (64, 64, 48));
        // A point falls on half the coordinates.
        let point = Vec3::new(0.3, 1.2, -0.2);
        let (place, _) = small.camera.project(point).unwrap();
        let (full, _) = large.camera.project(point).unwrap();
        assert!((place * 2.0 - full).length() < 1e-2, "{place} {full}");
        let mean = (0..4).map(|i| large.photo.radiance(20 + i / 2, 30 + i % 2)).sum::<Vec3>() / 4.0;
        assert!((small.photo.radiance(10, 15) - mean).length() < 1e-3);
    }
}

/// Writes the scene for a manifest, cameras as OpenGL `world_from_camera`.
fn write_for_manifest(folder: &Path, written: &Scene) {
    for view in &written.views {
        let Photo::Srgb8(bytes) = &view.photo else { unreachable!() };
        file::write_png_srgb8(&folder.join(format!("photos/{}.png", view.name)), bytes).unwrap();
        let camera = &view.camera;
        // The rows of the inverse of turn * [R | t], with turn = diag(1, -1, -1).
        let turn = Mat3::from_diagonal(Vec3::new(1.0, -1.0, -1.0));
        let inverse = (turn * camera.rotation_camera_from_world).transpose();
        let as_if = Camera {
            rotation_camera_from_world: inverse,
            translation_camera_from_world: camera.position_in_world(),
            ..*camera
        };
        write(
            &folder.join(format!("poses/{}_cam.txt", view.name)),
            &cam_text(&as_if, &FolderStyle { centre_shift: 0.0, ..Default::default() }),
        );
    }
    let mut inside_out = written.mesh.clone();
    inside_out.triangles.iter_mut().for_each(|corners| corners.swap(0, 1));
    inside_out.normals.iter_mut().for_each(|normal| *normal = -*normal);
    write(&folder.join("scan.obj"), &obj_text(&inside_out, &FolderStyle::default()));
}

#[test]
fn a_manifest_names_each_part_and_turns_what_it_says() {
    let (_keep, folder) = folder();
    let written = scene(4);
    write_for_manifest(&folder, &written);
    let text = r#"
        name = "two balls"
        mesh = "scan.obj"
        images = "photos"
        cameras = "poses"
        camera_axes = "opengl"
        camera_matrix = "world_from_camera"
        pixel_centre = "half"
        up = "Y"
        unit_in_metres = 0.01
        held_out = ["00000002", "nobody"]
        flip_winding = true
    "#;
    write(&folder.join("scene.toml"), text);
    let scene = read(&folder, &ReadSettings::default()).unwrap();
    assert_eq!(scene.name, "two balls");
    assert_eq!(scene.world_from_source.unit_in_metres, Some(0.01));
    let settings = ReadSettings { unit_in_metres: Some(0.5), ..Default::default() };
    assert_eq!(read(&folder, &settings).unwrap().world_from_source.unit_in_metres, Some(0.5), "what is typed wins");
    write(&folder.join("scene.toml"), &text.replace("0.01", "0"));
    let error = read(&folder, &ReadSettings::default()).unwrap_err();
    assert_eq!(error.place(), &Place::Line(folder.join("scene.toml"), 10), "{error}");
    write(&folder.join("scene.toml"), text);
    assert_same_cameras(&scene, &written);
    assert_eq!(scene.views.iter().map(|view| view.held_out).collect::<Vec<_>>(), [false, false, true, false]);
    assert!(has(&scene, "held-out-unknown"));
    let report = patina::scene::doctor::check(&scene);
    assert!(!report.is_fatal(), "{:?}", report.findings);
    assert!(report.views.iter().all(|view| view.back_face_share == 0.0 && view.opposed_normal_share < 0.01));
    // The manifest itself may be named.
    assert_eq!(read(&folder.join("scene.toml"), &ReadSettings::default()).unwrap().views.len(), 4);
    // Held-out lists do not starve the fit.
    write(&folder.join("scene.toml"), &text.replace("\"nobody\"", "\"00000000\", \"00000001\", \"00000003\""));
    assert!(read(&folder, &ReadSettings::default()).unwrap_err().message().contains("held out"));
}

#[test]
fn ply_is_read_in_all_encodings_and_types() {
    let (_keep, folder) = folder();
    // A pyramid: a quad, which becomes two triangles, and four triangles.
    let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.5, 0.5, 0.75f64]];
    let faces: [&[u32]; 5] = [&[3, 2, 1, 0], &[0, 1, 4], &[1, 2, 4], &[2, 3, 4], &[3, 0, 4]];
    let header = |format: &str, float: &str, index: &str| {
        format!(
            "ply\nformat {format} 1.0\ncomment made here\nelement vertex 5\nproperty {float} x\nproperty {float} y\nproperty {float} z\n\
             property uchar red\nelement face 5\nproperty list uchar {index} vertex_indices\nend_header\n"
        )
    };
    let mut expected = None;
    let mut check = |name: &str, bytes: &[u8]| {
        let path = folder.join(name);
        std::fs::write(&path, bytes).unwrap();
        let (mesh, _) = read_mesh(&path).unwrap();
        assert_eq!((mesh.positions.len(), mesh.triangles.len(), mesh.normals.len()), (5, 6, 5), "{name}");
        assert_eq!(mesh.triangles[..2], [[0, 3, 2], [0, 2, 1]]);
        assert_eq!(*expected.get_or_insert(mesh.clone()), mesh, "{name}");
    };
    for line_end in ["\n", "\r\n"] {
        let mut text = header("ascii", "float", "int");
        points.iter().for_each(|p| text += &format!("{} {} {} 200\n", p[0], p[1], p[2]));
        faces.iter().for_each(|f| {
            text += &format!("{} {}\n", f.len(), f.iter().map(u32::to_string).collect::<Vec<_>>().join(" "))
        });
        check("ascii.ply", text.replace('\n', line_end).as_bytes());
    }
    for big in [false, true] {
        for double in [false, true] {
            let format = if big { "binary_big_endian" } else { "binary_little_endian" };
            let mut bytes =
                header(format, if double { "double" } else { "float32" }, if double { "uint" } else { "short" })
                    .into_bytes();
            let mut put = |value: &[u8]| {
                let mut value = value.to_vec();
                if big {
                    value.reverse();
                }
                bytes.extend(value);
            };
            for point in points {
                for value in point {
                    if double { put(&value.to_le_bytes()) } else { put(&(value as f32).to_le_bytes()) }
                }
                put(&[200]);
            }
            for face in faces {
                put(&[face.len() as u8]);
                for &corner in face {
                    if double { put(&corner.to_le_bytes()) } else { put(&(corner as u16).to_le_bytes()) }
                }
            }
            check("binary.ply", &bytes);
        }
    }
}

#[test]
fn survey_coordinates_keep_their_detail() {
    let (_keep, folder) = folder();
    let (east, north) = (3_512_345.25f64, 5_400_100.5f64);
    let mut text = String::new();
    for (x, y) in [(0.0, 0.0), (0.01, 0.0), (0.0, 0.01)] {
        text += &format!("v {} {} 120.5\n", east + x, north + y);
    }
    write(&folder.join("far.obj"), &(text.clone() + "f 1 2 3\n"));
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty double x\nproperty double y\nproperty double z\nelement face 1\nproperty list uchar int vertex_index\nend_header\n";
    write(&folder.join("far.ply"), &(ply.to_owned() + &text.replace("v ", "") + "3 0 1 2\n"));
    for name in ["far.obj", "far.ply"] {
        let (mesh, _) = read_mesh(&folder.join(name)).unwrap();
        let [a, b, c] = mesh.corners(0);
        assert!(((b - a).x - 0.01).abs() < 1e-6 && ((c - a).y - 0.01).abs() < 1e-6, "{name}: {a} {b} {c}");
    }
}

#[test]
fn normals_that_are_none_are_computed() {
    let (_keep, folder) = folder();
    write(&folder.join("a.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 0\nvn 0 0 2\nvn nan 0 0\nf 1//1 2//2 3//3\n");
    let (mesh, findings) = read_mesh(&folder.join("a.obj")).unwrap();
    assert!(mesh.normals.iter().all(|normal| (*normal - Vec3::Z).length() < 1e-6), "{:?}", mesh.normals);
    assert!(
        findings.iter().any(|finding| finding.code == "mesh-normals-dropped"),
        "one that is used is no number: {findings:?}"
    );
}

#[test]
fn several_meshes_are_pieces_of_one_and_a_unit_is_told_and_kept() {
    let (_keep, folder) = folder();
    let written = scene(4);
    write_blended_mvs(&folder, &written, &FolderStyle::default());
    let corners = written.mesh.triangles.len() / 2;
    let pieces: Vec<PathBuf> = [&written.mesh.triangles[..corners], &written.mesh.triangles[corners..]]
        .iter()
        .enumerate()
        .map(|(index, triangles)| {
            let path = folder.with_file_name(format!("piece_{index}.obj"));
            let piece = Mesh { triangles: triangles.to_vec(), ..written.mesh.clone() };
            write(&path, &obj_text(&piece, &FolderStyle::default()));
            path
        })
        .collect();
    let triangles = |mesh: &[PathBuf]| {
        let settings = ReadSettings { mesh: mesh.to_vec(), ..Default::default() };
        let scene = read(&folder, &settings).unwrap();
        let told = understand(&folder, &settings, &scene).unwrap();
        assert_eq!(told.mesh.len(), mesh.len().max(1));
        (scene.mesh.triangles.len(), has(&scene, "mesh-pieces"))
    };
    let (whole, _) = triangles(&[]);
    assert_eq!(triangles(&pieces), (whole, true));
    assert_eq!(triangles(&pieces[..1]), (corners, false));

    let page = |unit_in_metres| {
        let settings = ReadSettings { unit_in_metres, ..Default::default() };
        let scene = read(&folder, &settings).unwrap();
        assert_eq!(scene.world_from_source.unit_in_metres, unit_in_metres);
        let told = understand(&folder, &settings, &scene).unwrap();
        let line = told.to_string().lines().find(|line| line.starts_with("scale")).unwrap().to_owned();
        (told.diagonal, line)
    };
    let (diagonal, line) = page(None);
    assert!(line.contains(&format!("{diagonal:.4} across")) && line.ends_with("in units of the source"), "{line}");
    let (same, line) = page(Some(0.001));
    assert_eq!(same, diagonal);
    assert!(line.contains(&format!("{:.4} across", 0.001 * f64::from(diagonal))), "{line}");
    assert!(line.ends_with("in metres: a unit of the source is given as 0.001"), "{line}");
}
