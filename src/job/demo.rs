//! The built-in scene: photographs are rendered from a truth, so that every error can be measured.

use super::kept::{self, Kept};
use super::prepare::{RunSettings, timed};
use crate::atlas::{AtlasSettings, KeepUv};
use crate::error::{Error, ErrorKind, Result};
use crate::export::exchange::{self, ExchangeOptions};
use crate::fit::{FitSettings, Method};
use crate::insight::report::data::StageTime;
use crate::render::Surface;
use crate::render::picture::{PictureSettings, render};
use crate::scene::demo::{self, DemoSettings};
use crate::scene::{Background, Scene};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use super::pictures::{parameters_of_truth, parameters_with};

/// Paths a pixel in the photographs of the demo.
const PHOTO_SAMPLES: usize = 16;

/// Settings of the demo's fit: small maps, and for who asks for Adam few steps, so that either takes a minute or so on two
/// cores.
pub fn settings() -> RunSettings {
    RunSettings {
        atlas: AtlasSettings { keep_uv: KeepUv::Keep, ..Default::default() },
        fit: FitSettings {
            // Its photos are rendered: there the solver ends nearer to the truth.
            method: Method::Solver,
            map_size: DemoSettings::default().map_size,
            steps_diffuse: 30,
            steps_all: 48,
            levels: 2,
            views_per_step: 6,
            pixels_per_step: 0,
            samples: 4,
            bounces: 2,
            ..Default::default()
        },
        ..Default::default()
    }
}

/// Builds the demo scene and renders its photographs. `progress` gets the share done, in [0, 1].
pub fn scene(
    settings: &DemoSettings,
    timings: &mut Vec<StageTime>,
    stop: &AtomicBool,
    progress: &dyn Fn(f32),
) -> Result<Scene> {
    scene_with(settings, &Kept::nowhere(), timings, stop, progress)
}

/// [`scene`] whose photographs are taken from disk where they were rendered before.
///
/// # Errors
/// `Stopped` when the flag is raised.
pub fn scene_with(
    settings: &DemoSettings,
    kept: &Kept,
    timings: &mut Vec<StageTime>,
    stop: &AtomicBool,
    progress: &dyn Fn(f32),
) -> Result<Scene> {
    let demo = timed(timings, "build demo", || demo::build(settings))?;
    let mut scene = demo.scene;
    timed(timings, "render photographs", || {
        kept::photograph(&mut scene, &(settings, PHOTO_SAMPLES), kept, |scene| {
            photograph(scene, PHOTO_SAMPLES, settings.seed, 1.0, stop, progress)
        })
    })?;
    Ok(scene)
}

/// Writes the demo scene with its photographs, linear, and its truth as an exchange folder: a capture to try things on.
///
/// # Errors
/// `InvalidSetting` for sizes of 0, `Unwritable`.
pub fn write_folder(settings: &DemoSettings, folder: &Path) -> Result<()> {
    let scene = scene(settings, &mut Vec::new(), &AtomicBool::new(false), &|_| {})?;
    let Some(truth) = &scene.truth else { return Ok(()) };
    exchange::write(&scene, truth, &ExchangeOptions { with_photos: true, ..ExchangeOptions::default() }, folder)
}

/// Fills the photographs and relit pictures of a scene with a known truth, by the path tracer at full depth. The paths
/// use other random numbers than any fit, and read the finest texels only.
pub fn photograph(
    scene: &mut Scene,
    samples: usize,
    seed: u64,
    lobe_strength: f32,
    stop: &AtomicBool,
    progress: &dyn Fn(f32),
) -> Result<()> {
    let Some(truth) = scene.truth.clone() else {
        return Err(Error::new(ErrorKind::Internal, "a scene without ground truth cannot be photographed"));
    };
    let surface = Surface::new(scene.mesh.clone())?;
    let lit = parameters_of_truth(&truth);
    let settings = PictureSettings {
        samples,
        max_bounces: truth.max_bounces,
        background_visible: scene.background == Background::Environment,
        lobe_strength,
        seed: seed ^ 0xf0f0_1234,
        ..Default::default()
    };
    let stopped = || Error::new(ErrorKind::Stopped, "stopped while photos were rendered");
    let count = scene.views.len();
    for view in 0..count {
        let picture = render(&surface, &scene.views[view].camera, &lit, view as u32, &settings, stop);
        if stop.load(Ordering::Relaxed) {
            return Err(stopped());
        }
        scene.set_photo(view, picture.radiance)?;
        progress((view + 1) as f32 / (count + 4) as f32);
    }
    if let Some(relight) = scene.truth.as_mut().and_then(|truth| truth.relight.as_mut()) {
        let lit = parameters_with(&truth.maps, &relight.environment, truth.lobe);
        let settings = PictureSettings { samples: 2 * samples, ..settings };
        relight.pictures.clear();
        let judged: Vec<usize> = (0..count).filter(|&view| scene.views[view].held_out).take(4).collect();
        let judged = if judged.is_empty() { (0..count.min(4)).collect() } else { judged };
        for view in judged {
            let picture = render(&surface, &scene.views[view].camera, &lit, view as u32, &settings, stop);
            if stop.load(Ordering::Relaxed) {
                return Err(stopped());
            }
            relight.pictures.push((view, picture.radiance));
        }
    }
    progress(1.0);
    Ok(())
}
