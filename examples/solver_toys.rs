//! The solver on a scene with a known truth: error against seconds.
//!
//! `cargo run --release --no-default-features --example solver_toys -- FOLDER [name=value …]`
//!
//! Names are the fields of `SolverSettings`, and `light=truth` to fit the maps under the true light,
//! `choices=tell` to let views judge which freedoms are needed, `choices=apply` to take over what they chose, `held_out` to
//! hold out every so many of them (0: none), `maps_steps` for the number of times that maps are made, `samples` a pixel for
//! the pictures of the path tracer (0: none), `out` for a folder that takes maps and light. Seconds
//! are the solver's own; scoring is left out.

use glam::Vec3;
use patina::fit::solver::{Estimate, Solver, SolverSettings, SolverStep};
use patina::image::{Image, RgbImage};
use patina::insight::intervals::interval_coverage;
use patina::insight::truth::{environment_errors, map_errors};
use patina::light::Environment;
use patina::material::MaterialMaps;
use patina::material::texels::{PyramidWeights, TexelPyramid, texels_from_maps};
use patina::render::picture::{PictureSettings, render};
use patina::render::{Parameters, Surface};
use patina::scene::{Background, ReadSettings, Scene, read};
use patina::{Error, ErrorKind, Result};
use std::sync::atomic::AtomicBool;
use std::time::Instant;

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let Some(folder) = arguments.first() else {
        return Err(Error::new(ErrorKind::InvalidSetting, "name a scene folder"));
    };
    let value =
        |name: &str| arguments.iter().find_map(|text| text.strip_prefix(&format!("{name}="))).map(str::to_string);
    let number = |name: &str, default: f64| value(name).and_then(|text| text.parse().ok()).unwrap_or(default);
    let count = |name: &str, default: usize| number(name, default as f64) as usize;
    let scene =
        read(folder.as_ref(), &ReadSettings { hold_out_every: count("held_out", 0), ..ReadSettings::default() })?;
    let Some(truth) = scene.truth.as_ref() else {
        return Err(Error::new(ErrorKind::InvalidScene, "the scene has no truth"));
    };
    let surface = Surface::new(scene.mesh.clone())?;
    let standard = SolverSettings::default();
    let settings = SolverSettings {
        map_size: truth.maps.diffuse.width(),
        grid: count("grid", standard.grid),
        max_bounces: truth.max_bounces,
        coarse_rounds: count("coarse_rounds", standard.coarse_rounds),
        fine_rounds: count("fine_rounds", standard.fine_rounds),
        blocks: count("blocks", standard.blocks),
        observations: count("observations", standard.observations),
        narrow_hats: count("narrow_hats", standard.narrow_hats),
        light_variation: number("light_variation", standard.light_variation),
        independence: number("independence", standard.independence),
        gauge_slack: number("gauge_slack", standard.gauge_slack),
        fixed_light: value("light").is_some(),
        check_choices: value("choices").is_some(),
        apply_choices: value("choices").is_some_and(|value| value == "apply"),
        seed: count("seed", 1) as u64,
        ..standard
    };
    let began = Instant::now();
    let known = value("light").is_some().then_some(&truth.environment);
    let mut solver = Solver::new(&scene, &surface, settings, known)?;
    println!(
        "cache {:.1} s: {} points, {:.1} M rays, {:.0} MiB",
        began.elapsed().as_secs_f64(),
        solver.scene.transport.grid.points.len(),
        solver.scene.transport.visibility.rays as f64 * 1e-6,
        solver.scene.memory_bytes() as f64 / f64::from(1 << 20)
    );
    let stop = AtomicBool::new(false);
    solver.run(&stop, &mut |step, report, estimate| {
        let light = environment_errors(&estimate.environment(settings.light_size), &truth.environment);
        let light = light.map_or(f64::NAN, |light| light.relative_l2.aligned);
        println!(
            "{:>7.1} s ({:.1} s of processors)  {step:?}: median residual {:.5}, RMSE {:.5}, {} blocks, {} light unknowns, light {light:.3}",
            began.elapsed().as_secs_f64(),
            processor_seconds(),
            report.residual,
            report.squared_error.sqrt(),
            report.blocks,
            report.light_unknowns
        );
        if let Some(choices) = &report.choices {
            println!("{choices}");
        }
    });
    // Maps again, with the kinds of surface that the first ones have shown.
    for _ in 1..count("maps_steps", 1) {
        solver.scene.step(SolverStep::Maps, &mut solver.estimate, &stop);
        println!("{:>7.1} s ({:.1} s of processors)  Maps", began.elapsed().as_secs_f64(), processor_seconds());
    }
    let (maps, light) = (solver.maps(), solver.environment());
    if let Some(folder) = value("maps") {
        let folder = std::path::Path::new(&folder);
        std::fs::create_dir_all(folder).map_err(|error| Error::writing(folder, error))?;
        patina::image::file::write_exr_rgb(&folder.join("diffuse.exr"), &maps.diffuse)?;
        patina::image::file::write_exr_rgb(&folder.join("specular.exr"), &maps.specular)?;
        patina::image::file::write_exr_grey(&folder.join("roughness.exr"), &maps.roughness)?;
    }
    let errors = map_errors(&maps, &truth.maps, &truth.texels_seen)?;
    let lights = environment_errors(&light, &truth.environment)?;
    println!(
        "diffuse raw {:.4} aligned {:.4} scale {:.3?}",
        errors.diffuse.raw, errors.diffuse.aligned, errors.diffuse.scale
    );
    println!("specular {:.4}  roughness {:.4}", errors.specular.raw, errors.roughness.raw);
    println!(
        "light relative {:.3} aligned {:.3} scale {:.3?}, log {:.3}, sun {:.1} degrees",
        lights.relative_l2.raw,
        lights.relative_l2.aligned,
        lights.relative_l2.scale,
        lights.log_rmse.aligned,
        lights.brightest_angle_degrees.unwrap_or(f64::NAN)
    );
    let of_light = (!settings.fixed_light).then_some(solver.estimate.light_known.scale_deviation);
    let Estimate { texels, variances, .. } = &solver.estimate;
    let deviations = Estimate::deviations(texels, variances, settings.map_size, of_light);
    if let Some(held) = interval_coverage(&maps, &deviations, &truth.maps, &truth.texels_seen, &errors) {
        println!(
            "90 % intervals hold the truth: diffuse (aligned) {:.3}, specular {:.3}, roughness {:.3}",
            held.diffuse, held.specular, held.roughness
        );
    }
    let scale = Vec3::from_array(errors.diffuse.scale.map(|value| value as f32));
    let samples = count("samples", 16);
    if samples > 0 {
        let views: Vec<usize> = (0..8).map(|k| k * scene.views.len() / 8).collect();
        let photos: Vec<(usize, RgbImage)> =
            views.iter().map(|&view| (view, scene.views[view].photo.to_linear())).collect();
        println!("image RMSE {:.4}", picture_error(&scene, &surface, &maps, &light, &photos, samples));
        if let Some(relight) = &truth.relight {
            let relit = |maps: &MaterialMaps| {
                picture_error(&scene, &surface, maps, &relight.environment, &relight.pictures, samples)
            };
            let aligned = MaterialMaps {
                diffuse: maps.diffuse.map(|&value| (value * scale).clamp(Vec3::ZERO, Vec3::ONE)),
                ..maps.clone()
            };
            println!("relit RMSE {:.4} aligned {:.4}", relit(&maps), relit(&aligned));
        }
    }
    if let Some(out) = value("out") {
        let folder = std::path::Path::new(&out);
        let write = |name: &str, image: &RgbImage| patina::image::file::write_exr_rgb(&folder.join(name), image);
        write("diffuse.exr", &maps.diffuse)?;
        write("specular.exr", &maps.specular)?;
        write("roughness.exr", &maps.roughness.map(|&value| Vec3::splat(value)))?;
        light.write(&folder.join("env.exr"))?;
    }
    Ok(())
}

/// Seconds that all processors have spent on this program, where the system tells (Linux); 0 elsewhere. On a machine
/// that others use too, this is what the clock would show, times the number of processors, if they did not.
fn processor_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let after_name = stat.rsplit(')').next().unwrap_or_default();
    let ticks: f64 = after_name.split_whitespace().skip(11).take(2).filter_map(|n| n.parse::<f64>().ok()).sum();
    ticks / 100.0
}

/// Root mean squared error over pictures, with the noise of our own taken out by two independent renders.
fn picture_error(
    scene: &Scene,
    surface: &Surface,
    maps: &MaterialMaps,
    light: &Environment,
    pictures: &[(usize, RgbImage)],
    samples: usize,
) -> f64 {
    let size = maps.diffuse.width();
    let weights = PyramidWeights::flat(size, size);
    let parameters = Parameters::new(TexelPyramid::from_base(texels_from_maps(maps), &weights), light);
    let max_bounces = scene.truth.as_ref().map_or(3, |truth| truth.max_bounces);
    let (mut sum, mut count) = (0.0, 0.0);
    for (view, picture) in pictures {
        let [first, second]: [Image<Vec3>; 2] = [11, 12].map(|seed| {
            let background_visible = scene.background == Background::Environment;
            let settings =
                PictureSettings { samples, max_bounces, background_visible, seed, ..PictureSettings::default() };
            let stop = AtomicBool::new(false);
            render(surface, &scene.views[*view].camera, &parameters, *view as u32, &settings, &stop).radiance
        });
        for ((a, b), truth) in first.pixels().iter().zip(second.pixels()).zip(picture.pixels()) {
            sum += f64::from((*a - *truth).dot(*b - *truth)) / 3.0;
            count += 1.0;
        }
    }
    (sum / count).max(0.0).sqrt()
}
