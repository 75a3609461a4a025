//! How long a frame takes. Printed, never asserted.

use super::common::{sphere, try_pixels, window};
use crate::window_tests::adapter::has_adapter;
use glam::{Vec2, Vec3};
use patina::image::Image;
use patina::light::sky::{SkySettings, sun_and_sky};
use patina::material::MaterialMaps;
use patina::studio::stage::eye::Eye;
use patina::studio::stage::eye::OrbitEye;
use patina::studio::stage::{Backdrop, Layer, StageContent, StageFrame, StageLight};
use std::sync::Arc;
use std::time::Instant;

#[test]
#[ignore = "slow: a large scene drawn on the processor; times are printed for a person"]
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
    let mut bare = egui_kittest::Harness::builder().with_size([1280.0, 800.0]).wgpu().build_ui(|_| {});
    let start = Instant::now();
    for _ in 0..5 {
        bare.step();
        if bare.render().is_err() {
            println!("a frame took too long");
        }
    }
    println!("a window without a stage: {:.0} ms a frame", start.elapsed().as_secs_f64() * 200.0);
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
    let normals = timed(&mut window, 5, |frame| {
        frame.look.layer = Layer::Normal;
        if let Eye::Orbit(orbit) = &mut frame.eye {
            orbit.distance = OrbitEye::default().distance;
        }
        turn(frame);
    });
    println!("1280 x 800, milliseconds a frame with reading the picture back, elapsed / of all cores together:");
    for (name, figures) in [
        ("nothing", empty),
        ("first, with all uploads", first),
        ("only shown", shown),
        ("drawn anew", drawn),
        ("drawn anew at half the resolution", coarse),
        ("drawn anew, normals alone", normals),
        ("drawn anew, filling the screen", near),
    ] {
        println!("{name}: {:.0} / {:.0}", figures[0], figures[1]);
    }
}

/// Milliseconds a frame: elapsed, and spent by all threads of the process.
fn timed(
    window: &mut egui_kittest::Harness<'_, super::common::Shown>,
    frames: usize,
    mut change: impl FnMut(&mut StageFrame),
) -> [f64; 2] {
    let (start, spent) = (Instant::now(), processor_seconds());
    for _ in 0..frames {
        if let Err(error) = try_pixels(window, &mut change) {
            println!("a frame took too long: {error}");
        }
    }
    [start.elapsed().as_secs_f64(), processor_seconds() - spent].map(|seconds| seconds * 1e3 / frames as f64)
}

/// Processor time of this process so far, to a hundredth of a second; 0 where the system does not tell.
fn processor_seconds() -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let numbers: Vec<f64> =
        text.rsplit(") ").next().unwrap_or("").split(' ').map(|word| word.parse().unwrap_or(0.0)).collect();
    // User and system time are the 14th and 15th field, in hundredths; the first after the name is the 3rd.
    numbers.get(11..13).map_or(0.0, |times| times.iter().sum::<f64>() / 100.0)
}
