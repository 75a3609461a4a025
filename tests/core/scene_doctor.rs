//! The pre-flight check names each spoiled scene, and leaves a good one in peace.

#![allow(clippy::unwrap_used, clippy::disallowed_methods)]

use super::scene_fixture::*;
use glam::{Mat3, Vec3};
use patina::Severity;
use patina::job::demo::photograph;
use patina::lab::scenes::hard::{HardCase, HardSettings, build};
use patina::scene::doctor::{self, Report, check};
use patina::scene::{Camera, Mesh, Photo, PixelState, Scene};
use patina::trace::Bvh;
use std::sync::atomic::AtomicBool;

fn severity_of(report: &Report, code: &str) -> Option<Severity> {
    let finding = report.findings.iter().find(|finding| finding.code == code)?;
    assert!(!finding.remedy.is_empty(), "no remedy: {finding}");
    Some(finding.severity)
}

#[track_caller]
fn assert_finding(scene: &Scene, code: &str, severity: Severity) -> Report {
    let report = check(scene);
    assert_eq!(severity_of(&report, code), Some(severity), "{code} is not among {:#?}", report.findings);
    assert_eq!(report.is_fatal(), report.findings[0].severity == Severity::Fatal, "the gravest comes first");
    report
}

fn turned(camera: &Camera, signs: Vec3) -> Camera {
    let turn = Mat3::from_diagonal(signs);
    Camera {
        rotation_camera_from_world: turn * camera.rotation_camera_from_world,
        translation_camera_from_world: turn * camera.translation_camera_from_world,
        ..*camera
    }
}

#[test]
fn a_good_scene_has_no_findings_and_good_figures() {
    let report = check(&scene(8));
    assert!(report.findings.is_empty(), "{:#?}", report.findings);
    for view in &report.views {
        assert_eq!(view.mask_overlap, Some(1.0));
        assert_eq!((view.back_face_share, view.clipped_share), (0.0, 0.0));
        assert!(view.exposure_stops.unwrap().abs() < 0.05 && view.mesh_share > 0.1, "{view:?}");
    }
    let centre = report.pixel_centre.unwrap();
    assert!(centre.centre_pixels.iter().all(|place| (place.unwrap() - 0.5).abs() < 0.05), "{centre:?}");
    assert_eq!(centre.disagreement.unwrap()[1], 0.0);
}

#[test]
fn remedies_are_for_the_scene_that_is_there() {
    let remedy = |scene: &Scene, code: &str| {
        check(scene).findings.into_iter().find(|finding| finding.code == code).unwrap().remedy
    };
    let mut scene = scene(8);
    scene.views.iter_mut().for_each(|view| view.camera.centre_pixels += 0.5);
    let off = |scene: &Scene| remedy(scene, "pixel-centre-off");
    assert!(off(&scene).contains("--pixel-centre half"), "{}", off(&scene));
    scene.views.iter_mut().for_each(|view| view.camera.centre_pixels -= 1.0);
    assert!(off(&scene).contains("--pixel-centre integer"), "{}", off(&scene));

    scene.mesh.triangles.iter_mut().for_each(|corners| corners.swap(1, 2));
    let (_keep, folder) = folder();
    scene.folder = Some(folder.clone());
    assert!(!remedy(&scene, "mesh-inside-out").contains("scene.toml"));
    write(&folder.join("scene.toml"), "");
    assert!(remedy(&scene, "mesh-inside-out").contains("scene.toml"));
}

#[test]
fn a_mesh_that_all_cameras_stand_within_may_be_too_large() {
    let message = |scene: &Scene| {
        let findings = check(scene).findings;
        findings.into_iter().find(|finding| finding.code == "mesh-inside-out").unwrap().message
    };
    let mut scene = scene(4);
    scene.mesh.positions.iter_mut().for_each(|point| *point *= 40.0);
    assert!(message(&scene).contains("all cameras stand within it"), "{}", message(&scene));
    scene.mesh.positions.iter_mut().for_each(|point| *point /= 40.0);
    scene.mesh.triangles.iter_mut().for_each(|corners| corners.swap(1, 2));
    assert!(!message(&scene).contains("stand within"), "{}", message(&scene));
}

#[test]
fn photo_edges_tell_the_pixel_centre_without_masks() {
    let mut scene = scene(8);
    for view in &mut scene.views {
        view.states.pixels_mut().fill(PixelState::Surface);
    }
    let place = |scene: &Scene| check(scene).pixel_centre.unwrap().centre_pixels.map(Option::unwrap);
    let right = place(&scene);
    scene.views.iter_mut().for_each(|view| view.camera.centre_pixels -= 0.5);
    let left = place(&scene);
    for axis in 0..2 {
        assert!((right[axis] - 0.5).abs() < 0.12, "{right:?}");
        assert!((right[axis] - left[axis] - 0.5).abs() < 0.1, "{right:?} {left:?}");
    }
}

#[test]
fn half_a_pixel_is_noticed() {
    let mut scene = scene(6);
    scene.views.iter_mut().for_each(|view| view.camera.centre_pixels += 0.5);
    assert_finding(&scene, "pixel-centre-off", Severity::Warning);
}

#[test]
fn mirrored_flipped_and_broken_cameras_are_named() {
    let mut mirrored = scene(4);
    mirrored.views[2].camera = turned(&mirrored.views[2].camera, Vec3::new(-1.0, 1.0, 1.0));
    let report = assert_finding(&mirrored, "camera-mirrored", Severity::Fatal);
    assert!(report.findings[0].place.contains("00000002"));

    // Conventions are said in scene.toml, where there is one.
    let (_keep, folder) = folder();
    write(&folder.join("scene.toml"), "");
    let mut opengl = Scene { folder: Some(folder.clone()), ..scene(4) };
    opengl.views.iter_mut().for_each(|view| view.camera = turned(&view.camera, Vec3::new(1.0, -1.0, -1.0)));
    let report = assert_finding(&opengl, "camera-convention", Severity::Warning);
    assert!(report.findings.iter().any(|finding| finding.remedy.contains("opengl")), "{:#?}", report.findings);
    assert_eq!(severity_of(&report, "views-see-nothing"), Some(Severity::Fatal));
    opengl.folder = None;
    let report = assert_finding(&opengl, "camera-convention", Severity::Warning);
    assert!(report.findings.iter().all(|finding| !finding.remedy.contains("scene.toml")), "{:#?}", report.findings);

    let mut inverted = Scene { folder: Some(folder), ..scene(4) };
    for view in &mut inverted.views {
        let camera = view.camera;
        view.camera.rotation_camera_from_world = camera.rotation_camera_from_world.transpose();
        view.camera.translation_camera_from_world = camera.position_in_world();
    }
    let report = assert_finding(&inverted, "camera-convention", Severity::Warning);
    assert!(
        report.findings.iter().any(|finding| finding.remedy.contains("\"world_from_camera\" in")),
        "{:#?}",
        report.findings
    );

    let mut not_a_number = scene(4);
    not_a_number.views[1].camera.translation_camera_from_world.y = f32::NAN;
    assert_finding(&not_a_number, "camera-invalid", Severity::Fatal);
    let mut sheared = scene(4);
    sheared.views[1].camera.rotation_camera_from_world.x_axis *= 1.1;
    assert_finding(&sheared, "camera-invalid", Severity::Fatal);

    let mut upside_down = scene(4);
    upside_down.views.iter_mut().for_each(|view| view.camera = turned(&view.camera, Vec3::new(-1.0, -1.0, 1.0)));
    assert_finding(&upside_down, "up-inverted", Severity::Warning);
    let mut other_size = scene(4);
    other_size.views[0].camera.centre_pixels *= 2.0;
    assert_finding(&other_size, "camera-off-centre", Severity::Warning);
    let mut copied = scene(4);
    copied.views[3].camera = copied.views[1].camera;
    assert_finding(&copied, "cameras-repeated", Severity::Note);
}

#[test]
fn meshes_inside_out_or_spoiled_are_named() {
    let mut inside_out = scene(4);
    inside_out.mesh.triangles.iter_mut().for_each(|corners| corners.swap(0, 1));
    assert_finding(&inside_out, "mesh-inside-out", Severity::Fatal);
    let mut normals = scene(4);
    normals.mesh.normals.iter_mut().for_each(|normal| *normal = -*normal);
    assert_finding(&normals, "normals-inside-out", Severity::Fatal);

    let mut spoiled = scene(4);
    let first = spoiled.mesh.triangles[100];
    spoiled.mesh.triangles.extend([[first[1], first[2], first[0]], [first[0], first[1], first[1]]]);
    spoiled.mesh.positions.push(Vec3::splat(50.0));
    spoiled.mesh.normals.push(Vec3::Y);
    let report = assert_finding(&spoiled, "mesh-duplicate", Severity::Note);
    let before = doctor::geometry::count(&scene(1).mesh).0;
    assert_eq!(report.mesh.duplicate_triangles, before.duplicate_triangles + 1);
    assert_eq!(report.mesh.degenerate_triangles, before.degenerate_triangles + 1);
    assert_eq!(report.mesh.unreferenced_vertices, before.unreferenced_vertices + 1);
    assert!(!report.is_fatal());

    let mut none = scene(2);
    none.mesh = Mesh::default();
    assert_finding(&none, "mesh-unusable", Severity::Fatal);
    let mut flat = scene(2);
    flat.mesh.triangles = vec![[0, 0, 1]];
    assert_finding(&flat, "mesh-unusable", Severity::Fatal);
    let mut out_of_range = scene(2);
    out_of_range.mesh.triangles[5][1] = 1_000_000;
    assert_finding(&out_of_range, "mesh-unusable", Severity::Fatal);
}

#[test]
fn a_mesh_of_one_triangle_and_a_single_view_are_checked_without_ado() {
    let mut scene = scene(1);
    scene.mesh = Mesh {
        positions: vec![Vec3::new(0.0, 0.2, -1.0), Vec3::new(0.0, 0.2, 1.0), Vec3::new(0.3, 1.8, 0.0)],
        triangles: vec![[0, 1, 2], [1, 0, 2]],
        ..Default::default()
    };
    scene.mesh.compute_normals();
    let report = assert_finding(&scene, "few-views", Severity::Warning);
    assert_eq!(report.views.len(), 1);
    assert_eq!(report.views[0].exposure_stops, None);
    assert!(report.views[0].mesh_share > 0.05);
}

#[test]
fn blind_views_and_masks_that_lie_are_named() {
    let mut blind = scene(4);
    blind.views[1].camera =
        Camera::looking_at(Vec3::new(9.0, 1.0, 0.0), Vec3::new(90.0, 1.0, 0.0), SIZE.0, SIZE.1, 0.7);
    let report = assert_finding(&blind, "view-sees-nothing", Severity::Warning);
    assert!(!report.is_fatal() && report.views[1].mesh_share == 0.0);

    let mut empty_mask = scene(4);
    empty_mask.views[1].states.pixels_mut().fill(PixelState::Background);
    let report = assert_finding(&empty_mask, "mask-overlap-low", Severity::Warning);
    assert_eq!(report.views[1].mask_overlap, Some(0.0));
    let pixels = empty_mask.views[0].states.pixels_mut().iter_mut();
    pixels.step_by(4).filter(|state| state.is_surface()).for_each(|state| *state = PixelState::Background);
    let report = assert_finding(&empty_mask, "mask-overlap-low", Severity::Warning);
    let told = report.findings.iter().find(|finding| finding.code == "mask-overlap-low").unwrap();
    assert_eq!(told.place, "view 00000001", "the worst is where to go");
    assert!(told.message.ends_with("in 2 views, by 0 % in the first: 00000001, 00000000"), "{told}");
    let mut inverted = scene(4);
    for view in &mut inverted.views {
        for state in view.states.pixels_mut() {
            *state = if state.is_surface() { PixelState::Background } else { PixelState::Surface };
        }
    }
    assert_finding(&inverted, "masks-and-mesh-disagree", Severity::Fatal);
    let mut held_out = scene(4);
    held_out.views.iter_mut().for_each(|view| view.held_out = true);
    assert_finding(&held_out, "no-views", Severity::Fatal);
}

#[test]
fn exposure_jumps_are_measured() {
    let mut scene = scene(8);
    change_photo(&mut scene.views[5], |radiance| radiance * 0.5);
    let report = assert_finding(&scene, "exposure-jump", Severity::Warning);
    for (index, view) in report.views.iter().enumerate() {
        let expected = if index == 5 { -1.0 } else { 0.0 };
        assert!((view.exposure_stops.unwrap() - expected).abs() < 0.06, "{index}: {:?}", view.exposure_stops);
    }
    change_photo(&mut scene.views[1], |radiance| radiance * 0.25);
    let report = assert_finding(&scene, "exposure-jump", Severity::Warning);
    let told: Vec<_> = report.findings.iter().filter(|finding| finding.code == "exposure-jump").collect();
    assert_eq!(told.len(), 1, "one finding with a list: {told:?}");
    assert!(told[0].message.contains("2 of 8") && told[0].message.contains("00000005 by -1.0"), "{}", told[0]);
    assert!(told[0].place.contains("00000001"), "the worst is where to go: {}", told[0]);
}

#[test]
fn photos_that_are_black_clipped_or_wrongly_encoded_are_named() {
    let mut black = scene(4);
    change_photo(&mut black.views[0], |_| Vec3::ZERO);
    assert_finding(&black, "photo-black", Severity::Warning);
    black.views.iter_mut().for_each(|view| change_photo(view, |_| Vec3::ZERO));
    assert_finding(&black, "photo-black", Severity::Fatal);

    let mut white = scene(4);
    white.views[1].states.pixels_mut().fill(PixelState::SurfaceClipped);
    assert_finding(&white, "photo-white", Severity::Warning);
    white.views.iter_mut().for_each(|view| view.states.pixels_mut().fill(PixelState::SurfaceClipped));
    assert_finding(&white, "photo-white", Severity::Fatal);

    let mut clipped = scene(4);
    clipped.views[2].states.pixels_mut()[..4000].fill(PixelState::BackgroundClipped);
    let report = assert_finding(&clipped, "photo-clipped", Severity::Warning);
    assert!((report.views[2].clipped_share - 4000.0 / 12288.0).abs() < 1e-9);
    clipped.views[3].states.pixels_mut()[..8000].fill(PixelState::BackgroundClipped);
    let report = assert_finding(&clipped, "photo-clipped", Severity::Warning);
    let told = report.findings.iter().find(|finding| finding.code == "photo-clipped").unwrap();
    assert_eq!(told.place, "view 00000003", "the worst is where to go");
    assert!(told.message.ends_with("in 2 views, 65 % in the first: 00000003, 00000002"), "{told}");

    // Linear values stored in 8 bits and decoded once more: v becomes about v^2.2. The sky is bright and small.
    let mut linear = scene(4);
    for view in &mut linear.views {
        let states = view.states.clone();
        let Photo::Srgb8(bytes) = &mut view.photo else { unreachable!() };
        for (index, (pixel, state)) in bytes.pixels_mut().iter_mut().zip(states.pixels()).enumerate() {
            if state.is_surface() || index > 600 {
                *pixel = [24 + (index % 17) as u8; 3];
            } else {
                *pixel = [250; 3];
            }
        }
    }
    assert_finding(&linear, "encoding-looks-linear", Severity::Warning);
    let mut encoded = scene(4);
    for view in &mut encoded.views {
        let Photo::Srgb8(bytes) = &view.photo else { unreachable!() };
        let top = bytes.pixels().iter().flatten().max().copied().unwrap();
        view.photo =
            Photo::Linear32(bytes.map(|pixel| Vec3::from_array(pixel.map(|byte| f32::from(byte) / f32::from(top)))));
    }
    assert_finding(&encoded, "encoding-looks-srgb", Severity::Warning);
}

#[test]
fn the_outline_is_drawn_where_the_mask_ends() {
    let scene = scene(2);
    let bvh = Bvh::build(&scene.mesh.positions, &scene.mesh.triangles).unwrap();
    let picture = doctor::overlay(&scene, &bvh, 1);
    let states = &scene.views[1].states;
    let mut drawn = 0;
    for row in 0..SIZE.1 - 1 {
        for column in 0..SIZE.0 - 1 {
            let here = states[(row, column)].is_surface();
            let edge = here != states[(row + 1, column)].is_surface() || here != states[(row, column + 1)].is_surface();
            let is_drawn = picture[(row, column)] == doctor::overlay::SILHOUETTE_COLOUR;
            assert_eq!(edge, is_drawn, "row {row} column {column}");
            drawn += usize::from(is_drawn);
        }
    }
    assert!(drawn > 100);
}

#[test]
fn a_texture_finer_than_the_photos_is_told() {
    let of = |case: HardCase| {
        let settings = HardSettings { views: 8, held_out: 1, light_height: 8, ..Default::default() };
        let mut hard = build(case, &settings).unwrap();
        photograph(&mut hard.scene, 64, 1, 1.0, &AtomicBool::new(false), &|_| {}).unwrap();
        let report = check(&hard.scene);
        (report.surface.fine_share, severity_of(&report, "detail-too-fine"))
    };
    let (plain, fine) = (of(HardCase::Plain), of(HardCase::FineTexture));
    assert_eq!((plain.1, fine.1), (None, Some(Severity::Note)));
    assert!(fine.0 > 2.0 * plain.0, "plain {plain:?}, fine {fine:?}");
}
