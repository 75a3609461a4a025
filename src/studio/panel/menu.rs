//! The menu bar, drawn from the list of acts.

use super::act_line;
use crate::studio::act::{Group, LIST};
use crate::studio::model::Model;
use egui::Ui;

/// Draws the menu bar.
pub fn show(ui: &mut Ui, model: &mut Model) {
    egui::Panel::top("menu").show(ui, |ui| {
        egui::MenuBar::new().ui(ui, |ui| {
            for (group, title) in Group::ALL {
                ui.menu_button(title, |ui| {
                    ui.set_min_width(230.0);
                    for info in LIST.iter().filter(|info| info.group == group) {
                        if act_line(ui, model, info, |button| button).clicked() {
                            model.act(info.act);
                            ui.close();
                        }
                    }
                });
            }
        });
    });
}
