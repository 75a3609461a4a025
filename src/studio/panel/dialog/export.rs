//! The dialog of the export: formats, size, colour space, and what will be lost, before anything is written.

use crate::export::texture::TextureFormat;
use crate::insight::report::number;
use crate::job::export::Format;
use crate::studio::model::exporting::ExportRequest;
use crate::studio::model::words::capitalised;
use crate::studio::model::{Dialog, Model, PickFor};
use crate::studio::panel::heading;
use crate::studio::theme;
use egui::{Button, Checkbox, ComboBox, Grid, RichText, ScrollArea, TextEdit, Ui};

/// Widths of maps that are offered, in texels.
const SIZES: [usize; 5] = [512, 1024, 2048, 4096, 8192];

/// Draws the dialog; true once it is done with.
pub(super) fn show(ui: &mut Ui, model: &mut Model, request: &mut ExportRequest) -> bool {
    super::set_width(ui, 560.0);
    ui.heading("Export");
    heading(ui, "Formats");
    for format in Format::ALL {
        let (name, what) = words(format);
        let mut is_on = request.has(format);
        let box_ = ui.add(Checkbox::new(&mut is_on, name)).on_hover_text(what);
        if box_.changed() {
            request.set(format, is_on);
        }
    }
    ui.add_space(6.0);
    Grid::new("export").num_columns(2).spacing([12.0, 6.0]).show(ui, |ui| {
        let label = ui.label("Map size");
        let told = |size: Option<usize>| size.map_or("As fitted".into(), |size| format!("{size} x {size}"));
        let list = ComboBox::from_id_salt("export size").selected_text(told(request.options.size)).show_ui(ui, |ui| {
            for size in [None].into_iter().chain(SIZES.map(Some)) {
                ui.selectable_value(&mut request.options.size, size, told(size));
            }
        });
        list.response.labelled_by(label.id).on_hover_text("Larger maps hold no more than was fitted");
        ui.end_row();
        let label = ui.label("Texture files and colour space");
        let chosen = textures(request.options.textures);
        let list = ComboBox::from_id_salt("export textures").selected_text(chosen).width(260.0).show_ui(ui, |ui| {
            for own in [TextureFormat::Png8, TextureFormat::Png16, TextureFormat::Tiff, TextureFormat::Exr] {
                ui.selectable_value(&mut request.options.textures, own, textures(own));
            }
        });
        list.response.labelled_by(label.id).on_hover_text(
            "Colours with the sRGB curve or linear; roughness and metalness never carry a curve. Roughness is written as \
             perceptual roughness, the square root of the GGX width; GLB and USD take PNG of 8 or 16 bits",
        );
        ui.end_row();
        ui.label("Cameras");
        ui.checkbox(&mut request.options.cameras, "Write cameras.json")
            .on_hover_text("The cameras of the photos; the page then shows some photos to compare with");
        ui.end_row();
        let label = ui.label("Export folder");
        ui.add(TextEdit::singleline(&mut request.output).desired_width(330.0))
            .labelled_by(label.id)
            .on_hover_text("Each format gets a folder of its name; an earlier export there is replaced");
        ui.end_row();
    });
    heading(ui, "What will be lost");
    let can_go = ahead(ui, request);
    ui.add_space(6.0);
    let mut done = false;
    ui.horizontal(|ui| {
        let colours = theme::palette(ui.visuals());
        let button = Button::new(RichText::new("Export").color(colours.on_accent)).fill(colours.accent);
        if ui.add_enabled(can_go && !request.output.trim().is_empty(), button).clicked() {
            model.export(request);
            done = true;
        }
        if ui.button("Browse…").on_hover_text("Open the system's file dialog").clicked() {
            model.dialog = Dialog::Export(Box::new(request.clone()));
            model.pick(PickFor::ExportFolder);
        }
        done |= ui.button("Cancel").clicked();
    });
    done
}

/// What the export will take and lose; whether it can be written so.
fn ahead(ui: &mut Ui, request: &mut ExportRequest) -> bool {
    let forecast = match request.ahead() {
        Ok(forecast) => forecast,
        Err(refusal) => {
            let colours = theme::palette(ui.visuals());
            ui.label(RichText::new(capitalised(&refusal.message)).color(colours.error));
            if !refusal.remedy.is_empty() {
                ui.label(format!("Fix: {}", capitalised(&refusal.remedy)));
            }
            return false;
        }
    };
    ScrollArea::vertical().max_height(150.0).auto_shrink([false, true]).show(ui, |ui| {
        if forecast.losses.is_empty() {
            ui.label("Nothing: without a specular lobe every format holds the maps as they are");
        }
        let mut last = None;
        for (format, sentence) in &forecast.losses {
            if last != Some(*format) {
                ui.label(RichText::new(words(*format).0).strong());
                last = Some(*format);
            }
            ui.label(format!("• {}", capitalised(sentence)));
        }
        for finding in &forecast.findings {
            let colours = theme::palette(ui.visuals());
            ui.label(RichText::new(capitalised(&finding.message)).color(colours.warning));
        }
    });
    let (width, height) = forecast.texels;
    let (disk, memory) = (number::memory(forecast.largest_disk_bytes), number::memory(forecast.peak_bytes));
    ui.label(
        RichText::new(format!("Maps of {width} x {height} texels · at most {disk} on disk · {memory} of memory"))
            .weak(),
    );
    true
}

fn textures(format: TextureFormat) -> &'static str {
    match format {
        TextureFormat::Png8 => "PNG, 8 bits, sRGB",
        TextureFormat::Png16 => "PNG, 16 bits, sRGB",
        TextureFormat::Tiff => "TIFF, 16 bits, sRGB",
        TextureFormat::Exr => "OpenEXR, 32-bit floats, linear",
    }
}

/// Name of a format on screen, and what it is for.
fn words(format: Format) -> (&'static str, &'static str) {
    match format {
        Format::Glb => ("GLB (glTF 2.0)", "One file for viewers, engines and Blender; KHR_materials_specular and _ior"),
        Format::Usd => ("USD", "A stage and a package with UsdPreviewSurface and a dome light"),
        Format::Mitsuba => ("Mitsuba 3", "A scene, and a plugin of the fitted lobe that loses nothing"),
        Format::Blender => ("Blender script", "Builds mesh, Principled BSDF and world in Blender 4.2 to 5"),
        Format::Materialx => ("MaterialX (OpenPBR)", "A material over EXR maps"),
        Format::Textures => ("Texture set", "Maps alone, named as artists name them"),
        Format::Web => ("Web page", "One HTML file to send: opens in any browser, without a network"),
    }
}
