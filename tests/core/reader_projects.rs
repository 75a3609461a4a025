//! Real projects of other tools beside the repository, where they are present, and projections written by the tools.

#![allow(clippy::unwrap_used)]

use super::beside::data as shared;
use glam::{DVec2, DVec3};
use patina::error::Place;
use patina::scene::read::colmap_lens::lens_of;
use patina::scene::{ReadSettings, read};

#[test]
fn a_photoscan_project_sees_the_mesh_where_its_undistorted_twin_does() {
    let Some(project) = shared("formats/photoscan") else { return };
    let Some(twin) = shared("multilight/head_walk_bmvs") else { return };
    let session: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(twin.join("session.json")).unwrap()).unwrap();
    let scene = read(&project, &ReadSettings::default()).unwrap();
    assert_eq!(scene.views.len(), 41);
    let codes: Vec<_> = scene.findings.iter().map(|finding| finding.code).collect();
    for expected in ["chunk-chosen", "intrinsics-scaled", "lens-undone"] {
        assert!(codes.contains(&expected), "{codes:?}");
    }
    let other = read(&twin, &ReadSettings { shrink: 4, ..Default::default() }).unwrap();
    assert_eq!(scene.mesh.positions.len(), other.mesh.positions.len());
    let mut largest = 0.0f32;
    let mut compared = 0;
    for entry in session["views"].as_array().unwrap() {
        let stem = entry["file"].as_str().unwrap().trim_end_matches(".jpg");
        let name = format!("{:08}", entry["view"].as_u64().unwrap());
        let Some(ours) = scene.views.iter().find(|view| view.name == stem) else { continue };
        let Some(theirs) = other.views.iter().find(|view| view.name == name) else { continue };
        let sizes = [&ours.camera, &theirs.camera].map(|own| glam::Vec2::new(own.width as f32, own.height as f32));
        for index in (0..scene.mesh.positions.len()).step_by(997) {
            let a = ours.camera.place_in_picture(scene.mesh.positions[index]);
            let Some((b, _)) = theirs.camera.project(other.mesh.positions[index]) else { continue };
            if let Some(a) = a {
                // Both pictures are whole: a place is compared as a share of the sides.
                largest = largest.max((a - b / sizes[1] * sizes[0]).length());
                compared += 1;
            }
        }
    }
    assert!(compared > 1000, "{compared}");
    assert!(largest < 0.2, "off by {largest} pixels");
}

#[test]
fn every_model_projects_as_colmap_does() {
    let text =
        std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/readers/colmap_projections.json")).unwrap();
    let cameras: Vec<serde_json::Value> = serde_json::from_str(&text).unwrap();
    let numbers = |value: &serde_json::Value| -> Vec<f64> {
        value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
    };
    assert!(cameras.len() >= 11, "{}", cameras.len());
    for camera in &cameras {
        let model = camera["model"].as_str().unwrap();
        let (intrinsics, lens) = lens_of(model, &numbers(&camera["params"]), &Place::Nowhere).unwrap();
        let focal = DVec2::new(intrinsics.x_axis.x, intrinsics.y_axis.y);
        let centre = intrinsics.z_axis.truncate();
        let valid = lens.valid_radius();
        let mut largest = 0.0f64;
        for point in camera["points"].as_array().unwrap() {
            let values = numbers(point);
            let (direction, expected) = (DVec3::new(values[0], values[1], values[2]), DVec2::new(values[3], values[4]));
            let place = lens.project(direction);
            largest = largest.max((place * focal + centre - expected).length());
            let again = lens.unproject(place, valid).unwrap();
            assert!((again - direction.normalize()).length() < 1e-7, "{model}: {again} {direction}");
        }
        assert!(largest < 1e-3, "{model} is off by {largest} pixels");
    }
}
