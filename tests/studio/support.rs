//! A studio in a harness, and a small scene on disk for it to open.

use egui_kittest::Harness;
use patina::export::exchange::{self, ExchangeOptions};
use patina::scene::demo::DemoSettings;
use patina::studio::{Studio, StudioOptions};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// What waits longer than this is taken to hang.
const PATIENCE: Duration = Duration::from_secs(240);

/// A small exchange folder with photos and a truth, made once.
pub fn small_scene() -> &'static Path {
    static SCENE: OnceLock<TempDir> = OnceLock::new();
    let folder = SCENE.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let small = DemoSettings { views: 6, held_out: 2, width: 48, height: 36, map_size: 64, seed: 1 };
        let stop = AtomicBool::new(false);
        let scene = patina::job::demo::scene(&small, &mut Vec::new(), &stop, &|_| {}).unwrap();
        let truth = scene.truth.clone().unwrap();
        let options = ExchangeOptions { with_photos: true, ..ExchangeOptions::default() };
        exchange::write(&scene, &truth, &options, folder.path()).unwrap();
        folder
    });
    folder.path()
}

/// A studio with settings and runs in a folder of its own, which lives as long as it does.
pub struct TestStudio {
    pub harness: Harness<'static, Studio>,
    pub folder: TempDir,
}

impl TestStudio {
    /// A fresh studio on its first page.
    pub fn new() -> Self {
        TestStudio::opening(None)
    }

    /// A studio that opens a path at once.
    pub fn opening(path: Option<PathBuf>) -> Self {
        let folder = tempfile::tempdir().unwrap();
        TestStudio::in_folder(folder, path)
    }

    /// A studio that remembers what is in a folder.
    pub fn in_folder(folder: TempDir, path: Option<PathBuf>) -> Self {
        let settings_file = Some(folder.path().join("studio.json"));
        let options = StudioOptions { path, demo: false, settings_file };
        let runs = folder.path().join("runs");
        let mut harness = Harness::builder()
            .with_size([1440.0, 900.0])
            .with_wait_for_pending_images(false)
            .build_eframe(move |creation| Studio::new(creation, &options));
        harness.state_mut().model.preferences.runs_folder = runs;
        // Pictures are made by threads of their own; most tests do without.
        harness.state_mut().model.switches.traced = false;
        TestStudio { harness, folder }
    }

    /// A studio with the small scene open and its atlas made, and settings of a fit of some seconds.
    pub fn with_small_scene() -> Self {
        let mut studio = TestStudio::opening(Some(small_scene().into()));
        studio.wait("the atlas", |studio| studio.model.project.as_ref().is_some_and(|own| own.surface.is_some()));
        let fit = &mut studio.harness.state_mut().model.edits.fit;
        (fit.map_size, fit.levels, fit.steps_diffuse, fit.steps_all) = (64, 2, 6, 6);
        (fit.samples, fit.pixels_per_step, fit.views_per_step) = (2, 0, 2);
        studio.step();
        studio
    }

    /// One frame.
    pub fn step(&mut self) {
        self.harness.step();
    }

    /// Frames until something is so.
    pub fn wait(&mut self, what: &str, is_so: impl Fn(&Studio) -> bool) {
        let began = Instant::now();
        loop {
            self.harness.step();
            if is_so(self.harness.state()) {
                return;
            }
            let model = &self.harness.state().model;
            let log: Vec<String> = model.log.messages().iter().map(|message| message.sentence()).collect();
            assert!(began.elapsed() < PATIENCE, "{what} did not come; status {:?}, log {log:#?}", model.fit.status);
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// Everything that was noticed, as one text.
    pub fn log(&self) -> String {
        let lines = self.harness.state().model.log.messages().iter();
        lines.map(|message| format!("{} {}\n", message.sentence(), message.remedy)).collect()
    }
}
