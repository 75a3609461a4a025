//! Cameras on the stage.

use super::common::{assert_colour, pixels, window};
use crate::window_tests::adapter::has_adapter;
use eframe::egui::Color32;
use glam::{Vec2, Vec3};
use patina::image::Image;
use patina::image::display::{DisplaySettings, scale_colour};
use patina::scene::Camera;
use patina::studio::stage::eye::Eye;
use patina::studio::stage::eye::OrbitEye;
use patina::studio::stage::{Backdrop, StageCamera, StageContent, StageFrame, StageLook, frustum_depth, pick_camera};
use std::sync::Arc;

const SIZE: Vec2 = Vec2::new(320.0, 240.0);

/// Two cameras that look along -z beside each other, seen from behind and above.
fn two_cameras() -> Vec<StageCamera> {
    [-1.0, 1.0]
        .map(|x| {
            let place = Vec3::new(x, 0.0, 0.0);
            StageCamera::new(Camera::looking_at(place, place + Vec3::NEG_Z, 40, 30, 0.9))
        })
        .to_vec()
}

fn frame(cameras: Vec<StageCamera>) -> StageFrame {
    let content = StageContent { cameras: Arc::new(cameras), frustum_depth: 1.0, ..StageContent::default() };
    let orbit = OrbitEye { distance: 5.0, yaw_radians: 0.2, pitch_radians: 0.3, ..OrbitEye::default() };
    let look = StageLook { backdrop: Backdrop::Colour(Color32::BLACK), ..StageLook::default() };
    StageFrame { eye: Eye::Orbit(orbit), content, look, ..StageFrame::default() }
}

/// The brightest of the 3 x 3 pixels about a point of the world.
fn brightest(picture: &Image<[u8; 3]>, eye: &Eye, point: Vec3) -> [u8; 3] {
    let (place, _) = eye.project(point, SIZE).unwrap();
    let around = (-1..=1).flat_map(|row| (-1..=1).map(move |column| (row, column)));
    around
        .map(|(row, column)| picture[((place.y as i32 + row) as usize, (place.x as i32 + column) as usize)])
        .max_by_key(|rgb| rgb.iter().map(|&byte| u32::from(byte)).sum::<u32>())
        .unwrap()
}

fn bytes(rgb: Vec3) -> [u8; 3] {
    (rgb * 255.0).round().to_array().map(|value| value as u8)
}

#[test]
fn frustums_have_the_colour_of_their_error_and_the_selected_one_the_accent() {
    if !has_adapter() {
        return;
    }
    let mut cameras = two_cameras();
    cameras[0].error_0_1 = Some(0.7);
    cameras[1].selected = true;
    let frame = frame(cameras.clone());
    let (eye, accent) = (frame.eye, frame.look.accent);
    let mut window = window(SIZE, frame);
    let picture = pixels(&mut window, |_| {});
    let edge = |camera: &StageCamera| {
        let ray = camera.camera.ray_through(Vec2::ZERO);
        ray.origin + 0.5 * ray.direction
    };
    assert_colour(brightest(&picture, &eye, edge(&cameras[0])), bytes(scale_colour(0.7)), 40, "error 0.7");
    assert_colour(brightest(&picture, &eye, edge(&cameras[1])), [accent.r(), accent.g(), accent.b()], 8, "selected");
    // Held out is dashed: fewer pixels are lit.
    let lit = |picture: &Image<[u8; 3]>| picture.pixels().iter().filter(|rgb| **rgb != [0; 3]).count();
    let solid = lit(&picture);
    let dashed = pixels(&mut window, |frame| {
        let mut cameras = two_cameras();
        cameras.iter_mut().for_each(|camera| camera.held_out = true);
        cameras[1].selected = true;
        frame.content.cameras = Arc::new(cameras);
    });
    assert!(lit(&dashed) < solid * 8 / 10 && lit(&dashed) > solid / 4, "{} of {solid}", lit(&dashed));
    let none = pixels(&mut window, |frame| frame.content.frustum_depth = 0.0);
    assert_eq!(lit(&none), 0);
}

#[test]
fn thumbnails_stand_upright_on_the_image_plane() {
    if !has_adapter() {
        return;
    }
    let mut cameras = two_cameras();
    // Upper left quarter red, upper right green, below blue.
    let photo = Image::from_fn(300, 400, |row, column| match (row < 200, column < 150) {
        (true, true) => Vec3::new(0.8, 0.0, 0.0),
        (true, false) => Vec3::new(0.0, 0.8, 0.0),
        _ => Vec3::new(0.0, 0.0, 0.8),
    });
    cameras[1].thumbnail = Some(Arc::new(photo.clone()));
    let frame = frame(cameras.clone());
    let eye = frame.eye;
    let mut window = window(SIZE, frame);
    let picture = pixels(&mut window, |_| {});
    let display = DisplaySettings::default();
    for (place, of_photo) in
        [(Vec2::new(10.0, 7.0), (50, 50)), (Vec2::new(30.0, 7.0), (50, 250)), (Vec2::new(20.0, 25.0), (350, 150))]
    {
        let on_plane = cameras[1].camera.ray_through(place);
        let point = on_plane.origin + on_plane.direction / on_plane.direction.dot(Vec3::NEG_Z);
        let (on_screen, _) = eye.project(point, SIZE).unwrap();
        let found = picture[(on_screen.y as usize, on_screen.x as usize)];
        assert_colour(found, display.bytes(photo[of_photo], 0, 0), 8, &format!("{place}"));
    }
}

#[test]
fn the_pointer_finds_what_is_drawn() {
    let cameras = two_cameras();
    let eye = frame(cameras.clone()).eye;
    let depth = frustum_depth(&cameras, Some((Vec3::NEG_ONE, Vec3::ONE)));
    assert!(depth > 0.0);
    for (index, camera) in cameras.iter().enumerate() {
        let (place, _) = eye.project(camera.camera.position_in_world() + Vec3::NEG_Z * 0.8, SIZE).unwrap();
        assert_eq!(pick_camera(&cameras, 1.0, &eye, place, SIZE), Some(index));
    }
    assert_eq!(pick_camera(&cameras, 1.0, &eye, Vec2::new(160.0, 235.0), SIZE), None);
}
