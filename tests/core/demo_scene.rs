//! The demo and the study scenes: what a renderer and a fit rely on.

#![allow(clippy::unwrap_used)]

use glam::{Vec2, Vec3};
use patina::export::exchange::{self, ExchangeOptions};
use patina::image::Image;
use patina::lab::scenes::study::{self, StudyKind, StudySettings};
use patina::scene::demo::{DemoScene, DemoSettings, build};
use patina::scene::{Background, Mesh, PixelState, ReadSettings};
use patina::trace::Bvh;

fn small() -> DemoSettings {
    DemoSettings { width: 48, height: 36, map_size: 256, ..DemoSettings::default() }
}

/// Triangles around each texel centre, on a map of twice the size.
fn triangles_at_texels(mesh: &Mesh, size: usize) -> Image<Vec<u32>> {
    let mut owners: Image<Vec<u32>> = Image::filled(size, size, Vec::new());
    for (index, triangle) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = triangle.map(|vertex| {
            let uv = mesh.uvs[vertex as usize];
            Vec2::new(uv.x, 1.0 - uv.y) * size as f32
        });
        let (low, high) = (a.min(b).min(c).max(Vec2::ZERO), a.max(b).max(c));
        let area = (b - a).perp_dot(c - a);
        for row in low.y as usize..=(high.y as usize).min(size - 1) {
            for column in low.x as usize..=(high.x as usize).min(size - 1) {
                let p = Vec2::new(column as f32 + 0.5, row as f32 + 0.5);
                let sides = [(a, b), (b, c), (c, a)].map(|(from, to)| (to - from).perp_dot(p - from) / area);
                if sides.iter().all(|&side| side > 1e-3) {
                    owners[(row, column)].push(index as u32);
                }
            }
        }
    }
    owners
}

fn demo() -> DemoScene {
    build(&small()).unwrap()
}

#[test]
fn charts_do_not_overlap_and_keep_their_gutters() {
    let demo = demo();
    let size = 512;
    let owners = triangles_at_texels(&demo.scene.mesh, size);
    let mut covered = 0;
    for row in 0..size {
        for column in 0..size {
            let here = &owners[(row, column)];
            assert!(here.len() <= 1, "texel {row} {column} belongs to triangles {here:?}");
            let Some(&triangle) = here.first() else { continue };
            covered += 1;
            // Other parts stay 4 texels of the map away: 8 of these.
            for (other_row, other_column) in [(row + 7, column), (row, column + 7)] {
                if other_row < size && other_column < size {
                    for &other in &owners[(other_row, other_column)] {
                        assert_eq!(demo.triangle_part[triangle as usize], demo.triangle_part[other as usize]);
                    }
                }
            }
        }
    }
    let share = covered as f32 / (size * size) as f32;
    assert!(share > 0.5, "only {share} of the map is used");
    assert!(demo.scene.mesh.uvs.iter().all(|uv| uv.min_element() > 0.0 && uv.max_element() < 1.0));
}

#[test]
fn the_truth_varies_in_every_map_and_most_of_it_is_seen() {
    let demo = demo();
    let truth = demo.scene.truth.as_ref().unwrap();
    let covered: Vec<usize> = (0..demo.covered.pixels().len()).filter(|&texel| demo.covered.pixels()[texel]).collect();
    let seen = covered.iter().filter(|&&texel| truth.texels_seen.pixels()[texel]).count() as f32 / covered.len() as f32;
    assert!(seen > 0.6, "only {seen} of the texels are seen");
    let share = |test: &dyn Fn(usize) -> bool| {
        covered.iter().filter(|&&texel| test(texel)).count() as f32 / covered.len() as f32
    };
    let (maps, at) = (&truth.maps, |texel: usize| truth.maps.roughness.pixels()[texel]);
    let metal = share(&|texel| maps.specular.pixels()[texel].max_element() > 0.5);
    let (sharp, rough) = (share(&|texel| at(texel) < 0.1), share(&|texel| at(texel) > 0.6));
    assert!(metal > 0.05 && sharp > 0.1 && rough > 0.1, "metal {metal}, sharp {sharp}, rough {rough}");
    for texel in 0..demo.covered.pixels().len() {
        let total = maps.diffuse.pixels()[texel] + maps.specular.pixels()[texel];
        assert!(total.is_finite() && total.min_element() >= 0.0 && total.max_element() <= 1.0);
        assert!((0.019..=1.0).contains(&at(texel)));
    }
}

#[test]
fn every_view_sees_the_scene_from_above_the_floor_and_the_held_out_ones_are_new() {
    let demo = demo();
    let scene = &demo.scene;
    assert_eq!(scene.views.iter().filter(|view| !view.held_out).count(), 48);
    assert_eq!(scene.views.len(), 54);
    let bvh = Bvh::build(&scene.mesh.positions, &scene.mesh.triangles).unwrap();
    let mut background = 0;
    for view in &scene.views {
        view.camera.validate(1e-5).unwrap();
        assert!(view.camera.position_in_world().y > 0.2);
        let hits = (0..48 * 36)
            .filter(|pixel| {
                let place = Vec2::new((pixel % 48) as f32 + 0.5, (pixel / 48) as f32 + 0.5);
                bvh.closest_hit(&view.camera.ray_through(place)).is_some()
            })
            .count();
        assert!(hits * 10 > 48 * 36 * 2, "view {} sees little of the scene", view.name);
        background += 48 * 36 - hits;
    }
    assert!(background > 0, "no view shows the light itself");
    for held_out in scene.views.iter().filter(|view| view.held_out) {
        for view in scene.views.iter().filter(|view| !view.held_out) {
            let apart = held_out.camera.position_in_world().distance(view.camera.position_in_world());
            assert!(apart > 0.1, "{} stands on {}", held_out.name, view.name);
        }
    }
}

#[test]
fn objects_do_not_touch() {
    let demo = demo();
    let mesh = &demo.scene.mesh;
    // Rays along the edges of one part must not cross the surface of another.
    let bvh = Bvh::build(&mesh.positions, &mesh.triangles).unwrap();
    for (index, triangle) in mesh.triangles.iter().enumerate() {
        for side in 0..3 {
            let from = mesh.positions[triangle[side] as usize];
            let to = mesh.positions[triangle[(side + 1) % 3] as usize];
            let ray = patina::trace::Ray { origin: from, direction: to - from, t_max: 1.0 };
            if let Some(hit) = bvh.closest_hit(&ray) {
                assert_eq!(
                    demo.triangle_part[index],
                    demo.triangle_part[hit.triangle as usize],
                    "{} and {} meet at {from}",
                    demo.parts[demo.triangle_part[index] as usize],
                    demo.parts[demo.triangle_part[hit.triangle as usize] as usize]
                );
            }
        }
    }
    assert!((8_000..30_000).contains(&mesh.triangles.len()), "{} triangles", mesh.triangles.len());
}

#[test]
fn shading_normals_agree_with_the_triangles() {
    let demo = demo();
    let mesh = &demo.scene.mesh;
    let mut worst = [1.0f32; 16];
    for (index, triangle) in mesh.triangles.iter().enumerate() {
        let flat = mesh.area_vector(index).try_normalize().unwrap();
        let part = demo.triangle_part[index] as usize;
        for &vertex in triangle {
            worst[part] = worst[part].min(flat.dot(mesh.normals[vertex as usize]));
        }
    }
    for (part, name) in demo.parts.iter().enumerate() {
        assert!(worst[part] > 0.7, "{name}: cosine {} between shading and geometric normal", worst[part]);
    }
}

#[test]
fn the_same_settings_give_the_same_bits_and_another_seed_other_cameras() {
    let settings = DemoSettings { map_size: 96, width: 8, height: 6, ..small() };
    let (one, two) = (build(&settings).unwrap(), build(&settings).unwrap());
    assert_eq!(one.scene.truth.as_ref().unwrap().maps, two.scene.truth.as_ref().unwrap().maps);
    assert_eq!(one.scene.truth.as_ref().unwrap().texels_seen, two.scene.truth.as_ref().unwrap().texels_seen);
    assert_eq!(one.scene.views[7].camera, two.scene.views[7].camera);
    let other = build(&DemoSettings { seed: 2, ..settings }).unwrap();
    assert_ne!(one.scene.views[7].camera, other.scene.views[7].camera);
}

#[test]
fn settings_that_make_no_scene_are_refused() {
    for wrong in [
        DemoSettings { views: 0, ..small() },
        DemoSettings { width: 0, ..small() },
        DemoSettings { map_size: 0, ..small() },
        DemoSettings { map_size: 16, ..small() },
    ] {
        assert!(build(&wrong).is_err(), "{wrong:?}");
    }
}

#[test]
fn a_photo_must_fit_its_camera_and_pixels_that_are_no_numbers_are_ignored() {
    let mut scene = build(&DemoSettings { map_size: 96, ..small() }).unwrap().scene;
    assert!(scene.set_photo(0, Image::filled(47, 36, Vec3::ONE)).is_err());
    assert!(scene.set_photo(99, Image::filled(48, 36, Vec3::ONE)).is_err());
    let mut picture = Image::filled(48, 36, Vec3::splat(0.25));
    picture[(3, 4)] = Vec3::new(0.0, f32::NAN, 0.0);
    scene.set_photo(1, picture).unwrap();
    assert_eq!(scene.views[1].photo.radiance(0, 0), Vec3::splat(0.25));
    assert_eq!(scene.views[1].photo.radiance(3, 4), Vec3::ZERO);
    assert_eq!(scene.views[1].states[(3, 4)], PixelState::Ignored);
    assert_eq!(scene.views[1].states[(3, 5)], PixelState::Surface);
}

#[test]
fn study_scenes_fill_the_picture_and_keep_their_promise() {
    let settings = StudySettings { views: 6, held_out: 2, size: 32, map_size: 128, ..StudySettings::default() };
    for kind in [StudyKind::Vase, StudyKind::CopperSphere] {
        let mesh = kind.mesh_in_code(settings.map_size).unwrap().unwrap();
        let scene = study::build(kind, mesh, &settings).unwrap();
        let truth = scene.truth.unwrap();
        let seen = truth.texels_seen.pixels().iter().filter(|&&seen| seen).count();
        assert!(seen > 2000, "{}: {seen} texels seen", kind.name());
        for view in &scene.views {
            for position in &scene.mesh.positions {
                let (place, _) = view.camera.project(*position).unwrap();
                assert!(place.min_element() > -2.0 && place.max_element() < 34.0, "{} leaves the picture", kind.name());
            }
        }
        let specular = truth.maps.specular.pixels().iter().map(|rgb| rgb.max_element()).fold(f32::MAX, f32::min);
        assert!(specular > 0.2, "{} is to be highly specular everywhere", kind.name());
    }
    assert!(StudyKind::Cow.mesh_in_code(64).unwrap().is_none());
    assert!(study::build(StudyKind::Cow, Mesh::default(), &settings).is_err());
}

#[test]
fn a_folder_that_is_written_is_read_as_the_same_scene() {
    let settings = DemoSettings { views: 3, held_out: 1, map_size: 96, ..small() };
    let mut demo = build(&settings).unwrap();
    for view in 0..4 {
        demo.scene.set_photo(view, Image::from_fn(48, 36, |row, _| Vec3::splat(0.1 + row as f32))).unwrap();
    }
    let mut truth = demo.scene.truth.clone().unwrap();
    truth.relight.as_mut().unwrap().pictures.push((3, Image::filled(48, 36, Vec3::X)));
    let folder = tempfile::tempdir().unwrap();
    let options = ExchangeOptions { with_photos: true, ..ExchangeOptions::default() };
    exchange::write(&demo.scene, &truth, &options, folder.path()).unwrap();
    let read = patina::scene::read(folder.path(), &ReadSettings::default()).unwrap();
    let again = read.truth.unwrap();
    assert_eq!((again.maps, again.environment, again.max_bounces), (truth.maps, truth.environment, truth.max_bounces));
    assert_eq!(again.texels_seen, truth.texels_seen);
    assert_eq!(again.relight.unwrap().pictures, truth.relight.unwrap().pictures);
    assert_eq!(read.background, Background::Environment);
    assert_eq!(read.mesh.triangles.len(), demo.scene.mesh.triangles.len());
    for (one, two) in read.views.iter().zip(&demo.scene.views) {
        assert_eq!((one.held_out, &one.name), (two.held_out, &two.name));
        assert_eq!(one.photo.radiance(20, 7), two.photo.radiance(20, 7));
        assert!(one.camera.position_in_world().distance(two.camera.position_in_world()) < 1e-5);
    }
}

#[test]
fn the_reference_scenes_are_written_and_read_again() {
    let folder = tempfile::tempdir().unwrap();
    patina::lab::scenes::write_references(folder.path(), &|_| {}).unwrap();
    for name in ["demo", "vase"] {
        let mesh = folder.path().join(name).join("mesh.obj");
        assert!(patina::scene::read_mesh(&mesh).unwrap().0.triangles.len() > 1000, "{name}");
    }
}
