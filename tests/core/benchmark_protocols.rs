use super::*;
use crate::image::file;
use crate::job::pictures::parameters;
use crate::lab::scenes::hard::{HardCase, HardScene, HardSettings, build};
use crate::scene::WorldFromSource;
use glam::{DMat3, DMat4, DVec3, Mat3};
use std::path::PathBuf;

/// Radiance of a light that differs in every direction, in our world.
fn radiance(direction: Vec3) -> Vec3 {
    let Vec3 { x, y, z } = direction;
    Vec3::new(1.0 + 0.9 * x, 0.8 + 0.6 * y, 1.0 - 0.7 * z + 0.2 * x)
        + 6.0 * Vec3::splat((0.6 * x + 0.5 * y - 0.6 * z).max(0.0).powi(20))
}

fn light() -> Environment {
    let direction = |row, column| radiance(sphere::direction_of_texel(row, column, 64, 32));
    Environment { radiance: Image::from_fn(64, 32, direction) }
}

/// A source world whose +z is up.
fn world() -> WorldFromSource {
    WorldFromSource { rotation: DMat3::from_rotation_x(-std::f64::consts::FRAC_PI_2), ..Default::default() }
}

struct Made {
    hard: HardScene,
    surface: Surface,
    own: Parameters<f32>,
}

fn made(size: usize) -> Made {
    let settings = HardSettings { size, views: 5, held_out: 1, light_height: 8, ..Default::default() };
    let hard = build(HardCase::Plain, &settings).unwrap();
    let surface = Surface::new(hard.scene.mesh.clone()).unwrap();
    let truth = hard.scene.truth.as_ref().unwrap();
    let own = parameters(&truth.maps, &truth.environment);
    Made { surface, own, hard }
}

impl Made {
    fn drawing(&self, samples: usize, seed: u64) -> Drawing<'_> {
        let settings = PictureSettings { samples, max_bounces: 2, seed, ..Default::default() };
        Drawing { surface: &self.surface, own: &self.own, settings }
    }
}

#[test]
fn environments_of_both_data_sets_are_laid_where_they_say() {
    for (direction, u, v) in [(Vec3::X, 0.5, 0.5), (Vec3::Y, 0.25, 0.5), (Vec3::NEG_Y, 0.75, 0.5)] {
        let (found_u, found_v) = owl::place_on_environment(direction);
        assert!((found_u - u).abs() < 1e-6 && (found_v - v).abs() < 1e-6, "{direction}: {found_u} {found_v}");
    }
    assert_eq!(owl::place_on_environment(Vec3::Z).1, 0.0);
    for (direction, u) in [(Vec3::NEG_Z, 0.5), (Vec3::NEG_X, 0.25), (Vec3::X, 0.75)] {
        let (found, v) = orb::place_on_environment(direction);
        assert!((found - u).abs() < 1e-6 && (v - 0.5).abs() < 1e-6, "{direction}: {found} {v}");
    }
    let (left, _) = orb::place_on_environment(Vec3::Z);
    assert!(left.fract().min(1.0 - left.fract()) < 1e-6, "{left}: the border");
    assert_eq!(orb::place_on_environment(Vec3::Y).1, 0.0);
}

#[test]
fn the_truth_of_an_object_with_lighting_scores_high_and_another_light_does_not() {
    let made = made(64);
    let folder = tempfile::tempdir().unwrap();
    let test = folder.path().join("test");
    std::fs::create_dir_all(test.join("inputs")).unwrap();
    let from_source = world().rotation;
    let write = |path: PathBuf, text: String| std::fs::write(path, text).unwrap();
    let camera = made.hard.scene.views[0].camera;
    let rotation = camera.rotation_camera_from_world.as_dmat3() * from_source;
    let row = |matrix: DMat3, row: usize| format!("{} {} {}", matrix.row(row).x, matrix.row(row).y, matrix.row(row).z);
    let t = camera.translation_camera_from_world;
    let text = format!(
        "{} 0 {}\n0 {} {}\n0 0 1\n{}\n{}\n{}\n{} {} {}\n{} {} 3\n",
        camera.focal_pixels.x,
        camera.centre_pixels.x,
        camera.focal_pixels.y,
        camera.centre_pixels.y,
        row(rotation, 0),
        row(rotation, 1),
        row(rotation, 2),
        t.x,
        t.y,
        t.z,
        camera.width,
        camera.height
    );
    write(test.join("inputs/camera_0000.txt"), text.clone());
    write(test.join("gt_camera_0000.txt"), text);
    let truth = made.drawing(256, 5).picture(&camera, Some(&light()), 0);
    // Seen by the eye of the data set: its own power, an exposure of half a stop less.
    let bytes = truth.map(|rgb| {
        rgb.to_array().map(|own| {
            (255.0 * (own * std::f32::consts::FRAC_1_SQRT_2).powf(1.0 / 2.2)).clamp(0.0, 255.0).round() as u8
        })
    });
    for path in [test.join("inputs/image_0000.png"), test.join("gt_image_0000.png")] {
        file::write_png_srgb8(&path, &bytes).unwrap();
    }
    let covered = truth.map(|rgb| if rgb.max_element() > 0.0 { [255u8; 3] } else { [0; 3] });
    file::write_png_srgb8(&test.join("gt_mask_0000.png"), &covered).unwrap();
    // +z at the top, +x in the middle, +y at a quarter, in the axes of the source.
    let lit = |turned: f32| {
        Image::from_fn(256, 128, |row, column| {
            let (sine, cosine) = (std::f32::consts::TAU * (0.5 - (column as f32 + 0.5) / 256.0)).sin_cos();
            let theta = std::f32::consts::PI * (row as f32 + 0.5) / 128.0;
            let in_source = Vec3::new(cosine * theta.sin(), sine * theta.sin(), theta.cos());
            radiance(Mat3::from_rotation_y(turned) * (from_source.as_mat3() * in_source))
        })
    };
    let path = test.join("gt_env_512_rotated_0000.hdr");
    let score = |turned: f32| {
        file::write_hdr(&path, &lit(turned)).unwrap();
        let all = owl::score(folder.path(), &world(), &made.drawing(256, 9), &mut |_| {}).unwrap();
        let Score::Owl(score) = all[0].score else { unreachable!() };
        assert_eq!((all.len(), all[0].name.as_str()), (1, "gt_image_0000"));
        score
    };
    let right = score(0.0);
    assert!(right.psnr_db > 30.0 && (right.exposure_stops + 0.5).abs() < 0.1, "{right:?}");
    assert!(right.balance.iter().all(|own| (own - 1.0).abs() < 0.05), "{right:?}");
    let turned = score(2.0);
    assert!(turned.psnr_db < right.psnr_db - 6.0, "{right:?} {turned:?}");
    std::fs::remove_file(&path).unwrap();
    let error = owl::score(folder.path(), &world(), &made.drawing(1, 9), &mut |_| {}).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Missing);
}

#[test]
fn the_truth_of_stanford_orb_scores_high_and_a_light_of_another_camera_does_not() {
    let made = made(32);
    let root = tempfile::tempdir().unwrap();
    let (own, other) = (root.path().join("blender_HDR/thing_scene001"), root.path().join("blender_HDR/thing_scene002"));
    let lights = root.path().join("ground_truth/thing_scene002/env_map");
    for folder in ["test", "test_mask"] {
        std::fs::create_dir_all(own.join(folder)).unwrap();
        std::fs::create_dir_all(other.join(folder)).unwrap();
    }
    std::fs::create_dir_all(&lights).unwrap();
    // The camera of a view as NeRF's scenes write it: camera to world, OpenGL's axes, in a source with +z up.
    let camera = made.hard.scene.views[1].camera;
    let angle = 2.0 * (0.5 * camera.width as f32 / camera.focal_pixels.x).atan();
    let to_opengl = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
    let world_from_opengl = camera.rotation_camera_from_world.as_dmat3().transpose() * to_opengl;
    let source_from_world = world().rotation.transpose();
    let mut pose = DMat4::from_mat3(source_from_world * world_from_opengl);
    pose.w_axis = (source_from_world * camera.position_in_world().as_dvec3()).extend(1.0);
    let rows: Vec<[f64; 4]> = (0..4).map(|row| pose.row(row).to_array()).collect();
    let frame = |scene: &str| {
        serde_json::json!({"camera_angle_x": angle, "frames": [{"file_path": "test/0003", "scene_name": scene,
            "camera_angle_x": angle, "transform_matrix": rows}]})
    };
    for (name, scene) in [("transforms_test.json", "thing_scene001"), ("transforms_novel.json", "thing_scene002")] {
        std::fs::write(own.join(name), frame(scene).to_string()).unwrap();
    }
    let large = Camera {
        width: orb_size(),
        height: orb_size(),
        focal_pixels: camera.focal_pixels * (orb_size() as f32 / camera.width as f32),
        centre_pixels: glam::Vec2::splat(0.5 * orb_size() as f32),
        ..camera
    };
    for (folder, light) in [(&own, None), (&other, Some(light()))] {
        let truth = made.drawing(8, 5).picture(&large, light.as_ref(), 0);
        file::write_exr_rgb(&folder.join("test/0003.exr"), &truth).unwrap();
        let mask = truth.map(|rgb| if rgb.max_element() > 0.0 { [255u8; 3] } else { [0; 3] });
        file::write_png_srgb8(&folder.join("test_mask/0003.png"), &mask).unwrap();
    }
    // Left border +z, middle -z, a quarter from the left -x, +y up, in the axes of the camera.
    let lit = |turned: f32| {
        Image::from_fn(128, 64, |row, column| {
            let (sine, cosine) = (std::f32::consts::TAU * (column as f32 + 0.5) / 128.0).sin_cos();
            let theta = std::f32::consts::PI * (row as f32 + 0.5) / 64.0;
            let in_camera = Vec3::new(-sine * theta.sin(), theta.cos(), cosine * theta.sin());
            radiance(world_from_opengl.as_mat3() * (Mat3::from_rotation_y(turned) * in_camera))
        })
    };
    let score = |turned: f32| {
        file::write_exr_rgb(&lights.join("0003.exr"), &lit(turned)).unwrap();
        let all = orb::score(&own, &world(), &made.drawing(8, 9), &mut |_| {}).unwrap();
        let questions: Vec<Question> = all.iter().map(|own| own.question).collect();
        assert_eq!(questions, [Question::NovelView, Question::Relighting]);
        [0, 1].map(|index| match all[index].score {
            Score::Orb(score) => score.psnr_ldr_db,
            Score::Owl(_) => unreachable!(),
        })
    };
    let [novel, relit] = score(0.0);
    assert!(novel > 28.0 && relit > 28.0, "{novel} {relit}");
    let [_, turned] = score(std::f32::consts::PI);
    assert!(turned < relit - 4.0, "{turned} {relit}");
}

fn orb_size() -> usize {
    crate::insight::protocols::orb::RESOLUTION
}
