//! How the scene was read, and reading it again in another way.

use crate::scene::settings::{BackgroundChoice, ColourEncoding, MaskUse, ReadSettings, Up};
use crate::studio::model::Model;
use egui::{CollapsingHeader, ComboBox, DragValue, Grid, RichText, Ui};
use std::path::PathBuf;

/// What the section keeps: choices that are not yet in force.
#[derive(Default)]
pub struct ReadingMemory {
    chosen: Option<(PathBuf, ReadSettings)>,
}

/// Draws the section; nothing for a run or a scene made in code.
pub fn show(ui: &mut Ui, model: &mut Model, memory: &mut ReadingMemory) {
    let Some(project) = &model.project else { return };
    let Some(path) = project.path.clone().filter(|_| !project.is_run) else { return };
    let in_force = project.settings.read.clone();
    if memory.chosen.as_ref().is_none_or(|(own, _)| *own != path) {
        memory.chosen = Some((path.clone(), in_force.clone()));
    }
    let Some((_, chosen)) = &mut memory.chosen else { return };
    CollapsingHeader::new("Import settings").show(ui, |ui| {
        Grid::new("reading").num_columns(2).spacing([10.0, 4.0]).show(ui, |ui| {
            let label = ui.label("Up axis").on_hover_text("The axis of the data set that points up");
            let ups = std::iter::once(Up::Auto).chain(Up::NAMED);
            let response = ComboBox::from_id_salt("up").selected_text(chosen.up.to_string()).show_ui(ui, |ui| {
                for up in ups {
                    ui.selectable_value(&mut chosen.up, up, up.to_string());
                }
            });
            response.response.labelled_by(label.id);
            ui.end_row();
            let label = ui.label("Hold out every").on_hover_text("Hold out every Nth photo for validation (0 = none)");
            ui.add(DragValue::new(&mut chosen.hold_out_every).range(0..=100)).labelled_by(label.id);
            ui.end_row();
            let label = ui.label("Downsample photos").on_hover_text("Average photos over squares of this many pixels");
            ui.add(DragValue::new(&mut chosen.shrink).range(1..=16)).labelled_by(label.id);
            ui.end_row();
            let label = ui.label("Masks").on_hover_text("Use the masks beside the photos");
            let mut used = chosen.masks == MaskUse::Use;
            ui.checkbox(&mut used, "").labelled_by(label.id);
            chosen.masks = if used { MaskUse::Use } else { MaskUse::Ignore };
            ui.end_row();
            let label = ui.label("Encoding").on_hover_text("How the numbers of the photos are encoded");
            let names = [
                (ColourEncoding::Auto, "By the file"),
                (ColourEncoding::Srgb, "sRGB"),
                (ColourEncoding::Linear, "Linear"),
                (ColourEncoding::Gamma22, "Gamma 2.2"),
            ];
            let name = names.iter().find(|(own, _)| *own == chosen.encoding).map_or("", |(_, name)| name);
            let response = ComboBox::from_id_salt("encoding of photos").selected_text(name).show_ui(ui, |ui| {
                for (own, name) in names {
                    ui.selectable_value(&mut chosen.encoding, own, name);
                }
            });
            response.response.labelled_by(label.id);
            ui.end_row();
            let label = ui.label("OpenEXR layer").on_hover_text("Name of the layer to read; empty for the radiance");
            let mut layer = chosen.layer.clone().unwrap_or_default();
            ui.add(egui::TextEdit::singleline(&mut layer).desired_width(120.0).hint_text("radiance"))
                .labelled_by(label.id);
            chosen.layer = (!layer.is_empty()).then_some(layer);
            ui.end_row();
            let label = ui
                .label("Unit")
                .on_hover_text("How many metres a unit of the data set is; 0: what the scene says, if it does");
            let mut metres = chosen.unit_in_metres.unwrap_or(0.0);
            let field = DragValue::new(&mut metres).range(0.0..=f64::MAX).speed(0.001).suffix(" m").max_decimals(6);
            ui.add(field).labelled_by(label.id);
            chosen.unit_in_metres = (metres > 0.0).then_some(metres);
            ui.end_row();
            let label = ui.label("Background").on_hover_text("What pixels without surface show");
            let names = [
                (BackgroundChoice::Auto, "Auto-detect"),
                (BackgroundChoice::Environment, "Environment"),
                (BackgroundChoice::Black, "Black"),
            ];
            let name = names.iter().find(|(own, _)| *own == chosen.background).map_or("", |(_, name)| name);
            let response = ComboBox::from_id_salt("background of photos").selected_text(name).show_ui(ui, |ui| {
                for (own, name) in names {
                    ui.selectable_value(&mut chosen.background, own, name);
                }
            });
            response.response.labelled_by(label.id);
            ui.end_row();
        });
        let differs = *chosen != in_force;
        let again = ui.add_enabled(differs, egui::Button::new("Reload scene"));
        if again.on_hover_text("A running fit is stopped; its checkpoint keeps the progress").clicked() {
            let chosen = chosen.clone();
            model.open_with(path, chosen);
        } else if differs {
            ui.label(RichText::new("Not applied yet").weak());
        }
    });
}
