//! From the drawn scene to the screen: display transform, photo, traced picture, and when nothing is drawn anew.

use super::common::{assert_colour, one_material, pixels, sphere_frame, test_picture, window};
use crate::window_tests::adapter::has_adapter;
use eframe::egui::{self, Color32};
use glam::{Vec2, Vec3};
use patina::image::Image;
use patina::image::display::{DisplaySettings, ToneCurve};
use patina::light::Environment;
use patina::scene::Camera;
use patina::studio::stage::eye::Eye;
use patina::studio::stage::eye::OrbitEye;
use patina::studio::stage::{Backdrop, PhotoMode, StageFrame};
use std::sync::Arc;

const SIZE: Vec2 = Vec2::new(120.0, 80.0);

fn white_sphere() -> StageFrame {
    let mut frame =
        sphere_frame(one_material(Vec3::ONE, Vec3::ZERO, 1.0), Environment::constant(16, 8, Vec3::splat(0.5)));
    frame.look.display.curve = ToneCurve::Linear;
    frame.look.backdrop = Backdrop::Colour(Color32::from_rgb(10, 20, 30));
    frame
}

#[test]
fn the_shader_shows_radiance_as_the_library_does() {
    if !has_adapter() {
        return;
    }
    let mut picture = test_picture(120, 80);
    for (place, hard) in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, 0.0, 6e4, 1e-4].into_iter().enumerate() {
        for column in 0..20 {
            picture[(10 * place + 3, 5 * column)] = Vec3::splat(hard);
            picture[(10 * place + 4, 5 * column)] = Vec3::new(0.5, hard, 0.1);
        }
    }
    let mut frame = white_sphere();
    frame.content.traced = Some(Arc::new(picture.clone()));
    let mut window = window(SIZE, frame);
    let mut compared = 0;
    for (curve, name) in ToneCurve::NAMED {
        for exposure_stops in [-2.5, 0.0, 1.3] {
            for (false_colour, stripes) in [(false, false), (true, false), (false, true), (true, true)] {
                let display = DisplaySettings { exposure_stops, curve, false_colour, stripes };
                let shown = pixels(&mut window, |frame| frame.look.display = display);
                for row in 0..80 {
                    for column in 0..120 {
                        let expected = display.bytes(picture[(row, column)], row as u32, column as u32);
                        let place = format!("{name} {display:?} row {row} column {column}");
                        assert_colour(shown[(row, column)], expected, 1, &place);
                        compared += 1;
                    }
                }
            }
        }
    }
    assert_eq!(compared, 36 * 80 * 120);
    assert_eq!(window.state().stage.status().scenes_drawn, 1, "a display setting does not draw the scene anew");
}

#[test]
fn a_traced_picture_of_another_size_is_stretched_over_the_whole_stage() {
    if !has_adapter() {
        return;
    }
    let mut frame = white_sphere();
    let half = Image::from_fn(60, 40, |row, _| Vec3::splat(if row < 20 { 0.25 } else { 0.75 }));
    frame.content.traced = Some(Arc::new(half));
    let mut window = window(SIZE, frame);
    let shown = pixels(&mut window, |_| {});
    assert_colour(shown[(20, 60)], [64; 3], 1, "upper half");
    assert_colour(shown[(60, 5)], [191; 3], 1, "lower half");
    let raster = pixels(&mut window, |frame| frame.content.traced = None);
    assert_colour(raster[(40, 60)], [128; 3], 2, "the mesh again");
}

#[test]
fn a_photo_lies_on_the_pixels_of_its_camera() {
    if !has_adapter() {
        return;
    }
    let camera = Camera::looking_at(Vec3::new(0.0, 0.0, 4.0), Vec3::ZERO, 100, 80, 0.8);
    let photo = test_picture(100, 80);
    let mut frame = white_sphere();
    frame.eye = Eye::Photo(camera);
    frame.content.photo = Some(Arc::new(photo.clone()));
    let mut window = window(SIZE, frame);
    let display = window.state().frame.look.display;
    let expected = |row: usize, column: usize| display.bytes(photo[(row, column - 10)], 0, 0);

    let off = pixels(&mut window, |_| {});
    assert_colour(off[(40, 60)], [128; 3], 2, "off");
    let wiped = pixels(&mut window, |frame| frame.look.photo_mode = PhotoMode::Wipe(0.5));
    for row in 0..80 {
        for column in 10..58 {
            assert_colour(wiped[(row, column)], expected(row, column), 1, "the photo left of the wipe");
        }
        for column in 62..110 {
            assert_colour(wiped[(row, column)], off[(row, column)], 0, "the mesh right of the wipe");
        }
    }
    let over = pixels(&mut window, |frame| frame.look.photo_mode = PhotoMode::Over(1.0));
    let mixed = pixels(&mut window, |frame| frame.look.photo_mode = PhotoMode::Over(0.25));
    let under = pixels(&mut window, |frame| frame.look.photo_mode = PhotoMode::Under);
    for (row, column) in [(3, 12), (70, 100), (40, 60), (20, 90)] {
        assert_colour(over[(row, column)], expected(row, column), 1, "the photo over the mesh");
        let blend: [u8; 3] = std::array::from_fn(|channel| {
            let parts = [0.75 * f32::from(off[(row, column)][channel]), 0.25 * f32::from(over[(row, column)][channel])];
            (parts[0] + parts[1]).round() as u8
        });
        assert_colour(mixed[(row, column)], blend, 2, "a quarter of the photo");
    }
    assert_colour(under[(40, 60)], [128; 3], 2, "the mesh before the photo");
    assert_colour(under[(3, 12)], expected(3, 12), 1, "the photo behind the mesh");
    let orbit = Eye::Orbit(OrbitEye::default());
    let left = pixels(&mut window, |frame| (frame.eye, frame.look.photo_mode) = (orbit, PhotoMode::Over(1.0)));
    assert_colour(left[(40, 60)], [128; 3], 2, "no photo beside its camera");
}

#[test]
fn the_scene_is_drawn_anew_only_when_it_looks_different() {
    if !has_adapter() {
        return;
    }
    let mut window = window(SIZE, white_sphere());
    let drawn = |window: &egui_kittest::Harness<'_, super::common::Shown>| window.state().stage.status().scenes_drawn;
    pixels(&mut window, |_| {});
    assert_eq!(drawn(&window), 1);
    pixels(&mut window, |frame| frame.look.display.exposure_stops = 2.0);
    pixels(&mut window, |frame| frame.content.photo = Some(Arc::new(test_picture(8, 8))));
    assert_eq!((drawn(&window), window.state().stage.status().frames_shown), (1, 3));
    pixels(&mut window, |frame| frame.content.light.as_mut().unwrap().strength = 2.0);
    assert_eq!(drawn(&window), 2);
    // An equal mesh behind another pointer is another mesh.
    pixels(&mut window, |frame| {
        frame.content.mesh = frame.content.mesh.take().map(|mesh| Arc::new(mesh.as_ref().clone()));
    });
    assert_eq!(drawn(&window), 3);
    let coarse = pixels(&mut window, |frame| frame.look.resolution_scale = 0.5);
    assert_eq!(drawn(&window), 4);
    assert_colour(coarse[(40, 60)], [255; 3], 0, "coarse, and two stops brighter");
    assert_colour(coarse[(2, 2)], [10, 20, 30], 0, "behind, coarse");
}

#[test]
fn nothing_to_show_and_no_room_to_show_it_in_are_borne() {
    if !has_adapter() {
        return;
    }
    let mut window = window(SIZE, StageFrame::default());
    pixels(&mut window, |_| {});
    window.set_size(egui::vec2(1.0, 1.0));
    pixels(&mut window, |frame| *frame = white_sphere());
    window.set_size(egui::vec2(300.0, 2.0));
    pixels(&mut window, |frame| frame.look.resolution_scale = f32::NAN);
    window.set_size(egui::vec2(120.0, 80.0));
    let broken = pixels(&mut window, |frame| {
        let mut mesh = frame.content.mesh.as_deref().unwrap().clone();
        mesh.triangles[3][1] = 999_999;
        frame.content.mesh = Some(Arc::new(mesh));
        frame.content.photo = Some(Arc::default());
        frame.eye = Eye::Orbit(OrbitEye { distance: f32::NAN, target: Vec3::NAN, ..OrbitEye::default() });
    });
    assert_colour(broken[(40, 60)], [10, 20, 30], 0, "no mesh");
    let findings = window.state().stage.status().findings;
    assert!(findings.iter().any(|finding| finding.code == "stage-mesh-invalid"), "{findings:?}");
}

#[test]
fn uploads_on_another_thread_arrive() {
    if !has_adapter() {
        return;
    }
    let mut window = window(SIZE, StageFrame::default());
    pixels(&mut window, |frame| {
        *frame = white_sphere();
        frame.wait_for_uploads = false;
    });
    let mut shown = pixels(&mut window, |_| {});
    for _ in 0..600 {
        if !window.state().stage.status().is_uploading {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(20));
        shown = pixels(&mut window, |_| {});
    }
    assert!(!window.state().stage.status().is_uploading);
    assert_colour(shown[(40, 60)], [128; 3], 2, "lit at last");
}

#[test]
fn hands_move_the_eye() {
    if !has_adapter() {
        return;
    }
    let mut window = window(SIZE, white_sphere());
    let orbit = |window: &egui_kittest::Harness<'_, super::common::Shown>| match window.state().frame.eye {
        Eye::Orbit(orbit) => orbit,
        Eye::Photo(_) => panic!("an orbit"),
    };
    window.step();
    let before = orbit(&window);
    window.drag_at(egui::pos2(60.0, 40.0));
    window.step();
    window.hover_at(egui::pos2(80.0, 50.0));
    window.step();
    window.drop_at(egui::pos2(80.0, 50.0));
    window.step();
    let turned = orbit(&window);
    assert!(turned.yaw_radians != before.yaw_radians && turned.pitch_radians > before.pitch_radians, "{turned:?}");
    assert_eq!((turned.distance, turned.target), (before.distance, before.target));
    window.hover_at(egui::pos2(70.0, 45.0));
    window.step();
    window.event(egui::Event::MouseWheel {
        unit: egui::MouseWheelUnit::Point,
        delta: egui::vec2(0.0, 60.0),
        phase: egui::TouchPhase::Move,
        source: egui::MouseWheelSource::Wheel,
        modifiers: egui::Modifiers::NONE,
    });
    window.run_steps(10);
    assert!(orbit(&window).distance < turned.distance, "the wheel goes nearer");
}
