//! A studio in a harness, and a small scene on disk for it to open; what a hand does to it is in `hand`.

use eframe::App;
use egui_kittest::{Harness, HarnessBuilder};
use patina::export::exchange::{self, ExchangeOptions};
use patina::fit::Method;
use patina::scene::demo::DemoSettings;
use patina::studio::StudioOptions;
use patina::studio::act::Act;
use patina::studio::app::Studio;
use patina::studio::model::{FitStatus, Model};
use patina::studio::workspace::Panel;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};
use tempfile::TempDir;

pub use eframe::egui::accesskit::Role;
pub use eframe::egui::{Key, Modifiers};

/// What waits longer than this is taken to hang.
const PATIENCE: Duration = Duration::from_secs(240);
/// The same where neither a task nor a fit is at work.
const PATIENCE_AT_REST: Duration = Duration::from_secs(10);
/// Between two looks at what is waited for.
const BETWEEN_LOOKS: Duration = Duration::from_millis(20);
/// Steps of a fit that only a stop ends.
pub const ENDLESS: usize = 100_000;

/// A folder that goes with the process' build folder rather than with the system's.
fn lasting_folder() -> TempDir {
    let beside = std::env::current_exe().unwrap().parent().unwrap().join("tmp");
    std::fs::create_dir_all(&beside).unwrap();
    tempfile::tempdir_in(beside).unwrap()
}

/// Writes a small exchange folder with photos and a truth.
pub fn write_small_scene(folder: &Path) {
    let small =
        DemoSettings { views: 6, held_out: 2, width: 48, height: 36, map_size: 64, seed: 1, ..Default::default() };
    let stop = AtomicBool::new(false);
    let scene = patina::job::demo::scene(&small, &mut Vec::new(), &stop, &|_| {}).unwrap();
    let truth = scene.truth.clone().unwrap();
    let options = ExchangeOptions { with_photos: true, ..ExchangeOptions::default() };
    exchange::write(&scene, &truth, &options, folder).unwrap();
}

/// A small exchange folder with photos and a truth, made once.
pub fn small_scene() -> &'static Path {
    static SCENE: OnceLock<TempDir> = OnceLock::new();
    let folder = SCENE.get_or_init(|| {
        let folder = lasting_folder();
        write_small_scene(folder.path());
        folder
    });
    folder.path()
}

/// A finished run of the small scene, made once; tests only read it.
pub fn finished_run() -> &'static Path {
    static RUN: OnceLock<(TempDir, PathBuf)> = OnceLock::new();
    let (_, path) = RUN.get_or_init(|| {
        let folder = lasting_folder();
        let mut studio = TestStudio::with_small_scene();
        studio.model().preferences.runs_folder = folder.path().into();
        studio.act(Act::Start);
        studio.wait("the end of the fit", |model| model.fit.status == FitStatus::Finished);
        let path = studio.run_folder();
        (folder, path)
    });
    path
}

/// A studio with settings and runs in a folder of its own, which lives as long as it does.
pub struct TestStudio {
    pub harness: Harness<'static, Studio>,
    pub folder: Arc<TempDir>,
}

impl Drop for TestStudio {
    fn drop(&mut self) {
        // As a killed program, it writes no settings; but its threads must not write into a folder that is gone.
        let model = &mut self.harness.state_mut().model;
        model.tasks.stop_all();
        model.fit.stop_and_wait();
        model.object.stop_and_wait();
    }
}

impl TestStudio {
    /// A fresh studio on its first page.
    pub fn new() -> Self {
        TestStudio::opening(None)
    }

    /// A studio that opens a path at once.
    pub fn opening(path: Option<PathBuf>) -> Self {
        TestStudio::in_folder(Arc::new(tempfile::tempdir().unwrap()), path)
    }

    /// A studio that remembers what is in a folder.
    pub fn in_folder(folder: Arc<TempDir>, path: Option<PathBuf>) -> Self {
        TestStudio::built(Harness::builder().with_size([1440.0, 900.0]), folder, path)
    }

    /// A studio in a window of its own kind.
    pub fn built(builder: HarnessBuilder<Studio>, folder: Arc<TempDir>, path: Option<PathBuf>) -> Self {
        let settings_file = Some(folder.path().join("studio.json"));
        let options = StudioOptions { path, demo: false, settings_file };
        let runs = folder.path().join("runs");
        let mut harness =
            builder.with_wait_for_pending_images(false).build_eframe(move |creation| Studio::new(creation, &options));
        harness.state_mut().model.preferences.runs_folder = runs;
        // Pictures are made by threads of their own; most tests do without.
        harness.state_mut().model.switches.traced = false;
        TestStudio { harness, folder }
    }

    /// A studio with the small scene open and its atlas made, and settings of a fit of some seconds.
    pub fn with_small_scene() -> Self {
        TestStudio::with_scene(small_scene())
    }

    /// The same with another folder of the small scene.
    pub fn with_scene(scene: &Path) -> Self {
        let mut studio = TestStudio::opening(Some(scene.into()));
        studio.prepare_fit();
        studio
    }

    /// Waits for the atlas and chooses settings of a fit of some seconds.
    pub fn prepare_fit(&mut self) {
        self.wait("the atlas", |model| model.project.as_ref().is_some_and(|own| own.surface.is_some()));
        self.ask_for_little();
        let model = self.model();
        let edits = model.edits.clone();
        model.history.restart(&edits);
        self.frames(2);
    }

    /// Chooses settings of a fit of some seconds.
    pub fn ask_for_little(&mut self) {
        let fit = &mut self.model().edits.fit;
        // Many short steps, to be held and stopped between.
        fit.method = Method::Adam;
        (fit.map_size, fit.levels, fit.steps_diffuse, fit.steps_all) = (64, 2, 6, 6);
        (fit.samples, fit.pixels_per_step, fit.views_per_step, fit.environment_height) = (2, 0, 2, 8);
    }

    /// A studio in which the small scene was just read, and is about to be checked and prepared.
    pub fn with_scene_just_read() -> Self {
        let mut studio = TestStudio::new();
        studio.model().open(small_scene().into());
        // News are taken in by hand: with the scene, nothing can have come that was made of it.
        let began = Instant::now();
        while studio.model().project.is_none() {
            assert!(began.elapsed() < PATIENCE, "{}", studio.log());
            std::thread::sleep(Duration::from_millis(5));
            studio.model().poll();
        }
        studio
    }

    /// A studio with a fit that goes on until it is stopped, some steps after its start.
    pub fn with_running_fit() -> Self {
        let mut studio = TestStudio::with_small_scene();
        studio.start_endless_fit();
        studio
    }

    /// Starts a fit that goes on until it is stopped, and waits for its first steps.
    pub fn start_endless_fit(&mut self) {
        self.model().edits.fit.steps_diffuse = ENDLESS;
        self.frames(1);
        self.click("Start");
        self.wait_for_step(3);
    }

    /// A studio with the finished run open.
    pub fn with_finished_run() -> Self {
        let mut studio = TestStudio::opening(Some(finished_run().into()));
        studio.wait("the run", |model| model.project.is_some());
        studio.frames(2);
        studio
    }

    /// What the window knows.
    pub fn model(&mut self) -> &mut Model {
        &mut self.harness.state_mut().model
    }

    /// The folder of the run that is open.
    pub fn run_folder(&self) -> PathBuf {
        self.harness.state().model.fit.folder.as_ref().unwrap().path().into()
    }

    /// The settings of that run as they are on disk.
    pub fn settings_on_disk(&self) -> String {
        std::fs::read_to_string(self.run_folder().join("settings.toml")).unwrap_or_default()
    }

    /// Steps done.
    pub fn steps_done(&self) -> usize {
        self.harness.state().model.fit.losses.last().map_or(0, |row| row.step)
    }

    /// Frames.
    pub fn frames(&mut self, count: usize) {
        for _ in 0..count {
            self.harness.step();
        }
    }

    /// Queues an act and lets it be done.
    pub fn act(&mut self, act: Act) {
        self.model().act(act);
        self.frames(2);
    }

    /// Brings a panel to the front by its tab.
    pub fn show(&mut self, panel: Panel) {
        self.harness.state_mut().layout.activate(panel);
        self.frames(2);
    }

    /// Frames until something is so.
    #[track_caller]
    pub fn wait(&mut self, what: &str, is_so: impl Fn(&Model) -> bool) {
        let began = Instant::now();
        loop {
            self.harness.step();
            let model = &self.harness.state().model;
            if is_so(model) {
                // What the panels show follows what the model knows.
                self.frames(2);
                return;
            }
            // Where nothing works any more, nothing will come either.
            let is_at_work = model.fit.status.is_live() || model.object.status.is_live();
            let is_at_rest = !is_at_work && !model.tasks.is_busy();
            let patience = if is_at_rest { PATIENCE_AT_REST } else { PATIENCE };
            assert!(began.elapsed() < patience, "{what} did not come; {:?}, {}", model.fit.status, self.log());
            // What is waited for works at a lower priority: frames would take its time.
            std::thread::sleep(BETWEEN_LOOKS);
        }
    }

    /// Frames until a fit has done so many steps.
    #[track_caller]
    pub fn wait_for_step(&mut self, step: usize) {
        self.wait(&format!("step {step}"), |model| model.fit.losses.last().is_some_and(|row| row.step >= step));
    }

    /// Frames until the log says something.
    #[track_caller]
    pub fn wait_for_word(&mut self, word: &str) {
        self.wait(word, |model| model.log.messages().iter().any(|message| message.sentence().contains(word)));
    }

    /// Everything that was noticed, as one text.
    pub fn log(&self) -> String {
        let lines = self.harness.state().model.log.messages().iter();
        lines.map(|message| format!("{} {}\n", message.sentence(), message.remedy)).collect()
    }

    /// Closes the window as a person does, so that settings are written; returns what is left on disk.
    pub fn close(mut self) -> Arc<TempDir> {
        self.harness.state_mut().on_exit();
        Arc::clone(&self.folder)
    }
}
