//! The check as a whole, on photographs that the cache itself makes of a surface whose halves are known.

use super::super::solver::{Solver, SolverStep};
use super::super::{Estimate, SolverSettings};
use super::choices::Choices;
use super::judge::region_of;
use crate::image::Image;
use crate::math::random::SequentialRandom;
use crate::render::Surface;
use crate::render::cached::{CachedTransport, SeenRows, ViewFootprints};
use crate::scene::{Scene, demo};
use glam::Vec3;
use std::sync::atomic::AtomicBool;

/// Two regions along each side.
const SIZE: usize = 64;
static GO: AtomicBool = AtomicBool::new(false);

struct Photographed {
    scene: Scene,
    surface: Surface,
}

fn settings() -> SolverSettings {
    SolverSettings {
        map_size: SIZE,
        grid: 48,
        bounce_rays: 16,
        max_bounces: 2,
        fixed_light: true,
        check_choices: true,
        ..SolverSettings::default()
    }
}

fn solver(made: &Photographed, settings: SolverSettings) -> Solver {
    let light = &made.scene.truth.as_ref().unwrap().environment;
    Solver::new(&made.scene, &made.surface, settings, Some(light)).unwrap()
}

/// Photographs by the cache: diffuse reflectance .4, a lobe where `lobe_of` a region says so, and normal noise relative
/// to the mean radiance.
fn photograph(held_out: usize, noise: f32, lobe_of: impl Fn(usize) -> Option<[f32; 4]>) -> Photographed {
    let views = 16;
    let demo =
        demo::DemoSettings { views, held_out, width: 64, height: 48, map_size: SIZE, seed: 1, ..Default::default() };
    let mut scene = demo::build(&demo).unwrap().scene;
    let surface = Surface::new(scene.mesh.clone()).unwrap();
    for view in 0..scene.views.len() {
        scene.set_photo(view, Image::filled(64, 48, Vec3::splat(0.5))).unwrap();
    }
    let mut made = Photographed { scene, surface };
    let Solver { scene: cache, estimate } = solver(&made, settings());
    let planes = cache.transport.basis.planes(&estimate.light);
    let at = cache.point_light(&estimate.texels, &planes);
    let mut random = SequentialRandom::new(9);
    let mut normal = move || random.next_normal();
    let judging = cache.held_out.iter().map(|(target, _)| (target.view, &target.camera));
    for (view, camera) in cache.views.iter().copied().zip(&cache.cameras).chain(judging) {
        let grid = &cache.transport.grid;
        let footprints = ViewFootprints::trace(&made.surface, grid, camera, &cache.first_hits);
        let mut picture = vec![Vec3::ZERO; 64 * 48];
        let mut around = SeenRows::default();
        for point in &footprints.points {
            let texel = footprints.texels_of(point)[0].0 as usize;
            let radiance = match lobe_of(region_of(texel, SIZE)) {
                Some([a, b, c, width]) => {
                    let material = [0.4, 0.4, 0.4, a, b, c, width];
                    cache.transport.shade(&planes, &at, &footprints, point, &material, &mut around)
                }
                None => CachedTransport::interpolate(&at.arriving, &footprints, point).map(|arriving| 0.4 * arriving),
            };
            picture[point.pixel as usize] += point.share * Vec3::from_array(radiance);
        }
        let mean = picture.iter().map(|pixel| pixel.element_sum()).sum::<f32>() / (3 * picture.len()) as f32;
        for pixel in &mut picture {
            *pixel += noise * mean * Vec3::new(normal(), normal(), normal());
        }
        made.scene.set_photo(view, Image::from_pixels(64, 48, picture)).unwrap();
    }
    made
}

fn judge(made: &Photographed, settings: SolverSettings, threads: usize) -> (Option<Choices>, Estimate) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| {
        let mut solver = solver(made, settings);
        let report = solver.scene.step(SolverStep::Maps, &mut solver.estimate, &GO).unwrap();
        (report.choices, solver.estimate)
    })
}

/// Share of the judged texels of regions in the left and the right half for which something was chosen.
fn shares(choices: &Choices, is_it: impl Fn(f32) -> bool) -> [f64; 2] {
    let mut counts = [[0.0f64; 2]; 2];
    for (texel, &code) in choices.map.pixels().iter().enumerate().filter(|(_, code)| **code > 0.0) {
        let half = region_of(texel, SIZE) % 2;
        counts[half][0] += f64::from(u8::from(is_it(code)));
        counts[half][1] += 1.0;
    }
    counts.map(|[chosen, all]| chosen / all)
}

fn without_seconds(choices: &Choices) -> Choices {
    let mut choices = choices.clone();
    choices.seconds = 0.0;
    choices.lines.iter_mut().for_each(|line| line.seconds = None);
    choices
}

#[test]
fn halves_with_and_without_a_lobe_are_told_apart_by_held_out_views() {
    let made = photograph(5, 0.02, |region| (region % 2 == 1).then_some([0.3, 0.3, 0.3, -1.0]));
    let choices = judge(&made, settings(), 2).0.unwrap();
    println!("{choices}");
    assert!(choices.views == 5 && !choices.are_withheld && choices.pixels > 2000);
    let none = shares(&choices, |code| code == 1.0);
    assert!(none[0] > 0.9 && none[1] < 0.1, "{none:?}");
    let line = |name: &str| choices.lines.iter().find(|line| line.name.starts_with(name)).unwrap();
    assert!(line("one lobe").is_borne_out() && line("light from other surface").is_borne_out());
    assert!(line("one lobe").rmse_change.unwrap() < 0.0);
}

#[test]
#[ignore = "slow: the check of another test three times over"]
fn nothing_depends_on_threads_and_maps_are_what_they_are_without_the_check() {
    let made = photograph(5, 0.02, |region| (region % 2 == 1).then_some([0.3, 0.3, 0.3, -1.0]));
    let (choices, estimate) = judge(&made, settings(), 2);
    let (again, same) = judge(&made, settings(), 1);
    assert_eq!(without_seconds(&again.unwrap()), without_seconds(&choices.unwrap()));
    assert!(same == estimate);
    let (unchecked, plain) = judge(&made, SolverSettings { check_choices: false, ..settings() }, 2);
    assert!(unchecked.is_none() && plain == estimate);
}

#[test]
#[ignore = "slow: a check of its own on photographs of its own"]
fn noise_alone_bears_no_lobe_out() {
    let made = photograph(5, 0.3, |_| None);
    let (choices, _) = judge(&made, settings(), 2);
    let choices = choices.unwrap();
    println!("{choices}");
    let share = choices.lines[0].share.unwrap();
    assert!(share > 0.5, "{share}");
}

#[test]
#[ignore = "slow: a check of its own on photographs of its own"]
fn without_held_out_views_some_are_withheld_from_the_check_alone() {
    let made = photograph(0, 0.02, |region| (region % 2 == 1).then_some([0.3, 0.3, 0.3, -1.0]));
    let (choices, estimate) = judge(&made, settings(), 2);
    let choices = choices.unwrap();
    println!("{choices}");
    assert!(choices.views == 2 && choices.are_withheld);
    let none = shares(&choices, |code| code == 1.0);
    assert!(none[0] > 0.9 && none[1] < 0.1, "{none:?}");
    let (_, plain) = judge(&made, SolverSettings { check_choices: false, ..settings() }, 2);
    assert!(plain == estimate, "withheld views take part in the maps");
}
