//! Photos and cameras that do not belong together, and lights that are not one, are told by the photos alone.

#![allow(clippy::unwrap_used, clippy::disallowed_methods)]

use super::scene_fixture::*;
use glam::{Vec2, Vec3};
use patina::image::{Image, file};
use patina::scene::doctor::lights::LightKind;
use patina::scene::doctor::{Report, check};
use patina::scene::{Photo, PixelState, ReadSettings, Scene, read, settings::PixelCentre};
use patina::trace::Bvh;
use patina::{Finding, Severity};

/// The small scene without its masks.
fn unmasked() -> Scene {
    let mut scene = scene(8);
    scene.views.iter_mut().for_each(|view| view.states.pixels_mut().fill(PixelState::Surface));
    scene
}

fn finding<'a>(report: &'a Report, code: &str) -> &'a Finding {
    let found = report.findings.iter().find(|finding| finding.code == code);
    found.unwrap_or_else(|| {
        panic!("{code} is not among {:#?}; {:?} {:?}", report.findings, report.agreement, report.light)
    })
}

const ALL: [&str; 6] =
    ["photos-shifted", "photos-exchanged", "photos-identical", "photo-misplaced", "photo-turned", "photos-disagree"];

#[test]
fn photos_that_belong_agree() {
    let report = check(&unmasked());
    assert!(report.agreement.unwrap() > 0.65, "{:?}", report.agreement);
    assert!(report.findings.iter().all(|finding| !ALL.contains(&finding.code)), "{:#?}", report.findings);
    assert_eq!(report.light.unwrap().kind(), LightKind::One);
}

#[test]
fn cameras_shifted_by_one_are_named_with_their_shift() {
    for forwards in [true, false] {
        let mut scene = unmasked();
        let mut photos: Vec<Photo> = scene.views.iter().map(|view| view.photo.clone()).collect();
        if forwards {
            photos.rotate_right(1)
        } else {
            photos.rotate_left(1)
        }
        scene.views.iter_mut().zip(photos).for_each(|(view, photo)| view.photo = photo);
        let report = check(&scene);
        let shifted = finding(&report, "photos-shifted");
        // A photo that lies one place further on in the list belongs to the camera before.
        assert!(shifted.message.contains(if forwards { "after its own" } else { "before its own" }), "{shifted}");
    }
}

#[test]
fn two_exchanged_photos_and_a_turned_one_are_named() {
    let mut exchanged = unmasked();
    let photo = exchanged.views[2].photo.clone();
    exchanged.views[2].photo = std::mem::replace(&mut exchanged.views[5].photo, photo);
    let report = check(&exchanged);
    let told = finding(&report, "photos-exchanged");
    assert!(told.message.contains("00000002") && told.message.contains("00000005"), "{told}");

    let mut turned = unmasked();
    let Photo::Srgb8(bytes) = &turned.views[3].photo else { unreachable!() };
    let half = Image::from_fn(SIZE.0, SIZE.1, |row, column| bytes[(SIZE.1 - 1 - row, SIZE.0 - 1 - column)]);
    turned.views[3].photo = Photo::Srgb8(half);
    let report = check(&turned);
    let told = finding(&report, "photo-turned");
    assert!(told.place.contains("00000003") && told.message.contains("180"), "{told}");

    let mut foreign = unmasked();
    let noise = Image::from_fn(SIZE.0, SIZE.1, |row, column| [(40 + (row / 9 * 37 + column / 7 * 101) % 180) as u8; 3]);
    foreign.views[6].photo = Photo::Srgb8(noise);
    let report = check(&foreign);
    assert!(finding(&report, "photos-disagree").message.ends_with(": 00000006"), "{:#?}", report.findings);
}

#[test]
fn a_copy_of_another_photo_is_told_by_its_content_and_by_where_it_fits() {
    let mut copied = unmasked();
    copied.views[3].photo = copied.views[4].photo.clone();
    let report = check(&copied);
    let told = finding(&report, "photos-identical");
    assert_eq!(told.severity, Severity::Warning);
    assert!(told.message.contains("00000003, 00000004; 00000004 fits"), "{told}");
    assert!(report.views[3].is_misplaced && !report.views[4].is_misplaced);
    // Another encoding of it is no copy, but fits where the other does.
    change_photo(&mut copied.views[3], |radiance| radiance * 0.8);
    let report = check(&copied);
    let told = finding(&report, "photo-misplaced");
    assert!(told.place.contains("00000003") && told.message.contains("camera of 00000004"), "{told}");
    // A view given twice is counted twice, and no fault.
    let mut twice = unmasked();
    twice.views.push(twice.views[2].clone());
    twice.views[8].name = "00000008".into();
    assert_eq!(finding(&check(&twice), "photos-identical").severity, Severity::Note);
}

#[test]
fn photos_that_are_all_mirrored_are_told_so() {
    let mut mirrored = unmasked();
    for view in &mut mirrored.views {
        let Photo::Srgb8(bytes) = &view.photo else { unreachable!() };
        view.photo = Photo::Srgb8(Image::from_fn(SIZE.0, SIZE.1, |row, column| bytes[(row, SIZE.0 - 1 - column)]));
    }
    let report = check(&mirrored);
    let told = finding(&report, "photo-turned");
    assert!(told.message.contains("all of them are mirrored left to right"), "{told}");
}

/// Photos whose surface is lit by one more light, from a direction of each view's own.
fn relit(light_of_view: impl Fn(usize, &Scene) -> Vec3) -> Scene {
    relit_beside(0.15, light_of_view)
}

/// The same beside so much light from all around.
fn relit_beside(ambient: f32, light_of_view: impl Fn(usize, &Scene) -> Vec3) -> Scene {
    let mut scene = unmasked();
    let bvh = Bvh::build(&scene.mesh.positions, &scene.mesh.triangles).unwrap();
    for index in 0..scene.views.len() {
        let light = light_of_view(index, &scene);
        let view = &scene.views[index];
        let linear = Image::from_fn(SIZE.0, SIZE.1, |row, column| {
            let hit = bvh.closest_hit(&view.camera.ray_through(Vec2::new(column as f32 + 0.5, row as f32 + 0.5)));
            let normal =
                hit.map_or(Vec3::ZERO, |hit| scene.mesh.area_vector(hit.triangle as usize).normalize_or_zero());
            view.photo.radiance(row, column) * (ambient + normal.dot(light).max(0.0))
        });
        scene.views[index].photo = Photo::Srgb8(bytes_of(&linear));
    }
    scene
}

#[test]
fn a_light_that_turns_with_the_camera_and_two_lights_are_told() {
    let report = check(&relit(|_, _| Vec3::new(0.6, 0.7, -0.3)));
    assert_eq!(report.light.as_ref().unwrap().kind(), LightKind::One, "{:?}", report.light);

    let from_left = |view: usize, scene: &Scene| {
        scene.views[view].camera.rotation_camera_from_world.transpose() * Vec3::new(-0.8, -0.5, -0.3)
    };
    let report = check(&relit(from_left));
    assert_eq!(finding(&report, "light-turns-with-camera").severity, Severity::Warning);

    let two = |first: Vec3, second: Vec3| check(&relit(|view, _| if view < 4 { first } else { second }));
    for second in [Vec3::new(0.0, 0.4, 0.9), Vec3::new(-0.3, 0.9, -0.3)] {
        let report = two(Vec3::new(0.9, 0.4, 0.0), second);
        assert!(finding(&report, "light-in-groups").place.contains("00000004"), "{:?}", report.light);
    }
    // Two that change sides as the cameras do are one or the other, and no light that stands still.
    let report = two(Vec3::new(0.9, 0.4, 0.0), Vec3::new(-0.7, 0.5, 0.5));
    assert_ne!(report.light.as_ref().unwrap().kind(), LightKind::One, "{:?}", report.light);
}

#[test]
fn a_soft_light_that_turns_is_told_where_nothing_else_explains_the_photos() {
    let from_left = |view: usize, scene: &Scene| {
        scene.views[view].camera.rotation_camera_from_world.transpose() * Vec3::new(-0.8, -0.5, -0.3)
    };
    let report = check(&relit_beside(2.0, from_left));
    let light = report.light.clone().unwrap();
    assert!(light.one_light_residual < 0.15, "as little as gloss makes: {light:?}");
    assert_eq!(light.kind(), LightKind::WithCamera, "{light:?}");
    let report = check(&relit_beside(2.0, |_, _| Vec3::new(0.9, 0.4, 0.0)));
    assert_eq!(report.light.as_ref().unwrap().kind(), LightKind::One, "{:?}", report.light);
}

#[test]
fn photos_at_twice_the_calibrated_size_are_read_with_scaled_intrinsics() {
    let (_keep, folder) = folder();
    let written = scene(4);
    write_blended_mvs(&folder, &written, &FolderStyle::default());
    for part in ["blended_images", "masks"] {
        for entry in std::fs::read_dir(folder.join(part)).unwrap() {
            let path = entry.unwrap().path();
            let photo = file::read_srgb8(&path).unwrap();
            let large = Image::from_fn(2 * SIZE.0, 2 * SIZE.1, |row, column| photo[(row / 2, column / 2)]);
            file::write_png_srgb8(&path, &large).unwrap();
        }
    }
    let settings = ReadSettings { pixel_centre: PixelCentre::Integer, ..Default::default() };
    let scene = read(&folder, &settings).unwrap();
    let told = scene.findings.iter().find(|finding| finding.code == "intrinsics-scaled").unwrap();
    assert!(told.message.contains("2 times"), "{told}");
    for (read, written) in scene.views.iter().zip(&written.views) {
        assert!((read.camera.focal_pixels - 2.0 * written.camera.focal_pixels).length() < 1e-2);
        assert!((read.camera.centre_pixels - 2.0 * written.camera.centre_pixels).length() < 1e-2);
    }
    assert!(check(&scene).views.iter().all(|view| view.mask_overlap.unwrap() > 0.95));
}

#[test]
fn twice_the_calibrated_size_puts_a_wrong_convention_off_by_a_whole_pixel_which_is_mended() {
    let (_keep, folder) = folder();
    let written = scene(4);
    // The source has its first pixel's centre at (0.5, 0.5), and readers of this kind of folder assume (0, 0).
    write_blended_mvs(&folder, &written, &FolderStyle { centre_shift: 0.0, ..Default::default() });
    for part in ["blended_images", "masks"] {
        for entry in std::fs::read_dir(folder.join(part)).unwrap() {
            let path = entry.unwrap().path();
            let photo = file::read_srgb8(&path).unwrap();
            let large = Image::from_fn(2 * SIZE.0, 2 * SIZE.1, |row, column| photo[(row / 2, column / 2)]);
            file::write_png_srgb8(&path, &large).unwrap();
        }
    }
    let scene = read(&folder, &ReadSettings::default()).unwrap();
    assert!(scene.findings.iter().any(|finding| finding.code == "pixel-centre-measured"), "{:#?}", scene.findings);
    for (read, written) in scene.views.iter().zip(&written.views) {
        let off = read.camera.centre_pixels - 2.0 * written.camera.centre_pixels;
        assert!(off.length() < 1e-2, "off by {off}: {:#?}", scene.findings);
    }
}
