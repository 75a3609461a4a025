//! Object mode as the window knows it: what is asked, the job, what it told.

use super::lights::LightName;
use super::log::{Log, Message, capitalised};
use super::{Done, Model, store};
use crate::error::{Error, ErrorKind, Place, Result};
use crate::image::{GreyImage, RgbImage};
use crate::job::object::{
    self, MaterialLook, ObjectJob, ObjectJobOptions, ObjectLook, ObjectNews, ObjectOutcome, ObjectRequest, PhotoSeen,
};
use crate::light::Environment;
use crate::object::prior::LightPriorKind;
use crate::object::progress::ObjectiveRow;
use crate::object::read::ObjectFiles;
use crate::object::settings::ObjectSettings;
use crate::object::starts::ModelKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Title of the task that shows the object under the lights of the shelf.
pub const RELIGHT_TITLE: &str = "Relighting the object";
/// Lights that are written into a result folder, at most.
const MOST_RELIGHTS: usize = 8;

/// How much is done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Effort {
    /// A coarse light, few pixels and few rounds.
    Quick,
    /// What the program takes by itself.
    #[default]
    Usual,
    /// The schedule released with the paper.
    Released,
}

impl Effort {
    /// All of them with their names and what they mean.
    pub const NAMED: [(Effort, &str, &str); 3] = [
        (Effort::Quick, "Quick", "A light of 32 rows, 1024 pixels, 6 rounds: a first look"),
        (Effort::Usual, "Usual", "A light of 64 rows, 2048 pixels, 8 rounds"),
        (Effort::Released, "As released", "The schedule released with the paper; takes long"),
    ];

    /// Its settings.
    pub fn settings(self) -> ObjectSettings {
        match self {
            Effort::Quick => ObjectSettings::quick(),
            Effort::Usual => ObjectSettings::default(),
            Effort::Released => ObjectSettings::released(),
        }
    }
}

/// What an estimation is asked for; undo covers it.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjectForm {
    /// Photos of one object under one light.
    pub photos: Vec<PathBuf>,
    /// One mask a photo, or none.
    pub masks: Vec<PathBuf>,
    /// Whether the object is a sphere that fills the photo.
    pub is_sphere: bool,
    /// The mesh otherwise; may be empty.
    pub mesh: String,
    /// Its cameras.
    pub cameras: Vec<PathBuf>,
    /// The light, where it is known; empty where it is estimated.
    pub light: String,
    /// Model of the reflectance.
    pub model: ModelKind,
    /// Lobes of the neural model.
    pub lobes: usize,
    /// Prior of the light.
    pub prior: LightPriorKind,
    /// How much is done.
    pub effort: Effort,
    /// Rows of the estimated light, where it is another number than the effort's: 16, 32, 64 or 128.
    pub light_rows: Option<usize>,
    /// Pixels that are used, likewise.
    pub pixels: Option<usize>,
    /// Whether the object shadows itself.
    pub shadows: bool,
    /// Seed of pixels and net.
    pub seed: u64,
}

impl Default for ObjectForm {
    fn default() -> Self {
        ObjectForm {
            photos: Vec::new(),
            masks: Vec::new(),
            is_sphere: true,
            mesh: String::new(),
            cameras: Vec::new(),
            light: String::new(),
            model: ModelKind::default(),
            lobes: 2,
            prior: LightPriorKind::default(),
            effort: Effort::default(),
            light_rows: None,
            pixels: None,
            shadows: true,
            seed: 1,
        }
    }
}

impl ObjectForm {
    /// The settings that are asked for.
    pub fn settings(&self) -> ObjectSettings {
        let own = self.effort.settings();
        ObjectSettings {
            prior: self.prior,
            shadows: self.shadows,
            seed: self.seed,
            light_height: self.light_rows.unwrap_or(own.light_height),
            pixels: self.pixels.unwrap_or(own.pixels),
            ..own
        }
    }

    /// The files that are asked for.
    ///
    /// # Errors
    /// `Missing` without a photo, or without a mesh where the object is one.
    pub fn files(&self) -> Result<ObjectFiles> {
        let missing = |setting: &str, message: &str, remedy: &str| {
            Err(Error::new(ErrorKind::Missing, message).at(Place::Setting(setting.into())).remedy(remedy))
        };
        if self.photos.is_empty() {
            return missing("photos", "no photo is named", "add a photo, or drop one on the window");
        }
        let mesh = self.mesh.trim();
        if !self.is_sphere && mesh.is_empty() {
            return missing("mesh", "no mesh is named", "name an OBJ or PLY file, or take the object for a sphere");
        }
        Ok(ObjectFiles {
            photos: self.photos.clone(),
            masks: self.masks.clone(),
            mesh: (!self.is_sphere).then(|| mesh.into()),
            cameras: if self.is_sphere { Vec::new() } else { self.cameras.clone() },
            ..ObjectFiles::default()
        })
    }
}

/// In which state the estimation is.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum ObjectStatus {
    /// None was started.
    #[default]
    Idle,
    /// It works.
    Running,
    /// It was asked to stop and writes what it has.
    Stopping,
    /// Everything is done.
    Finished,
    /// It ended early; what it reached is kept.
    Ended,
    /// It ended with nothing.
    Failed(String),
}

impl ObjectStatus {
    /// Whether a thread works on it.
    pub fn is_live(&self) -> bool {
        matches!(self, ObjectStatus::Running | ObjectStatus::Stopping)
    }

    /// The state in a word or two.
    pub fn words(&self) -> &'static str {
        match self {
            ObjectStatus::Idle => "Nothing estimated yet",
            ObjectStatus::Running => "Estimating",
            ObjectStatus::Stopping => "Stopping",
            ObjectStatus::Finished => "Finished",
            ObjectStatus::Ended => "Ended early",
            ObjectStatus::Failed(_) => "Failed",
        }
    }
}

/// The object under a light of the shelf.
#[derive(Clone, Debug)]
pub struct RelitObject {
    /// The light.
    pub name: LightName,
    /// The object of the first photo, exposed for a display at 0 stops.
    pub object: Arc<RgbImage>,
    /// A sphere of the estimated reflectance, likewise.
    pub sphere: Arc<RgbImage>,
}

/// The estimation.
#[derive(Default)]
pub struct ObjectControl {
    job: Option<ObjectJob>,
    /// The state.
    pub status: ObjectStatus,
    /// What is done now, in words.
    pub stage: String,
    /// The photos.
    pub photos: Vec<PhotoSeen>,
    /// The photo that is shown.
    pub chosen_photo: usize,
    /// The objective after each step.
    pub rows: Vec<ObjectiveRow>,
    /// Rounds that were asked for.
    pub rounds: usize,
    /// What was noticed.
    pub findings: Vec<crate::error::Finding>,
    look_number: u64,
    /// The newest look.
    pub look: Option<Arc<ObjectLook>>,
    /// The result.
    pub outcome: Option<Arc<ObjectOutcome>>,
    /// The object under the lights of the shelf.
    pub relit: Vec<RelitObject>,
}

impl ObjectControl {
    /// Takes over a job that was just started.
    fn begin(&mut self, job: ObjectJob, rounds: usize) {
        *self = ObjectControl { job: Some(job), status: ObjectStatus::Running, rounds, ..ObjectControl::default() };
    }

    /// Asks the job to end.
    pub fn stop(&mut self) {
        if let Some(job) = &self.job
            && self.status == ObjectStatus::Running
        {
            job.stop();
            self.status = ObjectStatus::Stopping;
        }
    }

    /// Asks the job to end and waits for it.
    pub fn stop_and_wait(&mut self) {
        if let Some(job) = self.job.take() {
            job.stop();
            job.join();
        }
    }

    /// Takes in what the job told. True when something changed; the second is true when a result came.
    pub fn poll(&mut self, log: &mut Log) -> (bool, bool) {
        let Some(job) = &self.job else { return (false, false) };
        let news: Vec<ObjectNews> = job.news.try_iter().collect();
        let mut changed = !news.is_empty();
        if let Some((number, look)) = job.looks.newest()
            && number > self.look_number
        {
            (self.look_number, self.look) = (number, Some(look));
            changed = true;
        }
        let mut came = false;
        for item in news {
            came |= self.take_in(item, log);
        }
        if !self.status.is_live() {
            self.job = None;
        }
        (changed, came)
    }

    fn take_in(&mut self, news: ObjectNews, log: &mut Log) -> bool {
        match news {
            ObjectNews::Stage(stage) => self.stage = capitalised(&stage),
            ObjectNews::Read(photos) => self.photos = photos,
            ObjectNews::Row(row) => self.rows.push(row),
            ObjectNews::Finding(finding) => {
                log.add(Message::from(&finding));
                self.findings.push(finding);
            }
            ObjectNews::Trouble(error) => log.error(&error),
            ObjectNews::Finished(outcome) => {
                log.note(told(&outcome));
                (self.status, self.outcome) = (ObjectStatus::Finished, Some(Arc::from(outcome)));
                return true;
            }
            ObjectNews::Ended(None) => {
                log.note("The estimation was stopped before its first round: there is nothing to keep");
                self.status = ObjectStatus::Ended;
            }
            ObjectNews::Ended(Some(outcome)) => {
                log.note(told(&outcome));
                (self.status, self.outcome) = (ObjectStatus::Ended, Some(Arc::from(outcome)));
                return true;
            }
            ObjectNews::Failed(error) => {
                self.status = ObjectStatus::Failed(error.message().into());
                log.error(&error);
            }
        }
        false
    }

    /// Re-render and error of the photo that is shown, as far as they are known.
    pub fn pictures(&self) -> Option<(Arc<RgbImage>, Arc<GreyImage>)> {
        let index = self.chosen_photo;
        if let Some(outcome) = &self.outcome
            && let (Some(picture), Some(error)) = (outcome.rerenders.get(index), outcome.log_errors.get(index))
        {
            return Some((Arc::clone(picture), Arc::clone(error)));
        }
        let look = self.look.as_ref().filter(|_| index == 0)?;
        Some((Arc::clone(&look.rerender), Arc::clone(&look.log_error)))
    }

    /// The newest reflectance.
    pub fn material(&self) -> Option<Arc<MaterialLook>> {
        let whole = self.outcome.as_ref().map(|outcome| Arc::clone(&outcome.material));
        whole.or_else(|| self.look.as_ref().map(|look| Arc::clone(&look.material)))
    }

    /// The newest light.
    pub fn light(&self) -> Option<Arc<Environment>> {
        let whole = self.outcome.as_ref().map(|outcome| Arc::clone(&outcome.light));
        whole.or_else(|| self.look.as_ref().map(|look| Arc::clone(&look.light)))
    }
}

/// A result in one sentence.
fn told(outcome: &ObjectOutcome) -> String {
    let estimate = &outcome.parts.estimate;
    let place = outcome.folder.as_ref().map_or("not written yet".into(), |folder| folder.display().to_string());
    format!(
        "Began as {}; picture within {:.3} in logarithms; {:.0} s: {place}",
        estimate.start, estimate.picture_log_rmse, estimate.seconds
    )
}

impl Model {
    /// Starts an estimation of what is asked for.
    pub fn start_object(&mut self) {
        let form = &self.edits.object;
        let files = match form.files() {
            Ok(files) => files,
            Err(error) => return self.log.error(&error),
        };
        let stem = files.photos.first().and_then(|photo| photo.file_stem()).unwrap_or_default().to_string_lossy();
        let output = store::new_run_folder(&self.runs_folder(), &format!("object {stem}"));
        let settings = form.settings();
        let light = form.light.trim();
        let request = ObjectRequest {
            files,
            light: (!light.is_empty()).then(|| light.into()),
            model: form.model,
            lobes: form.lobes,
            relights: self.named_lights(),
            output,
            settings: settings.clone(),
        };
        let options = ObjectJobOptions {
            wake: Some(Arc::clone(&self.wake)),
            after_round: self.after_round.clone().map(|own| Box::new(move |round| own(round)) as _),
        };
        match object::start(request, options) {
            Ok(job) => {
                self.tasks.stop(RELIGHT_TITLE);
                self.log.dismiss();
                self.object.begin(job, settings.outer_loops);
            }
            Err(error) => self.log.error(&error),
        }
    }

    /// Lights of the shelf that are none of a scene's, with names that suit files.
    fn named_lights(&self) -> Vec<(String, Arc<Environment>)> {
        let own = self.shelf.lights().iter().filter(|light| is_free(&light.name));
        let safe = |name: String| name.chars().map(|c| if c.is_alphanumeric() { c } else { '_' }).collect();
        own.take(MOST_RELIGHTS).map(|light| (safe(light.name.label()), Arc::clone(&light.environment))).collect()
    }

    /// Takes in what the estimation told; a new result is shown under the lights of the shelf.
    pub(super) fn poll_object(&mut self) -> bool {
        let (changed, came) = self.object.poll(&mut self.log);
        if came {
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
        self.tasks.stop(RELIGHT_TITLE);
        self.tasks.spawn(RELIGHT_TITLE, move |context| {
            let maps: Vec<&Environment> = lights.iter().map(|(_, light)| light.as_ref()).collect();
            context.tell("the object", 0.0);
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
        self.tasks.spawn("Saving the result", move |_| {
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
        self.log.note(format!("{} is {what}", path.display()));
    }
}

/// Whether a light is none of a scene's: built in, or of a file.
pub fn is_free(name: &LightName) -> bool {
    matches!(name, LightName::Sky(_) | LightName::File(_))
}

/// Whether a file may be a photo, by its ending.
pub fn is_photo(path: &Path) -> bool {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default();
    ["png", "jpg", "jpeg", "exr", "pfm"].contains(&ending.as_str())
}
