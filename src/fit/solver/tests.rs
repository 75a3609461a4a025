//! The solver as a whole, on a small scene photographed by the path tracer.

use super::solver::Solver;
use super::*;
use crate::material::texels::{PyramidWeights, TexelPyramid, texels_from_maps};
use crate::material::{LobeModel, MaterialMaps};
use crate::render::picture::{PictureSettings, render};
use crate::render::{Parameters, Surface};
use crate::scene::{Scene, demo};
use std::sync::OnceLock;
use std::sync::atomic::AtomicBool;

const SIZE: usize = 64;

/// Photographed once for all tests.
fn photographed() -> &'static (Scene, Surface) {
    static SCENE: OnceLock<(Scene, Surface)> = OnceLock::new();
    SCENE.get_or_init(|| photograph(LobeModel::BlinnPhong))
}

fn photograph(lobe: LobeModel) -> (Scene, Surface) {
    let settings = demo::DemoSettings { views: 12, held_out: 0, width: 80, height: 60, map_size: SIZE, seed: 1, lobe };
    let mut scene = demo::build(&settings).unwrap().scene;
    let surface = Surface::new(scene.mesh.clone()).unwrap();
    let truth = scene.truth.clone().unwrap();
    let weights = PyramidWeights::flat(SIZE, SIZE);
    let texels = TexelPyramid::from_base(texels_from_maps(&truth.maps), &weights).with_model(lobe);
    let lit = Parameters::new(texels, &truth.environment);
    for view in 0..scene.views.len() {
        let settings = PictureSettings { samples: 32, max_bounces: truth.max_bounces, ..PictureSettings::default() };
        let camera = scene.views[view].camera;
        let picture = render(&surface, &camera, &lit, view as u32, &settings, &AtomicBool::new(false));
        scene.set_photo(view, picture.radiance).unwrap();
    }
    (scene, surface)
}

fn settings() -> SolverSettings {
    SolverSettings {
        map_size: SIZE,
        grid: 64,
        bounce_rays: 16,
        coarse_rounds: 2,
        fine_rounds: 1,
        blocks: 100,
        observations: 32,
        narrow_hats: 64,
        ..SolverSettings::default()
    }
}

/// Root mean square difference of diffuse reflectance over seen texels, as it is or after the best factor per channel,
/// and what a constant would have.
fn diffuse_error(scene: &Scene, maps: &MaterialMaps, aligned: bool) -> (f64, f64) {
    let truth = scene.truth.as_ref().unwrap();
    let seen: Vec<usize> = (0..SIZE * SIZE).filter(|&texel| truth.texels_seen.pixels()[texel]).collect();
    let mean = seen.iter().map(|&t| truth.maps.diffuse.pixels()[t].as_dvec3()).sum::<glam::DVec3>() / seen.len() as f64;
    let (mut product, mut power) = (glam::DVec3::ZERO, glam::DVec3::ZERO);
    for &texel in &seen {
        let own = maps.diffuse.pixels()[texel].as_dvec3();
        product += own * truth.maps.diffuse.pixels()[texel].as_dvec3();
        power += own * own;
    }
    let factor = if aligned { product / power } else { glam::DVec3::ONE };
    let (mut own, mut constant) = (0.0, 0.0);
    for &texel in &seen {
        let value = truth.maps.diffuse.pixels()[texel].as_dvec3();
        own += (factor * maps.diffuse.pixels()[texel].as_dvec3() - value).length_squared();
        constant += (mean - value).length_squared();
    }
    ((own / seen.len() as f64 / 3.0).sqrt(), (constant / seen.len() as f64 / 3.0).sqrt())
}

#[test]
fn maps_are_recovered_under_a_known_light_and_bits_do_not_depend_on_threads() {
    let (scene, surface) = photographed();
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let settings = SolverSettings { fixed_light: true, coarse_rounds: 1, fine_rounds: 0, ..settings() };
            let light = &scene.truth.as_ref().unwrap().environment;
            let mut solver = Solver::new(scene, surface, settings, Some(light)).unwrap();
            solver.run(&AtomicBool::new(false), &mut |_, _, _| {});
            solver.maps()
        })
    };
    let maps = run(2);
    let (own, constant) = diffuse_error(scene, &maps, false);
    println!("diffuse {own:.4}, a constant {constant:.4}");
    assert!(own < 0.65 * constant, "{own} {constant}");
    assert!(maps.roughness.pixels().iter().all(|r| r.is_finite()));
    assert_eq!(run(1), maps);
}

#[test]
fn light_and_maps_are_found_together() {
    let (scene, surface) = photographed();
    let settings = SolverSettings { coarse_rounds: 4, fine_rounds: 4, ..settings() };
    let mut solver = Solver::new(scene, surface, settings, None).unwrap();
    let mut stages = Vec::new();
    solver.run(&AtomicBool::new(false), &mut |step, _, _| stages.push(step));
    assert_eq!(stages.len(), 10);
    let (raw, constant) = diffuse_error(scene, &solver.maps(), false);
    assert!(raw < 0.9 * constant, "{raw} {constant}");
    let (own, _) = diffuse_error(scene, &solver.maps(), true);
    let light = solver.environment();
    let truth = &scene.truth.as_ref().unwrap().environment;
    println!("diffuse {own:.4}, a constant {constant:.4}");
    assert!(own < 0.8 * constant, "{own} {constant}");
    assert!(light.radiance.pixels().iter().all(|rgb| rgb.is_finite() && rgb.min_element() >= 0.0));
    // Photos without masks show the sky, and rays say where.
    let background = &solver.scene.background;
    let misfits = background.iter().map(|pixel| {
        let taps = pixel.tap.index.iter().zip(pixel.tap.weight);
        let own: f32 = taps.map(|(&texel, weight)| weight * light.radiance.pixels()[texel as usize].y).sum();
        (own / pixel.radiance[1] - 1.0).abs()
    });
    let misfit = misfits.sum::<f32>() / background.len() as f32;
    println!("{} background pixels, off by {misfit:.4}", background.len());
    assert!(background.len() > 1000 && misfit < 0.1, "{misfit}");
    // The background shows the sky, so the scale is known but for the sun, which no photo shows: one channel of it
    // may be off by a third on photos as small as these.
    let ratio = light.power() / truth.power();
    assert!(ratio.min_element() > 0.7 && ratio.max_element() < 1.45, "{ratio}");
}

/// Photos of one kind of lobe are explained by lobes of that kind, and less well by the others.
#[test]
fn lobes_are_of_the_kind_that_photos_show() {
    let (scene, surface) = photograph(LobeModel::Ggx);
    let light = &scene.truth.as_ref().unwrap().environment;
    let [as_others, as_they_are] = LobeModel::ALL.map(|lobe| {
        let settings = SolverSettings { fixed_light: true, coarse_rounds: 1, fine_rounds: 0, lobe, ..settings() };
        let mut solver = Solver::new(&scene, &surface, settings, Some(light)).unwrap();
        let mut error = f64::NAN;
        solver.run(&AtomicBool::new(false), &mut |_, report, _| error = report.squared_error);
        error.sqrt()
    });
    println!("residual of Blinn-Phong {as_others:.4}, of GGX {as_they_are:.4}");
    assert!(as_they_are < 0.95 * as_others, "{as_they_are} {as_others}");
}
