//! The stage beside the path tracer, and pictures of the demo scene for a person to look at.

use super::common::{one_material, pixels, sphere, sphere_frame, window};
use crate::window_tests::adapter::has_adapter;
use eframe::egui::Color32;
use glam::{Vec2, Vec3};
use patina::image::Image;
use patina::image::display::{DisplaySettings, ToneCurve};
use patina::light::sky::{SkySettings, sun_and_sky};
use patina::render::Surface;
use patina::render::picture::{PictureSettings, render};
use patina::scene::demo::{DemoSettings, build};
use patina::studio::stage::eye::Eye;
use patina::studio::stage::eye::OrbitEye;
use patina::studio::stage::{
    Backdrop, CoveredTexels, Layer, PhotoMode, StageCamera, StageContent, StageFrame, StageLight, StageQuantity,
    frustum_depth,
};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

const LINEAR: DisplaySettings =
    DisplaySettings { exposure_stops: -1.0, curve: ToneCurve::Linear, false_colour: false, stripes: false };

fn settings(samples: usize) -> PictureSettings {
    PictureSettings { samples, max_bounces: 1, ..PictureSettings::default() }
}

#[test]
fn a_glossy_sphere_looks_as_the_path_tracer_says() {
    if !has_adapter() {
        return;
    }
    let sky = sun_and_sky(64, 32, &SkySettings::overcast());
    for roughness in [0.02, 0.15, 0.6] {
        let maps = one_material(Vec3::new(0.3, 0.2, 0.1), Vec3::splat(0.4), roughness);
        let parameters = patina::job::pictures::parameters(&maps, &sky);
        let mut frame = sphere_frame(maps, sky.clone());
        (frame.look.display, frame.look.backdrop, frame.content.lobe_strength) = (LINEAR, Backdrop::Light, 1.0);
        let eye = frame.eye;
        let shown = pixels(&mut window(Vec2::new(72.0, 54.0), frame), |_| {});
        let surface = Surface::new(sphere(96, 48)).unwrap();
        let stop = AtomicBool::new(false);
        let traced = render(&surface, &eye.as_camera(72, 54), &parameters, 0, &settings(128), &stop);
        let (mut difference, mut sum) = (0.0, 0.0);
        for row in 0..54 {
            for column in 0..72 {
                let expected = (traced.radiance[(row, column)] * 0.5).min(Vec3::ONE);
                let found = Vec3::from_array(shown[(row, column)].map(f32::from)) / 255.0;
                difference += (found - expected).abs().element_sum();
                sum += expected.element_sum();
            }
        }
        println!("roughness {roughness}: mean difference {:.2} % of the mean", 100.0 * difference / sum);
        assert!(difference < 0.05 * sum, "roughness {roughness}: {difference} of {sum}");
    }
}

/// Where pictures for a person go; `None` in everyday tests.
fn folder() -> Option<PathBuf> {
    std::env::var_os("PATINA_STAGE_PICTURES").map(PathBuf::from)
}

fn save(folder: &Path, name: &str, picture: &Image<[u8; 3]>) {
    patina::image::file::write_png_srgb8(&folder.join(format!("stage_{name}.png")), picture).unwrap();
}

#[test]
fn pictures_of_the_demo_scene() {
    if !has_adapter() {
        return;
    }
    let Some(folder) = folder() else {
        println!("skipped: PATINA_STAGE_PICTURES not set");
        return;
    };
    let demo = build(&DemoSettings {
        views: 24,
        held_out: 4,
        width: 160,
        height: 120,
        map_size: 512,
        seed: 1,
        ..Default::default()
    })
    .unwrap();
    let truth = demo.scene.truth.clone().unwrap();
    let parameters = patina::job::pictures::parameters(&truth.maps, &truth.environment);
    let surface = Surface::new(demo.scene.mesh.clone()).unwrap();
    let stop = AtomicBool::new(false);
    let photo = |camera: &patina::scene::Camera| {
        Arc::new(render(&surface, camera, &parameters, 0, &settings(16), &stop).radiance)
    };
    let mut cameras: Vec<StageCamera> = demo.scene.views.iter().map(|view| StageCamera::new(view.camera)).collect();
    for (index, camera) in cameras.iter_mut().enumerate() {
        camera.error_0_1 = (index % 7 != 6).then_some(index as f32 / 27.0);
        camera.held_out = index >= 24;
        camera.excluded = index == 5 || index == 11;
        camera.selected = index == 3;
        camera.thumbnail = (index % 2 == 1).then(|| photo(&camera.camera));
    }
    let camera = demo.scene.views[3].camera;
    let bounds = demo.scene.mesh.bounds();
    let noise = Image::from_fn(512, 512, |row, column| {
        let covered = demo.covered[(row, column)];
        if covered { (row as f32 * 0.02).sin() + (column as f32 * 0.03).cos() } else { f32::NAN }
    });
    let content = StageContent {
        mesh: Some(Arc::new(demo.scene.mesh.clone())),
        maps: Some(Arc::new(truth.maps.clone())),
        covered: Some({
            let covered = demo.covered.clone();
            Arc::new(CoveredTexels::new(Box::new(move || covered)))
        }),
        light: Some(StageLight::new(Arc::new(truth.environment.clone()))),
        quantity: Some(StageQuantity { texels: Arc::new(noise), range: [-2.0, 2.0] }),
        ..StageContent::default()
    };
    let mut orbit = OrbitEye { pitch_radians: 0.35, ..OrbitEye::default() };
    orbit.fit(bounds.unwrap(), 1.6);
    let mut frame = StageFrame { eye: Eye::Orbit(orbit), content, ..StageFrame::default() };
    frame.look.display.curve = ToneCurve::Filmic;
    let mut window = window(Vec2::new(960.0, 600.0), frame);
    save(&folder, "lit", &pixels(&mut window, |_| {}));
    save(&folder, "lit_smooth", &pixels(&mut window, |frame| frame.look.resolution_scale = 2.0));
    save(&folder, "lit_coarse", &pixels(&mut window, |frame| frame.look.resolution_scale = 0.5));
    save(
        &folder,
        "light_behind",
        &pixels(&mut window, |frame| {
            (frame.look.resolution_scale, frame.look.backdrop) = (1.0, Backdrop::Light);
        }),
    );
    for (layer, name) in Layer::NAMED {
        let name = name.to_lowercase().replace(' ', "_");
        save(
            &folder,
            &format!("layer_{name}"),
            &pixels(&mut window, |frame| {
                (frame.look.layer, frame.look.backdrop) = (layer, Backdrop::Colour(Color32::from_gray(38)));
            }),
        );
    }
    save(
        &folder,
        "two_lights",
        &pixels(&mut window, |frame| {
            (frame.look.layer, frame.look.light_wipe) = (Layer::Lit, Some(0.5));
            frame.content.other_light = Some(StageLight::new(Arc::new(truth.relight.clone().unwrap().environment)));
        }),
    );
    for (name, grey) in [("frustums", 38), ("frustums_light", 235)] {
        save(
            &folder,
            name,
            &pixels(&mut window, |frame| {
                frame.look.light_wipe = None;
                frame.look.backdrop = Backdrop::Colour(Color32::from_gray(grey));
                frame.content.frustum_depth = frustum_depth(&cameras, bounds);
                frame.content.cameras = Arc::new(cameras.clone());
                if let Eye::Orbit(orbit) = &mut frame.eye {
                    orbit.distance = 16.0;
                }
            }),
        );
    }
    for (name, mode) in [("photo_wipe", PhotoMode::Wipe(0.5)), ("photo_under", PhotoMode::Under)] {
        save(
            &folder,
            name,
            &pixels(&mut window, |frame| {
                (frame.eye, frame.look.photo_mode) = (Eye::Photo(camera), mode);
                frame.content.photo = Some(photo(&camera));
            }),
        );
    }
    let traced =
        |eye: Eye| Arc::new(render(&surface, &eye.as_camera(480, 300), &parameters, 0, &settings(16), &stop).radiance);
    save(
        &folder,
        "traced",
        &pixels(&mut window, |frame| {
            (frame.eye, frame.look.photo_mode) = (Eye::Orbit(orbit), PhotoMode::Off);
            frame.content.cameras = Arc::default();
            frame.content.traced = Some(traced(frame.eye));
        }),
    );
    save(
        &folder,
        "stripes",
        &pixels(&mut window, |frame| {
            frame.content.traced = None;
            frame.look.display.stripes = true;
        }),
    );
}
