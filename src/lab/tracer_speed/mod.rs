//! What rays, paths and gradients cost: `patina bench tracer`.
//!
//! Rays are those of a fit: through pixels, from the points they meet into a cosine-weighted direction, and from there
//! towards the light, where only whether something is in the way is asked. Paths have the length and the lobes of the
//! truth. Paths are also compared by what they are for: noise is the standard deviation of a pixel relative to the
//! pictures' mean, found from two pictures of different seeds, and variance times time says how long a megapixel takes to
//! a noise of one percent, if variance falls with the number of paths (it falls faster where samples are stratified).
//! A gradient is that of a squared error by all maps and the light. Mitsuba, where it is, times the same on the
//! same scene (`tests/mitsuba/time_exchange.py`): rays of the same kinds, `path` by two of its samplers, and `prb`.
//! Its rays go through Embree in packets; Embree itself, where `tests/embree/time_rays.c` was compiled, is asked for the
//! very same rays one by one, as this program asks for its own.
//!
//! `rays` holds the rays, `paths` pictures and gradients, `rivals` the other programs.

mod paths;
mod rays;
mod rivals;

use self::paths::{Workload, relative_deviation};
use self::rays::RaySets;
use crate::error::{Error, ErrorKind, Place, Result};
use crate::fit::FitSettings;
use crate::image::Image;
use crate::job::pictures::{parameters, parameters_of_truth};
use crate::lab::study_table::StudyTable;
use crate::light::Environment;
use crate::material::{LobeModel, MaterialMaps};
use crate::render::Surface;
use crate::scene::{Scene, Truth};
use glam::{Vec2, Vec3};
use std::path::{Path, PathBuf};
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
    /// `tests/embree/time_rays.c`, compiled; none when Embree is not to be asked.
    pub embree: Option<PathBuf>,
    /// Where spheres in code are written for Mitsuba, each in a folder of its own, and rays for Embree.
    pub output: PathBuf,
}

/// Times every scene, and writes the table anew after each; `tell` hears of each.
///
/// # Errors
/// A scene that cannot be read, rays that cannot be written. Where Python, Mitsuba or Embree is absent, a note of the
/// table says so.
pub fn run(options: &TracerOptions, tell: &dyn Fn(&str)) -> Result<StudyTable> {
    let threads = rayon::current_num_threads();
    let mut table =
        StudyTable::new(&format!("Rays, paths and gradients a second, {threads} threads"), "scene", &COLUMNS)
            .with_caption("Median over repetitions, in brackets the quartiles.");
    for path in &options.scenes {
        tell(&format!("timing {}", path.display()));
        let scene = crate::scene::read(path, &Default::default())?;
        let name = scene.name.clone();
        time(&scene, &name, options, &mut table)?;
        time_mitsuba(path, &name, options, &mut table);
        table.write(&options.output, "tracer")?;
    }
    for &triangles in &options.triangles {
        if triangles == 0 {
            return Err(Error::new(ErrorKind::InvalidSetting, "must be at least 1")
                .at(Place::Setting("triangles".into()))
                .remedy("give numbers of triangles above 0"));
        }
        let name = format!("sphere of {triangles}");
        tell(&format!("timing a {name} triangles"));
        let scene = grey_sphere(triangles, options.most_views.max(1));
        time(&scene, &name, options, &mut table)?;
        if let (Some(truth), Some(_)) = (&scene.truth, &options.python) {
            let folder = options.output.join(format!("sphere-{triangles}"));
            crate::export::exchange::write(&scene, truth, &Default::default(), &folder)?;
            time_mitsuba(&folder, &name, options, &mut table);
        }
        table.write(&options.output, "tracer")?;
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
    match rivals::mitsuba(python, folder, options) {
        Ok(repetitions) => {
            for (sampler, values) in repetitions.iter().flatten() {
                table.add_some(&format!("{name}, mitsuba, {sampler}"), values);
            }
        }
        Err(why) => table.notes.push(format!("{name}: Mitsuba was left out: {why}.")),
    }
}

/// Times this program, one value a repetition, and Embree on the same rays.
fn time(scene: &Scene, name: &str, options: &TracerOptions, table: &mut StudyTable) -> Result<()> {
    let surface = Surface::new(scene.mesh.clone())?;
    let views: Vec<usize> = (0..scene.views.len().min(options.most_views.max(1))).collect();
    if views.is_empty() {
        return Err(Error::new(ErrorKind::InvalidScene, "the scene has no view to time"));
    }
    let (lit, bounces) = match &scene.truth {
        Some(truth) => (parameters_of_truth(truth), truth.max_bounces),
        None => {
            let (maps, light) = grey();
            (parameters(&maps, &light), FitSettings::default().bounces)
        }
    };
    let rays = RaySets::of(scene, &surface, &views);
    let work = Workload { scene, surface: &surface, lit: &lit, views: &views, bounces, samples: options.samples };
    // What came before the first repetition is not timed: memory is touched for the first time.
    let mut before = work.pictures(0);
    let mut met = [0; 3];
    for repetition in 1..=options.repetitions.max(1) {
        let mut values = Vec::with_capacity(COLUMNS.len());
        for (kind, count) in rays.counts().into_iter().enumerate() {
            let (rate, hits) = timed_rate(count, || rays.trace(kind, &surface));
            values.push(rate);
            met[kind] = hits;
        }
        let (path_rate, made) = timed_rate(work.paths(), || work.pictures(repetition as u64));
        let deviation = relative_deviation(&made, &before);
        before = made;
        values.extend([path_rate, 100.0 * deviation, options.samples as f64 / path_rate * (deviation / 0.01).powi(2)]);
        let gradient_rate = timed_rate(work.paths(), || work.gradients()).0;
        values.extend([gradient_rate, path_rate / gradient_rate]);
        table.add(&format!("{name}, patina"), &values);
    }
    let Some(program) = &options.embree else { return Ok(()) };
    let file = options.output.join("rays.bin");
    rays.write(scene, &file)?;
    match rivals::embree(program, &file, options) {
        Ok(rows) => {
            for row in &rows {
                table.add_some(&format!("{name}, {}", row.name), &row.rates.map(Some));
            }
            for row in rows.iter().filter(|row| row.met != met) {
                let (theirs, rival) = (row.met, &row.name);
                let note = format!("{name}: {theirs:?} rays met something by {rival}, {met:?} by patina.");
                // All repetitions meet the same.
                if !table.notes.contains(&note) {
                    table.notes.push(note);
                }
            }
        }
        Err(why) => table.notes.push(format!("{name}: Embree was left out: {why}.")),
    }
    std::fs::remove_file(&file).map_err(|source| Error::writing(&file, source))
}

/// Millions a second of `count` things that `work` does, and what it made.
fn timed_rate<T>(count: usize, work: impl FnOnce() -> T) -> (f64, T) {
    let began = Instant::now();
    let made = std::hint::black_box(work());
    (count as f64 / began.elapsed().as_secs_f64() / 1e6, made)
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
        lobe: LobeModel::BlinnPhong,
    });
    scene
}
