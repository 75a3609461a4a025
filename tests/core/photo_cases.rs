//! Photos of real programs that were once read wrongly, with their right values. The files lie beside the project
//! (`PATINA_CASES`, or `../shared/cases/cases.tar.xz`); without them these tests do nothing.

#![allow(clippy::unwrap_used)]

use super::beside::cases;
use glam::Vec3;
use patina::image::file::{self, PhotoOptions};
use patina::image::{RgbImage, metrics};
use patina::math::{luminance, statistics::quantile};
use patina::scene::settings::{BackgroundChoice, ColourEncoding, MaskUse};
use patina::scene::{PixelState, ReadSettings, Scene, View, read};
use std::path::Path;

fn scene(name: &str, settings: ReadSettings) -> Option<Scene> {
    Some(read(&cases()?.join(name), &ReadSettings { hold_out_every: 0, ..settings }).unwrap())
}

fn has(scene: &Scene, code: &str) -> bool {
    scene.findings.iter().any(|finding| finding.code == code)
}

/// Median luminance of a picture.
fn median(picture: &RgbImage) -> f64 {
    quantile(&picture.pixels().iter().map(|pixel| f64::from(luminance(*pixel))).collect::<Vec<_>>(), 0.5)
}

#[test]
fn photos_on_their_side_are_turned_for_cameras_of_the_upright_picture() {
    let (Some(turned), Some(upright)) =
        (scene("exif6", ReadSettings::default()), scene("saha6", ReadSettings::default()))
    else {
        return;
    };
    assert!(has(&turned, "photo-turned"), "{:?}", turned.findings);
    for (a, b) in turned.views.iter().zip(&upright.views) {
        assert_eq!((a.photo.width(), a.photo.height()), (182, 273));
        let error = metrics::rmse(&a.photo.to_linear(), &b.photo.to_linear(), None).unwrap();
        assert!(error < 0.03, "view {}: {error}", a.name);
    }
}

#[test]
fn a_render_region_stays_where_it_was() {
    let Some(scene) = scene("exr_crop", ReadSettings::default()) else { return };
    assert!(has(&scene, "exr-window"), "{:?}", scene.findings);
    let unseen = |view: &View| view.states.pixels().iter().filter(|state| **state == PixelState::Ignored).count();
    assert!(scene.views.iter().all(|view| (view.photo.width(), view.photo.height()) == (256, 256)));
    // The first is stored from column 10 and row 59 on, the last as a whole.
    assert_eq!(unseen(&scene.views[0]), 256 * 256 - 246 * 197);
    assert_eq!(scene.views[0].states[(58, 200)], PixelState::Ignored);
    assert_eq!(unseen(&scene.views[7]), 0);
}

#[test]
fn the_layer_of_radiance_is_read_and_another_by_its_name() {
    let Some(folder) = cases() else { return };
    let of = |layer| {
        let path = folder.join("files/exr_blender_noisy.exr");
        file::read_photo(&path, &PhotoOptions { layer, ..Default::default() }).unwrap()
    };
    let radiance = of(None);
    assert!(radiance.findings.iter().any(|finding| finding.message.contains("Noisy Image")), "{:?}", radiance.findings);
    // By another reader of the file.
    let radiance = radiance.into_linear();
    assert!((median(&radiance) - 0.156_059_7).abs() < 1e-5, "{}", median(&radiance));
    let albedo = of(Some("DiffCol")).into_linear();
    assert!((median(&albedo) - 0.5).abs() < 1e-5, "{}", median(&albedo));
    // Albedo is one colour behind the masks, as a matte is.
    let background = BackgroundChoice::Environment;
    let settings = ReadSettings { layer: Some("ViewLayer.DiffCol".into()), background, ..Default::default() };
    let chosen = scene("exr_blender_noisy", settings).unwrap();
    assert!(chosen.views[0].photo.to_linear() == albedo);
}

#[test]
fn display_p3_becomes_rec_709() {
    let Some(folder) = cases() else { return };
    let path = folder.join("files/jpg_p3.jpg");
    let photo = file::read_photo(&path, &PhotoOptions::default()).unwrap();
    assert!(photo.findings.iter().any(|finding| finding.message.contains("Display P3")), "{:?}", photo.findings);
    let converted = photo.into_linear();
    let stored = file::read_srgb8(&path).unwrap().map(|bytes| patina::image::transfer::linear_from_srgb8(*bytes));
    // Linear Rec. 709 of linear Display P3 by SMPTE RP 177, to four digits.
    let rows = [[1.2249, -0.2249, 0.0], [-0.0421, 1.0421, 0.0], [-0.0196, -0.0786, 1.0983]].map(Vec3::from_array);
    let mut largest = 0.0f32;
    for (found, stored) in converted.pixels().iter().zip(stored.pixels()) {
        let expected = Vec3::from_array(rows.map(|row| row.dot(*stored)));
        assert!((*found - expected).abs().max_element() < 2e-3, "{found} for {expected}");
        largest = largest.max((found.x - stored.x) / stored.x.max(1e-3));
    }
    assert!(largest > 0.2, "some red was off by {largest}");
    let scene = scene("jpg_p3", ReadSettings::default()).unwrap();
    let told = scene.findings.iter().find(|finding| finding.code == "colour-converted").unwrap();
    assert!(told.message.ends_with("(all 8 photos)"), "one finding for all: {}", told.message);
}

#[test]
fn sixteen_bits_of_a_dark_scene_keep_their_precision() {
    let settings = ReadSettings { encoding: ColourEncoding::Linear, ..Default::default() };
    let Some(scene) = scene("png16_dark_linear", settings) else { return };
    // Medians of the luminance under the masks, by another reader of the files. Of 8 bits each would be 1 / 255.
    for (view, expected) in scene.views.iter().zip([0.004_430_230, 0.004_662_721, 0.002_745_385]) {
        let lit = view.photo.to_linear();
        let object = lit.pixels().iter().zip(view.states.pixels()).filter(|(_, state)| state.is_surface());
        let values: Vec<f64> = object.map(|(pixel, _)| f64::from(luminance(*pixel))).collect();
        let found = quantile(&values, 0.5);
        assert!((found - expected).abs() < 1e-6, "{}: {found}", view.name);
    }
}

#[test]
fn radiance_pictures_of_all_kinds_hold_the_same_light() {
    let Some(folder) = cases() else { return };
    let read = |name: &str| file::read_rgb(&folder.join("files").join(name)).unwrap();
    let plain = read("rgbe_sig.hdr");
    assert_eq!(read("exposure.hdr"), plain);
    assert_eq!(read("plus_y.hdr"), plain);
    // Each file rounds to eight bits of its largest channel, XYZ and RGB to different ones.
    let xyz = read("xyze.hdr");
    for (a, b) in xyz.pixels().iter().zip(plain.pixels()) {
        assert!((*a - *b).abs().max_element() < 0.03 * b.max_element().max(1e-3), "{a} for {b}");
    }
}

#[test]
fn a_jpeg_without_an_end_marker_is_read_and_told() {
    let Some(folder) = cases() else { return };
    let photo = file::read_photo(&folder.join("files/jpg_no_eoi.jpg"), &PhotoOptions::default()).unwrap();
    assert_eq!(photo.findings[0].code, "jpeg-no-end");
    let bytes = std::fs::read(folder.join("files/jpg_no_eoi.jpg")).unwrap();
    let whole =
        file::read_photo_from(Path::new("a"), [bytes.as_slice(), &[0xff, 0xd9]].concat(), &PhotoOptions::default());
    assert_eq!(photo.pixels, whole.unwrap().pixels);
}

#[test]
fn masks_with_the_photo_s_extension_in_their_names_are_used() {
    let Some(masked) = scene("masks_colmap_names", ReadSettings::default()) else { return };
    let ignored = ReadSettings { masks: MaskUse::Ignore, ..Default::default() };
    let without = scene("masks_colmap_names", ignored).unwrap();
    assert!(masked.views.iter().all(|view| view.has_mask()));
    assert!(without.views.iter().all(|view| !view.has_mask()));
}

#[test]
fn plain_scenes_say_nothing_new() {
    for name in ["tri", "saha6"] {
        let Some(scene) = scene(name, ReadSettings::default()) else { return };
        let codes: Vec<_> = scene.findings.iter().map(|finding| finding.code).collect();
        for code in ["colour-converted", "photo-turned", "mask-without-photo", "profile-damaged"] {
            assert!(!codes.contains(&code), "{name}: {codes:?}");
        }
    }
}
