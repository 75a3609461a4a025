//! The estimated light: as a map of all directions and in two balls; and what the photos see of it.

use crate::image::RgbImage;
use crate::image::display::DisplaySettings;
use crate::image::histogram::auto_exposure;
use crate::light::Environment;
use crate::studio::model::Model;
use crate::studio::panel::empty;
use crate::studio::panel::light::{self, LightMemory};
use crate::studio::picture::{self, Overlay, PictureView, Source};
use egui::{RichText, Ui, vec2};
use std::sync::Arc;

/// What the panel keeps: the light that is shown, and the exposure that suits it.
#[derive(Default)]
pub struct ObjectLightMemory {
    light: LightMemory,
    exposed: Option<(Arc<Environment>, f32)>,
    shows_seen: bool,
    seen: Option<Seen>,
    seen_view: PictureView,
}

/// What the photos see of a light, ready to be drawn.
struct Seen {
    light: Arc<Environment>,
    picture: Arc<RgbImage>,
    stops: f32,
}

/// Draws the panel.
pub fn show(ui: &mut Ui, model: &mut Model, memory: &mut ObjectLightMemory) {
    let Some(environment) = model.object.light() else {
        return empty(ui, "No environment yet", "It appears after the first round");
    };
    let many = model.object.outcome.as_ref().filter(|outcome| outcome.lights.len() > 1);
    if let Some(outcome) = many {
        let photo = model.object.photos.get(model.object.chosen_photo);
        let name = photo.map_or("the first photo", |photo| photo.name.as_str());
        ui.label(RichText::new(format!("Environment of {name}, one of {}", outcome.lights.len())).weak())
            .on_hover_text("Choose another photo to see its environment");
    }
    if let Some(bands) = model.object.outcome.as_ref().and_then(|outcome| outcome.parts.estimate.light_bands.as_ref()) {
        ui.label(RichText::new(bands.sentence()).weak()).on_hover_text(
            "Blurred by this angle, at least half of the environment's variance is what the photos tell",
        );
    }
    let is_of_first = many.is_none() || model.object.chosen_photo == 0;
    let has_seen = model.object.outcome.as_ref().is_some_and(|outcome| outcome.parts.estimate.light_seen.is_some());
    if has_seen && is_of_first {
        ui.horizontal(|ui| {
            ui.selectable_value(&mut memory.shows_seen, false, "Radiance").on_hover_text("The estimated environment");
            ui.selectable_value(&mut memory.shows_seen, true, "Sensitivity")
                .on_hover_text("How much each direction matters to the photos; the rest follows the prior");
        });
        if memory.shows_seen {
            return seen(ui, model, memory, &environment);
        }
    }
    if memory.exposed.as_ref().is_none_or(|(own, _)| !Arc::ptr_eq(own, &environment)) {
        memory.exposed = Some((Arc::clone(&environment), auto_exposure(&environment.radiance)));
    }
    let stops = memory.exposed.as_ref().map_or(0.0, |(_, stops)| *stops);
    ui.label(RichText::new(format!("Auto-exposed: {stops:+.1} EV")).weak())
        .on_hover_text("On top of the display exposure: the absolute scale is ambiguous");
    let own = model.edits.display;
    let display = DisplaySettings { exposure_stops: own.exposure_stops + stops, ..own };
    light::draw(ui, model, &mut memory.light, "Estimated environment map", &environment, None, &display);
}

/// Draws how much each direction matters, exposed for itself.
fn seen(ui: &mut Ui, model: &Model, memory: &mut ObjectLightMemory, environment: &Arc<Environment>) {
    let outcome = model.object.outcome.as_ref();
    let Some(found) = outcome.and_then(|outcome| outcome.parts.estimate.light_seen.as_ref()) else { return };
    if memory.seen.as_ref().is_none_or(|own| !Arc::ptr_eq(&own.light, environment)) {
        let stops = auto_exposure(&found.sensitivity);
        let picture = Arc::new(found.sensitivity.clone());
        memory.seen = Some(Seen { light: Arc::clone(environment), picture, stops });
    }
    let Some(Seen { picture, stops, .. }) = &memory.seen else { return };
    let share = 100.0 * found.unseen_share;
    ui.label(RichText::new(format!("The photos hardly constrain {share:.0} % of all directions")).weak());
    let display = DisplaySettings { exposure_stops: *stops, ..DisplaySettings::default() };
    let source = Source::from(Arc::clone(picture));
    let overlay = Overlay { badge: "up", ..Overlay::default() };
    let height = (ui.available_width() / 2.0).min(ui.available_height()).max(60.0);
    ui.allocate_ui(vec2(ui.available_width(), height), |ui| {
        picture::show(ui, "Sensitivity of the photos", &source, &display, &mut memory.seen_view, &overlay);
    });
}
