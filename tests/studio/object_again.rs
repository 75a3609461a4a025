//! Object mode from files: a result that is opened again, an object with a mesh and a camera, a photo named at the start.

use super::object::{result_folder, type_path, with_photo, write_sphere_photo};
use super::support::TestStudio;
use glam::Vec3;
use patina::image::file;
use patina::light::sky::{SkySettings, sun_and_sky};
use patina::measured::coordinates::HalfDifference;
use patina::object::ObjectGeometry;
use patina::object::picture::render_exact;
use patina::object::transport::TexelDirections;
use patina::scene::{Camera, Mesh};
use patina::studio::act::Act;
use patina::studio::model::object::ObjectStatus;
use patina::studio::model::object_form::Effort;
use patina::studio::workspace::{Panel, Workspace};
use std::path::Path;

/// Side of the photo of the mesh in pixels, and its field of view in radians.
const SIDE: usize = 40;
const FIELD_OF_VIEW: f32 = 0.6;
/// Where the camera stands: before the ball of radius 1.
const DISTANCE: f32 = 4.0;

#[test]
#[ignore = "slow: an estimation of its own"]
fn a_finished_result_is_opened_again_from_its_folder() {
    let mut studio = with_photo();
    studio.act(Act::ObjectStart);
    studio.wait("the end", |model| model.object.status == ObjectStatus::Finished);
    let folder = result_folder(&mut studio);
    let before = studio.model().object.outcome.clone().unwrap();
    assert_eq!(studio.model().preferences.recents[0].path, folder, "it is among the recents");

    let mut again = TestStudio::opening(Some(folder.clone()));
    again.wait("the result", |model| model.object.outcome.is_some());
    assert_eq!(again.model().workspace, Workspace::Object);
    for label in [
        "Photo of the object",
        "Re-render of the object",
        "Sphere of the estimated reflectance",
        "Estimated environment map",
    ] {
        again.control(label);
    }
    let after = again.model().object.outcome.clone().unwrap();
    let (own, other) = (&after.parts.estimate, &before.parts.estimate);
    assert_eq!(own.parameters, other.parameters);
    assert!(own.table == other.table, "the reflectance to the bit");
    assert_eq!((own.rows.len(), own.picture_log_rmse), (other.rows.len(), other.picture_log_rmse));
    assert_eq!((own.start.as_str(), &after.spread), (other.start.as_str(), &before.spread));
    let names = |outcome: &patina::job::object::ObjectOutcome| {
        outcome.starts.iter().map(|start| start.name.clone()).collect::<Vec<_>>()
    };
    assert_eq!(names(&after), names(&before));
    for (own, other) in after.lights[0].radiance.pixels().iter().zip(before.lights[0].radiance.pixels()) {
        assert!((*own - *other).abs().max_element() <= 1e-4 * other.max_element(), "{own} {other}");
    }
    let form = again.model().edits.object.clone();
    assert!(form.photos.len() == 1 && form.is_sphere && form.photos[0].ends_with("ball.exr"), "{form:?}");
    assert_eq!((form.effort, form.light_rows, form.pixels), (Effort::Quick, Some(16), Some(300)), "its settings");
    again.wait("the relit pictures", |model| !model.object.relit.is_empty());
    again.act(Act::PanelStarts);
    assert!(again.says("Ambiguity") && again.says("Initializations"));

    // It can be saved elsewhere, file by file, and opened from there; without its photo it says so and shows the rest.
    let elsewhere = again.folder.path().join("elsewhere");
    again.model().save_object(elsewhere.clone());
    again.wait_for_word("Saved");
    std::fs::remove_file(studio.folder.path().join("ball.exr")).unwrap();
    again.model().open(elsewhere);
    again.wait_for_word("the photos cannot be read any more");
    again.control("Estimated environment map");
    assert!(again.says("No photo yet"), "{}", again.log());

    // A folder that is damaged is an error with a remedy, and what was open stays.
    std::fs::write(folder.join("object.json"), "{").unwrap();
    again.model().open(folder);
    again.wait("the error", |model| model.log.banner().is_some());
    assert!(again.says("Fix: "), "{}", again.log());
    assert!(again.model().object.outcome.is_some());
}

/// A ball of triangles about the origin, wound outwards.
fn ball() -> Mesh {
    let (columns, rows) = (32u32, 16u32);
    let mut mesh = Mesh::default();
    for row in 0..=rows {
        for column in 0..columns {
            let theta = std::f32::consts::PI * row as f32 / rows as f32;
            let phi = std::f32::consts::TAU * column as f32 / columns as f32;
            mesh.positions.push(Vec3::new(theta.sin() * phi.sin(), theta.cos(), theta.sin() * phi.cos()));
        }
    }
    for row in 0..rows {
        for column in 0..columns {
            let at = |row: u32, column: u32| row * columns + column % columns;
            let [a, b] = [at(row, column), at(row, column + 1)];
            let [c, d] = [at(row + 1, column), at(row + 1, column + 1)];
            if row > 0 {
                mesh.triangles.push([a, c, b]);
            }
            if row + 1 < rows {
                mesh.triangles.push([b, c, d]);
            }
        }
    }
    mesh.compute_normals();
    mesh
}

/// Writes the ball as OBJ, its camera, and a photo of it under a sky.
fn write_ball(folder: &Path) {
    let mesh = ball();
    let mut text = String::new();
    for at in &mesh.positions {
        text += &format!("v {} {} {}\n", at.x, at.y, at.z);
    }
    for corners in &mesh.triangles {
        let [a, b, c] = corners.map(|corner| corner + 1);
        text += &format!("f {a} {b} {c}\n");
    }
    std::fs::write(folder.join("ball.obj"), text).unwrap();
    let focal = 0.5 * SIDE as f32 / (0.5 * FIELD_OF_VIEW).tan();
    let centre = 0.5 * SIDE as f32;
    let cameras = format!(
        r#"{{"convention":"opencv","views":[{{"file":"ball_photo.exr","width":{SIDE},"height":{SIDE},
        "K":[[{focal},0,{centre}],[0,{focal},{centre}],[0,0,1]],
        "w2c":[[1,0,0,0],[0,-1,0,0],[0,0,-1,{DISTANCE}],[0,0,0,1]]}}]}}"#
    );
    std::fs::write(folder.join("cameras.json"), cameras).unwrap();
    let camera = Camera::looking_at(Vec3::new(0.0, 0.0, DISTANCE), Vec3::ZERO, SIDE, SIDE, FIELD_OF_VIEW);
    let geometry = ObjectGeometry::of_mesh(&mesh, &camera).unwrap();
    let light = sun_and_sky(32, 16, &SkySettings::evening());
    let directions = TexelDirections::of_any_size(32, 16);
    let plaster = |_: &[HalfDifference], values: &mut [[f64; 3]]| values.fill([0.2, 0.12, 0.08]);
    let picture = render_exact(&geometry, None, &directions, &plaster, &[&light]).swap_remove(0);
    file::write_exr_rgb(&folder.join("ball_photo.exr"), &picture).unwrap();
}

#[test]
#[ignore = "slow: an estimation of its own"]
fn an_object_with_a_mesh_and_a_camera_is_estimated_and_opened_again() {
    // A studio in object mode with small settings; its photo of a sphere is taken out again.
    let mut studio = with_photo();
    studio.click("Remove ball.exr");
    let folder = studio.folder.path().to_path_buf();
    write_ball(&folder);
    type_path(&mut studio, "Photo", &folder.join("ball_photo.exr"));
    for name in ["ball.obj", "cameras.json"] {
        studio.model().dropped(folder.join(name));
    }
    studio.frames(2);
    studio.click("Start estimation");
    studio.wait("the end", |model| !model.object.status.is_live());
    let log = studio.log();
    assert_eq!(studio.model().object.status, ObjectStatus::Finished, "{log}");
    let outcome = studio.model().object.outcome.clone().unwrap();
    let pixels = outcome.parts.views[0].geometry.pixels.len();
    // The ball reaches asin(1/4) to each side of a view of 0.6 radians: most of the picture.
    let radius = 0.5 * SIDE as f32 * (1.0f32 / 4.0).asin().tan() / (0.5 * FIELD_OF_VIEW).tan();
    let disc = std::f32::consts::PI * radius * radius;
    assert!((pixels as f32 / disc - 1.0).abs() < 0.1, "{pixels} pixels of a disc of {disc}");
    assert!(outcome.parts.estimate.picture_log_rmse < 0.1, "{}", outcome.parts.estimate.picture_log_rmse);

    let mut again = TestStudio::opening(outcome.folder.clone());
    again.wait("the result", |model| model.object.outcome.is_some());
    let form = again.model().edits.object.clone();
    assert!(!form.is_sphere && form.mesh.ends_with("ball.obj") && form.cameras.len() == 1, "{form:?}");
    assert_eq!(again.model().object.outcome.as_ref().unwrap().parts.views[0].geometry.pixels.len(), pixels);
    again.control("Re-render of the object");
}

#[test]
fn a_photo_that_is_named_at_the_start_opens_object_mode_with_it() {
    let folder = tempfile::tempdir().unwrap();
    let photo = folder.path().join("ball.exr");
    write_sphere_photo(&photo, 24);
    let mut studio = TestStudio::opening(Some(photo.clone()));
    studio.frames(2);
    assert_eq!(studio.model().workspace, Workspace::Object);
    assert_eq!(studio.model().edits.object.photos, [photo]);
    assert!(studio.harness.state().object_layout.visible().contains(&Panel::Object));
    studio.control("Remove ball.exr");
    assert!(!studio.is_grey("Estimate"));
}
