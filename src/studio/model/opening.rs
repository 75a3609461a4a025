//! From a path to a project: reading, checking and preparing happen beside the window, step by step, and each step shows
//! what it brought. What is open stays until another scene was read.

use super::lights::{LightName, ShelfLight};
use super::log::Message;
use super::project::Atlas;
use super::tasks::TaskKind;
use super::{Cursor, Done, Edits, Model, Project, StageSwitches};
use crate::error::{Finding, Severity};
use crate::export::RunFolder;
use crate::fit::{FitSettings, Suited};
use crate::image::RgbImage;
use crate::insight::report::data::StageTime;
use crate::job::demo;
use crate::job::materials::OpenedMaterial;
use crate::job::open::{self, OpenStage, OpenedRun, OpenedScene, PathKind};
use crate::job::prepare::{Prepared, RunSettings, prepare_with};
use crate::math::parallel;
use crate::object::result_read;
use crate::render::Surface;
use crate::scene::demo::DemoSettings;
use crate::scene::{Mesh, ReadSettings, Scene};
use crate::studio::stage::eye::OrbitEye;
use crate::studio::workspace::Workspace;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Longest side of the small picture of a photo, in pixels.
const THUMBNAIL_SIDE: usize = 128;
/// Pixels along the shorter side of a photo whose rays are asked whether they meet the surface.
const LOOKED_AT_A_SIDE: usize = 64;

/// A scene that was read; it is shown before it is checked.
pub struct SceneRead {
    path: Option<PathBuf>,
    settings: RunSettings,
    /// What suits the scene as far as its photos alone say; the check says the rest.
    suited: Option<Suited>,
    scene: Arc<Scene>,
    mesh: Arc<Mesh>,
    timings: Vec<StageTime>,
    thumbnails: Vec<Arc<RgbImage>>,
}

/// What the check of a scene says.
pub struct SceneChecked {
    suited: Suited,
    findings: Vec<Finding>,
    timings: Vec<StageTime>,
}

/// A scene with its atlas.
pub struct PreparedScene {
    prepared: Prepared,
    atlas: Atlas,
    clipped_shares: Vec<f32>,
}

/// A run that was read.
pub struct RunRead {
    folder: RunFolder,
    run: OpenedRun,
    atlas: Atlas,
    thumbnails: Vec<Arc<RgbImage>>,
    clipped_shares: Vec<f32>,
}

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
        self.start_is_queued = false;
        (self.card, self.exported, self.other_run) = (false, None, None);
        self.log.scene_was_closed();
        self.fit.forget();
        self.project = None;
        self.cursor = None;
        self.shelf.forget_scene();
        self.switches = StageSwitches { traced: self.switches.traced, ..StageSwitches::default() };
        self.edits = Edits { display: self.edits.display, object: self.edits.object.clone(), ..Edits::default() };
        self.history.restart(&self.edits);
    }

    pub(super) fn scene_was_read(&mut self, read: SceneRead) {
        self.close();
        if let Some(path) = &read.path {
            self.preferences.remember(path, false);
            self.keep_thumbnail(path, &read.thumbnails);
        }
        let views = read.scene.views.len();
        self.edits.fit = read.settings.fit.clone();
        self.eye = OrbitEye::around(super::framing::subject(&read.mesh, Some(&read.scene)));
        if let Some(truth) = &read.scene.truth {
            let light = Arc::new(truth.environment.clone());
            self.shelf.put(ShelfLight::new(LightName::Truth, light));
            if let Some(unseen) = &truth.relight {
                self.shelf.put(ShelfLight::new(LightName::Unseen, Arc::new(unseen.environment.clone())));
            }
        }
        let is_made = read.suited.is_none();
        self.project = Some(Project {
            title: read.scene.name.clone(),
            path: read.path,
            is_run: false,
            scene: Some(read.scene),
            mesh: read.mesh,
            surface: None,
            suited: read.suited,
            settings: read.settings,
            default_fit: is_made.then(|| self.edits.fit.clone()),
            timings: read.timings,
            view_errors: vec![None; views],
            thumbnails: read.thumbnails,
            ..Project::default()
        });
        self.history.restart(&self.edits);
        self.first_light();
        match is_made {
            // What was made in code is as it should be.
            true => self.prepare(),
            false => self.check(),
        }
        self.lay_photos();
    }

    /// Checks the scene that was read, beside the window.
    fn check(&mut self) {
        let Some(project) = &self.project else { return };
        let Some(scene) = project.scene.clone() else { return };
        let (mut timings, kept) = (project.timings.clone(), self.kept.clone());
        self.tasks.spawn(TaskKind::Checking, move |context| {
            let tell = |stage: OpenStage, share: f32| context.tell(stage.label(), share);
            let report = open::check(&scene, &kept, &mut timings, &context.stop, &tell)?;
            let suited = Suited::to(&scene, &report);
            Ok(Done::SceneChecked(Box::new(SceneChecked { suited, findings: report.findings, timings })))
        });
    }

    /// Takes in what the check says: what was set meanwhile stays, all else becomes what suits the scene.
    pub(super) fn scene_was_checked(&mut self, checked: SceneChecked) {
        let Some(project) = &mut self.project else { return };
        let chosen = self.edits.fit.differences(&project.settings.fit);
        let chosen: Vec<String> = chosen.into_iter().map(|(name, ..)| name).collect();
        let settings = checked.suited.resolve(&FitSettings::default(), &[]);
        project.settings.fit = settings.clone();
        let asked = FitSettings { method: settings.method, ..FitSettings::default() };
        let suits = checked.suited.resolve(&asked, &chosen);
        if let Ok(joined) = suits.with(&chosen, &self.edits.fit) {
            self.edits.fit = joined;
        }
        let taken = checked.suited.told(&FitSettings::default(), &settings);
        project.suited = Some(checked.suited);
        project.findings.clone_from(&checked.findings);
        project.timings = checked.timings;
        if chosen.is_empty() {
            self.history.restart(&self.edits);
        }
        self.tell_taken(&taken);
        self.note_findings(&checked.findings);
        self.prepare();
    }

    /// Makes atlas and tracer beside the window.
    fn prepare(&mut self) {
        let Some(project) = &self.project else { return };
        let Some(scene) = project.scene.clone() else { return };
        let (settings, kept) = (project.settings.clone(), self.kept.clone());
        let (findings, timings) = (project.findings.clone(), project.timings.clone());
        self.tasks.spawn(TaskKind::Preparing, move |context| {
            let tell = |stage: OpenStage, share: f32| context.tell(stage.label(), share);
            let prepared = prepare_with(scene, findings, &settings, timings, &kept, &context.stop, &tell)?;
            let atlas = Atlas::of(Arc::clone(&prepared.surface));
            let clipped_shares = clipped_shares(&prepared.scene, &prepared.surface);
            Ok(Done::Prepared(Box::new(PreparedScene { prepared, atlas, clipped_shares })))
        });
    }

    pub(super) fn scene_was_prepared(&mut self, done: PreparedScene) {
        let Some(project) = &mut self.project else { return };
        let known = project.findings.len();
        project.findings = done.prepared.findings;
        project.timings = done.prepared.timings;
        project.take_atlas(done.atlas);
        project.clipped_shares = done.clipped_shares;
        project.quality.clone_from(&done.prepared.quality);
        if let Some(quality) = &done.prepared.quality {
            self.log.note(format!(
                "UV atlas: {} islands, {:.0} % packed",
                quality.charts,
                100.0 * quality.share_of_area
            ));
        }
        let findings: Vec<Finding> = self.project.as_ref().map_or(Vec::new(), |own| own.findings[known..].to_vec());
        self.note_findings(&findings);
        self.lay_photos();
        self.cache_transport();
        if std::mem::take(&mut self.start_is_queued) {
            self.start_fit();
        }
    }

    pub(super) fn run_was_opened(&mut self, read: RunRead) {
        self.close();
        let RunRead { folder, run, atlas, thumbnails, clipped_shares } = read;
        self.note_findings(&run.findings);
        self.preferences.remember(folder.path(), true);
        self.keep_thumbnail(folder.path(), &thumbnails);
        self.edits.fit = run.settings.fit.clone();
        self.eye = OrbitEye::around(super::framing::subject(&atlas.mesh, run.scene.as_deref()));
        let views = run.scene.as_ref().map_or(0, |scene| scene.views.len());
        let environment = Arc::new(run.environment);
        self.shelf.put(ShelfLight::new(LightName::Fitted, Arc::clone(&environment)));
        if let Some(truth) = run.scene.as_ref().and_then(|scene| scene.truth.as_ref()) {
            self.shelf.put(ShelfLight::new(LightName::Truth, Arc::new(truth.environment.clone())));
        }
        let errors = run.report.as_ref().map(|report| view_errors(report, run.scene.as_deref()));
        self.fit.folder = Some(folder.clone());
        self.fit.losses = run.losses;
        self.fit.report = run.report.map(Arc::new);
        if self.fit.report.is_some() {
            self.fit.status = super::FitStatus::Finished;
        } else if run.can_resume {
            self.fit.status = super::FitStatus::Stopped;
        }
        let title = folder.path().file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let mut project = Project {
            title,
            path: Some(folder.path().into()),
            is_run: true,
            scene: run.scene,
            settings: run.settings,
            findings: run.findings,
            maps: Some(Arc::new(run.maps)),
            environment: Some(environment),
            times_seen: run.times_seen.map(Arc::new),
            known: super::known::Known::of(run.told),
            view_errors: errors.unwrap_or_else(|| vec![None; views]),
            clipped_shares,
            thumbnails,
            ..Project::default()
        };
        project.take_atlas(atlas);
        self.project = Some(project);
        self.history.restart(&self.edits);
        if self.fit.report.is_none() {
            self.log.note("This run is unfinished: Start resumes it from its checkpoint");
        }
        self.lay_photos();
        self.cache_transport();
    }

    /// Keeps a picture of what was opened for the first page: the photo in the middle, as bright as a screen wants it.
    fn keep_thumbnail(&self, path: &Path, thumbnails: &[Arc<RgbImage>]) {
        if let Some(middle) = thumbnails.get(thumbnails.len() / 2) {
            let factor = crate::image::histogram::auto_exposure(middle.as_ref()).exp2();
            self.store.keep_thumbnail(path, &middle.map(|radiance| *radiance * factor));
        }
    }

    /// Before there is a fitted light the stage is lit by the first light of the shelf.
    fn first_light(&mut self) {
        if self.shelf.find(&LightName::Fitted).is_none()
            && let Some(light) = self.shelf.lights().iter().find(|light| matches!(light.name, LightName::Sky(_)))
        {
            self.edits.relight.first = light.name.clone();
            self.light_was_chosen_for_us = Some(light.name.clone());
            self.history.restart(&self.edits);
        }
    }

    pub(super) fn note_findings(&mut self, findings: &[Finding]) {
        let open: Vec<&Finding> = findings.iter().filter(|finding| !self.edits.fit.do_what_is_asked(finding)).collect();
        for finding in &open {
            self.log.add(Message::from(*finding));
        }
        let warnings = open.iter().filter(|finding| finding.severity == Severity::Warning).count();
        if warnings > 0 {
            self.activate = Some(crate::studio::workspace::Panel::Messages);
        }
    }

    /// Forgets the place under the cursor unless it is pinned.
    pub fn move_cursor(&mut self, cursor: Option<Cursor>) {
        let pinned = self.cursor.is_some_and(|own| own.pinned);
        if !pinned {
            self.cursor = cursor;
        }
    }
}

impl SceneRead {
    fn new(path: Option<PathBuf>, settings: RunSettings, opened: OpenedScene) -> Self {
        let OpenedScene { scene, timings, .. } = opened;
        let mut mesh = scene.mesh.clone();
        if mesh.normals.len() != mesh.positions.len() {
            mesh.compute_normals();
        }
        let thumbnails = small_pictures(&scene);
        SceneRead { path, suited: None, settings, scene: Arc::new(scene), mesh: Arc::new(mesh), timings, thumbnails }
    }
}

impl RunRead {
    fn new(folder: RunFolder, run: OpenedRun) -> Self {
        let atlas = Atlas::of(Arc::clone(&run.surface));
        let thumbnails = run.scene.as_deref().map(small_pictures).unwrap_or_default();
        let of_rays = |scene: &Scene| clipped_shares(scene, &run.surface);
        let clipped_shares = run.scene.as_deref().map(of_rays).unwrap_or_default();
        RunRead { folder, run, atlas, thumbnails, clipped_shares }
    }
}

/// A small picture of each photo.
fn small_pictures(scene: &Scene) -> Vec<Arc<RgbImage>> {
    let small = |view: &crate::scene::View| {
        let (photo, size) = (&view.photo, (view.photo.width(), view.photo.height()));
        Arc::new(crate::image::area::thumbnail_of(size, |row, column| photo.radiance(row, column), THUMBNAIL_SIDE))
    };
    parallel::map_items(&scene.views, small)
}

/// The share of clipped pixels among those whose rays meet the surface, of each photo: without a mask only rays tell the
/// object from a bright sky. Looks at a grid of pixels.
fn clipped_shares(scene: &Scene, surface: &Surface) -> Vec<f32> {
    let of_view = |view: &crate::scene::View| {
        let states = &view.states;
        let every = (states.width().min(states.height()) / LOOKED_AT_A_SIDE).max(1);
        let (mut met, mut clipped) = (0usize, 0usize);
        for row in (every / 2..states.height()).step_by(every) {
            for column in (every / 2..states.width()).step_by(every) {
                let state = states[(row, column)];
                let place = glam::Vec2::new(column as f32 + 0.5, row as f32 + 0.5);
                if state.is_surface() && surface.closest(&view.camera.ray_through(place)).is_some() {
                    met += 1;
                    clipped += usize::from(state.is_clipped());
                }
            }
        }
        clipped as f32 / met.max(1) as f32
    };
    parallel::map_items(&scene.views, of_view)
}

/// Root mean square errors of a report, in the order of a scene's views.
fn view_errors(report: &crate::insight::report::ReportData, scene: Option<&Scene>) -> Vec<Option<f32>> {
    let Some(scene) = scene else { return Vec::new() };
    let of = |name: &str| report.views.iter().find(|line| line.name == name).map(|line| line.raw.rmse_linear as f32);
    scene.views.iter().map(|view| of(&view.name)).collect()
}
