//! What was read, checked and prepared becomes the project, and each step shows what it brought.

use super::lights::{LightName, ShelfLight};
use super::log::Message;
use super::opened::{PreparedScene, RunRead, SceneChecked, SceneRead, clipped_shares};
use super::project::Atlas;
use super::tasks::TaskKind;
use super::{Done, Model, Project};
use crate::error::{Finding, Severity};
use crate::fit::{FitSettings, Suited};
use crate::image::RgbImage;
use crate::job::open::{self, OpenStage};
use crate::job::prepare::prepare_with;
use crate::scene::Scene;
use crate::studio::stage::eye::OrbitEye;
use crate::studio::workspace::Panel;
use std::path::Path;
use std::sync::Arc;

impl Model {
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
            self.activate = Some(Panel::Messages);
        }
    }
}

/// Root mean square errors of a report, in the order of a scene's views.
fn view_errors(report: &crate::insight::report::ReportData, scene: Option<&Scene>) -> Vec<Option<f32>> {
    let Some(scene) = scene else { return Vec::new() };
    let of = |name: &str| report.views.iter().find(|line| line.name == name).map(|line| line.raw.rmse_linear as f32);
    scene.views.iter().map(|view| of(&view.name)).collect()
}
