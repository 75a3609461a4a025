//! How long a frame takes. Printed, never asserted.

use crate::common::{has_adapter, pixels, sphere, window};
use glam::{Vec2, Vec3};
use patina::image::Image;
use patina::light::sky::{SkySettings, sun_and_sky};
use patina::material::MaterialMaps;
use patina::studio::stage::{Backdrop, Eye, OrbitEye, StageContent, StageFrame, StageLight};
use std::sync::Arc;
use std::time::Instant;

#[test]
fn frame_times_of_a_large_scene() {
    if !has_adapter() {
        return;
    }
    let mesh = sphere(675, 337);
    println!("{} triangles", mesh.triangles.len());
    let side = 2048;
    let maps = MaterialMaps {
        diffuse: Image::from_fn(side, side, |row, column| {
            Vec3::splat(0.3 + 0.3 * ((row / 32 + column / 32) % 2) as f32)
        }),
        specular: Image::filled(side, side, Vec3::splat(0.04)),
        roughness: Image::from_fn(side, side, |row, _| 0.05 + 0.9 * row as f32 / side as f32),
    };
    let content = StageContent {
        mesh: Some(Arc::new(mesh)),
        maps: Some(Arc::new(maps)),
        light: Some(StageLight::new(Arc::new(sun_and_sky(64, 32, &SkySettings::noon())))),
        ..StageContent::default()
    };
    let mut window = window(Vec2::new(1280.0, 800.0), StageFrame::default());
    let empty = timed(&mut window, 3, |_| {});
    let first = timed(&mut window, 1, |frame| {
        frame.content = content.clone();
        frame.look.backdrop = Backdrop::Light;
        frame.wait_for_uploads = true;
    });
    let turn = |frame: &mut StageFrame| {
        if let Eye::Orbit(orbit) = &mut frame.eye {
            orbit.orbit(Vec2::new(0.02, 0.0));
        }
    };
    let shown = timed(&mut window, 5, |_| {});
    let drawn = timed(&mut window, 5, turn);
    let coarse = timed(&mut window, 5, |frame| {
        frame.look.resolution_scale = 0.5;
        turn(frame);
    });
    let near = timed(&mut window, 5, |frame| {
        frame.look.resolution_scale = 1.0;
        frame.eye = Eye::Orbit(OrbitEye { distance: 1.4, ..OrbitEye::default() });
        turn(frame);
    });
    println!("1280 x 800, milliseconds a frame with reading the picture back:");
    println!("nothing {empty:.0}, first with all uploads {first:.0}, only shown {shown:.0}");
    println!("drawn anew {drawn:.0}, at half the resolution {coarse:.0}, filling the screen {near:.0}");
}

fn timed(
    window: &mut egui_kittest::Harness<'_, crate::common::Shown>,
    frames: usize,
    mut change: impl FnMut(&mut StageFrame),
) -> f64 {
    let start = Instant::now();
    for _ in 0..frames {
        pixels(window, &mut change);
    }
    start.elapsed().as_secs_f64() * 1e3 / frames as f64
}
