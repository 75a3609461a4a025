//! The row under the menus: run controls, layers, light and display, always at hand.

use super::{act_button_named, act_switch};
use crate::image::display::ToneCurve;
use crate::studio::act::Act;
use crate::studio::model::edits::PhotoLook;
use crate::studio::model::{Model, Phase};
use crate::studio::stage::Layer;
use crate::studio::theme;
use egui::{Button, ComboBox, DragValue, Slider, Ui};

/// Draws the row.
pub fn show(ui: &mut Ui, model: &mut Model) {
    egui::Panel::top("toolbar").show(ui, |ui| {
        ui.add_space(2.0);
        ui.horizontal_wrapped(|ui| {
            run(ui, model);
            ui.separator();
            layers(ui, model);
            ui.separator();
            act_switch(ui, model, Act::Traced, "Path traced", model.switches.traced);
            act_switch(ui, model, Act::Frustums, "Cameras", model.switches.frustums);
            act_switch(ui, model, Act::LookThrough, "Camera view", model.switches.looking_through);
            if model.switches.looking_through {
                photo(ui, model);
            }
            ui.separator();
            display(ui, model);
        });
        ui.add_space(2.0);
    });
}

fn run(ui: &mut Ui, model: &mut Model) {
    match model.phase() {
        Phase::Fitting => {
            act_button_named(ui, model, Act::PauseOrGoOn, "Pause");
            act_button_named(ui, model, Act::Stop, "Stop");
        }
        Phase::Paused => {
            act_button_named(ui, model, Act::PauseOrGoOn, "Resume");
            act_button_named(ui, model, Act::StepOnce, "Step");
            act_button_named(ui, model, Act::Stop, "Stop");
        }
        Phase::Pausing => {
            act_button_named(ui, model, Act::PauseOrGoOn, "Resume");
            act_button_named(ui, model, Act::Stop, "Stop");
        }
        Phase::Stopping | Phase::Finishing(_) => {
            act_button_named(ui, model, Act::Stop, "Stop");
        }
        Phase::Queued => {
            act_button_named(ui, model, Act::Stop, "Cancel start");
        }
        Phase::Closed
        | Phase::Opening
        | Phase::Preparing
        | Phase::Unprepared
        | Phase::Ready
        | Phase::Starting
        | Phase::Finished
        | Phase::Stopped
        | Phase::Failed(_) => start(ui, model),
    }
}

/// The button that matters most stands out.
fn start(ui: &mut Ui, model: &mut Model) {
    let available = crate::studio::act::availability::availability(Act::Start, model);
    let colours = theme::palette(ui.visuals());
    let label = if model.can_resume() { "Resume" } else { "Start" };
    let button = match available {
        Ok(()) => Button::new(egui::RichText::new(label).color(colours.on_accent)).fill(colours.accent),
        Err(_) => Button::new(label),
    };
    let response = ui.add_enabled(available.is_ok(), button).on_hover_text(Act::Start.info().help);
    let response = match available {
        Ok(()) => response,
        Err(why) => response.on_disabled_hover_text(format!("Not now: {why}")),
    };
    if response.clicked() {
        model.act(Act::Start);
    }
}

fn layers(ui: &mut Ui, model: &mut Model) {
    act_switch(ui, model, Act::LayerPhotos, "Projected", model.edits.layer == Layer::Photos);
    for (act, layer) in [
        (Act::LayerLit, Layer::Lit),
        (Act::LayerDiffuse, Layer::Diffuse),
        (Act::LayerSpecular, Layer::Specular),
        (Act::LayerRoughness, Layer::Roughness),
        (Act::LayerNormal, Layer::Normal),
    ] {
        act_switch(ui, model, act, act.name(), model.edits.layer == layer);
    }
    let further = [
        (Act::LayerPhotoError, Layer::PhotoError),
        (Act::LayerTimesSeen, Layer::TimesSeen),
        (Act::LayerCoverage, Layer::Coverage),
        (Act::LayerDisagreement, Layer::Disagreement),
        (Act::LayerDiffuseDeviation, Layer::DiffuseDeviation),
        (Act::LayerSpecularDeviation, Layer::SpecularDeviation),
        (Act::LayerRoughnessDeviation, Layer::RoughnessDeviation),
        (Act::LayerLobeSharing, Layer::LobeSharing),
        (Act::LayerChoice, Layer::Choice),
    ];
    act_switch(ui, model, Act::LayerCrossfade, "Crossfade", model.edits.layer == Layer::Crossfade);
    if model.edits.layer == Layer::Crossfade {
        ui.add(Slider::new(&mut model.edits.crossfade, 0.0..=2.0).show_value(false))
            .accessible_name("Photo – albedo – relit")
            .on_hover_text(
                "Projected photos at the left, diffuse reflectance in the middle, relit surface at the right",
            );
    }
    let chosen = further.iter().find(|(_, layer)| *layer == model.edits.layer);
    let text = chosen.map_or("Diagnostics", |(act, _)| act.name());
    let mut menu = Button::new(text);
    if chosen.is_some() {
        menu = menu.selected(true);
    }
    egui::containers::menu::MenuButton::from_button(menu).ui(ui, |ui| {
        for (act, layer) in further {
            act_switch(ui, model, act, act.name(), model.edits.layer == layer);
        }
    });
}

/// How the photo lies against the stage while one looks through its camera.
fn photo(ui: &mut Ui, model: &mut Model) {
    let look = &mut model.edits.photo;
    let name = match look {
        PhotoLook::Off => "Off",
        PhotoLook::Under => "Backdrop",
        PhotoLook::Over(_) => "Overlay",
        PhotoLook::Wipe(_) => "Wipe",
    };
    ComboBox::from_id_salt("photo look").selected_text(name).width(96.0).show_ui(ui, |ui| {
        ui.selectable_value(look, PhotoLook::Off, "Off");
        ui.selectable_value(look, PhotoLook::Under, "Backdrop")
            .on_hover_text("Behind the surface, in place of the background");
        let over = matches!(look, PhotoLook::Over(_));
        if ui.selectable_label(over, "Overlay").clicked() && !over {
            *look = PhotoLook::Over(0.5);
        }
        let wiped = matches!(look, PhotoLook::Wipe(_));
        if ui.selectable_label(wiped, "Wipe").clicked() && !wiped {
            *look = PhotoLook::Wipe(0.5);
        }
    });
    if let PhotoLook::Over(opacity) = look {
        ui.add(DragValue::new(opacity).speed(0.01).range(0.0..=1.0).max_decimals(2))
            .on_hover_text("Opacity of the photo");
    }
}

/// Exposure, tone curve and marks.
pub(super) fn display(ui: &mut Ui, model: &mut Model) {
    ui.label("Exposure");
    let stops = &mut model.edits.display.exposure_stops;
    ui.add(DragValue::new(stops).speed(0.05).range(-20.0..=20.0).max_decimals(2).suffix(" EV"))
        // A setting of the fit is called exposure too.
        .accessible_name("Display exposure")
        .on_hover_text("Scale the image by two to this power\nKeys: E and Shift+E");
    let curve = &mut model.edits.display.curve;
    let name = ToneCurve::NAMED.iter().find(|(own, _)| own == curve).map_or("", |(_, name)| name);
    let list = ComboBox::from_id_salt("tone curve").selected_text(name).width(80.0).show_ui(ui, |ui| {
        for (own, name) in ToneCurve::NAMED {
            ui.selectable_value(curve, own, name);
        }
    });
    list.response.accessible_name("Tone curve").on_hover_text("Tone mapping\nKey: K");
    act_switch(ui, model, Act::FalseColour, "False colour", model.edits.display.false_colour);
    act_switch(ui, model, Act::Stripes, "Zebra", model.edits.display.stripes);
}
