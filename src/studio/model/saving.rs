//! Images of the viewport that are kept: one, a round about the scene, the same view under every environment.

use super::lights::LightName;
use super::tasks::TaskKind;
use super::{Done, Model, SaveRequest, SaveWhat};
use crate::error::{Error, ErrorKind};
use crate::job::fit_film::{self, FitFilmSettings, StateOfFit};
use crate::job::gallery::{self, NamedLight, Turning, TurntableSettings};
use crate::job::{film, relit};
use crate::studio::stage::eye::Eye;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

/// Width and height of a picture of the strip of lights in pixels.
const STRIP_SIZE: (usize, usize) = (240, 160);
/// Paths a pixel of the strip.
const STRIP_SAMPLES: usize = 24;
/// Frames of a film of a fit: ten seconds.
const FRAMES_OF_FIT: usize = 10 * film::FRAMES_A_SECOND as usize;

impl Model {
    /// Opens the dialog that asks how and where to save.
    pub fn ask_to_save(&mut self, what: SaveWhat) {
        let Some(project) = &self.project else { return };
        let folder = self.fit.folder.as_ref().map_or_else(|| self.runs_folder(), |folder| folder.path().into());
        let light: String =
            self.edits.relight.first.label().chars().map(|c| if c.is_alphanumeric() { c } else { '_' }).collect();
        let light = light.to_lowercase();
        let view = match (self.switches.looking_through, project.chosen_name()) {
            (true, Some(name)) => name.to_owned(),
            _ => "viewport".into(),
        };
        let path = match what {
            SaveWhat::Picture => folder.join("renders").join(format!("{view}_{light}.png")),
            SaveWhat::Turntable => folder.join("renders").join(format!("turntable_{light}")),
            SaveWhat::Strip => folder.join("renders").join(format!("{view}_lights")),
            SaveWhat::FitFilm => folder.join("renders").join(format!("{view}_fit_{light}")),
        };
        let (width, height) = match self.eye_in_force() {
            Eye::Photo(camera) => (camera.width, camera.height),
            Eye::Orbit(_) => (1280, 800),
        };
        self.dialog = super::Dialog::Save(SaveRequest {
            what,
            path: path.display().to_string(),
            width,
            height,
            samples: 64,
            frames: if what == SaveWhat::FitFilm { FRAMES_OF_FIT } else { 48 },
            cut_out: false,
            film: true,
        });
    }

    /// Renders and saves what was asked for, beside the window.
    pub fn save(&mut self, request: SaveRequest) {
        if request.what == SaveWhat::FitFilm {
            return self.save_fit_film(request);
        }
        let Some(project) = &self.project else { return };
        let Some(surface) = project.surface.clone() else { return };
        let first = self.edits.relight.first.clone();
        let Some(own) = self.traced_parameters(&first) else { return };
        let camera = self.eye_in_force().as_camera(request.width, request.height);
        let settings = self.picture_settings(request.samples);
        let display = self.edits.display;
        let path = PathBuf::from(request.path.trim());
        let mut lights: Vec<NamedLight> = Vec::new();
        if request.what == SaveWhat::Strip {
            for light in self.shelf.lights() {
                let name = light.name.label();
                lights.extend(self.traced_light(&light.name).map(|environment| NamedLight { name, environment }));
            }
        }
        self.tasks.spawn(TaskKind::Saving, move |context| {
            let tell = |share: f32| context.tell("rendering", share);
            let stop = &context.stop;
            let began = Instant::now();
            let mut film = None;
            let saved = match request.what {
                SaveWhat::Picture => gallery::write_picture(
                    &path,
                    &surface,
                    &own,
                    &camera,
                    &settings,
                    &display,
                    request.cut_out,
                    stop,
                    &tell,
                )?,
                SaveWhat::Turntable => {
                    let size = (request.width, request.height);
                    let turntable = TurntableSettings {
                        frames: request.frames,
                        size,
                        turning: Turning::Camera,
                        start: Some(camera),
                    };
                    let (own, display) = (&own, &display);
                    let frames = gallery::write_turntable(
                        &path, &surface, own, None, &turntable, &settings, display, stop, &tell,
                    )?;
                    if request.film {
                        context.tell("making the film", 1.0);
                        film = Some(film::write(&path, &frames, "turntable")?);
                    }
                    frames
                }
                SaveWhat::Strip => {
                    gallery::write_strip(&path, &surface, &own, &camera, &lights, &settings, &display, stop, &tell)?
                }
                // Not path-traced: it went another way above.
                SaveWhat::FitFilm => Vec::new(),
            };
            let paths = (request.width * request.height * request.samples * saved.len()) as f64;
            let seconds_per_path = began.elapsed().as_secs_f64() / paths.max(1.0);
            // The film is what was wanted: it is named first.
            Ok(Done::Saved(film.into_iter().chain(saved).collect(), Some(seconds_per_path)))
        });
    }

    /// Relights the view as it was at each kept state of the fit, and saves a film of them, beside the window.
    fn save_fit_film(&mut self, request: SaveRequest) {
        let Some(project) = &self.project else { return };
        let Some(surface) = project.surface.clone() else { return };
        let relight = &self.edits.relight;
        let chosen = (relight.first != LightName::Fitted).then(|| self.traced_light(&relight.first)).flatten();
        let states: Vec<StateOfFit> = self
            .timeline
            .states()
            .iter()
            .map(|own| StateOfFit {
                seconds: own.seconds,
                maps: Arc::clone(&own.maps),
                light: chosen.clone().unwrap_or_else(|| relight.turned(&own.environment)),
            })
            .collect();
        let settings = FitFilmSettings {
            camera: self.eye_in_force().as_camera(request.width, request.height),
            frames: request.frames,
            background_visible: relight.as_background,
            background_blur_degrees: relight.background_blur_degrees(),
        };
        let cached =
            project.transport.as_ref().filter(|own| Arc::ptr_eq(&own.surface, &surface)).map(|own| own.transport());
        let wanted = relit::settings_beside(&self.edits.fit, self.picture_settings(1).max_bounces);
        let (kept, display) = (self.kept.clone(), self.edits.display);
        let folder = PathBuf::from(request.path.trim());
        self.tasks.spawn(TaskKind::Saving, move |context| {
            let stop = &context.stop;
            let traced = || relit::transport_of(&surface, wanted, &kept, stop).map(Arc::new);
            let stopped = || Error::new(ErrorKind::Stopped, "stopped while light transport was cached");
            let transport = cached.or_else(traced).ok_or_else(stopped)?;
            let tell = |share: f32| context.tell("rendering", share);
            let frames =
                fit_film::write_frames(&folder, &surface, &transport, &states, &settings, &display, stop, &tell)?;
            context.tell("making the film", 1.0);
            let film = film::write(&folder, &frames, "fit")?;
            Ok(Done::Saved(std::iter::once(film).chain(frames).collect(), None))
        });
    }

    /// Path-traces the stage's view, small, under every light of the shelf.
    pub fn show_strip(&mut self) {
        let Some(project) = &self.project else { return };
        let Some(surface) = project.surface.clone() else { return };
        let Some(own) = self.traced_parameters(&LightName::Fitted) else { return };
        let camera = self.eye_in_force().as_camera(STRIP_SIZE.0, STRIP_SIZE.1);
        let settings = self.picture_settings(STRIP_SAMPLES);
        let names: Vec<LightName> = self.shelf.lights().iter().map(|light| light.name.clone()).collect();
        let lights: Vec<NamedLight> = names
            .iter()
            .filter_map(|name| Some(NamedLight { name: name.label(), environment: self.traced_light(name)? }))
            .collect();
        self.tasks.spawn(TaskKind::ContactSheet, move |context| {
            let tell = |share: f32| context.tell("rendering", share);
            let pictures = gallery::relight_strip(&surface, &own, &camera, &lights, &settings, &context.stop, &tell)?;
            let pictures = pictures.into_iter().map(|picture| Arc::new(picture.radiance));
            Ok(Done::Strip(names.into_iter().zip(pictures).collect()))
        });
    }
}
