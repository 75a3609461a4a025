//! The cursor that joins photo, surface and map, and the record of one point.

#![allow(clippy::unwrap_used)]

use super::common::*;
use glam::{Vec2, Vec3};
use patina::image::Image;
use patina::insight::cursor::{
    UvIndex, place_in_view, point_of_pixel, seen_at, surface_point_of_triangle, surface_point_of_uv, uv_of_texel,
};
use patina::insight::record::{RecordSettings, texel_record};
use patina::job::pictures::parameters;
use patina::material::texels::texel_of_uv;
use patina::render::Surface;
use patina::render::picture::PictureSettings;
use patina::scene::demo::{DemoSettings, build};
use patina::scene::{Mesh, PixelState, Scene};

fn demo() -> (Scene, Surface) {
    let settings =
        DemoSettings { views: 6, held_out: 2, width: 80, height: 60, map_size: 128, seed: 1, ..Default::default() };
    let scene = build(&settings).unwrap().scene;
    let surface = Surface::new(scene.mesh.clone()).unwrap();
    (scene, surface)
}

/// Places all over a picture.
fn places(scene: &Scene, view: usize) -> impl Iterator<Item = Vec2> {
    let (width, height) = (scene.views[view].camera.width, scene.views[view].camera.height);
    (0..height).step_by(5).flat_map(move |row| {
        (0..width).step_by(5).map(move |column| Vec2::new(column as f32 + 0.37, row as f32 + 0.61))
    })
}

#[test]
fn photo_to_point_to_map_and_back() {
    let (scene, surface) = demo();
    let index = UvIndex::new(surface.mesh());
    let (mut found, mut missed) = (0, 0);
    for view in 0..scene.views.len() {
        for place in places(&scene, view) {
            let Some(point) = point_of_pixel(&scene, &surface, view, place) else { continue };
            let again = surface_point_of_uv(&surface, &index, point.uv).expect("a point of a chart is on the map");
            // Texture coordinates of 24 bits over a floor of 8 units.
            assert!((again.position - point.position).length() < 2e-3, "{place}: {point:?} {again:?}");
            assert_eq!(seen_at(&scene, &surface, view, &point).is_some(), {
                let seen = seen_at(&scene, &surface, view, &again);
                seen.is_some_and(|back| (back - place).length() < 0.1)
            });
            found += 1;
            missed += usize::from(seen_at(&scene, &surface, view, &point).is_none());
        }
    }
    assert!(found > 800, "{found} of the places show the surface");
    // A ray that grazes an edge may meet it on the way back.
    assert!(missed * 200 <= found, "{missed} of {found} points are not seen by the view they came from");
}

#[test]
fn what_a_view_sees_is_what_its_own_ray_meets_first() {
    let (scene, surface) = demo();
    let (mut seen, mut hidden) = (0, 0);
    for place in places(&scene, 0) {
        let Some(point) = point_of_pixel(&scene, &surface, 0, place) else { continue };
        for view in 1..scene.views.len() {
            let Some(other) = place_in_view(&scene, view, point.position) else {
                assert!(seen_at(&scene, &surface, view, &point).is_none());
                continue;
            };
            let ray = scene.views[view].camera.ray_through(other);
            let distance = (point.position - ray.origin).length();
            let Some(first) = surface.closest(&ray) else { continue };
            // Near an edge the two rays may differ; elsewhere they agree.
            if (first.t - distance).abs() < 1e-3 {
                let grazing = point.geometric_normal.dot(ray.direction).abs() < 0.02;
                assert!(grazing || seen_at(&scene, &surface, view, &point).is_some(), "{place} in view {view}");
                seen += 1;
            } else if first.t < distance - 0.05 {
                assert!(seen_at(&scene, &surface, view, &point).is_none(), "{place} is hidden in view {view}");
                hidden += 1;
            }
        }
    }
    assert!(seen > 200 && hidden > 100, "{seen} {hidden}");
}

#[test]
fn the_index_finds_what_a_walk_over_all_triangles_finds() {
    let (_, surface) = demo();
    let mesh = surface.mesh();
    let index = UvIndex::new(mesh);
    let inside = |triangle: &[u32; 3], uv: Vec2| {
        let [a, b, c] = triangle.map(|vertex| mesh.uvs[vertex as usize]);
        let signs = [(b - a).perp_dot(uv - a), (c - b).perp_dot(uv - b), (a - c).perp_dot(uv - c)];
        signs.iter().all(|&sign| sign > 1e-9) || signs.iter().all(|&sign| sign < -1e-9)
    };
    let mut charts = 0;
    for row in 0..48 {
        for column in 0..48 {
            let uv = uv_of_texel(row, column, 48, 48);
            let expected = mesh.triangles.iter().position(|triangle| inside(triangle, uv));
            let found = index.hit(mesh, uv);
            match (expected, &found) {
                (Some(triangle), Some(hit)) => {
                    assert_eq!(hit.triangle as usize, triangle);
                    charts += 1;
                }
                (Some(_), None) => panic!("nothing at {uv}"),
                // On an edge, or nearly.
                (None, _) => {}
            }
            if let Some(hit) = found {
                let weights = Vec2::new(hit.u, hit.v);
                let point = surface_point_of_triangle(&surface, hit.triangle as usize, weights).unwrap();
                assert!((point.uv - uv).length() < 1e-5);
                assert_eq!(texel_of_uv(uv, 48, 48), (row, column));
            }
        }
    }
    assert!(charts > 500, "{charts}");
    for nowhere in [Vec2::NAN, Vec2::splat(-3.0), Vec2::new(f32::INFINITY, 0.5)] {
        assert!(index.hit(mesh, nowhere).is_none());
    }
    assert!(UvIndex::new(&Mesh::default()).hit(&Mesh::default(), Vec2::splat(0.5)).is_none());
    assert!(surface_point_of_triangle(&surface, mesh.triangles.len(), Vec2::ZERO).is_none());
}

#[test]
fn the_index_of_a_large_mesh_and_of_one_that_lies_over_itself_stays_small() {
    let side = 477;
    let grid = |scale: f32| {
        let mut mesh = Mesh::default();
        for row in 0..=side {
            for column in 0..=side {
                let uv = Vec2::new(column as f32, row as f32) / side as f32;
                mesh.positions.push(uv.extend(0.0));
                mesh.uvs.push((uv * scale).fract());
            }
        }
        for row in 0..side {
            for column in 0..side {
                let a = (row * (side + 1) + column) as u32;
                let below = a + side as u32 + 1;
                mesh.triangles.push([a, a + 1, below]);
                mesh.triangles.push([a + 1, below + 1, below]);
            }
        }
        mesh
    };
    for (name, mesh) in [("one sheet", grid(0.999)), ("wrapped around 90 times", grid(90.0))] {
        let began = std::time::Instant::now();
        let index = UvIndex::new(&mesh);
        println!("{name}: {} triangles indexed in {:?}", mesh.triangles.len(), began.elapsed());
        let found = (0..1000).filter(|&k| {
            let uv = Vec2::new((k as f32 * 0.618_034).fract(), (k as f32 * 0.414_214).fract()) * 0.99;
            index.hit(&mesh, uv).is_some()
        });
        assert!(found.count() > 950, "{name}");
    }
}

#[test]
fn the_record_says_what_photos_and_model_say() {
    let trial = Trial { cameras: around(6, 35.0), ..Default::default() };
    let mut scene = trial.photographed();
    let surface = trial.surface();
    let truth = trial.truth();
    scene.views[4].held_out = true;
    // The point of the floor in the middle of view 0, and the point of the ball that faces it.
    let ball = point_of_pixel(&scene, &surface, 0, Vec2::new(12.0, 10.0)).unwrap();
    assert!(ball.position.y > 0.3, "{ball:?}");
    let hidden: Vec<usize> = (0..6).filter(|&view| seen_at(&scene, &surface, view, &ball).is_none()).collect();
    assert!(!hidden.is_empty() && !hidden.contains(&0), "the far side of the ball is not seen: {hidden:?}");

    let clipped_place = seen_at(&scene, &surface, 0, &ball).unwrap();
    let (row, column) = (clipped_place.y as usize, clipped_place.x as usize);
    scene.views[0].states[(row, column)] = PixelState::SurfaceClipped;
    let settings = RecordSettings {
        picture: PictureSettings { samples: 256, max_bounces: trial.bounces, ..Default::default() },
        gains: vec![1.0, 2.0],
        excluded: vec![false, false, true],
    };
    let record = texel_record(&scene, &surface, &truth, &ball, &settings);
    assert_eq!(record, texel_record(&scene, &surface, &truth, &ball, &settings), "same bits");
    let listed: Vec<usize> = record.rows.iter().map(|row| row.view).collect();
    let expected: Vec<usize> = (0..6).filter(|view| !hidden.contains(view)).collect();
    assert_eq!(listed, expected);
    for row in &record.rows {
        assert_eq!(row.name, scene.views[row.view].name);
        assert_eq!((row.held_out, row.is_excluded), (row.view == 4, row.view == 2));
        assert_eq!(row.residual, row.model - row.photo);
        let gain = if row.view == 1 { 2.0 } else { 1.0 };
        let error = (row.model / gain - row.photo).abs().max_element();
        // Photos are rendered with 32 paths a pixel.
        assert!(error < 0.15 * row.photo.max_element(), "view {}: {} {}", row.view, row.model, row.photo);
        assert!((0.0..90.0).contains(&row.angle_degrees) && row.footprint_texels > 0.0);
    }
    assert!((record.clipped_share - 1.0 / record.rows.len() as f32).abs() < 1e-6);
    let steepest = record.rows.iter().map(|row| row.angle_degrees).fold(0.0, f32::max);
    assert_eq!(record.grazing_degrees, steepest);
    // Cameras stand every 60 degrees around at 35 degrees of height: the chord of neighbours is 48 degrees at least.
    assert!(record.view_spread_degrees > 40.0 && record.view_spread_degrees < 115.0, "{record:?}");
    assert!((record.roughness - 0.3).abs() < 1e-4 && (record.diffuse.x - 0.7).abs() < 1e-6);
    assert_eq!(record.texel, (0, 0), "a map of one texel");
    assert!(serde_json::to_string(&record).unwrap().contains("\"angle_degrees\""));
}

#[test]
fn a_point_that_nobody_sees_has_a_record_without_rows() {
    let (scene, surface) = demo();
    let truth = scene.truth.as_ref().unwrap();
    let lit = parameters(&truth.maps, &truth.environment);
    let index = UvIndex::new(surface.mesh());
    let unseen = Image::from_fn(96, 96, |row, column| {
        let point = surface_point_of_uv(&surface, &index, uv_of_texel(row, column, 96, 96));
        point.filter(|point| (0..scene.views.len()).all(|view| seen_at(&scene, &surface, view, point).is_none()))
    });
    let point = unseen.pixels().iter().flatten().next().expect("the inside of the vase");
    let settings =
        RecordSettings { picture: PictureSettings { samples: 2, ..Default::default() }, ..Default::default() };
    let record = texel_record(&scene, &surface, &lit, point, &settings);
    assert!(record.rows.is_empty() && record.clipped_share.is_nan() && record.grazing_degrees.is_nan());
    assert!(record.view_spread_degrees.is_nan() && record.footprint_texels.is_nan());
    assert!(record.diffuse.cmpge(Vec3::ZERO).all());
}
