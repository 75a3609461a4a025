//! What was noticed: findings, errors, what was done. A line with a place goes there.

use super::empty;
use crate::error::{Place, Severity};
use crate::studio::model::Model;
use crate::studio::model::log::Message;
use crate::studio::model::words::capitalised;
use crate::studio::theme;
use egui::{RichText, ScrollArea, Ui};

/// Draws the list, newest first.
pub fn show(ui: &mut Ui, model: &mut Model) {
    if model.log.unread > 0 {
        model.log.unread = 0;
        // The count at the bottom was drawn before.
        ui.ctx().request_repaint();
    }
    let messages: Vec<Message> = model.log.messages().iter().rev().take(300).cloned().collect();
    if messages.is_empty() {
        return empty(ui, "No issues", "Findings of the scene check and of the fit appear here");
    }
    ui.horizontal(|ui| {
        if ui.button("Copy all").on_hover_text("Copy all messages to the clipboard").clicked() {
            let lines: Vec<String> = model.log.messages().iter().map(Message::text_to_copy).collect();
            ui.ctx().copy_text(lines.join("\n"));
        }
        if ui.button("Clear messages").on_hover_text("Remove all messages").clicked() {
            model.log.clear();
        }
    });
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        for (index, message) in messages.iter().enumerate() {
            ui.push_id(index, |ui| line(ui, model, message));
        }
    });
}

/// Draws one message.
pub fn line(ui: &mut Ui, model: &mut Model, message: &Message) {
    let colours = theme::palette(ui.visuals());
    let colour = colours.of(message.severity, ui.visuals().text_color());
    let word = match message.severity {
        Severity::Note => "Note",
        Severity::Warning => "Warning",
        Severity::Fatal => "Error",
    };
    ui.horizontal_wrapped(|ui| {
        ui.label(RichText::new(word).color(colour).small());
        if can_go(&message.place) {
            let link = ui.link(message.place.to_string()).on_hover_text("Shows this place");
            if link.clicked() {
                model.go_to(message.place.clone());
            }
            ui.label(capitalised(&message.text));
        } else {
            ui.label(message.sentence());
        }
        // What is no longer there cannot be opened, nor what was never found.
        if let Some(file) = message.file.as_ref().filter(|file| file.exists()) {
            let name =
                file.file_name().map_or_else(|| file.display().to_string(), |name| name.to_string_lossy().into());
            if ui.link(format!("Open {name}")).on_hover_text(file.display().to_string()).clicked() {
                let context = ui.ctx().clone();
                crate::studio::perform::open_file(file, &mut model.log, &context);
            }
        }
    });
    if !message.remedy.is_empty() || !message.offers.is_empty() {
        ui.horizontal_wrapped(|ui| {
            ui.add_space(18.0);
            if !message.remedy.is_empty() {
                ui.label(RichText::new(format!("Fix: {}", message.remedy)).weak());
            }
            for offer in &message.offers {
                let can = model.project.is_some();
                let button = ui.add_enabled(can, egui::Button::new(&offer.label).small());
                let button = if offer.help.is_empty() { button } else { button.on_hover_text(&offer.help) };
                if button.clicked() {
                    model.take_offer(offer);
                }
            }
        });
    }
}

/// Whether the window can show a place.
fn can_go(place: &Place) -> bool {
    matches!(place, Place::View(_) | Place::Pixel { .. } | Place::Texel { .. } | Place::Triangle(_) | Place::Setting(_))
}
