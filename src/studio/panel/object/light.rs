//! The estimated light: as a map of all directions and in two balls.

use crate::image::display::DisplaySettings;
use crate::image::histogram::auto_exposure;
use crate::light::Environment;
use crate::studio::model::Model;
use crate::studio::panel::empty;
use crate::studio::panel::light::{self, LightMemory};
use egui::{RichText, Ui};
use std::sync::Arc;

/// What the panel keeps: the light that is shown, and the exposure that suits it.
#[derive(Default)]
pub struct ObjectLightMemory {
    light: LightMemory,
    exposed: Option<(Arc<Environment>, f32)>,
}

/// Draws the panel.
pub fn show(ui: &mut Ui, model: &mut Model, memory: &mut ObjectLightMemory) {
    let Some(environment) = model.object.light() else {
        return empty(ui, "No light yet", "It appears after the first round");
    };
    if memory.exposed.as_ref().is_none_or(|(own, _)| !Arc::ptr_eq(own, &environment)) {
        memory.exposed = Some((Arc::clone(&environment), auto_exposure(&environment.radiance)));
    }
    let stops = memory.exposed.as_ref().map_or(0.0, |(_, stops)| *stops);
    ui.label(RichText::new(format!("Exposed for itself: {stops:+.1} stops")).weak())
        .on_hover_text("On top of the display's exposure: no photo tells the level of the light");
    let own = model.edits.display;
    let display = DisplaySettings { exposure_stops: own.exposure_stops + stops, ..own };
    light::draw(ui, model, &mut memory.light, "Estimated environment", &environment, None, &display);
}
