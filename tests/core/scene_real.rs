//! Real data and the exchange folder beside the repository, where they are present.

#![allow(clippy::unwrap_used)]

use super::beside::{data, peers};
use patina::scene::{Background, ReadSettings, doctor, read, settings::PixelCentre};

#[test]
fn saharov_is_read_upright() {
    let Some(folder) = data("multiview/saharov_bmvs") else { return };
    let settings = ReadSettings { pixel_centre: PixelCentre::Integer, max_views: 4, ..Default::default() };
    let scene = read(&folder, &settings).unwrap();
    assert_eq!(scene.mesh.triangles.len(), 158_929);
    assert_eq!(scene.views.len(), 4);
    let names: Vec<_> = scene.views.iter().map(|view| view.name.as_str()).collect();
    assert_eq!(names, ["00000000", "00000008", "00000016", "00000024"]);
    assert!(scene.views[0].held_out && !scene.views[1].held_out);
    assert_eq!((scene.views[0].camera.width, scene.views[0].camera.height), (728, 1092));
    assert_eq!(scene.views[0].camera.centre_pixels.x, 364.0);
    let (low, high) = scene.mesh.bounds().unwrap();
    assert!((high.y - 2.0).abs() < 0.02 && low.y.abs() < 0.1, "{low} {high}");
    for view in &scene.views {
        view.camera.validate(1e-5).unwrap();
    }
}

#[test]
fn herzjesu_stands_upright_although_its_z_axis_points_down() {
    let Some(folder) = data("multiview/herzjesu8_bmvs") else { return };
    let settings = ReadSettings { pixel_centre: PixelCentre::Integer, ..Default::default() };
    let scene = read(&folder, &settings).unwrap();
    assert_eq!((scene.mesh.triangles.len(), scene.views.len()), (299_998, 8));
    assert!(scene.findings.iter().any(|finding| finding.code == "up-estimated" && finding.message.contains("-Z")));
    // The pavement is the largest horizontal surface: its normals point up and it lies below most of the wall.
    let mean_of = |select: &dyn Fn(f32) -> bool| {
        let heights: Vec<f32> = scene
            .mesh
            .positions
            .iter()
            .zip(&scene.mesh.normals)
            .filter(|(_, normal)| select(normal.y))
            .map(|(point, _)| point.y)
            .collect();
        (heights.iter().sum::<f32>() / heights.len() as f32, heights.len())
    };
    let (floor, floor_count) = mean_of(&|up| up > 0.9);
    let (walls, _) = mean_of(&|up| up.abs() < 0.2);
    let (_, ceiling_count) = mean_of(&|up| up < -0.9);
    assert!(floor < walls && floor_count > 3 * ceiling_count, "{floor} {walls} {floor_count} {ceiling_count}");
}

#[test]
fn both_captures_have_pixel_centres_at_integers_and_pass_the_check() {
    for name in ["multiview/saharov_bmvs", "multiview/herzjesu8_bmvs"] {
        let Some(folder) = data(name) else { continue };
        let scene = read(&folder, &ReadSettings { max_views: 5, ..Default::default() }).unwrap();
        let measured = scene.findings.iter().find(|finding| finding.code == "pixel-centre-measured").unwrap();
        println!("{name}: {measured}");
        assert!(measured.message.contains("at (0, 0): "), "{measured}");
        let report = doctor::check(&scene);
        assert!(!report.is_fatal(), "{:#?}", report.findings);
        assert!(report.views.iter().all(|view| view.mask_overlap.unwrap() > 0.999), "{:?}", report.views);
        assert!(report.pixel_centre.unwrap().disagreement.unwrap()[1] < 0.01);
    }
}

#[test]
fn the_exchange_scene_is_read_with_its_truth() {
    let Some(folder) = peers("scenes/toys") else { return };
    let scene = read(&folder, &ReadSettings { hold_out_every: 0, ..Default::default() }).unwrap();
    assert_eq!((scene.mesh.triangles.len(), scene.views.len()), (30_400, 48));
    assert_eq!(scene.background, Background::Black);
    assert!(scene.views.iter().all(|view| !view.held_out));
    assert_eq!(scene.mesh.uvs.len(), scene.mesh.positions.len());
    let truth = scene.truth.unwrap();
    assert_eq!(truth.max_bounces, 3);
    assert_eq!((truth.maps.diffuse.width(), truth.environment.radiance.height()), (512, 32));
    let seen = truth.texels_seen.pixels().iter().filter(|seen| **seen).count() as f64 / (512.0 * 512.0);
    assert!((seen - 0.650_260_925).abs() < 1e-6, "{seen}");
    let relight = truth.relight.unwrap();
    assert_eq!(relight.pictures.iter().map(|(index, _)| *index).collect::<Vec<_>>(), [0, 6, 12, 18, 24, 30, 36, 42]);
}
