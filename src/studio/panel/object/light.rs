//! The estimated light: as a map of all directions and in two balls.

use crate::studio::model::Model;
use crate::studio::panel::empty;
use crate::studio::panel::light::{self, LightMemory};
use egui::Ui;

/// Draws the panel.
pub fn show(ui: &mut Ui, model: &mut Model, memory: &mut LightMemory) {
    let Some(environment) = model.object.light() else {
        return empty(ui, "No light yet", "It appears after the first round");
    };
    light::draw(ui, model, memory, "Estimated environment", &environment, None);
}
