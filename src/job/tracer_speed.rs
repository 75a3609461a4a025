//! What rays, paths and gradients cost: `patina bench tracer`.
//!
//! Rays are those of a fit: through pixels, from the points they meet into a cosine-weighted direction, and from there
//! towards the light, where only whether something is in the way is asked. Paths have the length and the lobes of the
//! truth. A gradient is that of a squared error by all maps and the light. Mitsuba, where it is, times the same on the
//! same scene (`tests/mitsuba/time_exchange.py`): rays of the same kinds, `path` and `prb`.

use super::pictures::parameters;
use crate::error::{Error, ErrorKind, Result};
use crate::fit::FitSettings;
use crate::insight::study::StudyTable;
use crate::light::{Environment, EnvironmentSampler};
use crate::material::MaterialMaps;
use crate::math::frame::{Frame, sample_cosine_hemisphere};
use crate::math::random::{SampleStream, StreamKey};
use crate::render::accumulate::{PassKey, PixelDerivative, PixelEstimate, PixelLoss, accumulate};
use crate::render::first_hits::{CameraRays, PixelFilter};
use crate::render::path::{PathSettings, PathTracer};
use crate::render::picture::{PictureSettings, render};
use crate::render::{Parameters, Surface};
use crate::scene::{Background, Scene};
use crate::trace::Ray;
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// Columns of the table.
const COLUMNS: [(&str, &str); 6] = [
    ("camera rays", "M/s"),
    ("bounce rays", "M/s"),
    ("shadow rays", "M/s"),
    ("path samples", "M/s"),
    ("gradient samples", "M/s"),
    ("gradient over picture", "times"),
];

/// What is timed.
#[derive(Clone, Debug)]
pub struct TracerOptions {
    /// Exchange folders, or any scene; those without truth are timed with a grey surface under a grey light.
    pub scenes: Vec<PathBuf>,
    /// Triangle counts of bumpy spheres in code, timed as well.
    pub triangles: Vec<usize>,
    /// Views that are timed, at most.
    pub most_views: usize,
    /// Paths a pixel.
    pub samples: usize,
    /// Repetitions; each is a value of its own.
    pub repetitions: usize,
    /// Threads of Mitsuba; all processors when not given. This program's pool is set before.
    pub threads: Option<usize>,
    /// The Python that has Mitsuba; none when it is not to be asked.
    pub python: Option<PathBuf>,
    /// The folder of `time_exchange.py`.
    pub scripts: PathBuf,
}

/// Times every scene; `tell` hears of each.
///
/// # Errors
/// A scene that cannot be read. Where Python or Mitsuba is absent, a note of the table says so.
pub fn run(options: &TracerOptions, tell: &dyn Fn(&str)) -> Result<StudyTable> {
    let threads = rayon::current_num_threads();
    let mut table =
        StudyTable::new(&format!("Rays, paths and gradients a second, {threads} threads"), "scene", &COLUMNS);
    for path in &options.scenes {
        tell(&format!("timing {}", path.display()));
        let scene = crate::scene::read(path, &Default::default())?;
        let name = scene.name.clone();
        time(&scene, &format!("{name}, patina"), options, &mut table)?;
        if let Some(python) = &options.python {
            match mitsuba(python, path, options) {
                Ok(rows) => rows.iter().for_each(|row| table.add(&format!("{name}, mitsuba"), row)),
                Err(why) => table.notes.push(format!("{name}: Mitsuba was left out: {why}.")),
            }
        }
    }
    for &triangles in &options.triangles {
        tell(&format!("timing a sphere of {triangles} triangles"));
        let case = super::scale::ScaleCase { triangles, views: options.most_views.max(1), map_size: 256 };
        let mut scene = super::scale::scene(case);
        if scene.mesh.uvs.is_empty() {
            // One grey texel serves all: only cost is looked at.
            scene.mesh.uvs = vec![Vec2::splat(0.5); scene.mesh.positions.len()];
        }
        time(&scene, &format!("sphere of {triangles}, patina"), options, &mut table)?;
    }
    table.notes.push(format!(
        "Rays of up to {} views with one ray a pixel; paths and gradients with {} samples a pixel. A gradient counts its \
         own picture.",
        options.most_views, options.samples
    ));
    Ok(table)
}

/// Adds one value a repetition to a row.
fn time(scene: &Scene, row: &str, options: &TracerOptions, table: &mut StudyTable) -> Result<()> {
    let surface = Surface::new(scene.mesh.clone())?;
    let views: Vec<usize> = (0..scene.views.len().min(options.most_views.max(1))).collect();
    if views.is_empty() {
        return Err(Error::new(ErrorKind::InvalidScene, "the scene has no view to time"));
    }
    let (lit, bounces) = match &scene.truth {
        Some(truth) => (parameters(&truth.maps, &truth.environment), truth.max_bounces),
        None => (grey(), FitSettings::default().bounces),
    };
    let (camera, bounce, shadow) = rays(scene, &surface, &views);
    let rate = |count: usize, work: &dyn Fn() -> usize| {
        let began = Instant::now();
        std::hint::black_box(work());
        count as f64 / began.elapsed().as_secs_f64() / 1e6
    };
    for _ in 0..options.repetitions.max(1) {
        let closest = |rays: &[Ray]| rays.par_iter().filter(|ray| surface.closest(ray).is_some()).count();
        let mut values = vec![
            rate(camera.len(), &|| closest(&camera)),
            rate(bounce.len(), &|| closest(&bounce)),
            rate(shadow.len(), &|| shadow.par_iter().filter(|ray| surface.bvh().is_occluded(ray)).count()),
        ];
        let pixels: usize =
            views.iter().map(|&view| scene.views[view].camera.width * scene.views[view].camera.height).sum();
        let samples = pixels * options.samples;
        values.push(rate(samples, &|| pictures(scene, &surface, &lit, &views, bounces, options.samples)));
        values.push(rate(samples, &|| gradients(scene, &surface, &lit, &views, bounces, options.samples)));
        values.push(values[3] / values[4]);
        table.add(row, &values);
    }
    Ok(())
}

/// A grey surface under a grey light, one texel each way.
fn grey() -> Parameters<f32> {
    let map = |value: f32| crate::image::Image::filled(1, 1, Vec3::splat(value));
    let roughness = crate::image::Image::filled(1, 1, 0.3);
    parameters(
        &MaterialMaps { diffuse: map(0.5), specular: map(0.04), roughness },
        &Environment::constant(64, 32, Vec3::ONE),
    )
}

/// Rays through the middle of pixels, bounces from where they meet a front, and rays from there into even directions.
fn rays(scene: &Scene, surface: &Surface, views: &[usize]) -> (Vec<Ray>, Vec<Ray>, Vec<Ray>) {
    let (mut camera_rays, mut bounce, mut shadow) = (Vec::new(), Vec::new(), Vec::new());
    for &view in views {
        let camera = &scene.views[view].camera;
        for pixel in 0..camera.width * camera.height {
            let place = Vec2::new((pixel % camera.width) as f32 + 0.5, (pixel / camera.width) as f32 + 0.5);
            let ray = camera.ray_through(place);
            camera_rays.push(ray);
            let Some(hit) = surface.closest(&ray) else { continue };
            let point = surface.point(&hit);
            let normal = point.geometric_normal;
            if normal.dot(ray.direction) >= 0.0 {
                continue;
            }
            let mut stream = SampleStream::new(StreamKey::new(1, 0, view as u32, pixel as u32), 0);
            let [a, b] = stream.next_pair();
            let frame = Frame::around(normal);
            bounce.push(surface.ray_from(&point, frame.outer_from_local(sample_cosine_hemisphere([a, b]))));
            let [a, b] = stream.next_pair();
            shadow.push(surface.ray_from(&point, frame.outer_from_local(sample_cosine_hemisphere([a, b]))));
        }
    }
    (camera_rays, bounce, shadow)
}

fn pictures(
    scene: &Scene,
    surface: &Surface,
    lit: &Parameters<f32>,
    views: &[usize],
    bounces: usize,
    samples: usize,
) -> usize {
    let settings = PictureSettings {
        samples,
        max_bounces: bounces,
        background_visible: scene.background == Background::Environment,
        ..Default::default()
    };
    let stop = AtomicBool::new(false);
    let picture = |&view: &usize| render(surface, &scene.views[view].camera, lit, view as u32, &settings, &stop);
    views.iter().map(picture).map(|picture| picture.radiance.pixels().len()).sum()
}

/// The squared error against a grey photo.
struct AgainstGrey;

impl PixelLoss<f32> for AgainstGrey {
    fn at(&self, _: usize, estimate: &PixelEstimate<f32>) -> Option<PixelDerivative<f32>> {
        let difference = |value: [f32; 3]| value.map(|value| value - 0.25);
        let (a, b) = (difference(estimate.first), difference(estimate.second));
        Some(PixelDerivative { loss: (0..3).map(|c| a[c] * b[c]).sum(), d_first: b, d_second: a })
    }
}

fn gradients(
    scene: &Scene,
    surface: &Surface,
    lit: &Parameters<f32>,
    views: &[usize],
    bounces: usize,
    samples: usize,
) -> usize {
    let sampler = EnvironmentSampler::new(&lit.environment());
    let mut gradient = lit.convert(|_| 0.0f32);
    let stop = AtomicBool::new(false);
    let mut done = 0;
    for &view in views {
        let camera = &scene.views[view].camera;
        let tracer = PathTracer {
            surface,
            proposal: &lit.texels,
            light: &sampler,
            environment_size: lit.environment_size,
            settings: PathSettings {
                max_bounces: bounces,
                lobe_strength: 1.0,
                background_visible: scene.background == Background::Environment,
                two_sided: false,
                camera_cone_radians: 0.0,
                bounce_cone_radians: 0.0,
            },
        };
        let rays = CameraRays::fresh(surface, camera, PixelFilter::Box, samples);
        let pixels: Vec<u32> = (0..(camera.width * camera.height) as u32).collect();
        let key = PassKey { seed: 1, step: 0, view: view as u32 };
        done += accumulate(&tracer, &rays, &pixels, key, lit, &AgainstGrey, &mut gradient, &stop).pixels as usize;
    }
    done
}

/// Rows of Mitsuba, one a repetition; or why there are none.
fn mitsuba(python: &Path, scene: &Path, options: &TracerOptions) -> std::result::Result<Vec<Vec<f64>>, String> {
    let script = options.scripts.join("time_exchange.py");
    if !script.is_file() {
        return Err(format!("there is no {}", script.display()));
    }
    let mut command = Command::new(python);
    command.arg(&script).arg(scene).args(["--spp", &options.samples.to_string()]);
    command.args(["--most-views", &options.most_views.to_string(), "--repetitions", &options.repetitions.to_string()]);
    if let Some(threads) = options.threads {
        command.args(["--threads", &threads.to_string()]);
    }
    let output = command.output().map_err(|error| format!("{} cannot be started ({error})", python.display()))?;
    if !output.status.success() {
        let text = String::from_utf8_lossy(&output.stderr);
        let last = text.lines().rev().find(|line| !line.trim().is_empty()).unwrap_or("no message");
        return Err(format!("the script ended with {} ({})", output.status, last.trim()));
    }
    let text = String::from_utf8_lossy(&output.stdout);
    let rows: Vec<Vec<f64>> = text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect();
    if rows.is_empty() { Err("the script said nothing".into()) } else { Ok(rows) }
}
