//! The first page: open, recents, the demo, and what a scene folder must hold.

use crate::image::file;
use crate::studio::act::Act;
use crate::studio::model::store::Recent;
use crate::studio::model::tasks::TaskKind;
use crate::studio::model::{Model, PickFor};
use crate::studio::theme;
use egui::{
    Align, Align2, Button, Color32, Context, Frame, Id, LayerId, Layout, Order, RichText, ScrollArea, TextStyle,
    TextureHandle, Ui, vec2,
};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Room for the small picture of what was opened before, in points.
const RECENT_PICTURE: egui::Vec2 = vec2(48.0, 32.0);

/// What the page keeps.
#[derive(Default)]
pub struct WelcomeMemory {
    path: String,
    /// Whether anything had the keys when the page was drawn last.
    had_focus: bool,
    /// Small pictures of what was opened before.
    pictures: HashMap<PathBuf, TextureHandle>,
}

impl WelcomeMemory {
    /// The small picture of a path, read once it is there.
    fn picture(&mut self, context: &Context, model: &Model, path: &Path) -> Option<TextureHandle> {
        if let Some(known) = self.pictures.get(path) {
            return Some(known.clone());
        }
        let own = model.store.thumbnail_path(path).filter(|own| own.is_file())?;
        let bytes = file::read_srgb8(&own).ok()?;
        let image = egui::ColorImage::from_rgb([bytes.width(), bytes.height()], bytes.pixels().as_flattened());
        let texture = context.load_texture(path.to_string_lossy(), image, egui::TextureOptions::LINEAR);
        self.pictures.insert(path.into(), texture.clone());
        Some(texture)
    }
}

/// What a scene folder may be, with what it must hold.
const KINDS: [(&str, &str); 5] = [
    (
        "A BlendedMVS scene",
        "cams/ with 00000000_cam.txt …, blended_images/ with the photos, textured_mesh/ or mesh.obj; blended masks if there are any",
    ),
    ("An exchange folder", "scene.json with cameras, mesh.obj, views/ with EXR or PNG pictures"),
    ("Your own photos", "scene.toml that names a mesh (OBJ or PLY), a list of photos and their calibrated cameras"),
    (
        "A run of Patina",
        "the results of a fit: maps, environment, report, checkpoint; an unfinished one can be resumed",
    ),
    (
        "One photo of an object",
        "a sphere, or a mesh with its camera; estimates the environment and a measured reflectance",
    ),
];

/// Draws the page.
pub fn show(ui: &mut Ui, model: &mut Model, memory: &mut super::Memory) {
    let memory = &mut memory.welcome;
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        let width = ui.available_width().min(760.0);
        let margin = ((ui.available_width() - width) / 2.0).max(0.0);
        ui.add_space((ui.available_height() * 0.08).min(70.0));
        ui.horizontal(|ui| {
            ui.add_space(margin);
            ui.allocate_ui_with_layout(vec2(width, 0.0), Layout::top_down(Align::Min), |ui| page(ui, model, memory));
        });
    });
    memory.had_focus = ui.memory(|memory| memory.focused().is_some());
}

fn page(ui: &mut Ui, model: &mut Model, memory: &mut WelcomeMemory) {
    let colours = theme::palette(ui.visuals());
    ui.label(RichText::new("Patina").size(40.0).color(colours.accent).strong());
    ui.label(RichText::new("From calibrated photos to relightable materials").size(16.0));
    ui.add_space(20.0);
    interrupted(ui, model);
    ui.horizontal_wrapped(|ui| {
        let demo = Button::new(RichText::new("Open the built-in demo").size(16.0).color(colours.on_accent))
            .fill(colours.accent)
            .min_size(vec2(230.0, 40.0));
        let demo = ui.add(demo).on_hover_text("A small scene with known materials; needs no data");
        // The first stop of Tab is what most people want first, not the menus above it.
        if !memory.had_focus && ui.input(|input| input.key_pressed(egui::Key::Tab)) {
            demo.request_focus();
        }
        if demo.clicked() {
            model.act(Act::OpenDemo);
        }
        let open = Button::new(RichText::new("Open a folder…").size(16.0)).min_size(vec2(190.0, 40.0));
        if ui.add(open).on_hover_text("A scene folder or a run folder").clicked() {
            model.pick(PickFor::Open);
        }
        let import = Button::new(RichText::new("Import…").size(16.0)).min_size(vec2(110.0, 40.0));
        if ui.add(import).on_hover_text(Act::Import.info().help).clicked() {
            model.act(Act::Import);
        }
        ui.label(RichText::new("or drop one here").weak());
    });
    ui.add_space(6.0);
    ui.horizontal_wrapped(|ui| {
        let object = Button::new(RichText::new("Single object…").size(16.0)).min_size(vec2(230.0, 40.0));
        if ui.add(object).on_hover_text(Act::ObjectWorkspace.info().help).clicked() {
            model.act(Act::ObjectWorkspace);
        }
        let materials = Button::new(RichText::new("Material library").size(16.0)).min_size(vec2(190.0, 40.0));
        if ui.add(materials).on_hover_text(Act::PanelMaterials.info().help).clicked() {
            model.act(Act::PanelMaterials);
        }
    });
    ui.add_space(8.0);
    ui.horizontal(|ui| {
        let label = ui.label("Path");
        let field = ui
            .add(
                egui::TextEdit::singleline(&mut memory.path)
                    .desired_width(430.0f32.min(ui.available_width() - 120.0))
                    .hint_text("/home/me/scenes/place"),
            )
            .labelled_by(label.id);
        let entered = field.lost_focus() && ui.input(|input| input.key_pressed(egui::Key::Enter));
        let clicked = ui.add_enabled(!memory.path.trim().is_empty(), Button::new("Open path")).clicked();
        if (entered || clicked) && !memory.path.trim().is_empty() {
            model.open(memory.path.trim().into());
        }
    });
    opening(ui, model);
    ui.add_space(18.0);
    recents(ui, model, memory);
    ui.add_space(12.0);
    ui.label(RichText::new("What can be opened").strong());
    egui::Grid::new("kinds").num_columns(2).spacing([16.0, 6.0]).show(ui, |ui| {
        for (kind, holds) in KINDS {
            ui.label(kind);
            ui.add(egui::Label::new(RichText::new(holds).weak()).wrap());
            ui.end_row();
        }
    });
    findings(ui, model);
}

/// A run that was in progress when the program ended without a word.
fn interrupted(ui: &mut Ui, model: &mut Model) {
    let Some(run) = model.interrupted_run.clone() else { return };
    let colours = theme::palette(ui.visuals());
    Frame::group(ui.style()).stroke(egui::Stroke::new(1.0, colours.warning)).show(ui, |ui| {
        ui.label(RichText::new("Patina quit unexpectedly during a fit").color(colours.warning).strong());
        ui.label(format!("A valid checkpoint was found: {}", run.display()));
        ui.horizontal(|ui| {
            if ui.button("Resume").clicked() {
                model.interrupted_run = None;
                model.open(run.clone());
            }
            if ui.button("Dismiss").on_hover_text("The run stays on disk and can be opened later").clicked() {
                model.interrupted_run = None;
                model.preferences.remember(&run, true);
            }
        });
    });
    ui.add_space(12.0);
}

/// How far the scene is that is being opened.
fn opening(ui: &mut Ui, model: &mut Model) {
    let progress = model.tasks.progress();
    let Some((_, what, share)) = progress.iter().find(|(kind, ..)| *kind == TaskKind::Opening) else { return };
    ui.add_space(14.0);
    Frame::group(ui.style()).inner_margin(12.0).show(ui, |ui| {
        ui.label(RichText::new("Opening").strong());
        ui.label(crate::studio::model::words::capitalised(what));
        ui.add(egui::ProgressBar::new(*share).desired_width(420.0f32.min(ui.available_width())).show_percentage());
    });
}

fn recents(ui: &mut Ui, model: &mut Model, memory: &mut WelcomeMemory) {
    ui.label(RichText::new("Recent").strong());
    if model.preferences.recents.is_empty() {
        ui.label(RichText::new("No recent files").weak());
        return;
    }
    let recents: Vec<Recent> = model.preferences.recents.clone();
    for recent in recents {
        let name = recent.path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let is_there = recent.path.exists();
        let picture = memory.picture(ui.ctx(), model, &recent.path);
        ui.horizontal(|ui| {
            let (place, _) = ui.allocate_exact_size(RECENT_PICTURE, egui::Sense::hover());
            if let Some(picture) = &picture {
                let size = picture.size_vec2();
                let own = egui::Rect::from_center_size(place.center(), size * (place.size() / size).min_elem());
                egui::Image::new((picture.id(), own.size())).paint_at(ui, own);
            }
            let link = ui.add_enabled(is_there, Button::new(&name).frame(false));
            let link = link.on_hover_text(recent.path.display().to_string());
            if link.on_disabled_hover_text("No longer there").clicked() {
                model.open(recent.path.clone());
            }
            ui.label(RichText::new(if recent.is_run { "run" } else { "scene" }).weak());
            let folder = recent.path.parent().map_or_else(String::new, |folder| folder.display().to_string());
            ui.label(RichText::new(folder).weak().small());
            if !is_there && ui.small_button("Remove from list").clicked() {
                model.preferences.recents.retain(|other| *other != recent);
            }
        });
    }
}

/// What was noticed when a folder could not be opened.
fn findings(ui: &mut Ui, model: &mut Model) {
    let messages: Vec<_> = model.log.messages().iter().rev().take(8).cloned().collect();
    if messages.iter().all(|message| message.severity == crate::Severity::Note) {
        return;
    }
    ui.add_space(12.0);
    ui.label(RichText::new("Issues").strong());
    for (index, message) in messages.iter().enumerate() {
        ui.push_id(index, |ui| super::messages::line(ui, model, message));
    }
}

/// A veil over the window while something is dragged over it.
pub fn drop_hint(context: &Context) {
    let hovers = context.input(|input| !input.raw.hovered_files.is_empty());
    if !hovers {
        return;
    }
    let painter = context.layer_painter(LayerId::new(Order::Foreground, Id::unique("drop hint")));
    let area = context.content_rect();
    painter.rect_filled(area, 0.0, Color32::from_black_alpha(170));
    let text =
        "Drop a scene or run folder to open it, an HDRI to import it; for a single object: photos, masks, mesh, camera";
    let font = TextStyle::Heading.resolve(&context.global_style());
    painter.text(area.center(), Align2::CENTER_CENTER, text, font, Color32::WHITE);
}
