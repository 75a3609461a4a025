//! Starts the processes of a contest one after the other, and has what they wrote judged.

use super::clock;
use super::contestant::Contestant;
use super::entry::base_settings;
use super::judge::Judge;
use super::options::ContestOptions;
use super::snapshot::{self, Snapshot};
use super::tables::{Contest, SceneResults};
use crate::error::{Error, ErrorKind, Place, Result};
use crate::fit::{FitSettings, Fitter};
use crate::job::against_truth::resampled;
use crate::job::demo::photograph;
use crate::render::Surface;
use crate::scene::demo::{self, DemoSettings};
use crate::scene::{ReadSettings, Scene};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Runs every method on every scene with every seed and writes tables and plots, anew after each fit. `tell` hears of
/// each.
///
/// # Errors
/// A scene without truth, an output folder that cannot be written, no method at all; `Stopped` when `stop` is raised. A
/// method that cannot run is no error: it is noted in the tables.
pub fn run(options: &ContestOptions, stop: &AtomicBool, tell: &dyn Fn(&str)) -> Result<Contest> {
    let wrong =
        |name: &str, message: &str| Err(Error::new(ErrorKind::InvalidSetting, message).at(Place::Setting(name.into())));
    if options.seeds == 0 {
        return wrong("seeds", "must be at least 1");
    }
    if options.methods.is_empty() {
        return wrong("methods", "must name at least one");
    }
    if !(options.seconds.is_finite() && options.seconds > 0.0) {
        return wrong("seconds", "must be more than 0");
    }
    let output = std::path::absolute(&options.output).unwrap_or_else(|_| options.output.clone());
    let options = &ContestOptions { output, ..options.clone() };
    std::fs::create_dir_all(&options.output).map_err(|source| Error::writing(&options.output, source))?;
    let mut contest = Contest::new(options);
    let mut scenes = options.scenes.clone();
    if scenes.is_empty() {
        tell("photographing the demo");
        scenes.push(built_in(options, stop)?);
    }
    let methods = able(options, &mut contest, tell);
    for path in &scenes {
        let path = std::path::absolute(path).unwrap_or_else(|_| path.clone());
        tell(&format!("reading {}", path.display()));
        let scene = crate::scene::read(&path, &options.read)?;
        let base = base_settings(&scene, options.settings.as_deref(), 1)?;
        let judge = Judge::new(scene, options.samples, options.most_views)?.of_lobe(base.lobe);
        let name = contest.unused_name(&judge.scene().name);
        let folder = options.output.join(&name);
        let start = write_start(judge.scene(), &base, &folder)?;
        let mut results = SceneResults::new(name, &judge, &base);
        if let Some(truth) = &judge.scene().truth {
            results.truth = judge.scores(&truth.maps, &truth.environment, 0, stop)?;
        }
        let (maps, light) = snapshot::read_maps(&start)?;
        results.start = judge.scores(&maps, &light, 0, stop)?;
        contest.scenes.push(results);
        for seed in 1..=options.seeds as u64 {
            for &method in &methods {
                let place = folder.join(format!("{}-{seed}", method.name()));
                let race = Race { options, scene: &path, judge: &judge, start: &start, place: &place, seed };
                race.run(method, &mut contest, stop, tell)?;
                contest.write(&options.output)?;
            }
        }
    }
    contest.write(&options.output)?;
    Ok(contest)
}

/// The methods that can run here; the others are noted.
fn able(options: &ContestOptions, contest: &mut Contest, tell: &dyn Fn(&str)) -> Vec<Contestant> {
    let mut able = Vec::new();
    for &method in &options.methods {
        match trouble_of(method, options) {
            None if !able.contains(&method) => able.push(method),
            None => {}
            Some(why) => {
                let note = format!("`{}` was left out: {why}.", method.name());
                tell(&note);
                contest.notes.push(note);
            }
        }
    }
    able
}

/// Why a method cannot run here, if so.
pub(super) fn trouble_of(method: Contestant, options: &ContestOptions) -> Option<String> {
    match method {
        Contestant::Mitsuba => mitsuba_trouble(options),
        own => own.settings(&FitSettings::default()).is_none().then(|| "this build has no such method".to_string()),
    }
}

/// Why Mitsuba cannot run, if so.
fn mitsuba_trouble(options: &ContestOptions) -> Option<String> {
    let default = ReadSettings::default();
    let own = ReadSettings {
        // Which views it fits to it is told by their names.
        hold_out_every: default.hold_out_every,
        max_views: default.max_views,
        ..options.read.clone()
    };
    if own != default {
        return Some("it reads exchange folders as they are: photos at their full size, in their own world".into());
    }
    let script = options.scripts.join("fit_exchange.py");
    if !script.is_file() {
        return Some(format!("there is no {}", script.display()));
    }
    let asked = "import mitsuba; mitsuba.set_variant('llvm_ad_rgb'); import drjit; drjit.eval(mitsuba.Float([1]) + 1)";
    let outcome = Command::new(&options.python).args(["-c", asked]).stdin(Stdio::null()).output();
    match outcome {
        Err(error) => Some(format!("{} cannot be started ({error})", options.python.display())),
        Ok(output) if output.status.success() => None,
        Ok(output) => {
            let text = String::from_utf8_lossy(&output.stderr);
            let last = text.lines().rev().find(|line| !line.trim().is_empty()).unwrap_or("no message");
            Some(format!("{} has no working Mitsuba ({})", options.python.display(), last.trim()))
        }
    }
}

/// The demo as an exchange folder.
fn built_in(options: &ContestOptions, stop: &AtomicBool) -> Result<PathBuf> {
    let settings = if options.quick {
        DemoSettings { views: 6, held_out: 2, width: 32, height: 24, map_size: 64, seed: 1, ..Default::default() }
    } else {
        DemoSettings::default()
    };
    let built = demo::build(&settings)?;
    let (covered, mut scene) = (built.covered, built.scene);
    photograph(&mut scene, if options.quick { 16 } else { 128 }, settings.seed, 1.0, stop, &|_| {})?;
    let folder = options.output.join("scene-demo");
    if let Some(truth) = &scene.truth {
        let exchange = crate::export::exchange::ExchangeOptions {
            covered: Some(&covered),
            with_photos: true,
            ..Default::default()
        };
        crate::export::exchange::write(&scene, truth, &exchange, &folder)?;
    }
    Ok(folder)
}

/// Writes what every method begins from, at full size.
pub(super) fn write_start(scene: &Scene, base: &FitSettings, folder: &Path) -> Result<PathBuf> {
    let settings = Contestant::Adam.settings(base).unwrap_or_else(|| base.clone());
    let surface = Arc::new(Surface::new(scene.mesh.clone())?);
    let fitter = Fitter::new(Arc::new(scene.clone()), surface, settings, None)?;
    let maps = resampled(&fitter.maps(), (base.map_size, base.map_size));
    let start = folder.join("start");
    snapshot::write_maps(&start, &maps, &fitter.environment())?;
    Ok(start)
}

/// One fit by a process of its own.
pub(super) struct Race<'a> {
    /// What is asked of it.
    pub(super) options: &'a ContestOptions,
    /// Folder of the scene it fits.
    pub(super) scene: &'a Path,
    /// Who scores; its scene names the views.
    pub(super) judge: &'a Judge,
    /// Folder of the maps and light that all begin from.
    pub(super) start: &'a Path,
    /// Folder of its snapshots.
    pub(super) place: &'a Path,
    /// Seed of the fit.
    pub(super) seed: u64,
}

impl Race<'_> {
    /// Runs a method and judges its snapshots; the scores go to the last scene of the contest.
    fn run(&self, method: Contestant, contest: &mut Contest, stop: &AtomicBool, tell: &dyn Fn(&str)) -> Result<()> {
        let scene = &self.judge.scene().name;
        let ended = |snapshots: &[Snapshot]| snapshots.last().is_some_and(|last| last.due.is_none());
        if self.options.reuse && ended(&snapshot::list(self.place).unwrap_or_default()) {
            tell(&format!("{scene}, seed {}: {} as it was", self.seed, method.name()));
            let note = format!("`{}` on {scene}, seed {}, is that of an earlier contest.", method.name(), self.seed);
            contest.notes.push(note);
            return self.judge(method, contest, stop, tell);
        }
        tell(&format!("{scene}, seed {}: {} for {} s", self.seed, method.name(), self.options.seconds));
        let trouble = self.fit(method, stop)?;
        if let Some(trouble) = trouble {
            let note = format!("`{}` on {scene}, seed {}: {trouble}.", method.name(), self.seed);
            tell(&note);
            contest.notes.push(note);
        }
        self.judge(method, contest, stop, tell)
    }

    /// Runs the process of a method to its end; says what went wrong, if anything.
    ///
    /// # Errors
    /// `Stopped` when `stop` is raised.
    pub(super) fn fit(&self, method: Contestant, stop: &AtomicBool) -> Result<Option<String>> {
        let mut command = match method {
            Contestant::Mitsuba => self.script(),
            own => self.program(own),
        };
        // A process that fails at once must not leave the list of an earlier one.
        let _ = std::fs::remove_file(self.place.join("snapshots.jsonl"));
        wait(&mut command, stop)
    }

    /// Judges what a method wrote.
    fn judge(&self, method: Contestant, contest: &mut Contest, stop: &AtomicBool, tell: &dyn Fn(&str)) -> Result<()> {
        let snapshots = snapshot::list(self.place)?;
        tell(&format!("judging {} snapshots", snapshots.len()));
        for snapshot in snapshots {
            let (maps, light) = snapshot.read(self.place)?;
            let scores = self.judge.scores(&maps, &light, snapshot.non_finite, stop)?;
            if let Some(results) = contest.scenes.last_mut() {
                results.add(method, self.seed, snapshot, scores);
            }
        }
        Ok(())
    }

    fn times(&self) -> String {
        self.options.due().iter().map(|due| due.to_string()).collect::<Vec<_>>().join(",")
    }

    fn program(&self, method: Contestant) -> Command {
        let mut command = Command::new(&self.options.program);
        if let Some(threads) = self.options.threads {
            command.arg("--threads").arg(threads.to_string());
        }
        command.args(["bench", "entry"]).arg(self.scene).args(["--method", method.name()]);
        command.args(read_arguments(&self.options.read));
        if let Some(settings) = &self.options.settings {
            command.arg("--settings").arg(settings);
        }
        command.args(["--seconds", &self.options.seconds.to_string()]);
        command.args(["--at", &self.times(), "--seed", &self.seed.to_string()]).arg("-o").arg(self.place);
        command.args(["--began", &clock::now().to_string()]);
        command
    }

    fn script(&self) -> Command {
        let mut command = Command::new(&self.options.python);
        command.arg(self.options.scripts.join("fit_exchange.py")).arg(self.scene);
        if let Some(threads) = self.options.threads {
            command.arg("--threads").arg(threads.to_string());
        }
        let views = self.judge.scene().views.iter().filter(|view| !view.held_out);
        let names: Vec<&str> = views.map(|view| view.name.as_str()).collect();
        command.arg("--start").arg(self.start).args(["--names", &names.join(",")]);
        command.args(["--seconds", &self.options.seconds.to_string()]);
        command.args(["--at", &self.times(), "--seed", &self.seed.to_string()]).arg("--out").arg(self.place);
        command.args(["--began", &clock::now().to_string()]);
        command
    }
}

/// The options by which `patina bench entry` reads a scene in the same way.
pub fn read_arguments(read: &ReadSettings) -> Vec<String> {
    fn word<T: clap::ValueEnum>(value: &T) -> String {
        value.to_possible_value().map(|value| value.get_name().to_string()).unwrap_or_default()
    }
    let mut arguments = vec![
        format!("--up={}", read.up),
        format!("--pixel-centre={}", read.pixel_centre),
        format!("--hold-out-every={}", read.hold_out_every),
        format!("--max-views={}", read.max_views),
        format!("--masks={}", word(&read.masks)),
        format!("--scene-background={}", word(&read.background)),
        format!("--encoding={}", word(&read.encoding)),
        format!("--shrink={}", read.shrink),
    ];
    arguments.extend(read.layer.iter().map(|layer| format!("--layer={layer}")));
    arguments.extend(read.unit_in_metres.iter().map(|metres| format!("--unit-in-metres={metres}")));
    arguments.extend(read.mesh.iter().map(|mesh| format!("--mesh={}", mesh.display())));
    arguments.extend(read.chunk.iter().map(|chunk| format!("--chunk={chunk}")));
    arguments
}

/// Runs a process to its end; says what went wrong, if anything.
///
/// # Errors
/// `Stopped` when `stop` is raised; the process is ended then.
fn wait(command: &mut Command, stop: &AtomicBool) -> Result<Option<String>> {
    let mut child = match command.stdin(Stdio::null()).stdout(Stdio::null()).spawn() {
        Ok(child) => child,
        Err(error) => return Ok(Some(format!("cannot be started ({error})"))),
    };
    loop {
        match child.try_wait() {
            Ok(Some(status)) if status.success() => return Ok(None),
            Ok(Some(status)) => return Ok(Some(format!("ended with {status}"))),
            Ok(None) => {}
            Err(error) => return Ok(Some(format!("was lost ({error})"))),
        }
        if stop.load(Ordering::Relaxed) {
            let _ = child.kill();
            let _ = child.wait();
            return Err(Error::new(ErrorKind::Stopped, "the contest was stopped")
                .remedy("tables of the fits that were done are written"));
        }
        std::thread::sleep(Duration::from_millis(50));
    }
}
