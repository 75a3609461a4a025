//! The shelf of lights: swap, turn, strengthen, two side by side.

use super::{act_button, act_switch, heading};
use crate::image::display::DisplaySettings;
use crate::image::{Image, RgbImage};
use crate::light::day::Day;
use crate::studio::act::Act;
use crate::studio::model::Model;
use crate::studio::model::lights::{LightName, ShelfLight};
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
    /// What is typed to find an environment.
    sought: String,
}

/// So many environments are found by looking.
const FEW_LIGHTS: usize = 8;

/// Draws the panel.
pub fn show(ui: &mut Ui, model: &mut Model, memory: &mut RelightMemory) {
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        controls(ui, model);
        day(ui, model);
        heading(ui, "Environments");
        shelf(ui, model, memory);
        ui.horizontal_wrapped(|ui| {
            act_button(ui, model, Act::AddLight);
            act_button(ui, model, Act::AddLightFolder);
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
        ui.add_enabled(on, egui::Checkbox::new(&mut model.edits.relight.is_background_blurred, "Blurred"))
            .on_hover_text("Show the background out of focus; it lights the surface as before");
        ui.checkbox(&mut model.edits.relight.ground, "Ground plane")
            .on_hover_text("Show the shadow of the object on a level ground; path-traced images only");
        ui.checkbox(&mut model.edits.relight.balls, "Reference balls")
            .on_hover_text("Show a chrome ball and a grey one in this environment");
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

/// Hour, latitude and day of the sky that is made of them.
fn day(ui: &mut Ui, model: &mut Model) {
    let relight = &mut model.edits.relight;
    if relight.first != LightName::Day && relight.second != Some(LightName::Day) {
        return;
    }
    let day = &mut relight.day;
    egui::Grid::new("day").num_columns(2).spacing([10.0, 5.0]).show(ui, |ui| {
        let (rise, set) = day.daylight().unwrap_or((12.0, 12.0));
        day.hour = day.hour.clamp(rise, set);
        let label = ui.label("Hour");
        ui.add(Slider::new(&mut day.hour, rise..=set).custom_formatter(|hour, _| clock(hour)).custom_parser(hour_of))
            .labelled_by(label.id)
            .on_hover_text("Solar time: the sun is highest at 12:00");
        ui.end_row();
        let label = ui.label("Latitude");
        ui.add(Slider::new(&mut day.latitude_degrees, -66.0..=66.0).suffix("°").fixed_decimals(0))
            .labelled_by(label.id)
            .on_hover_text("Degrees north of the equator");
        ui.end_row();
        let label = ui.label("Day of the year");
        ui.add(Slider::new(&mut day.day_of_year, 1..=365))
            .labelled_by(label.id)
            .on_hover_text("1 is the first of January, 172 the longest day of the north");
        ui.end_row();
        let label = ui.label("Haze");
        ui.add(Slider::new(&mut day.haze, 2.0..=10.0).fixed_decimals(1))
            .labelled_by(label.id)
            .on_hover_text("Turbidity of the air: 2 is very clear, 10 is thick haze");
        ui.end_row();
    });
}

fn clock(hour: f64) -> String {
    Day { hour: hour as f32, ..Day::default() }.clock()
}

fn hour_of(text: &str) -> Option<f64> {
    Day::of_name(&format!("{}@0", text.trim())).map(|day| f64::from(day.hour))
}

fn shelf(ui: &mut Ui, model: &mut Model, memory: &mut RelightMemory) {
    let mut lights = model.shelf.lights().to_vec();
    memory.textures.retain(|name, _| lights.iter().any(|light| light.name == *name));
    if lights.len() > FEW_LIGHTS || !memory.sought.is_empty() {
        ui.horizontal(|ui| {
            let label = ui.label("Find an environment");
            ui.text_edit_singleline(&mut memory.sought).labelled_by(label.id);
        });
        let sought = memory.sought.trim().to_lowercase();
        lights.retain(|light| light.name.label().to_lowercase().contains(&sought));
        if lights.is_empty() {
            ui.label(RichText::new("No matching environment").weak());
        }
    }
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
                        model.choose_light(light.name.clone());
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
    let title = ui.label(RichText::new("Lighting contact sheet").strong());
    let display = model.edits.display;
    let known = memory.strip.len() == pictures.len()
        && memory
            .strip
            .iter()
            .zip(&pictures)
            .all(|((own, shown, _), (_, other))| Arc::ptr_eq(own, other) && *shown == display);
    if !known {
        // It was asked for: what lies below the end of the panel would not be found.
        title.scroll_to_me(Some(egui::Align::TOP));
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
                model.choose_light(name.clone());
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
        LightName::Day => "The sky of an hour and a latitude, which are set above once it is chosen".into(),
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
