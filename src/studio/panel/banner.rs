//! An error across the window: a sentence and a remedy, until it is dismissed.

use crate::studio::model::Model;
use crate::studio::model::words::capitalised;
use crate::studio::theme;
use egui::{Align2, Area, Context, Frame, Id, Order, RichText, Stroke, vec2};

/// Draws the banner, if there is an error.
pub fn show(context: &Context, model: &mut Model) {
    let Some(message) = model.log.banner().cloned() else { return };
    let colours = theme::palette(&context.global_style().visuals);
    let mut dismissed = false;
    Area::new(Id::unique("banner")).order(Order::Foreground).anchor(Align2::CENTER_TOP, vec2(0.0, 64.0)).show(
        context,
        |ui| {
            Frame::popup(ui.style()).stroke(Stroke::new(1.5, colours.error)).inner_margin(12.0).show(ui, |ui| {
                ui.set_max_width(620.0f32.min(ui.ctx().content_rect().width() - 40.0));
                ui.label(RichText::new(message.sentence()).color(colours.error).strong());
                if !message.remedy.is_empty() {
                    ui.label(format!("Fix: {}", capitalised(&message.remedy)));
                }
                ui.add_space(4.0);
                ui.horizontal(|ui| {
                    dismissed = ui.button("Dismiss").on_hover_text("Key: Esc").clicked();
                    if ui.button("Copy").on_hover_text("Copy the message to the clipboard").clicked() {
                        ui.ctx().copy_text(message.text_to_copy());
                    }
                });
            });
        },
    );
    if dismissed {
        model.log.dismiss();
    }
}
