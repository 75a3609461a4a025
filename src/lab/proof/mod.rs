//! Do exports look elsewhere as they look here? Other programs open them by their own importers, render them from the cameras
//! of the run, and are compared with the path tracer: `patina-lab proof RUN --python PYTHON --node FOLDER`.
//!
//! [`lights`] are what the run is lit by; [`cases`] are its exports under them, with the pictures that others are held
//! against; [`programs`] starts Mitsuba, Blender and a browser on the scripts of `tests/proof`; [`figures`] are the numbers
//! between two pictures; [`table`] says which have a bar, and draws.
//!
//! The bars: the exact lobe in Mitsuba within noise; Mitsuba's own `diffuse` and `principled`, Cycles by GLB, by script and by USD within
//! 3 % of the mean where the lobe is GGX, which they have; a light of one bright texel nearer as it is than turned or
//! mirrored; no error by the checkers of glTF, USD and MaterialX. A run with lobes of Blinn-Phong is shown both as it is, with
//! figures and no bar, and with its maps taken for GGX. What the page for browsers shows, without shadows of lamps, has
//! no bar but that of the turned light.

pub mod cases;
pub mod figures;
pub mod lights;
pub mod programs;
pub mod table;

use crate::error::{Error, ErrorKind, Place, Result};
use crate::export::RunFolder;
use crate::files::write_bytes;
use crate::job::export::scene_of;
use crate::job::prepare::RunSettings;
use crate::material::LobeModel;
use crate::scene::Camera;
use cases::Case;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use table::{Judged, Table};

/// Surface hits on the longest path, here and there.
pub const BOUNCES: usize = 3;

/// What is proven, and with what.
#[derive(Clone, Debug, clap::Args)]
pub struct ProofOptions {
    /// The run folder; it is only read.
    pub run: PathBuf,
    /// The Python that has `mitsuba`, `bpy`, `usd-core` and `materialx`.
    #[arg(long, default_value = "python3")]
    pub python: PathBuf,
    /// Folder whose `node_modules` has `gltf-validator`.
    #[arg(long)]
    pub node: Option<PathBuf>,
    /// The browser that opens the page.
    #[arg(long, default_value = "chromium")]
    pub browser: PathBuf,
    /// The folder of the scripts.
    #[arg(long, default_value = "tests/proof")]
    pub scripts: PathBuf,
    /// Views, spread over those of the run.
    #[arg(long, default_value_t = 2)]
    pub views: usize,
    /// Pixels of a view, at most; larger ones are halved first.
    #[arg(long, default_value_t = 120_000)]
    pub pixels: usize,
    /// Samples a pixel, a multiple of 16.
    #[arg(long, default_value_t = 256)]
    pub samples: usize,
    /// Width of the exported maps in texels; that of the run when not given.
    #[arg(long)]
    pub size: Option<usize>,
    /// Only these programs.
    #[arg(long, value_enum, value_delimiter = ',')]
    pub only: Vec<Program>,
    /// Folder of exports, pictures and tables.
    #[arg(short, long, default_value = "patina-proof")]
    pub output: PathBuf,
}

/// A program that opens exports.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Program {
    /// Checkers of glTF, USD and MaterialX.
    Checkers,
    /// Mitsuba 3.
    Mitsuba,
    /// Blender, rendering with Cycles.
    Blender,
    /// A browser without a screen.
    Browser,
}

/// A camera that pictures are compared from.
#[derive(Clone, Debug)]
pub struct ProofView {
    /// Name of the photo.
    pub name: String,
    /// The camera at the size of the pictures.
    pub camera: Camera,
}

/// Runs the proof and writes its table and pictures; `tell` hears a line for each row.
///
/// # Errors
/// Errors of reading and exporting; a program that cannot be started or fails; `Numerical` naming every row that misses its
/// bar, once all is written.
pub fn run(options: &ProofOptions, stop: &AtomicBool, tell: &dyn Fn(&str)) -> Result<Table> {
    if options.samples < cases::GROUPS || !options.samples.is_multiple_of(cases::GROUPS) {
        return Err(Error::new(ErrorKind::InvalidSetting, format!("must be a multiple of {}", cases::GROUPS))
            .at(Place::Setting("samples".into())));
    }
    let folder = RunFolder::open(&options.run)?;
    let result = folder.read_result()?;
    let settings: RunSettings = folder.read_settings()?;
    let views = views_of(&folder, options)?;
    let asked = |program: Program| options.only.is_empty() || options.only.contains(&program);

    // The same maps with the lobe that others have, and as they were fitted.
    let mut lobes = vec![LobeModel::Ggx];
    if result.lobe != LobeModel::Ggx {
        lobes.push(result.lobe);
    }
    let mut all = Vec::new();
    for lobe in lobes {
        for light in lights::of(&result.environment) {
            if lobe == LobeModel::Ggx || light.name == lights::OWN {
                let name = format!("{}/{}", lobe.label().to_lowercase(), light.name);
                tell(&format!("{name}: exporting and tracing"));
                all.push(Case::make(&name, &result, &settings, lobe, light, &views, options, stop)?);
            }
        }
    }

    let mut judged = Judged::new(&options.output, tell);
    if asked(Program::Checkers) {
        programs::check_files(options, &all[0], &mut judged)?;
    }
    if asked(Program::Mitsuba) {
        programs::mitsuba(options, &all, &views)?;
        for case in &all {
            judged.pictures(case, "mitsuba-exact", &case.pictures_of("mitsuba_exact", &views)?)?;
            judged.pictures(case, "mitsuba-built-in", &case.pictures_of("mitsuba_built_in", &views)?)?;
        }
    }
    if asked(Program::Blender) {
        programs::blender(options, &all, &views)?;
        for case in &all {
            for kind in case.blender_kinds() {
                let stem = format!("cycles_{kind}");
                judged.pictures(case, &stem.replace('_', "-"), &case.pictures_of(&stem, &views)?)?;
            }
        }
    }
    if asked(Program::Browser) {
        for case in &all {
            let pictures = programs::page(options, case, &views)?;
            judged.page(case, &pictures)?;
        }
    }
    let table = judged.table;
    write_bytes(&options.output.join("proof.md"), table.to_markdown().as_bytes())?;
    let json = serde_json::to_vec_pretty(&table)
        .map_err(|source| Error::new(ErrorKind::Internal, format!("cannot encode the table: {source}")))?;
    write_bytes(&options.output.join("proof.json"), &json)?;
    Ok(table)
}

/// Views spread over those of the run's scene, at the size of the pictures.
fn views_of(folder: &RunFolder, options: &ProofOptions) -> Result<Vec<ProofView>> {
    let scene = scene_of(folder)?;
    let wanted = options.views.clamp(1, scene.views.len().max(1));
    let chosen = (0..wanted).filter_map(|index| scene.views.get(index * scene.views.len() / wanted));
    let views: Vec<ProofView> = chosen
        .map(|view| {
            let level = view.camera.level_within(options.pixels);
            ProofView { name: view.name.clone(), camera: view.camera.shrunk(1 << level) }
        })
        .collect();
    match views.is_empty() {
        true => Err(Error::new(ErrorKind::InvalidScene, "the scene of the run has no views to render from")),
        false => Ok(views),
    }
}
