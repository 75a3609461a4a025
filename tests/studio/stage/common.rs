//! A stage in a window without a display, and scenes small enough to know every pixel.

use eframe::egui;
use egui_kittest::Harness;
use glam::{Vec2, Vec3};
use patina::image::{Image, RgbImage};
use patina::light::Environment;
use patina::material::MaterialMaps;
use patina::scene::Mesh;
use patina::studio::stage::eye::Eye;
use patina::studio::stage::eye::OrbitEye;
use patina::studio::stage::{Stage, StageContent, StageFrame, StageLight};
use std::sync::Arc;

/// A window with nothing but a stage.
pub struct Shown {
    pub stage: Stage,
    pub frame: StageFrame,
    pub bounds: Option<(Vec3, Vec3)>,
    pub rect: egui::Rect,
}

impl eframe::App for Shown {
    fn ui(&mut self, ui: &mut egui::Ui, _frame: &mut eframe::Frame) {
        egui::CentralPanel::no_frame().show(ui, |ui| {
            let response = self.stage.show(ui, &self.frame);
            patina::studio::stage::navigate(&response, &mut self.frame.eye, self.bounds, Default::default());
            self.rect = response.rect;
        });
    }
}

/// A window of this size that shows a frame, every upload waited for.
pub fn window(size: Vec2, frame: StageFrame) -> Harness<'static, Shown> {
    let frame = StageFrame { wait_for_uploads: true, ..frame };
    Harness::builder().with_size(egui::vec2(size.x, size.y)).wgpu().build_eframe(move |creation| Shown {
        stage: Stage::new(creation.wgpu_render_state.as_ref().unwrap()),
        frame,
        bounds: None,
        rect: egui::Rect::NOTHING,
    })
}

/// The bytes on the screen after a change of the frame.
pub fn pixels(harness: &mut Harness<'_, Shown>, change: impl FnOnce(&mut StageFrame)) -> Image<[u8; 3]> {
    try_pixels(harness, change).unwrap()
}

/// [`pixels`], or what the adapter said.
pub fn try_pixels(
    harness: &mut Harness<'_, Shown>,
    change: impl FnOnce(&mut StageFrame),
) -> Result<Image<[u8; 3]>, String> {
    change(&mut harness.state_mut().frame);
    harness.step();
    let picture = crate::window_tests::adapter::rendered(harness)?;
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    Ok(Image::from_pixels(width, height, picture.pixels().map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect()))
}

/// Fails with the place where two colours differ by more than `tolerance` bytes.
pub fn assert_colour(found: [u8; 3], expected: [u8; 3], tolerance: u8, place: &str) {
    let close = (0..3).all(|channel| found[channel].abs_diff(expected[channel]) <= tolerance);
    assert!(close, "{place}: {found:?} instead of {expected:?}");
}

/// A unit sphere about the origin, `u` around and `v` up.
pub fn sphere(columns: usize, rows: usize) -> Mesh {
    let mut mesh = Mesh::default();
    for row in 0..=rows {
        for column in 0..=columns {
            let (u, v) = (column as f32 / columns as f32, 1.0 - row as f32 / rows as f32);
            let point =
                patina::math::sphere::direction_of_angles(std::f32::consts::TAU * u, std::f32::consts::PI * (1.0 - v));
            mesh.positions.push(point);
            mesh.normals.push(point);
            mesh.uvs.push(Vec2::new(u, v));
        }
    }
    let line = columns as u32 + 1;
    for row in 0..rows as u32 {
        for column in 0..columns as u32 {
            let corner = row * line + column;
            // From outside, rows go down and columns to the left.
            mesh.triangles.push([corner, corner + 1, corner + line]);
            mesh.triangles.push([corner + 1, corner + line + 1, corner + line]);
        }
    }
    mesh
}

/// Maps of one material.
pub fn one_material(diffuse: Vec3, specular: Vec3, roughness: f32) -> MaterialMaps {
    MaterialMaps {
        diffuse: Image::filled(16, 16, diffuse),
        specular: Image::filled(16, 16, specular),
        roughness: Image::filled(16, 16, roughness),
    }
}

/// A sphere of a material in a light, seen from +z.
pub fn sphere_frame(maps: MaterialMaps, environment: Environment) -> StageFrame {
    let content = StageContent {
        mesh: Some(Arc::new(sphere(96, 48))),
        maps: Some(Arc::new(maps)),
        lobe_strength: 0.0,
        light: Some(StageLight::new(Arc::new(environment))),
        ..StageContent::default()
    };
    let orbit = OrbitEye { yaw_radians: 0.0, pitch_radians: 0.0, ..OrbitEye::default() };
    StageFrame { eye: Eye::Orbit(orbit), content, ..StageFrame::default() }
}

/// Where the ray through the middle of a pixel first meets the unit sphere; there it is its own normal.
pub fn normal_at(eye: &Eye, row: usize, column: usize, size: Vec2) -> Option<Vec3> {
    let ray = eye.ray_through(Vec2::new(column as f32 + 0.5, row as f32 + 0.5), size);
    let middle = ray.origin.dot(ray.direction);
    let under_root = middle * middle - ray.origin.length_squared() + 1.0;
    (under_root > 0.0).then(|| ray.origin + ray.direction * (-middle - under_root.sqrt()))
}

/// A picture with dark, bright and coloured places, all of them numbers of half precision.
pub fn test_picture(width: usize, height: usize) -> RgbImage {
    let half = |value: f32| half::f16::from_f32(value).to_f32();
    Image::from_fn(width, height, |row, column| {
        let (x, y) = (column as f32 / width as f32, row as f32 / height as f32);
        Vec3::new(half(3.0 * x * x), half(0.02 + y), half((1.5 - x - y).max(0.0)))
    })
}
