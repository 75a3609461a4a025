//! The library: a sphere of every material, by kind and name; before it, measured tables that were opened.

use crate::image::display::DisplaySettings;
use crate::measured::Category;
use crate::studio::act::Act;
use crate::studio::model::Model;
use crate::studio::model::materials::{Choice, OpenedTile};
use crate::studio::model::tasks::TaskKind;
use crate::studio::panel::{act_button_named, empty};
use crate::studio::picture::ThumbnailCache;
use crate::studio::theme;
use crate::studio::workspace::Panel;
use egui::{ComboBox, Rect, RichText, ScrollArea, Sense, Stroke, StrokeKind, TextEdit, Ui, pos2, vec2};
use std::sync::Arc;

/// Side of a sphere in points.
const SIDE: f32 = 76.0;

/// What the panels of the library keep.
#[derive(Default)]
pub struct MaterialsMemory {
    filter: String,
    kind: Option<Category>,
    pub(super) thumbnails: ThumbnailCache,
    filled: bool,
    pub(super) without_pictures: bool,
}

impl MaterialsMemory {
    /// Puts the pictures that were drawn into the cache, once.
    pub(super) fn fill(&mut self, model: &Model) {
        let Some(library) = model.materials.library.as_ref().filter(|_| !self.filled) else { return };
        for (place, picture) in library.map.places.iter().zip(&model.materials.thumbnails) {
            self.thumbnails.keep(&place.name, picture);
        }
        self.filled = !model.materials.thumbnails.is_empty();
    }
}

/// Whether the library is there; otherwise it is asked for, and the panel says so.
pub(super) fn is_ready(ui: &mut Ui, model: &mut Model) -> bool {
    if !model.materials.was_asked {
        model.load_materials();
    }
    if model.materials.library.is_some() {
        return true;
    }
    if model.tasks.is_running(&TaskKind::DrawingMaterials) {
        empty(ui, "Rendering the materials", "This takes a few seconds");
    } else {
        empty(ui, "No materials yet", "They ship with Patina");
        ui.vertical_centered(|ui| {
            if ui.button("Render the materials").clicked() {
                model.load_materials();
            }
        });
    }
    false
}

/// Draws the panel.
pub fn show(ui: &mut Ui, model: &mut Model, memory: &mut MaterialsMemory) {
    if !is_ready(ui, model) {
        return;
    }
    memory.fill(model);
    let Some(library) = model.materials.library.clone() else { return };
    ui.horizontal_wrapped(|ui| {
        let label = ui.label("Find a material");
        ui.add(TextEdit::singleline(&mut memory.filter).desired_width(160.0).hint_text("gold")).labelled_by(label.id);
        let words = memory.kind.map_or("All kinds", Category::label);
        let list = ComboBox::from_id_salt("kind of material").selected_text(words).show_ui(ui, |ui| {
            ui.selectable_value(&mut memory.kind, None, "All kinds");
            for kind in Category::ALL {
                ui.selectable_value(&mut memory.kind, Some(kind), kind.label());
            }
        });
        list.response.accessible_name("Kind of material");
        act_button_named(ui, model, Act::OpenMaterial, "Open…");
        ui.label(RichText::new(library.statement()).weak());
    });
    let wanted = memory.filter.trim().to_lowercase();
    let choice = model.materials.choice.clone();
    let chosen = choice.as_ref().and_then(Choice::material_of_library);
    let (mut clicked, mut clicked_opened) = (None, None);
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        ui.horizontal_wrapped(|ui| {
            ui.spacing_mut().item_spacing = vec2(8.0, 8.0);
            for OpenedTile { material, thumbnail } in &model.materials.opened {
                let name = material.name();
                if memory.kind.is_some() || !name.to_lowercase().contains(&wanted) {
                    continue;
                }
                let key = material.path.display().to_string();
                // A file may be opened again with other contents.
                memory.thumbnails.keep(&key, thumbnail);
                let is_chosen = matches!(&choice, Some(Choice::Opened(own)) if Arc::ptr_eq(own, material));
                if tile(ui, memory, (&key, name), None, is_chosen) {
                    clicked_opened = Some(Arc::clone(material));
                }
            }
            for place in &library.map.places {
                let is_kind = memory.kind.is_none_or(|kind| kind == place.category);
                if is_kind && place.name.to_lowercase().contains(&wanted) {
                    let is_chosen = chosen == Some(place.name.as_str());
                    if tile(ui, memory, (&place.name, &place.name), Some(place.category), is_chosen) {
                        clicked = Some(place.at);
                    }
                }
            }
        });
    });
    if let Some(at) = clicked {
        model.choose_material(at);
        model.activate = Some(Panel::Material);
    }
    if let Some(material) = clicked_opened {
        model.choose_opened(material);
    }
}

/// A sphere with its name, and with the colour of its kind where it is of the library; whether it was clicked. `key` is
/// that of its thumbnail.
fn tile(
    ui: &mut Ui,
    memory: &mut MaterialsMemory,
    (key, name): (&str, &str),
    kind: Option<Category>,
    is_chosen: bool,
) -> bool {
    let mut clicked = false;
    ui.allocate_ui(vec2(SIDE + 16.0, SIDE + 20.0), |ui| {
        ui.vertical(|ui| {
            let (rect, response) = ui.allocate_exact_size(vec2(SIDE + 16.0, SIDE), Sense::click());
            response.widget_info(|| egui::WidgetInfo::selected(egui::Role::RadioButton, true, is_chosen, name));
            if ui.is_rect_visible(rect) {
                let place = Rect::from_center_size(rect.center(), vec2(SIDE, SIDE));
                if let Some(texture) = memory.thumbnails.texture(ui.ctx(), key, &DisplaySettings::default()) {
                    let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
                    ui.painter().image(texture.id(), place, whole, egui::Color32::WHITE);
                }
                if let Some(kind) = kind {
                    ui.painter().circle_filled(rect.right_top() + vec2(-6.0, 6.0), 4.0, theme::kind_colour(kind));
                }
                let colours = theme::palette(ui.visuals());
                let stroke = match (is_chosen, response.hovered()) {
                    (true, _) => Stroke::new(3.0, colours.accent),
                    (false, true) => Stroke::new(1.5, ui.visuals().text_color()),
                    _ => Stroke::NONE,
                };
                ui.painter().rect_stroke(rect, 3.0, stroke, StrokeKind::Outside);
            }
            clicked = response.on_hover_text(format!("{name}\n{}", kind.map_or(key, |kind| kind.label()))).clicked();
            ui.add(egui::Label::new(RichText::new(name).small()).truncate());
        });
    });
    clicked
}
