//! Error of cached transport against the path tracer, over its settings.
//!
//! The squared error is the product of the differences to two independent pictures of the path tracer, so that their
//! noise does not count. Prints the error relative to the root mean square of the picture, and what the cache took.

use crate::error::Result;
use crate::image::{Image, RgbImage, file};
use crate::lab::scenes::hard::{self, HardCase, HardSettings};
use crate::material::texels::{PyramidWeights, TexelPyramid, texels_from_maps};
use crate::render::cached::{CachedSettings, CachedTransport, FootprintSettings, ViewFootprints};
use crate::render::picture::{PictureSettings, render};
use crate::render::{Parameters, Surface};
use crate::scene::{ReadSettings, demo, read};
use clap::{Args, ValueEnum};
use glam::Vec3;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// Options of `patina-lab bench cache`.
#[derive(Clone, Debug, Args)]
pub struct CacheArguments {
    /// An exchange folder with its truth, `demo`, or the name of a hard case.
    #[arg(default_value = "demo")]
    pub scene: String,
    /// Paths a pixel of each reference.
    #[arg(long, default_value_t = 128)]
    pub samples: usize,
    /// Texels a side of the grid of points.
    #[arg(long, value_delimiter = ',', default_values_t = [128, 256])]
    pub grids: Vec<usize>,
    /// Root of the number of places of a pixel that are looked at first.
    #[arg(long, default_value_t = FootprintSettings::default().coarse_side)]
    pub coarse_side: usize,
    /// Folder for the pictures: the cache's, the path tracer's, the difference and its square.
    #[arg(long)]
    pub pictures: Option<PathBuf>,
}

/// Prints the table.
///
/// # Errors
/// A scene that cannot be read, pictures that cannot be written.
pub fn run(options: &CacheArguments) -> Result<()> {
    let CacheArguments { scene: source, samples, grids, coarse_side, pictures } = options;
    let (samples, coarse_side) = (*samples, *coarse_side);
    let scene = if source == "demo" {
        demo::build(&demo::DemoSettings::default())?.scene
    } else if let Ok(case) = HardCase::from_str(source, true) {
        hard::build(case, &HardSettings::default())?.scene
    } else {
        read(source.as_str().as_ref(), &ReadSettings { hold_out_every: 0, ..ReadSettings::default() })?
    };
    let Some(truth) = &scene.truth else { return Ok(()) };
    let surface = Surface::new(scene.mesh.clone())?;
    let map_size = truth.maps.diffuse.width();
    let weights = PyramidWeights::flat(map_size, map_size);
    let parameters =
        Parameters::new(TexelPyramid::from_base(texels_from_maps(&truth.maps), &weights), &truth.environment);
    let views: Vec<usize> = [0, scene.views.len() / 3, scene.views.len() / 2].into_iter().collect();
    let stop = AtomicBool::new(false);
    for max_bounces in [1, truth.max_bounces.max(3)] {
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
            for &grid in grids {
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
                let (mut of_kind, mut counts) = ([0.0f64; 3], [0usize; 3]);
                let (mut hits, mut shading, mut shaded) = (0.0, 0.0, 0usize);
                for (&view, [first, second]) in views.iter().zip(&references) {
                    let began = Instant::now();
                    let footprints = ViewFootprints::trace(
                        &surface,
                        &transport.grid,
                        &scene.views[view].camera,
                        &FootprintSettings { map_size, coarse_side, ..FootprintSettings::default() },
                    );
                    hits += began.elapsed().as_secs_f64();
                    let began = Instant::now();
                    let picture = transport.picture(&footprints, texels, &light, &at);
                    shading += began.elapsed().as_secs_f64();
                    shaded += footprints.points.len();
                    if let Some(folder) = pictures {
                        write_pictures(
                            &folder.join(format!("view{view}")),
                            max_bounces,
                            lobe_strength,
                            grid,
                            &picture,
                            [first, second],
                        )?;
                    }
                    let mut pieces = vec![0usize; picture.len()];
                    for point in &footprints.points {
                        pieces[point.pixel as usize] += 1;
                    }
                    for (pixel, ((own, first), second)) in
                        picture.iter().zip(first.pixels()).zip(second.pixels()).enumerate()
                    {
                        let kind = match (footprints.escaped[pixel] > 0.0, pieces[pixel]) {
                            (true, _) => 0,
                            (_, 0 | 1) => 1,
                            _ => 2,
                        };
                        counts[kind] += 1;
                        for channel in 0..3 {
                            let own = f64::from(own[channel]);
                            let (a, b) = (f64::from(first[channel]), f64::from(second[channel]));
                            squared += (own - a) * (own - b);
                            of_kind[kind] += (own - a) * (own - b);
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
                let [rim, inside, edges] = of_kind.map(|sum| (sum / power).max(0.0).sqrt());
                println!(
                    "    of it rims {rim:.4} ({}), inside {inside:.4} ({}), edges {edges:.4} ({})",
                    counts[0], counts[1], counts[2]
                );
            }
        }
    }
    Ok(())
}

fn write_pictures(
    folder: &Path,
    max_bounces: usize,
    lobe_strength: f32,
    grid: usize,
    own: &[[f32; 3]],
    [first, second]: [&RgbImage; 2],
) -> Result<()> {
    std::fs::create_dir_all(folder).map_err(|error| crate::error::Error::writing(folder, error))?;
    let mean = |texel: usize| 0.5 * (first.pixels()[texel] + second.pixels()[texel]);
    let width = first.width();
    let picture =
        |of: &dyn Fn(usize) -> Vec3| Image::from_fn(width, first.height(), |row, column| of(row * width + column));
    let name = |what: &str| folder.join(format!("hits{max_bounces}_lobe{lobe_strength}_grid{grid}_{what}.exr"));
    file::write_exr_rgb(&name("cache"), &picture(&|texel| Vec3::from_array(own[texel])))?;
    file::write_exr_rgb(&name("paths"), &picture(&mean))?;
    let own = |texel: usize| Vec3::from_array(own[texel]);
    file::write_exr_rgb(&name("difference"), &picture(&|texel| own(texel) - mean(texel)))?;
    // Without noise, of either sign where there is nothing else.
    let squared = |texel: usize| (own(texel) - first.pixels()[texel]) * (own(texel) - second.pixels()[texel]);
    file::write_exr_rgb(&name("squared_difference"), &picture(&squared))
}
