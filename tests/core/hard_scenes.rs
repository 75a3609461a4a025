//! What the check says of the hard cases of the lab, and of the same scenes without their fault.

use crate::image::Image;
use crate::lab::scenes::hard::{HardCase, HardSettings, build};
use crate::scene::doctor::{self, SurfaceCheck, check, normals};
use crate::scene::{Mesh, Photo, Scene};
use glam::Vec3;

/// A deep bowl of plaster with its truth, in which light goes to and fro; photos are black.
pub fn bowl_of_plaster(map_size: usize) -> Scene {
    let settings = HardSettings { size: 32, views: 8, held_out: 0, map_size, ..HardSettings::default() };
    build(HardCase::Plaster, &settings).unwrap().scene
}

#[test]
fn a_decimated_object_is_told_and_the_whole_one_is_not() {
    let settings = HardSettings { size: 48, views: 6, held_out: 1, ..Default::default() };
    for (case, is_told) in [(HardCase::Plain, false), (HardCase::Decimated, true), (HardCase::NoisyNormals, false)] {
        let hard = build(case, &settings).unwrap();
        let report = doctor::check(&hard.spoil(&hard.scene).unwrap());
        let told = report.findings.iter().any(|finding| finding.code == "mesh-coarse");
        assert_eq!(told, is_told, "{}: {:?}", case.name(), report.surface);
    }
}

fn surface_of(case: HardCase, size: usize) -> (SurfaceCheck, Vec<&'static str>) {
    let views = if size > 100 { 2 } else { 8 };
    let hard = build(case, &HardSettings { size, views, held_out: 1, ..Default::default() }).unwrap();
    let report = check(&hard.scene);
    (report.surface, report.findings.iter().map(|finding| finding.code).collect())
}

#[test]
fn walls_thinner_than_a_pixel_are_told_and_thicker_ones_are_not() {
    let (thin, told) = surface_of(HardCase::ThinShells, 48);
    assert!(thin.thin_share > 0.2 && told.contains(&"mesh-thin"), "{thin:?} {told:?}");
    // A wall of 0.006 where pixels are 0.003 wide and not 0.08.
    let (thick, told) = surface_of(HardCase::ThinShells, 1200);
    assert!(thick.thin_share < 0.01 && !told.contains(&"mesh-thin"), "{thick:?} {told:?}");
    let (plain, told) = surface_of(HardCase::Plain, 48);
    assert!(plain.thin_share == 0.0 && !told.contains(&"mesh-thin"), "{plain:?} {told:?}");
}

#[test]
fn things_that_touch_are_told() {
    let (touching, told) = surface_of(HardCase::Touching, 48);
    assert!(told.contains(&"mesh-touching"), "{touching:?} {told:?}");
    let (plain, told) = surface_of(HardCase::Plain, 48);
    assert!(plain.touching_share < touching.touching_share / 2.0, "{plain:?} {touching:?}");
    assert!(!told.contains(&"mesh-touching"), "{told:?}");
}

fn fine_share(scene: &Scene) -> (f64, bool) {
    let report = check(scene);
    (report.surface.fine_share, report.findings.iter().any(|finding| finding.code == "detail-too-fine"))
}

#[test]
fn chequers_of_a_pixel_are_told_and_larger_or_fainter_ones_are_not() {
    let mut scene =
        build(HardCase::Plain, &HardSettings { views: 3, held_out: 1, ..Default::default() }).unwrap().scene;
    let mut with = |cell: usize, contrast: f32| {
        for view in &mut scene.views {
            view.photo = Photo::Linear32(Image::from_fn(48, 48, |row, column| {
                let sign = if (row / cell + column / cell).is_multiple_of(2) { 1.0 } else { -1.0 };
                Vec3::splat(0.5 * (1.0 + contrast * sign))
            }));
        }
        fine_share(&scene)
    };
    assert_eq!(with(1, 0.5), (1.0, true));
    assert_eq!(with(1, 0.05), (0.0, false));
    assert_eq!(with(2, 0.5), (0.0, false), "blocks of 2 x 2 pixels are even");
    assert_eq!(with(3, 0.0), (0.0, false));
    assert_eq!(with(1, 0.5), (1.0, true));
    scene.views.iter_mut().for_each(|view| view.held_out = true);
    assert_eq!(fine_share(&scene), (0.0, false), "held-out photos are not asked");
}

#[test]
fn sound_and_coarse_meshes_pass_and_noisy_normals_do_not() {
    let settings = HardSettings { size: 8, views: 2, held_out: 1, ..Default::default() };
    let of = |case: HardCase| {
        let hard = build(case, &settings).unwrap();
        normals::median_departure_degrees(&hard.spoil(&hard.scene).unwrap().mesh).unwrap()
    };
    let (plain, coarse, noisy) = (of(HardCase::Plain), of(HardCase::Decimated), of(HardCase::NoisyNormals));
    assert!(plain < 2.0 && coarse < normals::TOLD_DEGREES, "{plain} {coarse}");
    assert!(noisy > normals::TOLD_DEGREES, "{noisy}");
    assert_eq!(normals::median_departure_degrees(&Mesh::default()), None);
}
