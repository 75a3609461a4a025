//! The estimated reflectance: lobes and a sphere under three lamps.

use super::lobes::{self, LobesMemory};
use crate::studio::model::Model;
use crate::studio::panel::empty;
use egui::{RichText, Ui};

/// Draws the panel.
pub fn show(ui: &mut Ui, model: &mut Model, memory: &mut LobesMemory) {
    let Some(look) = model.object.material() else {
        return empty(ui, "No reflectance yet", "Lobes and a sphere of it appear after the first round");
    };
    if let Some(outcome) = &model.object.outcome {
        let albedo = outcome.gauge.largest_albedo;
        let text = format!("Largest albedo: red {:.2}, green {:.2}, blue {:.2}", albedo[0], albedo[1], albedo[2]);
        let makes_light = albedo.iter().any(|value| *value > 1.0);
        let text = RichText::new(text);
        let text = if makes_light { text.color(ui.visuals().warn_fg_color) } else { text.weak() };
        ui.label(text).on_hover_text(
            "Largest share of the light that leaves again, of four directions; above 1 the split of reflectance and \
             light would make energy: the light is brighter than estimated",
        );
    }
    lobes::show(ui, "estimated reflectance", &look, None, &model.edits.display, memory);
}
