//! The object under other lights: one picture a light of the shelf.

use crate::image::RgbImage;
use crate::image::display::DisplaySettings;
use crate::studio::act::Act;
use crate::studio::model::Model;
use crate::studio::model::object::RelitObject;
use crate::studio::model::tasks::TaskKind;
use crate::studio::panel::relight::colour_image;
use crate::studio::panel::{act_button, act_button_named};
use egui::{Rect, RichText, ScrollArea, Sense, TextureHandle, Ui, pos2, vec2};
use std::sync::Arc;

/// Side of a picture in points.
const SIDE: f32 = 132.0;

/// What the panel keeps.
#[derive(Default)]
pub struct RelitMemory {
    spheres: bool,
    textures: Vec<(Arc<RgbImage>, DisplaySettings, TextureHandle)>,
}

/// Draws the panel.
pub fn show(ui: &mut Ui, model: &mut Model, memory: &mut RelitMemory) {
    ui.horizontal_wrapped(|ui| {
        ui.selectable_value(&mut memory.spheres, false, "The object");
        ui.selectable_value(&mut memory.spheres, true, "Spheres");
        ui.separator();
        act_button_named(ui, model, Act::ObjectRelight, "Relight");
        act_button(ui, model, Act::AddLight);
    });
    let relit = model.object.relit.clone();
    if relit.is_empty() {
        let hint = match (model.tasks.is_running(&TaskKind::RelightingObject), model.object.outcome.is_some()) {
            (true, _) => "Rendering…",
            (false, true) => "Press Relight",
            (false, false) => {
                "The object under the environments of the library appears when the estimation is finished"
            }
        };
        ui.label(RichText::new(hint).weak());
        return;
    }
    textures(ui, memory, &relit, model.edits.display);
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        ui.horizontal_wrapped(|ui| {
            for (picture, (.., texture)) in relit.iter().zip(&memory.textures) {
                let label = picture.name.label();
                ui.allocate_ui(vec2(SIDE, SIDE + 22.0), |ui| {
                    ui.vertical(|ui| {
                        let (rect, response) = ui.allocate_exact_size(vec2(SIDE, SIDE), Sense::hover());
                        let what = if memory.spheres { "sphere" } else { "object" };
                        response.widget_info(|| {
                            egui::WidgetInfo::labeled(egui::Role::Image, true, format!("{what} under {label}"))
                        });
                        ui.painter().rect_filled(rect, 3.0, ui.visuals().extreme_bg_color);
                        let size = texture.size_vec2();
                        let size = size * (SIDE / size.max_elem().max(1.0));
                        let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
                        let place = Rect::from_center_size(rect.center(), size);
                        ui.painter().image(texture.id(), place, whole, egui::Color32::WHITE);
                        ui.add(egui::Label::new(RichText::new(&label).small()).truncate());
                    });
                });
            }
        });
        ui.label(RichText::new("Each is auto-exposed: the absolute scale is ambiguous").weak());
    });
}

fn textures(ui: &Ui, memory: &mut RelitMemory, relit: &[RelitObject], display: DisplaySettings) {
    let wanted = |own: &RelitObject| Arc::clone(if memory.spheres { &own.sphere } else { &own.object });
    let pictures: Vec<Arc<RgbImage>> = relit.iter().map(wanted).collect();
    let is_known = memory.textures.len() == pictures.len()
        && memory
            .textures
            .iter()
            .zip(&pictures)
            .all(|((own, shown, _), other)| Arc::ptr_eq(own, other) && *shown == display);
    if !is_known {
        let texture = |picture: &Arc<RgbImage>| {
            ui.ctx().load_texture("relit", colour_image(picture, &display), egui::TextureOptions::LINEAR)
        };
        memory.textures = pictures.iter().map(|picture| (Arc::clone(picture), display, texture(picture))).collect();
    }
}
