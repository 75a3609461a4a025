//! What a process of this program does in a contest: fits, and writes what it has at rising seconds.

use super::clock::Clock;
use super::contestant::Contestant;
use super::pace::Pace;
use super::snapshot::{self, Progress, Snapshots};
use crate::error::{Error, ErrorKind, Result};
use crate::fit::{FitSettings, Fitter, StepOutcome};
use crate::render::Surface;
use crate::scene::{ReadSettings, Scene};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// What is asked of the process.
#[derive(Clone, Debug)]
pub struct EntryOptions {
    /// An exchange folder with its truth, of which only sizes are used.
    pub scene: PathBuf,
    /// How it is read.
    pub read: ReadSettings,
    /// The method.
    pub method: Contestant,
    /// Seconds it may take.
    pub seconds: f64,
    /// Seconds at which it shows what it has.
    pub at: Vec<f64>,
    /// Seed of its random numbers.
    pub seed: u64,
    /// A TOML file of settings that differ from the defaults; none when not given.
    pub settings: Option<PathBuf>,
    /// When the process was started, in seconds since 1970.
    pub began: Option<f64>,
    /// Folder of the snapshots.
    pub output: PathBuf,
}

/// The settings of a contest on a scene: the defaults, with the lobe and the sizes of maps, light and paths as the truth has
/// them.
///
/// # Errors
/// `InvalidScene` for a scene without truth; a settings file that cannot be read.
pub fn base_settings(scene: &Scene, changes: Option<&Path>, seed: u64) -> Result<FitSettings> {
    let Some(truth) = &scene.truth else {
        return Err(Error::new(ErrorKind::InvalidScene, "the scene has no truth to compare with")
            .remedy("give an exchange folder with diffuse.exr, specular.exr, roughness.exr and env.exr"));
    };
    let map_size = truth.maps.diffuse.width();
    let own = FitSettings {
        seed,
        map_size,
        environment_height: truth.environment.height(),
        bounces: truth.max_bounces,
        lobe: truth.lobe,
        // Whoever judges does it afterwards.
        held_out_interval: 0,
        ..Default::default()
    };
    let Some(path) = changes else { return Ok(own) };
    let (settings, _) = own.changed_by_file(path)?;
    settings.validate()?;
    Ok(settings)
}

/// Reads, fits and writes snapshots until the fit or its time ends.
///
/// # Errors
/// Those of reading and fitting; `Unsupported` for a method this build has not; `Stopped` when `stop` is raised.
pub fn enter(options: &EntryOptions, stop: &AtomicBool, tell: &dyn Fn(&str)) -> Result<()> {
    let mut clock = Clock::since(options.began);
    let mut scene = crate::scene::read(&options.scene, &options.read)?;
    let settings = base_settings(&scene, options.settings.as_deref(), options.seed)?;
    let settings = options.method.settings(&settings).filter(|_| options.method != Contestant::Mitsuba);
    let Some(settings) = settings else {
        return Err(Error::new(ErrorKind::Unsupported, format!("this build has no method {}", options.method.name())));
    };
    // A fit must not see it.
    scene.truth = None;
    let surface = Arc::new(Surface::new(scene.mesh.clone())?);
    let mut fitter = Fitter::new(Arc::new(scene), surface, settings, None)?;
    let mut snapshots = Snapshots::create(&options.output, &options.at)?;
    let mut pace = Pace::default();
    while clock.seconds() < options.seconds {
        match fitter.step(stop)? {
            StepOutcome::Stepped(_) => {}
            StepOutcome::Finished => break,
            StepOutcome::Interrupted => return Err(Error::new(ErrorKind::Stopped, "the contest was stopped")),
        }
        if options.method == Contestant::Adam
            && let Some(stage) = fitter.state().plan.get(fitter.state().stage).copied()
        {
            pace.after_step(&mut fitter, &stage, clock.seconds(), options.seconds)?;
        }
        offer(&fitter, &mut snapshots, &mut clock, None)?;
    }
    let findings = fitter.findings().iter().map(ToString::to_string).collect();
    offer(&fitter, &mut snapshots, &mut clock, Some(findings))?;
    if let Some(deviations) = fitter.deviations() {
        snapshot::write_deviations(&options.output, &deviations)?;
    }
    tell(&format!("{}: {} steps, {:.1} s", options.method.name(), fitter.state().step, clock.seconds()));
    Ok(())
}

fn offer(fitter: &Fitter, snapshots: &mut Snapshots, clock: &mut Clock, end: Option<Vec<String>>) -> Result<()> {
    let state = fitter.state();
    let progress = Progress {
        state: &|| (fitter.maps(), fitter.environment()),
        step: state.step,
        stage: fitter.stage().or(state.plan.last()).map(|stage| stage.name()).unwrap_or_default(),
        non_finite: state.non_finite.iter().map(|(_, count)| count).sum(),
    };
    snapshots.offer(clock, &progress, end)
}
