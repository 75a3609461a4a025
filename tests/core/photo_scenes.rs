//! What photos bring into a scene: opacity as mask, mattes that are no sky, masks by name, exposures by EXIF.

#![allow(clippy::unwrap_used)]

use super::scene_fixture::{FolderStyle, folder, scene, write, write_blended_mvs};
use glam::Vec3;
use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};
use patina::image::{Image, file};
use patina::scene::settings::{BackgroundChoice, PixelCentre, Up};
use patina::scene::{Background, Photo, PixelState, ReadSettings, Scene, read};
use patina::{ErrorKind, Severity};
use std::path::Path;

fn settings() -> ReadSettings {
    ReadSettings { pixel_centre: PixelCentre::Integer, up: Up::Y, hold_out_every: 0, ..Default::default() }
}

fn finding<'a>(scene: &'a Scene, code: &str) -> Option<&'a patina::Finding> {
    scene.findings.iter().find(|finding| finding.code == code)
}

/// The fixture's scene as a folder without masks, its photos changed by `change(pixel, is object)`.
fn written(path: &Path, change: impl Fn([u8; 3], bool) -> [u8; 3]) -> Scene {
    let mut scene = scene(3);
    for view in &mut scene.views {
        let Photo::Srgb8(bytes) = &view.photo else { panic!("the fixture's photos have 8 bits") };
        let states = &view.states;
        view.photo = Photo::Srgb8(Image::from_fn(bytes.width(), bytes.height(), |row, column| {
            change(bytes[(row, column)], states[(row, column)].is_surface())
        }));
    }
    write_blended_mvs(path, &scene, &FolderStyle::default());
    std::fs::remove_dir_all(path.join("masks")).unwrap();
    scene
}

#[test]
fn opacity_is_a_mask_and_what_it_hides_is_no_sky() {
    let (_keep, path) = folder();
    let whole = written(&path, |pixel, _| pixel);
    for view in &whole.views {
        let Photo::Srgb8(bytes) = &view.photo else { panic!("the fixture's photos have 8 bits") };
        let rgba: Vec<u8> = bytes
            .pixels()
            .iter()
            .zip(view.states.pixels())
            .flat_map(|([r, g, b], state)| if state.is_surface() { [*r, *g, *b, 255] } else { [0; 4] })
            .collect();
        let mut png = Vec::new();
        let (width, height) = (bytes.width() as u32, bytes.height() as u32);
        PngEncoder::new(&mut png).write_image(&rgba, width, height, ExtendedColorType::Rgba8).unwrap();
        std::fs::write(path.join(format!("blended_images/{}.png", view.name)), png).unwrap();
    }
    let scene = read(&path, &settings()).unwrap();
    assert!(finding(&scene, "alpha-as-mask").unwrap().message.ends_with("(all 3 photos)"));
    for (view, truth) in scene.views.iter().zip(&whole.views) {
        for (state, truth) in view.states.pixels().iter().zip(truth.states.pixels()) {
            assert_eq!(state.is_surface(), truth.is_surface());
        }
    }
    assert_eq!(finding(&scene, "background-matte").unwrap().severity, Severity::Note);
    assert_eq!(scene.background, Background::Black);
    let asked = ReadSettings { background: BackgroundChoice::Environment, ..settings() };
    let scene = read(&path, &asked).unwrap();
    assert!(finding(&scene, "background-matte").is_none() && scene.background == Background::Environment);
}

#[test]
fn a_white_matte_without_masks_is_set_aside_and_a_sky_is_kept() {
    let (_keep, path) = folder();
    written(&path, |pixel, is_object| if is_object { pixel } else { [255, 254, 255] });
    let scene = read(&path, &settings()).unwrap();
    let told = finding(&scene, "background-matte").unwrap();
    assert!(told.severity == Severity::Warning && told.message.contains("white"), "{told}");
    for view in &scene.views {
        assert_eq!(view.states[(0, 0)], PixelState::Ignored);
        assert!(view.states.pixels().contains(&PixelState::Surface));
        assert!(!view.states.pixels().contains(&PixelState::SurfaceClipped), "all of the matte is found");
    }
    let (_keep, path) = folder();
    written(&path, |pixel, _| pixel);
    let scene = read(&path, &settings()).unwrap();
    assert!(finding(&scene, "background-matte").is_none(), "{:?}", scene.findings);
    assert!(scene.views.iter().all(|view| !view.states.pixels().contains(&PixelState::Ignored)));
}

#[test]
fn masks_that_match_nothing_are_told_and_refused_where_they_are_named() {
    let (_keep, path) = folder();
    let whole = written(&path, |pixel, _| pixel);
    let mask = |view: &patina::scene::View| view.states.map(|state| [if state.is_surface() { 255 } else { 0 }; 3]);
    for view in &whole.views {
        file::write_png_srgb8(&path.join(format!("mask/{}.jpg.png", view.name)), &mask(view)).unwrap();
    }
    file::write_png_srgb8(&path.join("mask/other.png"), &mask(&whole.views[0])).unwrap();
    let scene = read(&path, &settings()).unwrap();
    assert!(scene.views.iter().all(|view| view.has_mask()));
    assert!(finding(&scene, "mask-without-photo").unwrap().message.contains("'other.png'"));
    let manifest =
        "mesh = \"textured_mesh/mesh.obj\"\nimages = \"blended_images\"\ncameras = \"cams\"\nmasks = \"mask\"\n";
    write(&path.join("scene.toml"), manifest);
    let error = read(&path, &settings()).unwrap_err();
    assert!(error.kind() == ErrorKind::InvalidScene && error.message().contains("other.png"), "{error}");
    std::fs::remove_file(path.join("mask/other.png")).unwrap();
    assert!(read(&path, &settings()).unwrap().views.iter().all(|view| view.has_mask()));
}

/// An EXIF block with a time of exposure of `1 / denominator` seconds.
fn exif(denominator: u32) -> Vec<u8> {
    let mut tiff = b"II*\0\x08\0\0\0".to_vec();
    tiff.extend([1, 0, 0x69, 0x87, 4, 0, 1, 0, 0, 0, 26, 0, 0, 0, 0, 0, 0, 0]);
    tiff.extend([1, 0, 0x9a, 0x82, 5, 0, 1, 0, 0, 0, 44, 0, 0, 0, 0, 0, 0, 0]);
    tiff.extend(1u32.to_le_bytes());
    tiff.extend(denominator.to_le_bytes());
    let length = (tiff.len() + 8) as u16;
    [&[0xff, 0xe1], &length.to_be_bytes()[..], b"Exif\0\0", &tiff].concat()
}

#[test]
fn exposures_by_exif_become_the_prior_of_the_gains() {
    let (_keep, path) = folder();
    let whole = written(&path, |pixel, _| pixel);
    for (view, denominator) in whole.views.iter().zip([50, 100, 400]) {
        let Photo::Srgb8(bytes) = &view.photo else { panic!("the fixture's photos have 8 bits") };
        let jpeg = file::encode_jpeg(bytes, 95).unwrap();
        let with_exif = [&jpeg[..2], &exif(denominator), &jpeg[2..]].concat();
        let photo = path.join(format!("blended_images/{}", view.name));
        std::fs::write(photo.with_extension("jpg"), with_exif).unwrap();
        std::fs::remove_file(photo.with_extension("png")).unwrap();
    }
    let scene = read(&path, &settings()).unwrap();
    let stops: Vec<f32> = scene.views.iter().map(|view| view.exposure_prior_stops.unwrap()).collect();
    // 1, 2 and 4 halvings of a second over 25: less their mean of 7/3.
    for (stops, expected) in stops.iter().zip([4.0 / 3.0, 1.0 / 3.0, -5.0 / 3.0]) {
        assert!((stops - expected).abs() < 1e-5, "{stops}");
    }
    assert!(finding(&scene, "exposure-by-exif").unwrap().message.contains("3.0 stops"));
    assert!(finding(&scene, "profile-missing").is_some());
    let plain = super::scene_fixture::scene(2);
    assert!(plain.views.iter().all(|view| view.exposure_prior_stops.is_none()));
    assert!(plain.views[0].photo.radiance(0, 0).cmpgt(Vec3::ZERO).all());
}

/// An EXIF block with an orientation.
fn exif_of_orientation(orientation: u8) -> Vec<u8> {
    let mut tiff = b"II*\0\x08\0\0\0".to_vec();
    tiff.extend([1, 0, 0x12, 0x01, 3, 0, 1, 0, 0, 0, orientation, 0, 0, 0, 0, 0, 0, 0]);
    let length = (tiff.len() + 8) as u16;
    [&[0xff, 0xe1], &length.to_be_bytes()[..], b"Exif\0\0", &tiff].concat()
}

#[test]
fn orientations_that_keep_the_sides_are_tried_on_the_pixels() {
    for (tag, turns) in [(3, true), (2, true), (4, true), (3, false)] {
        let (_keep, path) = folder();
        let whole = scene(8);
        write_blended_mvs(&path, &whole, &FolderStyle::default());
        for view in &whole.views {
            let Photo::Srgb8(bytes) = &view.photo else { panic!("the fixture's photos have 8 bits") };
            // Each of these is its own inverse.
            let stored = if turns { file::turned(bytes.clone(), tag) } else { bytes.clone() };
            let jpeg = file::encode_jpeg(&stored, 97).unwrap();
            let photo = path.join(format!("blended_images/{}", view.name));
            let with_exif = [&jpeg[..2], &exif_of_orientation(tag), &jpeg[2..]].concat();
            std::fs::write(photo.with_extension("jpg"), with_exif).unwrap();
            std::fs::remove_file(photo.with_extension("png")).unwrap();
        }
        let read = read(&path, &settings()).unwrap();
        let (told, other) =
            if turns { ("photo-turned", "photo-as-stored") } else { ("photo-as-stored", "photo-turned") };
        let told = finding(&read, told).unwrap_or_else(|| panic!("{tag} {turns}: {:#?}", read.findings));
        assert!(told.message.contains("photos agree by") && finding(&read, other).is_none(), "{told}");
        let off = read.views.iter().zip(&whole.views).map(|(own, view)| {
            let pixels = own.photo.to_linear().pixels().to_vec();
            pixels.iter().zip(view.photo.to_linear().pixels()).map(|(a, b)| (*a - *b).length()).sum::<f32>()
                / pixels.len() as f32
        });
        let worst = off.fold(0.0, f32::max);
        assert!(worst < 0.02, "{tag} {turns}: off by {worst} in the mean");
        // The masks lay as the cameras see them.
        assert!(read.views.iter().zip(&whole.views).all(
            |(own, view)| own.states.map(|state| state.is_surface()) == view.states.map(|state| state.is_surface())
        ));
    }
    // Photos that show nothing tell nothing, and nothing is claimed.
    let (_keep, path) = folder();
    let whole = written(&path, |_, _| [90; 3]);
    for view in &whole.views {
        let Photo::Srgb8(bytes) = &view.photo else { panic!("the fixture's photos have 8 bits") };
        let jpeg = file::encode_jpeg(bytes, 95).unwrap();
        let photo = path.join(format!("blended_images/{}", view.name));
        let with_exif = [&jpeg[..2], &exif_of_orientation(3), &jpeg[2..]].concat();
        std::fs::write(photo.with_extension("jpg"), with_exif).unwrap();
        std::fs::remove_file(photo.with_extension("png")).unwrap();
    }
    let read = read(&path, &settings()).unwrap();
    let told = finding(&read, "photo-as-stored").unwrap();
    assert!(told.message.contains("tells whether") && !told.remedy.is_empty(), "{told}");
}
