//! The shelf of lights: swap, turn, strengthen, two side by side.

use super::{act_button, act_switch, heading};
use crate::image::display::DisplaySettings;
use crate::image::{Image, RgbImage};
use crate::studio::act::Act;
use crate::studio::model::Model;
use crate::studio::model::lights::{LightName, ShelfLight};
use crate::studio::stage::Layer;
use crate::studio::theme::{self, SHELF_PICTURE};
use egui::{
    ColorImage, ComboBox, Context, Rect, RichText, ScrollArea, Sense, Slider, Stroke, StrokeKind, TextureHandle, Ui,
    vec2,
};
use std::collections::HashMap;
use std::sync::Arc;

/// What the panel keeps: textures of the small pictures.
#[derive(Default)]
pub struct RelightMemory {
    textures: HashMap<LightName, (Arc<RgbImage>, TextureHandle)>,
    strip: Vec<(Arc<RgbImage>, DisplaySettings, TextureHandle)>,
}

/// Draws the panel.
pub fn show(ui: &mut Ui, model: &mut Model, memory: &mut RelightMemory) {
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        controls(ui, model);
        heading(ui, "Environments");
        shelf(ui, model, memory);
        ui.horizontal_wrapped(|ui| {
            act_button(ui, model, Act::AddLight);
            act_button(ui, model, Act::LightStrip);
            act_button(ui, model, Act::SavePicture);
            act_button(ui, model, Act::SaveLightStrip);
            act_button(ui, model, Act::SaveTurntable);
        });
        strip(ui, model, memory);
        ui.label(RichText::new("Arrow keys switch the environment · Shift-drag rotates it").weak());
    });
}

fn controls(ui: &mut Ui, model: &mut Model) {
    egui::Grid::new("relight").num_columns(2).spacing([10.0, 5.0]).show(ui, |ui| {
        let relight = &mut model.edits.relight;
        let label = ui.label("Rotation");
        ui.add(Slider::new(&mut relight.turn_degrees, 0.0..=360.0).suffix("°").fixed_decimals(0))
            .labelled_by(label.id)
            .on_hover_text("Rotate the environment about the up axis\nKeys: Shift and the arrow keys");
        ui.end_row();
        let label = ui.label("Intensity (EV)");
        ui.add(Slider::new(&mut relight.strength_stops, -6.0..=6.0).suffix(" EV").fixed_decimals(1))
            .labelled_by(label.id)
            .on_hover_text("Scale the environment by two to this power");
        ui.end_row();
    });
    ui.horizontal_wrapped(|ui| {
        ui.checkbox(&mut model.edits.relight.matched, "Normalize intensity")
            .on_hover_text("Scale other environments to the mean luminance of the estimated one");
        let on = model.edits.relight.as_background;
        act_switch(ui, model, Act::LightBackground, "Background", on);
        act_button(ui, model, Act::FittedLight);
    });
    ui.horizontal_wrapped(|ui| {
        let two = model.edits.relight.second.is_some();
        act_switch(ui, model, Act::SecondLight, "Split view", two);
        if let Some(second) = model.edits.relight.second.clone() {
            let mut chosen = second.clone();
            let label = ui.label("Environment B");
            let list = ComboBox::from_id_salt("second light").selected_text(chosen.label()).show_ui(ui, |ui| {
                for light in model.shelf.lights() {
                    ui.selectable_value(&mut chosen, light.name.clone(), light.name.label());
                }
            });
            list.response.labelled_by(label.id);
            if chosen != second {
                model.edits.relight.second = Some(chosen);
            }
        }
    });
}

fn shelf(ui: &mut Ui, model: &mut Model, memory: &mut RelightMemory) {
    let lights = model.shelf.lights().to_vec();
    memory.textures.retain(|name, _| lights.iter().any(|light| light.name == *name));
    let colours = theme::palette(ui.visuals());
    let mut removed = None;
    ui.horizontal_wrapped(|ui| {
        for light in &lights {
            let texture = texture(ui.ctx(), memory, &light.name, &light.small);
            let chosen = model.edits.relight.first == light.name;
            let label = light.name.label();
            ui.allocate_ui(SHELF_PICTURE + vec2(8.0, 26.0), |ui| {
                ui.vertical(|ui| {
                    let (rect, response) = ui.allocate_exact_size(SHELF_PICTURE, Sense::click());
                    response.widget_info(|| egui::WidgetInfo::selected(egui::Role::RadioButton, true, chosen, &label));
                    let whole = Rect::from_min_max(egui::pos2(0.0, 0.0), egui::pos2(1.0, 1.0));
                    ui.painter().image(texture, rect, whole, egui::Color32::WHITE);
                    let stroke = if chosen {
                        Stroke::new(3.0, colours.accent)
                    } else if response.hovered() {
                        Stroke::new(2.0, ui.visuals().text_color())
                    } else {
                        ui.visuals().widgets.noninteractive.bg_stroke
                    };
                    ui.painter().rect_stroke(rect, 2.0, stroke, StrokeKind::Outside);
                    if response.clicked() {
                        model.edits.relight.first = light.name.clone();
                        model.edits.layer = Layer::Lit;
                    }
                    let response = response.on_hover_text(about(light));
                    if matches!(light.name, LightName::File(_)) {
                        response.context_menu(|ui| {
                            if ui.button("Remove").clicked() {
                                removed = Some(light.name.clone());
                                ui.close();
                            }
                        });
                    }
                    let short: String = label.chars().take(15).collect();
                    ui.label(RichText::new(short).small());
                });
            });
        }
    });
    if let Some(name) = removed {
        if let LightName::File(path) = &name {
            model.preferences.lights.retain(|other| other != path);
        }
        if model.edits.relight.first == name {
            model.edits.relight.first = LightName::Fitted;
        }
        if model.edits.relight.second.as_ref() == Some(&name) {
            model.edits.relight.second = None;
        }
        model.shelf.remove(&name);
    }
}

/// The stage's view under every light; a click lights the stage so.
fn strip(ui: &mut Ui, model: &mut Model, memory: &mut RelightMemory) {
    let pictures = model.project.as_ref().map_or(Vec::new(), |project| project.strip.clone());
    if pictures.is_empty() {
        memory.strip.clear();
        return;
    }
    heading(ui, "Lighting contact sheet");
    let display = model.edits.display;
    let known = memory.strip.len() == pictures.len()
        && memory
            .strip
            .iter()
            .zip(&pictures)
            .all(|((own, shown, _), (_, other))| Arc::ptr_eq(own, other) && *shown == display);
    if !known {
        let texture = |picture: &Arc<RgbImage>, name: &LightName| {
            let image = colour_image(picture, &display);
            ui.ctx().load_texture(format!("strip {}", name.label()), image, egui::TextureOptions::LINEAR)
        };
        memory.strip =
            pictures.iter().map(|(name, picture)| (Arc::clone(picture), display, texture(picture, name))).collect();
    }
    ui.horizontal_wrapped(|ui| {
        for ((name, _), (.., texture)) in pictures.iter().zip(&memory.strip) {
            let size = vec2(150.0, 100.0);
            let (rect, response) = ui.allocate_exact_size(size, Sense::click());
            let label = format!("view under {}", name.label());
            response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Button, true, &label));
            let whole = Rect::from_min_max(egui::pos2(0.0, 0.0), egui::pos2(1.0, 1.0));
            ui.painter().image(texture.id(), rect, whole, egui::Color32::WHITE);
            if response.on_hover_text(name.label()).clicked() {
                model.edits.relight.first = name.clone();
                model.edits.layer = Layer::Lit;
            }
        }
    });
}

fn about(light: &ShelfLight) -> String {
    let (mean, brightest) = (light.mean_radiance, light.brightest);
    let place = match &light.name {
        LightName::File(path) => format!("{}\nRight-click to remove it", path.display()),
        LightName::Fitted => "The environment estimated from the photos".into(),
        LightName::Truth => "The environment the photos were rendered in".into(),
        LightName::Unseen => "A ground-truth environment that no photo shows".into(),
        LightName::Sky(_) => "A built-in sky".into(),
    };
    format!(
        "{place}\n{} x {} texels, mean radiance {:.3} {:.3} {:.3}, brightest {brightest:.1}",
        light.environment.width(),
        light.environment.height(),
        mean.x,
        mean.y,
        mean.z
    )
}

/// The texture of a small picture, brought to a visible range of its own.
fn texture(context: &Context, memory: &mut RelightMemory, name: &LightName, small: &Arc<RgbImage>) -> egui::TextureId {
    if let Some((own, texture)) = memory.textures.get(name)
        && Arc::ptr_eq(own, small)
    {
        return texture.id();
    }
    let stops = crate::image::histogram::auto_exposure(small);
    let display = DisplaySettings { exposure_stops: stops, ..DisplaySettings::default() };
    let image = colour_image(small, &display);
    let texture = context.load_texture(format!("light {}", name.label()), image, egui::TextureOptions::LINEAR);
    let id = texture.id();
    memory.textures.insert(name.clone(), (Arc::clone(small), texture));
    id
}

/// A linear picture as egui shows it.
pub fn colour_image(picture: &Image<glam::Vec3>, display: &DisplaySettings) -> ColorImage {
    let (width, height) = (picture.width(), picture.height());
    let mut bytes = Vec::with_capacity(3 * width * height);
    for row in 0..height {
        for column in 0..width {
            bytes.extend(display.bytes(picture[(row, column)], row as u32, column as u32));
        }
    }
    ColorImage::from_rgb([width, height], &bytes)
}
