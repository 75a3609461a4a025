//! What is drawn on the surface.

use super::common::{assert_colour, normal_at, one_material, pixels, sphere_frame, window};
use crate::window_tests::adapter::has_adapter;
use eframe::egui::Color32;
use glam::{Vec2, Vec3};
use patina::image::Image;
use patina::image::display::{DisplaySettings, ToneCurve, scale_colour};
use patina::light::Environment;
use patina::light::sky::{SkySettings, sun_and_sky};
use patina::studio::stage::eye::Eye;
use patina::studio::stage::eye::OrbitEye;
use patina::studio::stage::{Backdrop, CoveredTexels, Layer, StageLight, StageQuantity};
use std::f32::consts::PI;
use std::sync::Arc;

const SIZE: Vec2 = Vec2::new(160.0, 120.0);
const LINEAR: DisplaySettings =
    DisplaySettings { exposure_stops: 0.0, curve: ToneCurve::Linear, false_colour: false, stripes: false };
/// Rows and columns on the sphere, from its middle to near its border.
const ON_SPHERE: [(usize, usize); 5] = [(60, 80), (40, 70), (75, 105), (60, 50), (93, 84)];

#[test]
fn an_even_light_on_matt_white_is_reflectance_times_radiance() {
    if !has_adapter() {
        return;
    }
    let mut frame = sphere_frame(
        one_material(Vec3::new(0.5, 0.25, 1.0), Vec3::ZERO, 1.0),
        Environment::constant(16, 8, Vec3::splat(0.8)),
    );
    frame.look.display = LINEAR;
    frame.look.backdrop = Backdrop::Colour(Color32::from_rgb(10, 20, 30));
    let mut window = window(SIZE, frame);
    let picture = pixels(&mut window, |_| {});
    for (row, column) in ON_SPHERE {
        for (channel, expected) in [0.4, 0.2, 0.8].into_iter().enumerate() {
            let found = f32::from(picture[(row, column)][channel]) / 255.0;
            assert!((found / expected - 1.0f32).abs() < 0.02, "row {row} column {column}: {found} for {expected}");
        }
    }
    assert_colour(picture[(2, 2)], [10, 20, 30], 0, "behind");
    // A strength and a stop double; both together are cut at white.
    let brighter = pixels(&mut window, |frame| frame.content.light.as_mut().unwrap().strength = 1.2);
    assert_colour(brighter[(60, 80)], [122, 61, 245], 2, "strength 1.2");
    let stop = pixels(&mut window, |frame| frame.look.display.exposure_stops = 1.0);
    assert_colour(stop[(60, 80)], [245, 122, 255], 4, "a stop more");
}

#[test]
fn a_mirror_in_an_even_light_is_as_bright_as_the_light() {
    if !has_adapter() {
        return;
    }
    let light = Environment::constant(16, 8, Vec3::splat(0.6));
    let mut frame = sphere_frame(one_material(Vec3::ZERO, Vec3::ONE, 1e-4), light);
    (frame.look.display, frame.content.lobe_strength) = (LINEAR, 1.0);
    let picture = pixels(&mut window(SIZE, frame), |_| {});
    assert_colour(picture[(60, 80)], [153; 3], 5, "mirror");
}

#[test]
fn maps_and_normals_are_shown_as_they_are() {
    if !has_adapter() {
        return;
    }
    let (diffuse, specular, roughness) = (Vec3::new(0.2, 0.4, 0.6), Vec3::new(0.04, 0.5, 0.9), 0.3);
    let light = Environment::constant(16, 8, Vec3::ONE);
    let mut window = window(SIZE, sphere_frame(one_material(diffuse, specular, roughness), light));
    let display = DisplaySettings::default();
    for (layer, value) in [
        (Layer::Diffuse, diffuse),
        (Layer::Specular, specular),
        (Layer::Roughness, Vec3::splat(roughness.sqrt().sqrt())),
    ] {
        for stops in [0.0, -3.0] {
            let picture = pixels(&mut window, |frame| {
                (frame.look.layer, frame.look.display.exposure_stops) = (layer, stops);
            });
            let place = format!("{layer:?} at {stops} stops");
            assert_colour(picture[(60, 80)], display.bytes(value, 60, 80), 1, &place);
        }
    }
    for eye in [OrbitEye { yaw_radians: 0.0, pitch_radians: 0.0, ..OrbitEye::default() }, OrbitEye::default()] {
        let eye = Eye::Orbit(eye);
        let picture = pixels(&mut window, |frame| (frame.look.layer, frame.eye) = (Layer::Normal, eye));
        for (row, column) in ON_SPHERE {
            let normal = normal_at(&eye, row, column, SIZE).unwrap();
            let expected = (0.5 * normal + 0.5) * 255.0;
            assert_colour(picture[(row, column)], expected.round().to_array().map(|value| value as u8), 2, "normal");
        }
    }
}

#[test]
fn a_sky_shades_by_its_irradiance_and_turns_as_the_library_turns_it() {
    if !has_adapter() {
        return;
    }
    let sky = sun_and_sky(64, 32, &SkySettings::noon());
    let mut frame = sphere_frame(one_material(Vec3::ONE, Vec3::ZERO, 1.0), sky.clone());
    frame.look.display = DisplaySettings { exposure_stops: -2.0, ..LINEAR };
    frame.look.backdrop = Backdrop::Light;
    let mut window = window(SIZE, frame);
    for turn in [0.0, 0.5 * PI, -1.25 * PI] {
        let turned = sky.rotated_about_up(turn);
        let largest = turned.irradiance(Vec3::Y).max_element() as f32 / PI;
        let picture = pixels(&mut window, |frame| frame.content.light.as_mut().unwrap().rotation_radians = turn);
        let eye = window.state().frame.eye;
        for (row, column) in ON_SPHERE {
            let normal = normal_at(&eye, row, column, SIZE).unwrap();
            let expected = turned.irradiance(normal).as_vec3() / PI;
            let found = Vec3::from_array(picture[(row, column)].map(f32::from)) / 255.0 * 4.0;
            let expected_cut = expected.min(Vec3::splat(4.0));
            let departure = (found - expected_cut).abs().max_element();
            assert!(departure < 0.03 * largest + 0.01, "turn {turn} row {row} column {column}: {found} {expected}");
        }
        for (row, column) in [(3, 3), (110, 150), (5, 120)] {
            let ray = eye.ray_through(Vec2::new(column as f32 + 0.5, row as f32 + 0.5), SIZE);
            let display = DisplaySettings { exposure_stops: -2.0, ..LINEAR };
            let expected = display.bytes(turned.radiance_towards(ray.direction), row as u32, column as u32);
            assert_colour(picture[(row, column)], expected, 2, "the sky behind");
        }
    }
}

#[test]
fn two_lights_share_the_screen_at_the_wipe() {
    if !has_adapter() {
        return;
    }
    let mut frame =
        sphere_frame(one_material(Vec3::ONE, Vec3::ZERO, 1.0), Environment::constant(16, 8, Vec3::new(0.8, 0.2, 0.2)));
    frame.content.other_light = Some(StageLight::new(Arc::new(Environment::constant(8, 4, Vec3::new(0.2, 0.2, 0.8)))));
    (frame.look.display, frame.look.backdrop) = (LINEAR, Backdrop::Light);
    let mut window = window(SIZE, frame);
    let (left, right) = ([204, 51, 51], [51, 51, 204]);
    let alone = pixels(&mut window, |_| {});
    assert_colour(alone[(60, 100)], left, 2, "one light alone");
    for place in [0.25, 0.5, 0.75] {
        let picture = pixels(&mut window, |frame| frame.look.light_wipe = Some(place));
        let wipe = (place * SIZE.x) as usize;
        for row in [10, 60] {
            assert_colour(picture[(row, wipe - 4)], left, 2, "left of the wipe");
            assert_colour(picture[(row, wipe + 4)], right, 2, "right of the wipe");
        }
        assert!(picture[(60, wipe)].iter().all(|&byte| byte > 200), "the wipe is marked: {:?}", picture[(60, wipe)]);
    }
}

#[test]
fn quantities_are_on_the_colour_scale_and_unknown_texels_grey() {
    if !has_adapter() {
        return;
    }
    let mut frame = sphere_frame(one_material(Vec3::ONE, Vec3::ZERO, 1.0), Environment::constant(16, 8, Vec3::ONE));
    // Seen from +z, u = 0.5 is in the middle and grows to the right.
    let texels = Image::from_fn(64, 32, |row, _| match row {
        0..12 => f32::NAN,
        12..18 => 3.0,
        _ => 11.0,
    });
    frame.content.quantity = Some(StageQuantity { texels: Arc::new(texels), range: [1.0, 5.0] });
    let mut window = window(SIZE, frame);
    let bytes = |value: f32| (scale_colour(value) * 255.0).round().to_array().map(|value| value as u8);
    for (layer, _) in Layer::NAMED.into_iter().filter(|(layer, _)| layer.is_quantity()) {
        let picture = pixels(&mut window, |frame| frame.look.layer = layer);
        assert_colour(picture[(60, 80)], bytes(0.5), 2, "in the middle of the range");
        assert_colour(picture[(85, 80)], bytes(1.0), 2, "beyond the range");
        assert_colour(picture[(35, 80)], [102; 3], 2, "unknown");
    }
}

#[test]
fn photos_are_colours_of_vertices_or_of_texels_and_follow_the_exposure() {
    if !has_adapter() {
        return;
    }
    let radiance = Vec3::new(0.5, 0.25, 1.0);
    let mut frame = sphere_frame(one_material(radiance, Vec3::ZERO, 1.0), Environment::constant(16, 8, Vec3::ZERO));
    (frame.look.display, frame.look.layer) = (LINEAR, Layer::Photos);
    let vertices = frame.content.mesh.as_ref().unwrap().positions.len();
    let mut window = window(SIZE, frame);
    let picture = pixels(&mut window, |_| {});
    assert_colour(picture[(60, 80)], LINEAR.bytes(radiance, 60, 80), 2, "texels");
    let brighter = DisplaySettings { exposure_stops: -1.0, ..LINEAR };
    let picture = pixels(&mut window, |frame| frame.look.display = brighter);
    assert_colour(picture[(60, 80)], brighter.bytes(radiance, 60, 80), 2, "texels, darker");
    let green = Arc::new(vec![[0.0, 0.75, 0.0, 1.0]; vertices]);
    let picture = pixels(&mut window, |frame| {
        (frame.look.display, frame.content.vertex_colours) = (LINEAR, Some(green));
    });
    assert_colour(picture[(60, 80)], LINEAR.bytes(Vec3::new(0.0, 0.75, 0.0), 60, 80), 2, "vertices");
    let unseen = Arc::new(vec![[0.0; 4]; vertices]);
    let picture = pixels(&mut window, |frame| frame.content.vertex_colours = Some(unseen));
    assert_colour(picture[(60, 80)], [102; 3], 2, "what no photo sees is grey");
}

#[test]
fn a_crossfade_goes_from_the_photos_over_reflectance_without_exposure_to_the_light() {
    if !has_adapter() {
        return;
    }
    let (photo, diffuse) = (Vec3::new(0.4, 0.2, 0.0), Vec3::new(0.2, 0.6, 0.8));
    let light = Environment::constant(16, 8, Vec3::splat(0.25));
    let mut frame = sphere_frame(one_material(diffuse, Vec3::ZERO, 1.0), light);
    let display = DisplaySettings { exposure_stops: 1.0, ..LINEAR };
    (frame.look.display, frame.look.layer) = (display, Layer::Crossfade);
    frame.content.lobe_strength = 0.0;
    let seen = CoveredTexels::new(Box::new(|| Image::filled(1, 1, true)));
    let photos = one_material(photo, Vec3::ZERO, 1.0);
    frame.content.photos = Some((Arc::new(photos), Arc::new(seen)));
    let mut window = window(SIZE, frame);
    // What an exposure of one stop makes of the radiance of photo and surface.
    let (photo, lit) = (2.0 * photo, 0.5 * diffuse);
    for (place, wanted) in [
        (0.0, photo),
        (0.25, photo.lerp(diffuse, 0.25)),
        (1.0, diffuse),
        (1.5, diffuse.lerp(lit, 0.5)),
        (2.0, lit),
        (f32::NAN, photo),
    ] {
        let picture = pixels(&mut window, |frame| frame.look.crossfade = place);
        assert_colour(picture[(60, 80)], LINEAR.bytes(wanted, 60, 80), 2, &format!("at {place}"));
    }
    let traced = Arc::new(Image::filled(SIZE.x as usize, SIZE.y as usize, Vec3::new(0.5, 0.0, 0.25)));
    let exposed = Vec3::new(1.0, 0.0, 0.5);
    for (place, wanted) in [(0.5, photo.lerp(diffuse, 0.5)), (1.75, diffuse.lerp(exposed, 0.75)), (2.0, exposed)] {
        let picture = pixels(&mut window, |frame| {
            (frame.look.crossfade, frame.content.traced) = (place, Some(traced.clone()));
        });
        assert_colour(picture[(60, 80)], LINEAR.bytes(wanted, 60, 80), 3, &format!("path traced, at {place}"));
    }
}

#[test]
fn the_rasteriser_and_the_rays_agree_on_what_is_seen() {
    if !has_adapter() {
        return;
    }
    let demo = patina::scene::demo::build(&patina::scene::demo::DemoSettings {
        views: 2,
        held_out: 1,
        width: 80,
        height: 60,
        map_size: 64,
        seed: 1,
        ..Default::default()
    })
    .unwrap();
    let bvh = patina::trace::Bvh::build(&demo.scene.mesh.positions, &demo.scene.mesh.triangles).unwrap();
    let mesh = Arc::new(demo.scene.mesh);
    let mut frame = sphere_frame(one_material(Vec3::ONE, Vec3::ZERO, 1.0), Environment::constant(16, 8, Vec3::ONE));
    frame.content.mesh = Some(mesh.clone());
    frame.look.layer = Layer::Normal;
    frame.look.backdrop = Backdrop::Colour(Color32::BLACK);
    let mut camera = demo.scene.views[1].camera;
    camera.centre_pixels += Vec2::new(5.0, -3.0);
    let orbit = OrbitEye { distance: 9.0, target: Vec3::new(0.3, 0.5, 0.0), ..OrbitEye::default() };
    let mut window = window(SIZE, frame);
    for eye in [Eye::Photo(camera), Eye::Orbit(orbit)] {
        let picture = pixels(&mut window, |frame| frame.eye = eye);
        let (mut differ, mut met) = (0, 0);
        for row in 0..120 {
            for column in 0..160 {
                let ray = eye.ray_through(Vec2::new(column as f32 + 0.5, row as f32 + 0.5), SIZE);
                let expected = bvh.closest_hit(&ray).map_or(Vec3::ZERO, |hit| {
                    let corners = mesh.triangles[hit.triangle as usize].map(|corner| mesh.normals[corner as usize]);
                    let normal = corners[0] * (1.0 - hit.u - hit.v) + corners[1] * hit.u + corners[2] * hit.v;
                    let front = mesh.area_vector(hit.triangle as usize).dot(ray.direction) < 0.0;
                    met += 1;
                    0.5 * normal.normalize_or_zero() * if front { 1.0 } else { -1.0 } + 0.5
                });
                let found = Vec3::from_array(picture[(row, column)].map(f32::from)) / 255.0;
                differ += u32::from((found - expected).abs().max_element() > 0.04);
            }
        }
        println!("{differ} of {met} pixels differ");
        assert!(met > 2000 && differ < 40, "{eye:?}: {differ} of {met} pixels differ");
    }
}
