//! What is estimated, from what: photos, shape, light, model, and start and stop.

use super::toolbar::start;
use crate::object::prior::LightPriorKind;
use crate::object::settings::LightsOf;
use crate::object::starts::ModelKind;
use crate::studio::act::Act;
use crate::studio::model::object::ObjectStatus;
use crate::studio::model::object_form::Effort;
use crate::studio::model::{Model, PickFor};
use crate::studio::panel::{act_button, act_button_named, heading};
use crate::studio::theme;
use egui::{ComboBox, DragValue, Grid, RichText, ScrollArea, TextEdit, Ui};
use std::path::PathBuf;

/// What the panel keeps: paths that are being typed.
#[derive(Default)]
pub struct SetupMemory {
    photo: String,
    mask: String,
    camera: String,
}

const MODELS: [(ModelKind, &str, &str); 4] = [
    (ModelKind::Ibrdf, "Neural (iBRDF)", "The invertible neural model, begun from all 88 materials of the library"),
    (ModelKind::CookTorrance, "Cook-Torrance", "Lambert and a lobe of Beckmann microfacets"),
    (ModelKind::Ggx, "GGX", "Lambert and a lobe of GGX microfacets"),
    (ModelKind::Ward, "Ward", "Lambert and Ward's lobe"),
];

const PRIORS: [(LightPriorKind, &str, &str); 3] = [
    (LightPriorKind::Deep, "Deep", "An untrained net: Chen, Nobuhara and Nishino 2020"),
    (LightPriorKind::Gradient, "Gradient", "Steps between neighbours are few and sparse: Lombardi and Nishino 2016"),
    (LightPriorKind::None, "None", "Nothing but a weak pull to the mean where no pixel is lit"),
];

/// Draws the panel.
pub fn show(ui: &mut Ui, model: &mut Model, memory: &mut SetupMemory) {
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        let live = model.object.status.is_live();
        run(ui, model);
        ui.add_enabled_ui(!live, |ui| {
            heading(ui, "Photos of one object");
            paths(ui, model, "Photo", PickFor::ObjectPhoto, &mut memory.photo);
            heading(ui, "Shape");
            shape(ui, model, memory);
            heading(ui, "Masks");
            ui.label(RichText::new("One per photo, or none; white is object").weak());
            paths(ui, model, "Mask", PickFor::ObjectMask, &mut memory.mask);
            heading(ui, "Environment");
            light(ui, model);
            heading(ui, "Estimation");
            settings(ui, model);
        });
        ui.add_space(6.0);
        ui.label(RichText::new("You can also drop files on the window").weak());
    });
}

/// Start and stop, and what became of it.
fn run(ui: &mut Ui, model: &mut Model) {
    let colours = theme::palette(ui.visuals());
    ui.horizontal_wrapped(|ui| match model.object.status.is_live() {
        true => {
            act_button_named(ui, model, Act::ObjectStop, "Stop estimation");
        }
        false => start(ui, model, "Start estimation"),
    });
    match &model.object.status {
        ObjectStatus::Idle => {
            ui.label(RichText::new("Estimates the environment and the reflectance of the object").weak());
        }
        ObjectStatus::Failed(why) => {
            ui.label(RichText::new(format!("Failed: {why}")).color(colours.error));
        }
        ObjectStatus::Running | ObjectStatus::Stopping => {
            ui.label(model.object.stage.as_str());
        }
        ObjectStatus::Finished | ObjectStatus::Ended => result(ui, model),
    }
}

fn result(ui: &mut Ui, model: &mut Model) {
    let colours = theme::palette(ui.visuals());
    let Some(outcome) = model.object.outcome.clone() else {
        ui.label(model.object.status.words());
        return;
    };
    let estimate = &outcome.parts.estimate;
    if model.object.status == ObjectStatus::Ended {
        ui.label(RichText::new("Ended early: this is what it had reached").color(colours.warning));
    }
    ui.label(format!("Best initialization: {}", estimate.start));
    ui.label(format!("log-RMSE {:.3}", estimate.picture_log_rmse))
        .on_hover_text("Root mean square of the logarithm of re-render over photo, over the pixels of the fit");
    match &outcome.folder {
        Some(folder) => {
            let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
            ui.label(RichText::new(format!("Written to {name}")).weak()).on_hover_text(folder.display().to_string());
        }
        None => {
            let text = "The result could not be written: it is in memory only";
            ui.label(RichText::new(text).color(colours.error));
        }
    }
    ui.horizontal_wrapped(|ui| {
        act_button(ui, model, Act::ObjectReport);
        act_button(ui, model, Act::ObjectSave);
        let is_lost = outcome.folder.is_none();
        if is_lost && ui.button("Discard result").on_hover_text("Lets another estimation start").clicked() {
            model.object.outcome = None;
        }
    });
}

/// A list of paths, with a field and a button for one more.
fn paths(ui: &mut Ui, model: &mut Model, what: &str, purpose: PickFor, typing: &mut String) {
    let list: &mut Vec<PathBuf> = match purpose {
        PickFor::ObjectMask => &mut model.edits.object.masks,
        PickFor::ObjectCamera => &mut model.edits.object.cameras,
        _ => &mut model.edits.object.photos,
    };
    let mut removed = None;
    for (index, path) in list.iter().enumerate() {
        ui.horizontal(|ui| {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let button = ui.small_button("Remove").accessible_name(format!("Remove {name}"));
            if button.clicked() {
                removed = Some(index);
            }
            ui.add(egui::Label::new(name).truncate()).on_hover_text(path.display().to_string());
        });
    }
    if let Some(index) = removed {
        list.remove(index);
    }
    ui.horizontal(|ui| {
        let width = (ui.available_width() - 128.0).max(60.0);
        let field = TextEdit::singleline(typing).desired_width(width).hint_text("path");
        let field = ui.add(field).accessible_name(format!("{what} path"));
        let entered = field.lost_focus() && ui.input(|input| input.key_pressed(egui::Key::Enter));
        let has_text = !typing.trim().is_empty();
        let add = ui.add_enabled(has_text, egui::Button::new("Add")).accessible_name(format!("Add {what}"));
        if has_text && (entered || add.clicked()) {
            model.picked(purpose, typing.trim().into());
            typing.clear();
        }
        browse(ui, model, purpose, what);
    });
}

fn browse(ui: &mut Ui, model: &mut Model, purpose: PickFor, what: &str) {
    let button = ui.button("Browse…").accessible_name(format!("Browse for {what}"));
    if button.on_hover_text("Open the system's file dialog").clicked() {
        model.pick(purpose);
    }
}

fn shape(ui: &mut Ui, model: &mut Model, memory: &mut SetupMemory) {
    let form = &mut model.edits.object;
    if !form.normals.is_empty() {
        ui.label("By normal maps, as in the result that was opened");
        let button = ui.button("Use another shape").on_hover_text("A sphere, or a mesh with its cameras");
        if button.clicked() {
            form.normals.clear();
            form.is_sphere = form.mesh.is_empty();
        }
        return;
    }
    ui.horizontal_wrapped(|ui| {
        ui.radio_value(&mut form.is_sphere, true, "A sphere")
            .on_hover_text("It fills the shorter side of the photo and is seen from infinitely far along -z");
        ui.radio_value(&mut form.is_sphere, false, "A mesh").on_hover_text("OBJ or PLY, with a camera for each photo");
    });
    if form.is_sphere {
        return;
    }
    path_field(ui, model, "Mesh", PickFor::ObjectMesh);
    ui.label(RichText::new("Cameras: one cameras.json, or one file a photo").weak());
    paths(ui, model, "Camera", PickFor::ObjectCamera, &mut memory.camera);
    ui.checkbox(&mut model.edits.object.shadows, "Shadows").on_hover_text("The object shadows itself; traced once");
}

/// A path that is typed or picked.
fn path_field(ui: &mut Ui, model: &mut Model, what: &str, purpose: PickFor) {
    ui.horizontal(|ui| {
        let text = match purpose {
            PickFor::ObjectLight => &mut model.edits.object.light,
            _ => &mut model.edits.object.mesh,
        };
        let width = (ui.available_width() - 76.0).max(60.0);
        ui.add(TextEdit::singleline(text).desired_width(width).hint_text("path"))
            .accessible_name(format!("{what} path"));
        browse(ui, model, purpose, what);
    });
}

fn light(ui: &mut Ui, model: &mut Model) {
    let form = &mut model.edits.object;
    let mut has_each = form.lights == LightsOf::Each;
    if form.photos.len() > 1 {
        ui.checkbox(&mut has_each, "An environment for each photo")
            .on_hover_text("Each photo under an environment of its own; they share the reflectance");
        form.lights = if has_each { LightsOf::Each } else { LightsOf::One };
    } else {
        has_each = false;
    }
    let is_known = !form.light.is_empty();
    ui.label(
        RichText::new(match (is_known, has_each) {
            (true, false) => "Known: only the reflectance is estimated",
            (false, false) => "Estimated; name an HDRI where it is known",
            (true, true) => "Known for the first photo: it fixes the absolute scale",
            (false, true) => "Estimated; name an HDRI where that of the first photo is known",
        })
        .weak(),
    );
    path_field(ui, model, "Known environment", PickFor::ObjectLight);
    if is_known && ui.button("Estimate the environment too").clicked() {
        model.edits.object.light.clear();
    }
}

fn settings(ui: &mut Ui, model: &mut Model) {
    let form = &mut model.edits.object;
    Grid::new("object settings").num_columns(2).spacing([10.0, 5.0]).show(ui, |ui| {
        choice(ui, "Model", &mut form.model, &MODELS);
        if form.model == ModelKind::Ibrdf {
            let label = ui.label("Lobes").on_hover_text("Lobes of the neural model, each with codes and colours");
            ui.add(DragValue::new(&mut form.lobes).range(1..=3).speed(0.02)).labelled_by(label.id);
            ui.end_row();
        }
        choice(ui, "Light prior", &mut form.prior, &PRIORS);
        let effort = form.effort;
        choice(ui, "Quality", &mut form.effort, &Effort::NAMED);
        if form.effort != effort {
            (form.light_rows, form.pixels) = (None, None);
        }
        let usual = form.effort.settings();
        let label = ui.label("Environment resolution").on_hover_text("The environment is twice as wide as high");
        let rows = form.light_rows.unwrap_or(usual.light_height);
        let list =
            ComboBox::from_id_salt("light rows").selected_text(rows.to_string()).width(130.0).show_ui(ui, |ui| {
                for rows in [16, 32, 64, 128, 180] {
                    let text = format!("{} x {rows}", 2 * rows);
                    ui.selectable_value(&mut form.light_rows, Some(rows), text);
                }
            });
        list.response.labelled_by(label.id);
        ui.end_row();
        let label = ui.label("Pixels").on_hover_text("Pixels used, spread over the photos");
        let mut pixels = form.pixels.unwrap_or(usual.pixels);
        if ui.add(DragValue::new(&mut pixels).range(16..=100_000).speed(8.0)).labelled_by(label.id).changed() {
            form.pixels = Some(pixels);
        }
        ui.end_row();
        let label = ui.label("Seed").on_hover_text("Of pixels and net: the same seed gives the same result");
        ui.add(DragValue::new(&mut form.seed).speed(0.1)).labelled_by(label.id);
        ui.end_row();
    });
}

fn choice<T: Copy + PartialEq>(ui: &mut Ui, name: &str, chosen: &mut T, all: &[(T, &str, &str)]) {
    let label = ui.label(name);
    let words = all.iter().find(|(value, ..)| value == chosen).map_or("", |(_, words, _)| words);
    let list = ComboBox::from_id_salt(name).selected_text(words).width(130.0).show_ui(ui, |ui| {
        for (value, words, help) in all {
            ui.selectable_value(chosen, *value, *words).on_hover_text(*help);
        }
    });
    list.response.labelled_by(label.id);
    ui.end_row();
}
