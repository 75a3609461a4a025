//! The row under the menus in object mode.

use crate::studio::act::Act;
use crate::studio::act::availability::availability;
use crate::studio::model::Model;
use crate::studio::panel::{act_button_named, toolbar};
use crate::studio::theme;
use egui::{Button, ProgressBar, RichText, Ui};

/// Draws the row.
pub fn show(ui: &mut Ui, model: &mut Model) {
    egui::Panel::top("object toolbar").show(ui, |ui| {
        ui.add_space(2.0);
        ui.horizontal_wrapped(|ui| {
            match model.object.status.is_live() {
                true => {
                    act_button_named(ui, model, Act::ObjectStop, "Stop");
                }
                false => start(ui, model, "Estimate"),
            }
            act_button_named(ui, model, Act::OpenPhoto, "Add photo");
            act_button_named(ui, model, Act::ObjectReport, "Report");
            ui.separator();
            act_button_named(ui, model, Act::PreviousMaterial, "Previous material");
            act_button_named(ui, model, Act::NextMaterial, "Next material");
            ui.separator();
            toolbar::display(ui, model);
        });
        ui.add_space(2.0);
    });
}

/// The button that matters most stands out.
pub fn start(ui: &mut Ui, model: &mut Model, label: &str) {
    let available = availability(Act::ObjectStart, model);
    let colours = theme::palette(ui.visuals());
    let button = match available {
        Ok(()) => Button::new(RichText::new(label).color(colours.on_accent)).fill(colours.accent),
        Err(_) => Button::new(label),
    };
    let response = ui.add_enabled(available.is_ok(), button).on_hover_text(Act::ObjectStart.info().help);
    let response = match available {
        Ok(()) => response,
        Err(why) => response.on_disabled_hover_text(format!("Not now: {why}")),
    };
    if response.clicked() {
        model.act(Act::ObjectStart);
    }
}

/// The left of the line at the bottom: what the estimation does, and how far it is.
pub fn status(ui: &mut Ui, model: &Model) {
    let colours = theme::palette(ui.visuals());
    let object = &model.object;
    let words = RichText::new(object.status.words());
    if !object.status.is_live() {
        ui.label(words);
        return;
    }
    ui.label(words.color(colours.accent).strong());
    let round = object.rows.last().map_or(0, |row| row.round);
    let share = (round as f32 / object.rounds.max(1) as f32).min(1.0);
    ui.add(ProgressBar::new(share).desired_width(140.0)).on_hover_text("Share of the rounds that were begun");
    ui.label(match round {
        0 => object.stage.clone(),
        round => format!("{}, round {round} of {}", object.stage, object.rounds),
    });
    if let Some(row) = object.rows.last() {
        ui.label(format!("{:.0} s", row.seconds));
    }
}
