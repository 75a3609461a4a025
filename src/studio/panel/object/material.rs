//! The chosen material of the library, or what lies between materials: lobes, and a sphere under a light.

use super::lobes::{self, LobesMemory};
use crate::studio::model::Model;
use crate::studio::model::estimating::is_free;
use crate::studio::panel::empty;
use egui::{ComboBox, RichText, Ui};

/// Draws the panel.
pub fn show(ui: &mut Ui, model: &mut Model, memory: &mut LobesMemory) {
    let Some(choice) = model.materials.choice.clone() else {
        return empty(
            ui,
            "No material chosen",
            "Click a material, or any place on the latent map; or open a .binary file",
        );
    };
    ui.add(egui::Label::new(RichText::new(choice.words()).strong()).wrap());
    light(ui, model);
    let Some(shown) = model.materials.shown.clone() else {
        ui.label(RichText::new("Rendering…").weak());
        return;
    };
    let [red, green, blue] = shown.albedo;
    ui.label(RichText::new(format!("Albedo near the normal: {red:.2} {green:.2} {blue:.2}")).weak())
        .on_hover_text("Share of the light near the normal that leaves again: red, green, blue");
    let estimated = model.object.material();
    lobes::show(ui, "material", &shown.look, estimated.as_deref(), &model.edits.display, memory);
}

fn light(ui: &mut Ui, model: &mut Model) {
    let mut chosen = model.materials.light.clone();
    ui.horizontal_wrapped(|ui| {
        let label = ui.label("Preview under");
        let words = chosen.as_ref().map_or("Three lamps".into(), |name| name.label());
        let list = ComboBox::from_id_salt("light of the sphere").selected_text(words).show_ui(ui, |ui| {
            ui.selectable_value(&mut chosen, None, "Three lamps");
            for light in model.shelf.lights().iter().filter(|light| is_free(&light.name)) {
                ui.selectable_value(&mut chosen, Some(light.name.clone()), light.name.label());
            }
        });
        list.response.labelled_by(label.id);
    });
    if chosen != model.materials.light {
        model.materials.light = chosen;
        model.show_material();
    }
}
