//! The view relit from cached transport: asked for whenever eye, maps or light differ, shown at once, and until the path
//! tracer has something better.

use super::pictured::{key_of, side_by_side, size_of_picture};
use crate::image::RgbImage;
use crate::job::relit::{Relighter, RelitLight, RelitRequest};
use crate::studio::model::lights::LightName;
use crate::studio::model::{FitStatus, Model};
use crate::studio::stage::StageFrame;
use egui::{Ui, Vec2};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// While a fit runs its newest maps are relit so often, unless somebody touches something.
const BESIDE_A_FIT: Duration = Duration::from_secs(2);

/// What is kept of it.
#[derive(Default)]
pub struct Relit {
    relighter: Option<Relighter>,
    /// Of what was asked for last: everything, and the view without the light.
    asked: (u64, u64),
    asked_at: Option<Instant>,
    /// Of what is shown: the number of the picture, its keys.
    seen: u64,
    shown: Option<Shown>,
    joined: Option<(u64, Arc<RgbImage>)>,
    failures: u64,
    failed: bool,
    /// How far the relit picture lay from the path tracer's, when both were there last.
    error: Option<f64>,
    compared: (usize, usize),
}

struct Shown {
    view: u64,
    key: u64,
    pictures: Vec<Arc<RgbImage>>,
    is_fine: bool,
    seconds: f64,
}

/// A picture of what is on the stage.
pub struct RelitShown {
    /// The picture.
    pub picture: Arc<RgbImage>,
    /// What to say about it.
    pub caption: String,
    /// Whether it is of the light as it is now, with smooth edges.
    pub is_current: bool,
}

impl Relit {
    /// Asks for what is needed and brings what is there.
    pub fn update(
        &mut self,
        ui: &Ui,
        model: &mut Model,
        frame: &StageFrame,
        size: Vec2,
        settled: bool,
    ) -> Option<RelitShown> {
        self.take_in(model);
        let is_wanted = model.switches.traced && !self.failed && model.shows_light() && size.min_elem() >= 16.0;
        let project = model.project.as_ref()?;
        let cached = project.transport.clone();
        let (Some(cached), Some(maps), Some(surface), true) =
            (cached, project.maps.clone(), project.surface.clone(), is_wanted)
        else {
            self.forget();
            return None;
        };
        if !Arc::ptr_eq(&cached.surface, &surface) {
            self.forget();
            return None;
        }
        let (width, height) = size_of_picture(ui, size);
        let camera = frame.eye.as_camera(width, height);
        let names: Vec<LightName> = [Some(model.edits.relight.first.clone()), model.edits.relight.second.clone()]
            .into_iter()
            .flatten()
            .collect();
        let mut hasher = DefaultHasher::new();
        names.iter().for_each(|name| key_of(model, frame, name, &maps, (width, height)).hash(&mut hasher));
        let key = hasher.finish() | 1;
        let view = view_key(&camera, &names, &cached);
        if key != self.asked.0 {
            if view != self.asked.1 && !settled {
                // The eye moves: what was asked for is no longer what is seen.
                return None;
            }
            let is_other_view = view != self.asked.1;
            let runs = matches!(model.fit.status, FitStatus::Running | FitStatus::Pausing | FitStatus::Finishing(_));
            let is_soon = self.asked_at.is_some_and(|then| then.elapsed() < BESIDE_A_FIT);
            if !(runs && is_soon && model.nobody_waits) {
                let light = |name| {
                    let relight = &model.edits.relight;
                    Some(RelitLight {
                        environment: model.stage_light(name)?,
                        turn_radians: relight.turn_degrees.to_radians(),
                        strength: relight.strength_stops.exp2(),
                    })
                };
                let lights: Option<Vec<RelitLight>> = names.iter().map(light).collect();
                let transport = cached.transport();
                let request = RelitRequest {
                    surface,
                    transport,
                    maps,
                    camera,
                    lights: lights?,
                    background_visible: model.edits.relight.as_background,
                    background_blur_degrees: model.edits.relight.background_blur_degrees(),
                    is_settled: !runs,
                    key,
                    view,
                };
                self.asked = (key, view);
                self.request(model, request, is_other_view);
            }
        }
        self.shown(view, key, model.edits.relight.second.is_some().then_some(model.edits.relight.wipe))
    }

    fn request(&mut self, model: &mut Model, request: RelitRequest, is_other_view: bool) {
        if self.relighter.is_none() {
            match Relighter::start(Some(Arc::clone(&model.wake))) {
                Ok(relighter) => self.relighter = Some(relighter),
                Err(error) => {
                    self.failed = true;
                    return model.log.error(&error);
                }
            }
        }
        self.asked_at = Some(Instant::now());
        if let Some(relighter) = &self.relighter {
            relighter.request(request, is_other_view);
        }
    }

    fn take_in(&mut self, model: &mut Model) {
        let Some(relighter) = &self.relighter else { return };
        if let Some((number, made)) = relighter.pictures.newest()
            && number > self.seen
        {
            self.seen = number;
            // A light that turned on meanwhile is still of this view.
            self.shown = Some(Shown {
                view: made.view,
                key: made.key,
                pictures: made.pictures.clone(),
                is_fine: made.is_fine,
                seconds: made.light_seconds,
            });
        }
        if let Some((number, failure)) = relighter.failures.newest()
            && number > self.failures
        {
            self.failures = number;
            self.failed = true;
            model.log.error(&failure.1);
        }
    }

    fn shown(&mut self, view: u64, key: u64, wipe: Option<f32>) -> Option<RelitShown> {
        let shown = self.shown.as_ref().filter(|own| own.view == view)?;
        let first = shown.pictures.first()?;
        let picture = match (wipe, shown.pictures.get(1)) {
            (Some(wipe), Some(second)) => {
                let mut hasher = DefaultHasher::new();
                (Arc::as_ptr(first) as usize, Arc::as_ptr(second) as usize, wipe.to_bits()).hash(&mut hasher);
                let joined = hasher.finish();
                if self.joined.as_ref().is_none_or(|(own, _)| *own != joined) {
                    self.joined = Some((joined, Arc::new(side_by_side(first, second, wipe))));
                }
                Arc::clone(&self.joined.as_ref()?.1)
            }
            _ => Arc::clone(first),
        };
        let milliseconds = 1e3 * shown.seconds;
        let caption = match self.error {
            Some(error) => {
                format!("Relit in {milliseconds:.0} ms · {:.1} % from path tracing", 100.0 * error)
            }
            None => format!("Relit in {milliseconds:.0} ms from cached transport"),
        };
        Some(RelitShown { picture, caption, is_current: shown.key == key && shown.is_fine })
    }

    /// Compares the picture with that of the path tracer, which has come to rest on the same view and light.
    pub fn compare(&mut self, own: &Arc<RgbImage>, traced: &Arc<RgbImage>) {
        let pair = (Arc::as_ptr(own) as usize, Arc::as_ptr(traced) as usize);
        if self.compared == pair || (own.width(), own.height()) != (traced.width(), traced.height()) {
            return;
        }
        self.compared = pair;
        let squares =
            own.pixels().iter().zip(traced.pixels()).map(|(own, traced)| {
                (f64::from((*own - *traced).length_squared()), f64::from(traced.length_squared()))
            });
        let (difference, whole) = squares.fold((0.0, 0.0), |sum, next| (sum.0 + next.0, sum.1 + next.1));
        self.error = Some((difference / whole).sqrt()).filter(|error| error.is_finite());
    }

    fn forget(&mut self) {
        if let Some(relighter) = &self.relighter {
            relighter.cancel();
        }
        (self.asked, self.shown, self.joined, self.error) = ((0, 0), None, None, None);
    }
}

/// A number that changes with the view, whatever lights it.
fn view_key(camera: &crate::scene::Camera, names: &[LightName], cached: &Arc<super::CachedOf>) -> u64 {
    let mut hasher = DefaultHasher::new();
    let numbers = [
        camera.rotation_camera_from_world.to_cols_array().as_slice(),
        &camera.translation_camera_from_world.to_array(),
        &camera.focal_pixels.to_array(),
        &camera.centre_pixels.to_array(),
    ]
    .concat();
    numbers.iter().for_each(|number| number.to_bits().hash(&mut hasher));
    (camera.width, camera.height, names.len(), Arc::as_ptr(cached) as usize).hash(&mut hasher);
    hasher.finish()
}
