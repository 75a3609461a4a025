//! The dialog of the import: a folder, a checklist of its parts that fills itself, and what is missing with a button each.

use crate::job::capture_folder::{CaptureAxes, CaptureParts};
use crate::studio::model::importing::ImportRequest;
use crate::studio::model::words::capitalised;
use crate::studio::model::{Dialog, Model, PickFor};
use crate::studio::theme;
use egui::{Button, ComboBox, Grid, RichText, TextEdit, Ui};
use std::path::Path;

/// Draws the dialog; true once it is done with.
pub(super) fn show(ui: &mut Ui, model: &mut Model, request: &mut ImportRequest) -> bool {
    super::set_width(ui, 600.0);
    ui.heading("Import a capture");
    ui.label("A folder with photos, a mesh and calibrated cameras. What is found is filled in; the rest is chosen.");
    ui.horizontal(|ui| {
        let label = ui.label("Folder");
        let field = TextEdit::singleline(&mut request.folder).desired_width(380.0).hint_text("/home/me/captures/place");
        ui.add(field).labelled_by(label.id);
        browse(ui, model, request, PickFor::ImportFolder, "Browse…");
    });
    let parts = match request.parts() {
        Ok(Some(_)) => request.chosen.clone(),
        Ok(None) => None,
        Err(message) => {
            let colours = theme::palette(ui.visuals());
            ui.label(RichText::new(capitalised(message)).color(colours.error));
            None
        }
    };
    if let Some(parts) = &parts {
        checklist(ui, model, request, parts);
        conventions(ui, request);
    }
    if let Some(kind) = &request.is_readable {
        ui.label(format!("{kind}: it can be opened as it is."));
    }
    ui.add_space(6.0);
    let mut done = false;
    ui.horizontal(|ui| {
        let missing = parts.as_ref().map(CaptureParts::missing);
        // A folder that is read as it is may still be read otherwise: what is chosen here comes first then.
        let can_write = missing.as_ref().is_some_and(Vec::is_empty);
        let colours = theme::palette(ui.visuals());
        let button =
            Button::new(RichText::new("Write scene.toml and open").color(colours.on_accent)).fill(colours.accent);
        let button = ui.add_enabled(can_write, button);
        let why = match &missing {
            Some(missing) => format!("Missing: {}", missing.join(", ")),
            None => "Name a folder first".to_owned(),
        };
        if button.on_disabled_hover_text(why).clicked() {
            done = model.import(request);
        }
        if ui.add_enabled(request.is_readable.is_some(), Button::new("Open as it is")).clicked() {
            model.open(request.folder.trim().into());
            done = true;
        }
        done |= ui.button("Cancel").clicked();
    });
    done
}

fn checklist(ui: &mut Ui, model: &mut Model, request: &mut ImportRequest, parts: &CaptureParts) {
    let missing = parts.missing();
    let found = match (parts.photo_count, missing.is_empty()) {
        (count, true) => format!("{count} photos; nothing is missing"),
        (count, false) => format!("{count} photos; missing: {}", missing.join(", ")),
    };
    ui.label(RichText::new(found).strong());
    let name = |path: &Option<std::path::PathBuf>| path.as_deref().map(|path| inside(path, &parts.folder));
    Grid::new("import").num_columns(3).spacing([12.0, 6.0]).show(ui, |ui| {
        let photos = name(&parts.photos).map(|photos| format!("{} in {photos}", parts.photo_count));
        for (what, value, purpose, button) in [
            ("Photos", photos, PickFor::ImportPhotos, "Choose photos…"),
            ("Mesh", name(&parts.mesh), PickFor::ImportMesh, "Choose mesh…"),
            ("Cameras", name(&parts.cameras), PickFor::ImportCameras, "Choose cameras…"),
            ("Masks (optional)", name(&parts.masks), PickFor::ImportMasks, "Choose masks…"),
        ] {
            let colours = theme::palette(ui.visuals());
            ui.label(what);
            match value {
                Some(value) => ui.label(value),
                None if purpose == PickFor::ImportMasks => ui.label(RichText::new("none").weak()),
                None => ui.label(RichText::new("missing").color(colours.warning)),
            };
            browse(ui, model, request, purpose, button);
            ui.end_row();
        }
    });
}

fn conventions(ui: &mut Ui, request: &mut ImportRequest) {
    let Some(parts) = &mut request.chosen else { return };
    ui.horizontal(|ui| {
        let words = |axes| match axes {
            CaptureAxes::OpenCv => "OpenCV: y down, z forward",
            CaptureAxes::OpenGl => "OpenGL: y up, z back",
        };
        let label = ui.label("Camera axes");
        let list =
            ComboBox::from_id_salt("camera axes").width(190.0).selected_text(words(parts.axes)).show_ui(ui, |ui| {
                for axes in [CaptureAxes::OpenCv, CaptureAxes::OpenGl] {
                    ui.selectable_value(&mut parts.axes, axes, words(axes));
                }
            });
        list.response.labelled_by(label.id);
        ui.checkbox(&mut parts.world_from_camera, "Matrices are camera to world");
    });
}

/// A button that asks the system for a path and comes back to this dialog.
fn browse(ui: &mut Ui, model: &mut Model, request: &ImportRequest, purpose: PickFor, label: &str) {
    if ui.button(label).clicked() {
        model.dialog = Dialog::Import(Box::new(request.clone()));
        model.pick(purpose);
    }
}

/// A path as seen from a folder.
fn inside(path: &Path, folder: &Path) -> String {
    match path.strip_prefix(folder) {
        Ok(inside) if inside.as_os_str().is_empty() => "this folder".into(),
        Ok(inside) => inside.display().to_string(),
        Err(_) => path.display().to_string(),
    }
}
