//! Surfaces, lights, cameras and photographs that break fits: each ends with sound numbers or with a located error.

#![allow(clippy::unwrap_used)]

use super::common::*;
use glam::{Mat3, Vec2, Vec3};
use patina::fit::settings::{BackgroundEvidence, Consistency, Start, Steps};
use patina::fit::state::FitState;
use patina::fit::{FitSettings, Fitter, StepOutcome};
use patina::image::Image;
use patina::light::Environment;
use patina::material::Material;
use patina::material::lobe::{MIN_ROUGHNESS, MIN_WIDTH};
use patina::render::Surface;
use patina::scene::{Background, Camera, Mesh, Photo, PixelState, Scene};
use patina::{ErrorKind, Place};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// A stop flag that nobody raises.
static GO: AtomicBool = AtomicBool::new(false);

/// A fit taken up from its start with one value in all texels.
fn fitter_from(trial: &Trial, settings: FitSettings, value: Material<f32>) -> Fitter {
    let (scene, surface) = (Arc::new(trial.photographed()), trial.surface());
    let fresh = Fitter::new(scene.clone(), surface.clone(), settings.clone(), None).unwrap();
    let mut state = fresh.state().clone();
    state.texels.fill(value);
    Fitter::resume(scene, surface, settings, state).unwrap()
}

/// Whether some texel that was moved at all has left `bound` in a number.
fn some_left(state: &FitState, number: usize, bound: f32) -> bool {
    let is_moved = |(texel, updates): (&Material<f32>, &f32)| *updates > 0.0 && texel.to_array()[number] != bound;
    state.texels.iter().zip(&state.moments.updates).any(is_moved)
}

// Materials.

#[test]
fn roughness_at_both_ends_in_photos_and_in_the_start() {
    for truth in [MIN_ROUGHNESS, 1.0] {
        let material = Material::from_maps(Vec3::splat(0.4), Vec3::splat(0.5), truth);
        assert_learned(&Trial { material, ..Default::default() }.fitted(quick()));
    }
    let settings = FitSettings { steps: Steps::OneStep, ..quick() };
    for start in [MIN_WIDTH.ln(), 0.0] {
        let value = Material { diffuse: [0.4; 3], specular: [0.3; 3], log_width: start };
        let mut fitter = fitter_from(&Trial::default(), settings.clone(), value);
        run(&mut fitter).unwrap();
        assert!(some_left(fitter.state(), 6, start), "no texel left the bound {start}");
    }
}

#[test]
fn specular_reflectance_of_zero_and_one() {
    for truth in [0.0, 1.0] {
        let material = Material::from_maps(Vec3::splat(0.2), Vec3::splat(truth), 0.2);
        let trial = Trial { material, ..Default::default() };
        assert_learned(&trial.fitted(quick()));
        // From the opposite end, the photos pull it off the bound.
        let settings = FitSettings { steps: Steps::OneStep, rate_light: 0.0, ..quick() };
        let start = Material::from_maps(Vec3::splat(0.2), Vec3::splat(1.0 - truth), 0.2);
        let mut fitter = fitter_from(&trial, settings, start);
        run(&mut fitter).unwrap();
        assert!(some_left(fitter.state(), 3, 1.0 - truth));
    }
}

// Views.

#[test]
fn grazing_views() {
    // Along the floor, half a degree above it, and below it where only its back can be seen.
    for elevation in [0.0, 0.5, -20.0] {
        let mut cameras = around(3, elevation);
        cameras[0] = Camera::looking_at(Vec3::new(4.0, 0.0, 0.0), Vec3::ZERO, PHOTO, PHOTO, 0.8);
        Trial { cameras, ..Default::default() }.fitted(quick());
    }
}

#[test]
fn one_view_alone_with_each_consistency() {
    for consistency in [Consistency::None, Consistency::Released, Consistency::Constant, Consistency::Exact] {
        let trial = Trial { cameras: around(1, 35.0), ..Default::default() };
        let fitter = trial.fitted(FitSettings { consistency, steps_diffuse: 25, steps_all: 25, ..quick() });
        assert!(fitter.state().losses.iter().all(|row| row.consistency < 0.1), "one view agrees with itself");
        assert_learned(&fitter);
    }
}

#[test]
fn views_that_see_nothing() {
    let away = Camera::looking_at(Vec3::new(0.0, 5.0, 0.0), Vec3::new(1.0, 9.0, 0.0), PHOTO, PHOTO, 0.8);
    let mut some = around(3, 35.0);
    some[1] = away;
    for background in [Background::Environment, Background::Black] {
        assert_learned(&Trial { cameras: some.clone(), background, ..Default::default() }.fitted(quick()));
        let nothing = Trial { cameras: vec![away; 3], background, ..Default::default() }.fitted(quick());
        let start = nothing.state().texels[0];
        assert!(nothing.state().texels.iter().all(|texel| *texel == start), "no view saw the surface");
    }
}

#[test]
fn views_of_different_sizes_and_levels_beyond_them() {
    let sizes = [(24, 24), (31, 17), (40, 3), (1, 1), (5, 40)];
    let cameras: Vec<Camera> =
        sizes.iter().zip([0.0, 70.0, 140.0, 210.0, 300.0]).map(|(s, a)| camera_at(a, 30.0, s.0, s.1)).collect();
    for (levels, map_size, consistency) in
        [(2, 16, Consistency::None), (6, 256, Consistency::None), (2, 16, Consistency::Exact)]
    {
        let trial = Trial { cameras: cameras.clone(), ..Default::default() };
        let mut scene = trial.photographed();
        scene.views[4].held_out = true;
        let settings = FitSettings { levels, map_size, consistency, views_per_step: 4, ..quick() };
        let fitter = fit(scene, trial.surface(), settings).unwrap();
        assert!(fitter.state().losses.iter().any(|row| row.held_out_rmse.is_some()));
    }
}

#[test]
fn few_pixels_a_step_and_more_views_than_there_are() {
    let settings = FitSettings { pixels_per_step: 1, views_per_step: 50, steps_diffuse: 10, ..quick() };
    Trial::default().fitted(settings);
    let settings = FitSettings { samples: 1, first_hits_mib: 0, environment_height: 2, bounces: 16, ..quick() };
    let fitter = Trial::default().fitted(settings);
    assert_eq!(fitter.environment().radiance.pixels().len(), 8);
    assert_learned(&fitter);
}

// Lights.

#[test]
fn a_black_light_and_black_photos() {
    let black = Environment::constant(8, 4, Vec3::ZERO);
    let trial = Trial { light: black.clone(), ..Default::default() };
    let fitter = trial.fitted(quick());
    assert!(mean_light(fitter.state()) < 1e-3);

    // Bright before, the photos are black: what is seen gets darker.
    let scene = Arc::new(trial.black());
    let mut fitter = Fitter::new(scene.clone(), trial.surface(), quick(), Some(&sky())).unwrap();
    let before = fitter.state().clone();
    run(&mut fitter).unwrap();
    assert!(mean_light(fitter.state()) < mean_light(&before) && mean_of(fitter.state(), 0) < mean_of(&before, 0));

    // Black before, the photos are bright: the light must be able to leave black.
    for background in [Background::Environment, Background::Black] {
        let trial = Trial { background, ..Default::default() };
        let scene = Arc::new(trial.photographed());
        let settings = FitSettings { rate_light: 0.2, ..quick() };
        let mut fitter = Fitter::new(scene, trial.surface(), settings, Some(&black)).unwrap();
        run(&mut fitter).unwrap();
        assert_learned(&fitter);
        assert!(mean_light(fitter.state()) > 0.0);
    }
}

#[test]
fn a_black_backdrop_that_is_taken_for_the_sky() {
    // Photographed before black cloth without a mask: all light that the background shows is none.
    let mut scene = Trial { background: Background::Black, ..Default::default() }.photographed();
    scene.background = Background::Environment;
    let fitter = fit(scene, Trial::default().surface(), quick()).unwrap();
    assert!(mean_light(fitter.state()) > 0.0, "the surface is bright, so there is light");
    assert_learned(&fitter);
}

#[test]
fn a_sun_of_one_texel() {
    let mut light = sky();
    light.radiance[(1, 5)] = Vec3::splat(1e6);
    for exposure in [false, true] {
        let trial = Trial { light: light.clone(), ..Default::default() };
        let settings = FitSettings { exposure, ..quick() };
        let fitter = trial.fitted(settings.clone());
        assert!(fitter.state().non_finite.is_empty(), "{:?}", fitter.state().non_finite);
        // And with the sun known from the start.
        let mut fitter = Fitter::new(Arc::new(trial.photographed()), trial.surface(), settings, Some(&light)).unwrap();
        run(&mut fitter).unwrap();
        assert!(fitter.state().light.iter().flatten().any(|&radiance| radiance > 1e4), "the sun is still there");
    }
}

// Photographs.

#[test]
fn photos_clipped_everywhere_never_darken_anything() {
    for start in [Start::Measured, Start::Paper] {
        let trial = Trial::default();
        let mut scene = trial.black();
        for view in &mut scene.views {
            view.photo = Photo::Linear32(Image::filled(PHOTO, PHOTO, Vec3::ONE));
            view.states = Image::filled(PHOTO, PHOTO, PixelState::SurfaceClipped);
        }
        let settings = FitSettings { levels: 1, start, ..quick() };
        let mut fitter = Fitter::new(Arc::new(scene), trial.surface(), settings, None).unwrap();
        let mut before = fitter.state().clone();
        while let StepOutcome::Stepped(row) = fitter.step(&GO).unwrap() {
            let now = fitter.state();
            assert_sound(now);
            if row.step > 1 || start == Start::Measured {
                let darker = now
                    .texels
                    .iter()
                    .zip(&before.texels)
                    .any(|(a, b)| (0..6).any(|n| a.to_array()[n] < b.to_array()[n]));
                assert!(!darker, "a reflectance fell in step {}", row.step);
                let darker = now.light.iter().zip(&before.light).any(|(a, b)| (0..3).any(|n| a[n] < b[n]));
                assert!(!darker, "a light fell in step {}", row.step);
            }
            before = now.clone();
        }
    }
}

#[test]
fn numbers_that_are_not_finite_in_a_photo_are_named_counted_and_left_out() {
    let bad = [(2, 3, f32::NAN), (12, 12, f32::NAN), (12, 13, f32::INFINITY), (20, 1, f32::NEG_INFINITY)];
    for consistency in [Consistency::None, Consistency::Exact] {
        for state in [PixelState::Surface, PixelState::Background, PixelState::SurfaceClipped, PixelState::Ignored] {
            let trial = Trial::default();
            let mut scene = trial.photographed();
            let view = &mut scene.views[1];
            let Photo::Linear32(photo) = &mut view.photo else { unreachable!() };
            for (row, column, value) in bad {
                photo[(row, column)].y = value;
                view.states[(row, column)] = state;
            }
            scene.views[2].held_out = true;
            let settings = FitSettings { consistency, exposure: true, ..quick() };
            let fitter = fit(scene, trial.surface(), settings).unwrap();
            let findings = fitter.findings();
            let named = findings.iter().find(|finding| finding.code == "non-finite");
            match state {
                PixelState::Ignored => assert!(named.is_none(), "{named:?}"),
                _ => {
                    let text = named.unwrap().to_string();
                    assert!(text.contains("view1") && text.contains("row 2 column 3"), "{text}");
                    assert!(text.contains('4'), "four pixels: {text}");
                }
            }
            let (first, last) = first_and_last_loss(&fitter, 3);
            assert!(last < first);
        }
    }
}

#[test]
fn a_photo_of_nothing_but_nan_is_left_out() {
    let trial = Trial::default();
    let mut scene = trial.photographed();
    scene.views[0].photo = Photo::Linear32(Image::filled(PHOTO, PHOTO, Vec3::NAN));
    let fitter = fit(scene, trial.surface(), quick()).unwrap();
    let text = fitter.findings().iter().map(ToString::to_string).collect::<String>();
    assert!(text.contains("view0") && text.contains("576"), "{text}");
}

#[test]
fn values_near_the_end_of_f32_are_left_out() {
    let trial = Trial::default();
    let mut scene = trial.photographed();
    let Photo::Linear32(photo) = &mut scene.views[1].photo else { unreachable!() };
    photo[(12, 12)] = Vec3::splat(3e38);
    let fitter = fit(scene, trial.surface(), FitSettings { exposure: true, levels: 1, ..quick() }).unwrap();
    let text = fitter.findings().iter().map(ToString::to_string).collect::<String>();
    assert!(text.contains("view1") && text.contains("row 12 column 12"), "{text}");
}

#[test]
fn masks_that_leave_no_evidence() {
    let trial = Trial::default();
    let blind = |scene: &mut Scene, view: usize| scene.views[view].states.pixels_mut().fill(PixelState::Ignored);
    let mut scene = trial.photographed();
    blind(&mut scene, 1);
    assert_learned(&fit(scene.clone(), trial.surface(), quick()).unwrap());
    for view in 0..3 {
        blind(&mut scene, view);
    }
    let error = fit(scene, trial.surface(), quick()).err().unwrap();
    assert_eq!(error.kind(), ErrorKind::InvalidScene);
    assert!(!error.remedy_text().is_empty(), "{error}");

    // Only background, and it is not to be used.
    let mut scene = trial.photographed();
    for view in &mut scene.views {
        view.states.pixels_mut().fill(PixelState::Background);
    }
    let settings = FitSettings { background: BackgroundEvidence::Ignore, ..quick() };
    assert_eq!(fit(scene.clone(), trial.surface(), settings).err().unwrap().kind(), ErrorKind::InvalidScene);
    fit(scene, trial.surface(), quick()).unwrap();
}

#[test]
fn a_photo_of_another_size_than_its_camera_is_an_error_at_the_view() {
    let trial = Trial::default();
    let mut scene = trial.photographed();
    scene.views[2].photo = Photo::Linear32(Image::filled(3, 3, Vec3::ONE));
    let error = fit(scene, trial.surface(), quick()).err().unwrap();
    assert_eq!((error.kind(), error.place()), (ErrorKind::InvalidScene, &Place::View("view2".into())));
}

// Cameras.

#[test]
fn cameras_that_are_none_are_errors_at_the_view() {
    type Spoil = fn(&mut Camera);
    let spoil: [(Spoil, ErrorKind); 6] = [
        (|camera| camera.translation_camera_from_world.x = f32::NAN, ErrorKind::NonFinite),
        (|camera| camera.rotation_camera_from_world.x_axis.y = f32::INFINITY, ErrorKind::NonFinite),
        (|camera| camera.focal_pixels.x = 0.0, ErrorKind::InvalidScene),
        (|camera| camera.rotation_camera_from_world *= 1.2, ErrorKind::InvalidScene),
        (|camera| camera.rotation_camera_from_world.x_axis.y += 0.1, ErrorKind::InvalidScene),
        (
            |camera| {
                camera.rotation_camera_from_world =
                    Mat3::from_diagonal(Vec3::new(-1.0, 1.0, 1.0)) * camera.rotation_camera_from_world;
            },
            ErrorKind::InvalidScene,
        ),
    ];
    for (number, (spoil, kind)) in spoil.into_iter().enumerate() {
        let trial = Trial::default();
        let mut scene = trial.black();
        spoil(&mut scene.views[1].camera);
        assert_eq!(scene.views[1].camera.validate(1e-3).unwrap_err().kind(), kind, "case {number}");
        let error = fit(scene, trial.surface(), quick()).err().unwrap();
        assert_eq!((error.kind(), error.place()), (kind, &Place::View("view1".into())), "case {number}");
        assert!(!error.remedy_text().is_empty());
    }
}

// Geometry.

#[test]
fn faces_without_area_and_faces_given_twice_change_nothing() {
    let trial = Trial::default();
    let scene = trial.photographed();
    let clean = fit(scene.clone(), trial.surface(), quick()).unwrap();
    let mut mesh = trial.mesh.clone();
    let again = mesh.triangles.clone();
    mesh.triangles.extend([[0, 0, 1], [5, 5, 5]]);
    let line = mesh.positions.len() as u32;
    for point in [Vec3::ZERO, Vec3::X, 2.0 * Vec3::X] {
        mesh.positions.push(point);
        mesh.normals.push(Vec3::Y);
        mesh.uvs.push(Vec2::ZERO);
    }
    mesh.triangles.push([line, line + 1, line + 2]);
    mesh.triangles.extend(again);
    let doubled = fit(scene, Arc::new(Surface::new(mesh).unwrap()), quick()).unwrap();
    assert_learned(&doubled);
    let (a, b) = (first_and_last_loss(&clean, 3).1, first_and_last_loss(&doubled, 3).1);
    assert!((a - b).abs() < 0.05 * a, "{a} against {b}");
}

#[test]
fn coincident_surfaces_with_textures_of_their_own() {
    let trial = Trial::default();
    let mut mesh = trial.mesh.clone();
    let (count, own) = (mesh.positions.len() as u32, mesh.clone());
    mesh.positions.extend(&own.positions);
    mesh.normals.extend(own.normals.iter().map(|normal| -normal));
    mesh.uvs.extend(own.uvs.iter().map(|uv| Vec2::ONE - uv));
    // Once facing out as well, once facing in.
    mesh.triangles.extend(own.triangles.iter().map(|&[a, b, c]| [a + count, c + count, b + count]));
    let fitter = fit(trial.photographed(), Arc::new(Surface::new(mesh).unwrap()), quick()).unwrap();
    assert!(fitter.state().non_finite.is_empty());
}

#[test]
fn a_mesh_of_one_triangle_and_of_none() {
    let mut mesh = Mesh {
        positions: vec![Vec3::new(-1.0, 0.0, 1.0), Vec3::new(1.0, 0.0, 1.0), Vec3::new(0.0, 0.0, -1.0)],
        uvs: vec![Vec2::ZERO, Vec2::X, Vec2::Y],
        triangles: vec![[0, 1, 2]],
        ..Default::default()
    };
    mesh.compute_normals();
    let trial = Trial { mesh: mesh.clone(), ..Default::default() };
    assert_learned(&trial.fitted(quick()));
    assert_learned(&trial.fitted(FitSettings { consistency: Consistency::Exact, ..quick() }));
    // All of it on one point of the texture.
    mesh.uvs = vec![Vec2::splat(0.5); 3];
    assert_learned(&Trial { mesh: mesh.clone(), ..Default::default() }.fitted(quick()));
    mesh.uvs[1].y = f32::NAN;
    assert_eq!(Surface::new(mesh.clone()).err().unwrap().kind(), ErrorKind::NonFinite);
    mesh.uvs[1].y = 0.0;
    mesh.triangles.clear();
    let error = Surface::new(mesh).err().unwrap();
    assert_eq!(error.kind(), ErrorKind::InvalidScene);
}

#[test]
fn the_smallest_textures() {
    for levels in [1, 2] {
        assert_learned(&Trial::default().fitted(FitSettings { map_size: 16, levels, ..quick() }));
    }
    // One texel: photos are rendered from it, a fit of it is refused by name.
    assert_eq!(Trial::default().truth().texels.levels[0].texels.len(), 1);
    for (map_size, levels, name) in [(1, 1, "map-size"), (0, 1, "map-size"), (16, 3, "levels")] {
        let trial = Trial::default();
        let error = fit(trial.black(), trial.surface(), FitSettings { map_size, levels, ..quick() }).err().unwrap();
        assert_eq!((error.kind(), error.place()), (ErrorKind::InvalidSetting, &Place::Setting(name.into())));
    }
}

#[test]
fn texels_nobody_sees_keep_their_start_bit_for_bit() {
    // A ball within the ball, on its own side of the texture, and only direct light.
    let mut mesh = ball_on_a_floor();
    mesh.uvs.iter_mut().for_each(|uv| uv.x *= 0.5);
    let mut hidden = laid_out(patina::scene::synthetic::shapes::sphere(0.3, 3));
    let count = mesh.positions.len() as u32;
    mesh.positions.extend(hidden.positions.iter().map(|position| position + Vec3::new(0.0, 0.75, 0.0)));
    mesh.normals.append(&mut hidden.normals);
    mesh.uvs.extend(hidden.uvs.iter().map(|uv| Vec2::new(0.7 + 0.3 * uv.x, uv.y)));
    mesh.triangles.extend(hidden.triangles.iter().map(|triangle| triangle.map(|vertex| vertex + count)));
    let trial = Trial { mesh, bounces: 1, ..Default::default() };
    for consistency in [Consistency::None, Consistency::Constant, Consistency::Exact] {
        let settings = FitSettings { map_size: 32, levels: 1, bounces: 1, consistency, ..quick() };
        let mut fitter = Fitter::new(Arc::new(trial.photographed()), trial.surface(), settings, None).unwrap();
        let start = fitter.state().texels.clone();
        run(&mut fitter).unwrap();
        let state = fitter.state();
        let mut moved = 0;
        let bits = |texel: &Material<f32>| texel.to_array().map(f32::to_bits);
        for (index, (now, start)) in state.texels.iter().zip(&start).enumerate() {
            let column = index % 32;
            assert!(column < 24 || bits(now) == bits(start), "texel {index} moved");
            moved += usize::from(now != start);
            assert!(now == start || state.moments.updates[index] > 0.0, "moved and not counted");
        }
        assert!(moved > 100, "{moved} texels moved");
    }
}
