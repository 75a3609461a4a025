//! What the bench works on.

use super::person::Person;
use crate::atlas::{AtlasSettings, KeepUv};
use crate::error::{Error, ErrorKind, Result};
use crate::export::exchange::{self, ExchangeOptions};
use crate::fit::settings::Steps;
use crate::fit::{FitSettings, Method};
use crate::job::demo;
use crate::job::prepare::RunSettings;
use crate::lab::scale::{self, ScaleCase};
use crate::scene::demo::DemoSettings;
use crate::studio::layout::Layout;
use crate::studio::workspace::Panel;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// How long a large atlas may take, in seconds.
const LONG: f64 = 1800.0;

/// What is opened.
#[derive(Clone, Debug, PartialEq)]
pub enum BenchScene {
    /// The sphere of `patina bench scale`.
    Sphere(ScaleCase),
    /// The built-in demo.
    Demo,
    /// A scene folder.
    Folder(PathBuf),
}

impl BenchScene {
    /// The large scene that options ask for.
    pub fn large(scene: Option<&Path>, is_small: bool) -> Self {
        match (scene, is_small) {
            (Some(path), _) => BenchScene::Folder(path.into()),
            (None, false) => BenchScene::Sphere(ScaleCase { triangles: 454_854, views: 48, map_size: 2048 }),
            (None, true) => BenchScene::Sphere(ScaleCase { triangles: 31_964, views: 12, map_size: 512 }),
        }
    }

    /// In words, for tables.
    pub fn name(&self) -> String {
        match self {
            BenchScene::Sphere(case) => {
                format!("{} triangles, maps {} x {}", case.triangles, case.map_size, case.map_size)
            }
            BenchScene::Demo => "demo".into(),
            BenchScene::Folder(path) => path.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        }
    }

    /// Opens it in the window and waits until a fit could start: one by Adam, whose steps are short and many, so that what the
    /// window takes from a fit can be measured on them.
    ///
    /// # Errors
    /// Where it cannot be opened, or takes too long.
    pub fn open(&self, person: &Person) -> Result<()> {
        self.open_as_it_is(person)?;
        person.ask(|studio, _| studio.model.edits.fit.method = Method::Adam)
    }

    /// [`BenchScene::open`] with the settings that the scene has by default.
    ///
    /// # Errors
    /// As of [`BenchScene::open`].
    pub fn open_as_it_is(&self, person: &Person) -> Result<()> {
        let scene = self.clone();
        // Made here: the window's thread has no part in it.
        let made = if let BenchScene::Sphere(case) = &scene { Some(scale::scene(*case)) } else { None };
        person.ask(move |studio, _| {
            // The layout of a first start, and nothing remembered of the measurement before.
            studio.layout = Layout::default();
            studio.model.edits = Default::default();
            match (scene, made) {
                (BenchScene::Sphere(case), Some(made)) => studio.model.open_made(made, settings_of(case)),
                (BenchScene::Folder(path), _) => studio.model.open(path),
                _ => studio.model.open_demo(),
            }
        })?;
        person.wait_until("a scene that is ready for a fit", LONG, |studio| {
            let is_ready = studio.model.project.as_ref().is_some_and(|project| project.surface.is_some());
            is_ready || !studio.model.tasks.is_busy()
        })?;
        if person.ask(|studio, _| studio.model.project.as_ref().is_none_or(|project| project.surface.is_none()))? {
            return Err(Error::new(ErrorKind::InvalidScene, format!("{} cannot be opened", self.name())));
        }
        person.ask(|studio, _| studio.layout.activate(Panel::Stage))
    }
}

/// Settings of a fit of the sphere: at full size from the first step, and longer than any measurement.
pub fn settings_of(case: ScaleCase) -> RunSettings {
    RunSettings {
        atlas: AtlasSettings { keep_uv: KeepUv::Rebuild, ..Default::default() },
        fit: FitSettings {
            method: Method::Adam,
            map_size: case.map_size,
            steps: Steps::OneStep,
            steps_diffuse: 0,
            steps_all: 100_000,
            levels: 1,
            held_out_interval: 0,
            ..Default::default()
        },
        ..Default::default()
    }
}

/// Writes a small demo as a scene folder, to be opened over and over.
///
/// # Errors
/// `Unwritable` for the folder.
pub fn write_small_scene(folder: &Path) -> Result<()> {
    let settings =
        DemoSettings { views: 10, held_out: 2, width: 120, height: 90, map_size: 256, seed: 1, ..Default::default() };
    let scene = demo::scene(&settings, &mut Vec::new(), &AtomicBool::new(false), &|_| {})?;
    let truth = scene.truth.clone();
    let truth = truth.ok_or_else(|| Error::new(ErrorKind::Internal, "the demo has no truth"))?;
    std::fs::create_dir_all(folder).map_err(|source| Error::writing(folder, source))?;
    exchange::write(&scene, &truth, &ExchangeOptions { with_photos: true, ..Default::default() }, folder)
}
