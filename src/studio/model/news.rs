//! What tasks and the job have brought since the last frame is taken in.

use super::lights::{LightName, ShelfLight};
use super::tasks::TaskKind;
use super::{Done, FitStatus, Model, known};
use crate::light::Environment;
use crate::material::MaterialMaps;
use std::path::PathBuf;
use std::sync::Arc;

impl Model {
    /// Takes in what tasks and the job brought. True when something changed.
    pub fn poll(&mut self) -> bool {
        let (mut changed, mut is_another_scene) = (false, false);
        for (kind, outcome) in self.tasks.finished() {
            changed = true;
            if is_another_scene && kind.is_of_scene() {
                // It ended in the same moment, and is of the scene that was open before.
                continue;
            }
            is_another_scene |= matches!(outcome, Ok(Done::SceneRead(_) | Done::RunOpened(_)));
            match outcome {
                Ok(done) => {
                    // What failed before has worked now.
                    self.log.worked(&kind);
                    self.take_in(done);
                }
                Err(error) => {
                    if matches!(kind, TaskKind::Checking | TaskKind::Preparing) {
                        self.start_is_queued = false;
                    }
                    match error.kind() {
                        crate::ErrorKind::Stopped => self.log.note(format!("Cancelled: {}", kind.words())),
                        _ => {
                            self.log.error_of(&error, &kind);
                            self.forget_light(&kind);
                        }
                    }
                }
            }
        }
        let was_live = self.fit.status.is_live();
        changed |= self.fit.poll(&mut self.log);
        self.card |= was_live && self.fit.status == FitStatus::Finished;
        if let Some(shown) = self.fit.advance.learned_pace() {
            let known = &mut self.preferences.machine_pace;
            *known = Some(known.map_or(shown, |before| before.towards(shown)));
        }
        changed |= self.poll_object();
        changed |= self.poll_queue();
        self.take_back_refused();
        self.remember_run();
        changed
    }

    fn take_in(&mut self, done: Done) {
        match done {
            Done::SceneRead(read) => self.scene_was_read(*read),
            Done::SceneChecked(checked) => self.scene_was_checked(*checked),
            Done::Prepared(prepared) => self.scene_was_prepared(*prepared),
            Done::Rescaled(rescaled) => self.run_was_rescaled(*rescaled),
            Done::Exported(exported) => self.run_was_exported(*exported),
            Done::PhotosLaid(laid) => self.photos_were_laid(*laid),
            Done::TransportCached(cached) => self.transport_was_cached(*cached),
            Done::RunOpened(run) => self.run_was_opened(*run),
            Done::OtherRun(other) => self.other_was_read(*other),
            Done::FitStarted(started) => self.fit_was_started(*started),
            Done::LightRead(light, noticed) => {
                self.note_findings(&noticed);
                if let LightName::File(path) = &light.name
                    && !self.preferences.lights.contains(path)
                {
                    self.preferences.lights.push(path.clone());
                }
                self.log.note(format!("{} was added to the environments", light.name.label()));
                if matches!((&light.name, &self.light_to_choose), (LightName::File(own), Some(path)) if own == path) {
                    self.light_to_choose = None;
                    self.choose_light(light.name.clone());
                }
                self.shelf.put(*light);
            }
            Done::Picked(_, None) => {}
            Done::Picked(purpose, Some(path)) => self.picked(purpose, path),
            Done::Saved(paths, seconds_per_path) => {
                if let Some(own) = seconds_per_path {
                    self.preferences.seconds_per_path = Some(own).filter(|own| own.is_finite() && *own > 0.0);
                }
                let Some(first) = paths.first() else { return };
                let text = match paths.len() {
                    1 => format!("Saved {}", first.display()),
                    count => format!("Saved {count} images, the first is {}", first.display()),
                };
                self.log.note_of_file(text, first);
            }
            Done::Layers(maps, layers) => self.layers_were_measured(&maps, *layers),
            Done::Strip(pictures) => {
                if let Some(project) = &mut self.project {
                    project.strip = pictures;
                }
            }
            Done::Entangled(table) => {
                if let Some(project) = &mut self.project {
                    project.entanglement = Some(Arc::from(table));
                }
            }
            Done::ObjectRelit(relit) => self.object.relit = relit,
            Done::ObjectOpened(opened) => self.object_was_opened(*opened),
            Done::ObjectSaved(folder) => self.object_was_saved(folder),
            Done::MaterialsDrawn(library, pictures) => self.materials_were_drawn(library, pictures),
            Done::MaterialOpened(tile) => self.material_was_opened(tile),
            Done::MaterialShown(shown) => self.materials.shown = Some(Arc::from(shown)),
        }
    }

    /// The newest snapshot becomes what the panels show; whether it is another than before.
    pub fn take_snapshot(&mut self) -> bool {
        let (Some(project), Some(snapshot)) = (&mut self.project, &self.fit.snapshot) else { return false };
        if snapshot.step == 0 && project.maps.is_none() {
            // Start values are nothing that was found: the photos stay until there is something.
            return false;
        }
        let is_shown = project.environment.as_ref().is_some_and(|own| Arc::ptr_eq(own, &snapshot.environment));
        if is_shown || self.timeline.has_newest(&snapshot.environment) {
            return false;
        }
        self.timeline.keep(snapshot);
        if self.timeline.shown().is_none() {
            self.show_newest();
        }
        true
    }

    /// The panels show the newest snapshot.
    pub(super) fn show_newest(&mut self) {
        let (Some(project), Some(snapshot)) = (&mut self.project, &self.fit.snapshot) else { return };
        project.view_errors.clone_from(&snapshot.view_rmse);
        project.known = known::Known::of(snapshot.told.clone());
        self.show_maps(Arc::clone(&snapshot.maps), Arc::clone(&snapshot.environment));
    }

    /// The panels show these maps under this light.
    pub(super) fn show_maps(&mut self, maps: Arc<MaterialMaps>, environment: Arc<Environment>) {
        let Some(project) = &mut self.project else { return };
        (project.maps, project.environment) = (Some(maps), Some(Arc::clone(&environment)));
        // What was measured on other maps no longer holds.
        (project.photo_error, project.disagreement) = (None, None);
        self.shelf.put(ShelfLight::new(LightName::Fitted, environment));
        if self.light_was_chosen_for_us.take().is_some_and(|sky| self.edits.relight.first == sky) {
            self.edits.relight.first = LightName::Fitted;
            self.history.restart(&self.edits);
        }
    }

    /// Keeps the run in progress in the remembered settings, so that a start after a crash finds it.
    fn remember_run(&mut self) {
        let running = self.fit.status.is_live().then(|| self.fit.folder.as_ref().map(|folder| folder.path().into()));
        let running: Option<PathBuf> = running.flatten();
        if self.preferences.running != running {
            self.preferences.running = running;
            self.write_preferences();
        }
    }
}
