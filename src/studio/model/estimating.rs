//! From what is asked to a job, from its result to relit pictures, and from a dropped file to what is asked.

use super::lights::LightName;
use super::log::Message;
use super::object::RelitObject;
use super::object_form::{ObjectForm, is_photo};
use super::tasks::TaskKind;
use super::{Done, Model};
use crate::error::{Error, ErrorKind, Place};
use crate::export::run_folder::new_run_folder;
use crate::files::unrepeated;
use crate::job::object::{self, ObjectJobOptions, ObjectOutcome, ObjectRequest, ReopenedObject};
use crate::light::Environment;
use crate::object::inputs::ObjectInputs;
use crate::object::settings::LightsOf;
use crate::studio::workspace::Workspace;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Lights that are written into a result folder, at most.
const MOST_RELIGHTS: usize = 8;

impl Model {
    /// Opens a result folder and shows it in object mode. While an estimation runs or waits to be saved, it is left alone.
    pub fn open_object(&mut self, folder: PathBuf) {
        self.workspace = Workspace::Object;
        let is_unsaved = self.object.outcome.as_ref().is_some_and(|own| own.folder.is_none());
        if self.object.status.is_live() || is_unsaved {
            let why = if is_unsaved { "the last result is not on disk yet" } else { "an estimation is running" };
            return self.log.error(
                &Error::new(ErrorKind::Unsupported, format!("the result was not opened: {why}"))
                    .at(Place::File(folder))
                    .remedy("stop the estimation or save its result, then open this one again"),
            );
        }
        self.log.dismiss();
        let folder = std::path::absolute(&folder).unwrap_or(folder);
        self.tasks.spawn(TaskKind::OpeningResult, move |context| {
            context.tell("reading the result", 0.0);
            Ok(Done::ObjectOpened(Box::new(object::reopen(&folder)?)))
        });
    }

    pub(super) fn object_was_opened(&mut self, opened: ReopenedObject) {
        for finding in &opened.findings {
            self.log.add(Message::from(finding));
        }
        let inputs = opened.outcome.parts.inputs.clone();
        let files = inputs.files;
        let mut form = ObjectForm {
            photos: files.photos,
            masks: files.masks,
            is_sphere: files.mesh.is_none() && files.normals.is_empty(),
            mesh: files.mesh.map(|mesh| mesh.display().to_string()).unwrap_or_default(),
            cameras: files.cameras,
            normals: files.normals,
            light: inputs
                .light
                .as_ref()
                .or(inputs.probes.first())
                .map_or(String::new(), |own| own.display().to_string()),
            model: inputs.model,
            lobes: inputs.lobes,
            ..ObjectForm::default()
        };
        if !form.take_settings(&opened.outcome.parts.settings) || inputs.probes.len() > 1 {
            self.log.note("Some settings of the result are not in this form: another estimation uses the defaults");
        }
        self.edits.object = form;
        self.history.restart(&self.edits);
        self.object.show(opened);
        if let Some(folder) = self.object.outcome.as_ref().and_then(|outcome| outcome.folder.clone()) {
            self.preferences.remember(&folder, true);
            self.log.note(format!("Opened {}", folder.display()));
        }
        self.relight_object();
    }

    /// Starts an estimation of what is asked for.
    pub fn start_object(&mut self) {
        let form = &self.edits.object;
        let files = match form.files() {
            Ok(files) => files,
            Err(error) => return self.log.error(&error),
        };
        let stem = files.photos.first().and_then(|photo| photo.file_stem()).unwrap_or_default().to_string_lossy();
        let output = new_run_folder(&self.runs_folder(), &format!("object {stem}"));
        let settings = form.settings();
        let light = form.light.trim();
        let known: Option<PathBuf> = (!light.is_empty()).then(|| light.into());
        let has_each = settings.lights == LightsOf::Each;
        let (light, probes) = if has_each { (None, known.into_iter().collect()) } else { (known, Vec::new()) };
        let inputs = ObjectInputs { files, light, probes, model: form.model, lobes: form.lobes, weights: None };
        let request = ObjectRequest { inputs, relights: self.named_lights(), output, settings: settings.clone() };
        let options = ObjectJobOptions {
            wake: Some(Arc::clone(&self.wake)),
            after_round: self.after_round.clone().map(|own| Box::new(move |round| own(round)) as _),
        };
        match object::start(request, options) {
            Ok(job) => {
                self.tasks.stop(&TaskKind::RelightingObject);
                self.log.dismiss();
                self.object.begin(job, settings.outer_loops);
            }
            Err(error) => self.log.error(&error),
        }
    }

    /// Lights of the shelf that are none of a scene's, with names that suit files.
    fn named_lights(&self) -> Vec<(String, Arc<Environment>)> {
        let own = self.shelf.lights().iter().filter(|light| is_free(&light.name)).take(MOST_RELIGHTS);
        let safe =
            |name: String| -> String { name.chars().map(|c| if c.is_alphanumeric() { c } else { '_' }).collect() };
        let (names, lights): (Vec<String>, Vec<Arc<Environment>>) =
            own.map(|light| (safe(light.name.label()), Arc::clone(&light.environment))).unzip();
        // Files of one name from two folders are two lights.
        unrepeated(&names).into_iter().zip(lights).collect()
    }

    /// Takes in what the estimation told; a new result is shown under the lights of the shelf.
    pub(super) fn poll_object(&mut self) -> bool {
        let (changed, came) = self.object.poll(&mut self.log);
        if came {
            if let Some(folder) = self.object.outcome.as_ref().and_then(|outcome| outcome.folder.clone()) {
                self.preferences.remember(&folder, true);
            }
            self.relight_object();
        }
        changed
    }

    /// Shows object and sphere under every light of the shelf, each brought to the brightness of the estimated one.
    pub fn relight_object(&mut self) {
        let Some(outcome) = self.object.outcome.clone() else { return };
        let lights: Vec<(LightName, Arc<Environment>)> = self
            .shelf
            .lights()
            .iter()
            .filter(|light| is_free(&light.name))
            .map(|light| (light.name.clone(), Arc::clone(&light.environment)))
            .collect();
        self.tasks.stop(&TaskKind::RelightingObject);
        self.tasks.spawn(TaskKind::RelightingObject, move |context| {
            let maps: Vec<&Environment> = lights.iter().map(|(_, light)| light.as_ref()).collect();
            context.tell("the object", 0.0);
            // Without its photos there is no object to show.
            let pictures = outcome.parts.relit(&maps);
            let mut relit = Vec::new();
            for (index, ((name, light), picture)) in lights.iter().zip(pictures).enumerate() {
                context.check()?;
                context.tell("spheres", index as f32 / lights.len() as f32);
                let sphere = object::look::sphere_of(&outcome.parts.reflectance(), 96, Some(light));
                let factor = crate::image::histogram::auto_exposure(&picture).exp2();
                relit.push(RelitObject {
                    name: name.clone(),
                    object: Arc::new(picture.map(|rgb| *rgb * factor)),
                    sphere: Arc::new(sphere),
                });
            }
            Ok(Done::ObjectRelit(relit))
        });
    }

    /// Writes the result once more, to a folder of a person's choice.
    pub fn save_object(&mut self, folder: PathBuf) {
        let Some(outcome) = self.object.outcome.clone() else { return };
        let relights = self.named_lights();
        self.tasks.spawn(TaskKind::SavingResult, move |_| {
            outcome.parts.write(&folder, &relights)?;
            Ok(Done::ObjectSaved(folder))
        });
    }

    pub(super) fn object_was_saved(&mut self, folder: PathBuf) {
        self.log.note(format!("Saved {}", folder.display()));
        if let Some(outcome) = &mut self.object.outcome
            && outcome.folder.is_none()
        {
            *outcome = Arc::new(ObjectOutcome { folder: Some(folder), ..(**outcome).clone() });
        }
    }

    /// Takes in a file that was dropped on object mode, by its ending and its name.
    pub fn object_dropped(&mut self, path: &Path) {
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default();
        let name = path.file_stem().unwrap_or_default().to_string_lossy().to_lowercase();
        let form = &mut self.edits.object;
        let what = match ending.as_str() {
            "obj" | "ply" => {
                (form.mesh, form.is_sphere) = (path.display().to_string(), false);
                form.normals.clear();
                "the mesh"
            }
            "json" | "txt" => {
                form.cameras.push(path.into());
                form.is_sphere = false;
                "a camera file"
            }
            "hdr" => return self.add_light(path.into()),
            _ if is_photo(path) && name.contains("mask") => {
                form.masks.push(path.into());
                "a mask"
            }
            _ if is_photo(path) => {
                form.photos.push(path.into());
                "a photo of the object"
            }
            _ => return self.open(path.into()),
        };
        self.log.note(format!("Taken as {what}: {}", path.display()));
    }
}

/// Whether a light is none of a scene's: built in, or of a file.
pub fn is_free(name: &LightName) -> bool {
    matches!(name, LightName::Sky(_) | LightName::Day | LightName::File(_))
}
