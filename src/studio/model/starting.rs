//! From a project to a fit, and settings that change on the way.

use super::laid::BeingCached;
use super::tasks::TaskKind;
use super::{Done, FitStatus, Model, store};
use crate::error::Result;
use crate::export::RunFolder;
use crate::export::run_folder::new_run_folder;
use crate::fit::{FitSettings, Fitter};
use crate::job::open::{self, OpenStage};
use crate::job::prepare::{Prepared, RunSettings, prepare_with};
use crate::job::{self, Command, JobHandle, JobOptions, background};
use crate::render::Surface;
use crate::studio::workspace::Panel;
use std::path::PathBuf;
use std::sync::Arc;

/// A job that was started.
pub struct Started {
    job: JobHandle,
    folder: RunFolder,
    settings: FitSettings,
    surface: Arc<Surface>,
    /// Whether it goes on from a checkpoint, and its curve with it.
    goes_on: bool,
}

impl Started {
    fn new(
        prepared: Prepared,
        fitter: Fitter,
        settings: RunSettings,
        folder: RunFolder,
        options: JobOptions,
    ) -> Result<Self> {
        let (fit, surface) = (settings.fit.clone(), Arc::clone(&prepared.surface));
        let job = job::start_with(prepared, fitter, settings, folder.clone(), options)?;
        Ok(Started { job, folder, settings: fit, surface, goes_on: false })
    }
}

impl Model {
    /// The folder into which new runs go.
    pub fn runs_folder(&self) -> PathBuf {
        match self.preferences.runs_folder.as_os_str().is_empty() {
            true => store::usual_runs_folder(),
            false => self.preferences.runs_folder.clone(),
        }
    }

    /// Starts a fit of what is open, or goes on with one from its checkpoint.
    pub fn start_fit(&mut self) {
        if self.project.as_ref().is_some_and(|project| project.surface.is_none()) && self.is_preparing() {
            self.start_is_queued = true;
            return self.log.note("The fit starts automatically when the scene is ready");
        }
        match self.fit.folder.clone().filter(|_| self.can_resume()) {
            Some(folder) => self.go_on_with(folder),
            None => self.start_anew(),
        }
    }

    /// Starts a fit of what is open in a new run, with the settings as they are. A checkpoint of the run before stays.
    pub fn start_anew(&mut self) {
        let Some(project) = &self.project else { return };
        let (Some(scene), Some(surface)) = (project.scene.clone(), project.surface.clone()) else { return };
        scene.spell_names(&mut self.edits.fit.exclude);
        let mut settings = project.settings.clone();
        settings.fit = self.edits.fit.clone();
        let path = new_run_folder(&self.runs_folder(), &project.title);
        let (findings, timings, quality) = (project.findings.clone(), project.timings.clone(), project.quality.clone());
        // The atlas keeps its charts apart at the size it was made for; other map sizes need another atlas.
        let same_atlas = project.settings.fit.map_size == settings.fit.map_size || project.is_run;
        let (options, kept) = (self.job_options(), self.kept.clone());
        let cached = project.transport.clone().filter(|own| Arc::ptr_eq(&own.surface, &surface));
        let cached = cached.map(|own| own.transport());
        // Two that trace the same beside each other are twice as slow.
        let is_first = |own: &BeingCached| same_atlas && own.is_first_of(&surface, &settings.fit);
        let being_cached = self.being_cached.take_if(|own| cached.is_none() && is_first(own));
        self.tasks.spawn(TaskKind::Starting, move |context| {
            let folder = RunFolder::create(&path)?;
            let tell = |stage: OpenStage, share: f32| context.tell(stage.label(), share);
            let prepared = match same_atlas {
                true => Prepared { scene, surface, quality, findings, timings },
                false => prepare_with(scene, findings, &settings, timings, &kept, &context.stop, &tell)?,
            };
            let (prepared, mut fitter, settings) = open::begin(prepared, settings, &context.stop, &tell)?;
            let wait = || {
                context.tell("Caching light transport", 0.9);
                being_cached.and_then(|own| own.wait(&context.stop))
            };
            if let Some(transport) = cached.filter(|_| same_atlas).or_else(wait) {
                fitter.take_transport(transport);
            }
            context.check()?;
            let started = Started::new(prepared, fitter, settings, folder, options)?;
            Ok(Done::FitStarted(Box::new(started)))
        });
    }

    /// Stops the fit, or takes it back where it has not begun.
    pub fn stop_fit(&mut self) {
        if std::mem::take(&mut self.start_is_queued) {
            return self.log.note("The fit is no longer queued");
        }
        if self.tasks.is_running(&TaskKind::Starting) {
            self.tasks.stop(&TaskKind::Starting);
            return self.log.note("The fit does not start");
        }
        self.fit.stop();
    }

    /// What the next job is given.
    fn job_options(&self) -> JobOptions {
        let before_step = self.before_step.clone();
        let before_step = before_step.map(|hook| Box::new(move |step| hook(step)) as Box<dyn FnMut(usize) + Send>);
        JobOptions {
            wake: Some(Arc::clone(&self.wake)),
            pool: background::pool("patina-fit"),
            before_step,
            budget: None,
            machine_pace: self.preferences.machine_pace.unwrap_or_default(),
        }
    }

    fn go_on_with(&mut self, folder: RunFolder) {
        let (options, kept) = (self.job_options(), self.kept.clone());
        let wanted = self.edits.fit.clone();
        self.tasks.spawn(TaskKind::Starting, move |context| {
            let tell = |stage: OpenStage, share: f32| context.tell(stage.label(), share);
            let (prepared, mut fitter, mut settings) = open::resume_with(&folder, None, &kept, &context.stop, &tell)?;
            if settings.fit != wanted {
                // What was changed while the fit stood still takes effect, as far as it can.
                fitter.change(wanted)?;
                settings.fit = fitter.settings().clone();
            }
            let started = Started::new(prepared, fitter, settings, folder, options)?;
            Ok(Done::FitStarted(Box::new(Started { goes_on: true, ..started })))
        });
    }

    pub(super) fn fit_was_started(&mut self, started: Started) {
        let Started { job, folder, settings, surface, goes_on } = started;
        // What is still being measured is of the maps before.
        for kind in [TaskKind::Residuals, TaskKind::NovelLighting, TaskKind::ContactSheet] {
            self.tasks.stop(&kind);
        }
        let mut is_other_atlas = false;
        if let Some(project) = &mut self.project {
            if project.surface.as_ref().is_none_or(|own| !Arc::ptr_eq(own, &surface)) {
                // The atlas was made anew for another size of the maps.
                project.take_surface(surface);
                is_other_atlas = true;
                if !goes_on {
                    // What is known of texels is known of those of the atlas before.
                    (project.times_seen, project.coverage) = (None, None);
                    (project.photo_error, project.disagreement) = (None, None);
                }
            }
            project.settings.fit = settings.clone();
            project.entanglement = None;
            project.strip.clear();
        }
        if is_other_atlas {
            self.lay_photos();
            self.cache_transport();
        }
        if !goes_on {
            // Only now: a start that fails leaves the curve and the scores of the run before.
            self.fit.losses.clear();
            self.timeline = super::timeline::Timeline::default();
        }
        self.preferences.remember(folder.path(), true);
        // A failure of the fit before is past.
        self.log.dismiss();
        self.log.note_of_file(format!("Output folder: {}", folder.path().display()), folder.path());
        self.fit.begin(job, folder, settings);
        self.activate = Some(Panel::Curves);
    }

    /// Sends settings that were changed to the running fit, once nothing moves any more.
    pub fn send_changed_settings(&mut self, context: &egui::Context) {
        let Some(in_force) = &self.fit.settings_in_force else { return };
        if *in_force == self.edits.fit
            || !matches!(self.fit.status, FitStatus::Running | FitStatus::Pausing | FitStatus::Paused)
        {
            return;
        }
        let moving = context.input(|input| input.pointer.any_down()) || context.text_edit_focused();
        if moving || self.edits.fit.validate().is_err() {
            return;
        }
        if let Some(scene) = self.project.as_ref().and_then(|project| project.scene.as_ref()) {
            scene.spell_names(&mut self.edits.fit.exclude);
        }
        let wanted = self.edits.fit.clone();
        // Taken as sent: if the worker refuses, what it said last comes back.
        self.fit.settings_in_force = Some(wanted.clone());
        self.fit.changes_sent += 1;
        self.fit.send(Command::Change(Box::new(wanted)));
    }

    /// Puts the form back to what is in force after the worker refused a change. While another change is on its way, that
    /// one decides.
    pub(super) fn take_back_refused(&mut self) {
        if !self.fit.was_refused || self.fit.changes_sent > 0 {
            return;
        }
        self.fit.was_refused = false;
        if let Some(confirmed) = self.fit.settings_confirmed.clone() {
            self.fit.settings_in_force = Some(confirmed.clone());
            self.edits.fit = confirmed;
        }
    }
}
