//! The path-traced preview: asked for when nothing moves, shown as long as it is of what is on the stage.

use super::pictured::{key_of, side_by_side, size_of_picture};
use crate::image::RgbImage;
use crate::job::pictures::parameters_with;
use crate::job::preview::{Preview, PreviewRequest};
use crate::studio::model::{FitStatus, Model};
use crate::studio::stage::StageFrame;
use egui::{Ui, Vec2};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;

/// Paths a pixel at which the preview rests.
const SAMPLES: usize = 128;

/// The preview of each side of the line between two lights.
#[derive(Default)]
pub struct Traced {
    sides: [Option<Side>; 2],
    joined: Option<(u64, Arc<RgbImage>)>,
    failed: bool,
    /// Addresses of the surface and the maps that are drawn.
    drawn: (usize, usize),
}

struct Side {
    preview: Preview,
    key: u64,
    seen: u64,
    picture: Option<(Arc<RgbImage>, usize)>,
    failures: u64,
}

/// What the stage shows of it.
#[derive(Default)]
pub struct TracedPicture {
    /// The picture, if there is one of exactly this view.
    pub picture: Option<Arc<RgbImage>>,
    /// What to say about it.
    pub caption: String,
    /// Samples a pixel; 0 for a picture that was drawn smaller.
    pub samples: usize,
    /// Whether it has come to rest.
    pub is_done: bool,
}

impl Traced {
    /// Asks for what is needed and brings what is there.
    pub fn update(
        &mut self,
        ui: &Ui,
        model: &mut Model,
        frame: &StageFrame,
        size: Vec2,
        settled: bool,
    ) -> TracedPicture {
        let surface = model.project.as_ref().and_then(|project| project.surface.clone());
        let maps = model.project.as_ref().and_then(|project| project.maps.clone());
        let drawn = (
            surface.as_ref().map_or(0, |own| Arc::as_ptr(own) as usize),
            maps.as_ref().map_or(0, |own| Arc::as_ptr(own) as usize),
        );
        if self.drawn != drawn {
            // Where one could not be drawn, another may be.
            (self.drawn, self.failed) = (drawn, false);
        }
        let wanted = model.switches.traced
            && !self.failed
            && model.shows_light()
            && matches!(
                model.fit.status,
                FitStatus::Idle | FitStatus::Paused | FitStatus::Stopped | FitStatus::Finished
            )
            && size.min_elem() >= 16.0;
        let (true, Some(surface), Some(maps)) = (wanted, surface, maps) else {
            self.cancel();
            return TracedPicture::default();
        };
        let (width, height) = size_of_picture(ui, size);
        let names = [Some(model.edits.relight.first.clone()), model.edits.relight.second.clone()];
        for (side, name) in names.iter().enumerate() {
            match name {
                None => self.sides[side] = None,
                Some(name) => {
                    let key = key_of(model, frame, name, &maps, (width, height));
                    let known = self.sides[side].as_ref().is_some_and(|own| own.key == key);
                    if !known {
                        if !settled {
                            // What was asked for is no longer what is seen.
                            self.cancel();
                            return TracedPicture::default();
                        }
                        let Some(light) = model.traced_light(name) else { continue };
                        let request = PreviewRequest {
                            surface: Arc::clone(&surface),
                            parameters: Arc::new(parameters_with(&maps, &light, model.edits.fit.lobe)),
                            camera: frame.eye.as_camera(width, height),
                            settings: model.picture_settings(1),
                            samples_target: SAMPLES,
                            coarse_first: true,
                            key,
                        };
                        self.request(model, side, request);
                    }
                }
            }
        }
        self.take_in(model);
        self.shown(names[1].is_some().then_some(model.edits.relight.wipe))
    }

    fn request(&mut self, model: &mut Model, side: usize, request: PreviewRequest) {
        let key = request.key;
        if self.sides[side].is_none() {
            let threads = std::thread::available_parallelism().map_or(1, |count| count.get());
            match Preview::start(threads, Some(Arc::clone(&model.wake))) {
                Ok(preview) => {
                    self.sides[side] = Some(Side { preview, key, seen: 0, picture: None, failures: 0 });
                }
                Err(error) => {
                    self.failed = true;
                    return model.log.error(&error);
                }
            }
        }
        if let Some(own) = &mut self.sides[side] {
            own.key = key;
            own.picture = None;
            own.preview.request(request);
        }
    }

    fn take_in(&mut self, model: &mut Model) {
        for own in self.sides.iter_mut().flatten() {
            if let Some((number, picture)) = own.preview.pictures.newest()
                && number > own.seen
            {
                own.seen = number;
                if picture.key == own.key {
                    own.picture = Some((Arc::new(picture.picture.clone()), picture.samples));
                    self.joined = None;
                }
            }
            if let Some((number, failure)) = own.preview.failures.newest()
                && number > own.failures
            {
                own.failures = number;
                self.failed |= failure.key == own.key;
                model.log.error(&failure.error);
            }
        }
    }

    /// The picture of one side, or of both joined at the line.
    fn shown(&mut self, wipe: Option<f32>) -> TracedPicture {
        let side = |place: usize| self.sides[place].as_ref().and_then(|own| own.picture.clone());
        let Some((first, samples)) = side(0) else {
            return TracedPicture { caption: "Path tracing…".into(), ..TracedPicture::default() };
        };
        let caption = |samples: usize| match samples {
            0 => "Path tracing…".to_owned(),
            SAMPLES => format!("Path traced · {SAMPLES} spp"),
            _ => format!("Path traced · {samples}/{SAMPLES} spp"),
        };
        let told = |picture, samples| TracedPicture {
            picture,
            caption: caption(samples),
            samples,
            is_done: samples >= SAMPLES,
        };
        let Some(wipe) = wipe else { return told(Some(first), samples) };
        let Some((second, other_samples)) = side(1) else {
            return told(None, 0);
        };
        if (first.width(), first.height()) != (second.width(), second.height()) {
            return TracedPicture::default();
        }
        let mut hasher = DefaultHasher::new();
        (Arc::as_ptr(&first) as usize, Arc::as_ptr(&second) as usize, wipe.to_bits()).hash(&mut hasher);
        let key = hasher.finish();
        if self.joined.as_ref().is_none_or(|(own, _)| *own != key) {
            self.joined = Some((key, Arc::new(side_by_side(&first, &second, wipe))));
        }
        let picture = self.joined.as_ref().map(|(_, picture)| Arc::clone(picture));
        told(picture, samples.min(other_samples))
    }

    fn cancel(&mut self) {
        for own in self.sides.iter_mut().flatten() {
            own.preview.cancel();
            own.key = 0;
            own.picture = None;
        }
        self.joined = None;
    }
}
