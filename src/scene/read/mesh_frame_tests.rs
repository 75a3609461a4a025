//! Meshes that are turned, shrunk and moved, and whether that is noticed and put right.

use super::*;
use crate::image::Image;
use crate::scene::{Camera, Photo, PixelState, WorldFromSource};
use crate::trace::Bvh;
use glam::{DVec3, Vec3};

const SIZE: (usize, usize) = (100, 100);

fn in_pixels(camera: &SourceCamera, _: usize) -> Camera {
    camera.in_world(&WorldFromSource::default(), SIZE, 0.0)
}

fn ring() -> Vec<SourceCamera> {
    (0..8)
        .map(|index| {
            let azimuth = 0.7 * f64::from(index);
            let eye = DVec3::new(4.0 * azimuth.cos(), 4.0 * azimuth.sin(), 6.0);
            let forward = (DVec3::new(0.0, 0.0, 5.0) - eye).normalize();
            let right = forward.cross(DVec3::Z).normalize();
            let rotation = DMat3::from_cols(right, forward.cross(right), forward).transpose();
            SourceCamera {
                intrinsics: super::super::colmap_lens::matrix([90.0; 2], [50.0, 50.0]),
                rotation,
                translation: -(rotation * eye),
            }
        })
        .collect()
}

/// Photos by these cameras of grey nothing: they say nothing of a mesh.
fn grey(cameras: &[SourceCamera]) -> Vec<View> {
    let view = |(index, camera): (usize, &SourceCamera)| View {
        name: index.to_string(),
        camera: in_pixels(camera, index),
        photo: Photo::Srgb8(Image::filled(SIZE.0, SIZE.1, [90; 3])),
        states: Image::filled(SIZE.0, SIZE.1, PixelState::Surface),
        held_out: false,
        exposure_prior_stops: None,
    };
    cameras.iter().enumerate().map(view).collect()
}

/// Moves it as it is found to stand.
fn put(mesh: &mut SourceMesh, views: &[View], own: &[MeshFrame]) -> Vec<Finding> {
    let mut findings = Vec::new();
    let back = put_right(mesh, (&ring(), views.to_vec()), &in_pixels, own, &mut findings);
    assert_eq!(back.len(), views.len());
    findings
}

fn mesh(centre: DVec3) -> SourceMesh {
    let positions =
        (0..300).map(|index| centre + DVec3::from_array([0.31, 0.77, 0.53].map(|x| (x * f64::from(index)).sin())));
    SourceMesh {
        positions: positions.collect(),
        triangles: (0..100).map(|index| [3 * index, 3 * index + 1, 3 * index + 2]).collect(),
        ..Default::default()
    }
}

#[test]
fn a_mesh_with_y_up_is_turned_to_cameras_with_z_up() {
    let views = grey(&ring());
    let mut fitting = mesh(DVec3::new(0.0, 0.0, 5.0));
    let before = fitting.positions.clone();
    assert!(put(&mut fitting, &views, &[]).is_empty() && fitting.positions == before, "what fits is left alone");
    let mut turned = mesh(DVec3::new(0.0, 5.0, 0.0));
    assert_eq!(put(&mut turned, &views, &[])[0].code, "mesh-frame-changed");
    let (low, high) = turned.bounds().unwrap();
    assert!((0.5 * (low + high) - DVec3::new(0.0, 0.0, 5.0)).length() < 0.2);
    let mut lost = mesh(DVec3::new(900.0, 0.0, 0.0));
    assert_eq!(put(&mut lost, &views, &[])[0].code, "mesh-frame-unknown");
    // A thousandth of it would be in the sight of cameras that stand around the origin.
    let about_origin = ring_about_origin();
    let mut findings = Vec::new();
    let mut beside = mesh(DVec3::new(40.0, 3.0, 0.0));
    let before = beside.positions.clone();
    put_right(&mut beside, (&about_origin, grey(&about_origin)), &in_pixels, &[], &mut findings);
    assert_eq!((findings[0].code, beside.positions == before), ("mesh-frame-unknown", true), "{}", findings[0]);
    let source_from_mesh = DMat4::from_translation(DVec3::new(-900.0, 0.0, 5.0));
    let own = MeshFrame { name: "own", source_from_mesh };
    let findings = put(&mut lost, &views, &[own]);
    assert!(findings[0].code == "mesh-frame-changed" && findings[0].message.contains("after own"), "{}", findings[0]);
}

/// The ring of cameras about the origin.
fn ring_about_origin() -> Vec<SourceCamera> {
    let moved = |camera: SourceCamera| SourceCamera {
        translation: camera.translation + camera.rotation * DVec3::new(0.0, 0.0, 5.0),
        ..camera
    };
    ring().into_iter().map(moved).collect()
}

/// An uneven ball about a place that all cameras look at, and photos of the pattern on it.
fn seen() -> (SourceMesh, Vec<View>) {
    seen_with(DVec3::new(0.0, 0.0, 5.0), DVec3::new(1.5, 1.0, 0.8), &ring())
}

/// The same of other half axes, about another place, by other cameras.
fn seen_with(centre: DVec3, half_axes: DVec3, cameras: &[SourceCamera]) -> (SourceMesh, Vec<View>) {
    let mut ball = SourceMesh::default();
    let (rings, sectors) = (16u32, 32u32);
    for ring in 0..=rings {
        for sector in 0..sectors {
            let theta = std::f64::consts::PI * f64::from(ring) / f64::from(rings);
            let phi = std::f64::consts::TAU * f64::from(sector) / f64::from(sectors);
            let normal = DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
            ball.positions.push(centre + normal * half_axes);
            let [a, b] = [ring * sectors + sector, ring * sectors + (sector + 1) % sectors];
            if ring < rings {
                ball.triangles.extend([[a, a + sectors, b], [b, a + sectors, b + sectors]]);
            }
        }
    }
    let positions: Vec<Vec3> = ball.positions.iter().map(|point| point.as_vec3()).collect();
    let bvh = Bvh::build(&positions, &ball.triangles).unwrap();
    let mut views = grey(cameras);
    for view in &mut views {
        let shade = |row: usize, column: usize| {
            let ray = view.camera.ray_through(glam::Vec2::new(column as f32 + 0.5, row as f32 + 0.5));
            let Some(hit) = bvh.closest_hit(&ray) else { return [40; 3] };
            let place = ray.origin + hit.t * ray.direction;
            let pattern = (9.0 * place.x).sin() * (8.0 * place.y + 1.0).cos() + (10.0 * place.z).sin();
            [(120.0 + 45.0 * pattern) as u8; 3]
        };
        view.photo = Photo::Srgb8(Image::from_fn(SIZE.0, SIZE.1, shade));
    }
    (ball, views)
}

fn moved_by(mesh: &SourceMesh, mesh_from_source: DMat4) -> SourceMesh {
    let positions = mesh.positions.iter().map(|point| mesh_from_source.transform_point3(*point)).collect();
    SourceMesh { positions, ..mesh.clone() }
}

#[test]
fn photos_tell_the_frame_of_a_mesh_that_all_cameras_look_at() {
    let (ball, views) = seen();
    assert!(put(&mut ball.clone(), &views, &[]).is_empty(), "what fits is left alone");
    let unit_sphere = DMat4::from_scale_rotation_translation(
        DVec3::splat(0.6),
        glam::DQuat::from_rotation_z(1.2),
        DVec3::new(0.5, -0.4, 1.6),
    );
    let own = MeshFrame { name: "scale_mat", source_from_mesh: unit_sphere.inverse() };
    let units = |scale: f64| DMat4::from_scale(DVec3::splat(scale));
    // Turned about the place that the cameras look at, all of it stays in sight.
    let y_up = DMat4::from_mat3(DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y));
    let cases = [
        ("units by 0.01", units(100.0)),
        ("units by 100", units(0.01)),
        ("after scale_mat", unit_sphere),
        ("from y up to z up and a change of units by 0.001", units(1000.0) * y_up),
    ];
    for (name, mesh_from_source) in cases {
        let mut mesh = moved_by(&ball, mesh_from_source);
        let findings = put(&mut mesh, &views, std::slice::from_ref(&own));
        assert_eq!(findings.len(), 1, "{name}: {findings:?}");
        assert_eq!(findings[0].code, "mesh-frame-changed");
        assert!(findings[0].message.contains(name), "{name}: {}", findings[0]);
        let off = mesh.positions.iter().zip(&ball.positions).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        assert!(off < 1e-9, "{name}: off by {off}");
    }
    let mut larger = moved_by(&ball, DMat4::from_translation(DVec3::new(0.4, 0.5, 0.3)) * units(1.05));
    let before = larger.positions.clone();
    let findings = put(&mut larger, &views, &[]);
    assert_eq!(findings[0].code, "mesh-frames-tried", "{findings:?}");
    assert!(larger.positions == before && findings[0].message.contains("Of 19 other frames"), "{}", findings[0]);
}

#[test]
fn a_frame_that_does_well_gives_way_to_one_that_lacks_less_than_half_as_much() {
    let rating = |agreement: f64, overlap: Option<f64>| Rating {
        views: 1.0,
        points: 1.0,
        agreement: Some(agreement),
        overlap,
        back_faces: 0.0,
    };
    let own = rating(0.75, None);
    assert!(is_sound(&own, SOUND_AGREEMENT, SOUND_OVERLAP) && !is_sound(&own, SURE_AGREEMENT, SURE_OVERLAP));
    assert!(is_better_than_sound(&rating(0.99, None), &own));
    assert!(!is_better_than_sound(&rating(0.85, None), &own), "gloss and noise do as much");
    let masked = rating(0.78, Some(0.83));
    assert!(is_better_than_sound(&rating(0.99, Some(0.99)), &masked));
    assert!(!is_better_than_sound(&rating(0.95, Some(0.8)), &masked), "masks speak against it");
    assert!(!is_better_than_sound(&rating(0.95, None), &masked), "nothing is in sight of the masks");
    assert!(!is_better_than_sound(&rating(0.99, Some(0.89)), &rating(0.97, Some(0.89))), "both are about alike");
}

#[test]
fn a_round_object_that_is_turned_is_noticed_though_photos_agree_well() {
    let about_origin = ring_about_origin();
    let (ball, views) = seen_with(DVec3::ZERO, DVec3::new(1.12, 1.0, 0.88), &about_origin);
    let z_up = DMat4::from_mat3(DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y));
    let mut turned = moved_by(&ball, z_up.inverse());
    let mut rater = Rater::new(&turned, &about_origin, views.clone(), &in_pixels);
    let before = rater.rate(&DMat4::IDENTITY).agreement.unwrap();
    assert!((SOUND_AGREEMENT..SURE_AGREEMENT).contains(&before), "{before}");
    for (mesh, is_moved) in [(&mut turned, true), (&mut ball.clone(), false)] {
        let mut findings = Vec::new();
        put_right(mesh, (&about_origin, views.clone()), &in_pixels, &[], &mut findings);
        let off = mesh.positions.iter().zip(&ball.positions).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        assert!(off < 1e-9 && findings.len() == usize::from(is_moved), "off by {off}: {findings:?}");
    }
}
