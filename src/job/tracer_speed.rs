//! What rays, paths and gradients cost: `patina bench tracer`.
//!
//! Rays are those of a fit: through pixels, from the points they meet into a cosine-weighted direction, and from there
//! towards the light, where only whether something is in the way is asked. Paths have the length and the lobes of the
//! truth. Paths are also compared by what they are for: noise is the standard deviation of a pixel relative to the
//! pictures' mean, found from two pictures of different seeds, and variance times time says how long a megapixel takes to
//! a noise of one percent, if variance falls with the number of paths (it falls faster where samples are stratified).
//! A gradient is that of a squared error by all maps and the light. Mitsuba, where it is, times the same on the
//! same scene (`tests/mitsuba/time_exchange.py`): rays of the same kinds, `path` by two of its samplers, and `prb`.

use super::pictures::parameters;
use crate::error::{Error, ErrorKind, Result};
use crate::fit::FitSettings;
use crate::image::{Image, RgbImage};
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
use crate::scene::{Background, Scene, Truth};
use crate::trace::Ray;
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// Columns of the table.
const COLUMNS: [(&str, &str); 8] = [
    ("camera rays", "M/s"),
    ("bounce rays", "M/s"),
    ("shadow rays", "M/s"),
    ("path samples", "M/s"),
    ("noise", "%"),
    ("to 1 % noise", "s a megapixel"),
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
    /// Where spheres in code are written for Mitsuba, each in a folder of its own.
    pub output: PathBuf,
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
        time_mitsuba(path, &name, options, &mut table);
    }
    for &triangles in &options.triangles {
        let name = format!("sphere of {triangles}");
        tell(&format!("timing a {name} triangles"));
        let scene = grey_sphere(triangles, options.most_views.max(1));
        time(&scene, &format!("{name}, patina"), options, &mut table)?;
        if let (Some(truth), Some(_)) = (&scene.truth, &options.python) {
            let folder = options.output.join(format!("sphere-{triangles}"));
            crate::export::exchange::write(&scene, truth, &Default::default(), &folder)?;
            time_mitsuba(&folder, &name, options, &mut table);
        }
    }
    table.notes.push(format!(
        "Rays of up to {} views with one ray a pixel; paths and gradients with {} samples a pixel. A gradient counts its \
         own picture.",
        options.most_views, options.samples
    ));
    Ok(table)
}

/// Adds Mitsuba's rows, or a note of why there are none.
fn time_mitsuba(folder: &Path, name: &str, options: &TracerOptions, table: &mut StudyTable) {
    let Some(python) = &options.python else { return };
    match mitsuba(python, folder, options) {
        Ok(repetitions) => {
            for (sampler, values) in repetitions.iter().flatten() {
                let values: Vec<f64> = values.iter().map(|value| value.unwrap_or(f64::NAN)).collect();
                table.add(&format!("{name}, mitsuba, {sampler}"), &values);
            }
        }
        Err(why) => table.notes.push(format!("{name}: Mitsuba was left out: {why}.")),
    }
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
        None => {
            let (maps, light) = grey();
            (parameters(&maps, &light), FitSettings::default().bounces)
        }
    };
    let (camera, bounce, shadow) = rays(scene, &surface, &views);
    let pixels: usize =
        views.iter().map(|&view| scene.views[view].camera.width * scene.views[view].camera.height).sum();
    let samples = pixels * options.samples;
    let closest = |rays: &[Ray]| rays.par_iter().filter(|ray| surface.closest(ray).is_some()).count();
    let render = |seed| pictures(scene, &surface, &lit, &views, bounces, options.samples, seed);
    // What came before the first repetition is not timed: memory is touched for the first time.
    let mut before = render(0);
    for repetition in 1..=options.repetitions.max(1) {
        let mut values = vec![
            timed_rate(camera.len(), || closest(&camera)).0,
            timed_rate(bounce.len(), || closest(&bounce)).0,
            timed_rate(shadow.len(), || shadow.par_iter().filter(|ray| surface.bvh().is_occluded(ray)).count()).0,
        ];
        let (path_rate, made) = timed_rate(samples, || render(repetition as u64));
        let deviation = relative_deviation(&made, &before);
        before = made;
        values.extend([path_rate, 100.0 * deviation, options.samples as f64 / path_rate * (deviation / 0.01).powi(2)]);
        let gradient_rate =
            timed_rate(samples, || gradients(scene, &surface, &lit, &views, bounces, options.samples)).0;
        values.extend([gradient_rate, path_rate / gradient_rate]);
        table.add(row, &values);
    }
    Ok(())
}

/// Millions a second of `count` things that `work` does, and what it made.
fn timed_rate<T>(count: usize, work: impl FnOnce() -> T) -> (f64, T) {
    let began = Instant::now();
    let made = std::hint::black_box(work());
    (count as f64 / began.elapsed().as_secs_f64() / 1e6, made)
}

/// Standard deviation of a pixel's channel relative to the mean, from two independent sets of the same pictures.
fn relative_deviation(one: &[RgbImage], other: &[RgbImage]) -> f64 {
    let pairs = || one.iter().zip(other).flat_map(|(one, other)| one.pixels().iter().zip(other.pixels()));
    let squares: f64 = pairs().map(|(a, b)| f64::from((*a - *b).length_squared())).sum();
    let sum: f64 = pairs().map(|(a, b)| f64::from((*a + *b).element_sum())).sum();
    let channels = 3.0 * pairs().count().max(1) as f64;
    (0.5 * squares / channels).sqrt() / (0.5 * sum / channels)
}

/// A grey surface under a grey light.
fn grey() -> (MaterialMaps, Environment) {
    let map = |value: f32| Image::filled(4, 4, Vec3::splat(value));
    let maps = MaterialMaps { diffuse: map(0.5), specular: map(0.04), roughness: Image::filled(4, 4, 0.3) };
    (maps, Environment::constant(64, 32, Vec3::ONE))
}

/// A bumpy sphere of the bench of growth, grey under grey light: only cost is looked at.
fn grey_sphere(triangles: usize, views: usize) -> Scene {
    let mut scene = super::scale::scene(super::scale::ScaleCase { triangles, views, map_size: 4 });
    // One texel serves all.
    scene.mesh.uvs = vec![Vec2::splat(0.5); scene.mesh.positions.len()];
    let (maps, environment) = grey();
    scene.truth = Some(Truth {
        maps,
        texels_seen: Image::filled(4, 4, true),
        environment,
        relight: None,
        max_bounces: FitSettings::default().bounces,
    });
    scene
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
    seed: u64,
) -> Vec<RgbImage> {
    let settings = PictureSettings {
        samples,
        max_bounces: bounces,
        seed,
        background_visible: scene.background == Background::Environment,
        ..Default::default()
    };
    let stop = AtomicBool::new(false);
    let picture = |&view: &usize| render(surface, &scene.views[view].camera, lit, view as u32, &settings, &stop);
    views.iter().map(picture).map(|picture| picture.radiance).collect()
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
        let key = PassKey::halves(1, 0, view as u32);
        done += accumulate(&tracer, &rays, &pixels, key, lit, &AgainstGrey, &mut gradient, &stop).pixels as usize;
    }
    done
}

/// One repetition of Mitsuba: for each of its samplers a value a column, where it has one.
type MitsubaRows = BTreeMap<String, Vec<Option<f64>>>;

/// What Mitsuba said, one repetition after the other; or why it said nothing.
fn mitsuba(python: &Path, scene: &Path, options: &TracerOptions) -> std::result::Result<Vec<MitsubaRows>, String> {
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
    let rows: Vec<MitsubaRows> = text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect();
    if rows.is_empty() { Err("the script said nothing".into()) } else { Ok(rows) }
}
