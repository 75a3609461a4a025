//! Ways to open something: reading happens beside the window, step by step, and what is open stays until another scene was
//! read.

use super::opened::{RunRead, SceneRead};
use super::tasks::TaskKind;
use super::{Done, Edits, Model, StageSwitches};
use crate::export::RunFolder;
use crate::fit::Suited;
use crate::job::demo;
use crate::job::materials::OpenedMaterial;
use crate::job::open::{self, OpenStage, OpenedScene, PathKind};
use crate::job::prepare::RunSettings;
use crate::object::result_read;
use crate::scene::demo::DemoSettings;
use crate::scene::{ReadSettings, Scene};
use crate::studio::workspace::Workspace;
use std::path::PathBuf;

impl Model {
    /// Opens a scene or run folder; a picture is a photo for object mode, a result of object mode is shown there, and so
    /// is a measured table.
    pub fn open(&mut self, path: PathBuf) {
        if OpenedMaterial::is_table(&path) {
            self.workspace = Workspace::Object;
            return self.open_material(path);
        }
        if super::object_form::is_photo(&path) && path.is_file() {
            self.workspace = Workspace::Object;
            return self.object_dropped(&path);
        }
        if result_read::is_result(&path) {
            return self.open_object(path);
        }
        self.open_with(path, ReadSettings::default());
    }

    /// Opens a scene that is to be read in a certain way, or a run folder. What is open is closed once the other was
    /// read: a path that leads to neither takes nothing away.
    pub fn open_with(&mut self, path: PathBuf, read: ReadSettings) {
        self.workspace = Workspace::Scene;
        self.tasks.stop(&TaskKind::Opening);
        self.log.dismiss();
        let path = std::path::absolute(&path).unwrap_or(path);
        let mut settings = RunSettings { scene: path.clone(), read, ..RunSettings::default() };
        let kept = self.kept.clone();
        self.tasks.spawn(TaskKind::Opening, move |context| {
            let tell = |stage: OpenStage, share: f32| context.tell(stage.label(), share);
            context.tell("looking at the folder", 0.0);
            match open::kind_of(&path)? {
                PathKind::Run => {
                    let folder = RunFolder::open(&path)?;
                    let run = open::view_run_with(&folder, None, &kept, &context.stop, &tell)?;
                    context.tell("thumbnails", 0.0);
                    Ok(Done::RunOpened(Box::new(RunRead::new(folder, run))))
                }
                PathKind::Scene => {
                    let opened = open::read_unchecked(&path, &settings.read, &context.stop, &tell)?;
                    let suited = Suited::to(&opened.scene, &opened.report);
                    settings.fit = suited.resolve(&settings.fit, &[]);
                    context.tell("thumbnails", 0.0);
                    let read = SceneRead::new(Some(path), settings, opened);
                    Ok(Done::SceneRead(Box::new(SceneRead { suited: Some(suited), ..read })))
                }
            }
        });
    }

    /// Photographs and opens the built-in scene.
    pub fn open_demo(&mut self) {
        self.workspace = Workspace::Scene;
        self.tasks.stop(&TaskKind::Opening);
        let kept = self.kept.clone();
        self.tasks.spawn(TaskKind::Opening, move |context| {
            let tell = |stage: OpenStage, share: f32| context.tell(stage.label(), share);
            let settings = demo::settings();
            let opened = open::open_demo_with(&DemoSettings::default(), &kept, &context.stop, &tell)?;
            Ok(Done::SceneRead(Box::new(SceneRead::new(None, settings, opened))))
        });
    }

    /// Opens a scene that was made in code.
    pub fn open_made(&mut self, scene: Scene, settings: RunSettings) {
        self.tasks.stop(&TaskKind::Opening);
        self.tasks.spawn(TaskKind::Opening, move |_| {
            let opened = OpenedScene { scene, report: Default::default(), timings: Vec::new() };
            Ok(Done::SceneRead(Box::new(SceneRead::new(None, settings, opened))))
        });
    }

    /// Takes in all that was dropped at once: of several folders a queue is made.
    pub fn all_dropped(&mut self, paths: Vec<PathBuf>) {
        let are_scenes =
            self.workspace == Workspace::Scene && paths.len() > 1 && paths.iter().all(|path| path.is_dir());
        match are_scenes {
            true => self.queue_scenes(paths),
            false => paths.into_iter().for_each(|path| self.dropped(path)),
        }
    }

    /// Takes in what was dropped on the window: a picture is a light, anything else a scene or run. In object mode it is
    /// what [`Model::object_dropped`] takes it for.
    pub fn dropped(&mut self, path: PathBuf) {
        if self.workspace == Workspace::Object {
            return self.object_dropped(&path);
        }
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default();
        match ending.as_str() {
            "hdr" | "exr" | "pfm" | "png" | "jpg" | "jpeg" => self.add_light(path),
            _ => self.open(path),
        }
    }

    /// Goes back to the first page. A fit in progress is stopped; its checkpoint keeps what was done.
    pub fn close(&mut self) {
        self.tasks.stop_those_of_scene();
        (self.start_is_queued, self.being_cached) = (false, None);
        (self.card, self.exported, self.other_run) = (false, None, None);
        self.log.scene_was_closed();
        self.fit.forget();
        self.timeline = super::timeline::Timeline::default();
        self.project = None;
        self.cursor = None;
        self.shelf.forget_scene();
        self.switches = StageSwitches { traced: self.switches.traced, ..StageSwitches::default() };
        self.edits = Edits { display: self.edits.display, object: self.edits.object.clone(), ..Edits::default() };
        self.history.restart(&self.edits);
    }
}
