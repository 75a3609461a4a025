//! Error of cached transport against the path tracer, over its settings.
//!
//! `cargo run --release --no-default-features --example cached_error -- [FOLDER|demo] [samples] [grids]`
//!
//! The squared error is the product of the differences to two independent pictures of the path tracer, so that their
//! noise does not count. Prints the error relative to the root mean square of the picture, and what the cache took.

use patina::Result;
use patina::material::texels::{PyramidWeights, TexelPyramid, texels_from_maps};
use patina::render::cached::{CachedSettings, CachedTransport, FootprintSettings, ViewFootprints};
use patina::render::picture::{PictureSettings, render};
use patina::render::{Parameters, Surface};
use patina::scene::{ReadSettings, demo, read};
use std::sync::atomic::AtomicBool;
use std::time::Instant;

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let source = arguments.first().map_or("demo", String::as_str);
    let samples: usize = arguments.get(1).and_then(|value| value.parse().ok()).unwrap_or(128);
    let grids: Vec<usize> =
        arguments.get(2).map_or("128,256", String::as_str).split(',').filter_map(|value| value.parse().ok()).collect();
    let scene = if source == "demo" {
        demo::build(&demo::DemoSettings::default())?.scene
    } else {
        read(source.as_ref(), &ReadSettings { hold_out_every: 0, ..ReadSettings::default() })?
    };
    let Some(truth) = &scene.truth else { return Ok(()) };
    let surface = Surface::new(scene.mesh.clone())?;
    let map_size = truth.maps.diffuse.width();
    let weights = PyramidWeights::flat(map_size, map_size);
    let parameters =
        Parameters::new(TexelPyramid::from_base(texels_from_maps(&truth.maps), &weights), &truth.environment);
    let views: Vec<usize> = [0, scene.views.len() / 3, scene.views.len() / 2].into_iter().collect();
    let stop = AtomicBool::new(false);
    for max_bounces in [1, 3] {
        for lobe_strength in [0.0, 1.0] {
            let references: Vec<_> = views
                .iter()
                .map(|&view| {
                    [7, 8].map(|seed| {
                        let settings = PictureSettings {
                            samples,
                            max_bounces,
                            lobe_strength,
                            background_visible: false,
                            seed,
                            ..PictureSettings::default()
                        };
                        let camera = &scene.views[view].camera;
                        render(&surface, camera, &parameters, view as u32, &settings, &stop).radiance
                    })
                })
                .collect();
            for &grid in &grids {
                let began = Instant::now();
                let settings =
                    CachedSettings { grid, max_bounces, lobe_strength, bounce_rays: 64, ..CachedSettings::default() };
                let Some(transport) = CachedTransport::build(&surface, settings, parameters.environment_size, &stop)
                else {
                    return Ok(());
                };
                let built = began.elapsed().as_secs_f64();
                let light = transport.basis.planes(&parameters.light);
                let texels = &parameters.texels.levels[0].texels;
                let reflectance = transport.reflectance_of_points(texels, map_size);
                let began = Instant::now();
                let at = transport.point_light(&light, &reflectance);
                let lit = began.elapsed().as_secs_f64();
                let (mut squared, mut power, mut bias, mut mean) = (0.0f64, 0.0f64, 0.0f64, 0.0f64);
                let (mut hits, mut shading, mut shaded) = (0.0, 0.0, 0usize);
                for (&view, [first, second]) in views.iter().zip(&references) {
                    let began = Instant::now();
                    let footprints = ViewFootprints::trace(
                        &surface,
                        &transport.grid,
                        &scene.views[view].camera,
                        view as u32,
                        &FootprintSettings { map_size, lobe_rays: max_bounces > 1, ..FootprintSettings::default() },
                    );
                    hits += began.elapsed().as_secs_f64();
                    let began = Instant::now();
                    let picture = transport.picture(&footprints, texels, &light, &at);
                    shading += began.elapsed().as_secs_f64();
                    shaded += footprints.points.len();
                    for ((own, first), second) in picture.iter().zip(first.pixels()).zip(second.pixels()) {
                        for channel in 0..3 {
                            let own = f64::from(own[channel]);
                            let (a, b) = (f64::from(first[channel]), f64::from(second[channel]));
                            squared += (own - a) * (own - b);
                            power += a * b;
                            bias += own - 0.5 * (a + b);
                            mean += 0.5 * (a + b);
                        }
                    }
                }
                println!(
                    "hits {max_bounces} lobe {lobe_strength} grid {grid}: relative RMSE {:.4}, bias {:+.4}; {} points, \
                     {:.1} M rays, cache {built:.1} s, light {lit:.2} s, first hits {hits:.1} s, {shaded} points shaded \
                     in {shading:.2} s",
                    (squared / power).max(0.0).sqrt(),
                    bias / mean,
                    transport.grid.points.len(),
                    transport.visibility.rays as f64 * 1e-6,
                );
            }
        }
    }
    Ok(())
}
