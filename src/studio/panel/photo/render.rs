//! The render of the chosen view by a run, made beside the window.

use crate::image::RgbImage;
use crate::job::preview::{Preview, PreviewRequest};
use crate::render::picture::PictureSettings;
use crate::render::{Parameters, Surface};
use crate::scene::Background;
use crate::studio::model::{FitStatus, Model};
use std::sync::Arc;
use std::time::Instant;

/// Paths a pixel of the render.
const SAMPLES: usize = 64;
/// Pixels of the render, at most.
const MOST_PIXELS: usize = 300_000;
/// Seconds between two renders of a photo while a fit runs.
const RENDER_INTERVAL: f32 = 8.0;

/// Whose maps and light are rendered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Whose {
    /// Those of the run that is open.
    Own,
    /// Those of the run that is held against it.
    Other,
}

/// A render that follows the chosen view.
#[derive(Default)]
pub(super) struct Rendering {
    preview: Option<Preview>,
    /// Address of what was drawn, the view, and when.
    asked: Option<(usize, usize, Instant)>,
    key: u64,
    picture: Option<(usize, Arc<RgbImage>)>,
    seen: u64,
    failures: u64,
}

impl Rendering {
    /// What is there of a view.
    pub fn picture(&self, view: usize) -> Option<Arc<RgbImage>> {
        self.picture.as_ref().filter(|(index, _)| *index == view).map(|(_, picture)| Arc::clone(picture))
    }

    /// Forgets what was drawn: the photo is another one.
    pub fn forget(&mut self) {
        (self.picture, self.asked) = (None, None);
    }

    /// Asks for the render of a view when maps or view changed, and takes in what is there.
    pub fn update(&mut self, model: &mut Model, view: usize, whose: Whose) {
        let running = matches!(model.fit.status, FitStatus::Running | FitStatus::Pausing | FitStatus::Finishing(_));
        let Some(address) = address_of(model, whose) else { return };
        let due = self.asked.is_none_or(|(own, index, then)| {
            index != view || (own != address && (!running || then.elapsed().as_secs_f32() > RENDER_INTERVAL))
        });
        if due && !self.ask(model, view, whose, running, address) {
            return;
        }
        self.take_in(model, view, whose);
    }

    fn ask(&mut self, model: &mut Model, view: usize, whose: Whose, running: bool, address: usize) -> bool {
        if self.preview.is_none() {
            match Preview::start(1, Some(Arc::clone(&model.wake))) {
                Ok(preview) => self.preview = Some(preview),
                Err(error) => {
                    model.log.error(&error);
                    return false;
                }
            }
        }
        let Some(scene) = model.project.as_ref().and_then(|project| project.scene.clone()) else { return false };
        let Some((surface, parameters)) = drawn(model, whose) else { return false };
        let camera = &scene.views[view].camera;
        let camera = camera.shrunk(1 << camera.level_within(MOST_PIXELS));
        self.key += 1;
        let request = PreviewRequest {
            surface,
            parameters,
            camera,
            settings: PictureSettings {
                background_visible: scene.background == Background::Environment,
                max_bounces: model.edits.fit.bounces,
                ground: None,
                ..model.picture_settings(1)
            },
            samples_target: if running { SAMPLES / 4 } else { SAMPLES },
            coarse_first: true,
            key: self.key,
        };
        self.asked = Some((address, view, Instant::now()));
        if let Some(preview) = &self.preview {
            // A fit keeps its pace: a picture beside it may take its time.
            preview.set_share(if running { 0.1 } else { 1.0 });
            preview.request(request);
        }
        true
    }

    fn take_in(&mut self, model: &mut Model, view: usize, whose: Whose) {
        let Some(preview) = &self.preview else { return };
        if let Some((number, picture)) = preview.pictures.newest()
            && number > self.seen
        {
            self.seen = number;
            if picture.key == self.key {
                // What a fit takes for the photo's exposure is no difference between the two.
                let gains = match (whose, &model.other_run) {
                    (Whose::Other, Some(other)) => other.gains.clone(),
                    _ => model.gains(),
                };
                let gain = gains.get(view).copied().unwrap_or(1.0);
                self.picture = Some((view, Arc::new(picture.picture.map(|radiance| *radiance * gain))));
            }
        }
        if let Some((number, failure)) = preview.failures.newest()
            && number > self.failures
        {
            self.failures = number;
            model.log.error(&failure.error);
        }
    }
}

/// What tells one state of the maps from another; `None` where there is nothing to draw.
fn address_of(model: &Model, whose: Whose) -> Option<usize> {
    match whose {
        Whose::Own => {
            let project = model.project.as_ref()?;
            project.surface.as_ref()?;
            Some(Arc::as_ptr(project.maps.as_ref()?) as usize)
        }
        Whose::Other => Some(Arc::as_ptr(model.other_run.as_ref()?) as usize),
    }
}

fn drawn(model: &Model, whose: Whose) -> Option<(Arc<Surface>, Arc<Parameters<f32>>)> {
    match whose {
        Whose::Own => {
            let surface = Arc::clone(model.project.as_ref()?.surface.as_ref()?);
            Some((surface, Arc::new(model.run_parameters()?)))
        }
        Whose::Other => {
            let other = model.other_run.as_ref()?;
            Some((Arc::clone(&other.surface), Arc::clone(&other.parameters)))
        }
    }
}
